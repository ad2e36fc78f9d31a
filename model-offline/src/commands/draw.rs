//! `model-offline draw`: a scene as a picture.

use super::check::warned;
use super::common::SceneArgs;
use super::error::CliError;
use model_offline::output;
use model_offline::output::{check_outputs, scene_picture};
use std::path::PathBuf;

/// Options of `draw`.
#[derive(Debug, clap::Args)]
pub(super) struct DrawArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Where to write the picture: a .svg file.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

pub(super) fn run(args: &DrawArgs) -> Result<(), CliError> {
    let extension = args.output.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    if extension.is_some_and(|extension| extension != "svg") {
        return Err(CliError::usage(
            format!("--output {}: pictures are written as SVG", args.output.display()),
            format!(
                "-o {}; browsers, Inkscape and rsvg-convert make other formats of it",
                args.output.with_extension("svg").display()
            ),
        ));
    }
    let scene = args.scene.read_any()?;
    check_outputs(&[&args.scene.scene], &[("--output", Some(&args.output))])?;
    output::write_whole(&args.output, scene_picture::svg(&scene).as_bytes())?;
    eprint!("{}", warned(&scene.told_warnings()));
    Ok(())
}
