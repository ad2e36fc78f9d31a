//! `model-offline pareto`: error against time for every method.

use super::common::{Common, SceneArgs};
use super::error::CliError;
use model_offline::output;
use model_offline::placement::adaptive::profile_model;
use model_offline::placement::discretise;
use model_offline::scene::Scene;
use model_offline::study::{Extent, pareto, table_pareto};
use std::path::PathBuf;

/// Options of `pareto`.
#[derive(Debug, clap::Args)]
pub(super) struct ParetoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Folder for the charts, made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Fewer settings.
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(args: &ParetoArgs) -> Result<(), CliError> {
    let scene = args.common.over(args.scene.read()?)?;
    output::make_folder(&args.out)?;
    let bar = args.common.progress(1000);
    let comparison =
        pareto::compare(&scene, Extent::of_flag(args.quick), &|share| bar.set_position((1000.0 * share) as u64))?;
    bar.finish_and_clear();
    let (csv, svg) = (args.out.join("pareto.csv"), args.out.join("pareto.svg"));
    output::write_whole(&csv, comparison.csv().as_bytes())?;
    output::write_whole(&svg, comparison.svg(&scene.name, scene.tissue()).as_bytes())?;
    let tables = tables(&scene, args)?;
    if !args.common.quiet {
        print!("{}{tables}", comparison.table());
        println!("{}\n{}", csv.display(), svg.display());
    }
    Ok(())
}

/// The comparison of tables, on the scene's own model; where the loop cannot be closed on it, says why and goes on.
fn tables(scene: &Scene, args: &ParetoArgs) -> Result<String, CliError> {
    let model = profile_model(&discretise(scene)?.0)?;
    match table_pareto::compare_tables(&model, args.common.threads()) {
        Ok(points) => {
            output::write_whole(&args.out.join("pareto_table.csv"), table_pareto::csv(&points).as_bytes())?;
            let svg = table_pareto::svg(&points, &scene.name);
            output::write_whole(&args.out.join("pareto_table.svg"), svg.as_bytes())?;
            Ok(table_pareto::table(&points))
        }
        Err(error) => Ok(format!("tables were not compared: {error}\n")),
    }
}
