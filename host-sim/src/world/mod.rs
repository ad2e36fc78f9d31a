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

use firmware::contract::frames::MAX_PADDLES;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::{Inputs, Mode};
use model_offline::model::TissueModel;
use nalgebra::SVector;

use self::actuator::PaddleActuator;
use self::error::WorldError;
use self::needle::{NeedleDrive, NeedleMotion, NeedleStart, NeedleTrajectory};
use self::sensors::{Encoders, TargetSensor};
use self::simulation::Simulation;
use self::tissue::{AttachedPaddle, Insertion, PlantAccount, Reductions, TissuePlant, TissueResponse};
use self::truth::{Truth, from_frame, to_frame};

/// The simulated world in D dimensions, whatever answers for the tissue and drives the needle. A tick is [`World::act`],
/// [`World::advance`], then [`World::encoders`] and [`World::target_samples`]; [`World::tick`] is all of them.
#[derive(Debug)]
pub struct World<T, N = NeedleTrajectory, const D: usize = 2> {
    /// The tissue.
    pub tissue: T,
    /// The needle's drive.
    pub drive: N,
    /// The paddles' actuators, in the order of the controller's table; at most as many as it moves.
    pub actuators: Vec<PaddleActuator<D>>,
    target_sensor: TargetSensor<D>,
    encoders: Encoders,
    needle: NeedleMotion,
    started: NeedleStart,
}

/// What the controller's samples come from.
#[derive(Clone, Debug)]
pub struct Sensors<const D: usize = 2> {
    /// The target's camera.
    pub target: TargetSensor<D>,
    /// Encoders of needle and paddles.
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
        let attachment = attachment.at_rate(simulation.loop_settings.rate);
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
        let target = TargetSensor::of(simulation).with_defects_of(&simulation.sensor, simulation.seed);
        Self::with_sensor(tissue, &[paddle_index], simulation, target)
    }
}

impl<T: TissueResponse<D>, const D: usize> World<T, NeedleTrajectory, D> {
    /// The same with paddles of these indices, and this camera.
    fn with_sensor(tissue: T, paddles: &[u32], simulation: &Simulation, target: TargetSensor<D>) -> Self {
        let actuators = paddles.iter().map(|_| PaddleActuator::new(simulation.actuator));
        let sensors = Sensors { target, encoders: Encoders::of(paddles) };
        Self::of(tissue, simulation.needle.clone(), actuators, sensors)
    }
}

impl<T: TissueResponse<D>, N: NeedleDrive, const D: usize> World<T, N, D> {
    /// A world of these parts, before its first tick; of actuators no more than a controller moves.
    pub fn of(
        tissue: T,
        drive: N,
        actuators: impl IntoIterator<Item = PaddleActuator<D>>,
        sensors: Sensors<D>,
    ) -> Self {
        let Sensors { target, encoders } = sensors;
        let actuators = actuators.into_iter().take(MAX_PADDLES).collect();
        let (needle, started) = (NeedleMotion::default(), NeedleStart::default());
        Self { tissue, drive, actuators, target_sensor: target, encoders, needle, started }
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
        let (needle, paddles) = self.encoders(time_ns);
        let target = self.target_samples(&truth).last();
        Ok((truth, Inputs { tick, time_ns, needle: Some(needle), target, paddles }))
    }

    /// Time goes on under `command`, if there is one. The first RUN starts the needle.
    pub fn act(&mut self, command: Option<&PaddleCommand>, time_ns: u64, elapsed_ns: u64) {
        if command.is_some_and(|command| command.state == Mode::Run as u32) {
            self.start_needle(time_ns);
        }
        let command = command.filter(|command| command.is_valid());
        for (place, actuator) in self.actuators.iter_mut().enumerate() {
            let goal = command.and_then(|command| command.displacement.get(place)).map(|goal| from_frame(*goal));
            actuator.advance(goal, elapsed_ns as f64 * 1e-9);
        }
    }

    /// Where the paddle at this place is, length; none where there is no paddle.
    pub fn paddle(&self, place: usize) -> Option<SVector<f64, D>> {
        self.actuators.get(place).map(PaddleActuator::position)
    }

    /// Where the paddles are, and how many there are.
    fn paddles(&self) -> ([SVector<f64, D>; MAX_PADDLES], usize) {
        (
            std::array::from_fn(|place| self.paddle(place).unwrap_or_else(SVector::zeros)),
            self.actuators.len().min(MAX_PADDLES),
        )
    }

    /// The needle moves on to this time, and the tissue answers. Returns what is true then.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn advance(&mut self, tick: u64, time_ns: u64) -> Result<Truth, WorldError> {
        self.needle = self.drive.motion(self.since_start_s(time_ns));
        let (depth, (paddles, count)) = (self.needle.depth, self.paddles());
        let target = self.tissue.step_at(self.since_start_s(time_ns), depth, &paddles[..count])?;
        let paddles = paddles.map(|paddle| to_frame(&paddle));
        Ok(Truth { tick, time_ns, depth, target: to_frame(&target), paddles })
    }

    /// Samples of the needle's encoder, and of each paddle's in the order of the controller's table.
    pub fn encoders(&mut self, time_ns: u64) -> (NeedleSample, [Option<PaddleSample>; MAX_PADDLES]) {
        let (paddles, count) = self.paddles();
        self.encoders.sample(time_ns, self.needle, &paddles[..count])
    }

    /// The target sensor measures if that is due; returns the samples that arrive at this tick, oldest first.
    pub fn target_samples(&mut self, truth: &Truth) -> impl Iterator<Item = TargetSample> + '_ {
        let time_ns = truth.time_ns;
        self.target_sensor.measure(time_ns, &truth.target());
        std::iter::from_fn(move || self.target_sensor.arrived(time_ns))
    }
}
