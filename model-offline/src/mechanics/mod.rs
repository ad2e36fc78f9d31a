//! Internal force and tangent stiffness of a body, and the essential boundary conditions on it.

pub mod assembly;
pub mod blocks;
pub mod constraints;
pub mod history;
pub mod nitsche;
pub mod stabilisation;
pub mod tissue;

pub use constraints::{ConstrainedRows, Constraints, WeaklyImposed};
pub use tissue::Tissue;
