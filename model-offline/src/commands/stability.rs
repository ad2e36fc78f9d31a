//! `model-offline stability`: where each method stops working.

use super::common::{RunArgs, VariedArgs, study_files};
use super::error::CliError;
use model_offline::discretization::{Basis, Discretization, Method, Resolution};
use model_offline::model::ModelError;
use model_offline::output;
use model_offline::placement::model_with_paddle;
use model_offline::placement::space::workflow::best_single;
use model_offline::scene::space::{AnyScene, SpaceScene};
use model_offline::study::Extent;
use model_offline::study::stability::setting::Setting;
use model_offline::study::stability::{self, Plan, Stability};
use model_offline::tell;
use std::path::PathBuf;

/// A spacing to begin with, over the size of the body.
const USUAL: f64 = 0.07;

/// Options of `stability`.
#[derive(Debug, clap::Args)]
pub(super) struct StabilityArgs {
    /// Scene file, or the name of a bundled scene (paper, paper-hull, breast, prostate, tethered; in space block, mound, scan).
    scene: PathBuf,
    /// Folder for stability.csv, stability.svg and, in the plane, zero_energy.csv; made when it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Fewer values and one spacing for the sweeps.
    #[arg(long)]
    quick: bool,
    /// Index of the paddle attached, static (default: the best dynamic paddle).
    #[arg(long, value_name = "K")]
    paddle: Option<u32>,
    /// Kernel support over local spacing, where it is not what is varied.
    #[arg(long)]
    support: Option<f64>,
    /// Basis of the shape functions.
    #[arg(long)]
    basis: Option<Basis>,
    #[command(flatten)]
    varied: VariedArgs,
    #[command(flatten)]
    run: RunArgs,
}

impl StabilityArgs {
    /// Puts support and basis into a scene's method, where they are given.
    fn over(&self, method: &mut Method) {
        method.support = self.support.unwrap_or(method.support);
        method.basis = self.basis.unwrap_or(method.basis);
    }
}

pub(super) fn run(args: &StabilityArgs) -> Result<(), CliError> {
    let mut scene = match AnyScene::read(&args.scene)? {
        AnyScene::Planar(scene) => *scene,
        AnyScene::Space(scene) => return run_in_space(args, *scene),
    };
    args.over(&mut scene.discretization.method);
    let scene = &args.varied.over(scene)?;
    check_spacing(&scene.discretization, scene.outline.size())?;
    let paddle = match args.paddle {
        Some(index) => scene.paddle_position(index).map(|_| index).map_err(ModelError::from)?,
        None => model_with_paddle(&scene.without_inclusions(), None)?.1,
    };
    studied(args, scene.into(), |plan, progress| plan.run(scene, paddle, args.run.threads(), progress))
}

/// `size` is that of the body, length units.
fn check_spacing(discretization: &Discretization, size: f64) -> Result<(), CliError> {
    match discretization.resolution {
        Resolution::Spacing(_) => Ok(()),
        Resolution::Tolerance(_) | Resolution::Level(_) => Err(CliError::usage(
            "the study varies a spacing, and this scene has none",
            format!("give the spacing to vary around, e.g. --spacing {}", rounded(USUAL * size)),
        )),
    }
}

/// With one digit.
fn rounded(value: f64) -> f64 {
    format!("{value:.0e}").parse().unwrap_or(value)
}

/// The same of a body in space. The paddle is the best by the scene's rule at the spacing.
fn run_in_space(args: &StabilityArgs, mut scene: SpaceScene) -> Result<(), CliError> {
    args.over(&mut scene.discretization.method);
    let scene = &args.varied.over_space(scene)?;
    check_spacing(&scene.discretization, scene.size())?;
    let paddle = match args.paddle {
        Some(index) => scene.paddle_position(index).map(|_| index).map_err(ModelError::from)?,
        None => best_single(&scene.without_inclusions())?,
    };
    let setting = Setting::in_space(scene, args.support);
    studied(args, setting, |plan, progress| plan.run_in_space(scene, paddle, args.run.threads(), progress))
}

/// Runs a plan behind a progress bar and writes what comes of it.
fn studied(
    args: &StabilityArgs,
    setting: Setting,
    run: impl FnOnce(&Plan, &(dyn Fn() + Sync)) -> Result<Stability, ModelError>,
) -> Result<(), CliError> {
    let [csv, svg, zero_energy] =
        study_files(&[&args.scene], &args.out, ["stability.csv", "stability.svg", "zero_energy.csv"])?;
    let plan = Plan::new(setting, Extent::of_flag(args.quick));
    let bar = args.run.progress(plan.runs() as u64);
    let result = run(&plan, &|| bar.inc(1))?;
    bar.finish_and_clear();
    let together = output::together();
    output::write_whole(&csv, &stability::csv(&result))?;
    if !result.zero_energy.is_empty() {
        output::write_whole(&zero_energy, &stability::zero_energy_csv(&result))?;
    }
    output::write_whole(&svg, stability::figure(&result).svg().as_bytes())?;
    drop(together);
    if !args.run.quiet {
        tell!("{}", stability::summary(&result));
    }
    Ok(())
}
