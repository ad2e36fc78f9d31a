//! Input streams: number and content of a sample are checked before anything changes.
//!
//! Two heads follow the sequence numbers. The ledger's goes with every number that is plausible, so that gaps are
//! counted whatever the samples say. The stream's own goes with accepted samples only, so that no refused one can make
//! the samples after it look old. Numbers that contradict a sample's time (older number, newer time, or a jump past
//! [`SEQUENCE_JUMP`]) are those of a sender that counts anew, or damaged: [`RESTART_SAMPLES`] of them that follow each
//! other take the stream up again.

use super::ledger::{Discard, StreamLedger};
use super::sample::Measurement;
use super::sequence::{Arrival, SequenceTracker};
use crate::contract::Faults;
use crate::detection::{RESTART_SAMPLES, RESTART_SPACING, SEQUENCE_JUMP};

/// One stream: sequence numbers and the last accepted sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct StreamGate<const V: usize = 2> {
    /// What has arrived, for the accounts.
    arrivals: SequenceTracker,
    /// Sequence number of the last accepted sample; unlike `accepted` it does not expire.
    head: Option<u32>,
    pub(crate) accepted: Option<Measurement<V>>,
    /// Last number that contradicted its time, and how many before it led there.
    contradiction: Option<(u32, u32)>,
}

impl<const V: usize> StreamGate<V> {
    /// Enters a delivery whose content has been checked. Returns whether it is accepted.
    #[inline(never)]
    pub(crate) fn offer(
        &mut self,
        sample: &Measurement<V>,
        content: Result<(), Discard>,
        ledger: &mut StreamLedger,
        faults: &mut Faults,
    ) -> bool {
        ledger.delivered += 1;
        // Nearly every sample: the next one, and good. The rest of this function would do the same, three times as slowly.
        if content.is_ok() && self.head == self.arrivals.newest() && self.arrivals.advance(sample.sequence, ledger) {
            return self.accept(sample, ledger);
        }
        let ahead = |of: Option<u32>| of.map_or(1, |newest| sample.sequence.wrapping_sub(newest).cast_signed());
        let accepted = if ahead(self.head) > 0 && ahead(self.arrivals.newest()) <= SEQUENCE_JUMP {
            self.offer_next(sample.sequence, content, ledger, faults)
        } else {
            self.offer_contradiction(sample.sequence, content, ledger, faults)
        };
        accepted && self.accept(sample, ledger)
    }

    fn accept(&mut self, sample: &Measurement<V>, ledger: &mut StreamLedger) -> bool {
        ledger.consumed += 1;
        self.head = Some(sample.sequence);
        self.accepted = Some(*sample);
        self.contradiction = None;
        true
    }

    /// A number that follows those of the accepted samples.
    fn offer_next(
        &mut self,
        sequence: u32,
        content: Result<(), Discard>,
        ledger: &mut StreamLedger,
        faults: &mut Faults,
    ) -> bool {
        if let (Err(reason), true) = (content, self.arrivals.is_forgotten(sequence)) {
            // Far too late and refused: no sender that counts anew.
            ledger.strays += 1;
            *faults |= fault_of(reason);
            return false;
        }
        let lost = ledger.lost;
        if !self.arrivals.enter(sequence, ledger) {
            *faults |= Faults::DUPLICATE;
            return false;
        }
        faults.set_if(Faults::SAMPLE_GAP, ledger.lost > lost);
        if let Err(reason) = content {
            ledger.discard(reason);
            *faults |= fault_of(reason);
        }
        content.is_ok()
    }

    /// A number from before, or from far ahead.
    fn offer_contradiction(
        &mut self,
        sequence: u32,
        content: Result<(), Discard>,
        ledger: &mut StreamLedger,
        faults: &mut Faults,
    ) -> bool {
        // Whoever sends old samples again, in whatever order, is refused by their times.
        if content.is_ok() {
            let led =
                self.contradiction.filter(|(last, _)| (1..=RESTART_SPACING).contains(&sequence.wrapping_sub(*last)));
            let led = led.map_or(1, |(_, led)| led.saturating_add(1));
            if led >= RESTART_SAMPLES {
                self.arrivals.restart(sequence, ledger);
                return true;
            }
            self.contradiction = Some((sequence, led));
        }
        *faults |= match self.arrivals.enter_old(sequence, ledger) {
            Arrival::Duplicate => Faults::DUPLICATE,
            Arrival::New | Arrival::Late | Arrival::Stray => Faults::OUT_OF_ORDER,
        };
        false
    }
}

/// Fault code that goes with a refusal.
pub(super) const fn fault_of(reason: Discard) -> Faults {
    match reason {
        Discard::Late => Faults::OUT_OF_ORDER,
        Discard::NotFinite => Faults::NOT_FINITE,
        Discard::OutOfRange => Faults::OUT_OF_RANGE,
        Discard::Time => Faults::SAMPLE_TIME,
        Discard::Innovation => Faults::INNOVATION,
        Discard::NotVisible => Faults::TARGET_LOST,
        Discard::Frozen => Faults::FROZEN,
        Discard::Identity => Faults::PADDLE_IDENTITY,
    }
}
