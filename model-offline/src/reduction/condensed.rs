//! Static condensation of the linear model: needle, paddle and target are retained, every other displacement is
//! condensed out. `K_c = K_rr − K_rf K_ff⁻¹ K_fr` (Guyan 1965), exact for the law's small-strain limit.

use super::lifting::{control_values, controls, flat, tangent_at_rest};
use crate::mechanics::ConstrainedRows;
use crate::mechanics::assembly::displacement_gradient;
use crate::model::{ModelError, TissueModel};
use crate::solver::equilibrium::{Equilibrium, Failure, FailureReason, NewtonSettings};
use nalgebra::{DMatrix, Matrix2, Vector2};

/// The condensed body. Retained, in this order: needle depth, paddle x and y (where one is attached), target x and y.
#[derive(Debug, Clone, PartialEq)]
pub struct Condensed {
    controls: usize,
    /// Symmetric, force per length (per unit thickness in the plane), over the retained displacements.
    stiffness: DMatrix<f64>,
    /// d(target)/d(needle, paddle x, paddle y) with no force on the target: 2 rows.
    response: [Vector2<f64>; 3],
}

impl Condensed {
    /// Condenses the model with the paddle at this place of the scene's list attached, or none.
    ///
    /// # Errors
    /// [`ModelError`] when too little of the body is constrained, or by Nitsche's method.
    pub fn new(model: &TissueModel, paddle: Option<usize>) -> Result<Self, ModelError> {
        let controls = controls(paddle);
        // The target is constrained too while the others are condensed out.
        let rows = model.constrained_rows_with_target(paddle).ok_or(ModelError::ImposedWeakly)?;
        let shapes = retained_responses(model, paddle, rows)?;
        let columns: Vec<&[f64]> = shapes.iter().map(Vec::as_slice).collect();
        let mut stiffness = model.analysis().stabilisation(model.rule(), model.tissue()).project::<2>(&columns);
        for (q, point) in model.rule().points().enumerate() {
            let a = tangent_at_rest(model.tissue(), point.cell, point.weight);
            let strains: Vec<_> = shapes.iter().map(|d| flat(&displacement_gradient(model.rule(), q, d))).collect();
            for (j, strain) in strains.iter().enumerate() {
                let stress = a * strain;
                for (i, virtual_strain) in strains.iter().enumerate() {
                    stiffness[(i, j)] += virtual_strain.dot(&stress);
                }
            }
        }
        let target = stiffness.fixed_view::<2, 2>(controls, controls).into_owned();
        let inverse = target.try_inverse().ok_or_else(|| Failure {
            reason: FailureReason::SingularTangent,
            reached: 0.0,
            detail: "nothing resists the target: move it inside the body, or hold more of it".into(),
        })?;
        let mut response = [Vector2::zeros(); 3];
        for (c, r) in response.iter_mut().enumerate().take(controls) {
            *r = -inverse * Vector2::new(stiffness[(controls, c)], stiffness[(controls + 1, c)]);
        }
        Ok(Self { controls, stiffness, response })
    }

    /// Target displacement for a needle depth and a paddle displacement: two dozen floating-point operations.
    pub fn target_displacement(&self, depth: f64, paddle: Vector2<f64>) -> Vector2<f64> {
        let values = control_values(depth, paddle);
        self.response.iter().zip(values).fold(Vector2::zeros(), |sum, (r, v)| sum + r * v)
    }

    /// Actuation Jacobian: rows target x, y; columns paddle x, y.
    pub fn actuation_jacobian(&self) -> Matrix2<f64> {
        Matrix2::from_columns(&[self.response[1], self.response[2]])
    }

    /// Forces that hold needle (along its axis) and paddle (x, y) there, with no force on the target.
    pub fn reactions(&self, depth: f64, paddle: Vector2<f64>) -> [f64; 3] {
        let target = self.target_displacement(depth, paddle);
        let values = control_values(depth, paddle);
        let displacement: Vec<f64> = values[..self.controls].iter().copied().chain([target.x, target.y]).collect();
        let mut forces = [0.0; 3];
        for (row, force) in forces.iter_mut().enumerate().take(self.controls) {
            *force = displacement.iter().enumerate().map(|(c, u)| self.stiffness[(row, c)] * u).sum();
        }
        forces
    }

    /// The condensed stiffness, over the retained displacements.
    pub fn stiffness(&self) -> &DMatrix<f64> {
        &self.stiffness
    }
}

/// Responses of the whole body to a unit of each retained displacement, the others zero.
fn retained_responses(
    model: &TissueModel,
    paddle: Option<usize>,
    rows: ConstrainedRows,
) -> Result<Vec<Vec<f64>>, ModelError> {
    let mut body =
        Equilibrium::analysed(model.discrete_body(), model.analysis(), rows.into(), NewtonSettings::default())?;
    (0..controls(paddle) + 2)
        .map(|retained| {
            let mut unit = [0.0; 3];
            let mut target = [0.0; 2];
            match retained.checked_sub(controls(paddle)) {
                Some(axis) => target[axis] = 1.0,
                None => unit[retained] = 1.0,
            }
            let mut rates = model.prescribed_values(paddle, unit[0], Vector2::new(unit[1], unit[2]));
            rates.extend(target);
            Ok(body.sensitivities(&rates)?)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    /// The condensed body against the whole one made of the linear law, at a displacement that no linear law would be
    /// used for: linear is linear.
    #[test]
    fn condensing_is_exact_for_the_linear_law() {
        let mut scene = Scene::bundled("paper").unwrap();
        scene.material = scene.material.linearised();
        for inclusion in [true, false] {
            let scene = if inclusion { scene.clone() } else { scene.without_inclusions() };
            let model = TissueModel::new(&scene).unwrap();
            for paddle in [None, Some(2)] {
                let condensed = Condensed::new(&model, paddle).unwrap();
                let (depth, place) = (0.07, Vector2::new(0.013, -0.02));
                let place = if paddle.is_some() { place } else { Vector2::zeros() };
                let mut body = model.body(paddle, NewtonSettings::default()).unwrap();
                body.drive(depth, place).unwrap();
                let (full, small) = (body.target_displacement(), condensed.target_displacement(depth, place));
                assert!((full - small).norm() < 1e-9 * full.norm(), "{full} {small}");
                // Clapeyron: the work of the reactions is twice the strain energy.
                let forces = condensed.reactions(depth, place);
                let work = forces[0] * depth + forces[1] * place.x + forces[2] * place.y;
                let energy = body.equilibrium().energy();
                assert!((0.5 * work - energy).abs() < 1e-8 * energy, "{work} {energy}");
                if paddle.is_some() {
                    let jacobian = body.actuation_jacobian().unwrap();
                    assert!((jacobian - condensed.actuation_jacobian()).norm() < 1e-9);
                }
                let k = condensed.stiffness();
                assert!((k - k.transpose()).norm() < 1e-9 * k.norm());
                assert!(k.clone().symmetric_eigenvalues().min() > 0.0);
            }
        }
    }

    #[test]
    fn nitsche_is_refused() {
        let mut scene = Scene::bundled("paper").unwrap();
        scene.discretization.essential = crate::discretization::Essential::Nitsche;
        let model = TissueModel::new(&scene).unwrap();
        assert!(matches!(Condensed::new(&model, Some(0)), Err(ModelError::ImposedWeakly)));
    }
}
