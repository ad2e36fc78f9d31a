//! `model-offline pareto`: error against time for every method.

use super::common::{RunArgs, SceneArgs, VariedArgs, study_files};
use super::error::CliError;
use model_offline::output;
use model_offline::scene::TissueVariant;
use model_offline::study::Extent;
use model_offline::study::pareto::{self, Pareto};
use model_offline::study::pareto_space::compare_in_space;
use model_offline::{say, tell};
use std::path::PathBuf;

/// What it writes.
const FILES: [&str; 2] = ["pareto.csv", "pareto.svg"];

/// Options of `pareto`.
#[derive(Debug, clap::Args)]
pub(super) struct ParetoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Folder for the charts, made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Fewer discretizations.
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    varied: VariedArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &ParetoArgs) -> Result<(), CliError> {
    if let Some(scene) = args.scene.read_in_space()? {
        args.varied.none_in_space()?;
        let compared = shown(args, |progress| Ok(compare_in_space(&scene, Extent::of_flag(args.quick), progress)?));
        return written(args, &compared?, &scene.name, scene.tissue());
    }
    let scene = args.varied.over(args.scene.read()?)?;
    let compared = shown(args, |progress| Ok(pareto::compare(&scene, Extent::of_flag(args.quick), progress)?));
    written(args, &compared?, &scene.name, scene.tissue())
}

/// Compares behind a progress bar.
fn shown(
    args: &ParetoArgs,
    compare: impl FnOnce(&dyn Fn(f64)) -> Result<Pareto, CliError>,
) -> Result<Pareto, CliError> {
    study_files(&[&args.scene.scene], &args.out, FILES)?;
    let bar = args.run.progress(1000);
    let comparison = compare(&|share| bar.set_position((1000.0 * share) as u64))?;
    bar.finish_and_clear();
    Ok(comparison)
}

/// Writes chart and numbers.
fn written(args: &ParetoArgs, comparison: &Pareto, scene: &str, tissue: TissueVariant) -> Result<(), CliError> {
    let [csv, svg] = FILES.map(|name| args.out.join(name));
    let together = output::together();
    output::write_whole(&csv, &comparison.csv())?;
    output::write_whole(&svg, comparison.svg(scene, tissue).as_bytes())?;
    drop(together);
    if !args.run.quiet {
        tell!("{}", comparison.table());
        say!("{}\n{}", csv.display(), svg.display());
    }
    Ok(())
}
