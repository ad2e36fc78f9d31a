//! A loop that drives the error up.

use crate::detection::{DIVERGENCE_FLOOR, DIVERGENCE_GROWTH, DIVERGENCE_SIGMAS, DIVERGENCE_WINDOW};
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Detects a loop with the wrong sign: the error grows while the feedback acts against it.
///
/// A loop of the right sign lags behind the steepest drift by at most slope·speed·(d + 1/g)·T, even when the
/// feed-forward is entirely wrong. An error that grows to twice its start and past twice this lag, while the
/// corrections should have removed it, means that they push the wrong way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DivergenceMonitor {
    samples: u32,
    start_error: f64,
    /// Correction applied since the start, as predicted change of the error, length.
    predicted: f64,
    /// Highest needle speed since re-arming, length/s.
    peak_speed: f64,
}

impl DivergenceMonitor {
    /// Enters a sample whose correction, the target's motion that it asks for, acts; returns whether the loop diverges.
    pub(crate) fn update<T: Scalar, const P: usize>(
        &mut self,
        runtime: &Runtime<T, P>,
        error: f64,
        correction: f64,
        needle_speed: f64,
    ) -> bool {
        let gain = runtime.gain.to_f64();
        self.peak_speed = self.peak_speed.max(needle_speed.abs());
        let lag_time = (f64::from(runtime.delay_samples) + 1.0 / gain) * runtime.target_period;
        let floor = (runtime.target_slope * self.peak_speed * lag_time)
            .max(DIVERGENCE_SIGMAS * runtime.target_noise)
            .max(DIVERGENCE_FLOOR * runtime.target_range);
        let magnitude = error.abs();
        if self.samples == 0 || f64::from(self.samples) * gain > DIVERGENCE_WINDOW || magnitude < self.start_error {
            *self = Self { samples: 0, start_error: magnitude, predicted: 0.0, ..*self };
        }
        self.samples += 1;
        let diverges = magnitude > DIVERGENCE_GROWTH * floor.max(self.start_error) && self.predicted >= floor;
        self.predicted += correction;
        diverges
    }
}
