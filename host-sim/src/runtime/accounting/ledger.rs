//! Accounts of samples, commands and ticks over both sides of the loop.

use firmware::Discard;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::runtime::names;

/// All accounts of one run of the controller.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LedgerResult {
    /// Needle samples.
    pub needle: StreamResult,
    /// Target samples.
    pub target: StreamResult,
    /// Samples of the only or the first paddle.
    pub paddle: StreamResult,
    /// Samples of the second paddle, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_paddle: Option<StreamResult>,
    /// Commands.
    pub command: StreamResult,
    /// Ticks.
    pub ticks: TickResult,
    /// Ticks that the controller ran and had no room for in its record: they are in no recording and no replay.
    #[serde(default)]
    pub not_recorded: u64,
    /// Sum of everything without an entry: 0.
    pub unaccounted: u64,
}

/// One stream: published = consumed + overwritten + discarded + in flight.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct StreamResult {
    /// Counted by the sender.
    pub published: u64,
    /// Used by the receiver.
    pub consumed: u64,
    /// Replaced by a newer one before anybody looked.
    pub overwritten: u64,
    /// Looked at and refused.
    pub discarded: u64,
    /// Refusals by reason, those that occurred.
    #[serde(with = "names::discards")]
    #[schemars(with = "Vec<(String, u64)>")]
    pub discarded_for: Vec<(Discard, u64)>,
    /// Published, and not looked at any more when the receiver stopped.
    pub in_flight: u64,
    /// Publications without an entry: 0.
    pub unaccounted: u64,
}

/// Ticks: due = RUN + HOLD + SAFE + skipped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct TickResult {
    /// Came due.
    pub due: u64,
    /// Ended in RUN.
    pub run: u64,
    /// Ended in HOLD.
    pub hold: u64,
    /// Ended in SAFE.
    pub safe: u64,
    /// Never started.
    pub skipped: u64,
    /// Due ticks without an entry: 0.
    pub unaccounted: u64,
}
