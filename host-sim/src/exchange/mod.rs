//! What goes between plant and controller: in shared memory five publish–subscribe services of iceoryx2, six with a second paddle, and nothing else,
//! the serial line to a controller on a [`board`], and the datagrams to sensors and actuators outside ([`udp`]).
//!
//! | service | from | to | when |
//! |---|---|---|---|
//! | `needle`, `paddle`, `second-paddle` | plant | controller | at loop rate |
//! | `target` | plant | controller | at the sensor's own rate, late by its latency |
//! | `clock` | plant | controller | lockstep: every tick; free-run: start and stop |
//! | `command` | controller | plant | one per tick |
//!
//! Everything is generic over the service variant: `ipc::Service` between processes, `local::Service` in tests.

pub mod board;
pub mod bytes;
mod error;
mod ports;
mod space;
mod stream;
pub mod udp;
mod wire;

pub use error::LinkError;
pub use ports::{ControllerPorts, PlantPorts, ReceiveCounts};
pub use space::{Departure, Space, sweep};
pub use stream::{Receiver, Sender};
pub use wire::{ClockFrame, ClockKind, Wire, WireFrame};

#[cfg(test)]
mod tests;
