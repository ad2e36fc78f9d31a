//! Input streams: every sample is checked before anything that the law depends on changes.

use crate::contract::{NeedleSample, PaddleSample, TargetSample};
use crate::ledger::{Discard, StreamLedger};
use crate::monitor::{FrozenMonitor, FrozenPaddle, InnovationGate};
use crate::runtime::Runtime;
use crate::scalar::Scalar;
use crate::sequence::{Arrival, SequenceTracker};
use crate::supervisor::Faults;

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
    /// Newest paddle sample.
    pub paddle: Option<PaddleSample>,
}

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
    let missed = ledger.missed;
    let fault = match tracker.register(sequence, ledger) {
        Arrival::New => {
            faults.set_if(Faults::SAMPLE_GAP, ledger.missed > missed);
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

/// How much faster than the table's limit the needle may seem between two samples: jitter of their times.
pub const NEEDLE_JUMP_MARGIN: f64 = 2.0;
/// Depth jump that is always plausible, part of the table's depth range: sensor resolution.
pub const NEEDLE_JUMP_FLOOR: f64 = 0.01;

/// Checks a needle sample against the one before it.
pub(crate) fn check_needle<T: Scalar>(
    runtime: &Runtime<T>,
    now_ns: u64,
    sample: &NeedleSample,
    previous: Option<&NeedleSample>,
    frozen: &mut FrozenMonitor,
) -> Result<(), Discard> {
    check_numbers(&[sample.depth, sample.velocity])?;
    let (least, most) = runtime.plausible_depth;
    if sample.depth < least || sample.depth > most {
        return Err(Discard::OutOfRange);
    }
    check_time(runtime, now_ns, sample.time_ns, previous.map(|p| p.time_ns))?;
    let Some(previous) = previous else {
        return Ok(());
    };
    let elapsed = seconds(sample.time_ns - previous.time_ns);
    let (start, end) = runtime.table_depth;
    let range = end - start;
    // What the needle says about its speed holds for the whole gap; what it might have done besides only for as long
    // as a gap is no fault: a wrong unit must not become plausible by being refused long enough.
    let speed = previous.velocity.abs().max(sample.velocity.abs());
    let unseen = elapsed.min(seconds(runtime.needle_age.hold_ns));
    let plausible = NEEDLE_JUMP_MARGIN * (speed * elapsed + runtime.needle_speed * unseen) + NEEDLE_JUMP_FLOOR * range;
    if (sample.depth - previous.depth).abs() > plausible {
        return Err(Discard::Innovation);
    }
    // A needle that says it moves, but does not, has a frozen depth.
    let claimed_travel = sample.velocity.abs() * elapsed;
    frozen.check(sample.depth == previous.depth, claimed_travel, range)
}

/// Checks a target sample; `gate` knows what motion can explain.
pub(crate) fn check_target<T: Scalar>(
    runtime: &Runtime<T>,
    now_ns: u64,
    sample: &TargetSample,
    previous: Option<&TargetSample>,
    gate: &InnovationGate,
    frozen: &mut FrozenMonitor,
    needle_travel: f64,
) -> Result<(), Discard> {
    if !sample.is_visible() {
        return Err(Discard::NotVisible);
    }
    check_numbers(&sample.displacement)?;
    let [x, y] = sample.displacement;
    // Compared in squares: an overflow to infinity is refused as well.
    if x * x + y * y > runtime.target_range * runtime.target_range {
        return Err(Discard::OutOfRange);
    }
    check_time(runtime, now_ns, sample.time_ns, previous.map(|p| p.time_ns))?;
    let Some(previous) = previous else {
        return Ok(());
    };
    gate.check(runtime, &previous.displacement, &sample.displacement)?;
    let (start, end) = runtime.table_depth;
    frozen.check(sample.displacement == previous.displacement, needle_travel, end - start)
}

/// Checks a paddle sample; `commanded` is the last command, if there is one.
pub(crate) fn check_paddle<T: Scalar>(
    runtime: &Runtime<T>,
    now_ns: u64,
    expected_index: u32,
    sample: &PaddleSample,
    previous: Option<&PaddleSample>,
    commanded: Option<&[f64; 2]>,
    frozen: &mut FrozenPaddle,
) -> Result<(), Discard> {
    if sample.paddle_index != expected_index {
        return Err(Discard::Identity);
    }
    check_numbers(&sample.displacement)?;
    let [x, y] = sample.displacement;
    if x * x + y * y > runtime.paddle_range * runtime.paddle_range {
        return Err(Discard::OutOfRange);
    }
    check_time(runtime, now_ns, sample.time_ns, previous.map(|p| p.time_ns))?;
    let (Some(previous), Some(commanded)) = (previous, commanded) else {
        return Ok(());
    };
    let age = seconds(now_ns.saturating_sub(sample.time_ns));
    frozen.check(runtime, sample.displacement == previous.displacement, commanded, age)
}

/// Zero or a normal number. Subnormals are no measurement: they come from garbage read as a float, and slow some
/// processors down by a factor of a hundred.
fn check_numbers(values: &[f64]) -> Result<(), Discard> {
    let normal = f64::MIN_POSITIVE..f64::INFINITY;
    let good = values.iter().all(|value| *value == 0.0 || normal.contains(&value.abs()));
    if good { Ok(()) } else { Err(Discard::NotFinite) }
}

/// Measured after the sample before it and not in the future. One period of tolerance: the sensor may stamp a sample
/// while this tick has already read its clock.
fn check_time<T: Scalar>(
    runtime: &Runtime<T>,
    now_ns: u64,
    time_ns: u64,
    previous_ns: Option<u64>,
) -> Result<(), Discard> {
    let future = time_ns > now_ns.saturating_add(runtime.loop_period_ns);
    if future || previous_ns.is_some_and(|previous| time_ns <= previous) {
        return Err(Discard::Time);
    }
    Ok(())
}

/// Nanoseconds as seconds.
///
/// Converted in halves: each is exact, so that their sum is rounded once, as `nanoseconds as f64` would be. Hardware
/// converts 32 bits; for 64, a microcontroller calls a function ten times as long.
pub(crate) fn seconds(nanoseconds: u64) -> f64 {
    let (high, low) = ((nanoseconds >> 32) as u32, nanoseconds as u32);
    (f64::from(high) * 4_294_967_296.0 + f64::from(low)) * 1e-9
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn seconds_are_rounded_once(nanoseconds: u64, shift in 0..64u32) {
            for nanoseconds in [nanoseconds >> shift, u64::MAX << shift, u64::MAX >> shift] {
                prop_assert_eq!(seconds(nanoseconds).to_bits(), (nanoseconds as f64 * 1e-9).to_bits());
            }
        }
    }
}
