//! How the weak form is integrated: points with weights and gradients, by every rule.

pub mod finite_element;
pub mod integration;
pub mod subcells;
