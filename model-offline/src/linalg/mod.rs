//! Sparse symmetric systems of node blocks: pattern, ordering, factorisation.

pub mod cholesky;
pub mod condensation;
pub mod dense;
mod ordering;
pub mod pattern;

pub use cholesky::{SparseCholesky, SymbolicFactor};
pub use condensation::CondensedFactor;
pub use dense::{DenseCholesky, NotPositiveDefinite};
pub use pattern::Pattern;
