//! Strategies compared: placement, tables, one insertion after the other, one result.

mod cases;
mod encoded_table;
mod lockstep;
mod parts;
mod training;

use std::path::PathBuf;
use std::time::Instant;

use firmware::Controller;
use firmware::contract::Table;
use model_offline::model::{ModelError, TissueModel};
use model_offline::output::Geometry;
use model_offline::output::resampling::Resampling;
use model_offline::output::table_text::hex;
use model_offline::parallel;
use model_offline::placement::study::steps;
use model_offline::placement::{PlacementOptions, PlacementStudy, discretise};
use model_offline::scene::{Scene, TableScalar};
use model_offline::table::{BuiltTable, TableBuildError, TableOptions, build_as_deep_as_it_goes, to_bytes};
use sha2::{Digest, Sha256};

use self::cases::{Case, cases};
pub(super) use self::encoded_table::ends_early;
pub use self::encoded_table::{EncodedTable, check_units, is_of, read_table};
use super::causes::{CausesResult, Examined};
use super::describe;
use super::insertion::{ControllerSetup, Extras, Label, MeasuredInsertion, SimulatedInsertion, digits, rounding};
use super::result::{CaseResult, FORMAT, PlacementResult, RunResult, Strategies, StrategyResult, TableResult};
use super::strategy::Strategy;
use super::table_tissue::TableTissue;
use crate::bench::error::SimError;
use crate::bench::forecast::Forecast;
use crate::bench::progress::Progress;
use crate::exchange::board::{Image, Processor};
use crate::record::files::Artifact;
use crate::runtime::executor::{Hardware, encode_in};
use crate::runtime::plant::observer::Spectator;
use crate::runtime::signals;
use crate::runtime::time::mode::RunMode;
use crate::world::simulation::Simulation;
use crate::world::tissue::Reductions;
use model_offline::scene::TissueVariant;

/// What is compared, and how.
#[derive(Clone, Debug)]
pub struct ComparisonOptions {
    /// Tissue of the simulation; none: both, and the inclusion with a table that does not know it.
    pub tissue: Option<TissueVariant>,
    /// Tissue that the planner and the table believe in; none: the simulation's.
    pub table_tissue: Option<TissueVariant>,
    /// Controller table to use instead of computing one.
    pub table: Option<PathBuf>,
    /// Whether a table of another scene is used all the same.
    pub allow_other_scene: bool,
    /// Whether the table knows of the world what a table can know: a needle that slips, and stress that relaxes. Else it is
    /// that of a contact that moves with the needle in elastic tissue.
    pub table_knows_the_world: bool,
    /// What drives time; none: lockstep, then the dynamic strategy once more in free-run.
    pub mode: Option<RunMode>,
    /// What computes the controller's steps.
    pub hardware: Hardware,
    /// Number type of the controller.
    pub scalar: TableScalar,
    /// Files for other tools.
    pub extras: Extras,
    /// Whether the error of the controlled insertion is taken apart by its causes.
    pub causes: bool,
    /// Threads for placement and for strategies without a controller.
    pub threads: usize,
    /// The program that serves as the controller's process: `host-sim`.
    pub program: PathBuf,
}

impl ComparisonOptions {
    /// Everything, on this machine, with `program` (`host-sim`) as the controller's process.
    pub fn new(program: PathBuf) -> Self {
        Self {
            tissue: None,
            table_tissue: None,
            table: None,
            allow_other_scene: false,
            table_knows_the_world: true,
            mode: None,
            hardware: Hardware::default(),
            scalar: TableScalar::default(),
            extras: Extras::default(),
            causes: false,
            threads: parallel::available(),
            program,
        }
    }
}

/// A tissue of the comparison, with its placement study.
#[derive(Debug)]
struct Studied {
    tissue: TissueVariant,
    study: PlacementStudy,
    /// The simulated tissue, where it has a past that the study does not know.
    world: Option<TissueModel>,
    reductions: Reductions,
}

impl Studied {
    /// What is simulated.
    fn plant(&self) -> &TissueModel {
        self.world.as_ref().unwrap_or(&self.study.model)
    }
}

/// `none` and `static` of a case.
type Uncontrolled = (Option<MeasuredInsertion>, Option<MeasuredInsertion>);

/// Puts the pictures of a case whose body has nodes of its own, as conforming elements have in every tissue, onto those that
/// all bodies are drawn on.
fn on_nodes_of(drawn: &Geometry, model: &TissueModel, case: &mut CaseResult) {
    let own: Vec<[f64; 2]> = model.positions().iter().map(|node| [node.x, node.y]).collect();
    if own == drawn.nodes {
        return;
    }
    let resampling = Resampling::new(&own, &drawn.nodes, &drawn.outline);
    let rounded = rounding(model.scene().needle.depth);
    for result in case.strategies.all_mut() {
        // Nothing is drawn of what cannot be drawn.
        let Some(resampling) = &resampling else {
            (result.deformed_nodes, result.frames) = (Vec::new(), Vec::new());
            continue;
        };
        result.deformed_nodes = resampling.moved(&result.deformed_nodes);
        for frame in &mut result.frames {
            frame.nodes = resampling.moved(&frame.nodes).into_iter().map(|node| node.map(&rounded)).collect();
            for values in [&mut frame.strain, &mut frame.von_mises] {
                *values = resampling.values(values).into_iter().map(digits).collect();
            }
        }
    }
}

/// Nothing depends on the table without a paddle: a case that did not run it is held against that of its tissue.
fn against_none_of_the_same_tissue(cases: &mut [CaseResult]) {
    let none: Vec<(TissueVariant, f64)> = cases
        .iter()
        .filter_map(|case| Some((case.tissue, case.strategies.none.as_ref()?.max_orthogonal_error)))
        .collect();
    for case in cases.iter_mut().filter(|case| case.improvement_over_none.is_none()) {
        let strategies = &case.strategies;
        let dynamic = strategies.controlled();
        let error = none.iter().find(|(tissue, _)| *tissue == case.tissue);
        case.improvement_over_none = error.zip(dynamic).map(|((_, none), dynamic)| none / dynamic.max_orthogonal_error);
    }
}

/// A comparison that is ready to run.
///
/// ```no_run
/// use host_sim::{Comparison, ComparisonOptions, Silent, Simulation};
/// use model_offline::scene::Scene;
///
/// # fn main() -> Result<(), host_sim::SimError> {
/// let scene = Scene::read("my.toml".as_ref())?;
/// let simulation = Simulation::new(&scene);
/// let options = ComparisonOptions::new("target/release/host-sim".into());
/// let compared = Comparison::prepare(scene, simulation, options, &Silent)?.run(None)?;
/// for case in &compared.result.cases {
///     println!("{}: {:?} times less", case.tissue, case.improvement);
/// }
/// host_sim::report::directory::write_run("my-report".as_ref(), &compared.result, compared.artifacts)?;
/// # Ok(())
/// # }
/// ```
///
/// The scene is studied and the tables are computed; nothing is simulated yet.
pub struct Comparison<'p> {
    scene: Scene,
    simulation: Simulation,
    options: ComparisonOptions,
    progress: &'p dyn Progress,
    forecast: Forecast,
    started: Instant,
    cases: Vec<Case>,
    studied: Vec<Studied>,
    tables: Vec<EncodedTable>,
    /// What computing the tables took, s.
    tables_took_s: f64,
}

impl std::fmt::Debug for Comparison<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Comparison").field("options", &self.options).finish_non_exhaustive()
    }
}

/// The result of a comparison, with the files that belong to it.
#[derive(Debug)]
pub struct Compared {
    /// The result.
    pub result: RunResult,
    /// Its files.
    pub artifacts: Vec<Artifact>,
    /// Why it has no free-run, where one was to stand beside lockstep and the tissue cannot keep the period.
    pub not_kept: Option<SimError>,
}

/// What is known of a case once all of it has run.
struct Known {
    strategies: Strategies,
    artifacts: Vec<Artifact>,
    not_kept: Option<SimError>,
}

impl<'p> Comparison<'p> {
    /// Studies the placements and computes the tables.
    ///
    /// # Errors
    /// [`SimError`]: options that do not go together, a scene or a table that cannot be used, settings that the
    /// controller refuses.
    pub fn prepare(
        scene: Scene,
        simulation: Simulation,
        options: ComparisonOptions,
        progress: &'p dyn Progress,
    ) -> Result<Self, SimError> {
        let started = Instant::now();
        if options.hardware == Hardware::Qemu {
            if options.mode == Some(RunMode::FreeRun) {
                return Err(SimError::QemuIsLockstepOnly);
            }
            // Before anybody waits for the controller: compiling takes a while the first time.
            Image::build(options.scalar.kind(), Processor::Double)?;
        }
        let given = options.table.as_deref().map(read_table).transpose()?;
        if let (Some(path), Some(given)) = (&options.table, &given) {
            check_units(&given.table, path, &[scene.length_unit.clone(), scene.stress_unit.clone()])?;
            if !options.allow_other_scene && !is_of(&given.table, &scene) {
                return Err(SimError::OtherScene { path: path.clone(), scene: scene.name.clone() });
            }
        }
        let cases = cases([options.tissue, options.table_tissue], &scene, given.as_ref().map(|given| &given.table))?;
        let mut comparison = Self {
            scene,
            simulation,
            options,
            progress,
            forecast: Forecast::default(),
            started,
            cases,
            studied: Vec::new(),
            tables: Vec::new(),
            tables_took_s: 0.0,
        };
        comparison.forecast = Forecast::of(comparison.parts());
        comparison.study()?;
        let before = Instant::now();
        comparison.tables = comparison.compute_tables(given.as_ref())?;
        comparison.tables_took_s = before.elapsed().as_secs_f64();
        Ok(comparison)
    }

    /// Simulates everything; `spectator` looks on at what has a controller.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn run(&self, spectator: Option<&dyn Spectator>) -> Result<Compared, SimError> {
        let mut artifacts = Vec::new();
        let (mut results, mut not_kept) = (Vec::new(), None);
        let uncontrolled = self.uncontrolled()?;
        let in_lockstep = self.in_lockstep(spectator)?;
        self.train_for_free_run();
        for (i, ((none, static_paddle), dynamic)) in uncontrolled.into_iter().zip(in_lockstep).enumerate() {
            let (case, table) = (&self.cases[i], &self.tables[i]);
            let known = [none, static_paddle, dynamic];
            let Known { strategies, artifacts: files, not_kept: refused } =
                self.strategies(case, known, table, spectator)?;
            artifacts.extend(files);
            not_kept = not_kept.or(refused);
            results.push(self.case_result(case, table, strategies)?);
        }
        against_none_of_the_same_tissue(&mut results);
        signals::check()?;
        Ok(Compared { result: self.result(results), artifacts, not_kept })
    }

    /// The last case's scene, and the table with its tissue, to go on from.
    pub fn last_case(&self) -> Option<(&Scene, TissueVariant, &EncodedTable)> {
        let (case, table) = self.cases.iter().zip(&self.tables).next_back()?;
        Some((self.studied(case.tissue).plant().scene(), case.table_tissue, table))
    }

    /// Its options.
    pub fn options(&self) -> &ComparisonOptions {
        &self.options
    }

    /// Its numbers.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The tissues of all cases.
    fn tissues(&self) -> Vec<TissueVariant> {
        let occurs = |tissue: &TissueVariant| {
            self.cases.iter().any(|case| case.tissue == *tissue || case.table_tissue == *tissue)
        };
        TissueVariant::ALL.into_iter().filter(occurs).collect()
    }

    /// Whether a table of this tissue has to be computed.
    fn needs_table(&self, tissue: TissueVariant) -> bool {
        self.options.table.is_none() && self.cases.iter().any(|case| case.table_tissue == tissue)
    }

    fn is_in_free_run(&self, case: &Case) -> bool {
        match self.options.mode {
            None => !case.is_mismatch && self.options.hardware == Hardware::Native,
            Some(mode) => mode == RunMode::FreeRun,
        }
    }

    fn study(&mut self) -> Result<(), SimError> {
        let tissues = self.tissues();
        let studies: u64 = tissues.iter().map(|tissue| steps(&tissue.of(&self.scene))).sum();
        let ticks = (self.simulation.duration_s * self.simulation.loop_settings.rate) as u64;
        let runs: u64 = self.cases.iter().map(|case| case.runs(self.options.mode)).sum();
        self.progress.begin(studies + runs * ticks);
        for tissue in tissues {
            self.begins(&format!("{tissue}: placement"));
            let step = || self.progress.step();
            let options = PlacementOptions { threads: self.options.threads, progress: &step, newton: None };
            let simulated = tissue.of(&self.scene);
            let failed = |source| SimError::of_tissue(tissue, self.other_alone(tissue), source);
            let study = PlacementStudy::run(&simulated.without_a_past(), &options).map_err(failed)?;
            signals::check()?;
            let world = simulated.has_a_past().then(|| discretise(&simulated)).transpose().map_err(failed)?;
            let world = world.map(|(model, _)| model);
            self.studied.push(Studied { tissue, study, world, reductions: Reductions::default() });
        }
        Ok(())
    }

    /// How the other tissue would be simulated without this one, where both are asked for.
    fn other_alone(&self, tissue: TissueVariant) -> Option<String> {
        let alone = self.cases.iter().find(|case| ![case.tissue, case.table_tissue].contains(&tissue))?;
        Some(format!("--tissue {} does without it", alone.tissue))
    }

    fn studied(&self, tissue: TissueVariant) -> &Studied {
        let found = self.studied.iter().find(|studied| studied.tissue == tissue);
        found.expect("the tissues of all cases are studied")
    }

    /// A table for every case; those that are not given are computed on all threads, one for each tissue.
    fn compute_tables(&self, given: Option<&EncodedTable>) -> Result<Vec<EncodedTable>, SimError> {
        let loop_settings = &self.simulation.loop_settings;
        let needed = |tissue: &TissueVariant| self.needs_table(*tissue);
        let tissues: Vec<TissueVariant> = TissueVariant::ALL.into_iter().filter(needed).collect();
        if !tissues.is_empty() {
            self.begins("controller tables");
        }
        let computed = parallel::map(tissues.len(), self.options.threads, |i| self.compute_table(tissues[i]));
        let computed: Vec<EncodedTable> = computed.into_iter().collect::<Result<_, _>>()?;
        let computed_for =
            |wanted| tissues.iter().zip(&computed).find_map(|(t, table)| (*t == wanted).then_some(table));
        self.cases
            .iter()
            .map(|case| {
                let known = given.or_else(|| computed_for(case.table_tissue));
                let EncodedTable { table, bytes, ended } = known.expect("given, or computed for every tissue").clone();
                // Refused settings are bad input: found before anything runs.
                Controller::new(&table, &loop_settings.settings(table.validity.depth_end))?;
                let scalar = self.options.scalar;
                let bytes = encode_in(scalar, &table, bytes);
                let bytes = bytes.map_err(|source| SimError::TableScalar { scalar, source })?;
                Ok(EncodedTable { table, bytes, ended })
            })
            .collect()
    }

    fn compute_table(&self, tissue: TissueVariant) -> Result<EncodedTable, SimError> {
        let studied = self.studied(tissue);
        let none = || SimError::of_tissue(tissue, self.other_alone(tissue), ModelError::NoPaddleControls);
        let paddle = studied.study.placement.optimum.dynamic_paddle.ok_or_else(none)?;
        let needle_speed = self.simulation.needle_speed();
        let model = if self.options.table_knows_the_world { studied.plant() } else { &studied.study.model };
        let failed = |source: TableBuildError| {
            let instead = self.other_alone(tissue);
            SimError::TissueTable { tissue, paddle, instead, source: Box::new(source) }
        };
        let options = TableOptions { needle_speed, ..TableOptions::default() };
        let BuiltTable { table, ended } = build_as_deep_as_it_goes(model, paddle, &options).map_err(failed)?;
        let bytes = to_bytes(&table).map_err(failed)?;
        Ok(EncodedTable { table, bytes, ended })
    }

    /// `none` and `static` of all cases, on all threads: nothing in them runs in real time.
    fn uncontrolled(&self) -> Result<Vec<Uncontrolled>, SimError> {
        self.begins("strategies without a controller");
        let jobs: Vec<(usize, Option<u32>, Strategy)> = self
            .cases
            .iter()
            .enumerate()
            .flat_map(|(i, case)| {
                let none = (!case.is_mismatch).then_some((i, None, Strategy::None));
                let paddle = self.studied(case.table_tissue).study.placement.optimum.static_paddle;
                none.into_iter().chain([(i, Some(paddle), Strategy::Static)])
            })
            .collect();
        // What is written at the end of a long insertion takes long too, and there is nothing to tidy up.
        let outcomes = signals::ends_at_once(|| {
            parallel::map(jobs.len(), self.options.threads, |job| {
                let (i, paddle, strategy) = jobs[job];
                let label = self.cases[i].label(strategy);
                self.insertion(&self.cases[i], label, &|| self.progress.step()).uncontrolled(paddle)
            })
        });
        let mut results: Vec<_> = self.cases.iter().map(|_| (None, None)).collect();
        for ((i, paddle, _), outcome) in jobs.iter().zip(outcomes) {
            let measured = Some(outcome?);
            match paddle {
                None => results[*i].0 = measured,
                Some(_) => results[*i].1 = measured,
            }
        }
        Ok(results)
    }

    fn insertion<'a>(&'a self, case: &Case, label: Label, progress: &'a dyn Fn()) -> SimulatedInsertion<'a> {
        let studied = self.studied(case.tissue);
        SimulatedInsertion {
            model: studied.plant(),
            reductions: Some(&studied.reductions),
            simulation: &self.simulation,
            label,
            extras: self.options.extras,
            progress,
        }
    }

    /// Everything about one case; what runs without a clock is known.
    fn strategies(
        &self,
        case: &Case,
        [none, static_paddle, dynamic]: [Option<MeasuredInsertion>; 3],
        table: &EncodedTable,
        spectator: Option<&dyn Spectator>,
    ) -> Result<Known, SimError> {
        let (mut artifacts, mut not_kept) = (Vec::new(), None);
        let mut keep = |measured: MeasuredInsertion| {
            artifacts.extend(measured.artifacts);
            measured.result
        };
        let mut strategies = Strategies {
            none: none.map(&mut keep),
            static_paddle: static_paddle.map(&mut keep),
            dynamic: dynamic.map(&mut keep),
            dynamic_free_run: None,
        };
        if self.is_in_free_run(case) {
            self.begins(&format!("{}: dynamic, {}", case.tissue, RunMode::FreeRun));
            let step = || self.progress.step();
            let insertion = self.insertion(case, case.label(Strategy::dynamic(RunMode::FreeRun)), &step);
            match insertion.controlled(&self.controller(table, RunMode::FreeRun, spectator)) {
                Ok(controlled) => strategies.dynamic_free_run = Some(keep(controlled)),
                // What has no clock has taken minutes, and is worth having by itself.
                Err(error) if error.is_too_slow() && strategies.dynamic.is_some() => not_kept = Some(error),
                Err(error) => return Err(error),
            }
        }
        Ok(Known { strategies, artifacts, not_kept })
    }

    fn controller<'a>(
        &'a self,
        table: &'a EncodedTable,
        mode: RunMode,
        spectator: Option<&'a dyn Spectator>,
    ) -> ControllerSetup<'a> {
        ControllerSetup {
            program: &self.options.program,
            table: &table.table,
            table_bytes: &table.bytes,
            mode,
            hardware: self.options.hardware,
            spectator,
        }
    }

    fn case_result(&self, case: &Case, encoded: &EncodedTable, strategies: Strategies) -> Result<CaseResult, SimError> {
        let EncodedTable { table, bytes, ended } = encoded;
        let settings = self.simulation.loop_settings.settings(table.validity.depth_end);
        let controller = Controller::new(table, &settings)?;
        let dynamic = strategies.controlled();
        let over = |strategy: &Option<StrategyResult>| {
            let factor = |dynamic: &StrategyResult| {
                strategy.as_ref().map(|other| other.max_orthogonal_error / dynamic.max_orthogonal_error)
            };
            dynamic.and_then(factor)
        };
        let causes = self.options.causes.then(|| self.causes(case, table)).transpose()?;
        let (improvement, improvement_over_none) = (over(&strategies.static_paddle), over(&strategies.none));
        Ok(CaseResult {
            tissue: case.tissue,
            table_tissue: TableTissue::believed(table, &self.scene),
            table: TableResult {
                hash: hex(&Sha256::digest(bytes)),
                scene_hash: hex(&table.scene_hash),
                paddle: table.paddles[0].index,
                knots: table.knots.len(),
                bytes: bytes.len(),
                loop_gain: controller.loop_gain(),
                delay_samples: controller.delay_samples(),
                depth: table.knots.iter().map(|knot| knot.depth).collect(),
                paddle_path: table.knots.iter().map(|knot| knot.paddle_path.into()).collect(),
                ends_early: ends_early(table.validity.depth_end, self.simulation.needle.depth(), ended.as_ref()),
            },
            strategies,
            improvement,
            improvement_over_none,
            causes,
        })
    }

    /// What the error of the controlled insertion is made of.
    fn causes(&self, case: &Case, table: &Table<f64, 2>) -> Result<CausesResult, SimError> {
        self.progress.say(&format!("{}: causes of the error", case.tissue));
        let studied = self.studied(case.tissue);
        let examined =
            Examined { model: studied.plant(), table, simulation: &self.simulation, reductions: &studied.reductions };
        signals::ends_at_once(|| examined.causes())
    }

    fn placements(&self) -> Vec<PlacementResult> {
        self.studied.iter().map(|studied| describe::placement(studied.tissue, &studied.study)).collect()
    }

    /// The body that all bodies are drawn on: that with the inclusions, whose edges its nodes may follow.
    fn drawn(&self) -> &TissueModel {
        let inclusion = self.studied.iter().find(|studied| studied.tissue == TissueVariant::Inclusion);
        inclusion.unwrap_or(&self.studied[0]).plant()
    }

    fn result(&self, mut cases: Vec<CaseResult>) -> RunResult {
        let geometry = Geometry::new(&self.scene, self.drawn().positions());
        for case in &mut cases {
            on_nodes_of(&geometry, self.studied(case.tissue).plant(), case);
        }
        RunResult {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: self.scene.name.clone(),
            units: [self.scene.length_unit.clone(), self.scene.stress_unit.clone()],
            mode: self.options.mode.unwrap_or(RunMode::Lockstep),
            seed: self.simulation.seed,
            settings: describe::settings(&self.scene, &self.simulation, self.options.table_knows_the_world),
            geometry,
            placements: self.placements(),
            cases,
            wall_s: self.started.elapsed().as_secs_f64(),
            command: describe::command_line(),
            platform: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
        }
    }
}
