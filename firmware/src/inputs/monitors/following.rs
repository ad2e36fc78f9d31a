//! A paddle that does not go where it is told.

use super::LeakyBucket;
use crate::detection::FOLLOWING_SAMPLES;
use crate::inputs::sample::are_within;
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Trips when the paddle is away from its command too often.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FollowingMonitor {
    off: LeakyBucket,
}

impl FollowingMonitor {
    /// Whether a position measured `age` seconds ago is where `commanded` explains it.
    pub(crate) fn follows<T: Scalar>(
        runtime: &Runtime<T>,
        measured: &[f64; 2],
        commanded: &[f64; 2],
        age: f64,
    ) -> bool {
        are_within(measured, commanded, runtime.following_error + runtime.unseen_motion(age))
    }

    /// Enters whether a fresh sample follows; returns whether the fault is certain.
    pub(crate) fn enter(&mut self, follows: bool) -> bool {
        self.off.enter(!follows, FOLLOWING_SAMPLES)
    }
}
