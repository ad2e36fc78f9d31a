//! The controller at the end of a serial line: frames, messages, and the device that answers them.
//!
//! The [device] is ordinary code over the [`device::Board`] trait, so that it is tested on the host; an image
//! for a microcontroller adds nothing but registers. One host, one device, full duplex:
//!
//! ```text
//! host                                     device
//! Hello { session }          ───────────→
//!                            ←───────────  Hello: what it is, why it started
//! Table { offset, bytes } …  ───────────→
//!                            ←───────────  Taken { bytes } …
//! Begin { settings, clock }  ───────────→  the table is checked as a file would be
//!                            ←───────────  Ready, or Refused: why
//! Needle, Paddle, Target     ───────────→
//! Time { tick, time_ns }     ───────────→  one step
//!                            ←───────────  Command { command, counts }
//! Account                    ───────────→
//!                            ←───────────  Account: ledger, line, stack
//! Hello { session }          ───────────→  ends this run, and no other
//! ```

pub mod device;
pub mod frame;
pub mod message;

pub use device::{Board, Memory, serve};
pub use frame::{Frame, FrameReader, FrameWriter, LineLedger};
pub use message::{Account, ClockSource, Identity, Refusal, Reply, Request, ResetCause};
