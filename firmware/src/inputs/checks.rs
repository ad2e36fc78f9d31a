//! Checks of one sample against the table's geometry and against the sample before it. Nothing changes here.

use super::ledger::Discard;
use super::monitors::{InnovationGate, NeedleMonitor};
use super::sample::{Measurement, are_within};
use super::stream::fault_of;
use crate::detection::{NEEDLE_JUMP_FLOOR, NEEDLE_JUMP_MARGIN};
use crate::scalar::Scalar;
use crate::settings::{PaddleRuntime, Runtime};
use crate::units::seconds;

/// The checks of one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Checks<'r, T: Scalar, const P: usize = 1> {
    pub(crate) runtime: &'r Runtime<T, P>,
    /// Time of the tick, ns.
    pub(crate) now_ns: u64,
    /// Latest time of a measurement, ns. One period after the tick: the sensor may stamp a sample while this tick has
    /// already read its clock.
    latest_ns: u64,
}

impl<'r, T: Scalar, const P: usize> Checks<'r, T, P> {
    /// The checks of a tick at `now_ns`.
    pub(crate) fn new(runtime: &'r Runtime<T, P>, now_ns: u64) -> Self {
        Self { runtime, now_ns, latest_ns: now_ns.saturating_add(runtime.loop_period_ns) }
    }

    /// What becomes of a sample: one that only a monitor that is off refuses is good.
    #[inline(always)]
    pub(crate) fn judge(&self, content: Result<(), Discard>) -> Result<(), Discard> {
        content.or_else(|reason| if self.runtime.seen(fault_of(reason)).is_empty() { Ok(()) } else { Err(reason) })
    }

    /// Checks a needle sample against the one before it. Returns what the monitor knows once it is accepted.
    pub(crate) fn needle(
        &self,
        sample: &Measurement,
        previous: Option<&Measurement>,
        monitor: &NeedleMonitor,
    ) -> Result<NeedleMonitor, Discard> {
        let runtime = self.runtime;
        self.numbers_and_time(sample, previous)?;
        let [depth, velocity] = sample.values;
        let (least, most) = runtime.plausible_depth;
        if depth < least || depth > most || velocity.abs() > runtime.plausible_speed {
            return Err(Discard::OutOfRange);
        }
        let Some(previous) = previous else {
            return Ok(NeedleMonitor::beginning_with(sample));
        };
        let elapsed = seconds(sample.time_ns - previous.time_ns);
        let [previous_depth, previous_velocity] = previous.values;
        // What the needle says about its speed holds for the whole gap; what it might have done besides only for as
        // long as a gap is no fault: a wrong unit must not become plausible by being refused long enough.
        let speed = previous_velocity.abs().max(velocity.abs());
        let unseen = elapsed.min(runtime.needle_gap);
        let plausible = NEEDLE_JUMP_MARGIN * (speed * elapsed + runtime.needle_speed * unseen)
            + NEEDLE_JUMP_FLOOR * runtime.depth_range();
        if (depth - previous_depth).abs() > plausible {
            return Err(Discard::Innovation);
        }
        monitor.next(runtime, sample, previous)
    }

    /// Checks a target sample; `gate` knows what motion can explain.
    pub(crate) fn target<const D: usize>(
        &self,
        sample: &Measurement<D>,
        previous: Option<&Measurement<D>>,
        gate: &InnovationGate<D, P>,
    ) -> Result<(), Discard> {
        let runtime = self.runtime;
        self.numbers_and_time(sample, previous)?;
        within(&sample.values, runtime.target_range)?;
        let Some(previous) = previous else {
            return Ok(());
        };
        gate.check(runtime, &previous.values, &sample.values)
    }

    /// Checks a sample of `paddle`.
    pub(crate) fn paddle<const D: usize>(
        &self,
        paddle: &PaddleRuntime<T>,
        sample: &Measurement<D>,
        previous: Option<&Measurement<D>>,
    ) -> Result<(), Discard> {
        self.numbers_and_time(sample, previous)?;
        within(&sample.values, paddle.range)
    }

    /// Zero or normal numbers, measured after the sample before and not in the future.
    ///
    /// Subnormals are no measurement: they come from garbage read as a float, and slow some processors down by a factor
    /// of a hundred.
    #[inline(never)]
    fn numbers_and_time<const V: usize>(
        &self,
        sample: &Measurement<V>,
        previous: Option<&Measurement<V>>,
    ) -> Result<(), Discard> {
        // Two of them without a loop, which compiled for size stays one.
        let are_numbers = match sample.values.as_slice() {
            [first, second] => is_number(*first) && is_number(*second),
            values => values.iter().all(|value| is_number(*value)),
        };
        if !are_numbers {
            return Err(Discard::NotFinite);
        }
        if sample.time_ns > self.latest_ns || previous.is_some_and(|previous| sample.time_ns <= previous.time_ns) {
            return Err(Discard::Time);
        }
        Ok(())
    }
}

/// |displacement| ≤ range.
fn within<const D: usize>(displacement: &[f64; D], range: f64) -> Result<(), Discard> {
    if are_within(displacement, &[0.0; D], range) { Ok(()) } else { Err(Discard::OutOfRange) }
}

/// Whether `value` is zero or normal. Asked of its bits: without hardware for doubles, comparisons take ten times as long.
#[inline(always)]
const fn is_number(value: f64) -> bool {
    const SMALLEST: u64 = f64::MIN_POSITIVE.to_bits();
    const INFINITE: u64 = f64::INFINITY.to_bits();
    let magnitude = value.abs().to_bits();
    magnitude == 0 || (SMALLEST <= magnitude && magnitude < INFINITE)
}
