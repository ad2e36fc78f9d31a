//! Equilibrium: Newton's method with line search and cutback, under constraints on nodal values.

pub mod analysis;
mod conjugate_gradients;
pub mod constrained;
pub mod equilibrium;
