//! A volumetric barrier that any law can be given.

use super::error::{MaterialError, not_negative};
use super::kinematics::{Matrix, Tensor4, determinant, inverse_transpose, tensor4};
use super::material::Response;
use serde::Serialize;

/// `β/4 (ln J)⁴`: zero value, slope and curvature at J = 1, so that small strains do not feel it, and unbounded as J → 0, so
/// that compression meets a growing resistance.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub(super) struct Barrier {
    /// β, stress units.
    pub(super) beta: f64,
}

impl Barrier {
    pub(super) fn new(beta: f64) -> Result<Self, MaterialError> {
        Ok(Self { beta: not_negative(beta, "barrier")? })
    }

    pub(super) fn acts(self) -> bool {
        self.beta > 0.0
    }

    pub(super) fn add_response<const D: usize>(self, h: &Matrix<D>, response: &mut Response<D>) {
        let f = Matrix::<D>::identity() + h;
        let j = determinant(&f);
        let log = j.ln();
        response.energy += 0.25 * self.beta * log.powi(4);
        response.pk1_stress += inverse_transpose(&f, j) * (self.beta * log.powi(3));
    }

    pub(super) fn add_tangent<const D: usize>(self, h: &Matrix<D>, tangent: &mut Tensor4<D>) {
        let f = Matrix::<D>::identity() + h;
        let j = determinant(&f);
        let log = j.ln();
        let g = inverse_transpose(&f, j);
        let added: Tensor4<D> = tensor4(|i, jj, k, l| {
            self.beta * (3.0 * log * log * g[(i, jj)] * g[(k, l)] - log.powi(3) * g[(i, l)] * g[(k, jj)])
        });
        let entries = tangent.as_flattened_mut().as_flattened_mut().as_flattened_mut();
        entries.iter_mut().zip(added.as_flattened().as_flattened().as_flattened()).for_each(|(sum, part)| *sum += part);
    }
}
