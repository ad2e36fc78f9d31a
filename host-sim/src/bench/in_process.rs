//! One insertion with the firmware's own controller in this process and in simulated time: what a lockstep run does, without
//! its processes and its files.

use firmware::{Controller, Feedback, Mode, Settings, State};
use model_offline::model::TissueModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::SimError;
use crate::world::World;
use crate::world::simulation::Simulation;
use crate::world::tissue::{AttachedPaddle, Reductions, TissuePlant};

/// Orthogonal error of one insertion, length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Errors {
    /// Largest.
    pub peak: f64,
    /// Root mean square.
    pub rms: f64,
}

/// What became of one insertion.
pub(super) struct Run {
    pub(super) errors: Errors,
    /// Part of the ticks that count in RUN.
    pub(super) run_share: f64,
    /// Largest error of the target displacement that the tissue estimated of itself, length.
    pub(super) tissue_estimate: f64,
    /// Largest one that the full model found, length; none where it was not asked, or cannot go there.
    pub(super) tissue_error: Option<f64>,
}

/// A tick of an insertion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// Time since the start of the needle, s; −1 before.
    pub(super) since_start_s: f64,
    /// Orthogonal displacement of the target, length.
    pub(super) error: f64,
    /// Its displacement along the needle, length.
    pub(super) axial: f64,
    /// Whether the needle has set out, and has waited long enough.
    pub(super) counts: bool,
    /// Whether the controller is in RUN.
    pub(super) in_run: bool,
}

/// As good as no gain: none is refused.
const NO_GAIN: f64 = 1e-12;

/// An insertion that is to be simulated.
pub(super) struct InProcess<'a> {
    model: &'a TissueModel,
    simulation: &'a Simulation,
    settings: Settings,
    reductions: &'a Reductions,
}

impl<'a> InProcess<'a> {
    /// With a controller that is set for this simulation.
    pub(super) fn new(model: &'a TissueModel, simulation: &'a Simulation, reductions: &'a Reductions) -> Self {
        let settings = simulation.loop_settings.settings(simulation.depth);
        Self { model, simulation, settings, reductions }
    }

    /// The same with a controller that is set for another one.
    pub(super) fn set_for(self, believed: &Simulation) -> Self {
        Self { settings: believed.loop_settings.settings(believed.depth), ..self }
    }

    /// The same with a controller that follows its table and does not look at the target.
    pub(super) fn fed_forward(self) -> Self {
        let settings = Settings { feedback: Feedback::Integral, loop_gain: Some(NO_GAIN), ..self.settings };
        Self { settings, ..self }
    }

    /// Simulates it: with a controller where the paddle is steered. The tissue is held against the full model where that
    /// is asked for.
    ///
    /// # Errors
    /// [`SimError`].
    pub(super) fn run(&self, paddle: AttachedPaddle<'_>, is_verified: bool) -> Result<Run, SimError> {
        let mut world = World::sharing(self.model, paddle, self.simulation, self.reductions)?;
        let (mut peak, mut squares, mut ticks, mut in_run) = (0.0_f64, 0.0, 0_u64, 0_u64);
        self.insert(&mut world, paddle, |moment| {
            if moment.counts {
                peak = peak.max(moment.error.abs());
                squares += moment.error * moment.error;
                ticks += 1;
                in_run += u64::from(moment.in_run);
            }
        })?;
        let account = is_verified.then(|| world.plant_account());
        let estimate = world.tissue.largest_estimate();
        Ok(Run {
            errors: Errors { peak, rms: (squares / ticks.max(1) as f64).sqrt() },
            run_share: in_run as f64 / ticks.max(1) as f64,
            tissue_estimate: estimate.unwrap_or(0.0),
            tissue_error: account.and_then(|account| account.extrapolation_error),
        })
    }

    /// The way from the needle's start on.
    ///
    /// # Errors
    /// [`SimError`].
    pub(super) fn moments(&self, paddle: AttachedPaddle<'_>) -> Result<Vec<Moment>, SimError> {
        let mut world = World::sharing(self.model, paddle, self.simulation, self.reductions)?;
        let mut moments = Vec::new();
        self.insert(&mut world, paddle, |moment| {
            if moment.since_start_s >= 0.0 {
                moments.push(moment);
            }
        })?;
        Ok(moments)
    }

    /// Goes through the insertion, tick by tick.
    fn insert(
        &self,
        world: &mut World<TissuePlant<'_>>,
        paddle: AttachedPaddle<'_>,
        mut visit: impl FnMut(Moment),
    ) -> Result<(), SimError> {
        let Self { model, simulation, settings, .. } = self;
        let controller = match paddle {
            AttachedPaddle::Steered(table) => Some(Controller::new(table, settings)?),
            _ => None,
        };
        let mut state = State::new();
        let mut command = None;
        let (normal, axis) = (model.scene().needle.orthogonal(), model.scene().needle.axis);
        if controller.is_none() {
            world.start_needle(0);
        }
        for tick in 0..simulation.ticks() {
            let (truth, inputs) = world.tick(tick, command.as_ref(), settings.loop_period_ns)?;
            let since_start_s = world.since_start_s(truth.time_ns);
            if since_start_s >= simulation.duration_s {
                break;
            }
            command = controller.as_ref().map(|controller| controller.step(&mut state, &inputs));
            visit(Moment {
                since_start_s,
                error: normal.dot(&truth.target::<2>()),
                axial: axis.dot(&truth.target::<2>()),
                counts: since_start_s >= 0.0 && since_start_s >= simulation.needle.wait_s(),
                in_run: command.as_ref().is_some_and(|command| command.state == Mode::Run as u32),
            });
        }
        Ok(())
    }
}
