//! From a body to integration points: nodes, kernel, moment matrix, shape functions Ψ_I, nodal cells and the rules
//! that integrate the weak form.
//!
//! The reproducing kernel particle method writes the displacement as `u(X) = Σ_I Ψ_I(X) d_I` with
//! `Ψ_I(X) = Hᵀ(0) M⁻¹(X) H(X − X_I) φ_a(X − X_I)`. The d_I are *coefficients*, not displacements: Ψ_I(X_J) ≠ δ_IJ.
//! Everything here is written for D dimensions; only the construction of nodes and cells is planar.

pub mod bisection;
pub mod boundary;
mod cell_loops;
pub mod features;
pub mod finite_element;
pub mod graded;
pub mod integration;
pub mod kernel;
pub mod lattice;
pub mod method;
pub mod nodal_cells;
pub mod node_cloud;
pub mod planar;
pub mod shape_functions;
pub mod sight;
pub mod subcells;
pub mod triangulation;

pub use features::Features;
pub use integration::Quadrature;
pub use method::{Basis, Consistency, Discretization, Essential, Integration, Method, Resolution};
pub use nodal_cells::NodalCell;
pub use node_cloud::NodeCloud;
pub use planar::{DiscretizationError, Planar};
pub use shape_functions::{ShapeError, ShapeFunctions, Stencil, Wanted};
