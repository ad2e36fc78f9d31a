//! Equilibrium: Newton's method with line search and cutback, under constraints on nodal values.

pub mod constrained;
pub mod equilibrium;
