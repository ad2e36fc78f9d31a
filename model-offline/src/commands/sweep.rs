//! `model-offline sweep`: what the mesh does to the choice of a paddle.

use super::common::{RunArgs, SceneArgs, VariedArgs, study_files};
use super::error::CliError;
use model_offline::output;
use model_offline::say;
use model_offline::study::sweep;
use std::path::PathBuf;

/// Options of `sweep`.
#[derive(Debug, clap::Args)]
pub(super) struct SweepArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Folder for the chart, made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    varied: VariedArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &SweepArgs) -> Result<(), CliError> {
    let scene = args.varied.over(args.scene.read()?)?;
    let [csv, svg] = study_files(&[&args.scene.scene], &args.out, ["sweep.csv", "sweep.svg"])?;
    let bar = args.run.progress(sweep::STEPS);
    let found = sweep::sweep(&scene, args.run.threads(), &|| bar.inc(1))?;
    bar.finish_and_clear();
    let together = output::together();
    output::write_whole(&csv, &found.csv())?;
    output::write_whole(&svg, found.svg().as_bytes())?;
    drop(together);
    if !args.run.quiet {
        say!("{}\n{}\n{}", found.table(), csv.display(), svg.display());
    }
    Ok(())
}
