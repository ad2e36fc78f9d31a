//! One insertion: simulated, measured, recorded.

pub(super) mod linked;
mod measure;

use std::path::Path;

use firmware::contract::Table;
use model_offline::model::TissueModel;
use model_offline::scene::TissueVariant;
use sha2::{Digest, Sha256};

use self::linked::{FinishedInsertion, LinkedController, LinkedInsertion, RunShare};
use self::measure::measure;
pub(super) use self::measure::{digits, rounding};
use super::result::{RecordingResult, StrategyResult};
use super::strategy::Strategy;
use crate::bench::error::SimError;
use crate::record::export::foxglove::{Scenery as _, Stage};
use crate::record::export::{csv, mcap, paraview};
use crate::record::files::Artifact;
use crate::record::recording::{Record, Recording};
use crate::runtime::executor::Hardware;
use crate::runtime::plant::PlantLoop;
use crate::runtime::plant::observer::{ObservedInsertion, PlanarBody, Spectator};
use crate::runtime::plant::rehearsal::world_in_time;
use crate::runtime::signals;
use crate::runtime::time::mode::RunMode;
use crate::world::World;
use crate::world::simulation::Simulation;
use crate::world::tissue::{AttachedPaddle, Reductions, TissuePlant};
use crate::world::truth::Truth;
use model_offline::output::table_text::hex;

/// A result and the files that belong to it.
#[derive(Clone, Debug)]
pub struct MeasuredInsertion {
    /// The result.
    pub result: StrategyResult,
    /// Its files.
    pub artifacts: Vec<Artifact>,
}

/// What is simulated: names its files, unique in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Label {
    /// Tissue of the simulation.
    pub tissue: TissueVariant,
    /// Tissue of the table.
    pub table_tissue: TissueVariant,
    /// Strategy.
    pub strategy: Strategy,
}

impl Label {
    /// A strategy on a tissue, with what was precomputed for the same one.
    pub fn new(tissue: TissueVariant, strategy: Strategy) -> Self {
        Self { tissue, table_tissue: tissue, strategy }
    }

    /// Name of its file with this extension.
    pub(super) fn file(&self, extension: &str) -> String {
        format!("{}.{extension}", self.stem())
    }

    /// What the names of its files begin with.
    pub(super) fn stem(&self) -> String {
        let Self { tissue, table_tissue, strategy } = self;
        if tissue == table_tissue {
            format!("{tissue}-{strategy}")
        } else {
            format!("{tissue}-with-{table_tissue}-table-{strategy}")
        }
    }

    /// What it is, in words.
    pub(super) fn title(&self) -> String {
        format!("{}, table of {}: {}", self.tissue, self.table_tissue, self.strategy)
    }
}

/// Files for other tools that are not always written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extras {
    /// Controlled insertions as MCAP.
    pub mcap: bool,
    /// The body along insertions as VTU series.
    pub vtu: bool,
}

/// The controller of a dynamic strategy.
#[derive(Clone, Copy, Debug)]
pub struct ControllerSetup<'a> {
    /// This program, which is also the controller.
    pub program: &'a Path,
    /// Its table.
    pub table: &'a Table<f64, 2>,
    /// The table as encoded.
    pub table_bytes: &'a [u8],
    /// What drives time.
    pub mode: RunMode,
    /// What computes the controller's steps.
    pub hardware: Hardware,
    /// Somebody who looks on.
    pub spectator: Option<&'a dyn Spectator>,
}

impl<'a> ControllerSetup<'a> {
    /// What of it is no matter of dimensions.
    fn linked(&self) -> LinkedController<'a> {
        let Self { program, table_bytes, mode, hardware, spectator, .. } = *self;
        LinkedController { program, table_bytes, mode, hardware, is_watched: spectator.is_some() }
    }
}

/// One insertion that is to be simulated.
///
/// ```
/// use host_sim::{Label, LoopSettings, SimulatedInsertion, Simulation, Strategy, TissueVariant};
/// use model_offline::{placement::discretise, scene::Scene};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let scene = Scene::bundled("paper").expect("it comes with the program");
/// let (model, _) = discretise(&scene)?;
/// let loop_settings = LoopSettings { rate: 50.0, ..LoopSettings::default() };
/// let simulation = Simulation { loop_settings, ..Simulation::new(&scene).with_insertion(1.0) };
/// let label = Label::new(TissueVariant::Inclusion, Strategy::Static);
/// let insertion = SimulatedInsertion::new(&model, &simulation, label);
///
/// let without = insertion.uncontrolled(None)?.result;
/// let held = insertion.uncontrolled(Some(2))?.result;
/// assert!(held.max_orthogonal_error < without.max_orthogonal_error);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy)]
pub struct SimulatedInsertion<'a> {
    /// The tissue.
    pub model: &'a TissueModel,
    /// Its numbers.
    pub simulation: &'a Simulation,
    /// Names of its files.
    pub label: Label,
    /// Reduced models that insertions into this tissue share; none for one of its own.
    pub reductions: Option<&'a Reductions>,
    /// Files besides recording and time series.
    pub extras: Extras,
    /// Called at every tick.
    pub progress: &'a dyn Fn(),
}

impl std::fmt::Debug for SimulatedInsertion<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SimulatedInsertion").field("label", &self.label).finish_non_exhaustive()
    }
}

impl<'a> SimulatedInsertion<'a> {
    /// An insertion without files for other tools, whose progress nobody follows.
    pub fn new(model: &'a TissueModel, simulation: &'a Simulation, label: Label) -> Self {
        Self { model, simulation, label, reductions: None, extras: Extras::default(), progress: &|| {} }
    }

    /// Without a paddle, or with one that does not move: nothing to control, time in ticks all the same.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn uncontrolled(&self, paddle: Option<u32>) -> Result<MeasuredInsertion, SimError> {
        let Self { model, simulation, label, reductions, extras, progress } = *self;
        let own = Reductions::default();
        let reductions = reductions.unwrap_or(&own);
        let world =
            World::sharing(model, paddle.map_or(AttachedPaddle::None, AttachedPaddle::Held), simulation, reductions)?;
        let mut plant = PlantLoop::new(world, simulation);
        plant.uncontrolled(simulation.loop_settings.period_ns(), progress)?;
        let mut result = measure(model, &mut plant, RunMode::Lockstep, paddle, simulation.seed);
        let series = self.series(plant.truths(), &[]);
        let mut artifacts = vec![Artifact { name: label.file("csv"), bytes: series }];
        result.csv = Some(artifacts[0].name.clone());
        let needle = self.needle_tables(&mut plant);
        result.needle_csv = needle.iter().map(|table| table.name.clone()).collect();
        artifacts.extend(needle);
        if extras.vtu {
            artifacts.extend(paraview::series(model, paddle, plant.truths(), 0, &label.stem()));
        }
        Ok(MeasuredInsertion { result, artifacts })
    }

    /// With the controller as a process of its own.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn controlled(&self, controller: &ControllerSetup<'_>) -> Result<MeasuredInsertion, SimError> {
        // Before there is anything to tidy up: a reduced model is trained here, which looks at no signal.
        let plant = signals::ends_at_once(|| self.plant(controller))?;
        let finished = self.with_controller(controller, plant)?;
        signals::ends_at_once(|| self.measured(controller, finished))
    }

    /// Runs the controller on the plant, in a space of their own that is tidied up whatever happens.
    ///
    /// # Errors
    /// [`SimError`].
    pub(super) fn with_controller(
        &self,
        controller: &ControllerSetup<'_>,
        plant: PlantLoop<TissuePlant<'a>>,
    ) -> Result<FinishedInsertion<TissuePlant<'a>>, SimError> {
        let Self { model, simulation, progress, .. } = *self;
        let linked = LinkedInsertion { controller: controller.linked(), simulation, progress };
        linked.run(plant, |plant| {
            if let Some(spectator) = controller.spectator {
                let body = PlanarBody { model, paddle: controller.table.paddles[0].index };
                let (period_ns, title) = (simulation.loop_settings.period_ns(), self.label.title());
                let mode = controller.mode;
                plant.observed_by(spectator.observe(ObservedInsertion { body, mode, period_ns, title }));
            }
        })
    }

    /// What the insertion amounts to, with its files.
    ///
    /// # Errors
    /// [`SimError`].
    pub(super) fn measured(
        &self,
        controller: &ControllerSetup<'_>,
        mut run: FinishedInsertion<TissuePlant<'a>>,
    ) -> Result<MeasuredInsertion, SimError> {
        let Self { model, simulation, label, .. } = *self;
        let paddle = controller.table.paddles[0].index;
        let mut result = measure(model, &mut run.plant, controller.mode, Some(paddle), simulation.seed);
        let (scene_hash, depth_end) = (model.scene().hash(), controller.table.validity.depth_end);
        let recording = run.recording(&controller.linked(), simulation, scene_hash, depth_end);
        let file = Artifact { name: label.file("rec"), bytes: recording.encode() };
        result.recording = Some(RecordingResult::of(&file, recording.records.len() as u64));
        result.table_hash = Some(hex(&Sha256::digest(controller.table_bytes)));
        let started_ns = run.plant.world().needle_started_ns().unwrap_or(0);
        let mut artifacts = self.files(controller, &recording, &mut run.plant, started_ns)?;
        artifacts.insert(1, file);
        result.csv = Some(artifacts[0].name.clone());
        let needle = self.needle_tables(&mut run.plant);
        result.needle_csv = needle.iter().map(|table| table.name.clone()).collect();
        artifacts.extend(needle);
        result.final_state = run.accounts.final_state;
        result.faults = run.accounts.faults;
        let RunShare { share, outside } = run.run_share(started_ns);
        result.run_share = Some(share);
        result.outside_run_for = outside;
        result.ledger = Some(run.ledger);
        result.timing = run.accounts.timing;
        result.plant_timing = run.plant_timing;
        Ok(MeasuredInsertion { result, artifacts })
    }

    /// The time series, and what else was asked for.
    fn files(
        &self,
        controller: &ControllerSetup<'_>,
        recording: &Recording,
        plant: &mut PlantLoop<TissuePlant<'_>>,
        started_ns: u64,
    ) -> Result<Vec<Artifact>, SimError> {
        let Self { model, label, extras, .. } = *self;
        let series = self.series(plant.truths(), &recording.records);
        let mut artifacts = vec![Artifact { name: label.file("csv"), bytes: series }];
        if extras.mcap {
            let name = label.file("mcap");
            let needle = mcap::NeedleForces { started_ns, moments: plant.world().tissue.needle() };
            let stage = Stage::new(model.scene(), controller.table.paddles[0].index);
            let known = mcap::Known { needle, stage: Some(&stage) };
            let table = controller.table;
            let series = csv::Series { orthogonal: &table.orthogonal, paddles: 1, length: &model.scene().length_unit };
            let bytes = mcap::encode(recording, &series, known)?;
            artifacts.push(Artifact { name, bytes });
            artifacts.push(Artifact { name: label.file("foxglove.json"), bytes: stage.layout_file() });
        }
        if extras.vtu {
            let paddle = controller.table.paddles[0].index;
            artifacts.extend(paraview::series(model, Some(paddle), plant.truths(), started_ns, &label.stem()));
        }
        Ok(artifacts)
    }

    /// The time series, a line per tick of the plant.
    fn series(&self, truths: &[Truth], records: &[Record]) -> Vec<u8> {
        let scene = self.model.scene();
        let series = csv::Series { orthogonal: &scene.needle.orthogonal(), paddles: 1, length: &scene.length_unit };
        series.insertion(truths, records)
    }

    /// What the needle met, where the world has one that slips.
    fn needle_tables(&self, plant: &mut PlantLoop<TissuePlant<'_>>) -> Vec<Artifact> {
        let scene = self.model.scene();
        let units = csv::Units { length: &scene.length_unit, stress: &scene.stress_unit };
        let first_ns = plant.truths().first().map_or(0, |truth| truth.time_ns);
        let started_s = csv::seconds_since(plant.world().needle_started_ns().unwrap_or(0), first_ns);
        let moments = plant.world().tissue.needle();
        if moments.is_empty() {
            return Vec::new();
        }
        let named = |what: &str, bytes| Artifact { name: format!("{}-{what}.csv", self.label.stem()), bytes };
        vec![
            named("needle", csv::needle(moments, started_s, units)),
            named("shaft", csv::shaft(moments, started_s, units)),
        ]
    }

    /// The simulated world before its first tick.
    ///
    /// # Errors
    /// [`SimError`].
    pub(super) fn plant(&self, controller: &ControllerSetup<'_>) -> Result<PlantLoop<TissuePlant<'a>>, SimError> {
        let Self { model, simulation, reductions, .. } = *self;
        let paddle = AttachedPaddle::Steered(controller.table);
        let own = Reductions::default();
        let reductions = reductions.unwrap_or(&own);
        let world = match controller.mode {
            RunMode::Lockstep => World::sharing(model, paddle, simulation, reductions)?,
            RunMode::FreeRun => world_in_time(model, paddle, simulation, reductions)?,
        };
        Ok(PlantLoop::new(world, simulation))
    }
}
