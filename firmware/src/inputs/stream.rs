//! Input streams: every sample is checked before anything that the law depends on changes.

use super::ledger::{Discard, StreamLedger};
use super::sequence::{Arrival, SequenceTracker};
use crate::contract::Faults;

/// One stream: sequence numbers and the last accepted sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stream<S> {
    pub(crate) sequence: SequenceTracker,
    pub(crate) accepted: Option<S>,
}

impl<S: Copy> Stream<S> {
    /// Registers the delivery, checks it, and accepts it or enters why not. Returns the sample if accepted.
    pub(crate) fn offer(
        &mut self,
        sample: S,
        sequence: u32,
        ledger: &mut StreamLedger,
        faults: &mut Faults,
        check: impl FnOnce(Option<&S>) -> Result<(), Discard>,
    ) -> Option<S> {
        if !is_new(&mut self.sequence, sequence, ledger, faults) {
            return None;
        }
        match check(self.accepted.as_ref()) {
            Ok(()) => {
                ledger.consumed += 1;
                self.accepted = Some(sample);
                Some(sample)
            }
            Err(reason) => {
                refuse(reason, ledger, faults);
                None
            }
        }
    }
}

// What does not depend on the kind of sample is there once for all streams.

/// Registers a delivery; enters why it is not a new sample.
#[inline(never)]
fn is_new(tracker: &mut SequenceTracker, sequence: u32, ledger: &mut StreamLedger, faults: &mut Faults) -> bool {
    let lost = ledger.lost;
    let fault = match tracker.register(sequence, ledger) {
        Arrival::New => {
            faults.set_if(Faults::SAMPLE_GAP, ledger.lost > lost);
            return true;
        }
        Arrival::Late | Arrival::Stray => Faults::OUT_OF_ORDER,
        Arrival::Duplicate => Faults::DUPLICATE,
    };
    *faults |= fault;
    false
}

/// Enters a refusal.
#[inline(never)]
fn refuse(reason: Discard, ledger: &mut StreamLedger, faults: &mut Faults) {
    ledger.discard(reason);
    *faults |= fault_of(reason);
}

/// Fault code that goes with a refusal.
const fn fault_of(reason: Discard) -> Faults {
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
