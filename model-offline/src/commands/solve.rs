//! `model-offline solve`: one equilibrium.

use super::common::{DiscretizationArgs, RunArgs, SceneArgs};
use super::error::CliError;
use super::json::write_json;
use model_offline::model::{Body, ModelError, TissueModel};
use model_offline::output;
use model_offline::output::check_outputs;
use model_offline::placement::{controllability, discretise};
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector2;
use std::path::PathBuf;

/// Options of `solve`.
#[derive(Debug, clap::Args)]
pub(super) struct SolveArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Index of the paddle that is attached.
    #[arg(long)]
    paddle: u32,
    /// Needle depth, length units.
    #[arg(long)]
    depth: f64,
    /// Paddle displacement, length units.
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    paddle_displacement: Option<Vec<f64>>,
    /// Write the result as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write displacement, strain, stress and det F for ParaView.
    #[arg(long, value_name = "FILE")]
    vtu: Option<PathBuf>,
    /// Draw the deformed body.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    discretization: DiscretizationArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &SolveArgs) -> Result<(), CliError> {
    let scene = args.discretization.over(args.scene.read()?)?;
    let displacement = match args.paddle_displacement.as_deref() {
        None => Vector2::zeros(),
        Some([x, y]) if x.is_finite() && y.is_finite() => Vector2::new(*x, *y),
        Some(_) => {
            return Err(CliError::usage(
                "--paddle-displacement takes two finite numbers",
                "e.g. --paddle-displacement 0.01,-0.002",
            ));
        }
    };
    if !args.depth.is_finite() || args.depth < 0.0 {
        return Err(CliError::usage(format!("--depth is {}", args.depth), "give a depth of 0 or more"));
    }
    let outputs = [("--json", args.json.as_deref()), ("--vtu", args.vtu.as_deref()), ("--svg", args.svg.as_deref())];
    check_outputs(&[&args.scene.scene], &outputs)?;
    solve(&scene, displacement, args).map_err(|error| error.reported(args.json.as_deref(), &scene))
}

fn solve(scene: &Scene, displacement: Vector2<f64>, args: &SolveArgs) -> Result<(), CliError> {
    let (model, _) = discretise(scene)?;
    let position = scene.paddle_position(args.paddle).map_err(ModelError::from)?;
    let mut body = model.body(Some(position), NewtonSettings::default()).map_err(ModelError::from)?;
    // In pieces of the scene's increment: the path matters near the limits of stability.
    let pieces = (args.depth / scene.needle.depth * f64::from(scene.needle.increments)).ceil().max(1.0);
    for piece in 1..=pieces as u32 {
        let share = f64::from(piece) / pieces;
        if let Err(failure) = body.drive(args.depth * share, displacement * share) {
            return Err(CliError::Solve { failure, depth: body.depth() });
        }
    }
    write(&model, &mut body, displacement, args)?;
    if !args.run.quiet {
        let target = body.target_displacement();
        println!(
            "{} · {} tissue · paddle {} at ({}, {}) · depth {}\ntarget displacement ({:.8}, {:.8}), orthogonal {:.8}",
            scene.name,
            scene.tissue(),
            args.paddle,
            displacement.x,
            displacement.y,
            args.depth,
            target.x,
            target.y,
            target.dot(&scene.needle.orthogonal())
        );
    }
    Ok(())
}

/// Writes the files that are asked for.
fn write(
    model: &TissueModel,
    body: &mut Body<'_>,
    displacement: Vector2<f64>,
    args: &SolveArgs,
) -> Result<(), CliError> {
    let scene = model.scene();
    let target = body.target_displacement();
    let jacobian = body.actuation_jacobian().map_err(|failure| CliError::Solve { failure, depth: body.depth() })?;
    let nodal = model.nodal_displacements(body.equilibrium().coefficients()).map_err(ModelError::from)?;
    let point = |p: &Vector2<f64>| [p.x, p.y];
    let document = serde_json::json!({
        "scene": scene.name, "tissue": scene.tissue(), "nodes": model.nodes(), "dofs": model.dofs(),
        "integration": scene.discretization.method.integration,
        "paddle": args.paddle, "depth": args.depth, "paddle_displacement": point(&displacement),
        "target_displacement": point(&target), "orthogonal": target.dot(&scene.needle.orthogonal()),
        "jacobian": controllability::rows(&jacobian),
        "strain_energy": body.equilibrium().energy(),
        "newton_iterations": body.equilibrium().effort().iterations,
        "node_positions": model.positions().iter().map(point).collect::<Vec<_>>(),
        "node_displacements": nodal.iter().map(point).collect::<Vec<_>>(),
        "failure": null,
    });
    write_json(args.json.as_deref(), &document)?;
    if let Some(path) = &args.vtu {
        output::write_whole(path, output::vtu::vtu(model, body).as_bytes())?;
    }
    if let Some(path) = &args.svg {
        output::write_whole(path, output::body::svg(model, body).as_bytes())?;
    }
    Ok(())
}
