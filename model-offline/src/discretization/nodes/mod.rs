//! Where the nodes are: on a lattice, or gathered where the solution is singular.

pub mod bisection;
pub mod features;
pub mod graded;
pub mod lattice;
pub mod sizing;
