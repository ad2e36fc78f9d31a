//! What all samples have in common.

use crate::contract::frames::MAX_DIMENSION;
use crate::contract::{NeedleSample, PaddleSample, TargetSample};

/// A sample of any stream: its number, its time, and the numbers that it measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measurement<const V: usize = 2> {
    pub(crate) sequence: u32,
    pub(crate) time_ns: u64,
    /// Depth and velocity of the needle, or a displacement.
    pub(crate) values: [f64; V],
}

impl<const V: usize> Measurement<V> {
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

impl<const D: usize> From<&TargetSample> for Measurement<D> {
    fn from(sample: &TargetSample) -> Self {
        Self { sequence: sample.sequence, time_ns: sample.time_ns, values: components(&sample.displacement) }
    }
}

impl<const D: usize> From<&PaddleSample> for Measurement<D> {
    fn from(sample: &PaddleSample) -> Self {
        Self { sequence: sample.sequence, time_ns: sample.time_ns, values: components(&sample.displacement) }
    }
}

/// The components of a displacement in a frame that this space has; what is out of a plane is not looked at.
#[inline(always)]
fn components<const D: usize>(displacement: &[f64; MAX_DIMENSION]) -> [f64; D] {
    displacement.first_chunk().copied().unwrap_or([0.0; D])
}

/// Whether two points are no further apart than `distance`. In squares: an overflow to infinity is further.
pub(crate) fn are_within<const V: usize>(a: &[f64; V], b: &[f64; V], distance: f64) -> bool {
    squared_distance(a, b) <= distance * distance
}

/// Square of the distance of two points.
#[inline(always)]
pub(crate) fn squared_distance<const V: usize>(a: &[f64; V], b: &[f64; V]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += (a - b) * (a - b);
    }
    sum
}
