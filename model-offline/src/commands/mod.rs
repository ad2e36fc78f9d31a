//! The command line of `model-offline`.

mod new;

use clap::{Args, CommandFactory as _, Parser, Subcommand};
use model_offline::discretization::{Basis, DiscretizationError, Essential, Integration, Resolution};
use model_offline::model::{ModelError, TissueModel};
use model_offline::output::{self, OutputError};
use model_offline::placement::adaptive::{self, ErrorEstimate};
use model_offline::placement::cross_check::cross_check;
use model_offline::placement::verdict::verdict;
use model_offline::placement::{Placement, study};
use model_offline::scene::{Scene, SceneError, check_override, check_tolerance, schema};
use model_offline::solver::equilibrium::{Failure, NewtonSettings};
use model_offline::study::{fit, pareto, stability, sweep, table_pareto};
use model_offline::table::{self, TableBuildError, TableOptions};
use nalgebra::Vector2;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Tissue model, paddle placement and controller tables for needle insertion.
#[derive(Debug, Parser)]
#[command(name = "model-offline", version, about, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Full placement study: every paddle, as a fixture and as an actuator.
    #[command(after_help = "Example:\n  model-offline place model-offline/scenes/paper.toml --json place.json")]
    Place {
        /// Scene file, or the name of a bundled scene (paper, paper-hull, breast, prostate, tethered).
        scene: PathBuf,
        /// Leave the inclusions out: homogeneous tissue.
        #[arg(long)]
        without_inclusion: bool,
        /// Write the study as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Write the controller table of the best dynamic paddle.
        #[arg(long, value_name = "FILE")]
        table: Option<PathBuf>,
        #[command(flatten)]
        common: Common,
    },
    /// One equilibrium: needle at a depth, one paddle displaced.
    #[command(
        after_help = "Example:\n  model-offline solve paper --paddle 3 --depth 0.1 --vtu body.vtu --svg body.svg"
    )]
    Solve {
        /// Scene file, or the name of a bundled scene.
        scene: PathBuf,
        /// Index of the paddle that is attached.
        #[arg(long)]
        paddle: u32,
        /// Needle depth, length units.
        #[arg(long)]
        depth: f64,
        /// Paddle displacement, length units.
        #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
        paddle_displacement: Option<Vec<f64>>,
        /// Leave the inclusions out: homogeneous tissue.
        #[arg(long)]
        without_inclusion: bool,
        /// Write the result as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Write displacement, strain, stress and det F for ParaView.
        #[arg(long, value_name = "FILE")]
        vtu: Option<PathBuf>,
        /// Draw the deformed body.
        #[arg(long, value_name = "FILE")]
        svg: Option<PathBuf>,
        #[command(flatten)]
        common: Common,
    },
    /// Controller table of one paddle.
    #[command(after_help = "Example:\n  model-offline table paper --paddle 3 -o paddle3.table")]
    Table {
        /// Scene file, or the name of a bundled scene.
        scene: PathBuf,
        /// Paddle index (default: the best dynamic paddle).
        #[arg(long)]
        paddle: Option<u32>,
        /// Where to write the table.
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
        /// Depth knots.
        #[arg(long, default_value_t = TableOptions::default().knots)]
        knots: usize,
        /// Leave the inclusions out: homogeneous tissue.
        #[arg(long)]
        without_inclusion: bool,
        #[command(flatten)]
        common: Common,
    },
    /// Where each method stops working, and why: depth reached against every parameter.
    #[command(after_help = "Example:\n  model-offline stability paper --out stability --quick")]
    Stability {
        /// Scene file, or the name of a bundled scene.
        scene: PathBuf,
        /// Folder for stability.csv, stability.svg and zero_energy.csv; made when it is not there.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Fewer values and one spacing for the sweeps.
        #[arg(long)]
        quick: bool,
        /// Index of the paddle attached as a fixture (default: the best dynamic paddle).
        #[arg(long, value_name = "K")]
        paddle: Option<u32>,
        #[command(flatten)]
        common: Common,
    },
    /// What a table holds, checked.
    #[command(after_help = "Example:\n  model-offline inspect paddle3.table")]
    Inspect {
        /// Table file.
        table: PathBuf,
        /// Write the contents as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
    },
    /// Error against time for every method there is: pareto.csv and pareto.svg.
    #[command(
        after_help = "Example:\n  model-offline pareto paper --out charts --quick\n\nTimes are those of one thread; leave the machine alone meanwhile. About five minutes without --quick."
    )]
    Pareto {
        /// Scene file, or the name of a bundled scene.
        scene: PathBuf,
        /// Folder for the charts, made if need be.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Fewer settings.
        #[arg(long)]
        quick: bool,
        /// Leave the inclusions out: homogeneous tissue.
        #[arg(long)]
        without_inclusion: bool,
        #[command(flatten)]
        common: Common,
    },
    /// What the mesh does to the choice of a paddle: both rankings along a refinement, sweep.csv and sweep.svg.
    #[command(after_help = "Example:\n  model-offline sweep paper --without-inclusion --out charts")]
    Sweep {
        /// Scene file, or the name of a bundled scene.
        scene: PathBuf,
        /// Folder for the chart, made if need be.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Leave the inclusions out: homogeneous tissue.
        #[arg(long)]
        without_inclusion: bool,
        #[command(flatten)]
        common: Common,
    },
    /// The smallest model that keeps a tolerance, chosen from the cheapest up; what was rejected, and by which number.
    #[command(after_help = "Example:\n  model-offline fit paper --tolerance 0.01 -o fitted.toml --json fit.json")]
    Fit {
        /// Scene file, or the name of a bundled scene.
        scene: PathBuf,
        /// Relative error of controllability and target displacement to keep.
        #[arg(long, value_name = "T")]
        tolerance: f64,
        /// Write the scene with the choice in it.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Write the choice and what was rejected as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Leave the inclusions out: homogeneous tissue.
        #[arg(long)]
        without_inclusion: bool,
        /// Threads to use for training (default: all). Times are those of one thread.
        #[arg(long)]
        threads: Option<usize>,
        /// No summary.
        #[arg(long)]
        quiet: bool,
    },
    /// A commented scene to start from, also from an SVG drawing or a Gmsh mesh.
    #[command(
        after_help = "Examples:\n  model-offline new -o my.toml\n  model-offline new --svg outline.svg --size 120 -o my.toml\n  model-offline new --msh body.msh -o my.toml"
    )]
    New(new::NewArgs),
    /// Prints a completion script for a shell.
    #[command(
        after_help = "Example:\n  model-offline completions bash > ~/.local/share/bash-completion/completions/model-offline"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Writes manual pages, one for every command.
    #[command(after_help = "Example:\n  model-offline man man1 && man ./man1/model-offline.1")]
    Man {
        /// Directory for the pages.
        directory: PathBuf,
    },
    /// JSON Schema of the scene file.
    #[command(after_help = "Example:\n  model-offline schema > scene.schema.json")]
    Schema,
}

/// Flags that override `[discretization]`, and how to run.
#[derive(Debug, Args)]
struct Common {
    /// Node spacing, length units.
    #[arg(long, value_name = "H", conflicts_with = "tolerance")]
    spacing: Option<f64>,
    /// Relative error of the controllability measures to refine down to.
    #[arg(long, value_name = "T")]
    tolerance: Option<f64>,
    /// Kernel support over local spacing.
    #[arg(long)]
    support: Option<f64>,
    /// Integration rule.
    #[arg(long)]
    integration: Option<Integration>,
    /// Basis of the shape functions.
    #[arg(long)]
    basis: Option<Basis>,
    /// How essential boundary conditions are imposed.
    #[arg(long)]
    essential: Option<Essential>,
    /// Threads to use (default: all).
    #[arg(long)]
    threads: Option<usize>,
    /// No progress and no summary.
    #[arg(long)]
    quiet: bool,
}

/// Why a command failed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub(crate) enum CliError {
    /// The scene is bad.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// An argument is bad.
    #[error("{0}")]
    #[diagnostic(help("{1}"))]
    Usage(String, String),
    /// The table file cannot be used.
    #[error("{}: {reason}", path.display())]
    BadTable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The model cannot be made or solved.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The table cannot be made.
    #[error(transparent)]
    Table(#[from] TableBuildError),
    /// No equilibrium.
    #[error("no equilibrium: {failure}; last converged state at depth {depth:.4}")]
    #[diagnostic(help(
        "the tissue law loses stability under strong compression: reduce the depth, or add a barrier to the material"
    ))]
    Solve {
        /// Why.
        failure: Failure,
        /// Depth of the last converged state.
        depth: f64,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl CliError {
    /// 2 for bad input or usage, 1 for a computation that failed.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_) | Self::Usage(..) | Self::BadTable { .. } => 2,
            Self::Model(ModelError::Unsupported(_)) => 2,
            Self::Table(TableBuildError::NoSuchPaddle(_) | TableBuildError::Knots(_)) => 2,
            _ => 1,
        }
    }

    fn reason(&self) -> String {
        match self {
            Self::Solve { failure, .. } | Self::Model(ModelError::Solve(failure)) => failure.reason.to_string(),
            Self::Model(ModelError::Uncontrollable { .. }) => "singular-jacobian".into(),
            Self::Model(ModelError::Shape(_) | ModelError::Discretization(DiscretizationError::Shape(_))) => {
                "singular-moment-matrix".into()
            }
            _ => "failed".into(),
        }
    }
}

impl Common {
    fn scene(&self, path: &Path, without_inclusion: bool) -> Result<Scene, CliError> {
        let mut scene = Scene::read(path)?;
        if without_inclusion {
            scene = scene.without_inclusions();
        }
        let spec = &mut scene.discretization;
        if let Some(h) = self.spacing {
            spec.resolution = Resolution::Spacing(h);
        }
        if let Some(t) = self.tolerance {
            spec.resolution = Resolution::Tolerance(t);
        }
        spec.method.support = self.support.unwrap_or(spec.method.support);
        spec.method.integration = self.integration.unwrap_or(spec.method.integration);
        spec.method.basis = self.basis.unwrap_or(spec.method.basis);
        spec.essential = self.essential.unwrap_or(spec.essential);
        check_override(&scene).map_err(|(message, help)| CliError::Usage(message, help))?;
        Ok(scene)
    }

    fn threads(&self) -> usize {
        threads_or_all(self.threads)
    }

    fn progress(&self, steps: u64) -> indicatif::ProgressBar {
        if self.quiet { indicatif::ProgressBar::hidden() } else { output::terminal::progress(steps) }
    }
}

/// Runs a command.
///
/// # Errors
/// [`CliError`], whose [`exit_code`](CliError::exit_code) is the process's.
pub(crate) fn run(cli: Cli) -> Result<(), CliError> {
    match cli.command {
        Command::Place { scene, without_inclusion, json, table, common } => {
            let scene = common.scene(&scene, without_inclusion)?;
            let outcome = place(&scene, &common, table.as_deref());
            match outcome {
                Ok((document, summary)) => {
                    if let Some(path) = json {
                        output::write_whole(&path, pretty(&document).as_bytes())?;
                    }
                    if !common.quiet {
                        print!("{summary}");
                    }
                    Ok(())
                }
                Err(error) => Err(report_failure(error, json.as_deref(), &scene)),
            }
        }
        Command::Solve { scene, paddle, depth, paddle_displacement, without_inclusion, json, vtu, svg, common } => {
            let scene = common.scene(&scene, without_inclusion)?;
            let displacement = match paddle_displacement.as_deref() {
                None => Vector2::zeros(),
                Some([x, y]) if x.is_finite() && y.is_finite() => Vector2::new(*x, *y),
                Some(_) => {
                    return Err(CliError::Usage(
                        "--paddle-displacement takes two finite numbers".into(),
                        "e.g. --paddle-displacement 0.01,-0.002".into(),
                    ));
                }
            };
            if !depth.is_finite() || depth < 0.0 {
                return Err(CliError::Usage(format!("--depth is {depth}"), "give a depth of 0 or more".into()));
            }
            let files = SolveFiles { json: json.as_deref(), vtu: vtu.as_deref(), svg: svg.as_deref() };
            solve(&scene, paddle, depth, displacement, &files, common.quiet)
                .map_err(|error| report_failure(error, json.as_deref(), &scene))
        }
        Command::Table { scene, paddle, output, knots, without_inclusion, common } => {
            let scene = common.scene(&scene, without_inclusion)?;
            let (model, _) = adaptive::discretise(&scene)?;
            let options = TableOptions { knots, ..TableOptions::default() };
            let paddle = match paddle {
                Some(index) => index,
                None => study::best_dynamic(&model)?,
            };
            let table = table::build(&model, paddle, &options)?;
            let bytes = table::to_bytes(&table)?;
            output::write_whole(&output, &bytes)?;
            if !common.quiet {
                println!(
                    "{}: {} bytes\n{}",
                    output.display(),
                    bytes.len(),
                    model_offline::output::table_text::summary(&table)
                );
            }
            Ok(())
        }
        Command::Stability { scene, out, quick, paddle, common } => {
            stability_study(&common.scene(&scene, false)?, &out, quick, paddle, &common)
        }
        Command::Inspect { table, json } => {
            let bad = |reason: String| CliError::BadTable { path: table.clone(), reason };
            let bytes = std::fs::read(&table).map_err(|e| bad(e.to_string()))?;
            let contents = model_offline::output::table_text::read(&bytes).map_err(|e| bad(e.to_string()))?;
            if let Some(path) = json {
                output::write_whole(&path, pretty(&model_offline::output::table_text::json(&contents)).as_bytes())?;
            }
            println!("{}: {} bytes, checked", table.display(), bytes.len());
            println!("{}", model_offline::output::table_text::summary(&contents));
            Ok(())
        }
        Command::Pareto { scene, out, quick, without_inclusion, common } => {
            let scene = common.scene(&scene, without_inclusion)?;
            pareto(&scene, &out, quick, &common)
        }
        Command::Sweep { scene, out, without_inclusion, common } => {
            let scene = common.scene(&scene, without_inclusion)?;
            output::make_folder(&out)?;
            let bar = common.progress(sweep::STEPS);
            let found = sweep::sweep(&scene, common.threads(), &|| bar.inc(1))?;
            bar.finish_and_clear();
            let (csv, svg) = (out.join("sweep.csv"), out.join("sweep.svg"));
            output::write_whole(&csv, found.csv().as_bytes())?;
            output::write_whole(&svg, found.svg().as_bytes())?;
            if !common.quiet {
                println!("{}\n{}\n{}", found.table(), csv.display(), svg.display());
            }
            Ok(())
        }
        Command::Fit { scene: path, tolerance, output, json, without_inclusion, threads, quiet } => {
            let mut scene = Scene::read(&path)?;
            if without_inclusion {
                scene = scene.without_inclusions();
            }
            scene.discretization.resolution = match scene.discretization.resolution {
                Resolution::Spacing(h) => Resolution::Spacing(h),
                _ => Resolution::Tolerance(tolerance),
            };
            check_tolerance(tolerance).map_err(|(message, help)| CliError::Usage(message, help))?;
            let threads = threads_or_all(threads);
            let outcome = fit::fit(&scene, tolerance, threads)
                .map_err(CliError::from)
                .and_then(|fit| Ok((scene_with(&fit, &path)?, fit)));
            let (text, fit) = outcome.map_err(|error| report_failure(error, json.as_deref(), &scene))?;
            if let Some(file) = output {
                output::write_whole(&file, text.as_bytes())?;
            }
            if let Some(file) = json {
                output::write_whole(&file, pretty(&fit).as_bytes())?;
            }
            if !quiet {
                print!("{}", fit.summary());
            }
            Ok(())
        }
        Command::New(args) => new::new(&args),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Cli::command(), "model-offline", &mut std::io::stdout());
            Ok(())
        }
        Command::Man { directory } => {
            let fail = |source| OutputError { path: directory.clone(), source };
            std::fs::create_dir_all(&directory).map_err(fail)?;
            clap_mangen::generate_to(Cli::command(), &directory).map_err(fail)?;
            println!("{}", directory.join("model-offline.1").display());
            Ok(())
        }
        Command::Schema => {
            println!("{}", pretty(&schema::json_schema()));
            Ok(())
        }
    }
}

/// The comparison of tables, on the scene's own model; where the loop cannot be closed on it, says why and goes on.
fn pareto_tables(scene: &Scene, out: &Path, common: &Common) -> Result<String, CliError> {
    let model = adaptive::profile_model(&adaptive::discretise(scene)?.0)?;
    match table_pareto::compare_tables(&model, common.threads()) {
        Ok(points) => {
            output::write_whole(&out.join("pareto_table.csv"), table_pareto::csv(&points).as_bytes())?;
            output::write_whole(&out.join("pareto_table.svg"), table_pareto::svg(&points, &scene.name).as_bytes())?;
            Ok(table_pareto::table(&points))
        }
        Err(error) => Ok(format!("tables were not compared: {error}\n")),
    }
}

fn threads_or_all(threads: Option<usize>) -> usize {
    threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get)).max(1)
}

/// The text of the scene with a fit written into it.
fn scene_with(fit: &fit::Fit, path: &Path) -> Result<String, CliError> {
    let text = Scene::text(path)?;
    fit.written_into(&text).map_err(|error| CliError::Usage(error.to_string(), "the scene changed meanwhile".into()))
}

fn pareto(scene: &Scene, out: &Path, quick: bool, common: &Common) -> Result<(), CliError> {
    output::make_folder(out)?;
    let bar = common.progress(1000);
    let comparison = pareto::compare(scene, quick, &|share| bar.set_position((1000.0 * share) as u64))?;
    bar.finish_and_clear();
    let (csv, svg) = (out.join("pareto.csv"), out.join("pareto.svg"));
    output::write_whole(&csv, comparison.csv().as_bytes())?;
    output::write_whole(&svg, comparison.svg(&scene.name, scene.tissue()).as_bytes())?;
    let tables = pareto_tables(scene, out, common)?;
    if !common.quiet {
        print!("{}{tables}", comparison.table());
        println!("{}\n{}", csv.display(), svg.display());
    }
    Ok(())
}

fn pretty(value: &impl serde::Serialize) -> String {
    // Values made of numbers, strings and lists always serialise.
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// A failed computation is told in the JSON too, so that a script sees the reason.
fn report_failure(error: CliError, json: Option<&Path>, scene: &Scene) -> CliError {
    if error.exit_code() == 1
        && let Some(path) = json
    {
        let document = serde_json::json!({
            "scene": scene.name, "tissue": scene.tissue(),
            "failure": {"reason": error.reason(), "detail": error.to_string()},
        });
        if let Err(output) = output::write_whole(path, pretty(&document).as_bytes()) {
            return output.into();
        }
    }
    error
}

fn place(scene: &Scene, common: &Common, table: Option<&Path>) -> Result<(serde_json::Value, String), CliError> {
    let start = Instant::now();
    let (model, estimate) = adaptive::discretise(scene)?;
    let profile = match estimate {
        Some(_) => adaptive::profile_model(&model)?,
        None => model.clone(),
    };
    let bar = common.progress(study::progress_steps(&model));
    let placement = study::place_on(&model, &profile, study::settings_for(scene), common.threads(), &|| bar.inc(1))?;
    bar.finish_and_clear();
    if let Some(path) = table {
        let built = table::build(&model, placement.optimum.dynamic, &TableOptions::default())?;
        output::write_whole(path, &table::to_bytes(&built)?)?;
    }
    let wall_s = start.elapsed().as_secs_f64();
    // Comes on top of the study, and only where the study does not judge itself.
    let check = if estimate.is_none() { cross_check(scene, &placement.paddles) } else { None };
    let document = serde_json::json!({
        "scene": scene.name,
        "tissue": scene.tissue(),
        "nodes": model.nodes(),
        "dofs": model.dofs(),
        "integration": scene.discretization.method.integration,
        "wall_s": wall_s,
        "error_estimate": estimate,
        "cross_check": check,
        "static_nodes": profile.nodes(),
        "paddles": placement.paddles,
        "optimum": placement.optimum,
    });
    let mut text = summary(scene, &model, &placement, estimate, wall_s);
    if let Some(check) = check {
        text.push_str(&check.line());
        text.push('\n');
    }
    Ok((document, text))
}

fn summary(
    scene: &Scene,
    model: &TissueModel,
    placement: &Placement,
    estimate: Option<ErrorEstimate>,
    wall_s: f64,
) -> String {
    use std::fmt::Write as _;
    let mut out = format!(
        "{} · {} tissue · {} nodes · {:.0} ms\n\n paddle   ‖J⁻¹n‖   J⁻¹n                  max orthogonal (fixture)\n",
        scene.name,
        scene.tissue(),
        model.nodes(),
        1e3 * wall_s
    );
    for p in &placement.paddles {
        let mark = |best: u32| if p.index == best { "*" } else { " " };
        let stopped = p
            .fixture
            .failure
            .as_ref()
            .map_or(String::new(), |f| format!("  stopped at depth {:.4}: {}", f.depth, f.reason));
        let _ = writeln!(
            out,
            "{:>7}  {:8.4}{} ({:8.4}, {:8.4})  {:12.6}{}{stopped}",
            p.index,
            p.controllability_measure,
            mark(placement.optimum.dynamic),
            p.best_direction[0],
            p.best_direction[1],
            p.fixture.max_orthogonal,
            mark(placement.optimum.fixture),
        );
    }
    if let Some(e) = estimate {
        let _ = writeln!(
            out,
            "\nestimated error: controllability {:.2} %, small-depth target displacement {:.2} % of the largest",
            100.0 * e.controllability,
            100.0 * e.target_displacement
        );
    }
    let _ = writeln!(
        out,
        "\nbest as a fixture: paddle {}; best as an actuator: paddle {}",
        placement.optimum.fixture, placement.optimum.dynamic
    );
    for line in verdict(placement, scene) {
        let _ = writeln!(out, "{line}");
    }
    out
}

fn stability_study(
    scene: &Scene,
    out: &Path,
    quick: bool,
    paddle: Option<u32>,
    common: &Common,
) -> Result<(), CliError> {
    let Resolution::Spacing(_) = scene.discretization.resolution else {
        return Err(CliError::Usage(
            "the study varies a spacing, and this scene has a tolerance".into(),
            "give the spacing to vary around, e.g. --spacing 0.1".into(),
        ));
    };
    let paddle = match paddle {
        Some(index) if scene.paddles.iter().any(|p| p.index == index) => index,
        Some(index) => return Err(no_such_paddle(scene, index)),
        None => study::best_dynamic(&TissueModel::new(&scene.without_inclusions())?)?,
    };
    output::make_folder(out)?;
    let plan = stability::Plan::new(scene, quick);
    let bar = common.progress(plan.runs() as u64);
    let result = plan.run(scene, paddle, common.threads(), &|| bar.inc(1))?;
    bar.finish_and_clear();
    output::write_whole(&out.join("stability.csv"), stability::csv(&result).as_bytes())?;
    output::write_whole(&out.join("zero_energy.csv"), stability::zero_energy_csv(&result).as_bytes())?;
    output::write_whole(&out.join("stability.svg"), stability::figure(&result).svg().as_bytes())?;
    if !common.quiet {
        print!("{}", stability::summary(&result));
    }
    Ok(())
}

fn no_such_paddle(scene: &Scene, index: u32) -> CliError {
    let known: Vec<String> = scene.paddles.iter().map(|p| p.index.to_string()).collect();
    CliError::Usage(format!("the scene has no paddle {index}"), format!("choose one of {}", known.join(", ")))
}

struct SolveFiles<'a> {
    json: Option<&'a Path>,
    vtu: Option<&'a Path>,
    svg: Option<&'a Path>,
}

fn solve(
    scene: &Scene,
    paddle: u32,
    depth: f64,
    displacement: Vector2<f64>,
    files: &SolveFiles<'_>,
    quiet: bool,
) -> Result<(), CliError> {
    let (model, _) = adaptive::discretise(scene)?;
    let position = model.paddle_position(paddle).ok_or_else(|| no_such_paddle(scene, paddle))?;
    let mut body = model.body(Some(position), NewtonSettings::default()).map_err(ModelError::from)?;
    // In pieces of the scene's increment: the path matters near the limits of stability.
    let pieces = (depth / scene.needle.depth * f64::from(scene.needle.increments)).ceil().max(1.0);
    for piece in 1..=pieces as u32 {
        let share = f64::from(piece) / pieces;
        if let Err(failure) = body.drive(depth * share, displacement * share) {
            return Err(CliError::Solve { failure, depth: body.depth() });
        }
    }
    let target = body.target_displacement();
    let orthogonal = target.dot(&scene.needle.orthogonal());
    let jacobian = body.actuation_jacobian().map_err(|failure| CliError::Solve { failure, depth: body.depth() })?;
    let nodal = model.nodal_displacements(body.equilibrium().coefficients()).map_err(ModelError::from)?;
    let point = |p: &Vector2<f64>| [p.x, p.y];
    if let Some(path) = files.json {
        let document = serde_json::json!({
            "scene": scene.name, "tissue": scene.tissue(), "nodes": model.nodes(), "dofs": model.dofs(),
            "integration": scene.discretization.method.integration,
            "paddle": paddle, "depth": depth, "paddle_displacement": point(&displacement),
            "target_displacement": point(&target), "orthogonal": orthogonal,
            "jacobian": study::rows(&jacobian),
            "strain_energy": body.equilibrium().energy(),
            "newton_iterations": body.equilibrium().effort().iterations,
            "node_positions": model.positions().iter().map(point).collect::<Vec<_>>(),
            "node_displacements": nodal.iter().map(point).collect::<Vec<_>>(),
            "failure": null,
        });
        output::write_whole(path, pretty(&document).as_bytes())?;
    }
    if let Some(path) = files.vtu {
        output::write_whole(path, output::vtu::vtu(&model, &body).as_bytes())?;
    }
    if let Some(path) = files.svg {
        output::write_whole(path, output::svg::svg(&model, &body).as_bytes())?;
    }
    if !quiet {
        println!(
            "{} · {} tissue · paddle {paddle} at ({}, {}) · depth {depth}\ntarget displacement ({:.8}, {:.8}), orthogonal {:.8}",
            scene.name,
            scene.tissue(),
            displacement.x,
            displacement.y,
            target.x,
            target.y,
            orthogonal
        );
    }
    Ok(())
}

/// Commands of the other program of this project, for those who mix them up.
const ELSEWHERE: [&str; 8] = ["run", "controller", "plant", "timing", "faults", "replay", "export", "report"];

/// Reads the command line; ends the process with help, or with what is wrong and what was meant.
pub(crate) fn parse() -> Cli {
    Cli::try_parse().unwrap_or_else(|error| {
        let word = error.get(clap::error::ContextKind::InvalidSubcommand).map(ToString::to_string);
        let _ = error.print();
        if let Some(word) = word {
            if ELSEWHERE.contains(&word.as_str()) {
                eprintln!("\n  tip: `{word}` is a command of host-sim: host-sim {word} --help");
            } else {
                output::terminal::suggest(&error, &word, &Cli::command());
            }
        }
        std::process::exit(error.exit_code());
    })
}
