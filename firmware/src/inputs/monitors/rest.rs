//! A paddle that rests, so that its position can be adopted.

use crate::inputs::sample::{Measurement, are_within};
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Waits until the paddle has stayed where it is, within the resolution of its sensor, for as long as a sample may be
/// old: if it moves steadily, it is not further than that from the sample when the sample is used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RestMonitor {
    /// First sample of the rest and the time of the last one, ns.
    rest: Option<(Measurement, u64)>,
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

impl RestMonitor {
    /// Enters an accepted sample.
    pub(crate) fn enter<T: Scalar>(&mut self, runtime: &Runtime<T>, sample: &Measurement) -> Motion {
        let longest_ns = runtime.paddle_age.hold_ns;
        let known = self.rest.filter(|(_, last_ns)| sample.time_ns.saturating_sub(*last_ns) <= longest_ns);
        let rested = known.filter(|(first, _)| are_within(&sample.values, &first.values, runtime.paddle_resolution));
        let (first, _) = rested.unwrap_or((*sample, sample.time_ns));
        self.rest = Some((first, sample.time_ns));
        match (known, rested) {
            (Some(_), None) => Motion::Moving,
            _ if sample.time_ns.saturating_sub(first.time_ns) >= longest_ns => Motion::Resting,
            _ => Motion::Unknown,
        }
    }
}
