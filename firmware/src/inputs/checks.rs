//! Checks of one sample against the table's geometry and against the sample before it.

use super::ledger::Discard;
use super::monitors::{FrozenMonitor, FrozenPaddle, InnovationGate};
use crate::contract::{NeedleSample, PaddleSample, TargetSample};
use crate::detection::{NEEDLE_JUMP_FLOOR, NEEDLE_JUMP_MARGIN};
use crate::scalar::Scalar;
use crate::settings::Runtime;
use crate::units::seconds;

/// The checks of one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Checks<'r, T: Scalar> {
    pub(crate) runtime: &'r Runtime<T>,
    /// Time of the tick, ns.
    pub(crate) now_ns: u64,
}

impl<T: Scalar> Checks<'_, T> {
    /// Checks a needle sample against the one before it.
    pub(crate) fn needle(
        &self,
        sample: &NeedleSample,
        previous: Option<&NeedleSample>,
        frozen: &mut FrozenMonitor,
    ) -> Result<(), Discard> {
        let runtime = self.runtime;
        normal_numbers(&[sample.depth, sample.velocity])?;
        let (least, most) = runtime.plausible_depth;
        if sample.depth < least || sample.depth > most {
            return Err(Discard::OutOfRange);
        }
        self.time(sample.time_ns, previous.map(|p| p.time_ns))?;
        let Some(previous) = previous else {
            return Ok(());
        };
        let elapsed = seconds(sample.time_ns - previous.time_ns);
        let (start, end) = runtime.table_depth;
        let range = end - start;
        // What the needle says about its speed holds for the whole gap; what it might have done besides only for as
        // long as a gap is no fault: a wrong unit must not become plausible by being refused long enough.
        let speed = previous.velocity.abs().max(sample.velocity.abs());
        let unseen = elapsed.min(seconds(runtime.needle_age.hold_ns));
        let plausible =
            NEEDLE_JUMP_MARGIN * (speed * elapsed + runtime.needle_speed * unseen) + NEEDLE_JUMP_FLOOR * range;
        if (sample.depth - previous.depth).abs() > plausible {
            return Err(Discard::Innovation);
        }
        // A needle that says it moves, but does not, has a frozen depth.
        let claimed_travel = sample.velocity.abs() * elapsed;
        frozen.check(sample.depth == previous.depth, claimed_travel, range)
    }

    /// Checks a target sample; `gate` knows what motion can explain.
    pub(crate) fn target(
        &self,
        sample: &TargetSample,
        previous: Option<&TargetSample>,
        gate: &InnovationGate,
        frozen: &mut FrozenMonitor,
    ) -> Result<(), Discard> {
        let runtime = self.runtime;
        if !sample.is_visible() {
            return Err(Discard::NotVisible);
        }
        normal_numbers(&sample.displacement)?;
        within(&sample.displacement, runtime.target_range)?;
        self.time(sample.time_ns, previous.map(|p| p.time_ns))?;
        let Some(previous) = previous else {
            return Ok(());
        };
        gate.check(runtime, &previous.displacement, &sample.displacement)?;
        let (start, end) = runtime.table_depth;
        frozen.check(sample.displacement == previous.displacement, gate.needle_travel(), end - start)
    }

    /// Checks a paddle sample; `commanded` is the last command, if there is one.
    pub(crate) fn paddle(
        &self,
        sample: &PaddleSample,
        previous: Option<&PaddleSample>,
        commanded: Option<&[f64; 2]>,
        frozen: &mut FrozenPaddle,
    ) -> Result<(), Discard> {
        let runtime = self.runtime;
        if sample.paddle_index != runtime.paddle_index {
            return Err(Discard::Identity);
        }
        normal_numbers(&sample.displacement)?;
        within(&sample.displacement, runtime.paddle_range)?;
        self.time(sample.time_ns, previous.map(|p| p.time_ns))?;
        let (Some(previous), Some(commanded)) = (previous, commanded) else {
            return Ok(());
        };
        let age = seconds(self.now_ns.saturating_sub(sample.time_ns));
        frozen.check(runtime, sample.displacement == previous.displacement, commanded, age)
    }

    /// Measured after the sample before it and not in the future. One period of tolerance: the sensor may stamp a
    /// sample while this tick has already read its clock.
    fn time(&self, time_ns: u64, previous_ns: Option<u64>) -> Result<(), Discard> {
        let future = time_ns > self.now_ns.saturating_add(self.runtime.loop_period_ns);
        if future || previous_ns.is_some_and(|previous| time_ns <= previous) {
            return Err(Discard::Time);
        }
        Ok(())
    }
}

/// Zero or a normal number. Subnormals are no measurement: they come from garbage read as a float, and slow some
/// processors down by a factor of a hundred.
fn normal_numbers(values: &[f64]) -> Result<(), Discard> {
    let normal = f64::MIN_POSITIVE..f64::INFINITY;
    let good = values.iter().all(|value| *value == 0.0 || normal.contains(&value.abs()));
    if good { Ok(()) } else { Err(Discard::NotFinite) }
}

/// |displacement| ≤ range. Compared in squares: an overflow to infinity is refused as well.
fn within([x, y]: &[f64; 2], range: f64) -> Result<(), Discard> {
    if x * x + y * y > range * range { Err(Discard::OutOfRange) } else { Ok(()) }
}
