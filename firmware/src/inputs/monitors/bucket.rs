//! Events that are too many, whether in a row or not.

use crate::detection::BUCKET_EVENT;

/// Leaky bucket: an event adds [`BUCKET_EVENT`], every sample without one lets 1 run out. It overflows after `limit`
/// events in a row, and sooner or later for every share of events above 1/(1 + [`BUCKET_EVENT`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LeakyBucket {
    level: u32,
}

impl LeakyBucket {
    /// Enters whether an event has happened; returns whether the bucket, which holds `limit` events, is full.
    pub(crate) fn enter(&mut self, happened: bool, limit: u32) -> bool {
        self.level = if happened { self.level.saturating_add(BUCKET_EVENT) } else { self.level.saturating_sub(1) };
        let full = BUCKET_EVENT * limit;
        self.level = self.level.min(full);
        self.level >= full
    }
}
