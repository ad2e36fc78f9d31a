//! `model-offline fit`: the smallest model that keeps a tolerance, and the fewest of the scene's effects or dimensions.

use super::common::SceneArgs;
use super::error::CliError;
use super::fit_space;
use super::json::write_json;
use indicatif::ProgressBar;
use model_offline::discretization::Resolution;
use model_offline::output;
use model_offline::output::check_outputs;
use model_offline::output::terminal::{self, complain};
use model_offline::parallel;
use model_offline::scene::{Scene, limits};
use model_offline::study::fit;
use model_offline::tell;
use std::path::{Path, PathBuf};

/// Options of `fit`.
#[derive(Debug, clap::Args)]
pub(super) struct FitArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Relative error of controllability and target displacement to keep. Of a needle that slips, tissue that creeps and a
    /// patient that moves, what changes less than 0.15 of it is left out.
    #[arg(long, value_name = "T")]
    tolerance: f64,
    /// Write the scene with the choice in it.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the choice and what was rejected as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Of a scene in space: draw every paddle's measure in body and slice.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Of a scene in space: write the slice through needle and target, a planar scene.
    #[arg(long, value_name = "FILE")]
    write_slice: Option<PathBuf>,
    /// Threads to use for training (default: all). Times are those of one thread.
    #[arg(long)]
    threads: Option<usize>,
    /// No summary.
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(args: &FitArgs) -> Result<(), CliError> {
    if let Some(scene) = args.scene.read_in_space()? {
        let asked = fit_space::Asked {
            scene: &args.scene,
            tolerance: args.tolerance,
            output: args.output.as_deref(),
            json: args.json.as_deref(),
            svg: args.svg.as_deref(),
            write_slice: args.write_slice.as_deref(),
            threads: args.threads,
            quiet: args.quiet,
        };
        return fit_space::run(&scene, &asked);
    }
    let given = [("--svg", &args.svg), ("--write-slice", &args.write_slice)];
    if let Some((option, _)) = given.into_iter().find(|(_, file)| file.is_some()) {
        return Err(CliError::usage(
            format!("{option} is for scenes in space, whose slice is planar"),
            "leave it out: this scene is planar",
        ));
    }
    let mut scene = args.scene.read_any()?;
    scene.discretization.resolution = match scene.discretization.resolution {
        Resolution::Spacing(h) => Resolution::Spacing(h),
        _ => Resolution::Tolerance(args.tolerance),
    };
    limits::check_tolerance(args.tolerance)?;
    check_outputs(&[&args.scene.scene], &[("--output", args.output.as_deref()), ("--json", args.json.as_deref())])?;
    let bar = if args.quiet { ProgressBar::hidden() } else { terminal::stages() };
    let told = |what: &str| {
        if !args.quiet {
            bar.suspend(|| complain(&format!("{what} …")));
        }
        bar.set_message(what.to_owned());
    };
    let outcome = fit::fit_told(&scene, args.tolerance, parallel::threads(args.threads), &told)
        .map_err(CliError::from)
        .and_then(|fit| Ok((scene_with(&fit, &args.scene.scene)?, fit)));
    bar.finish_and_clear();
    let (text, fit) = outcome.map_err(|error| error.reported(args.json.as_deref(), &scene))?;
    let together = output::together();
    if let Some(file) = &args.output {
        output::write_whole(file, text.as_bytes())?;
    }
    write_json(args.json.as_deref(), &fit)?;
    drop(together);
    if !args.quiet {
        tell!("{}", fit.summary());
    }
    Ok(())
}

/// The text of the scene with a fit written into it.
fn scene_with(fit: &fit::Fit, path: &Path) -> Result<String, CliError> {
    let text = Scene::text(path)?;
    fit.written_into(&text).map_err(|error| CliError::usage(error.to_string(), "the scene changed meanwhile"))
}
