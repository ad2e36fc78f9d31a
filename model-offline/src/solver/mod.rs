//! Equilibrium: sparse linear algebra, held nodal values, Newton's method with cutback and line search.

pub mod constrained;
pub mod equilibrium;
pub mod linear;
mod ordering;
