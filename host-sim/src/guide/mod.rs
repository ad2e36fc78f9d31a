//! Guides: run simulations, and check timing.
//!
//! For whoever precomputes tables, and for how it all works with the equations, see [`model_offline::guide`]. Every command
//! line on these pages is run by `cargo test -p host-sim --test documentation`.

#[doc = include_str!("run_simulations.md")]
pub mod run_simulations {}

#[doc = include_str!("check_timing.md")]
pub mod check_timing {}
