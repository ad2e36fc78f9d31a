//! Tissue model, paddle placement and controller tables.
pub mod cli;
pub mod discretization;
pub mod mechanics;
pub mod output;
pub mod placement;
pub mod scene;
pub mod solver;
