//! A paddle that does not go where it is told.

use super::LeakyBucket;
use crate::detection::FOLLOWING_SAMPLES;
use crate::inputs::sample::are_within;
use crate::scalar::Scalar;
use crate::settings::PaddleRuntime;

/// Trips when the paddle is away from its command too often.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FollowingMonitor {
    off: LeakyBucket,
}

impl FollowingMonitor {
    /// Whether a measured position is where `commanded` explains it.
    /// `unseen` is how far it may have been commanded since, length.
    pub(crate) fn follows<T: Scalar, const D: usize>(
        paddle: &PaddleRuntime<T>,
        measured: &[f64; D],
        commanded: &[f64; D],
        unseen: f64,
    ) -> bool {
        are_within(measured, commanded, paddle.following_error + unseen)
    }

    /// Enters whether a fresh sample follows; returns whether the fault is certain.
    pub(crate) fn enter(&mut self, follows: bool) -> bool {
        self.off.enter(!follows, FOLLOWING_SAMPLES)
    }
}
