//! Guides: run simulations, what is in the simulated world, check timing, inject faults, run the controller on a microcontroller, connect hardware, and what may be relied on.
//!
//! For whoever precomputes tables, and for how it all works with the equations, see [`model_offline::guide`]. Every command
//! line on these pages is run by `cargo test -p host-sim --test commands documentation`, but for those marked in their source.
//! Their pictures show when the pages are read as files, and in the documentation after
//! `cp -r host-sim/pictures target/doc/host_sim/`.

#[doc = include_str!("run_simulations.md")]
pub mod run_simulations {}

#[doc = include_str!("worlds.md")]
pub mod worlds {}

#[doc = include_str!("check_timing.md")]
pub mod check_timing {}

#[doc = include_str!("inject_faults.md")]
pub mod inject_faults {}

#[doc = include_str!("run_on_a_microcontroller.md")]
pub mod run_on_a_microcontroller {}

#[doc = include_str!("connect_hardware.md")]
pub mod connect_hardware {}

#[doc = include_str!("threat_model.md")]
pub mod threat_model {}
