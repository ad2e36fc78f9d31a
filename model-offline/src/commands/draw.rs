//! `model-offline draw`: a scene, or a result, as a picture.

use super::check_space;
use super::common::SceneArgs;
use super::common::warned;
use super::error::CliError;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use model_offline::output::field_picture::{self, Field};
use model_offline::output::placement_picture::{self, DrawnStudy, read_study};
use model_offline::output::result_file::{AnyBody, Which, read_body};
use model_offline::output::space_picture::{self, SpaceGeometry};
use model_offline::output::terminal::complain;
use model_offline::output::{PictureFormat, check_outputs, scene_picture, write_picture};
use model_offline::placement::space::workflow::coarse;
use model_offline::scene::space::SpaceScene;
use std::path::{Path, PathBuf};

/// Options of `draw`.
#[derive(Debug, clap::Args)]
pub(super) struct DrawArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Where to write the picture: a .svg, .png or .pdf file.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// What the colours of a result show; a result is a .json file of `place --json`, `solve --json` or `host-sim run`, in place of a
    /// scene [default: size; in space orthogonal]
    #[arg(long, value_parser = PossibleValuesParser::new(Field::ALL.map(|(name, _)| name)).try_map(|name| field(&name)))]
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
    /// An earlier result of `place --json`, whose values are drawn beside those of this one.
    #[arg(long, value_name = "FILE")]
    beside: Option<PathBuf>,
}

fn field(word: &str) -> Result<Field, String> {
    let found = Field::ALL.iter().find(|(name, _)| *name == word);
    found.map(|(_, field)| *field).ok_or_else(|| format!("there is no field {word}"))
}

pub(super) fn run(args: &DrawArgs) -> Result<(), CliError> {
    check_outputs(&[&args.scene.scene], &[("--output", Some(&args.output))])?;
    PictureFormat::of(&args.output)?;
    let is_result = args.scene.scene.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    if is_result {
        return draw_result(args);
    }
    if args.picks_a_state() || args.beside.is_some() {
        return Err(CliError::usage(
            "--field, --case, --strategy, --depth and --beside are for results, and a scene at rest has none",
            "draw DIR/result.json of `host-sim run`, or what `solve SCENE --depth D --json FILE` or `place SCENE --json FILE` writes",
        ));
    }
    if let Some(scene) = args.scene.read_in_space()? {
        check_outputs(&args.scene.files(&scene), &[("--output", Some(&args.output))])?;
        return draw_in_space(args, &scene);
    }
    let scene = args.scene.read_any()?;
    write_picture(&args.output, &scene_picture::svg(&scene))?;
    warn_of(&scene.told_warnings());
    Ok(())
}

/// The body at rest, on the mesh that insertions are followed on.
fn draw_in_space(args: &DrawArgs, scene: &SpaceScene) -> Result<(), CliError> {
    let warnings = check_space::warnings(scene, &check_space::survey(scene)?);
    let geometry = SpaceGeometry::new(&coarse(scene)?);
    write_picture(&args.output, &space_picture::scene_svg(&geometry, scene.needle.depth))?;
    warn_of(&warnings);
    Ok(())
}

/// On standard error: standard output may be the picture.
fn warn_of(warnings: &[String]) {
    if !warnings.is_empty() {
        complain(warned(warnings).trim_end());
    }
}

impl DrawArgs {
    /// Whether one of the options is given that choose a state, or what of it is shown.
    fn picks_a_state(&self) -> bool {
        self.field.is_some() || self.case.is_some() || self.strategy.is_some() || self.depth.is_some()
    }
}

/// A placement study, alone or beside an earlier one.
fn draw_study(args: &DrawArgs, study: &DrawnStudy) -> Result<(), CliError> {
    if args.picks_a_state() {
        return Err(CliError::usage(
            "--field, --case, --strategy and --depth are for results that have states; `place` writes numbers over paddles",
            "leave them out, or draw what `solve SCENE --depth D --json FILE` writes",
        ));
    }
    let Some(path) = &args.beside else {
        return Ok(write_picture(&args.output, &placement_picture::svg(study, None))?);
    };
    check_outputs(&[path], &[("--output", Some(&args.output))])?;
    let Some(earlier) = read_study(path)? else {
        return Err(no_study("--beside", path));
    };
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(write_picture(&args.output, &placement_picture::svg(study, Some((&name, &earlier))))?)
}

fn no_study(what: &str, path: &Path) -> CliError {
    CliError::usage(
        format!("{what}: {} is no result of `place`", path.display()),
        "--beside compares two results of `model-offline place SCENE --json FILE`",
    )
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
    if let Some(study) = read_study(result)? {
        return draw_study(args, &study);
    }
    if args.beside.is_some() {
        return Err(no_study("with --beside", result));
    }
    let which = Which { case: args.case, strategy: args.strategy.clone(), depth: args.depth };
    let svg = match read_body(result, &which)? {
        AnyBody::Planar(body) => {
            let (field, values) = wanted(args, Field::Size, |field| field.values(&body))?;
            field_picture::svg(&body, field, &values)
        }
        AnyBody::Space(body) => {
            let values_of = |field: Field| field.values_in_space(&body.geometry, &body.state);
            let (field, values) = wanted(args, Field::Orthogonal, values_of)?;
            space_picture::svg(&body, field, &values)
        }
    };
    Ok(write_picture(&args.output, &svg)?)
}

/// The field that is asked for, and its values at the nodes.
fn wanted(
    args: &DrawArgs,
    default: Field,
    values_of: impl Fn(Field) -> Option<Vec<f64>>,
) -> Result<(Field, Vec<f64>), CliError> {
    let field = args.field.unwrap_or(default);
    if let Some(values) = values_of(field) {
        return Ok((field, values));
    }
    let there = Field::ALL.iter().filter(|(_, field)| values_of(*field).is_some());
    let names: Vec<&str> = there.map(|(name, _)| *name).collect();
    Err(CliError::usage(
        format!("{}: it does not have this field", args.scene.scene.display()),
        format!(
            "--field {}; tissue that relaxes has no stress that a displacement tells, and results of older versions in space \
             have displacements alone",
            names.join(" or ")
        ),
    ))
}
