//! Fung's exponential law in isotropic form.

use super::catalogue::Catalogued;
use super::error::{MaterialError, finite, not_negative};
use super::kinematics::{Matrix, Tensor4, green_lagrange, tensor4};
use super::lame::{LameParameters, lambda};
use super::material::{Material, Response};
use super::section::{MaterialSection, required, unused};
use serde::Serialize;

/// `W = ½ [λ (tr E)² + 2μ E:E] + (c/2) (exp[λc (tr E)² + 2μc E:E] − 1)`: the paper's equation 6, its Table I summed over a
/// symmetric strain, counted from rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Fung {
    lambda: f64,
    mu: f64,
    c: f64,
    lambda_c: f64,
    mu_c: f64,
}

impl Fung {
    pub(super) fn new(lambda: f64, mu: f64, c: f64, lambda_c: f64, mu_c: f64) -> Result<Self, MaterialError> {
        let law = Self {
            lambda: finite(lambda, "lambda")?,
            mu: finite(mu, "mu")?,
            c: not_negative(c, "c")?,
            lambda_c: not_negative(lambda_c, "lambda_c")?,
            mu_c: not_negative(mu_c, "mu_c")?,
        };
        Material::<3>::check_stable_at_rest(&law)?;
        Ok(law)
    }
}

impl<const D: usize> Material<D> for Fung {
    fn respond(&self, h: &Matrix<D>) -> Response<D> {
        let Self { lambda, mu, c, lambda_c, mu_c } = *self;
        let f = Matrix::<D>::identity() + h;
        let e = green_lagrange(h);
        let (trace, square) = (e.trace(), e.norm_squared());
        let exponential = c * (lambda_c * trace * trace + 2.0 * mu_c * square).exp();
        let pk2 = Matrix::<D>::identity() * (trace * (lambda + exponential * lambda_c))
            + e * (2.0 * (mu + exponential * mu_c));
        // The energy is counted from rest: (c/2)(e^Q − 1), so that it is exactly 0 there.
        let energy = 0.5 * lambda * trace * trace + mu * square + 0.5 * (exponential - c);
        Response { energy, pk1_stress: f * pk2 }
    }

    fn tangent(&self, h: &Matrix<D>) -> Tensor4<D> {
        let Self { lambda, mu, c, lambda_c, mu_c } = *self;
        let f = Matrix::<D>::identity() + h;
        let e = green_lagrange(h);
        let (trace, square) = (e.trace(), e.norm_squared());
        let exponential = c * (lambda_c * trace * trace + 2.0 * mu_c * square).exp();
        let (l, m) = (lambda + exponential * lambda_c, mu + exponential * mu_c);
        let identity = Matrix::<D>::identity();
        // ∂Q/∂E = 2 g, and the exponential's own growth adds 2 g ⊗ g.
        let g = identity * (lambda_c * trace) + e * (2.0 * mu_c);
        let pk2 = identity * (l * trace) + e * (2.0 * m);
        // F C F for C = l I⊗I + 2m 𝕀 + 2 e^Q g⊗g, written out: no fourth-order product.
        let (fg, ff) = (f * g, f * f.transpose());
        tensor4(|i, j, k, n| {
            let geometric = if i == k { pk2[(j, n)] } else { 0.0 };
            let shear = if j == n { ff[(i, k)] } else { 0.0 };
            geometric
                + l * f[(i, j)] * f[(k, n)]
                + m * (shear + f[(i, n)] * f[(k, j)])
                + 2.0 * exponential * fg[(i, j)] * fg[(k, n)]
        })
    }
}

impl Catalogued for Fung {
    fn read<M>(section: &MaterialSection<M>) -> Result<Self, MaterialError> {
        unused(&[("C without A", section.c_tensor.is_some())])?;
        let c = section.c.unwrap_or(0.0);
        let (lambda_c, mu_c) = if c == 0.0 {
            (section.lambda_c.unwrap_or(0.0), section.mu_c.unwrap_or(0.0))
        } else {
            (required(section.lambda_c, "lambda_c")?, required(section.mu_c, "mu_c")?)
        };
        Self::new(required(section.lambda, "lambda")?, required(section.mu, "mu")?, c, lambda_c, mu_c)
    }

    fn linearised(&self) -> Option<LameParameters> {
        Some(LameParameters { lambda: self.lambda + self.c * self.lambda_c, mu: self.mu + self.c * self.mu_c })
    }

    fn with_exponential_factor(&self, c: f64) -> Option<Result<Self, MaterialError>> {
        Some(Self::new(self.lambda, self.mu, c, self.lambda_c, self.mu_c))
    }

    fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
        let lambda = lambda(self.mu, poisson);
        Some(Self::new(lambda, self.mu, self.c, self.lambda_c, self.mu_c))
    }
}
