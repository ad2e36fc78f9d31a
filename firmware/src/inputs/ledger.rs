//! Accounts: nothing that reaches the controller disappears without a count.
//!
//! For each input stream: published = consumed + lost + discarded (by reason), where `published` is what the
//! sequence numbers say and `lost` are the gaps (overwritten by newer samples, or lost). For the loop:
//! due ticks = RUN + HOLD + SAFE + skipped.

use serde::{Deserialize, Serialize};

use crate::contract::Mode;
use crate::contract::frames::MAX_PADDLES;

/// Why a received sample was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discard {
    /// Older than one already seen.
    Late = 0,
    /// A field is NaN, infinite or subnormal.
    NotFinite = 1,
    /// A field is outside what the table makes plausible (wrong units among the reasons).
    OutOfRange = 2,
    /// Measured in the future, or not after the sample before it.
    Time = 3,
    /// Further from the sample before it than motion and noise can explain.
    Innovation = 4,
    /// The sensor did not see the target.
    NotVisible = 5,
    /// Bit-identical although the needle moved.
    Frozen = 6,
    /// From another paddle than the table's.
    Identity = 7,
}

impl Discard {
    /// Every reason, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Late,
        Self::NotFinite,
        Self::OutOfRange,
        Self::Time,
        Self::Innovation,
        Self::NotVisible,
        Self::Frozen,
        Self::Identity,
    ];

    /// Name as reports show it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::NotFinite => "not finite",
            Self::OutOfRange => "out of range",
            Self::Time => "time",
            Self::Innovation => "innovation",
            Self::NotVisible => "not visible",
            Self::Frozen => "frozen",
            Self::Identity => "identity",
        }
    }
}

/// Account of one input stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StreamLedger {
    /// Deliveries, counted before anything is known of them.
    pub delivered: u64,
    /// Samples that the publisher must have sent, from the sequence numbers.
    pub published: u64,
    /// Samples accepted.
    pub consumed: u64,
    /// Samples that never arrived: overwritten by newer ones, or lost.
    pub lost: u64,
    /// Samples refused, by [`Discard`] as index.
    pub discarded: [u64; Discard::ALL.len()],
    /// Deliveries of a sample that had arrived before; not publications of their own.
    pub duplicates: u64,
    /// Deliveries too old to be matched with a publication.
    pub strays: u64,
}

impl StreamLedger {
    /// An account without entries.
    pub const fn new() -> Self {
        Self {
            delivered: 0,
            published: 0,
            consumed: 0,
            lost: 0,
            discarded: [0; Discard::ALL.len()],
            duplicates: 0,
            strays: 0,
        }
    }

    /// Counts one refusal.
    pub(crate) fn discard(&mut self, reason: Discard) {
        if let Some(count) = self.discarded.get_mut(reason as usize) {
            *count += 1;
        }
    }

    /// Refusals for one reason.
    pub fn discarded_for(&self, reason: Discard) -> u64 {
        self.discarded.get(reason as usize).copied().unwrap_or(0)
    }

    /// Publications and deliveries without an entry: 0 unless the controller is wrong.
    ///
    /// Both are counted apart from the entries: publications from the sequence numbers, deliveries at the door.
    pub fn unaccounted(&self) -> u64 {
        let used = self.consumed + self.discarded.iter().sum::<u64>();
        self.published.abs_diff(used + self.lost) + self.delivered.abs_diff(used + self.duplicates + self.strays)
    }
}

/// Account of the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickLedger {
    /// Ticks that came due.
    pub due: u64,
    /// Ticks that ended in RUN.
    pub run: u64,
    /// Ticks that ended in HOLD.
    pub hold: u64,
    /// Ticks that ended in SAFE.
    pub safe: u64,
    /// Ticks that were never started.
    pub skipped: u64,
}

impl TickLedger {
    /// A tick starts, `skipped` periods after the one that should have.
    pub(crate) fn start(&mut self, skipped: u64) {
        self.due = self.due.saturating_add(skipped).saturating_add(1);
        self.skipped = self.skipped.saturating_add(skipped);
    }

    /// The tick ends in `mode`.
    pub(crate) fn end(&mut self, mode: Mode) {
        match mode {
            Mode::Hold => self.hold += 1,
            Mode::Run => self.run += 1,
            Mode::Safe => self.safe += 1,
        }
    }

    /// Due ticks without an entry: 0 unless the controller is wrong.
    pub fn unaccounted(&self) -> u64 {
        // A release numbered by garbage may have skipped more than there are numbers left: sums stop where `due` does.
        let entries = [self.run, self.hold, self.safe, self.skipped].into_iter().fold(0, u64::saturating_add);
        self.due.abs_diff(entries)
    }
}

/// All accounts of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ledger {
    /// Needle samples.
    pub needle: StreamLedger,
    /// Target samples.
    pub target: StreamLedger,
    /// Samples of each paddle, in the order of the table; nothing in a place without one.
    pub paddles: [StreamLedger; MAX_PADDLES],
    /// Ticks of the loop.
    pub ticks: TickLedger,
}

impl Ledger {
    /// Everything without an entry: 0 unless the controller is wrong.
    pub fn unaccounted(&self) -> u64 {
        let paddles: u64 = self.paddles.iter().map(StreamLedger::unaccounted).sum();
        self.needle.unaccounted() + self.target.unaccounted() + paddles + self.ticks.unaccounted()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found by the fuzz target `step`: the sum of the entries overflowed.
    #[test]
    fn a_release_with_the_last_number_there_is_stays_accounted_for() {
        let mut ticks = TickLedger::default();
        for skipped in [0, u64::MAX - 3, 7, u64::MAX] {
            ticks.start(skipped);
            ticks.end(Mode::Safe);
            assert_eq!(ticks.unaccounted(), 0);
        }
    }

    #[test]
    fn every_entry_counts_once_on_its_side() {
        let balanced = StreamLedger {
            delivered: 7 + 20 + 5 + 6,
            published: 7 + 20 + 11,
            consumed: 7,
            lost: 11,
            discarded: [1, 2, 3, 4, 5, 3, 1, 1],
            duplicates: 5,
            strays: 6,
        };
        assert_eq!(balanced.unaccounted(), 0);
        type Field = fn(&mut StreamLedger) -> &mut u64;
        let fields: [(Field, u64); 7] = [
            (|l| &mut l.delivered, 1),
            (|l| &mut l.published, 1),
            (|l| &mut l.consumed, 2),
            (|l| &mut l.lost, 1),
            (|l| &mut l.discarded[4], 2),
            (|l| &mut l.duplicates, 1),
            (|l| &mut l.strays, 1),
        ];
        for (i, (field, sides)) in fields.into_iter().enumerate() {
            for by in [1, u64::MAX] {
                let mut off = balanced;
                let place = field(&mut off);
                *place = place.wrapping_add(by);
                assert_eq!(off.unaccounted(), sides, "field {i}");
            }
        }
        let ledger = Ledger { needle: StreamLedger { published: 1, ..balanced }, ..Ledger::default() };
        assert_eq!(ledger.unaccounted(), 37);
        let ticks = TickLedger { due: 10, run: 1, hold: 2, safe: 3, skipped: 4 };
        assert_eq!((ticks.unaccounted(), TickLedger { hold: 4, ..ticks }.unaccounted()), (0, 2));
        let all = Ledger { target: StreamLedger { lost: 1, ..StreamLedger::default() }, ticks, ..Ledger::default() };
        assert_eq!(all.unaccounted(), 1);
        let second = StreamLedger { strays: 4, ..StreamLedger::default() };
        let paddles = [StreamLedger::default(), second];
        let due = TickLedger { due: 12, ..ticks };
        assert_eq!(Ledger { paddles, ticks: due, ..Ledger::default() }.unaccounted(), 6);
    }

    #[test]
    fn reasons_are_named_and_counted_apart() {
        let mut ledger = StreamLedger::default();
        for (i, reason) in Discard::ALL.into_iter().enumerate() {
            assert_eq!(reason as usize, i);
            for _ in 0..=i {
                ledger.discard(reason);
            }
        }
        assert_eq!(ledger.discarded, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(Discard::ALL.map(|reason| ledger.discarded_for(reason)), ledger.discarded);
        let names = Discard::ALL.map(Discard::name);
        let expected =
            ["late", "not finite", "out of range", "time", "innovation", "not visible", "frozen", "identity"];
        assert_eq!(names, expected);
    }
}
