//! `model-offline new`: a scene to start from.

use super::error::CliError;
use model_offline::output;
use model_offline::scene::Scene;
use model_offline::scene::import::{Imported, gmsh, svg};
use model_offline::scene::starter::{StarterNames, starter};
use std::path::{Path, PathBuf};

/// Options of `new`.
#[derive(Debug, clap::Args)]
pub(super) struct NewArgs {
    /// Where to write the scene [default: standard output].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Take the outline from the paths of an SVG drawing: the largest is the body, others inside are inclusions.
    #[arg(long, value_name = "FILE", conflicts_with = "msh")]
    svg: Option<PathBuf>,
    /// Take the outline from a Gmsh mesh (ASCII, version 2.2 or 4.1): its boundary is the body.
    #[arg(long, value_name = "FILE")]
    msh: Option<PathBuf>,
    /// Length of the body's longer side, in the scene's unit [default: as in the file].
    #[arg(long, value_name = "LENGTH")]
    size: Option<f64>,
    /// Name of the scene [default: that of the file it comes from].
    #[arg(long)]
    name: Option<String>,
    /// Label of the length unit.
    #[arg(long, default_value = "mm", value_name = "UNIT")]
    length: String,
    /// Label of the stress unit.
    #[arg(long, default_value = "kPa", value_name = "UNIT")]
    stress: String,
    /// Replace a file that is there already.
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &NewArgs) -> Result<(), CliError> {
    let usage = |message: String, help: &str| CliError::usage(message, help);
    if let Some(size) = args.size {
        if !(size.is_finite() && size > 0.0) {
            return Err(usage(format!("--size is {size}"), "give the length of the body's longer side, above 0"));
        }
        if args.svg.is_none() && args.msh.is_none() {
            return Err(usage("--size belongs to --svg or --msh".into(), "the starter block has its own size"));
        }
    }
    let imported = match (&args.svg, &args.msh) {
        (Some(file), _) => Some(import(file, |text| svg::read(text, args.size))?),
        (None, Some(file)) => Some(import(file, |text| gmsh::read(text, args.size))?),
        (None, None) => None,
    };
    let stem = |path: &PathBuf| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let source = args.output.as_ref().or(args.svg.as_ref()).or(args.msh.as_ref());
    let name = args.name.clone().or_else(|| source.and_then(stem)).unwrap_or_else(|| "my-scene".to_owned());
    let names = StarterNames { name, length: args.length.clone(), stress: args.stress.clone() };
    let text = starter(&names, imported.as_ref());
    // A suggestion that validation refuses would only be found out by the next command.
    Scene::parse(&text, "<new scene>")?;
    match &args.output {
        None => print!("{text}"),
        Some(path) if path.exists() && !args.force => {
            return Err(usage(format!("{} is there already", path.display()), "name another file, or add --force"));
        }
        Some(path) => {
            let inputs: Vec<&Path> = args.svg.iter().chain(&args.msh).map(PathBuf::as_path).collect();
            output::check_outputs(&inputs, &[("--output", Some(path))])?;
            output::write_whole(path, text.as_bytes())?;
            println!("{}\nnext: model-offline place {0}", path.display());
        }
    }
    Ok(())
}

fn import(
    file: &Path,
    read: impl Fn(&str) -> Result<Imported, model_offline::scene::import::ImportError>,
) -> Result<Imported, CliError> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| CliError::usage(format!("cannot read {}: {error}", file.display()), "give a text file"))?;
    read(&text).map_err(|error| {
        let help = "an outline is a closed path of an SVG drawing, or the boundary of a planar ASCII Gmsh mesh";
        CliError::usage(format!("{}: {error}", file.display()), help)
    })
}
