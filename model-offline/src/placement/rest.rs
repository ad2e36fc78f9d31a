//! Actuation Jacobians at rest for all paddles at once: one assembly and one symbolic analysis serve them all, since
//! they differ only in which nodal values are constrained.

use super::controllability::best_direction;
use crate::mechanics::ConstrainedRows;
use crate::mechanics::assembly::{AssemblyState, Medium, internal_force, tangent};
use crate::mechanics::history::Prestress;
use crate::model::{ModelError, TissueModel};
use crate::solver::constrained::{ConstrainedSolver, Unknowns};
use crate::solver::equilibrium::{Failure, FailureReason, NewtonSettings};
use nalgebra::{Matrix2, Vector2};

/// How the target answers to one paddle and to the needle, at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestResponse {
    /// Actuation Jacobian, needle held: rows target x, y, columns paddle x, y.
    pub jacobian: Matrix2<f64>,
    /// ‖J⁻¹ n‖; infinite where the paddle cannot control the target.
    pub controllability_measure: f64,
    /// J⁻¹ n; none where the paddle cannot control the target.
    pub best_direction: Option<Vector2<f64>>,
    /// d(target displacement)/d(depth), paddle held.
    pub target_per_depth: Vector2<f64>,
}

/// Displacements of one body to unit rates, as nodal coefficients one after the other: paddle along x, paddle along y,
/// needle along its axis, and, where they were asked for, to unit loads on the target along x and y.
#[derive(Debug, Clone)]
pub(super) struct Fields {
    coefficients: Vec<f64>,
    unknowns: usize,
}

impl Fields {
    /// Field f in the order above.
    pub(super) fn field(&self, f: usize) -> &[f64] {
        &self.coefficients[f * self.unknowns..(f + 1) * self.unknowns]
    }
}

/// Rates that are prescribed: paddle along x, along y, needle along its axis.
const RATES: usize = 3;

/// Responses of all paddles of the model's scene, in its order.
///
/// # Errors
/// [`ModelError`] when the tangent at rest is singular. A paddle that cannot control the target is a result.
pub fn rest_responses(model: &TissueModel) -> Result<Vec<RestResponse>, ModelError> {
    let count = model.scene().paddles.len();
    if (0..count).any(|p| model.constrained_rows(Some(p)).is_none()) {
        return (0..count).map(|paddle| rest_response_weakly_imposed(model, paddle)).collect();
    }
    let mut responses = Vec::with_capacity(count);
    for_each_paddle(model, Loads::None, |_, fields| {
        responses.push(response_of(model, fields));
        Ok(())
    })?;
    Ok(responses)
}

/// Which loads are looked at besides the rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loads {
    /// None.
    None,
    /// Unit loads on the target: the adjoint of asking for its displacement.
    OnTarget,
}

/// Solves for every paddle in turn and hands its fields to `visit`: one assembly and one analysis, a factor each. All
/// right-hand sides pass through a factor together.
///
/// # Errors
/// [`ModelError`] when the tangent at rest is singular, the nodal values are not imposed exactly, or from `visit`.
pub(super) fn for_each_paddle(
    model: &TissueModel,
    loads: Loads,
    mut visit: impl FnMut(usize, &Fields) -> Result<(), ModelError>,
) -> Result<(), ModelError> {
    let rule = model.rule();
    let unknowns = 2 * model.nodes();
    let all: Vec<ConstrainedRows> = (0..model.scene().paddles.len())
        .map(|p| model.constrained_rows(Some(p)))
        .collect::<Option<_>>()
        .ok_or(ModelError::ImposedWeakly)?;
    let analysis = model.analysis();
    let stabilisation = analysis.stabilisation(rule, model.tissue());
    let prestress = Prestress::default();
    let medium = Medium { rule, stabilisation: &stabilisation, tissue: model.tissue(), prestress: &prestress };
    let (mut state, mut force) = (AssemblyState::default(), vec![0.0; unknowns]);
    internal_force(medium, &vec![0.0; unknowns], &mut state, &mut force).map_err(|_| singular("at rest"))?;
    let mut at_rest = vec![0.0; analysis.pattern().entries()];
    tangent(medium, &state, analysis.blocks(), &mut at_rest);

    let mut solver = ConstrainedSolver::<2>::new(analysis, ConstrainedRows::default());
    let columns = RATES + if loads == Loads::OnTarget { 2 } else { 0 };
    let mut forces = vec![0.0; columns * unknowns];
    for (column, axis) in (RATES..columns).zip(0..2) {
        for (&i, value) in model.target_row().nodes.iter().zip(&model.target_row().values) {
            forces[column * unknowns + 2 * i as usize + axis] += value;
        }
    }
    let mut fields = Fields { coefficients: vec![0.0; columns * unknowns], unknowns };
    for (paddle, rows) in all.into_iter().enumerate() {
        let mut multipliers = vec![0.0; columns * 2 * rows.len()];
        solver.constrain(rows);
        solver.load(&at_rest);
        solver.factorise().map_err(|_| singular("the tangent at rest is not positive definite"))?;
        let mut rates = [
            model.prescribed_values(Some(paddle), 0.0, Vector2::x()),
            model.prescribed_values(Some(paddle), 0.0, Vector2::y()),
            model.prescribed_values(Some(paddle), 1.0, Vector2::zeros()),
        ]
        .concat();
        rates.resize(multipliers.len(), 0.0);
        let unknowns = Unknowns { x: &mut fields.coefficients, multipliers: &mut multipliers };
        solver.solve(&forces, &rates, 1e-12, unknowns);
        visit(paddle, &fields)?;
    }
    Ok(())
}

/// Nitsche's terms change the matrix with the paddle: each has a body of its own.
fn rest_response_weakly_imposed(model: &TissueModel, paddle: usize) -> Result<RestResponse, ModelError> {
    let mut body = model.body(Some(paddle), NewtonSettings::default())?;
    let jacobian = body.actuation_jacobian()?;
    let target_per_depth = body.depth_sensitivity()?;
    Ok(RestResponse::new(jacobian, target_per_depth, model.scene().needle.orthogonal()))
}

/// What the fields of one paddle say about it.
pub(super) fn response_of(model: &TissueModel, fields: &Fields) -> RestResponse {
    let target = |rate: usize| model.target_row().interpolate(fields.field(rate));
    let jacobian = Matrix2::from_columns(&[target(0), target(1)]);
    RestResponse::new(jacobian, target(2), model.scene().needle.orthogonal())
}

impl RestResponse {
    /// The response of a Jacobian; `normal` is orthogonal to the needle.
    pub(super) fn new(jacobian: Matrix2<f64>, target_per_depth: Vector2<f64>, normal: Vector2<f64>) -> Self {
        let best_direction = best_direction(&jacobian, normal).ok();
        let controllability_measure = best_direction.map_or(f64::INFINITY, |direction| direction.norm());
        Self { jacobian, controllability_measure, best_direction, target_per_depth }
    }

    /// Relative distance of the controllability measure from another one; none apart where neither paddle controls the
    /// target, infinitely far where one does.
    pub fn measure_distance(&self, other: &Self) -> f64 {
        match (self.best_direction, other.best_direction) {
            (None, None) => 0.0,
            (Some(_), Some(_)) => (self.controllability_measure / other.controllability_measure - 1.0).abs(),
            _ => f64::INFINITY,
        }
    }
}

fn singular(detail: &str) -> Failure {
    Failure { reason: FailureReason::SingularTangent, reached: 0.0, detail: detail.to_owned() }
}
