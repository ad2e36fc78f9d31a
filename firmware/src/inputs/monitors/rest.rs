//! A paddle that rests, so that its position can be adopted.

use crate::inputs::sample::{Measurement, are_within};

/// Waits until the paddle has stayed where it is, within the resolution of its sensor, for as long as a sample may be
/// old: if it moves steadily, it is not further than that from the sample when the sample is used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RestMonitor<const D: usize = 2> {
    /// First sample of the rest and the time of the last one, ns.
    rest: Option<(Measurement<D>, u64)>,
}

/// What is known of the paddle's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// Too early to say.
    Unknown,
    /// It has just moved.
    Moving,
    /// It rests.
    Resting,
}

impl<const D: usize> RestMonitor<D> {
    /// Enters an accepted sample of a sensor that resolves so much, length, and whose samples may be so old, ns.
    pub(crate) fn enter(&mut self, resolution: f64, longest_ns: u64, sample: &Measurement<D>) -> Motion {
        let known = self.rest.filter(|(_, last_ns)| sample.time_ns.saturating_sub(*last_ns) <= longest_ns);
        let rested = known.filter(|(first, _)| are_within(&sample.values, &first.values, resolution));
        let (first, _) = rested.unwrap_or((*sample, sample.time_ns));
        self.rest = Some((first, sample.time_ns));
        match (known, rested) {
            (Some(_), None) => Motion::Moving,
            _ if sample.time_ns.saturating_sub(first.time_ns) >= longest_ns => Motion::Resting,
            _ => Motion::Unknown,
        }
    }
}
