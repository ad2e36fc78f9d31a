//! What a richer world than the table's leaves of a compensation: every combination of effects, every sensor, no paddle,
//! the best static paddles, and the controller with a table that knows the world and with one that does not.
//!
//! The loop is the firmware's own controller in this process and in simulated time; the tissue is the neighbourhood of each
//! insertion in its world, whose error against the full model is part of the result.

use firmware::contract::Table;
use model_offline::model::{ModelError, TissueModel};
use model_offline::parallel;
use model_offline::placement::{PlacementOptions, PlacementStudy, discretise};
use model_offline::scene::{Effect, Scene, Sensor, SensorPreset};
use model_offline::table::{TableOptions, build};
use serde::Serialize;

use super::error::SimError;
use super::in_process::{Errors, InProcess, Run};
use crate::runtime::signals;
use crate::world::loop_settings::{FeedbackLaw, LoopSettings};
use crate::world::simulation::Simulation;
use crate::world::tissue::{AttachedPaddle, Reductions};

/// Effects of a world: all combinations are tried.
const EFFECTS: [Effect; 3] = [Effect::Shaft, Effect::Creep, Effect::Breathing];

/// A number over many seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Nine in ten are not below.
    pub low: f64,
    /// Half are not above.
    pub median: f64,
    /// Nine in ten, with those below, are not above.
    pub high: f64,
}

/// The controller with one table, over all seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Controlled {
    /// Largest orthogonal error, length.
    pub peak: Spread,
    /// Its root mean square, length.
    pub rms: Spread,
    /// Least part of an insertion in RUN.
    pub run_share: f64,
    /// Largest error of the tissue's target displacement that it estimated of itself, length.
    pub tissue_estimate: f64,
    /// Largest error that the full model found along the first seed's insertion, length; none where it cannot go there.
    pub tissue_error: Option<f64>,
}

/// One sensor in one world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorRow {
    /// What sees the target.
    pub sensor: SensorPreset,
    /// The controller with a table of the world: of its needle, its tissue, not of its breath.
    pub known: Option<Controlled>,
    /// The controller with a table of a contact that moves with the needle in elastic tissue.
    pub simple: Controlled,
}

/// One world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorldRow {
    /// Its effects.
    pub effects: Vec<Effect>,
    /// Without a paddle.
    pub none: Errors,
    /// With the best static paddle.
    pub fixture: Errors,
    /// The controller, sensor by sensor.
    pub sensors: Vec<SensorRow>,
    /// Why there is no table that knows the world, where there is none.
    pub no_table: Option<String>,
}

/// What one sensor makes of a patient who breathes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BreathRow {
    /// What sees the target.
    pub sensor: SensorPreset,
    /// The controller that follows breaths behind.
    pub followed: Controlled,
    /// The one that predicts them, once it has seen one.
    pub predicted: Controlled,
}

/// A world in which the needle waits until the patient's breath is known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WaitingRow {
    /// Its effects.
    pub effects: Vec<Effect>,
    /// Seconds that the needle waits.
    pub wait_s: f64,
    /// How much longer or shorter, and larger or smaller, than the mean a breath may be: parts.
    pub varies: [f64; 2],
    /// Without a paddle.
    pub none: Errors,
    /// With the best static paddle.
    pub fixture: Errors,
    /// The controller with a table that knows the world, but for its breath, sensor by sensor.
    pub sensors: Vec<BreathRow>,
}

/// What one sensor is worth in the simplest world with a table of tissue that is another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherTissueRow {
    /// What sees the target.
    pub sensor: SensorPreset,
    /// The controller with a table of homogeneous tissue, in tissue with inclusions.
    pub homogeneous: Controlled,
    /// The one with a table of that tissue.
    pub known: Controlled,
}

/// A table of homogeneous tissue in tissue with inclusions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherTissue {
    /// Its feed-forward alone.
    pub fed_forward: Errors,
    /// With what the sensor shows, sensor by sensor.
    pub sensors: Vec<OtherTissueRow>,
}

/// All worlds of a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worlds {
    /// The scene.
    pub scene: String,
    /// Unit of its lengths.
    pub length_unit: String,
    /// Seeds of the sensors' noise, from 1.
    pub seeds: u64,
    /// Paddles: the best static one, the best dynamic one.
    pub paddles: [u32; 2],
    /// The worlds, from the simplest.
    pub rows: Vec<WorldRow>,
    /// Worlds that breathe, the needle having waited for some breaths.
    pub waiting: Vec<WaitingRow>,
    /// A table that does not know the inclusions, where there are some.
    pub other_tissue: Option<OtherTissue>,
}

/// Everything that all worlds of a scene share.
struct Basis<'a> {
    scene: &'a Scene,
    paddles: [u32; 2],
    simple: Table<f64, 2>,
    sensors: Vec<Sensor>,
    seeds: u64,
}

/// Tries all worlds; `progress` is called after each.
///
/// # Errors
/// [`SimError`]: tissue that cannot be modelled, or that fails in one of the worlds.
pub fn compare(scene: &Scene, seeds: u64, threads: usize, progress: &(dyn Fn() + Sync)) -> Result<Worlds, SimError> {
    let study = PlacementStudy::run(&scene.without_a_past(), &PlacementOptions { threads, ..Default::default() })?;
    let dynamic = study.placement.optimum.dynamic_paddle.ok_or(ModelError::NoPaddleControls)?;
    let basis = Basis {
        scene,
        paddles: [study.placement.optimum.static_paddle, dynamic],
        simple: build(&study.model, dynamic, &options(&Simulation::new(scene)))?,
        sensors: sensors(scene),
        seeds,
    };
    let combinations = 1_usize << EFFECTS.len();
    let rows = parallel::map(combinations, threads, |set| {
        let chosen = |k: &usize| set >> k & 1 == 1;
        let effects: Vec<Effect> = (0..EFFECTS.len()).filter(chosen).map(|k| EFFECTS[k]).collect();
        let row = signals::check().map_err(SimError::from).and_then(|()| basis.world(effects));
        progress();
        row
    });
    let rows = rows.into_iter().collect::<Result<_, _>>()?;
    let waiting = parallel::map(WAITING.len(), threads, |k| {
        let row = signals::check().map_err(SimError::from).and_then(|()| basis.waiting(WAITING[k]));
        progress();
        row
    });
    let waiting = waiting.into_iter().collect::<Result<_, _>>()?;
    let other_tissue = basis.other_tissue()?;
    progress();
    let Basis { paddles, .. } = basis;
    let (scene, length_unit) = (scene.name.clone(), scene.length_unit.clone());
    Ok(Worlds { scene, length_unit, seeds, paddles, rows, waiting, other_tissue })
}

/// Number of worlds that are tried, the one of other tissue with them.
pub fn count() -> u64 {
    (1 << EFFECTS.len()) + WAITING.len() as u64 + 1
}

/// Worlds that are tried with a needle that waits, and how their breaths vary.
const WAITING: [(&[Effect], [f64; 2]); 4] = [
    (&[Effect::Breathing], [0.0, 0.0]),
    (&[Effect::Breathing], [0.1, 0.2]),
    (&[Effect::Breathing], [0.2, 0.4]),
    (&EFFECTS, [0.0, 0.0]),
];
/// Breaths that it waits for: the first is seen when it ends, another makes it certain.
const BREATHS: f64 = 3.0;

/// A good sensor and one of practice, where the scene's unit of length is known.
fn sensors(scene: &Scene) -> Vec<Sensor> {
    let of = |preset: SensorPreset| preset.sensor(scene.needle.depth, &scene.length_unit).ok();
    let practical: Vec<Sensor> = [SensorPreset::Camera, SensorPreset::Ultrasound].into_iter().filter_map(of).collect();
    if practical.is_empty() { of(SensorPreset::Ideal).into_iter().collect() } else { practical }
}

fn options(simulation: &Simulation) -> TableOptions {
    TableOptions { needle_speed: simulation.needle_speed(), ..TableOptions::default() }
}

impl Basis<'_> {
    fn world(&self, effects: Vec<Effect>) -> Result<WorldRow, SimError> {
        let (scene, simulation) = self.with_only(&effects);
        let (model, _) = discretise(&scene)?;
        let reductions = Reductions::default();
        let [fixture, dynamic] = self.paddles;
        let uncontrolled =
            |paddle| InProcess::new(&model, &simulation, &reductions).run(paddle, false).map(|run| run.errors);
        let table = match effects.iter().any(|effect| *effect != Effect::Breathing) {
            true => Some(build(&model, dynamic, &options(&simulation))),
            false => None,
        };
        let (known, no_table) = match table {
            Some(Ok(table)) => (Some(table), None),
            Some(Err(error)) => (None, Some(error.to_string())),
            // Of a world whose needle and tissue are the simple ones it is the simple one.
            None => (Some(self.simple.clone()), None),
        };
        let sensors = self.sensors.iter().map(|sensor| {
            let loop_settings = LoopSettings { feedback: FeedbackLaw::default(), ..LoopSettings::of(sensor) };
            let seen = Simulation { sensor: *sensor, loop_settings, ..simulation.clone() };
            let controlled = |table| self.controlled(&model, &seen, table, &reductions);
            Ok(SensorRow {
                sensor: sensor.preset,
                known: known.as_ref().map(controlled).transpose()?,
                simple: controlled(&self.simple)?,
            })
        });
        let sensors = sensors.collect::<Result<_, SimError>>()?;
        Ok(WorldRow {
            effects,
            none: uncontrolled(AttachedPaddle::None)?,
            fixture: uncontrolled(AttachedPaddle::Held(fixture))?,
            sensors,
            no_table,
        })
    }

    /// The scene with these effects and no other, and an insertion at the speed that its forces are for.
    fn with_only(&self, effects: &[Effect]) -> (Scene, Simulation) {
        let mut scene = self.scene.with_only(effects);
        let simulation = Simulation::new(&scene);
        scene.set_speed(scene.needle.depth / simulation.needle.insertion_s());
        (scene, simulation)
    }

    /// The same with a needle that waits, the breath followed and foretold.
    fn waiting(&self, (effects, varies): (&[Effect], [f64; 2])) -> Result<WaitingRow, SimError> {
        let (mut scene, still) = self.with_only(effects);
        let period_s = scene.motion.breathing.as_mut().map_or(0.0, |breathing| {
            [breathing.period_variation, breathing.amplitude_variation] = varies;
            breathing.period
        });
        let wait_s = BREATHS * period_s;
        let simulation = still.clone().with_needle(still.needle.clone().after(wait_s));
        let (model, _) = discretise(&scene)?;
        let reductions = Reductions::default();
        let [fixture, dynamic] = self.paddles;
        let table = build(&model, dynamic, &options(&simulation))?;
        let uncontrolled =
            |paddle| InProcess::new(&model, &simulation, &reductions).run(paddle, false).map(|run| run.errors);
        let sensors = self.sensors.iter().map(|sensor| {
            let by = |feedback| {
                let loop_settings = LoopSettings { feedback, ..LoopSettings::of(sensor) };
                let simulation = Simulation { sensor: *sensor, loop_settings, ..simulation.clone() };
                self.controlled(&model, &simulation, &table, &reductions)
            };
            let (followed, predicted) = (by(FeedbackLaw::Observer)?, by(FeedbackLaw::Harmonic)?);
            Ok(BreathRow { sensor: sensor.preset, followed, predicted })
        });
        let sensors = sensors.collect::<Result<_, SimError>>()?;
        let (none, fixture) = (uncontrolled(AttachedPaddle::None)?, uncontrolled(AttachedPaddle::Held(fixture))?);
        Ok(WaitingRow { effects: effects.to_vec(), wait_s, varies, none, fixture, sensors })
    }

    /// The simplest world with a table of homogeneous tissue; none where the scene has no other.
    fn other_tissue(&self) -> Result<Option<OtherTissue>, SimError> {
        if self.scene.inclusions.is_empty() {
            return Ok(None);
        }
        let (scene, simulation) = self.with_only(&[]);
        let (model, _) = discretise(&scene)?;
        let (believed, _) = discretise(&scene.without_inclusions())?;
        let [_, dynamic] = self.paddles;
        let table = build(&believed, dynamic, &options(&simulation))?;
        let reductions = Reductions::default();
        let forward = InProcess::new(&model, &simulation, &reductions).fed_forward();
        let fed_forward = forward.run(AttachedPaddle::Steered(&table), false)?.errors;
        let sensors = self.sensors.iter().map(|sensor| {
            let loop_settings = LoopSettings { feedback: FeedbackLaw::Observer, ..LoopSettings::of(sensor) };
            let seen = Simulation { sensor: *sensor, loop_settings, ..simulation.clone() };
            let homogeneous = self.controlled(&model, &seen, &table, &reductions)?;
            let known = self.controlled(&model, &seen, &self.simple, &reductions)?;
            Ok(OtherTissueRow { sensor: sensor.preset, homogeneous, known })
        });
        let sensors = sensors.collect::<Result<_, SimError>>()?;
        Ok(Some(OtherTissue { fed_forward, sensors }))
    }

    fn controlled(
        &self,
        model: &TissueModel,
        simulation: &Simulation,
        table: &Table<f64, 2>,
        reductions: &Reductions,
    ) -> Result<Controlled, SimError> {
        let runs = (1..=self.seeds).map(|seed| {
            signals::check()?;
            let simulation = Simulation { seed, ..simulation.clone() };
            InProcess::new(model, &simulation, reductions).run(AttachedPaddle::Steered(table), seed == 1)
        });
        let runs: Vec<Run> = runs.collect::<Result<_, SimError>>()?;
        Ok(Controlled {
            peak: spread(runs.iter().map(|run| run.errors.peak)),
            rms: spread(runs.iter().map(|run| run.errors.rms)),
            run_share: runs.iter().map(|run| run.run_share).fold(1.0, f64::min),
            tissue_estimate: runs.iter().map(|run| run.tissue_estimate).fold(0.0, f64::max),
            tissue_error: runs.first().and_then(|run| run.tissue_error),
        })
    }
}

/// Median, and the range of the middle nine tenths.
fn spread(values: impl Iterator<Item = f64>) -> Spread {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
    Spread { low: at(0.05), median: at(0.5), high: at(0.95) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_twenty_is_their_middle_eighteen() {
        let Spread { low, median, high } = spread((1..=20).rev().map(f64::from));
        assert_eq!((low, median, high), (2.0, 11.0, 19.0));
        assert_eq!(spread(std::iter::once(3.0)), Spread { low: 3.0, median: 3.0, high: 3.0 });
    }

    /// Of the simplest world there is nothing that the simple table does not know, and a fixture is what it always was.
    #[test]
    fn in_the_simplest_world_both_tables_are_one() {
        let scene = Scene::bundled("paper").unwrap();
        let worlds = compare(&scene, 2, 2, &|| {}).unwrap();
        assert_eq!((worlds.rows.len() + worlds.waiting.len()) as u64 + 1, count());
        let simplest = &worlds.rows[0];
        assert!(simplest.effects.is_empty() && simplest.no_table.is_none());
        for row in &simplest.sensors {
            assert_eq!(row.known.as_ref(), Some(&row.simple));
            assert!(row.simple.peak.median < 0.1 * simplest.fixture.peak, "{row:?}");
        }
        // A table of other tissue leaves more than one of this tissue, and the sensor repairs it.
        let other = worlds.other_tissue.unwrap();
        assert_eq!(other.sensors.len(), simplest.sensors.len());
        for (row, same) in other.sensors.iter().zip(&simplest.sensors) {
            assert_eq!(row.known, same.simple);
            assert!(row.known.rms.median < row.homogeneous.rms.median, "{row:?}");
            assert!(row.homogeneous.rms.median < 0.1 * other.fed_forward.rms, "{row:?} {:?}", other.fed_forward);
        }
        // Whoever breathes moves the target without a needle.
        let breathing = worlds.rows.iter().find(|row| row.effects == [Effect::Breathing]).unwrap();
        assert!(breathing.none.peak > 1.5 * simplest.none.peak);
        // Who has seen some breaths knows the next ones.
        for WaitingRow { varies, sensors, .. } in &worlds.waiting {
            let least = if *varies == [0.0; 2] { 0.6 } else { 1.0 };
            assert!(
                sensors.iter().all(|row| row.predicted.rms.median < least * row.followed.rms.median),
                "{sensors:?}"
            );
        }
    }
}
