//! Kinematics, materials, and the assembly of internal force and tangent stiffness.

pub mod assembly;
pub mod material;
pub mod nitsche;
pub use assembly::Tissue;

pub use material::{FungTensors, Material, MaterialError};
