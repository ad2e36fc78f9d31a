//! `host-sim run`: the main job.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use host_sim::SimError;
use host_sim::bench::comparison::{Comparison, ComparisonOptions, EncodedTable};
use host_sim::bench::insertion::Extras;
use host_sim::record::files::write_json;
use host_sim::report::directory::{check_directory, write_run};
use host_sim::report::terminal::summary::summary;
use host_sim::runtime::error::RuntimeError;
use host_sim::runtime::executor::Hardware;
use host_sim::runtime::plant::observer::Spectator;
use host_sim::runtime::signals;
use host_sim::runtime::time::mode::RunMode;
use host_sim::view::{self, InsertionBasis, View};
use model_offline::output::terminal::LongRun;
use model_offline::parallel;
use model_offline::scene::TableScalar;
use model_offline::scene::TissueVariant;
use model_offline::tell;

use super::live::{first_knobs, going_on, said, say};
use super::outputs::check_json_beside_report;
use super::run_space::SpaceJob;
use super::world_args::WorldArgs;

/// Options of `run`.
#[derive(Args, Clone, Debug)]
pub(crate) struct RunArgs {
    /// The simulated world.
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    /// Tissue of the simulation [default: both, and the inclusion with a table that does not know it]
    #[arg(long, value_enum)]
    pub(crate) tissue: Option<TissueVariant>,
    /// Tissue that the planner and the table believe in [default: the simulation's]
    #[arg(long, value_enum)]
    pub(crate) table_tissue: Option<TissueVariant>,
    /// Controller table to use instead of computing one, in the plane
    #[arg(long, value_name = "FILE", conflicts_with = "table_tissue")]
    pub(crate) table: Option<PathBuf>,
    /// Use a table of another scene all the same; the report says so
    #[arg(long, requires = "table")]
    pub(crate) allow_other_scene: bool,
    /// What the table knows of a world that is more than its model: a needle that slips and stress that relaxes, or nothing
    #[arg(long, value_enum, default_value_t)]
    pub(crate) table_world: TableWorld,
    /// What drives time [default: lockstep, then the dynamic strategy once more in free-run]
    #[arg(long, value_enum)]
    pub(crate) mode: Option<RunMode>,
    /// What computes the controller's steps: this machine, or the bare-metal image on a Cortex-M7 in QEMU (in lockstep)
    #[arg(long = "controller", value_enum, default_value_t)]
    pub(crate) hardware: Hardware,
    /// Number type that the controller computes in
    #[arg(long, value_enum, default_value_t)]
    pub(crate) scalar: TableScalar,
    /// Directory for the report, created whole
    #[arg(long, default_value = "stillpoint-report", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Serve a page on this machine's loopback that shows the runs with a controller, and the same to Foxglove and
    /// Lichtblick; afterwards go on inserting under the page's knobs until it says finish, or Ctrl-C
    #[arg(long)]
    pub(crate) view: bool,
    /// Port of both [default: any free one]
    #[arg(long, value_name = "PORT", requires = "view", default_value_t = 0, hide_default_value = true)]
    pub(crate) view_port: u16,
    /// Also write every controlled insertion as MCAP, for Foxglove and Lichtblick
    #[arg(long)]
    pub(crate) mcap: bool,
    /// Also write the body along every insertion as a VTU series with a .pvd, for ParaView
    #[arg(long)]
    pub(crate) vtu: bool,
    /// Also take the controller's error apart: the same insertion without the sensor's noise, without its delay, with a
    /// table that knows everything, and so on
    #[arg(long)]
    pub(crate) causes: bool,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Neither progress nor summary
    #[arg(long)]
    pub(crate) quiet: bool,
    /// Threads for placement and for strategies without a controller [default: all processors]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
}

/// What a table knows of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableWorld {
    /// What a table can know.
    #[default]
    Known,
    /// A contact that moves with the needle, in elastic tissue.
    Simple,
}

impl std::fmt::Display for TableWorld {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Known => "known",
            Self::Simple => "simple",
        })
    }
}

impl RunArgs {
    /// What of it is for a body in space.
    fn in_space(&self) -> SpaceJob<'_> {
        let given = [
            (self.table.is_some(), "--table"),
            (self.scalar != TableScalar::F64, "--scalar f32"),
            (self.causes, "--causes"),
        ];
        SpaceJob {
            world: &self.world,
            tissue: self.tissue,
            table_tissue: self.table_tissue,
            mode: self.mode,
            hardware: self.hardware,
            extras: self.extras(),
            view_port: self.view.then_some(self.view_port),
            out: &self.out,
            json: self.json.as_deref(),
            quiet: self.quiet,
            threads: self.threads,
            refused: given.iter().find(|(given, _)| *given).map(|(_, option)| *option),
        }
    }

    fn extras(&self) -> Extras {
        Extras { mcap: self.mcap, vtu: self.vtu }
    }

    fn options(&self) -> Result<ComparisonOptions, SimError> {
        let mut options = ComparisonOptions::new(std::env::current_exe().map_err(RuntimeError::Spawn)?);
        options.tissue = self.tissue;
        options.table_tissue = self.table_tissue;
        options.table.clone_from(&self.table);
        options.allow_other_scene = self.allow_other_scene;
        options.table_knows_the_world = self.table_world == TableWorld::Known;
        options.mode = self.mode;
        options.hardware = self.hardware;
        options.scalar = self.scalar;
        options.extras = self.extras();
        options.causes = self.causes;
        options.threads = parallel::threads(self.threads);
        Ok(options)
    }
}

/// Runs everything that was asked for and writes the report.
///
/// # Errors
/// [`SimError`]; nothing is written then, but by [`SimError::NotKept`], which comes after the report.
pub(crate) fn run(args: &RunArgs) -> Result<(), SimError> {
    signals::install();
    super::sweep();
    if let Some(scene) = args.world.scene_in_space()? {
        return super::run_space::run(&args.in_space(), &scene);
    }
    let scene = args.world.scene()?;
    let simulation = args.world.simulation(&scene)?;
    check_directory(&args.out)?;
    let inputs: Vec<&Path> = args.table.iter().chain(args.world.files()).map(PathBuf::as_path).collect();
    check_json_beside_report(&inputs, args.json.as_deref(), &args.out)?;
    let progress = if args.quiet { LongRun::hidden() } else { LongRun::new() };
    let options = args.options()?;
    let comparison = signals::ends_at_once(|| Comparison::prepare(scene, simulation, options, &progress))?;
    let knobs = first_knobs(&comparison.simulation().loop_settings);
    let view = args.view.then(|| View::start(args.view_port, knobs).map(said)).transpose()?;
    let compared = comparison.run(view.as_ref().map(|view| view as &dyn Spectator))?;
    progress.bar.finish_and_clear();
    let replaced = args.out.join("report.html").is_file();
    write_run(&args.out, &compared.result, compared.artifacts)?;
    if let Some(path) = &args.json {
        write_json(path, &compared.result)?;
    }
    if !args.quiet {
        tell!("{}", summary(&compared.result, &args.out));
        if replaced {
            tell!("in place of the report that was there; --out DIR keeps both\n");
        }
    }
    if let Some(source) = compared.not_kept {
        return Err(SimError::NotKept { source: Box::new(source) });
    }
    view.map_or(Ok(()), |view| go_on(args, &view, &comparison))
}

/// Goes on inserting under the page's knobs.
fn go_on(args: &RunArgs, view: &View, comparison: &Comparison<'_>) -> Result<(), SimError> {
    let Some((scene, table_tissue, EncodedTable { table, bytes, .. })) = comparison.last_case() else { return Ok(()) };
    let options = comparison.options();
    let basis = InsertionBasis {
        program: &options.program,
        scene,
        table_tissue,
        table,
        table_bytes: bytes,
        simulation: comparison.simulation().clone(),
        mode: args.mode.unwrap_or(RunMode::Lockstep),
        hardware: args.hardware,
    };
    let say = say(args.quiet);
    say(&going_on(view));
    view::insertions(view, &basis, &say)
}
