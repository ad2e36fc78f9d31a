//! Files of other tools for bodies in space: surfaces (STL, OBJ, PLY), tetrahedra (Gmsh, VTU) and segmentations (NIfTI,
//! NRRD).
//!
//! Readers take bytes, so that they can be tried on any; [`surface()`], [`mesh()`] and [`labels()`] read files and put
//! their names before what is wrong. Every reader is total: any bytes give a value or a typed error, and nothing is allocated by a
//! number that merely stands in a header.

mod arrays;
mod bytes;
mod error;
mod file;
pub mod msh;
pub mod nifti;
pub mod nrrd;
pub mod obj;
pub mod ply;
mod polygons;
pub mod stl;
pub mod tetrahedra;
mod voxels;
pub mod vtu;
mod words;

pub use error::{FileError, Noted, Place, ReadError};
pub use file::{bytes, labels, mesh, surface};
pub use nifti::write_nifti;

#[cfg(test)]
mod tests;
