//! `model-offline draw`: a scene, or a result, as a picture.

use super::check_space;
use super::common::SceneArgs;
use super::common::warned;
use super::error::CliError;
use model_offline::output::field_picture::{self, Field};
use model_offline::output::result_file::{Which, read_body};
use model_offline::output::space_picture::{self, SpaceGeometry};
use model_offline::output::{PictureFormat, check_outputs, scene_picture, write_picture};
use model_offline::placement::space::workflow::coarse;
use model_offline::scene::space::SpaceScene;
use std::path::PathBuf;

/// Options of `draw`.
#[derive(Debug, clap::Args)]
pub(super) struct DrawArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Where to write the picture: a .svg, .png or .pdf file.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// What the colours of a result show; a result is a .json file of `solve --json` or `host-sim run` in place of a scene.
    #[arg(long, value_parser = field)]
    field: Option<Field>,
    /// Number of the case of a result of `host-sim run` [default: 1]
    #[arg(long, value_name = "N")]
    case: Option<usize>,
    /// Strategy of that case [default: dynamic]
    #[arg(long, value_parser = ["none", "static", "dynamic", "dynamic-free-run"])]
    strategy: Option<String>,
    /// The state nearest to this needle depth, length units [default: the deepest]
    #[arg(long, value_name = "LENGTH")]
    depth: Option<f64>,
}

fn field(word: &str) -> Result<Field, String> {
    let found = Field::ALL.iter().find(|(name, _)| *name == word);
    let names = || Field::ALL.map(|(name, _)| name).join(", ");
    found.map(|(_, field)| *field).ok_or_else(|| format!("one of {}", names()))
}

pub(super) fn run(args: &DrawArgs) -> Result<(), CliError> {
    check_outputs(&[&args.scene.scene], &[("--output", Some(&args.output))])?;
    PictureFormat::of(&args.output)?;
    let is_result = args.scene.scene.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    if is_result {
        return draw_result(args);
    }
    if args.field.is_some() || args.case.is_some() || args.strategy.is_some() || args.depth.is_some() {
        return Err(CliError::usage(
            "--field, --case, --strategy and --depth are for results, and a scene at rest has none",
            "draw DIR/result.json of `host-sim run`, or what `solve SCENE --depth D --json FILE` writes",
        ));
    }
    if let Some(scene) = args.scene.read_in_space()? {
        check_outputs(&args.scene.files(&scene), &[("--output", Some(&args.output))])?;
        return draw_in_space(args, &scene);
    }
    let scene = args.scene.read_any()?;
    write_picture(&args.output, &scene_picture::svg(&scene))?;
    eprint!("{}", warned(&scene.told_warnings()));
    Ok(())
}

/// The body at rest, on the mesh that insertions are followed on.
fn draw_in_space(args: &DrawArgs, scene: &SpaceScene) -> Result<(), CliError> {
    let warnings = check_space::warnings(scene, &check_space::survey(scene)?);
    let geometry = SpaceGeometry::new(&coarse(scene)?);
    write_picture(&args.output, &space_picture::scene_svg(&geometry, scene.needle.depth))?;
    eprint!("{}", warned(&warnings));
    Ok(())
}

fn draw_result(args: &DrawArgs) -> Result<(), CliError> {
    let result = &args.scene.scene;
    if args.scene.leaves_out_inclusions() {
        return Err(CliError::usage(
            "--without-inclusion is for scenes: a result is of the tissue that it is of",
            "give --case for another one, or solve without the inclusion",
        ));
    }
    if let Some(depth) = args.depth.filter(|depth| !depth.is_finite() || *depth < 0.0) {
        return Err(CliError::usage(format!("--depth is {depth}"), "give a depth of 0 or more"));
    }
    let which = Which { case: args.case, strategy: args.strategy.clone(), depth: args.depth };
    let body = read_body(result, &which)?;
    let field = args.field.unwrap_or(Field::Size);
    let Some(values) = field.values(&body) else {
        let there: Vec<&str> =
            Field::ALL.iter().filter(|(_, field)| field.values(&body).is_some()).map(|(name, _)| *name).collect();
        return Err(CliError::usage(
            format!("{}: it does not have this field", result.display()),
            format!("--field {}; tissue that relaxes has no stress that a displacement tells", there.join(" or ")),
        ));
    };
    Ok(write_picture(&args.output, &field_picture::svg(&body, field, &values))?)
}
