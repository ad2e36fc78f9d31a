//! Bodies in space: tetrahedra, their finite elements, and the nodal cells dual to them.

pub mod dual_cells;
pub mod elements;
pub mod geometry;
pub mod shape;

pub use elements::TetElements;
