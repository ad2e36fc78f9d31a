//! `host-sim stability`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::Args;
use model_offline::model::ModelError;
use model_offline::output::write_whole;
use model_offline::placement::study::best_dynamic;
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use model_offline::table::TableOptions;
use nalgebra::Matrix2;

use crate::bench::stability::cells::{self, Boundary, boundaries};
use crate::bench::stability::mismatch::{Mismatch, Refused, mismatches};
use crate::bench::stability::rate_limit::{self, Cell};
use crate::error::SimError;
use crate::report::stability as files;

/// Options of `stability`.
#[derive(Args, Clone, Debug)]
pub struct StabilityArgs {
    /// Folder for closed_loop.csv and closed_loop.svg; made when it is not there
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Scene file, or the name of a bundled scene [default: paper]
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Wider cells
    #[arg(long)]
    pub quick: bool,
    /// Threads to use [default: all]
    #[arg(long)]
    pub threads: Option<usize>,
    /// No progress and no summary
    #[arg(long)]
    pub quiet: bool,
}

/// Everything that was simulated.
#[derive(Debug)]
pub struct ClosedLoop {
    /// The scene's name.
    pub scene: String,
    /// Paddle whose Jacobian the cells are simulated around.
    pub paddle: u32,
    /// Its Jacobian at rest.
    pub jacobian: Matrix2<f64>,
    /// Whether cells are wide.
    pub quick: bool,
    /// Gain × delay × Jacobian error.
    pub boundaries: Vec<Boundary>,
    /// Table and tissue swapped, by paddle and depth; empty without inclusions.
    pub mismatches: Vec<Mismatch>,
    /// Paddles without a table, and why.
    pub refused: Vec<Refused>,
    /// Largest |λ| that the tables' gain allows for.
    pub lambda_max: f64,
    /// Rate limits with delay.
    pub cells: Vec<Cell>,
}

impl ClosedLoop {
    /// Gains of the cells along every boundary.
    pub fn gains(&self) -> Vec<f64> {
        cells::gains(self.quick)
    }
}

/// Simulates everything and writes the files.
///
/// # Errors
/// [`SimError`]: a bad scene, tissue that cannot be modelled, files that cannot be written.
pub fn stability(args: &StabilityArgs) -> Result<ClosedLoop, SimError> {
    let path = args.scene.as_deref().unwrap_or(Path::new("paper"));
    let scene = Scene::read(path).map_err(|error| SimError::Scene(Box::new(error)))?;
    let write_error = |path: &Path| {
        let path = path.to_owned();
        move |source| SimError::Write { path, source }
    };
    std::fs::create_dir_all(&args.out).map_err(write_error(&args.out))?;
    let bar = progress(args.quiet);
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).max(1);
    let result = simulate(&scene, args.quick, threads, &|| bar.inc(1))?;
    bar.finish_and_clear();
    for (name, text) in [("closed_loop.csv", files::csv(&result)), ("closed_loop.svg", files::figure(&result).svg())] {
        let path = args.out.join(name);
        write_whole(&path, text.as_bytes())
            .map_err(|error| SimError::Write { path: error.path, source: error.source })?;
    }
    if !args.quiet {
        print!("{}", files::summary(&result));
    }
    Ok(result)
}

fn simulate(scene: &Scene, quick: bool, threads: usize, progress: &dyn Fn()) -> Result<ClosedLoop, SimError> {
    let plain = scene.without_inclusions();
    let (model, _) = model_offline::placement::discretise(&plain)?;
    let paddle = best_dynamic(&model)?;
    let place = model.paddle_position(paddle);
    let jacobian = model
        .body(place, NewtonSettings::default())
        .and_then(|mut body| body.actuation_jacobian())
        .map_err(ModelError::from)?;
    let boundaries = boundaries(&jacobian, quick);
    progress();
    let (mut rows, mut refused) = (Vec::new(), Vec::new());
    if !scene.inclusions.is_empty() {
        let knots = if quick { 6 } else { 11 };
        (rows, refused) = mismatches(scene, knots, threads)?;
    }
    progress();
    let cells = rate_limit::map(quick);
    progress();
    let lambda_max = TableOptions::default().lambda_max;
    Ok(ClosedLoop {
        scene: scene.name.clone(),
        paddle,
        jacobian,
        quick,
        boundaries,
        mismatches: rows,
        refused,
        lambda_max,
        cells,
    })
}

fn progress(quiet: bool) -> indicatif::ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return indicatif::ProgressBar::hidden();
    }
    let bar = indicatif::ProgressBar::new(3);
    match indicatif::ProgressStyle::with_template("{wide_bar} {pos}/{len} parts") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
