//! What the error of a controlled insertion is made of: the same insertion with one cause taken away at a time, and with
//! all of them.
//!
//! Causes do not add up: noise that is taken away lets nothing else be seen better, and a table that knows everything
//! leaves a slow sensor nothing to be slow about. What each is worth is what is left without it alone.

use firmware::contract::{Knot, Table};
use model_offline::model::TissueModel;
use model_offline::placement::discretise;
use model_offline::scene::{Motion, Scene};
use model_offline::table::{TableOptions, build};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::VariantArray as _;

use super::bound::{Bound, Seen, Unknown, least_error_at_rate};
use super::error::SimError;
use super::in_process::{Errors, InProcess};
use crate::world::loop_settings::LoopSettings;
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
    /// What any other controller would leave at least.
    pub bound: Bound,
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
            bound: self.bound(&present, knowing.as_ref())?,
        })
    }

    /// What no causal controller with this table, sensor and paddle can leave less than. It does not know how large what the
    /// table leaves is, cause by cause.
    fn bound(&self, present: &[Cause], knowing: Option<&Table<f64, 2>>) -> Result<Bound, SimError> {
        let Self { table, simulation, .. } = self;
        let blind = |causes: &[Cause]| {
            self.inserted(causes, knowing, |insertion, table| {
                insertion.fed_forward().moments(AttachedPaddle::Steered(table))
            })
        };
        let whole = blind(&[])?;
        let unknown = present.iter().filter(|cause| matches!(cause, Cause::Table | Cause::Motion | Cause::Deflection));
        let shapes = unknown.map(|cause| {
            let without = blind(&[*cause])?;
            let left = whole.iter().zip(without);
            Ok(left.map(|(with, without)| [with.error - without.error, with.axial - without.axial]).collect())
        });
        let shapes = shapes.collect::<Result<Vec<Vec<[f64; 2]>>, SimError>>()?;
        let times_s: Vec<f64> = whole.iter().map(|moment| moment.since_start_s).collect();
        let unknown = Unknown {
            times_s: &times_s,
            shapes: &shapes,
            counts_from: whole.iter().position(|moment| moment.counts).unwrap_or(0),
        };
        let LoopSettings { target_rate, latency, quantisation, rate, .. } = simulation.loop_settings;
        let rounding = quantisation * quantisation / 12.0;
        let seen = Seen {
            period_s: 1.0 / target_rate,
            latency_s: 1e-3 * latency + simulation.actuator.delay_ticks as f64 / rate,
            noise: (simulation.loop_settings.noise_for(simulation.depth).powi(2) + rounding).sqrt(),
        };
        // The paddle is attached and holds already where it does not move.
        let held = AttachedPaddle::Held(table.paddles[0].index);
        let alone = self.inserted(&[], knowing, |insertion, _| insertion.moments(held))?;
        let pushed: Vec<f64> = alone.iter().map(|moment| moment.error).collect();
        let times_alone: Vec<f64> = alone.iter().map(|moment| moment.since_start_s).collect();
        Ok(Bound {
            sensor: unknown.least_error(&seen),
            delay: unknown.least_error(&Seen { noise: 0.0, ..seen }),
            paddle: least_error_at_rate(&times_alone, &pushed, self.fastest()),
        })
    }

    /// How fast the paddle can move the target across the needle at most, length/s: by its own motion, and by what the
    /// deeper needle makes of a displacement that it has already. As far as the tissue is linear in the paddle's displacement.
    fn fastest(&self) -> f64 {
        let Self { table, simulation, .. } = self;
        let normal = self.model.scene().needle.orthogonal();
        let across = |knot: &Knot<f64, 2>| knot.jacobian[0].tr_mul(&normal);
        let effect = table.knots.iter().map(|knot| across(knot).norm()).fold(0.0, f64::max);
        let per_depth = table.knots.windows(2).map(|pair| {
            let [shallow, deep] = [&pair[0], &pair[1]];
            (across(deep) - across(shallow)).norm() / (deep.depth - shallow.depth)
        });
        let change = per_depth.fold(0.0, f64::max);
        let farthest = (simulation.actuator.max_rate * simulation.duration_s).min(table.paddles[0].max_displacement);
        effect * simulation.actuator.max_rate + change * simulation.needle_speed() * farthest
    }

    /// A table of the simulated scene for the same paddle; none where the controller has it already.
    fn table_that_knows(&self) -> Result<Option<Table<f64, 2>>, SimError> {
        let options = TableOptions { needle_speed: self.simulation.needle_speed(), ..TableOptions::default() };
        let table = build(self.model, self.table.paddles[0].index, &options)?;
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
        self.inserted(causes, knowing, |insertion, table| {
            insertion.run(AttachedPaddle::Steered(table), false).map(|run| run.errors)
        })
    }

    /// The insertion without some causes, and the table that it is steered by.
    fn inserted<R>(
        &self,
        causes: &[Cause],
        knowing: Option<&Table<f64, 2>>,
        then: impl Fn(InProcess<'_>, &Table<f64, 2>) -> Result<R, SimError>,
    ) -> Result<R, SimError> {
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
            then(InProcess::new(model, &simulation, reductions).set_for(&believed), table)
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
