//! The closed loop in one thread and virtual time: plant, sensors, seam, controller, actuator; nothing waits.
//!
//! The plant ticks every period. The controller follows its own [`Schedule`] in the same virtual time, so that a slow
//! step makes it skip periods while the plant goes on.

use std::collections::VecDeque;

use firmware::contract::frames::MAX_PADDLES;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, Table, TargetSample};
use firmware::io::{CommandSink, SampleSource, run_tick};
use firmware::schedule::Schedule;
use firmware::{Controller, Faults, Inputs, Mode, Settings, SettingsError, State};
use nalgebra::SVector;
use rand_pcg::Pcg64;

use super::audit::Audit;
use super::fault::{Event, Fault, Stream};
use super::invariants::{Invariants, positions};
use super::seam::{Channel, see};
use super::shuttle::ShuttleDrive;
use super::tissue::LinearTissue;
use crate::runtime::accounting::tick::ControllerTick;
use crate::world::actuator::{ActuatorModel, PaddleActuator};
use crate::world::sensors::{Encoders, TargetSensor};
use crate::world::{Sensors, World};
use model_offline::scene::IDEAL_NOISE_PER_DEPTH;

/// Part of a period that a healthy step takes.
const HEALTHY_STEP: f64 = 0.1;
/// Stream of the generator for the faults' own noise.
const FAULT_STREAM: u128 = 7;

/// What a bench is built from.
#[derive(Clone, Copy, Debug)]
pub struct Setup<const D: usize = 2, const P: usize = 1> {
    /// Settings of the controller.
    pub settings: Settings,
    /// Standard deviation of the target sensor, length.
    pub noise: f64,
    /// Speed of the insertion, length/s.
    pub speed: f64,
    /// Depth where the needle stops, length.
    pub depth_end: f64,
    /// The actuator of each paddle.
    pub actuators: [ActuatorModel; P],
    /// First sequence number of needle and paddle samples.
    pub sequence: u32,
    /// Whether the needle turns back at the end of the table, again and again.
    pub shuttles: bool,
    /// Where the paddles are before the controller starts, length.
    pub paddles: [SVector<f64, D>; P],
    /// Seed of all noise.
    pub seed: u64,
    /// Monitors of the controller that are off, to see that somebody notices.
    pub without: Faults,
}

impl<const D: usize, const P: usize> Setup<D, P> {
    /// A 1 kHz loop on `table` with the target at 50 Hz, 20 ms late; the insertion takes 5 s.
    pub fn new<const N: usize>(table: &Table<f64, D, N, P>, seed: u64) -> Self {
        const MS: u64 = 1_000_000;
        let depth = table.validity.depth_end;
        let noise = IDEAL_NOISE_PER_DEPTH * depth;
        let servo = |max_rate| ActuatorModel { max_rate, lag_s: 0.0, delay_ticks: 0, gain: 1.0 };
        Self {
            settings: Settings { target_noise: noise, ..Settings::new(MS, 20 * MS, 20 * MS) },
            noise,
            speed: depth / 5.0,
            depth_end: depth,
            actuators: table.paddles.each_ref().map(|paddle| servo(paddle.max_rate)),
            sequence: 0,
            shuttles: false,
            paddles: [SVector::zeros(); P],
            seed,
            without: Faults::NONE,
        }
    }
}

impl<const D: usize, const P: usize> Setup<D, P> {
    /// Plant, needle, actuators and sensors of this set-up.
    fn world<'t, const N: usize>(&self, table: &'t Table<f64, D, N, P>) -> BenchWorld<'t, D, N, P> {
        let settings = &self.settings;
        let period_s = settings.loop_period_ns as f64 * 1e-9;
        let drive = ShuttleDrive::new(table, self.depth_end, self.speed, period_s);
        let drive = if self.shuttles { drive.to_and_fro() } else { drive };
        let actuators = self.actuators.iter().zip(&self.paddles).map(|(model, at)| PaddleActuator::at(*model, *at));
        let (period_ns, latency_ns) = (settings.target_period_ns, settings.target_latency_ns);
        let sensors = Sensors {
            target: TargetSensor::new(period_ns, latency_ns, self.noise, self.seed),
            encoders: Encoders::of(&table.paddles.each_ref().map(|paddle| paddle.index)).starting_at(self.sequence),
        };
        World::of(LinearTissue::new(table), drive, actuators, sensors)
    }
}

/// The simulated world of a bench.
type BenchWorld<'t, const D: usize, const N: usize, const P: usize> = World<LinearTissue<'t, D, N, P>, ShuttleDrive, D>;

/// What the controller's traits see of the bench.
#[derive(Debug)]
struct BenchLink {
    needle: Channel<NeedleSample>,
    target: Channel<TargetSample>,
    paddles: [Channel<PaddleSample>; MAX_PADDLES],
    sent: Option<PaddleCommand>,
}

impl BenchLink {
    /// Nothing has been sent in so many dimensions.
    fn new(dimension: usize) -> Self {
        Self {
            needle: Channel::new(Stream::Needle, dimension),
            target: Channel::new(Stream::Target, dimension),
            paddles: Stream::PADDLES.map(|stream| Channel::new(stream, dimension)),
            sent: None,
        }
    }
}

impl SampleSource for BenchLink {
    fn needle(&mut self) -> Option<NeedleSample> {
        self.needle.take()
    }
    fn target(&mut self) -> Option<TargetSample> {
        self.target.take()
    }
    fn paddle(&mut self, place: usize) -> Option<PaddleSample> {
        self.paddles.get_mut(place)?.take()
    }
}

impl CommandSink for BenchLink {
    type Error = std::convert::Infallible;
    fn send(&mut self, command: &PaddleCommand) -> Result<(), Self::Error> {
        self.sent = Some(*command);
        Ok(())
    }
}

/// The closed loop.
#[derive(Debug)]
pub struct ClosedLoop<'t, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    setup: Setup<D, P>,
    controller: Controller<'t, f64, D, N, P>,
    /// State of the controller.
    pub state: State<f64, D, N, P>,
    schedule: Schedule,
    events: Vec<Event>,
    active: Vec<Fault>,
    tick: u64,
    world: BenchWorld<'t, D, N, P>,
    random: Pcg64,
    link: BenchLink,
    /// Commands on their way, with the time when the step that gave them has ended, ns.
    on_their_way: VecDeque<(u64, PaddleCommand)>,
    next_release_ns: u64,
    /// Wall clock minus steady clock, ns: what nothing here may depend on.
    wall_offset_ns: i64,
    /// Accounts from outside of the controller.
    pub audit: Audit,
    /// What must hold on every tick.
    pub invariants: Invariants<P>,
    /// Last exchange of the controller.
    pub last: Option<ControllerTick>,
    /// Orthogonal error now, along each direction, length.
    pub error: SVector<f64, N>,
    /// Largest norm of the orthogonal error so far, length.
    pub max_error: f64,
    /// Injections so far.
    pub injected: u64,
    /// Commands that came with at least one fault code.
    pub flagged: u64,
}

impl<'t, const D: usize, const N: usize, const P: usize> ClosedLoop<'t, D, N, P> {
    /// Everything at rest at time 0.
    ///
    /// # Errors
    /// What the controller refuses.
    pub fn new(table: &'t Table<f64, D, N, P>, setup: Setup<D, P>) -> Result<Self, SettingsError> {
        let settings = &setup.settings;
        let controller = Controller::new(table, settings)?.without(setup.without);
        Ok(Self {
            controller,
            state: State::new(),
            schedule: Schedule::new(0, settings.loop_period_ns),
            events: Vec::new(),
            active: Vec::new(),
            tick: 0,
            world: setup.world(table),
            random: Pcg64::new(u128::from(setup.seed), FAULT_STREAM),
            link: BenchLink::new(D),
            on_their_way: VecDeque::new(),
            next_release_ns: 0,
            wall_offset_ns: 0,
            audit: Audit::default(),
            invariants: Invariants::new(table, settings),
            last: None,
            error: SVector::zeros(),
            max_error: 0.0,
            injected: 0,
            flagged: 0,
            setup,
        })
    }

    /// The settings it was built from.
    pub fn setup(&self) -> &Setup<D, P> {
        &self.setup
    }

    /// Number of the next tick of the plant.
    pub fn now(&self) -> u64 {
        self.tick
    }

    /// What a wall clock beside the loop shows, ns since it was right.
    pub fn wall_clock_ns(&self) -> i64 {
        (self.tick * self.setup.settings.loop_period_ns).cast_signed() + self.wall_offset_ns
    }

    /// Depth of the needle, length.
    pub fn depth(&self) -> f64 {
        self.world.drive.depth()
    }

    /// Where the paddles are, length.
    pub fn paddles(&self) -> [SVector<f64, D>; P] {
        std::array::from_fn(|place| self.world.paddle(place).unwrap_or_else(SVector::zeros))
    }

    /// The orthogonal error along the direction of a push, length.
    pub fn error_sideways(&self) -> f64 {
        self.world.tissue.push_direction.dot(&self.error)
    }

    /// The tissue.
    pub fn tissue(&mut self) -> &mut LinearTissue<'t, D, N, P> {
        &mut self.world.tissue
    }

    /// Loop gain g in use.
    pub fn loop_gain(&self) -> f64 {
        self.controller.loop_gain()
    }

    /// `fault` from now on for this many ticks of the plant.
    pub fn inject(&mut self, fault: Fault, ticks: u64) -> &mut Self {
        self.inject_at(Event { fault, from: self.tick, until: self.tick + ticks })
    }

    /// `event` when its time has come.
    pub fn inject_at(&mut self, event: Event) -> &mut Self {
        self.events.push(event);
        self
    }

    /// Somebody has looked and re-arms the controller.
    pub fn rearm(&mut self) {
        self.state.rearm();
        self.audit.rearm();
        self.invariants.rearm();
    }

    /// Lets this many ticks of the plant pass.
    pub fn run(&mut self, ticks: u64) -> &mut Self {
        for _ in 0..ticks {
            self.step();
        }
        self
    }

    /// Ticks of the plant until a command satisfies `condition`, that tick included; none within `limit`.
    pub fn until(&mut self, limit: u64, condition: impl Fn(&PaddleCommand) -> bool) -> Option<u64> {
        (1..=limit).find(|_| self.step().is_some_and(|exchange| condition(&exchange.command)))
    }

    /// What the controller would answer to `inputs` now. Nothing changes.
    pub fn foresee(&self, inputs: &Inputs) -> PaddleCommand {
        self.controller.step(&mut self.state.clone(), inputs)
    }

    /// Mode of the last command.
    pub fn mode(&self) -> Mode {
        self.state.mode()
    }

    /// What is in one account and not in the other.
    pub fn unaccounted(&self) -> u64 {
        self.audit.unaccounted(self.state.ledger())
    }

    /// One tick of the plant, and of the controller if it is due.
    pub fn step(&mut self) -> Option<ControllerTick> {
        let time_ns = self.tick * self.setup.settings.loop_period_ns;
        self.active.clear();
        let tick = self.tick;
        self.active.extend(self.events.iter().filter(|event| event.is_active(tick)).map(|event| event.fault));
        self.move_plant(time_ns);
        self.sense(time_ns);
        let exchange = if self.next_release_ns <= time_ns { Some(self.control(time_ns)) } else { None };
        self.tick += 1;
        exchange
    }

    /// One period passes for needle, actuator and whatever pushes.
    fn move_plant(&mut self, time_ns: u64) {
        let period_s = self.setup.settings.loop_period_ns as f64 * 1e-9;
        let mut gains = self.setup.actuators.map(|actuator| actuator.gain);
        let (mut speed, mut stuck, mut exchanged) = (1.0, [false; P], false);
        self.world.tissue.gain = 1.0;
        for fault in &self.active {
            match *fault {
                Fault::Stuck(place) => stuck.iter_mut().skip(place).take(1).for_each(|stuck| *stuck = true),
                Fault::ActuatorGain(place, gain) => gains.iter_mut().skip(place).take(1).for_each(|of| *of = gain),
                Fault::CommandsExchanged => exchanged = true,
                Fault::TissueGain(gain) => self.world.tissue.gain = gain,
                Fault::Push(rate) => self.world.tissue.push += rate * period_s,
                Fault::NeedleSpeed(factor) => speed = factor,
                Fault::WallClock(by_ns) => self.wall_offset_ns = by_ns,
                _ => continue,
            }
            self.injected += 1;
        }
        let mut command = None;
        while let Some((ready_ns, sent)) = self.on_their_way.front()
            && *ready_ns <= time_ns
        {
            command = Some(*sent);
            self.on_their_way.pop_front();
        }
        let goals = command.filter(PaddleCommand::is_valid).map(|command| {
            let mut goals: [SVector<f64, D>; P] = positions(&command);
            if exchanged {
                goals.reverse();
            }
            goals
        });
        for (place, moved) in self.world.actuators.iter_mut().enumerate().take(P) {
            moved.set_gain(gains[place]);
            if !stuck[place] {
                moved.advance(goals.map(|goals| goals[place]), period_s);
            }
        }
        self.world.drive.hurry = speed;
        // The needle starts with the first RUN, as in a real insertion.
        if self.audit.modes[Mode::Run as usize - 1] > 0 {
            self.world.start_needle(time_ns);
        }
    }

    /// Measures, and lets the seam pass what arrives.
    fn sense(&mut self, time_ns: u64) {
        // A linear tissue always has an answer.
        let Ok(truth) = self.world.advance(self.tick, time_ns) else { return };
        self.error = self.world.tissue.error(&truth.target());
        self.max_error = self.max_error.max(self.error.norm());
        let stopped = self.active.contains(&Fault::PeerStopped);
        let (mut needle, mut paddles, mut seen) = (None, [None; MAX_PADDLES], None);
        if stopped {
            self.injected += 1;
        } else {
            let (from_needle, from_paddles) = self.world.encoders(time_ns);
            (needle, paddles) = (Some(from_needle), self.attached(from_paddles));
            seen = self.world.target_samples(&truth).next();
            if let Some(sample) = &mut seen {
                self.injected += see(sample, &self.active, &mut self.random);
            }
        }
        let (tick, audit) = (self.tick, &mut self.audit);
        self.injected += self.link.needle.pass(tick, needle, &self.active, audit)
            + self.link.target.pass(tick, seen, &self.active, audit);
        for (channel, sample) in self.link.paddles.iter_mut().zip(paddles) {
            self.injected += channel.pass(tick, sample, &self.active, audit);
        }
    }

    /// What the encoders of the paddles say with the faults that are about paddles and not about streams.
    fn attached(&mut self, mut samples: [Option<PaddleSample>; MAX_PADDLES]) -> [Option<PaddleSample>; MAX_PADDLES] {
        if self.active.contains(&Fault::SamplesExchanged) {
            self.injected += 1;
            let there = samples.map(|sample| sample.map(|sample| sample.displacement));
            for (sample, displacement) in samples.iter_mut().zip(there.into_iter().rev()) {
                *sample =
                    sample.zip(displacement).map(|(sample, displacement)| PaddleSample { displacement, ..sample });
            }
        }
        for (place, sample) in samples.iter_mut().enumerate() {
            let identity = self.active.iter().rev().find_map(|fault| match fault {
                Fault::PaddleIdentity(at, index) if *at == place => Some(*index),
                _ => None,
            });
            self.injected += u64::from(identity.is_some());
            if let (Some(sample), Some(identity)) = (sample, identity) {
                sample.paddle_index = identity;
            }
        }
        samples
    }

    /// One tick of the controller.
    fn control(&mut self, time_ns: u64) -> ControllerTick {
        let period_ns = self.setup.settings.loop_period_ns;
        let (mut back_ns, mut periods) = (0, HEALTHY_STEP);
        for fault in &self.active {
            match *fault {
                Fault::ClockBack(by_ns) => back_ns = by_ns,
                Fault::SlowStep(slow) => periods = slow,
                _ => continue,
            }
            self.injected += 1;
        }
        // A release before this one that did not start was skipped: arithmetic of its own, not the schedule's.
        self.audit.skipped += (time_ns - self.next_release_ns) / period_ns;
        let release = self.schedule.begin(time_ns);
        let before = self.state.clone();
        let Ok((inputs, command)) =
            run_tick(&self.controller, &mut self.state, release.tick, time_ns.saturating_sub(back_ns), &mut self.link);
        let accepted = !self.invariants.is_backwards(&inputs);
        for (stream, sequence) in Stream::ALL.into_iter().zip([
            inputs.needle.map(|sample| sample.sequence),
            inputs.target.map(|sample| sample.sequence),
            inputs.paddles[0].map(|sample| sample.sequence),
            inputs.paddles[1].map(|sample| sample.sequence),
        ]) {
            if let Some(sequence) = sequence {
                self.audit.stream(stream).read(sequence, accepted);
            }
        }
        if let Some(count) = self.audit.modes.get_mut(command.state.wrapping_sub(1) as usize) {
            *count += 1;
        }
        self.invariants.check(&before, &self.state, &inputs, &command);
        self.flagged += u64::from(command.faults != 0);

        let end_ns = time_ns + (periods * period_ns as f64).round() as u64;
        self.schedule.finish(end_ns);
        let whole = end_ns.div_ceil(period_ns) * period_ns;
        let next_ns = whole.max(time_ns + period_ns);
        self.audit.skipped += (next_ns - time_ns) / period_ns - 1;
        self.invariants.check_release(self.schedule.next_release_ns(), next_ns);
        self.next_release_ns = next_ns;
        self.on_their_way.push_back((end_ns, command));
        let exchange = ControllerTick { inputs, command };
        self.last = Some(exchange);
        exchange
    }
}
