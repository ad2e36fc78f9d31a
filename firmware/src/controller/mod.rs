//! The control law, one tick at a time.

use crate::contract::frames::COMMAND_VALID;
use crate::contract::{Faults, Mode, NeedleSample, PaddleCommand, PaddleSample, Table, TargetSample};
use crate::inputs::Inputs;
use crate::inputs::checks::Checks;
use crate::scalar::Scalar;
use crate::settings::{AgeLimits, Runtime, Settings, SettingsError};
use crate::units::seconds;

#[cfg(test)]
pub(crate) mod plant;
mod state;
#[cfg(test)]
mod tests;

pub use state::State;
use state::{Underway, from_frame, start_tick, to_frame};

/// Planar tissue: displacements have two components.
const D: usize = 2;

/// Controller of one paddle: a table and settings, nothing that changes. See the crate documentation for the law.
#[derive(Clone, Copy, Debug)]
pub struct Controller<'t, T: Scalar> {
    table: &'t Table<T, D>,
    runtime: Runtime<T>,
}

impl<'t, T: Scalar> Controller<'t, T> {
    /// Builds the runtime form of `settings` for `table`, which [`crate::contract::decode`] has validated.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn new(table: &'t Table<T, D>, settings: &Settings) -> Result<Self, SettingsError> {
        Ok(Self { table, runtime: Runtime::new(table, settings)? })
    }

    /// Loop gain g per target sample in use.
    pub fn loop_gain(&self) -> f64 {
        self.runtime.gain.to_f64()
    }

    /// Delay d that the gain was chosen for, target samples.
    pub fn delay_samples(&self) -> u32 {
        self.runtime.delay_samples
    }

    /// One tick: reads and checks the inputs, decides the mode, and gives the command for the paddle.
    pub fn step(&self, state: &mut State<T>, inputs: &Inputs) -> PaddleCommand {
        let mut faults = Faults::NONE;
        let fresh_target =
            if start_tick(state, inputs, &mut faults) { self.read_inputs(state, inputs, &mut faults) } else { None };
        self.expire_before_arming(state);
        self.check_ages(state, &mut faults);
        let mut mode = state.supervisor.decide(faults);
        if mode == Mode::Run {
            state.armed = true;
            self.move_paddle(state, inputs, fresh_target, &mut faults);
            // The law itself may have found a reason to stop; its last command is within the limits.
            mode = state.supervisor.decide(faults);
        }
        state.mode = mode;
        state.faults = faults | state.supervisor.latched();
        state.ledger.ticks.end(mode);
        self.command(state, inputs)
    }

    /// Reads all streams. Returns a target sample that may be integrated.
    fn read_inputs(&self, state: &mut State<T>, inputs: &Inputs, faults: &mut Faults) -> Option<TargetSample> {
        if let Some(sample) = &inputs.needle {
            self.read_needle(state, inputs.time_ns, sample, faults);
        }
        if let Some(sample) = &inputs.paddle {
            self.read_paddle(state, inputs.time_ns, sample, faults);
        }
        let target = inputs.target.as_ref();
        target.and_then(|sample| self.read_target(state, inputs.time_ns, sample, faults))
    }

    fn checks(&self, now_ns: u64) -> Checks<'_, T> {
        Checks { runtime: &self.runtime, now_ns }
    }

    fn read_needle(&self, state: &mut State<T>, now_ns: u64, sample: &NeedleSample, faults: &mut Faults) {
        let before = state.needle.accepted;
        let ledger = &mut state.ledger.needle;
        let accepted = state.needle.offer(*sample, sample.sequence, ledger, faults, |previous| {
            self.checks(now_ns).needle(sample, previous, &mut state.needle_frozen)
        });
        if let (Some(now), Some(before)) = (accepted, before) {
            state.gate.travel.needle += (now.depth - before.depth).abs();
        }
    }

    fn read_target(
        &self,
        state: &mut State<T>,
        now_ns: u64,
        sample: &TargetSample,
        faults: &mut Faults,
    ) -> Option<TargetSample> {
        let ledger = &mut state.ledger.target;
        let mut found = Faults::NONE;
        let accepted = state.target.offer(*sample, sample.sequence, ledger, &mut found, |previous| {
            self.checks(now_ns).target(sample, previous, &state.gate, &mut state.target_frozen)
        });
        *faults |= found;
        state.target_lost |= found.contains(Faults::TARGET_LOST);
        if accepted.is_some() {
            state.target_lost = false;
            state.gate.accept();
        }
        accepted
    }

    fn read_paddle(&self, state: &mut State<T>, now_ns: u64, sample: &PaddleSample, faults: &mut Faults) {
        let ledger = &mut state.ledger.paddle;
        let commanded = state.displacement.as_ref().map(to_frame);
        let accepted = state.paddle.offer(*sample, sample.sequence, ledger, faults, |previous| {
            self.checks(now_ns).paddle(sample, previous, commanded.as_ref(), &mut state.paddle_frozen)
        });
        let Some(sample) = accepted else { return };
        match &state.displacement {
            Some(commanded) => {
                let age = seconds(now_ns.saturating_sub(sample.time_ns));
                let (measured, commanded) = (&sample.displacement, &to_frame(commanded));
                let off = state.following.update(&self.runtime, measured, commanded, age);
                faults.set_if(Faults::FOLLOWING_ERROR, off);
            }
            // Starting (again) must not move the paddle: the first command is where it is.
            None => {
                let measured = from_frame(&sample.displacement);
                state.displacement = Some(self.runtime.limits.clamp_position(&measured));
                // Even when everything else is there already: RUN may follow on the next tick.
                *faults |= Faults::WAITING;
            }
        }
    }

    /// Before RUN, nothing accepted long ago may stand in the way of what arrives now: a first sample that was wrong
    /// would have every right one after it refused as a jump. Once armed, the age leads to SAFE instead.
    fn expire_before_arming(&self, state: &mut State<T>) {
        let Some((_, now_ns)) = state.last_tick.filter(|_| !state.armed) else {
            return;
        };
        let expired = |time_ns: Option<u64>, limits: AgeLimits| {
            time_ns.is_some_and(|time_ns| now_ns.saturating_sub(time_ns) > limits.safe_ns)
        };
        if expired(state.needle.accepted.map(|sample| sample.time_ns), self.runtime.needle_age) {
            state.needle.accepted = None;
        }
        if expired(state.target.accepted.map(|sample| sample.time_ns), self.runtime.target_age) {
            state.target.accepted = None;
        }
        if expired(state.paddle.accepted.map(|sample| sample.time_ns), self.runtime.paddle_age) {
            state.paddle.accepted = None;
        }
    }

    /// Faults from what was accepted last: age, visibility, speed, range.
    fn check_ages(&self, state: &State<T>, faults: &mut Faults) {
        let Some((_, now_ns)) = state.last_tick else {
            return;
        };
        let runtime = &self.runtime;
        let mut check = |time_ns: Option<u64>, limits: AgeLimits, stale: Faults, dead: Faults| {
            let Some(time_ns) = time_ns else {
                *faults |= Faults::WAITING;
                return;
            };
            let age_ns = now_ns.saturating_sub(time_ns);
            faults.set_if(stale, age_ns > limits.hold_ns);
            faults.set_if(dead, state.armed && age_ns > limits.safe_ns);
        };
        let needle_time = state.needle.accepted.map(|sample| sample.time_ns);
        let target_time = state.target.accepted.map(|sample| sample.time_ns);
        let paddle_time = state.paddle.accepted.map(|sample| sample.time_ns);
        check(needle_time, runtime.needle_age, Faults::NEEDLE_STALE, Faults::NEEDLE_DEAD);
        check(target_time, runtime.target_age, Faults::TARGET_STALE, Faults::TARGET_DEAD);
        check(paddle_time, runtime.paddle_age, Faults::PADDLE_STALE, Faults::PADDLE_DEAD);
        faults.set_if(Faults::TARGET_LOST, state.target_lost);
        if let Some(needle) = &state.needle.accepted {
            let (start, end) = runtime.table_depth;
            faults.set_if(Faults::NEEDLE_TOO_FAST, needle.velocity.abs() > runtime.needle_speed);
            faults.set_if(Faults::DEPTH_CLAMPED, needle.depth < start || needle.depth > end);
        }
    }

    /// Feed-forward plus integral feedback, within the limits.
    fn move_paddle(
        &self,
        state: &mut State<T>,
        inputs: &Inputs,
        fresh_target: Option<TargetSample>,
        faults: &mut Faults,
    ) {
        let runtime = &self.runtime;
        let (Some(previous), Some(needle)) = (state.displacement, &state.needle.accepted) else {
            return;
        };
        // Where the needle will be when the command acts.
        let lead_ns = inputs.time_ns.saturating_sub(needle.time_ns).saturating_add(runtime.actuator_delay_ns);
        let depth = needle.depth + needle.velocity * seconds(lead_ns);
        let Some(location) = self.table.locate(T::of(depth)) else {
            return;
        };
        let feed_forward = location.paddle_path();
        let mut integral = state.integral.unwrap_or(previous - feed_forward);

        if let Some(sample) = fresh_target {
            let n = &self.table.orthogonal;
            let error = n.dot(&from_frame(&sample.displacement));
            let direction = runtime.direction.solve(&location.jacobian(), n);
            let change = -runtime.gain * error;
            let correction = direction.map(|component| component * change);
            // Measured while the paddle was on its way at full rate: what is asked for once more may be there already.
            let repeats = state.underway.is_some_and(|underway| underway.explains(sample.time_ns, &correction));
            let corrected = if repeats {
                integral
            } else {
                runtime.limits.integrate(&integral, &correction, &feed_forward, &previous)
            };
            // A correction that saturation swallows proves nothing about the sign of the plant.
            let taken = (corrected - integral).dot(&correction);
            let acted = taken > correction.norm_squared() * T::of(0.5);
            integral = corrected;
            if acted {
                let diverges = state.divergence.update(runtime, error.to_f64(), needle.velocity);
                faults.set_if(Faults::DIVERGENCE, diverges);
            }
        }

        let limited = runtime.limits.command(&previous, &(feed_forward + integral));
        if !to_frame(&limited.displacement).iter().all(|component| component.is_finite()) {
            *faults |= Faults::INTERNAL;
            return;
        }
        faults.set_if(Faults::POSITION_LIMITED, limited.position_limited);
        faults.set_if(Faults::RATE_LIMITED, limited.rate_limited);
        if limited.rate_limited {
            let there_ns =
                inputs.time_ns.saturating_add(runtime.loop_period_ns).saturating_add(runtime.actuator_delay_ns);
            // One motion as long as no tick is without it.
            let since_ns = match state.underway {
                Some(before) if before.until_ns >= inputs.time_ns => before.since_ns,
                _ => inputs.time_ns,
            };
            state.underway = Some(Underway { since_ns, until_ns: there_ns, step: limited.displacement - previous });
        }
        state.gate.travel.paddle += (limited.displacement - previous).norm().to_f64();
        state.integral = Some(integral);
        state.displacement = Some(limited.displacement);
    }

    /// The command frame for the state after a tick.
    fn command(&self, state: &mut State<T>, inputs: &Inputs) -> PaddleCommand {
        let sequence = state.command_sequence;
        state.command_sequence = sequence.wrapping_add(1);
        PaddleCommand {
            sequence,
            state: state.mode as u32,
            tick: inputs.tick,
            time_ns: inputs.time_ns,
            faults: state.faults.bits(),
            displacement: state.displacement.as_ref().map(to_frame).unwrap_or_default(),
            needle_sequence: state.needle.accepted.map(|sample| sample.sequence).unwrap_or_default(),
            target_sequence: state.target.accepted.map(|sample| sample.sequence).unwrap_or_default(),
            paddle_index: self.table.paddle.index,
            flags: if state.displacement.is_some() { COMMAND_VALID } else { 0 },
        }
    }
}
