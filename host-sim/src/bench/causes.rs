//! What the error of a controlled insertion is made of: the same insertion with one cause taken away at a time, and with
//! all of them.
//!
//! Causes do not add up: noise that is taken away lets nothing else be seen better, and a table that knows everything
//! leaves a slow sensor nothing to be slow about. What each is worth is what is left without it alone.

use firmware::contract::Table;
use model_offline::model::TissueModel;
use model_offline::placement::discretise;
use model_offline::scene::{Motion, Scene};
use model_offline::table::{TableOptions, build};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::VariantArray as _;

use super::error::SimError;
use super::in_process::{Errors, InProcess};
use crate::world::simulation::Simulation;
use crate::world::tissue::{AttachedPaddle, Reductions};

/// Something that leaves an error.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, strum::Display, strum::VariantArray,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Cause {
    /// Noise, steps, bias and outages of the target's sensor; the controller goes on expecting them.
    SensorNoise,
    /// The time from a measurement of the target to its arrival; the controller knows it.
    SensorDelay,
    /// What the table does not know of needle and tissue: in its place one of the simulated scene.
    Table,
    /// What moves the patient, which no table knows.
    Motion,
    /// A needle that bends, which no table knows.
    Deflection,
    /// Lag, delay and gain of the paddle.
    Paddle,
}

impl Cause {
    /// What it is, in a few words.
    pub fn title(self) -> &'static str {
        match self {
            Self::SensorNoise => "sensor's noise",
            Self::SensorDelay => "sensor's delay",
            Self::Table => "table's ignorance",
            Self::Motion => "patient's motion",
            Self::Deflection => "needle's bending",
            Self::Paddle => "paddle's lag",
        }
    }

    /// What it is, in a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::SensorNoise => "noise",
            Self::SensorDelay => "delay",
            Self::Table => "table",
            Self::Motion => "motion",
            Self::Deflection => "bending",
            Self::Paddle => "paddle",
        }
    }
}

/// What is left without one cause.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Without {
    /// The cause.
    pub cause: Cause,
    /// Error without it.
    pub left: Errors,
}

/// What an error is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CausesResult {
    /// Error as it is, in lockstep.
    pub whole: Errors,
    /// Every cause that there is.
    pub without: Vec<Without>,
    /// Error without any of them: what the controller itself leaves.
    pub without_all: Errors,
}

impl CausesResult {
    /// The cause without which the largest error is smallest.
    pub fn chief(&self) -> Option<&Without> {
        self.without.iter().min_by(|a, b| a.left.peak.total_cmp(&b.left.peak))
    }
}

/// A controlled insertion whose error is looked into.
#[derive(Clone, Copy)]
pub(super) struct Examined<'a> {
    pub(super) model: &'a TissueModel,
    pub(super) table: &'a Table<f64, 2>,
    pub(super) simulation: &'a Simulation,
    pub(super) reductions: &'a Reductions,
}

impl Examined<'_> {
    /// Takes every cause away in turn.
    ///
    /// # Errors
    /// [`SimError`]: the tissue fails without one.
    pub(super) fn causes(&self) -> Result<CausesResult, SimError> {
        let knowing = self.table_that_knows()?;
        let present: Vec<Cause> =
            Cause::VARIANTS.iter().copied().filter(|cause| self.has(*cause, knowing.as_ref())).collect();
        let left = |causes: &[Cause]| self.without(causes, knowing.as_ref());
        let without = present.iter().map(|cause| Ok(Without { cause: *cause, left: left(&[*cause])? }));
        Ok(CausesResult {
            whole: left(&[])?,
            without: without.collect::<Result<_, SimError>>()?,
            without_all: left(&present)?,
        })
    }

    /// A table of the simulated scene for the same paddle; none where the controller has it already.
    fn table_that_knows(&self) -> Result<Option<Table<f64, 2>>, SimError> {
        let options = TableOptions { needle_speed: self.simulation.needle_speed(), ..TableOptions::default() };
        let table = build(self.model, self.table.paddle.index, &options)?;
        Ok((table.knots != self.table.knots).then_some(table))
    }

    fn has(&self, cause: Cause, knowing: Option<&Table<f64, 2>>) -> bool {
        let (scene, Simulation { sensor, loop_settings, actuator, .. }) = (self.model.scene(), self.simulation);
        match cause {
            Cause::SensorNoise => {
                let noise = loop_settings.noise_for(self.simulation.depth);
                noise > 0.0 || sensor.quantisation > 0.0 || sensor.bias.norm() > 0.0 || sensor.outages.is_some()
            }
            Cause::SensorDelay => loop_settings.latency > 0.0,
            Cause::Table => knowing.is_some(),
            Cause::Motion => !scene.motion.is_none(),
            Cause::Deflection => scene.needle.deflection != 0.0,
            Cause::Paddle => actuator.lag_s > 0.0 || actuator.delay_ticks > 0 || actuator.gain != 1.0,
        }
    }

    fn without(&self, causes: &[Cause], knowing: Option<&Table<f64, 2>>) -> Result<Errors, SimError> {
        let is_gone = |cause| causes.contains(&cause);
        let mut believed = self.simulation.clone();
        if is_gone(Cause::SensorDelay) {
            believed.loop_settings.latency = 0.0;
            believed.sensor.latency = 0.0;
        }
        let mut simulation = believed.clone();
        if is_gone(Cause::SensorNoise) {
            simulation.loop_settings.noise = Some(0.0);
            let sensor = &mut simulation.sensor;
            (sensor.noise, sensor.quantisation, sensor.outages) = (0.0, 0.0, None);
            sensor.bias = Default::default();
        }
        if is_gone(Cause::Paddle) {
            let actuator = &mut simulation.actuator;
            (actuator.lag_s, actuator.delay_ticks, actuator.gain) = (0.0, 0, 1.0);
        }
        let table = knowing.filter(|_| is_gone(Cause::Table)).unwrap_or(self.table);
        let run = |model: &TissueModel, reductions: &Reductions| {
            let insertion = InProcess::new(model, &simulation, reductions).set_for(&believed);
            insertion.run(AttachedPaddle::Steered(table), false).map(|run| run.errors)
        };
        if !is_gone(Cause::Motion) && !is_gone(Cause::Deflection) {
            return run(self.model, self.reductions);
        }
        let mut scene: Scene = self.model.scene().clone();
        if is_gone(Cause::Motion) {
            scene.motion = Motion::default();
        }
        if is_gone(Cause::Deflection) {
            scene.needle.deflection = 0.0;
        }
        let (model, _) = discretise(&scene)?;
        run(&model, &Reductions::default())
    }
}
