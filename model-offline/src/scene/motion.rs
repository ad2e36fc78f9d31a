//! What moves a patient while the needle goes in.

use crate::geometry::Point2;
use crate::random::SplitMix64;
use serde::Serialize;
use std::f64::consts::PI;

/// What moves the immobile part, from the start of the needle on: the sum of all there is.
///
/// # Example
/// ```
/// use model_offline::scene::{Breathing, Motion};
///
/// let breathing = Breathing { period: 4.0, amplitude: 3.0, direction: [0.0, 1.0].into(), ..Breathing::default() };
/// let motion = Motion { breathing: Some(breathing), ..Motion::default() };
/// assert_eq!(motion.displacement(-1.0).y, 0.0); // exhaled, before the needle starts
/// assert!((motion.displacement(2.0).y - 3.0).abs() < 1e-12); // inhaled
/// assert!(motion.displacement(4.0).y.abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Motion {
    /// Breathing.
    pub breathing: Option<Breathing>,
    /// A cough, or a jerk.
    pub surge: Option<Surge>,
    /// Rows of time in s, and displacement.
    pub recorded: Vec<(f64, Point2)>,
}

/// `amplitude · (1 − cos⁴(π t / period))`, from the end of an exhalation on: long at rest exhaled, short inhaled (Lujan et
/// al., Medical Physics 26, 1999).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Breathing {
    /// Seconds per breath.
    pub period: f64,
    /// From exhaled to inhaled, length.
    pub amplitude: f64,
    /// Unit vector.
    pub direction: Point2,
    /// Each breath takes up to this part longer or shorter.
    #[serde(skip_serializing_if = "is_zero")]
    pub period_variation: f64,
    /// Each breath is up to this part larger or smaller.
    #[serde(skip_serializing_if = "is_zero")]
    pub amplitude_variation: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde asks")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Breathing {
    /// Distance from the exhaled body so many seconds after the start of the first breath, length.
    fn distance(&self, time: f64) -> f64 {
        let (phase, amplitude) = self.breath_at(time);
        amplitude * (1.0 - (PI * phase).cos().powi(4))
    }

    /// The part of its breath that is over, and the size of that breath.
    fn breath_at(&self, time: f64) -> (f64, f64) {
        if self.period_variation == 0.0 && self.amplitude_variation == 0.0 {
            return (time / self.period, self.amplitude);
        }
        // The same breaths in every run.
        let mut random = SplitMix64(1);
        let mut left = time;
        loop {
            let period = self.period * (1.0 + self.period_variation * random.symmetric());
            let amplitude = self.amplitude * (1.0 + self.amplitude_variation * random.symmetric());
            if left <= period {
                return (left / period, amplitude);
            }
            left -= period;
        }
    }
}

/// `amplitude · sin²(π (t − at) / last)` while it lasts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Surge {
    /// Seconds after the start of the needle.
    pub at: f64,
    /// Seconds that it lasts.
    pub last: f64,
    /// Largest displacement, length.
    pub amplitude: f64,
    /// Unit vector.
    pub direction: Point2,
}

impl Motion {
    /// Whether nothing moves.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The longest step of time that follows everything that moves, s; none where nothing does.
    pub fn longest_step(&self) -> Option<f64> {
        let breathing = self.breathing.map(|breathing| (1.0 - breathing.period_variation) * breathing.period / 40.0);
        let surge = self.surge.map(|surge| surge.last / 20.0);
        let rows = self.recorded.windows(2).map(|pair| 0.25 * (pair[1].0 - pair[0].0));
        breathing.into_iter().chain(surge).chain(rows).min_by(f64::total_cmp)
    }

    /// Displacement of the immobile part so many seconds after the start of the needle; none before.
    pub fn displacement(&self, since_start: f64) -> Point2 {
        if since_start <= 0.0 {
            return Point2::zeros();
        }
        let breathed = self
            .breathing
            .map_or_else(Point2::zeros, |breathing| breathing.direction * breathing.distance(since_start));
        let surged = self.surge.map_or_else(Point2::zeros, |Surge { at, last, amplitude, direction }| {
            let share = ((since_start - at) / last).clamp(0.0, 1.0);
            direction * (amplitude * (PI * share).sin().powi(2))
        });
        breathed + surged + self.recorded_at(since_start)
    }

    fn recorded_at(&self, time: f64) -> Point2 {
        let after = self.recorded.partition_point(|(at, _)| *at <= time);
        match (after.checked_sub(1).map(|before| self.recorded[before]), self.recorded.get(after).copied()) {
            (None, None) => Point2::zeros(),
            (None, Some((_, only))) | (Some((_, only)), None) => only,
            (Some((from, a)), Some((to, b))) => a + (b - a) * ((time - from) / (to - from)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_that_moves_adds_up_and_nothing_moves_before_the_needle() {
        let motion = Motion {
            breathing: Some(Breathing {
                period: 4.0,
                amplitude: 2.0,
                direction: Point2::new(0.0, 1.0),
                ..Breathing::default()
            }),
            surge: Some(Surge { at: 1.0, last: 0.5, amplitude: 5.0, direction: Point2::new(1.0, 0.0) }),
            recorded: vec![(0.5, Point2::new(0.1, 0.0)), (1.5, Point2::new(0.3, 0.2))],
        };
        assert_eq!(motion.displacement(0.0), Point2::zeros());
        // cos⁴ = 1/4 at an eighth of a turn; the middle of the cough; half way between the rows.
        let at_once = motion.displacement(1.25);
        let breath = 2.0 * (1.0 - (PI * 1.25 / 4.0).cos().powi(4));
        assert!((at_once - Point2::new(5.0 + 0.25, breath + 0.15)).norm() < 1e-12, "{at_once}");
        assert!((motion.displacement(1.0).y - (2.0 * 0.75 + 0.1)).abs() < 1e-12);
        // Its ends are held.
        assert!((motion.displacement(9.0).x - 0.3).abs() < 1e-12);
        assert!((motion.displacement(0.1).x - 0.1).abs() < 1e-12);
        assert!(!motion.is_none() && Motion::default().is_none());
    }

    /// No two breaths are alike, each is within what is said, and the body never jumps.
    #[test]
    fn breaths_vary_within_what_is_said() {
        let direction = Point2::new(0.0, 1.0);
        let breathing =
            Breathing { period: 4.0, amplitude: 2.0, direction, period_variation: 0.1, amplitude_variation: 0.25 };
        let motion = Motion { breathing: Some(breathing), ..Motion::default() };
        let at = |k: usize| motion.displacement(1e-3 * k as f64).y;
        let heights: Vec<f64> = (0..400_000).map(at).collect();
        let tops: Vec<usize> =
            (1..399_999).filter(|k| heights[*k] > heights[k - 1] && heights[*k] >= heights[k + 1]).collect();
        let steepest = heights.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(steepest < 1e-3 * 2.5 * PI / 3.6 * 1.5, "{steepest}");
        let sizes = || tops.iter().map(|k| heights[*k]);
        assert!(sizes().all(|size| (1.5..=2.5).contains(&size)));
        assert!(sizes().fold(0.0, f64::max) > 2.4 && sizes().fold(9.0, f64::min) < 1.6);
        // From top to top is half of one breath and half of the next.
        let apart: Vec<f64> = tops.windows(2).map(|pair| 1e-3 * (pair[1] - pair[0]) as f64).collect();
        assert!(apart.iter().all(|apart| (3.6 - 2e-3..=4.4 + 2e-3).contains(apart)));
        assert!((apart.iter().sum::<f64>() / apart.len() as f64 - 4.0).abs() < 0.1 && apart.len() > 90);
        assert!(motion.longest_step().unwrap() <= 3.6 / 40.0 + 1e-12);
    }
}
