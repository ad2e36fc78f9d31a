//! Sequence numbers that wrap: what is new, late, or a duplicate.

use super::ledger::{Discard, StreamLedger};

/// How far back a late sample is still told from a duplicate.
const WINDOW: u32 = u64::BITS;

/// So many numbers within the window of the newest one are no damage to it: they are where the sender is.
const NO_ACCIDENT: u32 = 8;

/// What a sequence number says about a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Newer than all before it.
    New,
    /// Arrives after a newer one.
    Late,
    /// Has arrived before.
    Duplicate,
    /// Older than the window, or than the first one ever seen: cannot be told.
    Stray,
}

/// Remembers the newest sequence number and which of the 64 before it have arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SequenceTracker {
    newest: Option<u32>,
    /// Bit i: the sample `newest − i` has arrived.
    arrived: u64,
    /// Sequence numbers from the first one seen to the newest, at most the window: older ones are in no account.
    known: u32,
}

impl SequenceTracker {
    /// A tracker before the first delivery.
    pub const fn new() -> Self {
        Self { newest: None, arrived: 0, known: 0 }
    }

    /// Newest sequence number seen.
    pub const fn newest(&self) -> Option<u32> {
        self.newest
    }

    /// Classifies a delivery and enters everything but its fate if it is new into the ledger.
    pub(crate) fn register(&mut self, sequence: u32, ledger: &mut StreamLedger) -> Arrival {
        let Some(newest) = self.newest else {
            self.restart(sequence, ledger);
            return Arrival::New;
        };
        if self.behind(sequence).is_none() {
            let ahead = sequence.wrapping_sub(newest);
            self.newest = Some(sequence);
            self.arrived = self.arrived.checked_shl(ahead).unwrap_or(0) | 1;
            self.known = self.known.saturating_add(ahead).min(WINDOW);
            ledger.published += u64::from(ahead);
            ledger.lost += u64::from(ahead - 1);
            return Arrival::New;
        }
        self.enter_old(sequence, ledger)
    }

    /// Enters the number that follows the newest one, as [`Self::register`] would; any other changes nothing.
    pub(crate) fn advance(&mut self, sequence: u32, ledger: &mut StreamLedger) -> bool {
        let follows = self.newest.is_some_and(|newest| sequence == newest.wrapping_add(1));
        if follows {
            self.newest = Some(sequence);
            self.arrived = self.arrived << 1 | 1;
            self.known += u32::from(self.known < WINDOW);
            ledger.published += 1;
        }
        follows
    }

    /// A delivery `behind` the newest: late if it fills a gap, which it then does.
    fn fill(&mut self, behind: u32, ledger: &mut StreamLedger) -> Arrival {
        if behind >= self.known {
            return Arrival::Stray;
        }
        let bit = 1u64 << behind;
        if self.arrived & bit != 0 || ledger.lost == 0 {
            return Arrival::Duplicate;
        }
        self.arrived |= bit;
        ledger.lost -= 1;
        Arrival::Late
    }

    /// How far a number lies behind the newest; none ahead of it. Half of the range lies ahead, half behind, so that ages stay
    /// right when the counter wraps; the number right across is behind.
    fn behind(&self, sequence: u32) -> Option<u32> {
        let behind = self.newest?.wrapping_sub(sequence);
        (behind <= u32::MAX / 2 + 1).then_some(behind)
    }

    /// Whether a number lies behind everything that is remembered.
    pub(crate) fn is_forgotten(&self, sequence: u32) -> bool {
        self.behind(sequence).is_some_and(|behind| behind >= WINDOW)
    }

    /// Enters the number of a sample that follows the accepted ones, which it may do in a gap that a refused one has
    /// left; `false` for one that has arrived before.
    pub(crate) fn enter(&mut self, sequence: u32, ledger: &mut StreamLedger) -> bool {
        let Some(behind) = self.behind(sequence) else {
            self.register(sequence, ledger);
            return true;
        };
        if behind < WINDOW {
            let arrival = self.fill(behind, ledger);
            ledger.duplicates += u64::from(arrival == Arrival::Duplicate);
            // Before the first number of all.
            ledger.published += u64::from(arrival == Arrival::Stray);
            return arrival != Arrival::Duplicate;
        }
        if self.arrived.count_ones() >= NO_ACCIDENT {
            // Those that were refused meanwhile have numbers that agree: this sample is late, and in no account any more.
            ledger.published += 1;
            return true;
        }
        // A refused sample with a number from nowhere: what it made seem lost never was.
        let never = u64::from(behind).min(ledger.lost);
        ledger.lost -= never;
        ledger.published -= never.min(ledger.published);
        self.restart(sequence, ledger);
        true
    }

    /// Enters the number of a sample that does not follow the accepted ones.
    pub(crate) fn enter_old(&mut self, sequence: u32, ledger: &mut StreamLedger) -> Arrival {
        let behind = self.newest.map_or(u32::MAX, |newest| newest.wrapping_sub(sequence));
        let arrival = self.fill(behind, ledger);
        match arrival {
            Arrival::Late => ledger.discard(Discard::Late),
            Arrival::Duplicate => ledger.duplicates += 1,
            Arrival::New | Arrival::Stray => ledger.strays += 1,
        }
        arrival
    }

    /// The first sample of a sender, or of one that counts anew.
    pub(crate) fn restart(&mut self, sequence: u32, ledger: &mut StreamLedger) {
        *self = Self { newest: Some(sequence), arrived: 1, known: 1 };
        ledger.published += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Delivers the sequence numbers, counting new ones as consumed.
    fn deliver(sequences: &[u32]) -> StreamLedger {
        let (mut tracker, mut ledger) = (SequenceTracker::default(), StreamLedger::default());
        for &sequence in sequences {
            ledger.delivered += 1;
            if tracker.register(sequence, &mut ledger) == Arrival::New {
                ledger.consumed += 1;
            }
            assert_eq!(ledger.unaccounted(), 0);
        }
        ledger
    }

    #[test]
    fn gaps_are_counted_exactly() {
        for gap in [1, 10, 1000] {
            let ledger = deliver(&[5, 6, 7 + gap, 8 + gap]);
            assert_eq!((ledger.lost, ledger.published), (u64::from(gap), 4 + u64::from(gap)));
        }
    }

    #[test]
    fn what_follows_is_entered_in_short_as_in_full() {
        let (mut long, mut short) = (SequenceTracker::default(), SequenceTracker::default());
        let (mut in_full, mut in_short) = (StreamLedger::default(), StreamLedger::default());
        assert!(!short.advance(0, &mut in_short), "nothing to follow");
        let start = u32::MAX - 40;
        for tracker in [(&mut long, &mut in_full), (&mut short, &mut in_short)] {
            tracker.0.register(start, tracker.1);
        }
        for i in 1..100 {
            for other in [0, 2, 1 << 31] {
                assert!(!short.advance(start.wrapping_add(i - 1 + other), &mut in_short), "{other} ahead");
            }
            long.register(start.wrapping_add(i), &mut in_full);
            assert!(short.advance(start.wrapping_add(i), &mut in_short));
            assert_eq!((short, in_short), (long, in_full), "number {i}");
        }
    }

    #[test]
    fn the_counter_wraps() {
        let start = u32::MAX - 5;
        let sequences: std::vec::Vec<u32> = (0..20).map(|i| start.wrapping_add(i)).collect();
        let ledger = deliver(&sequences);
        assert_eq!((ledger.consumed, ledger.lost), (20, 0));
    }

    /// Found by the fuzz target `step`: one half of the code had the number right across ahead, the other behind.
    #[test]
    fn the_number_right_across_the_range_is_behind() {
        const HALF: u32 = 1 << 31;
        for start in [0, 5, HALF, u32::MAX - 3] {
            let mut tracker = SequenceTracker::default();
            let mut ledger = StreamLedger::default();
            tracker.restart(start, &mut ledger);
            let expected = [(HALF - 1, None), (HALF, Some(HALF)), (HALF + 1, Some(HALF - 1))];
            for (ahead, behind) in expected {
                let across = start.wrapping_add(ahead);
                assert_eq!(tracker.behind(across), behind);
                assert_eq!(tracker.is_forgotten(across), behind.is_some());
            }
            // Good samples with such numbers are consumed, and each is one publication.
            (ledger.delivered, ledger.consumed) = (1, 1);
            for (step, (ahead, _)) in expected.into_iter().enumerate() {
                let entered = tracker.enter(start.wrapping_add(ahead), &mut ledger);
                ledger.delivered += 1;
                ledger.consumed += u64::from(entered);
                assert_eq!(ledger.unaccounted(), 0, "{step}: {ledger:?}");
            }
        }
    }

    #[test]
    fn late_is_not_duplicate() {
        let ledger = deliver(&[1, 4, 2, 2, 4, 3, 5]);
        assert_eq!(ledger.consumed, 3);
        assert_eq!(ledger.discarded_for(Discard::Late), 2);
        assert_eq!((ledger.duplicates, ledger.lost), (2, 0));
        assert_eq!(deliver(&[100, 1]).strays, 1);
    }
}
