//! Derivatives of a body's state with respect to its controls: needle depth and paddle displacements.
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
use super::driven::DrivenBody;
use crate::solver::equilibrium::Failure;
use nalgebra::{DMatrix, Matrix2x3, Matrix3};

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

/// Derivatives by all controls of a body in D dimensions.
#[derive(Debug, Clone)]
pub struct ControlDerivatives<const D: usize> {
    /// First, of the target displacement: D rows, a column per control.
    pub slope: DMatrix<f64>,
    /// Second, by component of the target displacement; none where differences cannot be taken.
    pub bend: Option<[DMatrix<f64>; D]>,
    /// First derivatives of the coefficients, control after control.
    pub responses: Vec<f64>,
}

/// First and second derivatives at the present state, for bodies whose prescribed values are imposed exactly.
///
/// # Errors
/// [`Failure`] when the current state is not stable.
pub fn control_derivatives<const D: usize, B: DrivenBody<D>>(body: &mut B) -> Result<ControlDerivatives<D>, Failure> {
    let unknowns = body.equilibrium().coefficients().len();
    let controls = 1 + D * body.paddles();
    let mut rates = Vec::new();
    for control in 0..controls {
        let mut unit = vec![0.0; controls];
        unit[control] = 1.0;
        rates.extend(body.prescribed(&unit));
    }
    let mut on_target = vec![0.0; D * unknowns];
    for (&i, value) in body.target_row().nodes.iter().zip(&body.target_row().values) {
        for axis in 0..D {
            on_target[axis * unknowns + D * i as usize + axis] += value;
        }
    }
    let mut responses = body.equilibrium_mut().linear_responses(&rates, &on_target)?;
    let adjoints = responses.split_off(controls * unknowns);
    let mut slope = DMatrix::zeros(D, controls);
    for (column, response) in responses.chunks_exact(unknowns).enumerate() {
        slope.set_column(column, &body.target_row().interpolate(response));
    }
    if let Some(beside) = body.beside_row() {
        slope += beside;
    }
    let bend = second_derivatives(body, &responses, &adjoints);
    Ok(ControlDerivatives { slope, bend, responses })
}

/// By polarisation: `2 D²f[x, y] = D²f[x + y, x + y] − D²f[x, x] − D²f[y, y]`.
fn second_derivatives<const D: usize, B: DrivenBody<D>>(
    body: &B,
    responses: &[f64],
    adjoints: &[f64],
) -> Option<[DMatrix<f64>; D]> {
    let unknowns = body.equilibrium().coefficients().len();
    let responses: Vec<&[f64]> = responses.chunks_exact(unknowns).collect();
    let adjoints: Vec<&[f64]> = adjoints.chunks_exact(unknowns).collect();
    let along = |direction: &[f64]| -> Option<[f64; D]> {
        let furthest = direction.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if furthest == 0.0 {
            return Some([0.0; D]);
        }
        let length = DIFFERENCE * body.spacing() / furthest;
        let sums = body.equilibrium().force_curvature(direction, length, &adjoints).ok()?;
        Some(std::array::from_fn(|row| -sums[row]))
    };
    let mut bend: [DMatrix<f64>; D] = std::array::from_fn(|_| DMatrix::zeros(responses.len(), responses.len()));
    for (i, x) in responses.iter().enumerate() {
        let own = along(x)?;
        (0..D).for_each(|row| bend[row][(i, i)] = own[row]);
    }
    for (i, x) in responses.iter().enumerate() {
        for (j, y) in responses.iter().enumerate().skip(i + 1) {
            let sum: Vec<f64> = x.iter().zip(*y).map(|(x, y)| x + y).collect();
            let both = along(&sum)?;
            for row in 0..D {
                let mixed = 0.5 * (both[row] - bend[row][(i, i)] - bend[row][(j, j)]);
                (bend[row][(i, j)], bend[row][(j, i)]) = (mixed, mixed);
            }
        }
    }
    Some(bend)
}

impl Body<'_> {
    /// First and second derivatives at the present state, for bodies whose prescribed values are imposed exactly.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn derivatives(&mut self) -> Result<Derivatives, Failure> {
        let found = control_derivatives::<2, _>(self)?;
        let mut slope = Matrix2x3::zeros();
        slope.view_mut((0, 0), (2, found.slope.ncols())).copy_from(&found.slope);
        let whole = |part: &DMatrix<f64>| {
            let mut whole = Matrix3::zeros();
            whole.view_mut((0, 0), part.shape()).copy_from(part);
            whole
        };
        Ok(Derivatives { slope, bend: found.bend.map(|bend| bend.each_ref().map(whole)), responses: found.responses })
    }
}

#[cfg(test)]
mod tests {
    use crate::model::TissueModel;
    use crate::scene::Scene;
    use crate::solver::equilibrium::NewtonSettings;
    use nalgebra::Vector2;

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
