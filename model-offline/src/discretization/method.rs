//! The words for discretizations: where the nodes are, how the displacement is approximated, the weak form integrated, and
//! essential boundary conditions imposed. Scene files, command lines and studies all take them from here.
//!
//! What an option is called in files, on the command line and in reports comes from one list, the enum itself.

use crate::choice::choice;
use serde::Serialize;

choice! {
    /// Integration rules of the weak form, and finite-element baselines.
    ///
    /// # Example
    /// ```
    /// use model_offline::discretization::Integration;
    /// use strum::VariantArray as _;
    ///
    /// assert_eq!("fem-t6".parse(), Ok(Integration::FemT6));
    /// assert_eq!(Integration::Scni.to_string(), "scni");
    /// assert!(Integration::VARIANTS.contains(&Integration::Nsni));
    /// ```
    #[derive(Default)]
    pub enum Integration {
        /// Direct nodal integration: the gradient at the node.
        Dni,
        /// Stabilised conforming nodal integration: the gradient averaged over the nodal cell.
        Scni,
        /// SCNI with the variation of the gradient inside the nodal cell given energy by a constant matrix: as cheap, and
        /// without modes that no interior cell feels. The default.
        #[default]
        ScniStabilised,
        /// Modified SCNI: the law in every node–edge triangle of the nodal cells.
        Mscni,
        /// Naturally stabilised nodal integration: direct, plus the gradient's own variation over the cell.
        Nsni,
        /// Gauss points in the triangles of the nodal cells.
        Gauss,
        /// Linear triangles on the same nodes.
        FemT3,
        /// Quadratic triangles on the same nodes.
        FemT6,
        /// Linear tetrahedra, in space.
        FemT4,
        /// Quadratic tetrahedra, in space.
        FemT10,
    }
}

impl Integration {
    /// The rules of the plane.
    pub const PLANAR: &[Self] =
        &[Self::Dni, Self::Scni, Self::ScniStabilised, Self::Mscni, Self::Nsni, Self::Gauss, Self::FemT3, Self::FemT6];
    /// The rules of space.
    pub const SPATIAL: &[Self] = &[Self::Dni, Self::Scni, Self::ScniStabilised, Self::Mscni, Self::FemT4, Self::FemT10];

    /// Whether it is a finite-element baseline: basis and support do not apply.
    pub fn is_element(self) -> bool {
        matches!(self, Self::FemT3 | Self::FemT6 | Self::FemT4 | Self::FemT10)
    }

    /// The same in space, where nodal cells are the duals of tetrahedra and the farthest neighbour is that along the longest
    /// edge: 1.2 leaves less error than 1.49 (block, 4,268 nodes: 7.0 against 8.6 %), with two thirds of the pairs.
    pub fn default_support_in_space(self) -> f64 {
        match self {
            Self::ScniStabilised | Self::Mscni => 1.2,
            _ => 2.0,
        }
    }

    /// Whether it integrates over nodal cells.
    pub fn is_nodal(self) -> bool {
        matches!(self, Self::Dni | Self::Scni | Self::ScniStabilised | Self::Mscni | Self::Nsni)
    }

    /// Kernel support over local spacing where none is given: the smallest that is safe for the stabilised rules (stencils
    /// of 5 × 5 nodes on a lattice), the paper's for the others.
    pub fn default_support(self) -> f64 {
        match self {
            Self::ScniStabilised | Self::Mscni => 1.49,
            _ => 2.0,
        }
    }
}

choice! {
    /// Monomials that the shape functions reproduce exactly.
    #[derive(Default)]
    pub enum Basis {
        /// 1, x, y.
        #[default]
        Linear,
        /// 1, x, y, x², xy, y².
        Quadratic,
    }
}

choice! {
    /// How essential boundary conditions are imposed.
    #[derive(Default)]
    pub enum Essential {
        /// Nodal values are prescribed exactly (the paper's transformation method).
        #[default]
        Transformation,
        /// Nitsche's method: weakly, with consistent boundary terms.
        Nitsche,
    }
}

/// Whether the mean gradient of a rule over a cell is that of its boundary.
///
/// The weak form of a constant stress is ∮ Ψ_I n dΓ, so that only such a rule passes the patch test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Consistency {
    /// As the gradients are at the points.
    Uncorrected,
    /// Shifted to the boundary average over the cell: variationally consistent to first order.
    Corrected,
}

/// How the displacement is approximated and the weak form integrated, wherever the nodes are.
///
/// # Example
/// ```
/// use model_offline::discretization::{Basis, Consistency, Integration, Method};
///
/// let method = Method { basis: Basis::Quadratic, support: 3.0, ..Method::new(Integration::Gauss) };
/// assert_eq!(method.consistency, Consistency::Corrected);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// Integration rule.
    pub integration: Integration,
    /// Basis of the shape functions.
    pub basis: Basis,
    /// Kernel support over local spacing.
    pub support: f64,
    /// Whether `nsni` and `gauss` pass the patch test; SCNI and the elements do by nature.
    pub consistency: Consistency,
}

impl Method {
    /// A rule with a linear basis and its default support.
    pub fn new(integration: Integration) -> Self {
        Self {
            integration,
            basis: Basis::Linear,
            support: integration.default_support(),
            consistency: Consistency::Corrected,
        }
    }

    /// Basis of the displacement itself: that of quadratic triangles is quadratic whatever the shape functions' is.
    pub fn displacement_basis(&self) -> Basis {
        match self.integration {
            Integration::FemT3 | Integration::FemT4 => Basis::Linear,
            Integration::FemT6 | Integration::FemT10 => Basis::Quadratic,
            _ => self.basis,
        }
    }
}

/// How many nodes: given, or found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// Uniform node spacing, length units.
    Spacing(f64),
    /// Refine until the controllability measures are within this relative error.
    Tolerance(f64),
    /// Nodes gathered where the solution is singular, at this refinement level.
    Level(i32),
}

impl Resolution {
    /// Half the error, or so.
    #[must_use]
    pub fn finer(self) -> Self {
        match self {
            Self::Spacing(h) => Self::Spacing(0.5 * h),
            Self::Tolerance(t) => Self::Tolerance(0.5 * t),
            Self::Level(level) => Self::Level(level + 1),
        }
    }

    /// Twice the error, or so.
    #[must_use]
    pub fn coarser(self) -> Self {
        match self {
            Self::Spacing(h) => Self::Spacing(2.0 * h),
            Self::Tolerance(t) => Self::Tolerance(2.0 * t),
            Self::Level(level) => Self::Level(level - 1),
        }
    }

    /// Whether nodes gather where the solution is singular.
    pub fn is_graded(self) -> bool {
        !matches!(self, Self::Spacing(_))
    }
}

impl std::fmt::Display for Resolution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Spacing(h) => write!(f, "uniform {h:.4}"),
            Self::Tolerance(t) => write!(f, "tolerance {t}"),
            Self::Level(level) => write!(f, "graded level {level}"),
        }
    }
}

/// A whole discretization: how many nodes, by which method, with which essential boundary conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Discretization {
    /// How many nodes.
    pub resolution: Resolution,
    /// How the displacement is approximated and the weak form integrated.
    pub method: Method,
    /// How essential boundary conditions are imposed.
    pub essential: Essential,
}

impl Discretization {
    /// A method at a resolution, essential boundary conditions imposed exactly.
    pub fn new(resolution: Resolution, method: Method) -> Self {
        Self { resolution, method, essential: Essential::Transformation }
    }

    /// Another method at another resolution, with the same essential boundary conditions.
    #[must_use]
    pub fn with(&self, resolution: Resolution, method: Method) -> Self {
        Self { resolution, method, ..*self }
    }

    /// Support and basis where they apply, nodes: the settings in a few words.
    pub fn settings(&self) -> String {
        let Method { integration, basis, support, .. } = self.method;
        if integration.is_element() {
            self.resolution.to_string()
        } else {
            format!("{basis} basis, support {support}, {}", self.resolution)
        }
    }
}

/// Integration rule and settings.
impl std::fmt::Display for Discretization {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, {}", self.method.integration, self.settings())
    }
}
