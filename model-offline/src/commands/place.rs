//! `model-offline place`: the whole placement study.

use super::common::{DiscretizationArgs, RunArgs, SceneArgs, StudyProgress};
use super::error::CliError;
use super::json::write_json;
use super::place_space;
use super::place_text;
use super::table::warnings;
use model_offline::model::ModelError;
use model_offline::output;
use model_offline::output::check_outputs;
use model_offline::placement::workflow::StudyAccuracy;
use model_offline::placement::{PlacementOptions, PlacementStudy, study};
use model_offline::scene::Scene;
use model_offline::table::{self, BuiltTable, TableOptions};
use model_offline::tell;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Options of `place`.
#[derive(Debug, clap::Args)]
pub(super) struct PlaceArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,
    /// Write the study as JSON.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Write the controller table of the best dynamic paddle.
    #[arg(long, value_name = "FILE")]
    pub(super) table: Option<PathBuf>,
    #[command(flatten)]
    discretization: DiscretizationArgs,
    #[command(flatten)]
    pub(super) run: RunArgs,
}

pub(super) fn run(args: &PlaceArgs) -> Result<(), CliError> {
    let outputs = [("--json", args.json.as_deref()), ("--table", args.table.as_deref())];
    if let Some(scene) = args.scene.read_in_space()? {
        let scene = args.discretization.over_space(scene)?;
        check_outputs(&args.scene.files(&scene), &outputs)?;
        if args.table.is_some() {
            return Err(CliError::usage(
                "--table: in space a table is made of another model than the study, by a command of its own",
                "leave --table out, and use `model-offline table SCENE -o FILE`",
            ));
        }
        return place_space::run(&scene, args.json.as_deref(), &args.run);
    }
    let scene = args.discretization.over(args.scene.read()?)?;
    check_outputs(&[&args.scene.scene], &outputs)?;
    place(&scene, args).map_err(|error| error.reported(args.json.as_deref(), &scene))?.finish(args)
}

/// A study whose JSON and text are out; the table, or why there is none, is left.
struct Placed {
    table: Option<Result<MadeTable, CliError>>,
}

/// The bytes of a table, and what is to be said of it.
type MadeTable = (Vec<u8>, String);

impl Placed {
    fn finish(self, args: &PlaceArgs) -> Result<(), CliError> {
        match (self.table, &args.table) {
            (Some(table), Some(path)) => {
                let (bytes, warnings) = table?;
                output::write_whole(path, &bytes)?;
                if !args.run.quiet {
                    tell!("{warnings}");
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

fn place(scene: &Scene, args: &PlaceArgs) -> Result<Placed, CliError> {
    let bar = StudyProgress::new(&args.run, scene.discretization.resolution);
    bar.begin(study::steps(scene));
    let progress = || bar.step();
    let threads = args.run.threads();
    let options = PlacementOptions { threads, progress: &progress, ..Default::default() };
    let study = PlacementStudy::run(scene, &options)?;
    let wanted = !args.run.quiet || args.json.is_some();
    let accuracy = wanted.then(|| study.accuracy(threads));
    bar.finish();
    let table = args.table.as_ref().map(|_| table_of(&study));
    write_json(args.json.as_deref(), &document(&study, accuracy.as_ref(), table.as_ref()))?;
    if !args.run.quiet {
        tell!("{}", place_text::summary(&study, accuracy.as_ref()));
    }
    Ok(Placed { table })
}

/// The controller table of the best dynamic paddle.
fn table_of(study: &PlacementStudy) -> Result<MadeTable, CliError> {
    let paddle = study.placement.optimum.dynamic_paddle.ok_or(ModelError::NoPaddleControls)?;
    let BuiltTable { table, ended } = table::build_as_deep_as_it_goes(&study.model, paddle, &TableOptions::default())?;
    Ok((table::to_bytes(&table)?, warnings(&table, ended, study.model.scene().needle.speed)))
}

type AccuracyOutcome = Result<StudyAccuracy, ModelError>;

fn document(
    study: &PlacementStudy,
    accuracy: Option<&AccuracyOutcome>,
    table: Option<&Result<MadeTable, CliError>>,
) -> Value {
    let scene = study.model.scene();
    let known = accuracy.and_then(|a| a.as_ref().ok());
    let mut paddles = json!(study.placement.paddles);
    for (i, paddle) in paddles.as_array_mut().into_iter().flatten().enumerate() {
        paddle["error"] = json!(known.map(|known| &known.errors.paddles[i]));
    }
    let mut no_paddle = json!(study.placement.no_paddle);
    no_paddle["error"] = json!(known.map(|known| json!({ "static": known.errors.no_paddle })));
    json!({
        "scene": scene.name,
        "tissue": scene.tissue(),
        "units": [&scene.length_unit, &scene.stress_unit],
        "nodes": study.model.nodes(),
        "dofs": study.model.dofs(),
        "integration": scene.discretization.method.integration,
        "wall_s": study.wall_s,
        "error_estimate": study.error_estimate,
        "left_out": known.map(|known| &known.left_out),
        "cross_check": known.and_then(|known| known.cross_check),
        "errors_unknown": accuracy.and_then(|a| a.as_ref().err()).map(ToString::to_string),
        "reference_nodes": known.map(|known| known.reference_nodes),
        "static_nodes": study.placement.profile_nodes,
        "static_second_nodes": known.and_then(|known| known.errors.second_nodes),
        "paddles": paddles,
        "no_paddle": no_paddle,
        "optimum": study.placement.optimum,
        "as_good": known.map(|known| known.errors.as_good(&study.placement)),
        "warnings": scene.told_warnings(),
        "table_failure": table.and_then(|table| table.as_ref().err()).map(ToString::to_string),
    })
}
