//! What all samples have in common.

use crate::contract::{NeedleSample, PaddleSample, TargetSample};

/// A sample of any stream: its number, its time, and the two numbers that it measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Measurement {
    pub(crate) sequence: u32,
    pub(crate) time_ns: u64,
    /// Depth and velocity of the needle, or a displacement.
    pub(crate) values: [f64; 2],
}

impl Measurement {
    /// Whether the sample before it said the same.
    pub(crate) fn is_like(&self, previous: Option<&Self>) -> bool {
        previous.is_some_and(|previous| previous.values == self.values)
    }
}

impl From<&NeedleSample> for Measurement {
    fn from(sample: &NeedleSample) -> Self {
        Self { sequence: sample.sequence, time_ns: sample.time_ns, values: [sample.depth, sample.velocity] }
    }
}

impl From<&TargetSample> for Measurement {
    fn from(sample: &TargetSample) -> Self {
        Self { sequence: sample.sequence, time_ns: sample.time_ns, values: sample.displacement }
    }
}

impl From<&PaddleSample> for Measurement {
    fn from(sample: &PaddleSample) -> Self {
        Self { sequence: sample.sequence, time_ns: sample.time_ns, values: sample.displacement }
    }
}

/// Whether two points are no further apart than `distance`. In squares: an overflow to infinity is further.
pub(crate) fn are_within(a: &[f64; 2], b: &[f64; 2], distance: f64) -> bool {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy <= distance * distance
}
