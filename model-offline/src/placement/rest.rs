//! Actuation Jacobians at rest for all paddles at once: one assembly and one symbolic analysis serve them all, since
//! they differ only in which nodal values are constrained.

use super::controllability::best_direction;
use crate::linalg::Pattern;
use crate::mechanics::ConstrainedRows;
use crate::mechanics::assembly::{BlockPositions, State, internal_force, tangent};
use crate::model::{ModelError, TissueModel};
use crate::solver::constrained::{ConstrainedSolver, Unknowns};
use crate::solver::equilibrium::{Failure, FailureReason, NewtonSettings};
use nalgebra::{Matrix2, Vector2};

/// How the target answers to one paddle and to the needle, at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestResponse {
    /// Actuation Jacobian, needle held: rows target x, y, columns paddle x, y.
    pub jacobian: Matrix2<f64>,
    /// ‖J⁻¹ n‖.
    pub controllability_measure: f64,
    /// J⁻¹ n.
    pub best_direction: Vector2<f64>,
    /// d(target displacement)/d(depth), paddle held.
    pub target_per_depth: Vector2<f64>,
}

/// Responses of all paddles of the model's scene, in its order.
///
/// # Errors
/// [`ModelError`] when the tangent at rest is singular or a paddle cannot control the target.
pub fn rest_responses(model: &TissueModel) -> Result<Vec<RestResponse>, ModelError> {
    let rule = model.rule();
    let nodes = model.nodes();
    let count = model.scene().paddles.len();
    let Some(all) = (0..count).map(|p| model.constrained_rows(Some(p))).collect::<Option<Vec<ConstrainedRows>>>()
    else {
        return (0..count).map(|paddle| rest_response_weakly_imposed(model, paddle)).collect();
    };
    let lists = (0..rule.len()).map(|q| rule.point(q).nodes).chain(all.iter().flat_map(ConstrainedRows::node_lists));
    let pattern = Pattern::new(2, nodes, lists);
    let blocks = BlockPositions::new(rule, &pattern);
    let (mut state, mut force) = (State::default(), vec![0.0; 2 * nodes]);
    internal_force(rule, model.tissue(), &vec![0.0; 2 * nodes], &mut state, &mut force)
        .map_err(|_| singular("at rest"))?;
    let mut at_rest = vec![0.0; pattern.entries()];
    tangent(rule, model.tissue(), &state, &pattern, &blocks, &mut at_rest);

    let mut solver = ConstrainedSolver::<2>::new(pattern, model.positions(), ConstrainedRows::default());
    // Paddle along x, paddle along y, needle along its axis: three right-hand sides pass through each factor together.
    const RATES: usize = 3;
    let zero = vec![0.0; RATES * 2 * nodes];
    let mut response = vec![0.0; RATES * 2 * nodes];
    let mut responses = Vec::with_capacity(all.len());
    for (paddle, rows) in all.into_iter().enumerate() {
        let mut multipliers = vec![0.0; RATES * 2 * rows.len()];
        solver.constrain(rows);
        solver.load(&at_rest);
        solver.factorise().map_err(|_| singular("the tangent at rest is not positive definite"))?;
        let rates = [
            model.prescribed_values(Some(paddle), 0.0, Vector2::x()),
            model.prescribed_values(Some(paddle), 0.0, Vector2::y()),
            model.prescribed_values(Some(paddle), 1.0, Vector2::zeros()),
        ];
        let unknowns = Unknowns { x: &mut response, multipliers: &mut multipliers };
        solver.solve(&zero, &rates.concat(), 1e-12, unknowns);
        let target = |rate: usize| model.target_row().interpolate(&response[rate * 2 * nodes..]);
        responses.push(response_of(model, paddle, Matrix2::from_columns(&[target(0), target(1)]), target(2))?);
    }
    Ok(responses)
}

/// Nitsche's terms change the matrix with the paddle: each has a body of its own.
fn rest_response_weakly_imposed(model: &TissueModel, paddle: usize) -> Result<RestResponse, ModelError> {
    let mut body = model.body(Some(paddle), NewtonSettings::default())?;
    let jacobian = body.actuation_jacobian()?;
    let target_per_depth = body.depth_sensitivity()?;
    response_of(model, paddle, jacobian, target_per_depth)
}

fn response_of(
    model: &TissueModel,
    paddle: usize,
    jacobian: Matrix2<f64>,
    target_per_depth: Vector2<f64>,
) -> Result<RestResponse, ModelError> {
    let scene = model.scene();
    let direction = best_direction(&jacobian, scene.needle.orthogonal()).map_err(|singular| {
        ModelError::Uncontrollable { paddle: scene.paddles[paddle].index, condition: singular.condition }
    })?;
    Ok(RestResponse {
        jacobian,
        controllability_measure: direction.norm(),
        best_direction: direction,
        target_per_depth,
    })
}

fn singular(detail: &str) -> Failure {
    Failure { reason: FailureReason::SingularTangent, reached: 0.0, detail: detail.to_owned() }
}
