//! Compressible neo-Hookean law with an isochoric-volumetric split.

use super::catalogue::Catalogued;
use super::error::{MaterialError, finite};
use super::kinematics::{Matrix, Tensor4, determinant, dilation, inverse_transpose, tensor4};
use super::lame::{LameParameters, lambda};
use super::material::{Material, Response};
use super::section::MaterialSection;
use serde::Serialize;

/// `W = μ/2 (Ī₁ − 3) + κ/4 (J² − 1 − 2 ln J)`, Ī₁ = J^(−2/3) tr C in three dimensions (plane strain: C₃₃ = 1).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct NeoHookean {
    kappa: f64,
    mu: f64,
}

impl NeoHookean {
    pub(super) fn new(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        let (lambda, mu) = (finite(lambda, "lambda")?, finite(mu, "mu")?);
        let law = Self { kappa: lambda + 2.0 * mu / 3.0, mu };
        Material::<3>::check_stable_at_rest(&law)?;
        Ok(law)
    }
}

impl<const D: usize> Material<D> for NeoHookean {
    fn respond(&self, h: &Matrix<D>) -> Response<D> {
        let Self { kappa, mu } = *self;
        let f = Matrix::<D>::identity() + h;
        let j = determinant(&f);
        let inverse_t = inverse_transpose(&f, j);
        let trace = f.norm_squared() + (3 - D) as f64;
        let factor = j.powf(-2.0 / 3.0);
        // From ∇u, never as a difference of numbers near 1: at strains of 1e-6, as at the start of an insertion, the
        // energy would be nothing but rounding, and the line search with it.
        let dilation = dilation(h);
        let stretch = 2.0 * h.trace() + h.norm_squared();
        let log = dilation.ln_1p();
        let distortion = factor * stretch + 3.0 * (-2.0 / 3.0 * log).exp_m1();
        Response {
            energy: 0.5 * mu * distortion + 0.25 * kappa * (dilation * dilation + 2.0 * (dilation - log)),
            pk1_stress: (f - inverse_t * (trace / 3.0)) * (mu * factor) + inverse_t * (0.5 * kappa * (j * j - 1.0)),
        }
    }

    fn tangent(&self, h: &Matrix<D>) -> Tensor4<D> {
        let Self { kappa, mu } = *self;
        let f = Matrix::<D>::identity() + h;
        let j = determinant(&f);
        let g = inverse_transpose(&f, j);
        let trace = f.norm_squared() + (3 - D) as f64;
        let factor = mu * j.powf(-2.0 / 3.0);
        // What multiplies g ⊗ g is shared out between the two sides of f ⊗ g + g ⊗ f: a third of the products remain.
        let both = factor * trace * 2.0 / 9.0 + kappa * j * j;
        let swap = factor * trace / 3.0 - 0.5 * kappa * (j * j - 1.0);
        let e = g * (0.5 * both) - f * (2.0 / 3.0 * factor);
        tensor4(|i, j, k, l| {
            let identity = if i == k && j == l { factor } else { 0.0 };
            identity + (e[(i, j)] * g[(k, l)] + g[(i, j)] * e[(k, l)]) + swap * (g[(i, l)] * g[(k, j)])
        })
    }
}

impl Catalogued for NeoHookean {
    fn read<M>(section: &MaterialSection<M>) -> Result<Self, MaterialError> {
        let (lambda, mu) = section.lame_parameters()?;
        Self::new(lambda, mu)
    }

    fn has_mesh_limit(&self) -> bool {
        true
    }

    fn linearised(&self) -> Option<LameParameters> {
        Some(LameParameters { lambda: self.kappa - 2.0 * self.mu / 3.0, mu: self.mu })
    }

    fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
        Some(Self::new(lambda(self.mu, poisson), self.mu))
    }
}
