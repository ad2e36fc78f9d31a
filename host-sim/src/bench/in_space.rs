//! Strategies compared on a body in space: no paddle, the best static paddles, and the paddles that control the target best.
//!
//! The controller is a process of its own, as in the plane; a [table of states](model_offline::reduction::tabulated) is the tissue.

use std::hint::black_box;
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
use model_offline::reduction::{TabulatedBody, TabulationReport};
use model_offline::scene::TissueVariant;
use model_offline::scene::space::SpaceScene;
use model_offline::table::space::SpaceTable;
use model_offline::table::{BuiltTable, TableBuildError, TableOptions};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::comparison::ends_early;
use super::error::SimError;
use super::insertion::linked::{LinkedController, LinkedInsertion, RunShare};
use super::insertion::{Extras, Label};
use super::result::{FORMAT, RecordingResult, stillest};
use super::space_bodies::{self, CaseBodies, SpaceBodies};
use super::strategy::Strategy;
use crate::exchange::board::{Control, Image, Processor};
use crate::record::export::foxglove::{Scenery as _, SpaceStage};
use crate::record::export::{csv, mcap, paraview};
use crate::record::files::Artifact;
use crate::record::recording::{Record, Recording};
use crate::runtime::accounting::ledger::LedgerResult;
use crate::runtime::executor::{AnyTable, Hardware};
use crate::runtime::names;
use crate::runtime::plant::PlantLoop;
use crate::runtime::plant::observer::{ObservedInsertion, Spectator};
use crate::runtime::plant::rehearsal::space_in_time;
use crate::runtime::signals;
use crate::runtime::time::durations::LoopTiming;
use crate::runtime::time::mode::RunMode;
use crate::world::retrace::solved_bodies;
use crate::world::simulation::Simulation;
use crate::world::space::{PreparedBody, SpaceTissue};
use crate::world::truth::{Truth, from_frame};

/// Points of a time series in the result.
const SERIES_POINTS: usize = 500;
/// States at which the tissue is held against the model that it was tabulated from, after a run.
const CHECKS: usize = 20;

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

/// Strategies on a body in space that are about to be compared: on both of its tissues, and on the one with inclusions by what
/// homogeneous tissue says; or on one tissue alone.
#[derive(Debug)]
pub struct SpaceComparison<'a> {
    scene: &'a SpaceScene,
    options: SpaceOptions<'a>,
    simulation: &'a Simulation,
    homogeneous: Tissue,
    inclusion: Option<Tissue>,
    /// Tissues of simulation and table.
    wanted: Vec<(TissueVariant, TissueVariant)>,
    start: Instant,
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
        let (homogeneous, inclusion) = signals::ends_at_once(|| tissues(scene, threads))?;
        let prepared = Self { scene, options: *options, simulation, homogeneous, inclusion, wanted, start };
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
        let (mut cases, mut artifacts) = (Vec::new(), Vec::new());
        for &(tissue, believed) in &self.wanted {
            let (world, table) = ((tissue, self.of(tissue)), (believed, self.of(believed)));
            let compared = case(world, table, simulation, (options, spectator), &mut artifacts)?;
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
    SpaceComparison::prepare(scene, options, simulation)?.run(None)
}

/// The homogeneous tissue of a scene, and the one with its inclusions where there are any, with what is best on them.
fn tissues(scene: &SpaceScene, threads: usize) -> Result<(Tissue, Option<Tissue>), SimError> {
    let with = parallel::within(threads, || insertion_model(scene));
    let with = with.map_err(|source| SimError::of_tissue(scene.tissue(), None, source))?;
    let study = |model: InsertionModel| {
        let placement = place_in_space(&model, threads, &|| ())?;
        Ok(Tissue { optimum: placement.optimum, model })
    };
    let of = |tissue| move |source: ModelError| SimError::of_tissue(tissue, None, source);
    let homogeneous = parallel::within(threads, || with.without_inclusions()).and_then(study);
    let homogeneous = homogeneous.map_err(of(TissueVariant::Homogeneous))?;
    let inclusion = (!scene.inclusions.is_empty()).then(|| study(with)).transpose();
    let inclusion = inclusion.map_err(of(TissueVariant::Inclusion))?;
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

fn case(
    (tissue, world): (TissueVariant, &Tissue),
    (table_tissue, believed): (TissueVariant, &Tissue),
    simulation: &Simulation,
    (options, spectator): (&SpaceOptions<'_>, Option<&dyn Spectator>),
    artifacts: &mut Vec<Artifact>,
) -> Result<SpaceCase, SimError> {
    let SpaceOptions { program, threads, extras, hardware, .. } = *options;
    let label = |strategy| Label { tissue, table_tissue, strategy };
    let mut still = |strategy, paddles: &[u32]| -> Result<SpaceStrategyResult, SimError> {
        let body = PreparedBody::new(&world.model, paddles, false, threads)?;
        let label = label(strategy);
        Insertion { body: &body, simulation, label, extras, spectator: None, is_held_against_full: true }
            .uncontrolled(artifacts)
    };
    let ((table, ended), none, fixture) = signals::ends_at_once(|| -> Result<_, SimError> {
        let BuiltTable { table, ended } = table_of(believed, simulation)?;
        Ok(((table, ended), still(Strategy::None, &[])?, still(Strategy::Static, &believed.optimum.fixture)?))
    })?;
    let bytes = table.to_bytes()?;
    let body = signals::ends_at_once(|| PreparedBody::new(&world.model, &table.paddles(), true, threads))?;
    let mut controlled = |mode| -> Result<SpaceStrategyResult, SimError> {
        let is_watched = spectator.is_some();
        let controller = LinkedController { program, table_bytes: &bytes, mode, hardware, is_watched };
        let label = label(Strategy::dynamic(mode));
        Insertion { body: &body, simulation, label, extras, spectator, is_held_against_full: true }
            .controlled(controller, artifacts)
    };
    let dynamic = controlled(options.mode.unwrap_or(RunMode::Lockstep))?;
    // As in the plane: a table of another tissue repeats nothing that this tissue's own case shows already.
    let once_more = options.mode.is_none() && tissue == table_tissue && hardware == Hardware::Native;
    let dynamic_free_run = if once_more { Some(controlled(RunMode::FreeRun)?) } else { None };
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

/// An insertion that is to be simulated.
struct Insertion<'a, 'm> {
    body: &'a PreparedBody<'m>,
    simulation: &'a Simulation,
    label: Label,
    extras: Extras,
    spectator: Option<&'a dyn Spectator>,
    /// Whether it is told how well the tissue was answered for, which takes further solves.
    is_held_against_full: bool,
}

impl Insertion<'_, '_> {
    /// Without a controller: paddles stay where they rest.
    fn uncontrolled(&self, artifacts: &mut Vec<Artifact>) -> Result<SpaceStrategyResult, SimError> {
        let mut plant = PlantLoop::new(self.body.world(self.simulation), self.simulation);
        plant.uncontrolled(self.simulation.loop_settings.period_ns(), &|| ())?;
        let result = self.measured(&mut plant, RunMode::Lockstep, &[], artifacts);
        artifacts.extend(self.extras(plant.truths(), None)?);
        Ok(result)
    }

    /// Steered by a controller in a process of its own.
    fn controlled(
        &self,
        controller: LinkedController<'_>,
        artifacts: &mut Vec<Artifact>,
    ) -> Result<SpaceStrategyResult, SimError> {
        let Self { body, simulation, label, .. } = *self;
        let world = match controller.mode {
            RunMode::Lockstep => body.world(simulation),
            RunMode::FreeRun => signals::ends_at_once(|| space_in_time(body, simulation))?,
        };
        let linked = LinkedInsertion { controller, simulation, progress: &|| () };
        let mut run = linked.run(PlantLoop::new(world, simulation), |plant| {
            if let Some(spectator) = self.spectator {
                let (mode, period_ns) = (controller.mode, simulation.loop_settings.period_ns());
                let insertion = ObservedInsertion { body, mode, period_ns, title: label.title() };
                plant.observed_by(spectator.observe_in_space(insertion));
            }
        })?;
        let table = AnyTable::decode(controller.table_bytes).map_err(TableBuildError::Invalid)?;
        let recording = run.recording(&controller, simulation, body.model().scene().hash(), table.depth_end());
        let started_ns = run.plant.world().needle_started_ns().unwrap_or(0);
        let RunShare { share, outside } = run.run_share(started_ns);
        let measured = || self.measured(&mut run.plant, controller.mode, &recording.records, artifacts);
        let mut result = signals::ends_at_once(measured);
        let file = Artifact { name: label.file("rec"), bytes: recording.encode() };
        result.recording = Some(RecordingResult::of(&file, recording.records.len() as u64));
        artifacts.push(file);
        artifacts.extend(signals::ends_at_once(|| self.extras(&recording.truths(), Some(&recording)))?);
        result.table_hash = Some(hex(&Sha256::digest(controller.table_bytes)));
        (result.run_share, result.outside_run_for) = (Some(share), outside);
        (result.final_state, result.faults) = (run.accounts.final_state, run.accounts.faults);
        (result.timing, result.plant_timing) = (run.accounts.timing, run.plant_timing);
        result.ledger = Some(run.ledger);
        Ok(result)
    }

    /// What an insertion is for other tools, as far as that was asked for: its bodies are solved for once more.
    fn extras(&self, truths: &[Truth], recording: Option<&Recording>) -> Result<Vec<Artifact>, SimError> {
        let Self { body, label, extras, .. } = *self;
        let recording = recording.filter(|_| extras.mcap);
        let (coarse, mut files) = (body.model().coarse(), Vec::new());
        if recording.is_none() && !extras.vtu {
            return Ok(files);
        }
        let solved = solved_bodies(coarse, body.paddles(), truths)?;
        if let Some(recording) = recording {
            let scene = body.model().scene();
            let stage = SpaceStage::new(SpaceGeometry::new(coarse), body.paddles(), &solved);
            let (orthogonal, paddles) = (scene.needle.orthogonal(), body.paddles().len());
            let series = csv::Series { orthogonal: &orthogonal, paddles, length: &scene.length_unit };
            let known = mcap::Known { stage: Some(&stage), ..mcap::Known::default() };
            let bytes = mcap::encode(recording, &series, known)?;
            files.push(Artifact { name: label.file("mcap"), bytes });
            files.push(Artifact { name: label.file("foxglove.json"), bytes: stage.layout_file() });
        }
        if extras.vtu {
            let started_ns = solved.first().map_or(0, |body| body.truth.time_ns);
            files.extend(paraview::series_in_space(coarse, body.paddles(), &solved, started_ns, &label.stem()));
        }
        Ok(files)
    }

    /// What the true motion of the target amounts to, with its time series.
    fn measured(
        &self,
        plant: &mut PlantLoop<SpaceTissue<'_>, 3>,
        mode: RunMode,
        records: &[Record],
        artifacts: &mut Vec<Artifact>,
    ) -> SpaceStrategyResult {
        let Self { body, simulation, label, .. } = *self;
        let (scene, paddles) = (body.model().scene(), body.paddles());
        let (orthogonal, axis) = (scene.needle.orthogonal(), scene.needle.axis);
        let series = csv::Series { orthogonal: &orthogonal, paddles: paddles.len(), length: &scene.length_unit };
        let table = Artifact { name: label.file("csv"), bytes: series.insertion(plant.truths(), records) };
        let started_ns = plant.world().needle_started_ns().unwrap_or(0);
        let moving = plant.truths().partition_point(|truth| truth.time_ns < started_ns);
        let truths = plant.truths()[moving..].to_vec();
        let error = |truth: &Truth| orthogonal.tr_mul(&truth.target::<3>()).norm();
        let worst = truths.iter().max_by(|a, b| error(a).total_cmp(&error(b)));
        let squares: f64 = truths.iter().map(|truth| error(truth).powi(2)).sum();
        let way = |pair: &[Truth]| -> f64 {
            let steps = pair[0].paddles.iter().zip(&pair[1].paddles);
            steps.map(|(from, to)| (from_frame::<3>(*to) - from_frame::<3>(*from)).norm()).sum()
        };
        let stride = truths.len().div_ceil(SERIES_POINTS - 1).max(1);
        let last = truths.len().saturating_sub(1);
        let kept = truths.iter().enumerate().filter(|(i, _)| i % stride == 0 || *i == last);
        let result = SpaceStrategyResult {
            mode,
            paddles: paddles.to_vec(),
            max_orthogonal_error: worst.map_or(0.0, error),
            max_error_depth: worst.map_or(0.0, |truth| truth.depth),
            rms_orthogonal_error: (squares / truths.len().max(1) as f64).sqrt(),
            // The sum of nothing is −0.
            paddle_travel: truths.windows(2).map(way).sum::<f64>() + 0.0,
            final_state: None,
            run_share: None,
            faults: Faults::NONE,
            outside_run_for: Faults::NONE,
            ledger: None,
            timing: None,
            plant_timing: None,
            seed: simulation.seed,
            table_hash: None,
            recording: None,
            csv: Some(table.name.clone()),
            plant: self.plant_account(&mut plant.world().tissue, &truths),
            series: kept
                .map(|(_, truth)| SpaceSeriesPoint {
                    time_s: csv::seconds_since(truth.time_ns, started_ns),
                    depth: truth.depth,
                    orthogonal_error: error(truth),
                    axial: axis.dot(&truth.target::<3>()),
                    paddles: truth.paddles.iter().take(paddles.len()).copied().collect(),
                })
                .collect(),
        };
        artifacts.push(table);
        result
    }

    /// What answered for the tissue, and how well.
    fn plant_account(&self, tissue: &mut SpaceTissue<'_>, truths: &[Truth]) -> SpacePlantAccount {
        let Self { body, .. } = *self;
        let (fallbacks, first_fallback) = (tissue.fallbacks, tissue.first_fallback.clone());
        SpacePlantAccount {
            tabulation: body.report.clone(),
            step_us: if self.is_held_against_full {
                step_us(body.table().body(), body.paddles().len(), truths)
            } else {
                f64::NAN
            },
            fallbacks,
            first_fallback,
            largest_estimate: tissue.largest_estimate,
            largest_error: if self.is_held_against_full { held_against_full(tissue, truths) } else { None },
        }
    }
}

/// Mean time of a step, µs, on the way of a run.
fn step_us(mut body: TabulatedBody, paddles: usize, truths: &[Truth]) -> f64 {
    let start = Instant::now();
    for truth in truths {
        // Where the table does not reach, finding that out is what a step takes.
        let places = truth.paddles.map(from_frame);
        let _ = black_box(body.drive(truth.depth, &places[..paddles]));
    }
    start.elapsed().as_secs_f64() * 1e6 / truths.len().max(1) as f64
}

/// The largest distance of the tissue from its full model at some states of a run, in their order.
fn held_against_full(tissue: &mut SpaceTissue<'_>, truths: &[Truth]) -> Option<f64> {
    let every = truths.len().div_ceil(CHECKS).max(1);
    let mut largest = 0.0_f64;
    for truth in truths.iter().step_by(every).chain(truths.last()) {
        largest = largest.max(tissue.held_against_full(truth).ok()?);
    }
    Some(largest)
}
