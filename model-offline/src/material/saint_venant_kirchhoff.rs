//! St. Venant–Kirchhoff: linear in the Green–Lagrange strain.

use super::catalogue::Catalogued;
use super::error::{MaterialError, finite};
use super::kinematics::{Matrix, Tensor4, green_lagrange, tensor4};
use super::lame::{LameParameters, lambda};
use super::material::{Material, Response};
use super::section::MaterialSection;
use serde::Serialize;

/// `W = ½ λ (tr E)² + μ E:E`, so S = λ (tr E) I + 2μ E.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct SaintVenantKirchhoff {
    lambda: f64,
    mu: f64,
}

impl SaintVenantKirchhoff {
    pub(super) fn new(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        let law = Self { lambda: finite(lambda, "lambda")?, mu: finite(mu, "mu")? };
        Material::<3>::check_stable_at_rest(&law)?;
        Ok(law)
    }
}

impl<const D: usize> Material<D> for SaintVenantKirchhoff {
    fn respond(&self, h: &Matrix<D>) -> Response<D> {
        let f = Matrix::<D>::identity() + h;
        let e = green_lagrange(h);
        let trace = e.trace();
        let pk2 = Matrix::<D>::identity() * (trace * self.lambda) + e * (2.0 * self.mu);
        Response { energy: 0.5 * self.lambda * trace * trace + self.mu * e.norm_squared(), pk1_stress: f * pk2 }
    }

    fn tangent(&self, h: &Matrix<D>) -> Tensor4<D> {
        let f = Matrix::<D>::identity() + h;
        let e = green_lagrange(h);
        let pk2 = Matrix::<D>::identity() * (self.lambda * e.trace()) + e * (2.0 * self.mu);
        let left_cauchy_green = f * f.transpose();
        tensor4(|i, j, k, l| {
            let geometric = if i == k { pk2[(j, l)] } else { 0.0 };
            let shear = if j == l { left_cauchy_green[(i, k)] } else { 0.0 };
            geometric + self.lambda * f[(i, j)] * f[(k, l)] + self.mu * (shear + f[(i, l)] * f[(k, j)])
        })
    }
}

impl Catalogued for SaintVenantKirchhoff {
    fn read<M>(section: &MaterialSection<M>) -> Result<Self, MaterialError> {
        let (lambda, mu) = section.lame_parameters()?;
        Self::new(lambda, mu)
    }

    fn linearised(&self) -> Option<LameParameters> {
        Some(LameParameters { lambda: self.lambda, mu: self.mu })
    }

    fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
        Some(Self::new(lambda(self.mu, poisson), self.mu))
    }
}
