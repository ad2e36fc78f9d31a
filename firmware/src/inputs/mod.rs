//! What comes from outside, and whether to believe it: streams, checks and monitors of single streams, the supervisor
//! that draws the conclusion, and the accounts.

use crate::contract::frames::MAX_PADDLES;
use crate::contract::{NeedleSample, PaddleSample, TargetSample};

pub(crate) mod checks;
pub mod ledger;
pub(crate) mod monitors;
pub(crate) mod sample;
pub mod sequence;
pub(crate) mod stream;
pub(crate) mod supervisor;
#[cfg(test)]
mod tests;

pub use ledger::{Discard, Ledger, StreamLedger, TickLedger};
pub use sequence::{Arrival, SequenceTracker};

/// What arrived since the previous tick: the newest sample of each stream, or `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Number of this release since the start; skipped releases leave gaps.
    pub tick: u64,
    /// Time of this tick on the clock that stamps the samples, ns.
    pub time_ns: u64,
    /// Newest needle sample.
    pub needle: Option<NeedleSample>,
    /// Newest target sample.
    pub target: Option<TargetSample>,
    /// Newest sample of each paddle, in the order of the table. What stands in a place without a paddle is not read.
    pub paddles: [Option<PaddleSample>; MAX_PADDLES],
}
