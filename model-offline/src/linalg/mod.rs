//! Sparse symmetric systems of node blocks: pattern, ordering, factorisation.

pub mod cholesky;
pub mod condensation;
pub mod dense;
pub mod memory;
pub mod mixed;
mod ordering;
mod packing;
pub mod pattern;
pub mod singular;

pub use cholesky::{SparseCholesky, SymbolicFactor};
pub use condensation::CondensedFactor;
pub use dense::{DenseCholesky, NotPositiveDefinite};
pub use memory::NotEnoughMemory;
pub(crate) use memory::room;
pub use mixed::{MixedCholesky, Unfactorised};
pub use pattern::Pattern;
pub use singular::SingularValues;
