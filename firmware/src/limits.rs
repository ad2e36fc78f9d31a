//! Position and rate limits, and the anti-windup that goes with them.
//!
//! Both limits hold for *every* command: `|u| ≤ u_max` and `|u − u_previous| ≤ Δ_max`, up to the rounding of one
//! addition. The admissible set is convex, so that a step towards an admissible position stays admissible.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use crate::scalar::{Scalar, bounded};

/// Shape of the admissible positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PositionLimit {
    /// Norm of the displacement: a disc; saturation keeps the direction.
    #[default]
    Norm,
    /// Each axis by itself: the largest square inside the disc.
    Box,
}

/// Limits of a paddle in runtime form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<T: Scalar> {
    /// Shape of the admissible positions.
    pub shape: PositionLimit,
    /// Largest norm of the displacement, length.
    pub max_displacement: T,
    /// Largest norm of the change per tick, length.
    pub max_step: T,
}

/// A command within the limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited<T: Scalar, const D: usize> {
    /// The admissible displacement nearest along the way, length.
    pub displacement: SVector<T, D>,
    /// The setpoint was outside the admissible positions.
    pub position_limited: bool,
    /// The setpoint was further than one tick's step.
    pub rate_limited: bool,
}

impl<T: Scalar> Limits<T> {
    /// Admissible position for the setpoint `displacement`.
    pub fn clamp_position<const D: usize>(&self, displacement: &SVector<T, D>) -> SVector<T, D> {
        self.nearest(displacement).unwrap_or(*displacement)
    }

    /// The nearest admissible position; `None` for one that is admissible itself. Inlined, as [`shortened`] is: passing a
    /// position through memory takes longer than finding that it is admissible.
    #[inline(always)]
    fn nearest<const D: usize>(&self, displacement: &SVector<T, D>) -> Option<SVector<T, D>> {
        match self.shape {
            PositionLimit::Norm => shortened(displacement, self.max_displacement),
            PositionLimit::Box => self.nearest_in_box(displacement),
        }
    }

    #[inline(never)]
    fn nearest_in_box<const D: usize>(&self, displacement: &SVector<T, D>) -> Option<SVector<T, D>> {
        let half_edge = self.max_displacement / T::of(D as f64).sqrt();
        let inside = displacement.map(|component| bounded(component, -half_edge, half_edge));
        (inside.as_slice() != displacement.as_slice()).then_some(inside)
    }

    /// The command that goes from `previous` towards `setpoint` as far as one tick allows; keeps the direction.
    pub fn command<const D: usize>(&self, previous: &SVector<T, D>, setpoint: &SVector<T, D>) -> Limited<T, D> {
        let nearest = self.nearest(setpoint);
        let admissible = nearest.unwrap_or(*setpoint);
        let short_step = shortened(&(admissible - previous), self.max_step);
        // Without the rate limit, take the position itself: previous + (setpoint − previous) would round.
        let displacement = short_step.map_or(admissible, |step| previous + step);
        Limited { displacement, position_limited: nearest.is_some(), rate_limited: short_step.is_some() }
    }

    /// Integral feedback after `correction`, without windup.
    ///
    /// The setpoint is `feed_forward + integral`, the command before this tick `previous`.
    /// - A correction that would leave the admissible positions is taken up to their boundary; once outside
    ///   (the feed-forward may push there), only corrections that lead back are taken.
    /// - While the paddle is still on its way at full rate, corrections that ask for more of the same are not taken:
    ///   the error they answer will be gone when the paddle arrives.
    pub fn integrate<const D: usize>(
        &self,
        integral: &SVector<T, D>,
        correction: &SVector<T, D>,
        feed_forward: &SVector<T, D>,
        previous: &SVector<T, D>,
    ) -> SVector<T, D> {
        let setpoint = feed_forward + integral;
        let nearest = self.nearest(&setpoint);
        let pending = nearest.unwrap_or(setpoint) - previous;
        if pending.norm_squared() > self.max_step * self.max_step && pending.dot(correction) > T::zero() {
            return *integral;
        }
        let corrected = setpoint + correction;
        match (nearest, self.nearest(&corrected)) {
            (_, None) => integral + correction,
            (None, Some(boundary)) => boundary - feed_forward,
            (Some(before), Some(after)) if (corrected - after).norm_squared() < (setpoint - before).norm_squared() => {
                integral + correction
            }
            _ => *integral,
        }
    }
}

/// The direction of `vector` with norm `limit`; `None` for a vector that is no longer than that, or by rounding only.
#[inline(always)]
fn shortened<T: Scalar, const D: usize>(vector: &SVector<T, D>, limit: T) -> Option<SVector<T, D>> {
    // Compared in squares: a square root costs more than all the rest on most microcontrollers.
    let squared = vector.norm_squared();
    if squared <= limit * limit { None } else { cut(vector, squared, limit) }
}

/// The rest of [`shortened`], which most steps do not need: there once, so that the comparison is cheap.
#[cold]
#[inline(never)]
fn cut<T: Scalar, const D: usize>(vector: &SVector<T, D>, squared: T, limit: T) -> Option<SVector<T, D>> {
    let factor = limit / squared.sqrt();
    let short = vector.map(|component| component * factor);
    // As slices: matrices compare with more code than all the rest here.
    (short.as_slice() != vector.as_slice()).then_some(short)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use proptest::prelude::*;

    use super::*;

    const LIMITS: Limits<f64> = Limits { shape: PositionLimit::Norm, max_displacement: 1.0, max_step: 0.1 };

    #[test]
    fn direction_is_kept() {
        let limited = LIMITS.command(&Vector2::zeros(), &Vector2::new(3.0, 4.0));
        assert!((limited.displacement - Vector2::new(0.06, 0.08)).norm() < 1e-15);
        assert!(limited.position_limited && limited.rate_limited);
    }

    #[test]
    fn a_box_limits_each_axis() {
        let limits = Limits { shape: PositionLimit::Box, ..LIMITS };
        let clamped = limits.clamp_position(&Vector2::new(9.0, -0.1));
        assert!((clamped - Vector2::new(0.5f64.sqrt(), -0.1)).norm() < 1e-15);
    }

    #[test]
    fn saturation_does_not_wind_up_and_recovery_is_immediate() {
        let (zero, push) = (Vector2::zeros(), Vector2::new(0.3, 0.0));
        let mut integral = zero;
        let mut previous = zero;
        for _ in 0..1000 {
            integral = LIMITS.integrate(&integral, &push, &zero, &previous);
            previous = LIMITS.command(&previous, &integral).displacement;
            assert!(integral.norm() <= 1.0 + 1e-12);
        }
        assert!((previous.x - 1.0).abs() < 1e-12);
        let back = LIMITS.integrate(&integral, &-push, &zero, &previous);
        assert!((back.x - 0.7).abs() < 1e-12, "the first correction back acts in full");
    }

    #[test]
    fn outside_only_corrections_that_lead_back_are_taken() {
        let limits = Limits { shape: PositionLimit::Box, max_step: 10.0, ..LIMITS };
        let edge = 0.5f64.sqrt();
        let (outside, previous) = (Vector2::new(edge + 0.2, 0.0), Vector2::new(edge, 0.0));
        let integrate = |x: f64, y: f64| limits.integrate(&outside, &Vector2::new(x, y), &Vector2::zeros(), &previous);
        assert_eq!(integrate(-0.1, 0.0), Vector2::new(edge + 0.2, 0.0) + Vector2::new(-0.1, 0.0));
        assert_eq!(integrate(0.1, 0.0), outside, "further out");
        assert_eq!(integrate(0.0, 0.3), outside, "along the boundary: no nearer");
        // One that leaves the admissible positions is taken up to their boundary.
        let inside = limits.integrate(&Vector2::zeros(), &Vector2::new(2.0, 0.1), &Vector2::zeros(), &Vector2::zeros());
        assert!((inside - Vector2::new(edge, 0.1)).norm() < 1e-15);
        // On its way at full rate, the paddle is asked for no more of the same, but for less at once.
        let slow = Limits { max_step: 0.1, ..LIMITS };
        let (goal, zero) = (Vector2::new(0.5, 0.0), Vector2::zeros());
        let underway = |x: f64| slow.integrate(&goal, &Vector2::new(x, 0.0), &zero, &zero);
        assert_eq!((underway(0.1), underway(-0.1)), (goal, Vector2::new(0.4, 0.0)));
    }

    #[test]
    fn a_paddle_that_one_tick_brings_there_is_not_on_its_way() {
        let (zero, correction) = (Vector2::zeros(), Vector2::new(0.3, 0.0));
        // One tick goes 0.1.
        for (goal, taken) in [(0.099, 0.3), (0.101, 0.0)] {
            let integral = LIMITS.integrate(&Vector2::new(goal, 0.0), &correction, &zero, &zero);
            assert!((integral.x - (goal + taken)).abs() < 1e-15, "{goal}: {integral}");
        }
    }

    #[test]
    fn at_the_boundary_feed_forward_and_integral_are_the_position_together() {
        let feed_forward = Vector2::new(0.0, 0.6);
        let integral = LIMITS.integrate(&Vector2::zeros(), &Vector2::new(8.0, 5.4), &feed_forward, &feed_forward);
        assert!((integral - Vector2::new(0.8, 0.0)).norm() < 1e-15, "{integral}");
    }

    proptest! {
        #[test]
        fn what_is_cut_differs_and_the_rest_is_left_alone(angle in 0.0..6.3f64, limit in 0.1..10.0f64, ulps in -9..9i32) {
            // A few rounding errors around the limit, where a longer vector may be cut to itself.
            let norm = limit * (1.0 + f64::from(ulps) * f64::EPSILON);
            let vector = Vector2::new(norm * libm::cos(angle), norm * libm::sin(angle));
            let longer = vector.norm_squared() > limit * limit;
            let expected = if longer { vector * (limit / vector.norm()) } else { vector };
            prop_assert_eq!(shortened(&vector, limit), (expected != vector).then_some(expected));
        }

        #[test]
        fn both_limits_hold_for_any_setpoint(
            start in (-0.7..0.7f64, -0.7..0.7f64),
            setpoints in prop::collection::vec((-1e3..1e3f64, -1e3..1e3f64), 1..50),
        ) {
            let mut previous = Vector2::new(start.0, start.1);
            for (x, y) in setpoints {
                let next = LIMITS.command(&previous, &Vector2::new(x, y)).displacement;
                prop_assert!(next.norm() <= 1.0 + 1e-14);
                prop_assert!((next - previous).norm() <= 0.1 + 1e-14);
                previous = next;
            }
        }
    }
}
