//! Linear elasticity.

use super::catalogue::Catalogued;
use super::error::{MaterialError, finite};
use super::kinematics::{Matrix, Tensor4, tensor4};
use super::lame::{LameParameters, lambda};
use super::material::{Material, Response};
use super::section::MaterialSection;
use serde::Serialize;

/// `W = ½ λ (tr ε)² + μ ε:ε`, ε = ½ (H + Hᵀ).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Linear {
    lambda: f64,
    mu: f64,
}

impl Linear {
    pub(super) fn new(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        let law = Self { lambda: finite(lambda, "lambda")?, mu: finite(mu, "mu")? };
        Material::<3>::check_stable_at_rest(&law)?;
        Ok(law)
    }
}

/// The moduli of a law that is stable at rest make a linear one that is.
impl From<LameParameters> for Linear {
    fn from(LameParameters { lambda, mu }: LameParameters) -> Self {
        Self { lambda, mu }
    }
}

impl<const D: usize> Material<D> for Linear {
    fn respond(&self, h: &Matrix<D>) -> Response<D> {
        let strain = (h + h.transpose()) * 0.5;
        let trace = strain.trace();
        let stress = Matrix::<D>::identity() * (self.lambda * trace) + strain * (2.0 * self.mu);
        Response { energy: 0.5 * stress.dot(&strain), pk1_stress: stress }
    }

    fn tangent(&self, _: &Matrix<D>) -> Tensor4<D> {
        let delta = |p: usize, q: usize| if p == q { 1.0 } else { 0.0 };
        tensor4(|i, j, k, l| {
            self.lambda * delta(i, j) * delta(k, l) + self.mu * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k))
        })
    }
}

impl Catalogued for Linear {
    fn read<M>(section: &MaterialSection<M>) -> Result<Self, MaterialError> {
        let (lambda, mu) = section.lame_parameters()?;
        Self::new(lambda, mu)
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn has_mesh_limit(&self) -> bool {
        true
    }

    fn linearised(&self) -> Option<LameParameters> {
        Some(LameParameters { lambda: self.lambda, mu: self.mu })
    }

    fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
        Some(Self::new(lambda(self.mu, poisson), self.mu))
    }
}
