//! A paddle that does not go where it is told.

use crate::detection::FOLLOWING_SAMPLES;
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Trips when the paddle stays away from its command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FollowingMonitor {
    successive: u32,
}

impl FollowingMonitor {
    /// Enters a fresh paddle sample `age` seconds old; returns whether the fault is certain.
    pub(crate) fn update<T: Scalar>(
        &mut self,
        runtime: &Runtime<T>,
        measured: &[f64; 2],
        commanded: &[f64; 2],
        age: f64,
    ) -> bool {
        let admitted = runtime.following_error + runtime.unseen_motion(age);
        let (dx, dy) = (measured[0] - commanded[0], measured[1] - commanded[1]);
        let off = dx * dx + dy * dy > admitted * admitted;
        self.successive = if off { self.successive.saturating_add(1) } else { 0 };
        self.successive >= FOLLOWING_SAMPLES
    }
}
