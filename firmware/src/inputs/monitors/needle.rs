//! A needle whose depth and velocity contradict each other.

use crate::detection::{NEEDLE_CONTRADICTION, NEEDLE_CONTRADICTION_RATIO, NEEDLE_WINDOW, NEEDLE_WINDOW_NS};
use crate::inputs::ledger::Discard;
use crate::inputs::sample::Measurement;
use crate::scalar::Scalar;
use crate::settings::Runtime;
use crate::units::seconds;

/// Compares, over a window, how far the depth went with how far the velocity says that it went: a frozen depth, or a
/// velocity that is stuck. Both are net: what an encoder trembles at rest does not add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct NeedleMonitor {
    /// Change of depth since the window began, length.
    moved: f64,
    /// Integral of the velocity since then, length.
    claimed: f64,
    /// When it began, ns.
    since_ns: u64,
}

impl NeedleMonitor {
    fn after(&self, sample: &Measurement, previous: &Measurement) -> Self {
        let elapsed = seconds(sample.time_ns - previous.time_ns);
        let ([depth, velocity], [previous_depth, previous_velocity]) = (sample.values, previous.values);
        Self {
            moved: self.moved + (depth - previous_depth),
            claimed: self.claimed + 0.5 * (velocity + previous_velocity) * elapsed,
            since_ns: self.since_ns,
        }
    }

    /// Refuses a sample with which depth and velocity contradict each other.
    pub(crate) fn check<T: Scalar>(
        &self,
        runtime: &Runtime<T>,
        sample: &Measurement,
        previous: &Measurement,
    ) -> Result<(), Discard> {
        let Self { moved, claimed, .. } = self.after(sample, previous);
        let larger = moved.abs().max(claimed.abs());
        // Nobody knows when in a gap the velocity has changed.
        let unknown = 0.5 * (sample.values[1] - previous.values[1]).abs() * seconds(sample.time_ns - previous.time_ns);
        let admitted = NEEDLE_CONTRADICTION * runtime.depth_range() + NEEDLE_CONTRADICTION_RATIO * larger + unknown;
        if (moved - claimed).abs() > admitted { Err(Discard::Frozen) } else { Ok(()) }
    }

    /// Enters an accepted sample.
    pub(crate) fn accept<T: Scalar>(
        &mut self,
        runtime: &Runtime<T>,
        sample: &Measurement,
        previous: Option<&Measurement>,
    ) {
        let begin = Self { since_ns: sample.time_ns, ..Self::default() };
        *self = match previous {
            Some(previous) if sample.time_ns - previous.time_ns <= runtime.needle_age.hold_ns => {
                let next = self.after(sample, previous);
                let far = next.moved.abs().max(next.claimed.abs()) > NEEDLE_WINDOW * runtime.depth_range();
                let long = sample.time_ns.saturating_sub(next.since_ns) > NEEDLE_WINDOW_NS;
                if far || long { begin } else { next }
            }
            _ => begin,
        };
    }
}
