//! A law as a scene file gives it.

use super::error::MaterialError;
use super::preset::Preset;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One entry `[i, j, k, l, value]` of a fourth-order tensor, indices from 0, as in the paper's Table I.
pub type TensorEntry = (u32, u32, u32, u32, f64);

/// What tissue is made of: a preset, whose numbers the keys beside it replace, or a law. A law has either the isotropic moduli or,
/// for `fung`, the general tensors `A` and `C`.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "MaterialSection")]
pub struct MaterialSection<M> {
    /// A material by name, where the unit of stress is known; every key beside it replaces the preset's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Which law; needed without a preset. Another than the preset's takes its moduli at rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<M>,
    /// First Lamé parameter λ, stress units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lambda: Option<f64>,
    /// Shear modulus μ, stress units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mu: Option<f64>,
    /// Factor c of Fung's exponential term, stress units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c: Option<f64>,
    /// λ of the exponent, dimensionless.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lambda_c: Option<f64>,
    /// μ of the exponent, dimensionless.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mu_c: Option<f64>,
    /// General form: entries [i, j, k, l, value] of A, stress units.
    #[serde(rename = "A", skip_serializing_if = "Option::is_none")]
    pub a: Option<Vec<TensorEntry>>,
    /// General form: entries [i, j, k, l, value] of C, dimensionless.
    #[serde(rename = "C", skip_serializing_if = "Option::is_none")]
    pub c_tensor: Option<Vec<TensorEntry>>,
    /// Volumetric barrier β, stress units: adds β (ln J)⁴ / 4, felt only under strong volume change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub barrier: Option<f64>,
    /// Stress relaxation (default: the preset's, else none; without terms: none).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relaxation: Option<RelaxationSection>,
}

/// A Prony series `G(t) = 1 − Σ g (1 − e^(−t/tau))` on all moduli, which are then those of a fast deformation.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelaxationSection {
    /// Shares of the stress that decay, each positive, their sum below 1.
    pub g: Vec<f64>,
    /// Their times, seconds.
    pub tau: Vec<f64>,
}

impl<M> MaterialSection<M> {
    /// λ and μ, for a law that has no other modulus.
    pub(super) fn lame_parameters(&self) -> Result<(f64, f64), MaterialError> {
        unused(&[
            ("c", self.c.is_some()),
            ("lambda_c", self.lambda_c.is_some()),
            ("mu_c", self.mu_c.is_some()),
            ("A", self.a.is_some()),
            ("C", self.c_tensor.is_some()),
        ])?;
        Ok((required(self.lambda, "lambda")?, required(self.mu, "mu")?))
    }
}

/// A modulus that the law cannot do without.
pub(super) fn required(value: Option<f64>, name: &'static str) -> Result<f64, MaterialError> {
    value.ok_or(MaterialError::Missing(name))
}

/// Refuses the first key that is given.
pub(super) fn unused(keys: &[(&'static str, bool)]) -> Result<(), MaterialError> {
    match keys.iter().find(|(_, given)| *given) {
        Some((key, _)) => Err(MaterialError::Meaningless(key)),
        None => Ok(()),
    }
}
