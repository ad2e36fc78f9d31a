//! The controller as firmware: a device at the end of a serial line, usually a Cortex-M7 in QEMU.
//!
//! ```text
//! plant ── shared memory ── bridge ── serial line ── image on a Cortex-M7: firmware::serial::serve
//! ```
//!
//! The [bridge](Device) takes the controller's place on the link in shared memory and passes every sample and
//! every command on; time comes from the messages. [`crate::bench::board`] counts the instructions of the image's steps and holds
//! them against a budget.

pub mod device;
pub mod error;
pub mod image;
pub mod line;
pub mod qemu;
pub mod tamper;

pub use device::{Answer, Device};
pub use error::BoardError;
pub use image::{Control, Image, Processor};
pub use line::SerialLine;
pub use qemu::Qemu;
