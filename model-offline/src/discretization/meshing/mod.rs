//! Tetrahedral meshes: isosurface stuffing of a graded lattice, fitted to surfaces, sharp edges, rims and interfaces.

mod alignment;
mod collapse;
mod complex;
mod cutting;
mod features;
pub mod grading;
mod improvement;
mod lattice;
pub mod mesh;
mod octree;
pub(crate) mod quality;
mod reconnection;
pub mod request;
pub mod rims;
pub mod stuffing;

#[cfg(test)]
mod tests;

pub use grading::Grading;
pub use mesh::{Quality, TetMesh};
pub use request::{Request, Sizes};
pub use rims::{feature_points, patch_triangles, rim_points, surface_points};
pub use stuffing::{StuffingError, stuff};
