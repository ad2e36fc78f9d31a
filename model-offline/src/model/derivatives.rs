//! Derivatives of a body's state with respect to what moves it: needle depth, paddle displacement x and y.
//!
//! With the state d(z) that keeps `f(d) + Λᵀ μ = 0, Λ d = g(z)`, the responses `x_i = ∂d/∂z_i` solve `K x_i + Λᵀ μ = 0,
//! Λ x_i = ∂g/∂z_i`, and the target displacement u = T d has
//!
//! ```text
//! ∂u/∂z_i = T x_i,   ∂²u_r/∂z_i∂z_j = −λ_r · D²f[x_i, x_j],   K λ_r + Λᵀ μ = T_rᵀ,   Λ λ_r = 0
//! ```
//!
//! with one factor for all; D²f is taken by second differences of the force, which needs none. The stabilisation is linear
//! and drops out.

use super::Body;
use crate::solver::equilibrium::Failure;
use nalgebra::{Matrix2x3, Matrix3, Vector2};

/// Longest way of a node in a second difference, over the finest spacing: strains of a thousandth, between rounding and
/// the law's higher derivatives.
const DIFFERENCE: f64 = 1e-3;

/// Derivatives of the target displacement at an equilibrium. Without a paddle those that belong to one are zero.
#[derive(Debug, Clone)]
pub struct Derivatives {
    /// First: rows target x, y; columns depth, paddle x, y.
    pub slope: Matrix2x3<f64>,
    /// Second, of target x and y; none where the body is so near a limit that differences cannot be taken.
    pub bend: Option<[Matrix3<f64>; 2]>,
    /// First derivatives of the coefficients, one after the other: by depth, then by paddle x and y where one is attached.
    pub responses: Vec<f64>,
}

impl Body<'_> {
    /// First and second derivatives at the present state, for bodies whose prescribed values are imposed exactly.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn derivatives(&mut self) -> Result<Derivatives, Failure> {
        let unknowns = self.model.dofs();
        let mut rates = self.model.prescribed_values(self.attached, 1.0, Vector2::zeros());
        let controls = if self.attached.is_some() { 3 } else { 1 };
        for axis in 0..controls - 1 {
            rates.extend(self.model.prescribed_values(self.attached, 0.0, Vector2::ith(axis, 1.0)));
        }
        let mut on_target = vec![0.0; 2 * unknowns];
        for (&i, value) in self.model.target.nodes.iter().zip(&self.model.target.values) {
            for axis in 0..2 {
                on_target[axis * unknowns + 2 * i as usize + axis] += value;
            }
        }
        let mut responses = self.equilibrium.linear_responses(&rates, &on_target)?;
        let adjoints = responses.split_off(controls * unknowns);
        let mut slope = Matrix2x3::zeros();
        for (column, response) in responses.chunks_exact(unknowns).enumerate() {
            slope.set_column(column, &self.model.target.interpolate(response));
        }
        let bend = self.second_derivatives(&responses, &adjoints);
        Ok(Derivatives { slope, bend, responses })
    }

    /// By polarisation: `2 D²f[x, y] = D²f[x + y, x + y] − D²f[x, x] − D²f[y, y]`.
    fn second_derivatives(&self, responses: &[f64], adjoints: &[f64]) -> Option<[Matrix3<f64>; 2]> {
        let responses: Vec<&[f64]> = responses.chunks_exact(self.model.dofs()).collect();
        let adjoints: Vec<&[f64]> = adjoints.chunks_exact(self.model.dofs()).collect();
        let along = |direction: &[f64]| -> Option<[f64; 2]> {
            let furthest = direction.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            if furthest == 0.0 {
                return Some([0.0; 2]);
            }
            let length = DIFFERENCE * self.model.spacing() / furthest;
            let sums = self.equilibrium.force_curvature(direction, length, &adjoints).ok()?;
            Some([-sums[0], -sums[1]])
        };
        let mut bend = [Matrix3::zeros(); 2];
        for (i, x) in responses.iter().enumerate() {
            let own = along(x)?;
            (0..2).for_each(|row| bend[row][(i, i)] = own[row]);
        }
        for (i, x) in responses.iter().enumerate() {
            for (j, y) in responses.iter().enumerate().skip(i + 1) {
                let sum: Vec<f64> = x.iter().zip(*y).map(|(x, y)| x + y).collect();
                let both = along(&sum)?;
                for row in 0..2 {
                    let mixed = 0.5 * (both[row] - bend[row][(i, i)] - bend[row][(j, j)]);
                    (bend[row][(i, j)], bend[row][(j, i)]) = (mixed, mixed);
                }
            }
        }
        Some(bend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TissueModel;
    use crate::scene::Scene;
    use crate::solver::equilibrium::NewtonSettings;

    /// Against differences of the first derivatives of states that were solved for, at rest and deep in.
    #[test]
    fn second_derivatives_are_those_of_the_first() {
        let paper = Scene::bundled("paper").unwrap();
        for scene in [paper.without_inclusions(), paper, Scene::bundled("prostate").unwrap()] {
            let (model, _) = crate::placement::discretise(&scene).unwrap();
            let model: &TissueModel = &model;
            let size = scene.needle.depth;
            for (paddle, share) in [(None, 0.4), (Some(1), 0.0), (Some(1), 0.5)] {
                let place =
                    if paddle.is_some() { Vector2::new(0.06, -0.04) * (share * size) } else { Vector2::zeros() };
                let at = |step: f64, control: usize| {
                    let mut body = model.body(paddle, NewtonSettings::default()).unwrap();
                    let along = |c: usize| if c == control { step } else { 0.0 };
                    body.drive(share * size + along(0), place + Vector2::new(along(1), along(2))).unwrap();
                    body.derivatives().unwrap()
                };
                let bend = at(0.0, 0).bend.unwrap();
                let scale = bend.iter().map(|b| b.amax()).fold(0.0, f64::max);
                let step = 1e-3 * size;
                for control in 0..if paddle.is_some() { 3 } else { 1 } {
                    let change = (at(step, control).slope - at(-step, control).slope) / (2.0 * step);
                    for (row, bend) in bend.iter().enumerate() {
                        let off = (bend.column(control).transpose() - change.row(row)).amax();
                        assert!(off < 2e-3 * scale, "{paddle:?} {share} {control}: off by {off:.2e} of {scale:.2e}");
                    }
                }
            }
        }
    }
}
