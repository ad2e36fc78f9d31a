//! Values that no longer change although something moves.

use crate::detection::{FROZEN_SAMPLES, FROZEN_TRAVEL};
use crate::inputs::ledger::Discard;
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Detects a value that stays bit-identical while the sequence advances and the needle moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FrozenMonitor {
    identical: u32,
    travel: f64,
}

impl FrozenMonitor {
    /// Enters whether the value is bit-identical and how far the needle went since the sample before it, length.
    pub(crate) fn check(&mut self, identical: bool, travel: f64, depth_range: f64) -> Result<(), Discard> {
        if !identical {
            *self = Self::default();
            return Ok(());
        }
        self.identical = self.identical.saturating_add(1);
        self.travel += travel;
        if self.identical >= FROZEN_SAMPLES && self.travel > FROZEN_TRAVEL * depth_range {
            Err(Discard::Frozen)
        } else {
            Ok(())
        }
    }
}

/// Detects a measured paddle position that stays bit-identical while the command goes away from where it was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FrozenPaddle {
    identical: u32,
    /// Command when the position was last seen to change, length.
    commanded: [f64; 2],
}

impl FrozenPaddle {
    /// Enters whether the position is bit-identical, the last command, and the sample's age, s.
    pub(crate) fn check<T: Scalar>(
        &mut self,
        runtime: &Runtime<T>,
        identical: bool,
        commanded: &[f64; 2],
        age: f64,
    ) -> Result<(), Discard> {
        if !identical || self.identical == 0 {
            *self = Self { identical: u32::from(identical), commanded: *commanded };
            return Ok(());
        }
        self.identical = self.identical.saturating_add(1);
        // What is on its way through the actuator cannot show yet.
        let range = runtime.limits.max_displacement.to_f64();
        let admitted = FROZEN_TRAVEL * range + runtime.unseen_motion(age);
        let (dx, dy) = (commanded[0] - self.commanded[0], commanded[1] - self.commanded[1]);
        let moved = dx * dx + dy * dy > admitted * admitted;
        if self.identical >= FROZEN_SAMPLES && moved { Err(Discard::Frozen) } else { Ok(()) }
    }
}
