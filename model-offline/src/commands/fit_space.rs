//! `model-offline fit` of a scene in space: which dimension, and how many paddles.

use super::common::SceneArgs;
use super::error::CliError;
use super::json::write_json;
use model_offline::output::terminal::complain;
use model_offline::output::{self, check_outputs, terminal};
use model_offline::parallel;
use model_offline::scene::space::SpaceScene;
use model_offline::scene::{Scene, limits};
use model_offline::study::fit::space::{SpaceFit, fit_in_space};
use model_offline::tell;
use std::path::Path;
use std::sync::OnceLock;

/// What `fit` is asked for.
#[derive(Debug)]
pub(super) struct Asked<'a> {
    pub(super) scene: &'a SceneArgs,
    pub(super) tolerance: f64,
    pub(super) output: Option<&'a Path>,
    pub(super) json: Option<&'a Path>,
    pub(super) svg: Option<&'a Path>,
    pub(super) write_slice: Option<&'a Path>,
    pub(super) threads: Option<usize>,
    pub(super) quiet: bool,
}

pub(super) fn run(scene: &SpaceScene, args: &Asked<'_>) -> Result<(), CliError> {
    limits::check_tolerance(args.tolerance)?;
    let outputs =
        [("--output", args.output), ("--json", args.json), ("--svg", args.svg), ("--write-slice", args.write_slice)];
    check_outputs(&args.scene.files(scene), &outputs)?;
    stays_in_folder(scene, args)?;
    if !args.quiet {
        scene.notes.iter().for_each(|note| complain(&format!("note: {note}")));
    }
    let text = Scene::text(&args.scene.scene)?;
    let fit = fitted(scene, &text, args).map_err(|error| error.reported_of(args.json, &scene.name, scene.tissue()))?;
    let together = output::together();
    if let Some(file) = args.output {
        let text = fit
            .written(scene, &text)
            .map_err(|error| CliError::usage(error.to_string(), "the scene changed meanwhile"))?;
        output::write_whole(file, text.as_bytes())?;
    }
    if let Some(file) = args.write_slice {
        match &fit.slice_text {
            Some(text) => output::write_whole(file, text.as_bytes())?,
            None => {
                let why = fit.slice_failure.as_deref().unwrap_or("there is no slice");
                complain(&format!("note: --write-slice: {why}"));
            }
        }
    }
    if let Some(file) = args.svg {
        output::write_whole(file, fit.svg().as_bytes())?;
    }
    write_json(args.json, &fit)?;
    drop(together);
    if !args.quiet {
        tell!("{}", fit.summary());
    }
    Ok(())
}

fn fitted(scene: &SpaceScene, text: &str, args: &Asked<'_>) -> Result<SpaceFit, CliError> {
    let bar = OnceLock::new();
    let begin = |steps: u64| {
        bar.get_or_init(|| if args.quiet { indicatif::ProgressBar::hidden() } else { terminal::progress(steps) });
    };
    let progress = || bar.get().into_iter().for_each(|bar: &indicatif::ProgressBar| bar.inc(1));
    let fit = fit_in_space(scene, text, args.tolerance, parallel::threads(args.threads), (&begin, &progress))?;
    bar.get().into_iter().for_each(|bar| bar.finish_and_clear());
    Ok(fit)
}

/// A scene that names files is written beside them: their paths are relative to its folder.
fn stays_in_folder(scene: &SpaceScene, args: &Asked<'_>) -> Result<(), CliError> {
    let folder = |path: &Path| path.parent().map(|folder| folder.canonicalize().unwrap_or_else(|_| folder.to_owned()));
    match args.output {
        Some(file) if !scene.files.is_empty() && folder(file) != folder(&args.scene.scene) => Err(CliError::usage(
            format!("--output {}: the scene names files relative to its own folder", file.display()),
            "write it into the folder of the scene",
        )),
        _ => Ok(()),
    }
}
