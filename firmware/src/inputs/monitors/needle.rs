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
    /// A window that begins with this sample.
    pub(crate) fn beginning_with(sample: &Measurement) -> Self {
        Self { since_ns: sample.time_ns, ..Self::default() }
    }

    /// The window once `sample` is accepted; refuses one with which depth and velocity contradict each other.
    pub(crate) fn next<T: Scalar, const P: usize>(
        &self,
        runtime: &Runtime<T, P>,
        sample: &Measurement,
        previous: &Measurement,
    ) -> Result<Self, Discard> {
        let elapsed_ns = sample.time_ns - previous.time_ns;
        let elapsed = seconds(elapsed_ns);
        let ([depth, velocity], [previous_depth, previous_velocity]) = (sample.values, previous.values);
        let moved = self.moved + (depth - previous_depth);
        let claimed = self.claimed + 0.5 * (velocity + previous_velocity) * elapsed;
        let larger = moved.abs().max(claimed.abs());
        // Nobody knows when in a gap the velocity has changed.
        let unknown = 0.5 * (velocity - previous_velocity).abs() * elapsed;
        let range = runtime.depth_range();
        let admitted = NEEDLE_CONTRADICTION * range + NEEDLE_CONTRADICTION_RATIO * larger + unknown;
        if (moved - claimed).abs() > admitted {
            return Err(Discard::Frozen);
        }
        let ends = elapsed_ns > runtime.needle_age.hold_ns
            || larger > NEEDLE_WINDOW * range
            || sample.time_ns.saturating_sub(self.since_ns) > NEEDLE_WINDOW_NS;
        Ok(if ends { Self::beginning_with(sample) } else { Self { moved, claimed, ..*self } })
    }
}
