//! From a body to integration points: nodes, kernel, moment matrix, shape functions Ψ_I, nodal cells and the rules
//! that integrate the weak form.
//!
//! The reproducing kernel particle method writes the displacement as `u(X) = Σ_I Ψ_I(X) d_I` with
//! `Ψ_I(X) = Hᵀ(0) M⁻¹(X) H(X − X_I) φ_a(X − X_I)`. The d_I are *coefficients*, not displacements: Ψ_I(X_J) ≠ δ_IJ.
//! Everything here is written for D dimensions; only the construction of nodes and cells is planar.

pub mod approximation;
pub mod boundary;
pub mod cells;
pub mod meshing;
pub mod method;
pub mod nodes;
pub mod planar;
pub mod quadrature;
pub mod spatial;
pub mod tetrahedra;

pub use approximation::node_cloud::NodeCloud;
pub use approximation::shape_functions::{ShapeError, ShapeFunctions, Stencil, Wanted};
pub use cells::nodal_cells::NodalCell;
pub use meshing::TetMesh;
pub use method::{Basis, Consistency, Discretization, Essential, Integration, Method, Resolution};
pub use nodes::features::Features;
pub use planar::{DiscretizationError, Planar};
pub use quadrature::integration::Quadrature;
pub use spatial::{Spatial, SpatialError};
