//! `model-offline slice`: the planar scene that a plane through needle and target cuts of a scene in space.

use super::common::SceneArgs;
use super::error::CliError;
use super::json::write_json;
use model_offline::number::in_unit;
use model_offline::output;
use model_offline::output::check_outputs;
use model_offline::scene::Scene;
use model_offline::scene::space::SpaceScene;
use model_offline::study::slice::{Slice, Through};
use model_offline::tell;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Options of `slice`.
#[derive(Debug, clap::Args)]
pub(super) struct SliceArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Lay the plane through this paddle (default: the one whose plane meets the most).
    #[arg(long, value_name = "INDEX")]
    paddle: Option<u32>,
    /// Where to write the planar scene.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Write where the plane lies and what it leaves out as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// No summary.
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(args: &SliceArgs) -> Result<(), CliError> {
    let scene = args.scene.read_in_space()?.ok_or_else(|| {
        CliError::usage("this scene is planar: it is its own slice", "give a scene with dimension = 3")
    })?;
    check_outputs(&args.scene.files(&scene), &[("--output", Some(&args.output)), ("--json", args.json.as_deref())])?;
    let slice = slice_of(&scene, args)?;
    let together = output::together();
    output::write_whole(&args.output, slice.text.as_bytes())?;
    write_json(args.json.as_deref(), &document(&slice))?;
    drop(together);
    if !args.quiet {
        tell!("{}", summary(&slice));
    }
    Ok(())
}

fn slice_of(scene: &SpaceScene, args: &SliceArgs) -> Result<Slice, CliError> {
    let text = Scene::text(&args.scene.scene)?;
    let slice = Slice::of(scene, &text, args.paddle).map_err(CliError::from);
    slice.map_err(|error| error.reported_of(args.json.as_deref(), &scene.name, scene.tissue()))
}

/// Where a slice lies and what it leaves out.
pub(super) fn document(slice: &Slice) -> Value {
    let plane = &slice.plane;
    json!({
        "through": slice.through,
        "normal": <[f64; 3]>::from(plane.normal),
        "offset": plane.offset,
        "right": <[f64; 3]>::from(plane.directions[0]),
        "up": <[f64; 3]>::from(plane.directions[1]),
        "paddles": slice.scene.paddles.iter().map(|paddle| paddle.index).collect::<Vec<_>>(),
        "left_out": slice.left_out,
        "pieces_left_out": slice.pieces_left_out,
        "inclusions_left_out": slice.inclusions_left_out,
    })
}

/// The same for people.
pub(super) fn summary(slice: &Slice) -> String {
    let (scene, plane) = (&slice.scene, &slice.plane);
    let why = match slice.through {
        Through::Paddle(paddle) => format!("free to turn about the needle's line: laid through paddle {paddle}"),
        Through::NeedleBesideTarget => "given by the needle's line and the target beside it".to_owned(),
    };
    let mut out = format!("slice: {} ({why})\n", plane.name(&scene.length_unit));
    let paddle = |p: &model_offline::scene::PaddlePosition| {
        format!("{} ({} long)", p.index, in_unit((p.segment[1] - p.segment[0]).norm(), &scene.length_unit))
    };
    let paddles: Vec<String> = scene.paddles.iter().map(paddle).collect();
    let _ = writeln!(out, "paddles in it: {}", paddles.join(", "));
    for left in &slice.left_out {
        let _ = writeln!(out, "paddle {} is left out: {}", left.index, left.reason);
    }
    for number in &slice.inclusions_left_out {
        let _ = writeln!(out, "inclusion {number} is left out: the plane does not meet it");
    }
    if slice.pieces_left_out > 0 {
        let _ = writeln!(out, "{} other pieces of the body are left out", slice.pieces_left_out);
    }
    out
}
