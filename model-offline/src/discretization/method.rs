//! The words for discretizations: how the displacement is approximated, the weak form integrated, and essential boundary
//! conditions imposed. Scene files, command lines and studies all take them from here.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Integration rules of the weak form, and finite-element baselines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Deserialize, Serialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
#[value(rename_all = "kebab-case")]
pub enum Integration {
    /// Direct nodal integration: the gradient at the node.
    Dni,
    /// Stabilised conforming nodal integration: the gradient averaged over the nodal cell.
    Scni,
    /// Naturally stabilised nodal integration: direct, plus the gradient's own variation over the cell.
    Nsni,
    /// Gauss points in the triangles of the nodal cells.
    Gauss,
    /// Linear triangles on the same nodes.
    FemT3,
    /// Quadratic triangles on the same nodes.
    FemT6,
}

/// Monomials that the shape functions reproduce exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Deserialize, Serialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// 1, x, y.
    #[default]
    Linear,
    /// 1, x, y, x², xy, y².
    Quadratic,
}

/// How essential boundary conditions are imposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Deserialize, Serialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Essential {
    /// Nodal values are held exactly (the paper's transformation method).
    #[default]
    Transformation,
    /// Nitsche's method: weakly, with consistent boundary terms.
    Nitsche,
}

/// How the displacement is approximated and the weak form integrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// Integration rule.
    pub integration: Integration,
    /// Basis of the shape functions.
    pub basis: Basis,
    /// Kernel support over local spacing.
    pub support: f64,
    /// Whether `nsni` and `gauss` are corrected to be variationally consistent; SCNI and the elements are by nature.
    pub consistent: bool,
}
