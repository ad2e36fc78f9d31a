//! `model-offline sweep`: what the mesh does to the choice of a paddle.

use super::common::{Common, SceneArgs};
use super::error::CliError;
use model_offline::output;
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
    common: Common,
}

pub(super) fn run(args: &SweepArgs) -> Result<(), CliError> {
    let scene = args.common.over(args.scene.read()?)?;
    output::make_folder(&args.out)?;
    let bar = args.common.progress(sweep::STEPS);
    let found = sweep::sweep(&scene, args.common.threads(), &|| bar.inc(1))?;
    bar.finish_and_clear();
    let (csv, svg) = (args.out.join("sweep.csv"), args.out.join("sweep.svg"));
    output::write_whole(&csv, &found.csv())?;
    output::write_whole(&svg, found.svg().as_bytes())?;
    if !args.common.quiet {
        println!("{}\n{}\n{}", found.table(), csv.display(), svg.display());
    }
    Ok(())
}
