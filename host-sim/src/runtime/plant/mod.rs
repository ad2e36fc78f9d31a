//! The plant's side of the loop: publishes what the world's sensors see, and passes commands on to it.

pub mod ages;
pub mod free_run;
pub mod lockstep;
pub mod observer;
pub mod process;
pub mod rehearsal;

use std::time::{Duration, Instant};

use firmware::contract::PaddleCommand;
use firmware::{Faults, Inputs, Mode};
use iceoryx2::service::Service;

use self::ages::InputAges;
use self::observer::{Answer, Moment, Observer};
use super::accounting::accounts::Published;
use super::accounting::tick::ControllerTick;
use super::error::RuntimeError;
use super::signals;
use super::time::clock::now_ns;
use crate::exchange::{LinkError, PlantPorts, Sender};
use crate::world::World;
use crate::world::error::WorldError;
use crate::world::needle::NeedleTrajectory;
use crate::world::simulation::{LONGEST_WAIT_FOR_RUN_NS, Simulation};
use crate::world::tissue::TissueResponse;
use crate::world::truth::Truth;

/// A world in D dimensions in a loop, with everything that is kept of it.
#[derive(Debug)]
pub struct PlantLoop<T, const D: usize = 2> {
    world: World<T, NeedleTrajectory, D>,
    duration_ns: u64,
    truths: Vec<Truth>,
    first_ns: Option<u64>,
    solving: Duration,
    observer: Option<Box<dyn Observer<T>>>,
    answer: Option<Answer>,
    /// The newest sample of every sensor.
    told: Inputs,
    exchanged: Option<ControllerTick>,
    ages: InputAges,
}

impl<T: TissueResponse<D>, const D: usize> PlantLoop<T, D> {
    /// A world before its first tick.
    pub fn new(world: World<T, NeedleTrajectory, D>, simulation: &Simulation) -> Self {
        let truths = Vec::with_capacity(simulation.ticks() as usize);
        let duration_ns = simulation.duration_ns();
        let ages = InputAges::default();
        Self {
            world,
            duration_ns,
            truths,
            first_ns: None,
            solving: Duration::ZERO,
            observer: None,
            answer: None,
            told: Inputs::default(),
            exchanged: None,
            ages,
        }
    }

    /// Somebody looks on from now.
    pub fn observed_by(&mut self, observer: Box<dyn Observer<T>>) {
        self.observer = Some(observer);
    }

    /// The world.
    pub fn world(&mut self) -> &mut World<T, NeedleTrajectory, D> {
        &mut self.world
    }

    /// Runs the whole insertion without a controller, time in ticks all the same; `progress` is called at every tick.
    ///
    /// # Errors
    /// [`RuntimeError::World`], [`RuntimeError::Interrupted`].
    pub fn uncontrolled(&mut self, period_ns: u64, progress: &dyn Fn()) -> Result<(), RuntimeError> {
        self.world.start_needle(0);
        for tick in 0.. {
            let time_ns = tick * period_ns;
            if self.is_over(time_ns) {
                break;
            }
            signals::check()?;
            self.solve(tick, time_ns)?;
            progress();
        }
        Ok(())
    }

    /// Solves for this moment and notes what really happened.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn solve(&mut self, tick: u64, time_ns: u64) -> Result<Truth, WorldError> {
        self.first_ns.get_or_insert(time_ns);
        let before = Instant::now();
        let began_ns = if self.observer.is_some() { now_ns() } else { 0 };
        let truth = self.world.advance(tick, time_ns)?;
        self.solving += before.elapsed();
        if let Some(observer) = &mut self.observer {
            let time_s = self.world.since_start_s(time_ns);
            let is_counted = self.world.needle_started_ns().is_some() && time_s >= self.world.drive.wait_s();
            let moment = Moment { truth, time_s, began_ns, is_counted, answer: self.answer, exchanged: self.exchanged };
            observer.offer(&self.world.tissue, &moment);
        }
        self.truths.push(truth);
        Ok(truth)
    }

    /// Solves for this moment, measures, and publishes what arrives.
    ///
    /// # Errors
    /// [`RuntimeError::World`], [`RuntimeError::Link`].
    fn publish<S: Service>(&mut self, tick: u64, time_ns: u64, ports: &mut PlantPorts<S>) -> Result<(), RuntimeError> {
        let truth = self.solve(tick, time_ns)?;
        let (needle, paddles) = self.world.encoders(time_ns);
        ports.needle.send(needle)?;
        ports.send_paddles(&paddles)?;
        self.ages.needle(needle.sequence, needle.time_ns);
        let before = self.told.paddles;
        self.told.time_ns = time_ns;
        self.told.needle = Some(needle);
        self.told.paddles = std::array::from_fn(|place| paddles[place].or(before[place]));
        for sample in self.world.target_samples(&truth) {
            self.ages.target(sample.sequence, sample.time_ns);
            self.told.target = Some(sample);
            ports.target.send(sample)?;
        }
        Ok(())
    }

    /// Time goes on under `command`, if there is one.
    ///
    /// # Errors
    /// [`RuntimeError::NeverArmed`] when RUN does not come.
    fn act(&mut self, command: Option<&PaddleCommand>, time_ns: u64, elapsed_ns: u64) -> Result<(), RuntimeError> {
        self.world.act(command, time_ns, elapsed_ns);
        if let Some(command) = command {
            self.answer =
                Some(Answer { mode: Mode::from_wire(command.state), faults: Faults::from_bits(command.faults) });
            // As the controller records it: by its own tick and that one's time.
            let inputs = Inputs { tick: command.tick, time_ns: command.time_ns, ..self.told };
            self.exchanged = Some(ControllerTick { inputs, command: *command });
        }
        let waited_ns = time_ns - self.first_ns.unwrap_or(time_ns);
        match command {
            Some(command) if self.world.needle_started_ns().is_none() && waited_ns > LONGEST_WAIT_FOR_RUN_NS => {
                Err(RuntimeError::NeverArmed {
                    waited_s: waited_ns as f64 * 1e-9,
                    faults: Faults::from_bits(command.faults),
                })
            }
            _ => Ok(()),
        }
    }

    /// Whether everything has been simulated, or whoever looks on has seen enough.
    pub fn is_over(&self, time_ns: u64) -> bool {
        let started_ns = self.world.needle_started_ns();
        started_ns.is_some_and(|started_ns| time_ns >= started_ns + self.duration_ns)
            || self.observer.as_ref().is_some_and(|observer| observer.ends_early())
    }

    /// Between two ticks of lockstep: whoever looks on may hold time.
    fn between_ticks(&mut self) {
        if let Some(observer) = &mut self.observer {
            observer.hold();
        }
    }

    /// What really happened.
    pub fn truths(&self) -> &[Truth] {
        &self.truths
    }

    /// Mean duration of a solve, µs.
    pub fn mean_step_us(&self) -> f64 {
        self.solving.as_secs_f64() * 1e6 / self.truths.len().max(1) as f64
    }
}

/// Samples that the plant has published.
pub fn published<S: Service>(ports: &PlantPorts<S>) -> Published {
    Published {
        streams: [ports.needle.published(), ports.target.published(), ports.paddle.published()],
        second_paddle: ports.second_paddle.as_ref().map(Sender::published),
    }
}

/// The newest command that waits, for closing the accounts.
///
/// # Errors
/// [`LinkError::Receive`].
pub fn waiting_command<S: Service>(ports: &mut PlantPorts<S>) -> Result<Option<u32>, LinkError> {
    Ok(ports.command.newest()?.map(|command| command.sequence))
}
