//! `model-offline table`: the controller table of one paddle, in space of one or two.

use super::common::{self, DiscretizationArgs, RunArgs, SceneArgs, StudyProgress};
use super::error::CliError;
use firmware::contract::Table;
use model_offline::number::length;
use model_offline::output::check_outputs;
use model_offline::output::{self, space_table_text, table_text};
use model_offline::parallel;
use model_offline::placement::model_with_paddle;
use model_offline::placement::space::workflow::insertion_model;
use model_offline::say;
use model_offline::scene::space::SpaceScene;
use model_offline::table::space::SpaceTable;
use model_offline::table::{self, BuiltTable, EndedEarly, TableBuildError, TableOptions};
use std::path::PathBuf;

/// Options of `table`.
#[derive(Debug, clap::Args)]
pub(super) struct TableArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Paddle index; of a scene in space one or two, as in `3,8` (default: the best to control with, in space the best pair).
    #[arg(long, value_delimiter = ',', num_args = 1, value_parser = common::paddle_index)]
    paddle: Vec<u32>,
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
    if let Some(scene) = args.scene.read_in_space()? {
        return in_space(args, args.discretization.over_space(scene)?);
    }
    let paddle = match args.paddle[..] {
        [] => None,
        [index] => Some(index),
        _ => return Err(TableBuildError::Paddles(args.paddle.len()).into()),
    };
    let scene = args.discretization.over(args.scene.read_still()?)?;
    check_outputs(&[&args.scene.scene], &[("--output", Some(&args.output))])?;
    let progress = StudyProgress::new(&args.run, scene.discretization.resolution);
    let (model, paddle) = model_with_paddle(&scene, paddle)?;
    progress.follow(0);
    let options = TableOptions { knots: args.knots, ..TableOptions::default() };
    let BuiltTable { table, ended } = table::build_as_deep_as_it_goes(&model, paddle, &options)?;
    let bytes = table::to_bytes(&table)?;
    progress.finish();
    output::write_whole(&args.output, &bytes)?;
    if !args.run.quiet {
        let summary = table_text::summary(&table);
        let warnings = warnings(&table, ended, scene.needle.speed);
        say!("{}: {} bytes\n{summary}{warnings}", args.output.display(), bytes.len());
    }
    Ok(())
}

/// A table in space, of the model that insertions are followed on.
fn in_space(args: &TableArgs, scene: SpaceScene) -> Result<(), CliError> {
    check_outputs(&args.scene.files(&scene), &[("--output", Some(&args.output))])?;
    let progress = StudyProgress::new(&args.run, scene.discretization.resolution);
    let model = parallel::within(args.run.threads(), || insertion_model(&scene))?;
    progress.follow(0);
    let paddles = match args.paddle.is_empty() {
        true => model.best_to_control()?,
        false => args.paddle.clone(),
    };
    let options = TableOptions { knots: args.knots, ..TableOptions::default() };
    let BuiltTable { table, ended } = SpaceTable::build_as_deep_as_it_goes(&model, &paddles, &options)?;
    let bytes = table.to_bytes()?;
    progress.finish();
    output::write_whole(&args.output, &bytes)?;
    if !args.run.quiet {
        let summary = space_table_text::summary(&table);
        say!("{}: {} bytes\n{summary}{}", args.output.display(), bytes.len(), early_end(ended));
    }
    Ok(())
}

/// What is to be said of a table for a needle at this speed.
pub(super) fn warnings(table: &Table<f64, 2>, ended: Option<EndedEarly>, speed: f64) -> String {
    early_end(ended) + &too_steep(table, speed)
}

/// A warning where a paddle cannot follow the path while the needle goes at this speed.
fn too_steep(table: &Table<f64, 2>, speed: f64) -> String {
    let (from, slope) = table::steepest_path(table);
    let rate = table.paddles.first().map_or(f64::INFINITY, |paddle| paddle.max_rate);
    if slope * speed <= rate {
        return String::new();
    }
    let [wanted, rate, from] = [slope * speed, rate, from].map(length);
    format!(
        "\nwarning: from depth {from} on the path asks for {wanted} per s at the scene's needle speed of {}, and the actuator has {rate}: \
         the target is not held there; insert more slowly, or choose another paddle\n",
        length(speed)
    )
}

/// A warning where the table is not as deep as the insertion.
fn early_end(ended: Option<EndedEarly>) -> String {
    let told = |ended| {
        format!(
            "\nwarning: {ended}; beyond that no controller has anything to go by: choose another paddle, insert less deep, or where \
             contact and paddle end nodes may be too close for the law: another --integration, or fewer nodes\n"
        )
    };
    ended.map_or_else(String::new, told)
}
