//! The live view: a page on loopback that shows the simulation while it runs, and knobs for the next insertion.
//!
//! ```text
//! loop ──(try_lock, at most 30 times a second)──→ newest snapshot ←── view threads ──→ browsers
//! loop ←──────────────(atomics, between ticks of lockstep)────────── pause, step, pace, knobs
//! ```
//!
//! The loop copies a few kilobytes of coefficients when a picture is due and nobody holds the snapshot, and never
//! waits; solving for the picture's nodes, JSON and sockets belong to threads of their own. In free-run nothing
//! reaches back into the loop; in lockstep, where no clock is in the record, the page may hold time between two ticks.

#[cfg(test)]
mod attacks;
mod body;
mod events;
#[cfg(feature = "foxglove")]
mod foxglove;
mod insertions;
mod limits;
mod page;
mod requests;
mod server;
mod shared;
mod watch;

pub use insertions::{InsertionBasis, insertions, insertions_in_space};
pub use server::View;
pub use shared::{KnobOutOfRange, Knobs};
