//! Strategies compared on a body in space: no paddle, the best static paddles, and the paddles that control the target best.
//!
//! The controller is a process of its own, as in the plane; a [table of states](model_offline::reduction::tabulated) is the tissue.

mod insertion;
mod parts;

use std::path::Path;
use std::time::Instant;

use firmware::scalar::ScalarKind;
use firmware::{Faults, Mode};
use model_offline::model::ModelError;
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::output::table_text::hex;
use model_offline::parallel;
use model_offline::placement::space::insertion::InsertionModel;
use model_offline::placement::space::study::{SpaceOptimum, place_in_space};
use model_offline::placement::space::workflow::insertion_model;
use model_offline::reduction::TabulationReport;
use model_offline::scene::TissueVariant;
use model_offline::scene::space::SpaceScene;
use model_offline::table::space::SpaceTable;
use model_offline::table::{BuiltTable, TableOptions};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::comparison::ends_early;
use super::error::SimError;
use super::forecast::Forecast;
use super::insertion::linked::LinkedController;
use super::insertion::{Extras, Label};
use super::progress::{Progress, Silent};
use super::result::{FORMAT, RecordingResult, stillest};
use super::space_bodies::{self, CaseBodies, SpaceBodies};
use super::strategy::Strategy;
use crate::exchange::board::{Control, Image, Processor};
use crate::record::files::Artifact;
use crate::runtime::accounting::ledger::LedgerResult;
use crate::runtime::executor::Hardware;
use crate::runtime::names;
use crate::runtime::plant::observer::Spectator;
use crate::runtime::signals;
use crate::runtime::time::durations::LoopTiming;
use crate::runtime::time::mode::RunMode;
use crate::world::simulation::Simulation;
use crate::world::space::PreparedBody;

use self::insertion::Insertion;
use self::parts::Shared;

/// A run on a body in space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceRun {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of host-sim.
    pub version: String,
    /// Name of the scene.
    pub scene: String,
    /// 3.
    pub dimension: u32,
    /// Labels of length and stress.
    pub units: [String; 2],
    /// What drove time in the comparison of strategies.
    pub mode: RunMode,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Rate of the loop, Hz.
    pub rate_hz: f64,
    /// Rate of the target's sensor, Hz.
    pub target_rate_hz: f64,
    /// Its latency, ms.
    pub target_latency_ms: f64,
    /// Standard deviation of its noise per component, length.
    pub noise: f64,
    /// Depth of the insertion, length.
    pub depth: f64,
    /// Duration of the insertion, s.
    pub insertion_s: f64,
    /// Nodes of the model of insertions.
    pub nodes: usize,
    /// The comparisons.
    pub cases: Vec<SpaceCase>,
    /// Duration of the whole, s.
    pub wall_s: f64,
    /// The bodies at the end, for pictures.
    pub bodies: SpaceBodies,
}

impl SpaceRun {
    /// What is wrong with a run that was read from a file; nothing that could not be drawn passes.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self) -> Result<(), String> {
        if self.bodies.are_of(self.cases.len()) { Ok(()) } else { Err("its bodies are not whole".to_owned()) }
    }
}

/// Strategies on one tissue with one table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceCase {
    /// Tissue of the simulation.
    pub tissue: TissueVariant,
    /// Tissue that the planner and the table believed in.
    pub table_tissue: TissueVariant,
    /// The table.
    pub table: SpaceTableResult,
    /// No paddle.
    pub none: SpaceStrategyResult,
    /// The static paddles that are best in the table's tissue.
    #[serde(rename = "static")]
    pub fixture: SpaceStrategyResult,
    /// The table's paddles, controlled.
    pub dynamic: SpaceStrategyResult,
    /// The same once more on the machine's clock, where that was not asked for alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dynamic_free_run: Option<SpaceStrategyResult>,
    /// Largest error of `static` over that of `dynamic`.
    pub improvement: f64,
    /// Largest error without a paddle over that of `dynamic`.
    pub improvement_over_none: f64,
}

impl SpaceCase {
    /// Which of `none`, `static` and `dynamic` leaves the target stillest; `dynamic` where all do.
    pub fn stillest(&self) -> Strategy {
        stillest(Some(self.improvement), Some(self.improvement_over_none))
    }
}

/// A table in short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceTableResult {
    /// SHA-256 of its bytes.
    pub hash: String,
    /// SHA-256 of the scene that it was made from.
    pub scene_hash: String,
    /// Its paddles.
    pub paddles: Vec<u32>,
    /// Its size, bytes.
    pub bytes: usize,
    /// Deepest knot, length.
    pub depth_end: f64,
    /// Where and why it ends before the needle does; results of older versions do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ends_early: Option<String>,
}

/// One simulated insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceStrategyResult {
    /// What drove time.
    pub mode: RunMode,
    /// The attached paddles.
    pub paddles: Vec<u32>,
    /// Largest true target displacement orthogonal to the needle, length.
    pub max_orthogonal_error: f64,
    /// Depth at which it occurs, length.
    pub max_error_depth: f64,
    /// Its root mean square, length.
    pub rms_orthogonal_error: f64,
    /// Length of the way of all paddles.
    pub paddle_travel: f64,
    /// State of the controller at the end; none without one.
    #[serde(with = "names::mode")]
    #[schemars(with = "String")]
    pub final_state: Option<Mode>,
    /// Part of the ticks from the needle's start on that ended in RUN; none without a controller.
    pub run_share: Option<f64>,
    /// Every fault that was ever present.
    #[serde(with = "names::faults")]
    #[schemars(with = "String")]
    pub faults: Faults,
    /// Faults of the ticks that did not end in RUN, from the needle's start on.
    #[serde(with = "names::faults")]
    #[schemars(with = "String")]
    pub outside_run_for: Faults,
    /// Accounts of samples, commands and ticks over both processes; none without a controller.
    pub ledger: Option<LedgerResult>,
    /// Timing of the controller's loop; free-run only.
    pub timing: Option<LoopTiming>,
    /// Timing of the plant's loop; free-run only.
    pub plant_timing: Option<LoopTiming>,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// SHA-256 of the table's bytes.
    pub table_hash: Option<String>,
    /// The recording; none without a controller.
    pub recording: Option<RecordingResult>,
    /// Name of the time series.
    pub csv: Option<String>,
    /// What answered for the tissue.
    pub plant: SpacePlantAccount,
    /// The way of target and paddles, thinned out.
    pub series: Vec<SpaceSeriesPoint>,
}

/// What answered for the tissue, and how well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpacePlantAccount {
    /// How it was tabulated.
    pub tabulation: TabulationReport,
    /// Mean time of a step of the table, µs, on the way of this run once more.
    pub step_us: f64,
    /// Steps that the full model answered.
    pub fallbacks: u64,
    /// Why, the first time.
    pub first_fallback: Option<String>,
    /// Largest error that the table estimated of itself, length.
    pub largest_estimate: f64,
    /// Largest distance from the full model at some states of the run, length; none where it could not go there.
    pub largest_error: Option<f64>,
}

/// A moment of an insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceSeriesPoint {
    /// Time since the start of the needle, s.
    pub time_s: f64,
    /// Needle depth, length.
    pub depth: f64,
    /// Length of the target's displacement orthogonal to the needle.
    pub orthogonal_error: f64,
    /// Its displacement along the needle, length.
    pub axial: f64,
    /// Displacement of every paddle, length.
    pub paddles: Vec<[f64; 3]>,
}

/// A tissue with what is best on it.
#[derive(Debug)]
struct Tissue {
    model: InsertionModel,
    optimum: SpaceOptimum,
}

/// What is to be compared.
#[derive(Clone, Copy, Debug)]
pub struct SpaceOptions<'a> {
    /// This program, which is also the controller.
    pub program: &'a Path,
    /// Tissue of the simulation; none: both, and the one with inclusions by what homogeneous tissue says.
    pub tissue: Option<TissueVariant>,
    /// Tissue that planner and table believe in; none: the simulation's.
    pub table_tissue: Option<TissueVariant>,
    /// What drives time; none: lockstep, then the controlled paddles once more in free-run.
    pub mode: Option<RunMode>,
    /// What computes the controller's steps: a board in lockstep only, and two paddles.
    pub hardware: Hardware,
    /// Files for other tools that are not always written.
    pub extras: Extras,
    /// Threads for placement and tabulation.
    pub threads: usize,
}

impl SpaceOptions<'_> {
    /// Whether a case of this tissue and this one of its table is controlled once more, in free-run.
    fn is_once_more(&self, [tissue, table_tissue]: [TissueVariant; 2]) -> bool {
        self.mode.is_none() && tissue == table_tissue && self.hardware == Hardware::Native
    }
}

/// Strategies on a body in space that are about to be compared: on both of its tissues, and on the one with inclusions by what
/// homogeneous tissue says; or on one tissue alone.
pub struct SpaceComparison<'a> {
    scene: &'a SpaceScene,
    options: SpaceOptions<'a>,
    simulation: &'a Simulation,
    progress: &'a dyn Progress,
    forecast: Forecast,
    homogeneous: Tissue,
    inclusion: Option<Tissue>,
    /// Tissues of simulation and table.
    wanted: Vec<(TissueVariant, TissueVariant)>,
    start: Instant,
}

impl std::fmt::Debug for SpaceComparison<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SpaceComparison").field("options", &self.options).finish_non_exhaustive()
    }
}

impl<'a> SpaceComparison<'a> {
    /// Finds what is best on every tissue.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn prepare(
        scene: &'a SpaceScene,
        options: &SpaceOptions<'a>,
        simulation: &'a Simulation,
        progress: &'a dyn Progress,
    ) -> Result<Self, SimError> {
        let start = Instant::now();
        let SpaceOptions { tissue, table_tissue, threads, .. } = *options;
        if options.hardware == Hardware::Qemu && options.mode == Some(RunMode::FreeRun) {
            return Err(SimError::QemuIsLockstepOnly);
        }
        if scene.inclusions.is_empty() && [tissue, table_tissue].contains(&Some(TissueVariant::Inclusion)) {
            return Err(SimError::NoInclusion { scene: scene.name.clone() });
        }
        let own = scene.tissue();
        let wanted = match (tissue, table_tissue) {
            (Some(tissue), believed) => vec![(tissue, believed.unwrap_or(tissue))],
            (None, Some(believed)) => vec![(own, believed)],
            (None, None) if own == TissueVariant::Homogeneous => vec![(own, own)],
            (None, None) => vec![
                (TissueVariant::Homogeneous, TissueVariant::Homogeneous),
                (TissueVariant::Inclusion, TissueVariant::Inclusion),
                (TissueVariant::Inclusion, TissueVariant::Homogeneous),
            ],
        };
        let mut parts = parts::before(if scene.inclusions.is_empty() { 1 } else { 2 });
        // Which paddles are controlled the studies will tell: as a rule the same ones by every table.
        parts.extend(parts::insertions(&wanted, options, simulation.duration_s, |_| [&[], &[]]));
        let forecast = Forecast::of(parts);
        let begins = |what: &str| forecast.steps_on(what, progress);
        let (homogeneous, inclusion) = signals::ends_at_once(|| tissues(scene, threads, &begins))?;
        let prepared =
            Self { scene, options: *options, simulation, progress, forecast, homogeneous, inclusion, wanted, start };
        let best = |variant| {
            let SpaceOptimum { fixture, dynamic, .. } = &prepared.of(variant).optimum;
            [fixture.as_slice(), dynamic.as_slice()]
        };
        prepared.forecast.foresee(parts::insertions(&prepared.wanted, options, simulation.duration_s, best));
        if options.hardware == Hardware::Qemu {
            prepared.build_images()?;
        }
        Ok(prepared)
    }

    /// Builds what the board is to run, before anybody waits for it: compiling takes a while the first time.
    fn build_images(&self) -> Result<(), SimError> {
        for (_, believed) in &self.wanted {
            let control = Control::of(3, self.of(*believed).optimum.dynamic.len(), ScalarKind::F64)?;
            Image::build_for(control, ScalarKind::F64, Processor::Double)?;
        }
        Ok(())
    }

    fn of(&self, variant: TissueVariant) -> &Tissue {
        match (variant, &self.inclusion) {
            (TissueVariant::Inclusion, Some(tissue)) => tissue,
            _ => &self.homogeneous,
        }
    }

    /// The body at rest, with its inclusions.
    pub fn geometry(&self) -> SpaceGeometry {
        SpaceGeometry::new(self.inclusion.as_ref().unwrap_or(&self.homogeneous).model.coarse())
    }

    /// Indices of the paddles that are controlled in the last case.
    pub fn paddles(&self) -> &[u32] {
        self.wanted.last().map_or(&[], |(_, believed)| &self.of(*believed).optimum.dynamic)
    }

    /// Simulates everything, with somebody who looks on at what is controlled. Recordings and time series come with the result.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn run(&self, spectator: Option<&dyn Spectator>) -> Result<(SpaceRun, Vec<Artifact>), SimError> {
        let Self { scene, options, simulation, homogeneous, .. } = self;
        let mut bodies = SpaceBodies { geometry: self.geometry(), cases: Vec::new() };
        let (mut cases, mut artifacts, mut shared) = (Vec::new(), Vec::new(), Shared::default());
        for &(tissue, believed) in &self.wanted {
            let compared = self.case([tissue, believed], spectator, &mut shared, &mut artifacts)?;
            self.begins(&format!("{tissue}: the body at the end"));
            bodies.cases.push(signals::ends_at_once(|| bodies_of(&self.of(tissue).model, &compared)));
            cases.push(compared);
        }
        let settings = simulation.loop_settings;
        let result = SpaceRun {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.name.clone(),
            dimension: 3,
            units: [scene.length_unit.clone(), scene.stress_unit.clone()],
            mode: options.mode.unwrap_or(RunMode::Lockstep),
            seed: simulation.seed,
            rate_hz: settings.rate,
            target_rate_hz: settings.target_rate,
            target_latency_ms: settings.latency,
            noise: settings.noise_for(simulation.depth),
            depth: simulation.depth,
            insertion_s: simulation.needle.insertion_s(),
            nodes: homogeneous.model.nodes(),
            cases,
            wall_s: self.start.elapsed().as_secs_f64(),
            bodies,
        };
        Ok((result, artifacts))
    }

    /// A tissue, by the table of what is believed to be one.
    fn case<'s>(
        &'s self,
        [tissue, table_tissue]: [TissueVariant; 2],
        spectator: Option<&dyn Spectator>,
        shared: &mut Shared<'s>,
        artifacts: &mut Vec<Artifact>,
    ) -> Result<SpaceCase, SimError> {
        let (world, believed) = (self.of(tissue), self.of(table_tissue));
        let Self { simulation, options, .. } = *self;
        let SpaceOptions { program, threads, extras, hardware, .. } = options;
        let label = |strategy| Label { tissue, table_tissue, strategy };
        let case = match tissue == table_tissue {
            true => tissue.to_string(),
            false => format!("{tissue} (table: {table_tissue})"),
        };
        let Shared { tables, bodies, none } = shared;
        let built = tables.get(table_tissue, || {
            self.begins(&format!("{table_tissue}: table"));
            signals::ends_at_once(|| table_of(believed, simulation))
        })?;
        let BuiltTable { table, ended } = &*built;
        let mut still = |strategy, paddles: &[u32]| {
            self.begins(&format!("{case}: {strategy}"));
            signals::ends_at_once(|| -> Result<SpaceStrategyResult, SimError> {
                let key = (tissue, false, paddles.to_vec());
                let body = bodies.get(key, || PreparedBody::new(&world.model, paddles, false, threads))?;
                let label = label(strategy);
                Insertion { body: &body, simulation, label, extras, spectator: None, is_held_against_full: true }
                    .uncontrolled(artifacts)
            })
        };
        // What no paddle touches is the same whatever a table knows.
        let none = (*none.get(tissue, || still(Strategy::None, &[]))?).clone();
        let fixture = still(Strategy::Static, &believed.optimum.fixture)?;
        let bytes = table.to_bytes()?;
        let key = (tissue, true, table.paddles());
        let body = bodies.get(key, || {
            self.begins(&format!("{case}: states of the controlled body"));
            signals::ends_at_once(|| PreparedBody::new(&world.model, &table.paddles(), true, threads))
        })?;
        let mut controlled = |mode| -> Result<SpaceStrategyResult, SimError> {
            self.begins(&format!("{case}: dynamic, {mode}"));
            let is_watched = spectator.is_some();
            let controller = LinkedController { program, table_bytes: &bytes, mode, hardware, is_watched };
            let label = label(Strategy::dynamic(mode));
            Insertion { body: &body, simulation, label, extras, spectator, is_held_against_full: true }
                .controlled(controller, artifacts)
        };
        let dynamic = controlled(options.mode.unwrap_or(RunMode::Lockstep))?;
        // As in the plane: a table of another tissue repeats nothing that this tissue's own case shows already.
        let dynamic_free_run =
            if options.is_once_more([tissue, table_tissue]) { Some(controlled(RunMode::FreeRun)?) } else { None };
        Ok(SpaceCase {
            tissue,
            table_tissue,
            table: SpaceTableResult {
                hash: hex(&Sha256::digest(&bytes)),
                scene_hash: hex(&believed.model.scene().hash()),
                paddles: table.paddles(),
                bytes: bytes.len(),
                depth_end: table.validity().depth_end,
                ends_early: ends_early(table.validity().depth_end, simulation.needle.depth(), ended.as_ref()),
            },
            improvement: fixture.max_orthogonal_error / dynamic.max_orthogonal_error,
            improvement_over_none: none.max_orthogonal_error / dynamic.max_orthogonal_error,
            none,
            fixture,
            dynamic,
            dynamic_free_run,
        })
    }

    fn begins(&self, what: &str) {
        self.forecast.steps_on(what, self.progress);
    }

    /// The controlled insertion of the last case, to be repeated; it is tabulated again.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn last_case(&self) -> Result<Option<RepeatedCase<'_>>, SimError> {
        let Some(&(tissue, table_tissue)) = self.wanted.last() else { return Ok(None) };
        let (world, believed) = (self.of(tissue), self.of(table_tissue));
        let repeated = signals::ends_at_once(|| -> Result<_, SimError> {
            let table = table_of(believed, self.simulation)?.table;
            let body = PreparedBody::new(&world.model, &table.paddles(), true, self.options.threads)?;
            Ok((body, table.to_bytes()?))
        });
        let (body, table_bytes) = repeated?;
        let SpaceOptions { program, hardware, .. } = self.options;
        Ok(Some(RepeatedCase { body, table_bytes, program, hardware, tissue, table_tissue }))
    }
}

/// A controlled insertion that is repeated.
#[derive(Debug)]
pub struct RepeatedCase<'c> {
    body: PreparedBody<'c>,
    table_bytes: Vec<u8>,
    program: &'c Path,
    hardware: Hardware,
    tissue: TissueVariant,
    table_tissue: TissueVariant,
}

impl RepeatedCase<'_> {
    /// Inserts once more; nothing is recorded.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn insert(
        &self,
        simulation: &Simulation,
        mode: RunMode,
        spectator: &dyn Spectator,
    ) -> Result<SpaceStrategyResult, SimError> {
        let Self { body, table_bytes, program, hardware, tissue, table_tissue } = self;
        let label = Label { tissue: *tissue, table_tissue: *table_tissue, strategy: Strategy::dynamic(mode) };
        let controller = LinkedController { program, table_bytes, mode, hardware: *hardware, is_watched: true };
        let (extras, spectator) = (Extras::default(), Some(spectator));
        let insertion = Insertion { body, simulation, label, extras, spectator, is_held_against_full: false };
        insertion.controlled(controller, &mut Vec::new())
    }
}

/// Compares strategies without anybody who looks on.
///
/// # Errors
/// [`SimError`].
pub fn compare(
    scene: &SpaceScene,
    options: &SpaceOptions<'_>,
    simulation: &Simulation,
) -> Result<(SpaceRun, Vec<Artifact>), SimError> {
    SpaceComparison::prepare(scene, options, simulation, &Silent)?.run(None)
}

/// The homogeneous tissue of a scene, and the one with its inclusions where there are any, with what is best on them.
fn tissues(scene: &SpaceScene, threads: usize, begins: &dyn Fn(&str)) -> Result<(Tissue, Option<Tissue>), SimError> {
    begins(&format!("{}: placement", TissueVariant::Homogeneous));
    let with = parallel::within(threads, || insertion_model(scene));
    let with = with.map_err(|source| SimError::of_tissue(scene.tissue(), None, source))?;
    let study = |model: InsertionModel| {
        let placement = place_in_space(&model, threads, &|| ())?;
        Ok(Tissue { optimum: placement.optimum, model })
    };
    let of = |tissue| move |source: ModelError| SimError::of_tissue(tissue, None, source);
    let homogeneous = parallel::within(threads, || with.without_inclusions()).and_then(study);
    let homogeneous = homogeneous.map_err(of(TissueVariant::Homogeneous))?;
    let with = (!scene.inclusions.is_empty()).then(|| {
        begins(&format!("{}: placement", TissueVariant::Inclusion));
        study(with)
    });
    let inclusion = with.transpose().map_err(of(TissueVariant::Inclusion))?;
    Ok((homogeneous, inclusion))
}

/// The bodies at the end of a case's insertions.
fn bodies_of(model: &InsertionModel, case: &SpaceCase) -> CaseBodies {
    [&case.none, &case.fixture, &case.dynamic].map(|result| {
        let way: Vec<_> = result.series.iter().map(|point| (point.depth, point.paddles.as_slice())).collect();
        space_bodies::at_end(model, &result.paddles, &way)
    })
}

/// The table of the paddles that control a tissue best.
fn table_of(believed: &Tissue, simulation: &Simulation) -> Result<BuiltTable<SpaceTable>, SimError> {
    let options = TableOptions { needle_speed: simulation.needle_speed(), ..TableOptions::default() };
    Ok(SpaceTable::build_as_deep_as_it_goes(&believed.model, &believed.optimum.dynamic, &options)?)
}
