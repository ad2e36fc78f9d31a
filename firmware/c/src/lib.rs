//! The controller of [`firmware`] for C and C++: the archive `libstillpoint.a` and the header `include/stillpoint.h`.
//!
//! Nothing is allocated: a controller lives in memory that the caller gives. Nothing is printed, no file is read, no
//! clock is asked. The steps are those of [`firmware::Controller`] in `f64`, bit by bit.
//!
//! ```text
//! stillpoint_init         memory of the caller  → a controller without a table
//! stillpoint_load_table   bytes of a table file → checked, decoded
//! stillpoint_configure    settings              → ready
//! stillpoint_step         samples of a tick     → command        once per period
//! stillpoint_rearm        leaves SAFE, after somebody has looked
//! stillpoint_release      the memory is the caller's again
//! ```
//!
//! The controller itself has no `unsafe`; here it is needed to follow the pointers that C gives, and stands in
//! [`memory`], `instance` and the functions of [`api`] alone. Every pointer is checked for null and alignment, every
//! length, and every number that chooses something; what cannot be checked (that a pointer leads to memory at all) is
//! told in the header. No panic can be reached: `tests/bare_metal.rs` links the archive and looks for the handler.
//!
//! # Modules
//! In the order of use; each uses only those above it:
//!
//! 1. [`status`]: what a function returns, with a text for each.
//! 2. [`types`]: plain structs of samples, settings and commands, and their constants.
//! 3. [`memory`]: pointers of the caller, checked. `text`: words into a buffer of the caller.
//! 4. `instance`: a controller in the caller's memory.
//! 5. [`api`]: the exported functions.
#![no_std]
#![deny(missing_docs)]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

// For its panic handler, which a program of a host needs: it aborts at the border to C.
#[cfg(not(target_os = "none"))]
extern crate std;

pub mod status;

pub mod faults;
pub mod types;

mod convert;
pub mod memory;
mod text;

mod instance;

pub mod api;

#[cfg(target_os = "none")]
mod panic;

pub use instance::Stillpoint;
pub use status::StillpointStatus;
