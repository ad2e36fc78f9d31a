//! Sparse symmetric systems of node blocks: pattern, ordering, factorisation.

pub mod cholesky;
pub mod condensation;
mod ordering;
pub mod pattern;

pub use cholesky::{NotPositiveDefinite, SparseCholesky, SymbolicFactor};
pub use condensation::CondensedFactor;
pub use pattern::Pattern;
