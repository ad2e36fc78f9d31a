//! `model-offline solve` of a scene in space: one equilibrium, with as many paddles as are named.

use super::common::{StudyProgress, check_depth, check_displacements};
use super::error::CliError;
use super::for_paraview::ForParaView;
use super::json::write_json;
use model_offline::model::ModelError;
use model_offline::model::space::{SpaceBody, SpaceModel};
use model_offline::number::{in_unit, short};
use model_offline::output;
use model_offline::output::field_picture::Field;
use model_offline::output::space_picture::{self, DrawnBody, SpaceGeometry, SpaceState};
use model_offline::output::terminal::complain;
use model_offline::output::vtu::{self, Shown, Sight};
use model_offline::parallel;
use model_offline::placement::space::workflow;
use model_offline::scene::space::SpaceScene;
use model_offline::solver::equilibrium::NewtonSettings;
use model_offline::tell;
use nalgebra::{Matrix3xX, Vector3};
use serde_json::json;
use std::path::Path;

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpaceArgs<'a> {
    /// Indices of the paddles that are attached.
    pub(super) paddles: &'a [u32],
    /// Their displacements, three numbers each; none: where they are.
    pub(super) displacements: &'a [f64],
    /// Needle depth.
    pub(super) depth: f64,
    /// Where the result goes.
    pub(super) json: Option<&'a Path>,
    /// Where the body goes for ParaView.
    pub(super) vtu: Option<&'a Path>,
    /// Where its picture goes.
    pub(super) svg: Option<&'a Path>,
    /// Threads to use.
    pub(super) threads: usize,
    /// No summary.
    pub(super) quiet: bool,
    /// Who is told how far it is.
    pub(super) progress: &'a StudyProgress,
}

/// A paddle by its place in the scene's list, and how far it is displaced.
type Displaced = (usize, Vector3<f64>);

pub(super) fn run(scene: &SpaceScene, args: SpaceArgs<'_>) -> Result<(), CliError> {
    check_depth(args.depth, scene.size())?;
    let paddles = displaced(scene, args)?;
    if !args.quiet {
        scene.notes.iter().for_each(|note| complain(&format!("note: {note}")));
    }
    let solved = parallel::within(args.threads, || solve(scene, &paddles, args));
    solved.map_err(|error| error.reported_of(args.json, &scene.name, scene.tissue()))
}

/// The paddles that are named, with their displacements.
fn displaced(scene: &SpaceScene, args: SpaceArgs<'_>) -> Result<Vec<Displaced>, CliError> {
    let numbers = args.displacements;
    if !numbers.is_empty() && numbers.len() != 3 * args.paddles.len() || !numbers.iter().all(|v| v.is_finite()) {
        return Err(CliError::usage(
            "--paddle-displacement takes three finite numbers in space, once for every --paddle",
            "e.g. --paddle 1 --paddle-displacement 0.01,0,-0.002 --paddle 4 --paddle-displacement 0,0,0",
        ));
    }
    check_displacements(numbers, scene.size())?;
    let mut found: Vec<Displaced> = Vec::new();
    for (i, index) in args.paddles.iter().enumerate() {
        let place = scene.paddle_position(*index).map_err(ModelError::from)?;
        if found.iter().any(|(other, _)| *other == place) {
            let help = "name every paddle once";
            return Err(CliError::usage(format!("--paddle {index} is given twice"), help));
        }
        found.push((place, numbers.get(3 * i..3 * i + 3).map_or_else(Vector3::zeros, Vector3::from_column_slice)));
    }
    Ok(found)
}

fn solve(scene: &SpaceScene, paddles: &[Displaced], args: SpaceArgs<'_>) -> Result<(), CliError> {
    let model = workflow::model(scene)?;
    let attached: Vec<usize> = paddles.iter().map(|(place, _)| *place).collect();
    let mut body = model.body(&attached, NewtonSettings::default()).map_err(ModelError::from)?;
    // In pieces of the scene's increment: the path matters near the limits of stability.
    let increments = (args.depth / scene.needle.depth * f64::from(scene.needle.increments)).ceil().max(1.0) as u32;
    args.progress.follow(increments);
    for increment in 1..=increments {
        let part = f64::from(increment) / f64::from(increments);
        let at: Vec<Vector3<f64>> = paddles.iter().map(|(_, displacement)| displacement * part).collect();
        if let Err(failure) = body.drive(args.depth * part, &at) {
            return Err(CliError::Solve { failure, depth: body.depth() });
        }
        args.progress.increment();
    }
    args.progress.finish();
    write(&model, &mut body, paddles, args)?;
    if !args.quiet {
        tell!("{}", text(&model, &body, paddles, args));
    }
    Ok(())
}

fn text(model: &SpaceModel, body: &SpaceBody<'_>, paddles: &[Displaced], args: SpaceArgs<'_>) -> String {
    let scene = model.scene();
    let (target, axis) = (body.target_displacement(), scene.needle.axis);
    let at = |(place, u): &Displaced| format!("paddle {} at ({}, {}, {})", scene.paddles[*place].index, u.x, u.y, u.z);
    let paddles = match paddles {
        [] => "no paddle".to_owned(),
        paddles => paddles.iter().map(at).collect::<Vec<_>>().join(", "),
    };
    let axial = target.dot(&axis);
    format!(
        "{} · {} tissue · {paddles} · depth {} · {} nodes\n\
         target displacement ({:.8}, {:.8}, {:.8}), orthogonal {:.8}, axial {axial:.8}\nbase force {}\n",
        scene.name,
        scene.tissue(),
        in_unit(args.depth, &scene.length_unit),
        model.nodes(),
        target.x,
        target.y,
        target.z,
        (target - axis * axial).norm(),
        short(body.contact_force()),
    )
}

/// Writes the files that are asked for.
fn write(
    model: &SpaceModel,
    body: &mut SpaceBody<'_>,
    paddles: &[Displaced],
    args: SpaceArgs<'_>,
) -> Result<(), CliError> {
    let scene = model.scene();
    let (target, axis) = (body.target_displacement(), scene.needle.axis);
    let axial = target.dot(&axis);
    let failed = |failure, depth| CliError::Solve { failure, depth };
    let jacobian = match paddles {
        [] => None,
        _ => Some(body.actuation_jacobian().map_err(|failure| failed(failure, args.depth))?),
    };
    let rows = |m: &Matrix3xX<f64>| m.row_iter().map(|row| row.iter().copied().collect()).collect::<Vec<Vec<f64>>>();
    let point = |p: &Vector3<f64>| <[f64; 3]>::from(*p);
    let coefficients = body.equilibrium().coefficients();
    let moved = model.nodal_displacements(coefficients);
    let (geometry, state) = (SpaceGeometry::new(model), SpaceState::new(body, args.paddles));
    let drawn = DrawnBody::new(geometry, state, scene.tissue().name(), false);
    let document = json!({
        "scene": scene.name, "dimension": 3, "tissue": scene.tissue(), "nodes": model.nodes(), "dofs": model.dofs(),
        "integration": scene.discretization.method.integration,
        "paddles": paddles.iter().map(|(place, _)| scene.paddles[*place].index).collect::<Vec<_>>(),
        "depth": args.depth,
        "paddle_displacements": paddles.iter().map(|(_, u)| point(u)).collect::<Vec<_>>(),
        "target_displacement": point(&target), "orthogonal": (target - axis * axial).norm(), "axial": axial,
        "jacobian": jacobian.as_ref().map(rows),
        "base_force": body.contact_force(),
        "strain_energy": body.equilibrium().energy(),
        "newton_iterations": body.equilibrium().effort().iterations,
        "node_positions": model.spatial().positions().iter().map(point).collect::<Vec<_>>(),
        "node_displacements": moved.iter().map(point).collect::<Vec<_>>(),
        "geometry": &drawn.geometry, "strain": &drawn.state.strain,
        "von_mises": (!drawn.state.von_mises.is_empty()).then_some(&drawn.state.von_mises),
        "units": [&scene.length_unit, &scene.stress_unit],
        "failure": null,
    });
    let _together = output::together();
    write_json(args.json, &document)?;
    draw(model, body, &drawn, args)
}

/// The pictures that are asked for.
fn draw(model: &SpaceModel, body: &SpaceBody, drawn: &DrawnBody, args: SpaceArgs<'_>) -> Result<(), CliError> {
    let DrawnBody { geometry, state, .. } = drawn;
    if let Some(file) = args.vtu {
        let text = vtu::vtu_in_space(model, body.equilibrium().coefficients());
        let scene = model.scene();
        let units = [&scene.length_unit[..], &scene.stress_unit];
        let of_points = scene.discretization.method.integration.is_nodal();
        let in_space = Some(Sight::new(geometry, args.paddles));
        let shown = Shown { scene: &scene.name, units, stress: true, of_points, in_space, ..Shown::default() };
        ForParaView::beside(file).write(&text, &vtu::parts_in_space(geometry, state), shown)?;
    }
    if let Some(file) = args.svg {
        // What paddles are to take away.
        let field = Field::Orthogonal;
        let values = field.values_in_space(geometry, state).unwrap_or_default();
        output::write_whole(file, space_picture::svg(drawn, field, &values).as_bytes())?;
    }
    Ok(())
}
