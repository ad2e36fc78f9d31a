//! `model-offline new`: a scene to start from.

mod interactive;

use super::error::CliError;
use model_offline::output;
use model_offline::output::terminal::complain;
use model_offline::reading;
use model_offline::scene::import::{ImportError, ImportOptions, Imported, gmsh, svg};
use model_offline::scene::space::{self, AnyScene};
use model_offline::scene::starter::{self, StarterNames, starter};
use model_offline::{say, tell};
use std::borrow::Cow;
use std::io::{self, IsTerminal as _};
use std::path::{Path, PathBuf};

/// Options of `new`.
#[derive(Debug, clap::Args)]
pub(super) struct NewArgs {
    /// Where to write the scene [default: standard output].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Take body, inclusions, needle, target, paddles and what is fixed from the shapes of an SVG drawing, by their
    /// names. Without names the largest closed shape is the body, others inside are inclusions.
    #[arg(long, value_name = "FILE", conflicts_with = "msh")]
    svg: Option<PathBuf>,
    /// Take the same from a Gmsh mesh (version 2.2 or 4.1, ASCII or binary), by its physical groups: its boundary is
    /// the body.
    #[arg(long, value_name = "FILE")]
    msh: Option<PathBuf>,
    /// Dimension of the scene: 2 for plane strain, 3 for space.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=3))]
    dimension: u8,
    /// Ask on the terminal for the few numbers that matter: size, material, target, depth.
    #[arg(long, conflicts_with_all = ["svg", "msh"])]
    interactive: bool,
    /// Length of the body's longer side, in the scene's unit [default: as in the file; drawings with a width in mm,
    /// cm, in, pt, pc, Q or px are to scale].
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
    let planar = [(args.svg.is_some(), "--svg"), (args.msh.is_some(), "--msh"), (args.interactive, "--interactive")];
    if let Some((_, option)) = planar.into_iter().find(|(given, _)| *given && args.dimension == 3) {
        let help = "leave it out, and name the body's file in the scene: [domain] surface = \"body.stl\"";
        return Err(usage(format!("{option} gives scenes in the plane, and --dimension is 3"), help));
    }
    // Before anybody is asked anything.
    if let Some(path) = &args.output {
        if path.exists() && !output::is_stream(path) && !args.force {
            return Err(usage(format!("{} is there already", path.display()), "name another file, or add --force"));
        }
        let inputs: Vec<&Path> = args.svg.iter().chain(&args.msh).map(PathBuf::as_path).collect();
        output::check_outputs(&inputs, &[("--output", Some(path))])?;
    }
    let stem = |path: &PathBuf| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let file = args.output.as_ref().filter(|path| !output::is_stream(path));
    let source = file.or(args.svg.as_ref()).or(args.msh.as_ref());
    let name = args.name.clone().or_else(|| source.and_then(stem)).unwrap_or_else(|| "my-scene".to_owned());
    let names = StarterNames { name, length: args.length.clone(), stress: args.stress.clone() };
    let (text, summary) = match args.svg.as_ref().or(args.msh.as_ref()) {
        Some(file) => import(file, args, &names)?,
        None if args.dimension == 3 => (space::starter::starter(&names), String::new()),
        None if args.interactive => (asked_for(&names)?, String::new()),
        None => (starter(&names, None), String::new()),
    };
    // A suggestion that validation refuses would only be found out by the next command.
    AnyScene::parse(&text, "<new scene>")?;
    let Some(file) = file else {
        match &args.output {
            None => tell!("{text}"),
            Some(stream) => output::write_whole(stream, text.as_bytes())?,
        }
        if !summary.is_empty() {
            complain(summary.trim_end());
        }
        return Ok(());
    };
    output::write_whole(file, text.as_bytes())?;
    say!("{summary}{}\nnext: model-offline check {0}, draw it, then model-offline place {0}", file.display());
    Ok(())
}

/// The scene of somebody's answers.
fn asked_for(names: &StarterNames) -> Result<String, CliError> {
    let stdin = io::stdin();
    if !stdin.is_terminal() {
        let help = "without one, `model-offline new` gives a scene that is good as it is, to be edited";
        return Err(CliError::usage("--interactive asks on a terminal, and there is none", help));
    }
    // What is written may go to standard output: questions do not.
    let imported = interactive::ask(stdin.lock(), io::stderr(), names)
        .map_err(|error| CliError::usage(error.to_string(), "nothing was written; begin again"))?;
    Ok(starter(names, Some(&imported)))
}

/// The text of a drawing: UTF-8, or UTF-16 with its mark.
fn text_of(bytes: &[u8]) -> Result<Cow<'_, str>, ImportError> {
    let wrong = |line| {
        let what = "this is no text: give an SVG file that is not compressed".to_owned();
        ImportError::Syntax { line, what }
    };
    let wide = |of: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| of([pair[0], pair[1]])).collect();
        String::from_utf16(&units).map(Cow::Owned).map_err(|_| wrong(1))
    };
    match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] if bytes.len() % 2 == 1 => Err(wrong(1)),
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => std::str::from_utf8(bytes)
            .map(Cow::Borrowed)
            .map_err(|error| wrong(1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count())),
    }
}

/// The scene of a file, and what became of everything in it.
fn import(file: &Path, args: &NewArgs, names: &StarterNames) -> Result<(String, String), CliError> {
    let bytes = reading::read(file, reading::DATA).map_err(|error| {
        CliError::usage(format!("cannot read {}: {error}", file.display()), "give a drawing or a mesh")
    })?;
    let options = ImportOptions { size: args.size, length: &names.length, stress: &names.stress };
    let read = || -> Result<(String, Imported), ImportError> {
        let mut imported =
            if args.svg.is_some() { svg::read(&text_of(&bytes)?, &options)? } else { gmsh::read(&bytes, &options)? };
        Ok((starter::imported(names, &mut imported)?, imported))
    };
    match read() {
        Ok((text, imported)) => Ok((text, imported.summary.to_string())),
        Err(error) => {
            let help = match &error {
                ImportError::NoScene { help, .. } => help.clone(),
                _ => "a body is a closed shape of an SVG drawing, or the boundary of a planar Gmsh mesh".to_owned(),
            };
            Err(CliError::usage(format!("{}: {error}", file.display()), help))
        }
    }
}
