//! `model-offline pareto`: error against time for every method.

use super::common::{RunArgs, SceneArgs, VariedArgs};
use super::error::CliError;
use model_offline::output;
use model_offline::study::{Extent, pareto};
use std::path::PathBuf;

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
    let scene = args.varied.over(args.scene.read()?)?;
    output::make_folder(&args.out)?;
    let bar = args.run.progress(1000);
    let comparison =
        pareto::compare(&scene, Extent::of_flag(args.quick), &|share| bar.set_position((1000.0 * share) as u64))?;
    bar.finish_and_clear();
    let (csv, svg) = (args.out.join("pareto.csv"), args.out.join("pareto.svg"));
    output::write_whole(&csv, &comparison.csv())?;
    output::write_whole(&svg, comparison.svg(&scene.name, scene.tissue()).as_bytes())?;
    if !args.run.quiet {
        print!("{}", comparison.table());
        println!("{}\n{}", csv.display(), svg.display());
    }
    Ok(())
}
