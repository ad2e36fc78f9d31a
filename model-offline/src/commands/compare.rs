//! `model-offline compare`: which effects a scene needs.

use super::common::{DiscretizationArgs, RunArgs, SceneArgs, StudyProgress};
use super::error::CliError;
use super::json::write_json;
use model_offline::output::{self, check_outputs};
use model_offline::study::effects;
use model_offline::tell;
use std::path::PathBuf;

/// Options of `compare`.
#[derive(Debug, clap::Args)]
pub(super) struct CompareArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Change that counts, of the target's largest displacement and of the controllability measure.
    #[arg(long, default_value_t = 0.01, value_name = "SHARE")]
    effect_tolerance: f64,
    /// Write the result as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw a bar per effect.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write a line per effect.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    discretization: DiscretizationArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &CompareArgs) -> Result<(), CliError> {
    let scene = args.discretization.over(args.scene.read_any()?)?;
    if !(args.effect_tolerance > 0.0 && args.effect_tolerance < 1.0) {
        return Err(CliError::usage(
            format!("--effect-tolerance is {}", args.effect_tolerance),
            "give a share between 0 and 1, e.g. 0.01",
        ));
    }
    let outputs = [("--json", args.json.as_deref()), ("--svg", args.svg.as_deref()), ("--csv", args.csv.as_deref())];
    check_outputs(&[&args.scene.scene], &outputs)?;
    let progress = StudyProgress::new(&args.run, scene.discretization.resolution);
    progress.follow(0);
    let found = effects::compare(&scene, args.effect_tolerance, args.run.threads())?;
    progress.finish();
    let together = output::together();
    write_json(args.json.as_deref(), &found)?;
    if let Some(path) = &args.svg {
        output::write_whole(path, found.svg().as_bytes())?;
    }
    if let Some(path) = &args.csv {
        output::write_whole(path, &found.csv())?;
    }
    drop(together);
    if !args.run.quiet {
        tell!("{}", found.table());
    }
    Ok(())
}
