//! Sparse symmetric systems of node blocks: pattern, ordering, factorisation.

pub mod cholesky;
mod ordering;
pub mod pattern;

pub use cholesky::{NotPositiveDefinite, SparseCholesky, SymbolicFactor};
pub use pattern::Pattern;
