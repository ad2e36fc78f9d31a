//! Sensors and actuators outside, by UDP: one [`Datagram`] is one sample, one command, or the bridge's Hello.
//!
//! The layout byte by byte is in [connect hardware](crate::guide::connect_hardware), for programs in other languages.

pub mod datagram;
mod error;
pub mod refusal;
mod socket;

pub use datagram::{Datagram, Hello, Message};
pub use error::UdpError;
pub use refusal::Refusal;
pub use socket::{Addresses, Socket};
