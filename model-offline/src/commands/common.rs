//! What commands share: the scene with the flags that override it, threads, progress.

use super::error::CliError;
use clap::Args;
use indicatif::ProgressBar;
use model_offline::discretization::{Basis, Essential, Integration, Resolution};
use model_offline::model::ModelError;
use model_offline::number::short;
use model_offline::output::{self, check_outputs, terminal};
use model_offline::parallel;
use model_offline::scene::space::{AnyScene, SpaceScene};
use model_offline::scene::{Scene, limits};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A scene file, with or without its inclusions.
#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Scene file, or the name of a bundled scene (paper, paper-hull, breast, breast-world, prostate, prostate-world,
    /// tethered; in space, for all commands but `sweep` and `compare`: block, mound, scan).
    pub(super) scene: PathBuf,
    /// Leave the inclusions out: homogeneous tissue.
    #[arg(long)]
    without_inclusion: bool,
}

impl SceneArgs {
    /// The scene, whose needle may not slip.
    pub(super) fn read(&self) -> Result<Scene, CliError> {
        let scene = self.read_still()?;
        if scene.needle.shaft.is_some() { Err(ModelError::NeedleSlips.into()) } else { Ok(scene) }
    }

    /// The scene for what knows no patient that moves and no needle that bends, which it says.
    pub(super) fn read_still(&self) -> Result<Scene, CliError> {
        let scene = self.read_any()?;
        if !scene.motion.is_none() || scene.needle.deflection != 0.0 {
            terminal::complain(
                "note: [motion] and deflection are left out here; `fit`, `compare` and `host-sim run` take them",
            );
        }
        Ok(scene)
    }

    /// The scene, where it is one in space.
    pub(super) fn read_in_space(&self) -> Result<Option<SpaceScene>, CliError> {
        match AnyScene::read(&self.scene)? {
            AnyScene::Planar(_) => Ok(None),
            AnyScene::Space(scene) if self.without_inclusion => Ok(Some(scene.without_inclusions())),
            AnyScene::Space(scene) => Ok(Some(*scene)),
        }
    }

    /// The scene's file and those that it names, over which nothing may be written.
    pub(super) fn files<'a>(&'a self, scene: &'a SpaceScene) -> Vec<&'a Path> {
        scene.files.iter().chain([&self.scene]).map(PathBuf::as_path).collect()
    }

    /// Whether the inclusions are to be left out.
    pub(super) fn leaves_out_inclusions(&self) -> bool {
        self.without_inclusion
    }

    /// The scene as its file has it.
    pub(super) fn read_any(&self) -> Result<Scene, CliError> {
        let scene = Scene::read(&self.scene)?;
        Ok(if self.without_inclusion { scene.without_inclusions() } else { scene })
    }
}

/// Flags that override `[discretization]`.
#[derive(Debug, Args)]
pub(super) struct DiscretizationArgs {
    /// Node spacing, length units.
    #[arg(long, value_name = "H", conflicts_with = "tolerance")]
    spacing: Option<f64>,
    /// Relative error of the controllability measures to refine down to.
    #[arg(long, value_name = "T")]
    tolerance: Option<f64>,
    /// Kernel support over local spacing.
    #[arg(long)]
    support: Option<f64>,
    /// Integration rule.
    #[arg(long)]
    integration: Option<Integration>,
    /// Basis of the shape functions.
    #[arg(long)]
    basis: Option<Basis>,
    /// How essential boundary conditions are imposed.
    #[arg(long)]
    essential: Option<Essential>,
}

/// The same for studies that vary the rest themselves.
#[derive(Debug, Args)]
pub(super) struct VariedArgs {
    /// Node spacing to vary around, length units.
    #[arg(long, value_name = "H")]
    spacing: Option<f64>,
    /// How essential boundary conditions are imposed.
    #[arg(long)]
    essential: Option<Essential>,
}

impl VariedArgs {
    /// Refuses what is varied on planar nodes alone.
    pub(super) fn none_in_space(&self) -> Result<(), CliError> {
        let given = [("--spacing", self.spacing.is_some()), ("--essential", self.essential.is_some())];
        match given.into_iter().find(|(_, given)| *given) {
            Some((option, _)) => Err(CliError::usage(
                format!("{option} is for scenes in the plane"),
                "in space spacings are shares of the body's size, and essential values are always held node by node",
            )),
            None => Ok(()),
        }
    }

    /// The scene in space with the flags in it, checked.
    pub(super) fn over_space(&self, mut scene: SpaceScene) -> Result<SpaceScene, CliError> {
        check_essential_in_space(self.essential)?;
        let spec = &mut scene.discretization;
        spec.resolution = self.spacing.map_or(spec.resolution, Resolution::Spacing);
        scene.check_discretization()?;
        Ok(scene)
    }

    /// The scene with the flags in it, checked.
    pub(super) fn over(&self, mut scene: Scene) -> Result<Scene, CliError> {
        let spec = &mut scene.discretization;
        spec.resolution = self.spacing.map_or(spec.resolution, Resolution::Spacing);
        spec.essential = self.essential.unwrap_or(spec.essential);
        limits::check(&scene.discretization, &scene.outline)?;
        Ok(scene)
    }
}

fn check_essential_in_space(essential: Option<Essential>) -> Result<(), CliError> {
    match essential {
        Some(Essential::Nitsche) => {
            Err(CliError::usage("--essential: Nitsche's method is planar", "leave --essential out"))
        }
        Some(Essential::Transformation) | None => Ok(()),
    }
}

/// Makes the folder of a study; where its files of these names go in it, none of which is one of the inputs.
pub(super) fn study_files<const N: usize>(
    inputs: &[&Path],
    folder: &Path,
    names: [&str; N],
) -> Result<[PathBuf; N], CliError> {
    if folder.exists() && !folder.is_dir() {
        return Err(CliError::usage(
            format!("--out {}: a file is in its place", folder.display()),
            "name a folder; it is made when it is not there",
        ));
    }
    output::make_folder(folder)?;
    let files = names.map(|name| folder.join(name));
    let outputs: Vec<_> = files.iter().map(|file| ("--out", Some(file.as_path()))).collect();
    check_outputs(inputs, &outputs)?;
    Ok(files)
}

/// How to run.
#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Threads to use (default: all).
    #[arg(long)]
    threads: Option<usize>,
    /// No progress and no summary.
    #[arg(long)]
    pub(super) quiet: bool,
}

impl DiscretizationArgs {
    /// The scene with the flags in it, checked.
    pub(super) fn over(&self, mut scene: Scene) -> Result<Scene, CliError> {
        let spec = &mut scene.discretization;
        if let Some(h) = self.spacing {
            spec.resolution = Resolution::Spacing(h);
        }
        if let Some(t) = self.tolerance {
            spec.resolution = Resolution::Tolerance(t);
        }
        if let Some(integration) = self.integration.filter(|i| *i != spec.method.integration) {
            // The scene's support belongs to the scene's rule.
            spec.method.integration = integration;
            spec.method.support = integration.default_support();
        }
        spec.method.support = self.support.unwrap_or(spec.method.support);
        spec.method.basis = self.basis.unwrap_or(spec.method.basis);
        spec.essential = self.essential.unwrap_or(spec.essential);
        limits::check(&scene.discretization, &scene.outline)?;
        Ok(scene)
    }
}

impl DiscretizationArgs {
    /// The scene in space with the flags in it, checked.
    pub(super) fn over_space(&self, mut scene: SpaceScene) -> Result<SpaceScene, CliError> {
        check_essential_in_space(self.essential)?;
        let spec = &mut scene.discretization;
        spec.resolution = match (self.spacing, self.tolerance) {
            (Some(spacing), _) => Resolution::Spacing(spacing),
            (_, Some(tolerance)) => Resolution::Tolerance(tolerance),
            _ => spec.resolution,
        };
        if let Some(integration) = self.integration.filter(|i| *i != spec.method.integration) {
            spec.method.integration = integration;
            spec.method.support = integration.default_support_in_space();
        }
        spec.method.support = self.support.unwrap_or(spec.method.support);
        spec.method.basis = self.basis.unwrap_or(spec.method.basis);
        scene.names_method |= self.integration.is_some() || self.support.is_some() || self.basis.is_some();
        scene.check_discretization()?;
        Ok(scene)
    }
}

impl RunArgs {
    pub(super) fn threads(&self) -> usize {
        parallel::threads(self.threads)
    }

    pub(super) fn progress(&self, steps: u64) -> ProgressBar {
        if self.quiet { ProgressBar::hidden() } else { terminal::progress(steps) }
    }
}

/// Progress of a study: what comes before and after the steps that are counted is told in words.
#[derive(Debug)]
pub(super) struct StudyProgress(ProgressBar);

impl StudyProgress {
    /// Of a scene at this resolution, before anything is solved.
    pub(super) fn new(run: &RunArgs, resolution: Resolution) -> Self {
        let bar = run.progress(1);
        bar.set_message(match resolution {
            Resolution::Tolerance(_) => "finding the nodes that the tolerance asks for",
            Resolution::Spacing(_) | Resolution::Level(_) => "solving the body at rest",
        });
        Self(bar)
    }

    /// So many steps come.
    pub(super) fn begin(&self, steps: u64) {
        self.0.set_length(steps);
    }

    /// One of them is done.
    pub(super) fn step(&self) {
        self.0.inc(1);
        let is_last = self.0.length().is_some_and(|steps| self.0.position() >= steps);
        self.0.set_message(if is_last { "estimating errors" } else { "following the insertion" });
    }

    /// One insertion in so many increments comes, or in who knows how many.
    pub(super) fn follow(&self, increments: u32) {
        self.0.set_length(u64::from(increments));
        self.0.set_message("following the insertion");
    }

    /// An increment of it is done.
    pub(super) fn increment(&self) {
        self.0.inc(1);
    }

    /// Nothing of it is left on a terminal.
    pub(super) fn finish(&self) {
        self.0.finish_and_clear();
    }
}

/// Warnings, a line each.
pub(super) fn warned(warnings: &[String]) -> String {
    warnings.iter().fold(String::new(), |mut out, warning| {
        let _ = writeln!(out, "warning: {warning}");
        out
    })
}

/// A paddle's index, with spaces around it as lists of them have.
pub(super) fn paddle_index(text: &str) -> Result<u32, std::num::ParseIntError> {
    text.trim().parse()
}

/// Paddles farther from rest than this many sizes of the body are none.
const FARTHEST: f64 = 10.0;

/// A depth in the body of this size, as a scene's own has to be.
pub(super) fn check_depth(depth: f64, size: f64) -> Result<(), CliError> {
    if depth <= size {
        return Ok(());
    }
    let message = format!("--depth is {depth}, larger than the whole body ({})", short(size));
    Err(CliError::usage(message, "check the units of the depth"))
}

/// Refuses displacements of paddles, length units, that no body of this size can be meant to bear.
///
/// # Errors
/// [`CliError::usage`] with the largest of them that is accepted.
pub(super) fn check_displacements(displacements: &[f64], size: f64) -> Result<(), CliError> {
    match displacements.iter().find(|d| d.abs() > FARTHEST * size) {
        None => Ok(()),
        Some(far) => Err(CliError::usage(
            format!("--paddle-displacement has {}, and the body is {} across", short(*far), short(size)),
            format!("give length units of the scene, at most {} here", short(FARTHEST * size)),
        )),
    }
}
