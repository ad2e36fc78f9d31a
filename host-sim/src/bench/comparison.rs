//! The main job: placement, tables, strategies, one result.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use firmware::Controller;
use firmware::contract::Table;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use model_offline::model::TissueModel;
use model_offline::placement::study::{parallel, progress_steps};
use model_offline::placement::{Placement, place};
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use model_offline::table::{TableOptions, build, to_bytes};
use sha2::{Digest, Sha256};

use crate::bench::describe;
use crate::bench::result::{CaseResult, RunResult, Strategies, TableResult};
use crate::bench::strategy::{Active, Extras, Label, Measured, active, hex, passive};
use crate::commands::controller::{qemu_is_lockstep_only, read_table};
use crate::error::SimError;
use crate::exchange::board::{Image, Processor};
use crate::record::recording::RunMode;
use crate::report::directory as output;
use crate::runtime::executor::{Hardware, ScalarChoice};
use crate::runtime::signals;
use crate::view;
use crate::view::{Basis, View};
use crate::world::Simulation;
use crate::world::actuator::ActuatorModel;
use crate::world::loop_settings::{LoopArgs, not_negative, positive};
use crate::world::tissue::PlantChoice;

/// Time simulated after the needle has arrived, s: long enough for the feedback to remove what is left.
const SETTLE_S: f64 = 0.5;

/// Which tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Tissue {
    /// The scene without its inclusions.
    Homogeneous,
    /// The scene as it is.
    Inclusion,
}

impl Tissue {
    /// Name in results and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Homogeneous => "homogeneous",
            Self::Inclusion => "inclusion",
        }
    }
}

/// Options of the simulated world.
#[derive(Args, Clone, Debug)]
pub struct WorldArgs {
    /// Scene file, or the name of a bundled scene [default: paper]
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Rates, latency, noise.
    #[command(flatten)]
    pub loop_args: LoopArgs,
    /// Duration of the insertion, s
    #[arg(long, default_value_t = 5.0, value_name = "S")]
    pub insertion_time: f64,
    /// Time simulated from the start of the needle, s [default: the insertion and half a second]
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Seed of the sensors' noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Time constant of the paddle's lag, ms
    #[arg(long, default_value_t = 0.0, value_name = "MS")]
    pub paddle_lag: f64,
    /// Ticks that a command waits before the paddle acts
    #[arg(long, default_value_t = 0, value_name = "TICKS")]
    pub paddle_delay: u32,
    /// What answers for the tissue at every tick
    #[arg(long, value_enum, default_value_t)]
    pub plant: PlantChoice,
    /// Part of its command that the paddle reaches
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub paddle_gain: f64,
}

impl WorldArgs {
    /// Reads the scene.
    ///
    /// # Errors
    /// [`SimError::Scene`].
    pub fn scene(&self) -> Result<Scene, SimError> {
        let path = self.scene.as_deref().unwrap_or(Path::new("paper"));
        // Boxed: errors travel through every result, and this one carries the scene's text.
        Scene::read(path).map_err(|error| SimError::Scene(error.into()))
    }

    /// Checks the numbers and combines them with the scene's.
    ///
    /// # Errors
    /// [`SimError::Usage`] names the option.
    pub fn simulation(&self, scene: &Scene) -> Result<Simulation, SimError> {
        self.loop_args.check()?;
        positive("--insertion-time", self.insertion_time)?;
        let duration_s = self.duration.unwrap_or(self.insertion_time + SETTLE_S);
        positive("--duration", duration_s)?;
        not_negative("--paddle-lag", self.paddle_lag)?;
        not_negative("--paddle-gain", self.paddle_gain)?;
        Ok(Simulation {
            loop_args: self.loop_args,
            insertion_s: self.insertion_time,
            duration_s,
            depth: scene.needle.depth,
            actuator: ActuatorModel {
                max_rate: scene.actuator.max_rate,
                lag_s: self.paddle_lag * 1e-3,
                delay_ticks: self.paddle_delay,
                gain: self.paddle_gain,
            },
            seed: self.seed,
            plant: self.plant,
        })
    }
}

/// Options of `run`.
#[derive(Args, Clone, Debug)]
pub struct RunArgs {
    /// The simulated world.
    #[command(flatten)]
    pub world: WorldArgs,
    /// Tissue of the simulation [default: both, and the inclusion with a table that does not know it]
    #[arg(long, value_enum)]
    pub tissue: Option<Tissue>,
    /// Tissue that the planner and the table believe in [default: the simulation's]
    #[arg(long, value_enum)]
    pub table_tissue: Option<Tissue>,
    /// Controller table to use instead of computing one
    #[arg(long, value_name = "FILE", conflicts_with = "table_tissue")]
    pub table: Option<PathBuf>,
    /// What drives time [default: lockstep, then the dynamic strategy once more in free-run]
    #[arg(long, value_enum)]
    pub mode: Option<RunMode>,
    /// What computes the controller's steps: this machine, or the bare-metal image on a Cortex-M7 in QEMU (in lockstep)
    #[arg(long = "controller", value_enum, default_value_t)]
    pub hardware: Hardware,
    /// Number type that the controller computes in
    #[arg(long, value_enum, default_value_t)]
    pub scalar: ScalarChoice,
    /// Directory for the report, created whole
    #[arg(long, default_value = "stillpoint-report", value_name = "DIR")]
    pub out: PathBuf,
    /// Serve a page on this machine's loopback that shows the runs with a controller; afterwards go on inserting under
    /// the page's knobs until it says finish, or Ctrl-C
    #[arg(long)]
    pub view: bool,
    /// Port of the page [default: any free one]
    #[arg(long, value_name = "PORT", requires = "view", default_value_t = 0, hide_default_value = true)]
    pub view_port: u16,
    /// Also write every controlled insertion as MCAP, for Foxglove and Lichtblick
    #[arg(long)]
    pub mcap: bool,
    /// Also write the body along every insertion as a VTU series with a .pvd, for ParaView
    #[arg(long)]
    pub vtu: bool,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Neither progress nor summary
    #[arg(long)]
    pub quiet: bool,
    /// Threads for placement and for strategies without a controller [default: all processors]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

impl RunArgs {
    fn extras(&self) -> Extras {
        Extras { mcap: self.mcap, vtu: self.vtu }
    }
}

/// A plant, and what its controller believes.
struct Case {
    tissue: Tissue,
    table_tissue: Tissue,
    /// A mismatch repeats nothing that its plant's own case shows already.
    is_mismatch: bool,
}

/// Runs everything that was asked for and writes the report.
///
/// # Errors
/// [`SimError`]; nothing is written then.
pub fn run(args: &RunArgs) -> Result<RunResult, SimError> {
    signals::install();
    let started = Instant::now();
    let scene = args.world.scene()?;
    let simulation = args.world.simulation(&scene)?;
    if args.hardware == Hardware::Qemu && args.mode == Some(RunMode::FreeRun) {
        return Err(qemu_is_lockstep_only());
    }
    if args.hardware == Hardware::Qemu {
        // Before anybody waits for the controller: compiling takes a while the first time.
        Image::build(args.scalar.kind(), Processor::Double)?;
    }
    output::check_directory(&args.out)?;
    let given_table = args.table.as_deref().map(read_table).transpose()?;
    if let (Some(path), Some((table, _))) = (&args.table, &given_table) {
        check_units(table, path, &[scene.length_unit.clone(), scene.stress_unit.clone()])?;
    }
    let cases = cases(args, &scene, given_table.as_ref().map(|table| &table.0))?;
    let studies = Studies::new(&scene, &cases, args, &simulation)?;
    let program = std::env::current_exe().map_err(SimError::Spawn)?;

    let tables = cases
        .iter()
        .map(|case| {
            let (table, bytes) = given_table.clone().map_or_else(|| studies.table(case.table_tissue), Ok)?;
            // Refused settings are bad input: found before anything runs.
            Controller::new(&table, &simulation.loop_args.settings(table.validity.depth_end))?;
            let bytes = args.scalar.encode(&table, bytes)?;
            Ok((table, bytes))
        })
        .collect::<Result<Vec<_>, SimError>>()?;
    let view = args.view.then(|| live_view(args, &simulation)).transpose()?;
    let watched = view.as_ref().map(View::shared);
    let mut artifacts = Vec::new();
    let passive = studies.passive(&cases, &simulation, args.extras())?;
    let mut results = Vec::new();
    for ((case, (none, fixture)), (table, table_bytes)) in cases.iter().zip(passive).zip(&tables) {
        let mut keep = |measured: Measured| {
            artifacts.extend(measured.1);
            measured.0
        };
        let mut strategies =
            Strategies { none: none.map(&mut keep), fixture: fixture.map(&mut keep), ..Strategies::default() };
        let dynamic = |mode: RunMode| {
            let name = match mode {
                RunMode::Lockstep => "dynamic",
                RunMode::FreeRun => "dynamic-free-run",
            };
            studies.say(&format!("{}: dynamic, {mode}", case.tissue.name()));
            let controller = Active {
                program: &program,
                table,
                table_bytes,
                mode,
                hardware: args.hardware,
                view: watched,
                extras: args.extras(),
            };
            let model = studies.model(case.tissue);
            let progress = || studies.bar.inc(1);
            active(model, &controller, &simulation, &case.label(name), &progress)
        };
        if args.mode != Some(RunMode::FreeRun) {
            strategies.dynamic = Some(keep(dynamic(RunMode::Lockstep)?));
        }
        let free_run = match args.mode {
            None => !case.is_mismatch && args.hardware == Hardware::Native,
            Some(mode) => mode == RunMode::FreeRun,
        };
        if free_run {
            strategies.dynamic_free_run = Some(keep(dynamic(RunMode::FreeRun)?));
        }
        results.push(case_result(case, table, table_bytes, strategies, &simulation)?);
    }
    studies.bar.finish_and_clear();

    let result = RunResult {
        format: crate::bench::result::FORMAT,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene.name.clone(),
        units: [scene.length_unit.clone(), scene.stress_unit.clone()],
        mode: args.mode.unwrap_or(RunMode::Lockstep),
        seed: simulation.seed,
        settings: describe::settings(&scene, &simulation),
        geometry: describe::geometry(&scene, &studies.models[0].1),
        placements: studies.placement_results(),
        cases: results,
        wall_s: started.elapsed().as_secs_f64(),
        command: describe::command_line(),
        platform: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
    };
    signals::check()?;
    output::write_run(&args.out, &result, artifacts)?;
    if let Some(path) = &args.json {
        output::write_json(path, &result)?;
    }
    if !args.quiet {
        print!("{}", crate::report::summary::summary(&result, &args.out));
    }
    if let Some((view, (case, (table, table_bytes)))) = view.as_ref().zip(cases.iter().zip(&tables).next_back()) {
        let scene = studies.model(case.tissue).scene();
        let mode = args.mode.unwrap_or(RunMode::Lockstep);
        let hardware = args.hardware;
        let basis = Basis { program: &program, scene, table, table_bytes, simulation, mode, hardware };
        let say = |line: &str| {
            if !args.quiet {
                println!("{line}");
            }
        };
        say(&format!("\nGoing on under the knobs of {} (its Finish, or Ctrl-C, ends it)", view.address()));
        view::insertions(view, &basis, &say)?;
    }
    Ok(result)
}

/// Starts the page and says where it is.
fn live_view(args: &RunArgs, simulation: &Simulation) -> Result<View, SimError> {
    let loop_args = &simulation.loop_args;
    let (target_rate, latency) = (loop_args.target_rate, loop_args.latency);
    let view = View::start(
        args.view_port,
        view::Knobs { needle_speed: 1.0, target_rate, latency, noise: 1.0, stiffness: 1.0 },
    )?;
    // The one line that even a quiet run must say: without it nobody gets in.
    println!("Live view: {}", view.address());
    Ok(view)
}

/// Refuses a table in other units of length and stress than `expected`.
///
/// # Errors
/// [`SimError::TableUnits`].
pub fn check_units(table: &Table<f64, 2>, path: &Path, expected: &[String; 2]) -> Result<(), SimError> {
    let found = [table.units.length.as_str().to_owned(), table.units.stress.as_str().to_owned()];
    if found == *expected {
        return Ok(());
    }
    Err(SimError::TableUnits { path: path.to_owned(), found, expected: expected.clone() })
}

/// What is to be simulated.
fn cases(args: &RunArgs, scene: &Scene, table: Option<&Table<f64, 2>>) -> Result<Vec<Case>, SimError> {
    let has_inclusion = !scene.inclusions.is_empty();
    let asked = [args.tissue, args.table_tissue];
    if !has_inclusion && asked.contains(&Some(Tissue::Inclusion)) {
        return Err(SimError::Usage(format!(
            "the scene {} has no inclusion: leave --tissue and --table-tissue away",
            scene.name
        )));
    }
    let believed = match table {
        Some(table) if table.tissue == Tissue::Homogeneous.name() => Some(Tissue::Homogeneous),
        Some(table) if has_inclusion && table.tissue == Tissue::Inclusion.name() => Some(Tissue::Inclusion),
        _ => args.table_tissue,
    };
    let case = |tissue, table_tissue: Option<Tissue>| Case {
        tissue,
        table_tissue: table_tissue.unwrap_or(tissue),
        is_mismatch: false,
    };
    let mut cases = match args.tissue {
        Some(tissue) => vec![case(tissue, believed)],
        None if has_inclusion => vec![case(Tissue::Homogeneous, believed), case(Tissue::Inclusion, believed)],
        None => vec![case(Tissue::Homogeneous, believed)],
    };
    if has_inclusion && args.tissue.is_none() && believed.is_none() {
        cases.push(Case { tissue: Tissue::Inclusion, table_tissue: Tissue::Homogeneous, is_mismatch: true });
    }
    Ok(cases)
}

impl Case {
    fn label<'a>(&self, strategy: &'a str) -> Label<'a> {
        Label { tissue: self.tissue.name(), table_tissue: self.table_tissue.name(), strategy }
    }
}

/// `none` and `static` of a case.
type Passive = (Option<Measured>, Option<Measured>);

/// Models and placement studies of the tissues that occur.
struct Studies {
    models: Vec<(Tissue, TissueModel)>,
    placements: Vec<(Tissue, Placement, f64)>,
    threads: usize,
    bar: ProgressBar,
}

impl Studies {
    fn new(scene: &Scene, cases: &[Case], args: &RunArgs, simulation: &Simulation) -> Result<Self, SimError> {
        let mut models: Vec<(Tissue, TissueModel)> = Vec::new();
        for tissue in [Tissue::Homogeneous, Tissue::Inclusion] {
            let occurs = |case: &Case| case.tissue == tissue || case.table_tissue == tissue;
            if cases.iter().any(occurs) {
                let scene = match tissue {
                    Tissue::Homogeneous => scene.without_inclusions(),
                    Tissue::Inclusion => scene.clone(),
                };
                models.push((tissue, model_offline::placement::discretise(&scene)?.0));
            }
        }
        let threads =
            args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get));
        let studies: u64 = models.iter().map(|model| progress_steps(&model.1)).sum();
        let ticks = (simulation.duration_s * simulation.loop_args.rate) as u64;
        let runs: u64 = cases
            .iter()
            .map(|case| match (args.mode, case.is_mismatch) {
                (None, false) => 4,
                (Some(_), false) => 3,
                (_, true) => 2,
            })
            .sum();
        let mut studies = Self {
            models,
            placements: Vec::new(),
            threads: threads.max(1),
            bar: progress_bar(studies + runs * ticks, args.quiet),
        };
        studies.place()?;
        Ok(studies)
    }

    fn place(&mut self) -> Result<(), SimError> {
        for (tissue, model) in &self.models {
            self.bar.set_message(format!("{}: placement", tissue.name()));
            let started = Instant::now();
            let progress = || self.bar.inc(1);
            let placement = place(model, NewtonSettings::default(), self.threads, &progress)?;
            signals::check()?;
            let wall_s = started.elapsed().as_secs_f64();
            self.placements.push((*tissue, placement, wall_s));
        }
        Ok(())
    }

    fn say(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    fn model(&self, tissue: Tissue) -> &TissueModel {
        let found = self.models.iter().find(|model| model.0 == tissue);
        &found.expect("models of all cases exist").1
    }

    fn placement(&self, tissue: Tissue) -> &Placement {
        let found = self.placements.iter().find(|study| study.0 == tissue);
        &found.expect("placements of all cases exist").1
    }

    fn table(&self, tissue: Tissue) -> Result<(Table<f64, 2>, Vec<u8>), SimError> {
        self.say(&format!("{}: controller table", tissue.name()));
        let paddle = self.placement(tissue).optimum.dynamic;
        let table = build(self.model(tissue), paddle, &TableOptions::default())?;
        let bytes = to_bytes(&table)?;
        Ok((table, bytes))
    }

    /// `none` and `static` of all cases, on all threads: nothing in them runs in real time.
    fn passive(&self, cases: &[Case], simulation: &Simulation, extras: Extras) -> Result<Vec<Passive>, SimError> {
        self.say("strategies without a controller");
        let jobs: Vec<(usize, Option<u32>, &str)> = cases
            .iter()
            .enumerate()
            .flat_map(|(i, case)| {
                let none = (!case.is_mismatch).then_some((i, None, "none"));
                let paddle = self.placement(case.table_tissue).optimum.fixture;
                none.into_iter().chain([(i, Some(paddle), "static")])
            })
            .collect();
        let outcomes = parallel(jobs.len(), self.threads, |job| {
            let (i, paddle, strategy) = jobs[job];
            let progress = || self.bar.inc(1);
            let label = cases[i].label(strategy);
            let model = self.model(cases[i].tissue);
            passive(model, paddle, simulation, &label, extras, &progress)
        });
        let mut results: Vec<_> = cases.iter().map(|_| (None, None)).collect();
        for ((i, paddle, _), outcome) in jobs.iter().zip(outcomes) {
            let measured = Some(outcome?);
            match paddle {
                None => results[*i].0 = measured,
                Some(_) => results[*i].1 = measured,
            }
        }
        Ok(results)
    }

    fn placement_results(&self) -> Vec<crate::bench::result::PlacementResult> {
        self.placements
            .iter()
            .map(|(tissue, placement, wall_s)| {
                describe::placement(tissue.name(), self.model(*tissue), placement, *wall_s)
            })
            .collect()
    }
}

fn case_result(
    case: &Case,
    table: &Table<f64, 2>,
    table_bytes: &[u8],
    strategies: Strategies,
    simulation: &Simulation,
) -> Result<CaseResult, SimError> {
    let settings = simulation.loop_args.settings(table.validity.depth_end);
    let controller = Controller::new(table, &settings)?;
    let dynamic = strategies.dynamic.as_ref().or(strategies.dynamic_free_run.as_ref());
    let improvement = strategies
        .fixture
        .as_ref()
        .zip(dynamic)
        .map(|(fixture, dynamic)| fixture.max_orthogonal_error / dynamic.max_orthogonal_error);
    Ok(CaseResult {
        tissue: case.tissue.name().to_owned(),
        table_tissue: table.tissue.as_str().to_owned(),
        table: TableResult {
            hash: hex(&Sha256::digest(table_bytes)),
            scene_hash: hex(&table.scene_hash),
            paddle: table.paddle.index,
            knots: table.knots.len(),
            bytes: table_bytes.len(),
            loop_gain: controller.loop_gain(),
            delay_samples: controller.delay_samples(),
            depth: table.knots.iter().map(|knot| knot.depth).collect(),
            paddle_path: table.knots.iter().map(|knot| knot.paddle_path.into()).collect(),
        },
        strategies,
        improvement,
    })
}

fn progress_bar(steps: u64, quiet: bool) -> ProgressBar {
    let target = if quiet {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr() // Hidden by itself where stderr is no terminal.
    };
    let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {elapsed}, {eta} left  {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(Some(steps), target).with_style(style)
}
