//! `model-offline table`: the controller table of one paddle.

use super::common::{DiscretizationArgs, RunArgs, SceneArgs};
use super::error::CliError;
use model_offline::output::check_outputs;
use model_offline::output::{self, table_text};
use model_offline::placement::model_with_paddle;
use model_offline::table::{self, TableOptions};
use std::path::PathBuf;

/// Options of `table`.
#[derive(Debug, clap::Args)]
pub(super) struct TableArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Paddle index (default: the best dynamic paddle).
    #[arg(long)]
    paddle: Option<u32>,
    /// Where to write the table.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Depth knots.
    #[arg(long, default_value_t = TableOptions::default().knots)]
    knots: usize,
    #[command(flatten)]
    discretization: DiscretizationArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &TableArgs) -> Result<(), CliError> {
    let scene = args.discretization.over(args.scene.read_still()?)?;
    check_outputs(&[&args.scene.scene], &[("--output", Some(&args.output))])?;
    let (model, paddle) = model_with_paddle(&scene, args.paddle)?;
    let options = TableOptions { knots: args.knots, ..TableOptions::default() };
    let table = table::build(&model, paddle, &options)?;
    let bytes = table::to_bytes(&table)?;
    output::write_whole(&args.output, &bytes)?;
    if !args.run.quiet {
        println!("{}: {} bytes\n{}", args.output.display(), bytes.len(), table_text::summary(&table));
    }
    Ok(())
}
