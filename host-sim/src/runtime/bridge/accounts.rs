//! What went over a bridge.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What `bridge --json` writes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BridgeResult {
    /// Samples taken and published to the controller: of the needle, the target, and each paddle in the order of its table.
    pub taken: BTreeMap<String, u64>,
    /// Datagrams of the rig that never came, by the gaps in their numbers.
    pub missing: u64,
    /// Datagrams that were not obeyed, by reason.
    pub refused: BTreeMap<String, u64>,
    /// Commands of the controller that were sent on.
    pub commands: u64,
    /// Valid ones among them that had waited for more than 0.1 s, because the bridge was stopped: they went without VALID.
    pub expired: u64,
    /// Datagrams that the operating system did not take for sending.
    pub not_sent: u64,
    /// Commands of the bridge's own without VALID: while the controller was silent, and at the end.
    pub own_commands: u64,
    /// Largest time from the start of a controller's tick to the sending of its command, ns; none without a command.
    pub largest_delay_ns: Option<u64>,
    /// Why it ended, if it was not for its time.
    pub ended: Option<String>,
}

impl BridgeResult {
    /// One line for a person.
    pub fn summary(&self) -> String {
        let list = |counts: &BTreeMap<String, u64>| {
            let shown: Vec<_> = counts.iter().map(|(name, count)| format!("{count} {name}")).collect();
            if shown.is_empty() { "none".to_owned() } else { shown.join(", ") }
        };
        let delay = self.largest_delay_ns.map_or("none".to_owned(), |ns| format!("{:.3} ms", ns as f64 * 1e-6));
        format!(
            "samples taken: {}; missing: {}; refused: {}; commands sent: {}, {} of them expired, and {} of the bridge's own, not sent: {}; \
             largest delay from a tick to the sending of its command: {delay}",
            list(&self.taken),
            self.missing,
            list(&self.refused),
            self.commands,
            self.expired,
            self.own_commands,
            self.not_sent
        )
    }
}
