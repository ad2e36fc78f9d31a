//! Values that no longer change although they must.

use crate::detection::{FROZEN_RESOLUTION, FROZEN_SAMPLES, FROZEN_STEPS, FROZEN_UNSEEN_RESOLUTION};
use crate::inputs::ledger::Discard;
use crate::inputs::sample::{Measurement, are_within, squared_distance};

/// Detects a value that stays bit-identical while what it follows goes away from where it was when it last changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrozenMonitor<const D: usize = 2> {
    /// Samples like the one before them, in a row.
    identical: u32,
    /// Where the followed thing was at the first of them, length.
    reference: [f64; D],
}

impl<const D: usize> Default for FrozenMonitor<D> {
    fn default() -> Self {
        Self { identical: 0, reference: [0.0; D] }
    }
}

impl<const D: usize> FrozenMonitor<D> {
    /// Refuses a sample that is one of many [like the ones before](Measurement::is_like) although what it follows has
    /// moved further than `admitted` without it.
    pub(crate) fn check(&self, identical: bool, followed: &[f64; D], admitted: f64) -> Result<(), Discard> {
        let frozen =
            identical && self.identical + 1 >= FROZEN_SAMPLES && !are_within(followed, &self.reference, admitted);
        if frozen { Err(Discard::Frozen) } else { Ok(()) }
    }

    /// Enters an accepted sample.
    pub(crate) fn accept(&mut self, identical: bool, followed: &[f64; D]) {
        if identical && self.identical > 0 {
            self.identical = self.identical.saturating_add(1);
        } else {
            *self = Self { identical: u32::from(identical), reference: *followed };
        }
    }
}

/// What a sensor resolves, learned from its samples: the smallest change that it has ever shown.
///
/// A value rounded to steps stays bit-identical until the target has moved by one. How far it must move for that is
/// what the table says, so that the test asks for the table's own motion in units of the resolution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SensorStep {
    /// Squared; `None` before the first change.
    smallest_step_squared: Option<f64>,
}

impl SensorStep {
    /// Motion without which an unchanged value says nothing, for a sensor of this range, length.
    pub(crate) fn unseen_motion(&self, range: f64) -> f64 {
        let coarsest = FROZEN_UNSEEN_RESOLUTION * range;
        let step = self.smallest_step_squared.map_or(coarsest, |squared| libm::sqrt(squared).min(coarsest));
        FROZEN_STEPS * step.max(FROZEN_RESOLUTION * range)
    }

    /// Enters an accepted sample.
    pub(crate) fn accept<const D: usize>(&mut self, sample: &Measurement<D>, previous: Option<&Measurement<D>>) {
        let Some(previous) = previous else { return };
        let squared = squared_distance(&sample.values, &previous.values);
        if squared > 0.0 {
            let smallest = self.smallest_step_squared.map_or(squared, |smallest| smallest.min(squared));
            self.smallest_step_squared = Some(smallest);
        }
    }
}
