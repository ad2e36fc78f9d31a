//! Where needle and paddles were when the target was measured.

use nalgebra::SMatrix;

use crate::scalar::Scalar;

/// Moments that are remembered.
const MOMENTS: usize = 16;
// Indices of the ring wrap with those of the machine.
const _: () = assert!(MOMENTS.is_power_of_two());

/// Intervals between them: the newest moment lies anywhere within one, and one more may be cut off by a late tick.
pub(crate) const INTERVALS: u64 = MOMENTS as u64 - 2;

/// Needle and paddles at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment<T: Scalar, const D: usize = 2, const P: usize = 1> {
    /// When the paddles are there, ns.
    pub(super) time_ns: u64,
    /// Depth of the needle, length.
    pub(super) depth: T,
    /// Displacements of the paddles, length; a column each.
    pub(super) paddles: SMatrix<T, D, P>,
}

/// The last moments, no closer than a spacing but for the newest: a ring.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct History<T: Scalar, const D: usize = 2, const P: usize = 1> {
    moments: [Moment<T, D, P>; MOMENTS],
    newest: usize,
    count: usize,
}

impl<T: Scalar, const D: usize, const P: usize> Default for History<T, D, P> {
    fn default() -> Self {
        let empty = Moment { time_ns: 0, depth: T::ZERO, paddles: SMatrix::zeros() };
        Self { moments: [empty; MOMENTS], newest: 0, count: 0 }
    }
}

impl<T: Scalar, const D: usize, const P: usize> History<T, D, P> {
    /// Adds the newest moment.
    pub(super) fn record(&mut self, spacing_ns: u64, moment: Moment<T, D, P>) {
        let is_spaced = match (self.ago(0), self.ago(1)) {
            (Some(newest), _) if moment.time_ns < newest.time_ns => {
                // Another clock: what was before it is of no use.
                self.count = 0;
                true
            }
            (Some(newest), Some(before)) => newest.time_ns - before.time_ns >= spacing_ns,
            _ => true,
        };
        if is_spaced {
            self.newest = self.newest.wrapping_add(1) % MOMENTS;
            self.count = (self.count + 1).min(MOMENTS);
        }
        if let Some(newest) = self.moments.get_mut(self.newest) {
            *newest = moment;
        }
    }

    /// Needle and paddles at a time, between the moments around it; before the oldest, the oldest. `None` if nothing is
    /// remembered.
    pub(super) fn at(&self, time_ns: u64) -> Option<Moment<T, D, P>> {
        let mut later = self.ago(0)?;
        for ago in 0..self.count {
            let moment = self.ago(ago)?;
            if moment.time_ns <= time_ns {
                return Some(between(moment, later, time_ns));
            }
            later = moment;
        }
        Some(*later)
    }

    fn ago(&self, ago: usize) -> Option<&Moment<T, D, P>> {
        if ago < self.count { self.moments.get(self.newest.wrapping_sub(ago) % MOMENTS) } else { None }
    }
}

fn between<T: Scalar, const D: usize, const P: usize>(
    earlier: &Moment<T, D, P>,
    later: &Moment<T, D, P>,
    time_ns: u64,
) -> Moment<T, D, P> {
    if time_ns >= later.time_ns {
        return *later;
    }
    // Both differences are below the spacing, seconds at most.
    let part = |ns: u64| T::of(f64::from(u32::try_from(ns).unwrap_or(u32::MAX)));
    let fraction = part(time_ns - earlier.time_ns) / part(later.time_ns - earlier.time_ns);
    Moment {
        time_ns,
        depth: earlier.depth + (later.depth - earlier.depth) * fraction,
        paddles: earlier.paddles.zip_map(&later.paddles, |before, after| before + (after - before) * fraction),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    const MS: u64 = 1_000_000;

    fn moment(ms: u64) -> Moment<f64> {
        let x = ms as f64;
        Moment { time_ns: ms * MS, depth: 2.0 * x, paddles: Vector2::new(x, -x) }
    }

    #[test]
    fn a_straight_motion_is_known_at_every_time_that_the_ring_spans() {
        let spacing_ns = 3 * MS;
        let mut history = History::default();
        assert_eq!(history.at(5), None);
        for ms in 10..=500 {
            history.record(spacing_ns, moment(ms));
            let oldest = 10.0f64.max(ms as f64 - (INTERVALS * 3) as f64);
            for ago in [0.0, 0.25, 1.0, 3.0, 10.5, 30.0, 42.0] {
                let asked = (ms as f64 - ago).max(oldest);
                let found = history.at((asked * MS as f64) as u64).unwrap();
                assert!((found.depth - 2.0 * asked).abs() < 1e-9, "{ms} − {ago}: {found:?}");
                assert!((found.paddles - Vector2::new(asked, -asked)).norm() < 1e-9);
            }
        }
        assert_eq!(history.at(1_000 * MS), Some(moment(500)), "nothing is extrapolated");
        assert!(history.at(0).unwrap().time_ns >= 450 * MS, "the oldest");
    }

    #[test]
    fn a_clock_that_goes_back_starts_over() {
        let mut history = History::default();
        (10..=500).for_each(|ms| history.record(MS, moment(ms)));
        history.record(MS, moment(3));
        assert_eq!(history.at(400 * MS), Some(moment(3)));
        assert_eq!(history.at(0), Some(moment(3)));
    }
}
