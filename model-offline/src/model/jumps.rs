//! Tissue that goes over to another equilibrium between two states of an insertion.
//!
//! Static equilibria are not unique at large strains: a surface that is pressed together folds, a rim snaps round. Each of
//! Newton's steps then converges, to a state far from the last one, and nothing fails. What tells is the path itself: one that bends
//! one way goes between two states by no less than its smaller slope there says and by no more than its larger, also where a limit
//! is near and the slope grows beyond bounds. One that jumps does not. Jumps that are small beside what is gone in a step are not seen.

use super::Body;
use nalgebra::{SMatrix, Vector1, Vector2};
use serde::Serialize;

/// Part of the way between two states by which it may be outside of what their slopes say: paths that bend both ways in a step are.
const SMOOTH: f64 = 0.5;
/// Part of the controls' way between two states below which a response's is rounding.
const ROUNDING: f64 = 1e-2;

/// How far a response that has `gone` so far between two states is outside of where its slopes at both lead, length; none where it
/// goes there. Slopes are what they say of the whole step, in which the controls go `way`.
pub(crate) fn elsewhere<const R: usize, const C: usize>(
    way: f64,
    gone: SMatrix<f64, R, C>,
    slopes: [SMatrix<f64, R, C>; 2],
) -> Option<f64> {
    let bounds = slopes[0].zip_map(&slopes[1], |a, b| (a.min(b), a.max(b)));
    let off = gone.zip_map(&bounds, |gone, (least, most)| gone - gone.max(least).min(most)).norm();
    let steepest = slopes[0].norm().max(slopes[1].norm());
    (off > ROUNDING * way && off > SMOOTH * gone.norm().max(steepest)).then_some(off)
}

/// Where the target went elsewhere than its slopes lead, along the needle or across it: what it does along it is the more by far, and
/// would hide the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Jump {
    /// Needle depth before, length.
    pub from: f64,
    /// Needle depth behind, length.
    pub to: f64,
    /// How far the target is there outside of where its slopes at both lead, length.
    pub off: f64,
}

/// The target on an insertion in which the paddle goes along with the needle: finds the first jump.
#[derive(Debug)]
pub struct TargetPath {
    /// Paddle displacement per depth of the needle.
    paddle: Vector2<f64>,
    /// Depth, target displacement and its slope by the depth, where it could be had.
    last: Option<(f64, Vector2<f64>, Vector2<f64>)>,
    found: Option<Jump>,
}

impl TargetPath {
    /// From a body at rest; the paddle goes so far per depth of the needle.
    pub fn from_rest(body: &mut Body<'_>, paddle: Vector2<f64>) -> Self {
        let mut path = Self { paddle, last: None, found: None };
        path.goes_on(body);
        path
    }

    /// Takes in the body's next state. One that is not stable has no slope, and nothing is said of the steps beside it.
    pub fn goes_on(&mut self, body: &mut Body<'_>) {
        let slope = self.slope(body);
        let here = slope.map(|slope| (body.depth(), body.target_displacement(), slope));
        if let (Some((from, before, slope)), Some((to, behind, next)), None) = (self.last, here, self.found) {
            let step = to - from;
            let (gone, slopes) = (behind - before, [slope * step, next * step]);
            let off = body.directions().into_iter().filter_map(|direction| {
                let along = |way: Vector2<f64>| Vector1::new(way.dot(&direction));
                elsewhere(step * self.paddle.norm().max(1.0), along(gone), slopes.map(along))
            });
            self.found = off.reduce(f64::max).map(|off| Jump { from, to, off });
        }
        self.last = here;
    }

    fn slope(&self, body: &mut Body<'_>) -> Option<Vector2<f64>> {
        let by_depth = body.depth_sensitivity().ok()?;
        if self.paddle == Vector2::zeros() {
            return Some(by_depth);
        }
        Some(by_depth + body.actuation_jacobian().ok()? * self.paddle)
    }

    /// The first jump.
    pub fn jump(&self) -> Option<Jump> {
        self.found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a response is that grows along (1, -1), and its slope over the whole step.
    fn off(from: [f64; 2], to: [f64; 2], step: f64) -> Option<f64> {
        let along = Vector2::new(1.0, -1.0);
        elsewhere(step, along * (to[0] - from[0]), [along * (from[1] * step), along * (to[1] * step)])
    }

    #[test]
    fn no_power_of_the_depth_jumps_and_no_turn() {
        for power in 1..12 {
            let at = |depth: f64| [depth.powi(power), f64::from(power) * depth.powi(power - 1)];
            assert_eq!(off(at(0.0), at(1.0), 1.0), None, "{power}");
            assert_eq!(off(at(0.7), at(1.0), 0.3), None, "{power}");
        }
        // Before a limit the slope grows beyond bounds.
        let limit = |depth: f64| [-(1.0 - depth).sqrt(), 0.5 / (1.0 - depth).sqrt()];
        for end in [0.9, 0.999, 0.999_999_9] {
            assert_eq!(off(limit(0.7), limit(end), end - 0.7), None, "{end}");
        }
        let turning = |depth: f64| [(depth - 0.5).powi(2), 2.0 * (depth - 0.5)];
        assert_eq!(off(turning(0.3), turning(0.6), 0.3), None);
        // What has nothing to do moves by rounding.
        assert_eq!(off([0.0, 1e-17], [-3e-16, 2e-17], 1.0), None);
    }

    /// As seen on an L of 80 mm whose surface folds beside the paddle: 5.4, 5.7 and 6.0 mm deep.
    #[test]
    fn a_path_that_turns_back_at_once_jumps() {
        assert_eq!(off([0.165, 0.04], [0.177, 0.038], 0.3), None);
        let off = off([0.177, 0.038], [0.078, 0.02], 0.3);
        assert!(off.is_some_and(|off| off > 0.1), "{off:?}");
    }
}
