//! `model-offline stability`: where each method stops working.

use super::common::{RunArgs, VariedArgs};
use super::error::CliError;
use model_offline::discretization::{Basis, Resolution};
use model_offline::model::ModelError;
use model_offline::output;
use model_offline::placement::model_with_paddle;
use model_offline::scene::Scene;
use model_offline::study::Extent;
use model_offline::study::stability;
use std::path::PathBuf;

/// Options of `stability`.
#[derive(Debug, clap::Args)]
pub(super) struct StabilityArgs {
    /// Scene file, or the name of a bundled scene.
    scene: PathBuf,
    /// Folder for stability.csv, stability.svg and zero_energy.csv; made when it is not there.
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

pub(super) fn run(args: &StabilityArgs) -> Result<(), CliError> {
    let mut scene = Scene::read(&args.scene)?;
    let method = &mut scene.discretization.method;
    method.support = args.support.unwrap_or(method.support);
    method.basis = args.basis.unwrap_or(method.basis);
    let scene = &args.varied.over(scene)?;
    let Resolution::Spacing(_) = scene.discretization.resolution else {
        return Err(CliError::usage(
            "the study varies a spacing, and this scene has a tolerance",
            "give the spacing to vary around, e.g. --spacing 0.1",
        ));
    };
    let paddle = match args.paddle {
        Some(index) => scene.paddle_position(index).map(|_| index).map_err(ModelError::from)?,
        None => model_with_paddle(&scene.without_inclusions(), None)?.1,
    };
    output::make_folder(&args.out)?;
    let plan = stability::Plan::new(scene, Extent::of_flag(args.quick));
    let bar = args.run.progress(plan.runs() as u64);
    let result = plan.run(scene, paddle, args.run.threads(), &|| bar.inc(1))?;
    bar.finish_and_clear();
    output::write_whole(&args.out.join("stability.csv"), &stability::csv(&result))?;
    output::write_whole(&args.out.join("zero_energy.csv"), &stability::zero_energy_csv(&result))?;
    output::write_whole(&args.out.join("stability.svg"), stability::figure(&result).svg().as_bytes())?;
    if !args.run.quiet {
        print!("{}", stability::summary(&result));
    }
    Ok(())
}
