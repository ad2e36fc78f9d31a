//! Actuation Jacobians at rest for all paddles at once: one assembly and one factor serve them all, since they differ only in
//! which nodal values are constrained.

use super::attaching::Attaching;
use super::condensed::{singular, tangent_at_rest};
use super::controllability::best_direction;
use super::fields::{Fields, Loads, RATES};
use crate::linalg::Unfactorised;
use crate::mechanics::ConstrainedRows;
use crate::model::{ModelError, TissueModel};
use crate::solver::constrained::{ConstrainedSolver, Unknowns};
use crate::solver::equilibrium::{Failure, NewtonSettings};
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

/// Responses of all paddles of the model's scene, in its order.
///
/// # Errors
/// [`ModelError`] when the tangent at rest is singular. A paddle that cannot control the target is a result.
pub fn rest_responses(model: &TissueModel) -> Result<Vec<RestResponse>, ModelError> {
    let count = model.scene().paddles.len();
    if model.is_held_weakly() {
        return (0..count).map(|paddle| rest_response_weakly_imposed(model, paddle)).collect();
    }
    let normal = model.scene().needle.orthogonal();
    if let Some(body) = Attaching::new(model, Loads::None)? {
        let response = |paddle| {
            let [x, y, per_depth] = body.target(paddle)?;
            Ok(RestResponse::new(Matrix2::from_columns(&[x, y]), per_depth, normal))
        };
        return (0..count).map(response).collect();
    }
    let mut responses = Vec::with_capacity(count);
    for_each_paddle_by_itself(model, Loads::None, |_, fields| {
        responses.push(response_of(model, fields));
        Ok(())
    })?;
    Ok(responses)
}

/// Solves for every paddle in turn and hands its fields to `visit`: one assembly and one factor for all where the body holds
/// without a paddle.
///
/// # Errors
/// [`ModelError`] when the tangent at rest is singular, the nodal values are not imposed exactly, or from `visit`.
pub(super) fn for_each_paddle(
    model: &TissueModel,
    loads: Loads,
    mut visit: impl FnMut(usize, &Fields) -> Result<(), ModelError>,
) -> Result<(), ModelError> {
    let Some(mut body) = Attaching::new(model, loads)? else { return for_each_paddle_by_itself(model, loads, visit) };
    let mut fields = Fields::new(model, loads);
    for paddle in 0..model.scene().paddles.len() {
        body.fields(paddle, &mut fields)?;
        visit(paddle, &fields)?;
    }
    Ok(())
}

/// The same with a factor for each paddle. All right-hand sides pass through it together.
fn for_each_paddle_by_itself(
    model: &TissueModel,
    loads: Loads,
    mut visit: impl FnMut(usize, &Fields) -> Result<(), ModelError>,
) -> Result<(), ModelError> {
    let all: Vec<ConstrainedRows> = (0..model.scene().paddles.len())
        .map(|p| model.constrained_rows(Some(p)))
        .collect::<Option<_>>()
        .ok_or(ModelError::ImposedWeakly)?;
    let at_rest = tangent_at_rest(model.rule(), model.tissue(), model.analysis())?;
    let mut solver =
        ConstrainedSolver::<2>::new(model.analysis(), ConstrainedRows::default()).map_err(Failure::from)?;
    let mut forces = vec![0.0; RATES * model.dofs()];
    forces.extend(loads.forces(model));
    let mut fields = Fields::new(model, loads);
    for (paddle, rows) in all.into_iter().enumerate() {
        let mut multipliers = vec![0.0; forces.len() / model.dofs() * 2 * rows.len()];
        solver.constrain(rows);
        solver.load(&at_rest);
        solver.factorise().map_err(|error| match error {
            Unfactorised::NotPositiveDefinite(error) => singular(&error.to_string()),
            Unfactorised::NotEnoughMemory(error) => Failure::from(error),
        })?;
        let mut rates = [
            model.prescribed_values(Some(paddle), 0.0, Vector2::x()),
            model.prescribed_values(Some(paddle), 0.0, Vector2::y()),
            model.prescribed_values(Some(paddle), 1.0, Vector2::zeros()),
        ]
        .concat();
        rates.resize(multipliers.len(), 0.0);
        let unknowns = Unknowns { x: fields.all_mut(), multipliers: &mut multipliers };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Integration, Method, Resolution};
    use crate::scene::Scene;

    fn quadratic(scene: Scene, spacing: f64) -> TissueModel {
        model(scene, spacing, Integration::FemT6)
    }

    fn model(mut scene: Scene, spacing: f64, integration: Integration) -> TissueModel {
        scene.discretization.method = Method::new(integration);
        scene.discretization.resolution = Resolution::Spacing(spacing);
        TissueModel::new(&scene).unwrap()
    }

    #[test]
    fn paddles_attached_to_one_factor_answer_as_with_a_factor_each() {
        let scenes = [("paper", 0.1), ("paper-hull", 0.1), ("breast", 8.0)];
        // Single unknowns are retained as they are; sums of several by ports.
        let rules = [Integration::FemT6, Integration::ScniStabilised, Integration::Mscni];
        for ((name, spacing), rule) in scenes.into_iter().flat_map(|scene| rules.map(|rule| (scene, rule))) {
            let model = model(Scene::bundled(name).unwrap(), spacing, rule);
            let mut own = Vec::new();
            for_each_paddle_by_itself(&model, Loads::OnTarget, |_, fields| {
                own.push(fields.clone());
                Ok(())
            })
            .unwrap();
            let mut body = Attaching::new(&model, Loads::OnTarget).unwrap().expect("paddles apart");
            let mut fields = Fields::new(&model, Loads::OnTarget);
            for (paddle, own) in own.iter().enumerate() {
                body.fields(paddle, &mut fields).unwrap();
                // What holds sums of unknowns costs digits.
                let within = if rule.is_element() { 1e-9 } else { 1e-7 };
                for f in 0..RATES + 2 {
                    let largest = own.field(f).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                    for (here, there) in fields.field(f).iter().zip(own.field(f)) {
                        assert!((here - there).abs() < within * largest, "{name} {rule} {paddle} {f}: {here} {there}");
                    }
                }
                let expected = response_of(&model, own);
                let [x, y, per_depth] = body.target(paddle).unwrap();
                let off = (Matrix2::from_columns(&[x, y]) - expected.jacobian).norm() / expected.jacobian.norm();
                let moved = (per_depth - expected.target_per_depth).norm();
                assert!(off < 1e-7 && moved < 1e-7, "{name} {rule} {paddle}: {off} {moved}");
            }
        }
    }

    #[test]
    fn rules_that_ports_cost_digits_have_a_factor_for_each_paddle() {
        let paper = |rule| {
            Attaching::new(&model(Scene::bundled("paper-hull").unwrap(), 0.1, rule), Loads::None).unwrap().is_some()
        };
        assert_eq!([Integration::Scni, Integration::Gauss, Integration::Mscni].map(paper), [false, false, true]);
    }

    #[test]
    fn a_paddle_that_shares_a_node_with_the_needle_has_a_factor_of_its_own() {
        let mut scene = Scene::bundled("paper").unwrap();
        let end = *scene.needle.contact.last().unwrap();
        scene.paddles[0].segment[0] = end;
        let model = quadratic(scene, 0.1);
        assert!(Attaching::new(&model, Loads::None).unwrap().is_none());
        let responses = rest_responses(&model).unwrap();
        assert!(responses.iter().all(|r| r.jacobian.iter().all(|x| x.is_finite())));
    }
}
