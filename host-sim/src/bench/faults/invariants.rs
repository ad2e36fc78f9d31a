//! What must hold on every tick, whatever is injected.

use firmware::contract::{PaddleCommand, Table};
use firmware::{Faults, Inputs, Mode, Settings, State};
use nalgebra::SVector;

use crate::world::truth::from_frame;

/// Rounding of one addition, relative.
const ROUNDING: f64 = 1e-9;
/// Violations that are kept in words.
const KEPT: usize = 5;

/// Checks from outside of the controller.
#[derive(Clone, Debug)]
pub struct Invariants<const P: usize = 1> {
    /// Largest displacement and step of each paddle, length.
    limits: [(f64, f64); P],
    last: Option<PaddleCommand>,
    /// Number and time of the last tick that went forward.
    forward: Option<(u64, u64)>,
    /// SAFE has been seen and nobody has re-armed since.
    latched: bool,
    violations: Vec<String>,
    count: u64,
}

impl<const P: usize> Invariants<P> {
    /// Limits of this table and these settings.
    pub fn new<const D: usize, const N: usize>(table: &Table<f64, D, N, P>, settings: &Settings) -> Self {
        let period_s = settings.loop_period_ns as f64 * 1e-9;
        Self {
            limits: table.paddles.each_ref().map(|paddle| (paddle.max_displacement, paddle.max_rate * period_s)),
            last: None,
            forward: None,
            latched: false,
            violations: Vec::new(),
            count: 0,
        }
    }

    /// What did not hold, in words; the first few.
    pub fn violations(&self) -> &[String] {
        &self.violations
    }

    /// How often something did not hold.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The next command starts from the measured position.
    pub fn rearm(&mut self) {
        self.latched = false;
        // The measured position may be anywhere: the step to it is not a motion.
        self.last = self.last.map(|last| PaddleCommand { flags: 0, ..last });
    }

    /// Whether the tick's number or time does not go on from the last one that did.
    pub fn is_backwards(&self, inputs: &Inputs) -> bool {
        self.forward.is_some_and(|(tick, time_ns)| inputs.tick <= tick || inputs.time_ns <= time_ns)
    }

    /// The schedule agrees with arithmetic of its own: next whole period after the end of the step.
    pub fn check_release(&mut self, scheduled_ns: u64, expected_ns: u64) {
        if scheduled_ns != expected_ns {
            self.fail(|| format!("next release at {scheduled_ns} ns instead of {expected_ns} ns"));
        }
    }

    fn fail(&mut self, what: impl FnOnce() -> String) {
        self.count += 1;
        if self.violations.len() < KEPT {
            self.violations.push(what());
        }
    }

    fn require(&mut self, holds: bool, inputs: &Inputs, what: &str) {
        if !holds {
            self.fail(|| format!("tick {}: {what}", inputs.tick));
        }
    }

    /// Checks one tick of the controller.
    pub fn check<const D: usize, const N: usize>(
        &mut self,
        before: &State<f64, D, N, P>,
        after: &State<f64, D, N, P>,
        inputs: &Inputs,
        command: &PaddleCommand,
    ) {
        let faults = Faults::from_bits(command.faults);
        let displacements: [SVector<f64, D>; P] = positions(command);
        let backwards = self.is_backwards(inputs);
        self.forward = Some(match self.forward {
            Some((tick, time_ns)) if backwards => (tick.max(inputs.tick), time_ns),
            _ => (inputs.tick, inputs.time_ns),
        });
        let finite = displacements.iter().flatten().all(|component| component.is_finite());
        self.require(finite, inputs, "command not finite");
        let within =
            |(displacement, (most, _)): (&SVector<f64, D>, &(f64, f64))| displacement.norm() <= most * (1.0 + ROUNDING);
        let within = displacements.iter().zip(&self.limits).all(within);
        self.require(within, inputs, "command beyond the position limit");
        self.check_transition(inputs, command, &displacements);
        let mode = Mode::from_wire(command.state);
        let has = |codes: Faults| !faults.intersection(codes).is_empty();
        let expected = if has(Faults::LATCHING) {
            Mode::Safe
        } else if has(Faults::HOLDING) {
            Mode::Hold
        } else {
            Mode::Run
        };
        self.require(mode == Some(expected), inputs, "mode does not follow from the fault codes");
        self.require(!self.latched || mode == Some(Mode::Safe), inputs, "SAFE left without re-arming");
        self.latched = mode == Some(Mode::Safe);
        let reversed = faults.contains(Faults::CLOCK_REVERSED);
        self.require(reversed || !backwards, inputs, "a tick from the past was accepted");
        self.require(
            backwards || !reversed || was_reversed(before),
            inputs,
            "a good tick was taken for one of the past",
        );
        self.check_integral(before, after, inputs, command);
        self.last = Some(*command);
    }

    /// Against the command before.
    fn check_transition<const D: usize>(
        &mut self,
        inputs: &Inputs,
        command: &PaddleCommand,
        displacements: &[SVector<f64, D>; P],
    ) {
        let Some(last) = self.last else { return };
        let consecutive = command.sequence == last.sequence.wrapping_add(1);
        self.require(consecutive, inputs, "not exactly one command per tick");
        if !last.is_valid() {
            return;
        }
        if !command.is_valid() {
            // The position is no longer known: not adopted yet, moved by somebody else, or not following.
            let reasons = Faults::WAITING | Faults::PADDLE_MOVING | Faults::FOLLOWING_ERROR;
            let known = Faults::from_bits(command.faults).intersection(reasons).is_empty();
            self.require(!known, inputs, "a valid command was followed by an invalid one without a reason");
            return;
        }
        let before: [SVector<f64, D>; P] = positions(&last);
        let within = displacements
            .iter()
            .zip(&before)
            .zip(&self.limits)
            .all(|((now, before), (_, most))| (now - before).norm() <= most * (1.0 + ROUNDING));
        self.require(within, inputs, "command beyond the rate limit");
        // The tick that finds a reason in the law itself has moved already.
        let law = Faults::from_bits(command.faults).intersection(Faults::DIVERGENCE);
        if command.state != Mode::Run as u32 && law.is_empty() {
            let same = command.displacement.map(|place| place.map(f64::to_bits))
                == last.displacement.map(|place| place.map(f64::to_bits));
            self.require(same, inputs, "the paddle was moved in HOLD or SAFE");
        }
    }

    /// Without a sample of the target that was accepted in RUN, the integral keeps its bits.
    fn check_integral<const D: usize, const N: usize>(
        &mut self,
        before: &State<f64, D, N, P>,
        after: &State<f64, D, N, P>,
        inputs: &Inputs,
        command: &PaddleCommand,
    ) {
        let consumed = after.ledger().target.consumed > before.ledger().target.consumed;
        let bits =
            |state: &State<f64, D, N, P>| state.integral().map(|integral| integral.map(|of| of.map(f64::to_bits)));
        if let Some(old) = bits(before)
            && (!consumed || command.state == Mode::Hold as u32)
        {
            self.require(bits(after) == Some(old), inputs, "the integral changed without an accepted sample");
        }
    }
}

/// Where a command has each paddle, length.
pub fn positions<const D: usize, const P: usize>(command: &PaddleCommand) -> [SVector<f64, D>; P] {
    std::array::from_fn(|place| command.displacement.get(place).map_or_else(SVector::zeros, |of| from_frame(*of)))
}

fn was_reversed<const D: usize, const N: usize, const P: usize>(state: &State<f64, D, N, P>) -> bool {
    state.faults().contains(Faults::CLOCK_REVERSED)
}
