//! The simulated world: tissue, needle drive, actuator, sensors. No I/O, no clock: time is what the caller says it is.
//!
//! ```text
//! needle drive ──→ tissue ──→ target sensor ──→ samples
//!                    ↑  └────→ truth
//! command ──→ actuator ──→ encoders ──────────→ samples
//! ```

pub mod actuator;
pub mod error;
pub mod loop_settings;
pub mod needle;
pub mod retrace;
pub mod sensors;
pub mod simulation;
pub mod space;
pub mod tissue;
pub mod truth;

use firmware::contract::frames::to_plane;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::{Inputs, Mode};
use model_offline::model::TissueModel;
use nalgebra::Vector2;

use self::actuator::PaddleActuator;
use self::error::WorldError;
use self::needle::{NeedleDrive, NeedleMotion, NeedleStart, NeedleTrajectory};
use self::sensors::{Encoders, TargetSensor};
use self::simulation::Simulation;
use self::tissue::{AttachedPaddle, Insertion, PlantAccount, Reductions, TissuePlant, TissueResponse};
use self::truth::Truth;

/// The simulated world, whatever answers for the tissue and drives the needle. A tick is [`World::act`],
/// [`World::advance`], then [`World::encoders`] and [`World::target_samples`]; [`World::tick`] is all of them.
#[derive(Debug)]
pub struct World<T, N = NeedleTrajectory> {
    /// The tissue.
    pub tissue: T,
    /// The needle's drive.
    pub drive: N,
    /// The paddle and its actuator.
    pub actuator: PaddleActuator,
    target_sensor: TargetSensor,
    encoders: Encoders,
    needle: NeedleMotion,
    started: NeedleStart,
}

/// What the controller's samples come from.
#[derive(Clone, Debug)]
pub struct Sensors {
    /// The target's camera.
    pub target: TargetSensor,
    /// Encoders of needle and paddle.
    pub encoders: Encoders,
}

impl<'m> World<TissuePlant<'m>> {
    /// Tissue at rest, the needle at its surface, with the paddle of this index attached (or none).
    ///
    /// # Errors
    /// [`WorldError`].
    pub fn new(model: &'m TissueModel, paddle_index: Option<u32>, simulation: &Simulation) -> Result<Self, WorldError> {
        let reductions = Reductions::default();
        let paddle = paddle_index.map_or(AttachedPaddle::None, AttachedPaddle::Moved);
        Self::sharing(model, paddle, simulation, &reductions)
    }

    /// The same with what becomes of the paddle, and with reduced models that others of this tissue have asked for, or will.
    ///
    /// # Errors
    /// [`WorldError`].
    pub fn sharing(
        model: &'m TissueModel,
        paddle: AttachedPaddle<'_>,
        simulation: &Simulation,
        reductions: &Reductions,
    ) -> Result<Self, WorldError> {
        let place = |index: u32| model.paddle_position(index).ok_or(WorldError::NoPaddle { index });
        let attachment = paddle.attachment(paddle.index().map(place).transpose()?);
        let tissue = match model.scene().has_a_past() {
            true => {
                let insertion = Insertion {
                    trajectory: simulation.needle.clone(),
                    duration_s: simulation.duration_s,
                    plan: paddle.plan(),
                };
                TissuePlant::along(model, attachment, simulation.plant, insertion, reductions)?
            }
            false => {
                let choice = simulation.plant.unwrap_or_default();
                TissuePlant::sharing(model, attachment, choice, reductions)?
            }
        };
        Ok(Self::simulated(tissue, paddle.index().unwrap_or(0), simulation))
    }

    /// Which model answered for the tissue, and how well.
    pub fn plant_account(&mut self) -> PlantAccount {
        self.tissue.account()
    }
}

impl<T: TissueResponse> World<T> {
    /// A tissue with the needle drive, the actuator and the sensors of a simulation; the paddle's encoder has this index.
    pub fn simulated(tissue: T, paddle_index: u32, simulation: &Simulation) -> Self {
        let settings = simulation.loop_settings.settings(simulation.depth);
        let drive = simulation.needle.clone();
        let sensors = Sensors {
            target: TargetSensor::new(
                settings.target_period_ns,
                settings.target_latency_ns,
                simulation.loop_settings.noise_for(simulation.depth),
                simulation.seed,
            )
            .with_defects_of(&simulation.sensor, simulation.seed),
            encoders: Encoders::new(paddle_index),
        };
        Self::of(tissue, drive, PaddleActuator::new(simulation.actuator), sensors)
    }
}

impl<T: TissueResponse, N: NeedleDrive> World<T, N> {
    /// A world of these parts, before its first tick.
    pub fn of(tissue: T, drive: N, actuator: PaddleActuator, sensors: Sensors) -> Self {
        let Sensors { target, encoders } = sensors;
        let needle = NeedleMotion::default();
        Self { tissue, drive, actuator, target_sensor: target, encoders, needle, started: NeedleStart::default() }
    }

    /// The needle starts now. It waits for the controller's RUN, or for nobody without a controller.
    pub fn start_needle(&mut self, time_ns: u64) {
        self.started.at(time_ns);
    }

    /// When the needle started, ns.
    pub fn needle_started_ns(&self) -> Option<u64> {
        self.started.time_ns()
    }

    /// Time since the needle started, s; −1 before.
    pub fn since_start_s(&self, time_ns: u64) -> f64 {
        self.started.since_s(time_ns)
    }

    /// One tick of a loop without a transport: time goes on by a period under `command`, and every sensor is read at
    /// once. Returns what is true then, and what the controller is given.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn tick(
        &mut self,
        tick: u64,
        command: Option<&PaddleCommand>,
        period_ns: u64,
    ) -> Result<(Truth, Inputs), WorldError> {
        let time_ns = tick * period_ns;
        // The command is the answer to the tick before: where it says RUN first, the needle started then.
        self.act(command, time_ns.saturating_sub(period_ns), period_ns);
        let truth = self.advance(tick, time_ns)?;
        let (needle, paddle) = self.encoders(time_ns);
        let target = self.target_samples(&truth).last();
        Ok((truth, Inputs { tick, time_ns, needle: Some(needle), target, paddles: [Some(paddle), None] }))
    }

    /// Time goes on under `command`, if there is one. The first RUN starts the needle.
    pub fn act(&mut self, command: Option<&PaddleCommand>, time_ns: u64, elapsed_ns: u64) {
        if command.is_some_and(|command| command.state == Mode::Run as u32) {
            self.start_needle(time_ns);
        }
        let goal = command
            .filter(|command| command.is_valid())
            .map(|command| Vector2::from(to_plane(command.displacement[0])));
        self.actuator.advance(goal, elapsed_ns as f64 * 1e-9);
    }

    /// The needle moves on to this time, and the tissue answers. Returns what is true then.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn advance(&mut self, tick: u64, time_ns: u64) -> Result<Truth, WorldError> {
        self.needle = self.drive.motion(self.since_start_s(time_ns));
        let (depth, paddle) = (self.needle.depth, self.actuator.position());
        let target = self.tissue.step_at(self.since_start_s(time_ns), depth, paddle)?;
        Ok(Truth { tick, time_ns, depth, target: target.into(), paddle: paddle.into() })
    }

    /// Samples of the needle's and the paddle's encoder.
    pub fn encoders(&mut self, time_ns: u64) -> (NeedleSample, PaddleSample) {
        self.encoders.sample(time_ns, self.needle, &self.actuator.position())
    }

    /// The target sensor measures if that is due; returns the samples that arrive at this tick, oldest first.
    pub fn target_samples(&mut self, truth: &Truth) -> impl Iterator<Item = TargetSample> + '_ {
        let time_ns = truth.time_ns;
        self.target_sensor.measure(time_ns, &Vector2::from(truth.target));
        std::iter::from_fn(move || self.target_sensor.arrived(time_ns))
    }
}
