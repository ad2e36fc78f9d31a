//! Plant, needle drive, actuator and sensors together, as both modes of time drive them.

pub mod actuator;
pub mod loop_settings;
pub mod sensors;
pub mod tissue;

use std::time::{Duration, Instant};

use firmware::contract::PaddleCommand;
use firmware::{Faults, Mode};
use iceoryx2::service::Service;
use model_offline::model::TissueModel;
use nalgebra::Vector2;

use crate::error::SimError;
use crate::exchange::{LinkError, PlantPorts};
use crate::record::recording::Truth;
use crate::runtime::clock::now_ns;
use crate::view::{Moment, Watch};
use crate::world::actuator::{ActuatorModel, Paddle, Trajectory};
use crate::world::loop_settings::LoopArgs;
use crate::world::sensors::{Encoders, TargetSensor};
use crate::world::tissue::{PlantAccount, PlantChoice, TissueSolver};

/// The controller needs one target sample to arrive; everything longer is a fault of the set-up.
const LONGEST_WAIT_FOR_RUN_NS: u64 = 2_000_000_000;

/// Numbers of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulation {
    /// Rates, latency, noise.
    pub loop_args: LoopArgs,
    /// Duration of the insertion, s.
    pub insertion_s: f64,
    /// Time simulated after the start of the needle, s.
    pub duration_s: f64,
    /// Depth of the insertion, length.
    pub depth: f64,
    /// The paddle's actuator.
    pub actuator: ActuatorModel,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// What answers for the tissue.
    pub plant: PlantChoice,
}

impl Simulation {
    /// Ticks of a run, with the wait for RUN.
    pub fn ticks(&self) -> u64 {
        let longest_ns = self.duration_ns() + LONGEST_WAIT_FOR_RUN_NS;
        longest_ns / self.loop_args.period_ns() + 2
    }

    fn duration_ns(&self) -> u64 {
        (self.duration_s * 1e9).round() as u64
    }
}

/// The simulated world.
#[derive(Debug)]
pub struct World<'m> {
    tissue: TissueSolver<'m>,
    paddle: Paddle,
    /// Index of the attached paddle; 0 without one.
    paddle_index: u32,
    trajectory: Trajectory,
    target_sensor: TargetSensor,
    encoders: Encoders,
    duration_ns: u64,
    first_ns: Option<u64>,
    needle_started_ns: Option<u64>,
    truths: Vec<Truth>,
    solving: Duration,
    watch: Option<Watch>,
}

impl<'m> World<'m> {
    /// Tissue at rest, the needle at its surface, with the paddle of this index attached (or none).
    ///
    /// # Errors
    /// [`SimError::Tissue`]; [`SimError::Usage`] for a paddle that the scene does not have.
    pub fn new(model: &'m TissueModel, paddle_index: Option<u32>, simulation: &Simulation) -> Result<Self, SimError> {
        let position = match paddle_index {
            None => None,
            Some(index) => Some(
                model
                    .paddle_position(index)
                    .ok_or_else(|| SimError::Usage(format!("the simulated scene has no paddle {index}")))?,
            ),
        };
        let depth = simulation.depth;
        let settings = simulation.loop_args.settings(depth);
        Ok(Self {
            tissue: TissueSolver::new(model, position, simulation.plant)?,
            paddle: Paddle::new(simulation.actuator),
            paddle_index: paddle_index.unwrap_or(0),
            trajectory: Trajectory::new(depth, simulation.insertion_s),
            target_sensor: TargetSensor::new(
                settings.target_period_ns,
                settings.target_latency_ns,
                settings.target_noise,
                simulation.seed,
            ),
            encoders: Encoders::default(),
            duration_ns: simulation.duration_ns(),
            first_ns: None,
            needle_started_ns: None,
            truths: Vec::with_capacity(simulation.ticks() as usize),
            solving: Duration::ZERO,
            watch: None,
        })
    }

    /// A view looks on from now.
    pub fn watch(&mut self, watch: Watch) {
        self.watch = Some(watch);
    }

    /// The needle starts now. It waits for the controller's RUN, or for nobody without a controller.
    pub fn start_needle(&mut self, time_ns: u64) {
        self.needle_started_ns.get_or_insert(time_ns);
    }

    /// When the needle started, ns.
    pub fn needle_started_ns(&self) -> Option<u64> {
        self.needle_started_ns
    }

    /// Solves for this moment and notes what really happened. Returns needle depth and velocity.
    ///
    /// # Errors
    /// [`SimError::Tissue`].
    pub fn solve(&mut self, tick: u64, time_ns: u64) -> Result<(f64, f64), SimError> {
        self.first_ns.get_or_insert(time_ns);
        let since_start_s =
            self.needle_started_ns.map_or(-1.0, |started_ns| time_ns.saturating_sub(started_ns) as f64 * 1e-9);
        let (depth, velocity) = self.trajectory.at(since_start_s);
        let before = Instant::now();
        let began_ns = if self.watch.is_some() { now_ns() } else { 0 };
        let target = self.tissue.step(depth, self.paddle.position())?;
        self.solving += before.elapsed();
        if let Some(watch) = &mut self.watch {
            let paddle = self.paddle.position().into();
            let moment =
                Moment { tick, time_ns, time_s: since_start_s, depth, target: target.into(), paddle, began_ns };
            watch.offer(&self.tissue, &moment);
        }
        self.truths.push(Truth { tick, time_ns, depth, target: target.into(), paddle: self.paddle.position().into() });
        Ok((depth, velocity))
    }

    /// Solves for this moment, measures, and publishes what arrives.
    ///
    /// # Errors
    /// [`SimError::Tissue`], [`SimError::Link`].
    pub fn publish<S: Service>(&mut self, tick: u64, time_ns: u64, ports: &mut PlantPorts<S>) -> Result<(), SimError> {
        let motion = self.solve(tick, time_ns)?;
        let (needle, paddle) = self.encoders.sample(time_ns, motion, self.paddle_index, &self.paddle.position());
        ports.needle.send(needle)?;
        ports.paddle.send(paddle)?;
        if let Some(truth) = self.truths.last() {
            self.target_sensor.measure(time_ns, &Vector2::from(truth.target));
        }
        while let Some(sample) = self.target_sensor.arrived(time_ns) {
            ports.target.send(sample)?;
        }
        Ok(())
    }

    /// Time goes on under `command`, if there is one.
    ///
    /// # Errors
    /// [`SimError::NeverArmed`] when RUN does not come.
    pub fn act(&mut self, command: Option<&PaddleCommand>, time_ns: u64, elapsed_ns: u64) -> Result<(), SimError> {
        if let Some(command) = command {
            if command.state == Mode::Run as u32 {
                self.start_needle(time_ns);
            }
            let waited_ns = time_ns - self.first_ns.unwrap_or(time_ns);
            if self.needle_started_ns.is_none() && waited_ns > LONGEST_WAIT_FOR_RUN_NS {
                return Err(SimError::NeverArmed {
                    waited_s: waited_ns as f64 * 1e-9,
                    faults: Faults::from_bits(command.faults),
                });
            }
        }
        let goal = command.filter(|command| command.is_valid()).map(|command| Vector2::from(command.displacement));
        self.paddle.advance(goal, elapsed_ns as f64 * 1e-9);
        Ok(())
    }

    /// Whether everything has been simulated.
    pub fn is_over(&self, time_ns: u64) -> bool {
        self.needle_started_ns.is_some_and(|started_ns| time_ns >= started_ns + self.duration_ns)
            || self.watch.as_ref().is_some_and(Watch::ends_early)
    }

    /// What really happened.
    pub fn truths(&self) -> &[Truth] {
        &self.truths
    }

    /// Where the nodes are now.
    pub fn deformed_nodes(&self) -> Vec<[f64; 2]> {
        self.tissue.deformed_nodes()
    }

    /// Which model answered for the tissue, and how well.
    pub fn plant_account(&mut self) -> PlantAccount {
        self.tissue.account()
    }

    /// Mean duration of a solve, µs.
    pub fn mean_step_us(&self) -> f64 {
        self.solving.as_secs_f64() * 1e6 / self.truths.len().max(1) as f64
    }
}

/// Samples that the plant has published: needle, target, paddle.
pub fn published<S: Service>(ports: &PlantPorts<S>) -> [u64; 3] {
    [ports.needle.published(), ports.target.published(), ports.paddle.published()]
}

/// The newest command that waits, for closing the accounts.
///
/// # Errors
/// [`LinkError::Receive`].
pub fn waiting_command<S: Service>(ports: &mut PlantPorts<S>) -> Result<Option<u32>, LinkError> {
    Ok(ports.command.newest()?.map(|command| command.sequence))
}
