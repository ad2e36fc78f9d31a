//! Lamé's parameters, and how Poisson's ratio joins them.

/// λ and μ of an isotropic law at small strain, stress units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LameParameters {
    pub(super) lambda: f64,
    pub(super) mu: f64,
}

/// λ = 2μν/(1 − 2ν).
pub(super) fn lambda(mu: f64, poisson: f64) -> f64 {
    2.0 * mu * poisson / (1.0 - 2.0 * poisson)
}
