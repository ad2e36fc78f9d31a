//! Tissue that goes over to another equilibrium between two knots of a table.
//!
//! Static equilibria are not unique at large strains: a surface that is pressed together folds, a rim snaps round. Each of
//! Newton's steps then converges, to a state far from the last one, and nothing fails. What tells is the path itself: a smooth one
//! goes between two knots as far as the mean of its slopes there says, whatever power of the depth it grows with, and one that jumps
//! does not.

use super::TableBuildError;
use firmware::contract::Knot;

/// Part of the way between two knots by which it may differ from what their slopes say: d⁵ differs by 0.3, no power by 0.5.
const SMOOTH: f64 = 0.5;
/// Part of the needle's way between two knots below which a paddle's is rounding.
const ROUNDING: f64 = 1e-2;

/// That a paddle's path goes elsewhere between these knots than its slopes at both say.
///
/// # Errors
/// [`TableBuildError::Jump`].
pub(super) fn refuse<const D: usize, const P: usize>(
    last: &Knot<f64, D, P>,
    next: &Knot<f64, D, P>,
) -> Result<(), TableBuildError> {
    let step = next.depth - last.depth;
    let gone = next.paddle_path - last.paddle_path;
    let foreseen = (last.paddle_path_slope + next.paddle_path_slope) * (0.5 * step);
    let steepest = last.paddle_path_slope.norm().max(next.paddle_path_slope.norm());
    let off = (gone - foreseen).norm();
    if off > ROUNDING * step && off > SMOOTH * gone.norm().max(steepest * step) {
        return Err(TableBuildError::Jump { from: last.depth, to: next.depth, off });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    /// A knot of a path along (1, -1) that is `at` there, with this slope.
    fn knot(depth: f64, at: f64, slope: f64) -> Knot<f64, 2> {
        let along = Vector2::new(1.0, -1.0);
        Knot {
            depth,
            jacobian: [Matrix2::identity()],
            paddle_path: along * at,
            paddle_path_slope: along * slope,
            target_displacement: Vector2::zeros(),
            target_displacement_slope: Vector2::zeros(),
            static_target_displacement: Vector2::zeros(),
        }
    }

    #[test]
    fn no_power_of_the_depth_jumps_and_no_turn() {
        for power in 1..12 {
            let at = |depth: f64| knot(depth, depth.powi(power), f64::from(power) * depth.powi(power - 1));
            assert_eq!(refuse(&at(0.0), &at(1.0)), Ok(()), "{power}");
            assert_eq!(refuse(&at(0.7), &at(1.0)), Ok(()), "{power}");
        }
        let turning = |depth: f64| knot(depth, (depth - 0.5).powi(2), 2.0 * (depth - 0.5));
        assert_eq!(refuse(&turning(0.3), &turning(0.6)), Ok(()));
        // A paddle that has nothing to do moves by rounding.
        assert_eq!(refuse(&knot(0.0, 0.0, 1e-17), &knot(1.0, -3e-16, 2e-17)), Ok(()));
    }

    /// As seen on an L of 80 mm whose surface folds beside the paddle: 5.4, 5.7 and 6.0 mm deep.
    #[test]
    fn a_path_that_turns_back_at_once_is_refused() {
        let before = [knot(5.4, 0.165, 0.04), knot(5.7, 0.177, 0.038)];
        assert_eq!(refuse(&before[0], &before[1]), Ok(()));
        let error = refuse(&before[1], &knot(6.0, 0.078, 0.02)).unwrap_err();
        assert!(matches!(error, TableBuildError::Jump { from: 5.7, to: 6.0, off } if off > 0.1), "{error}");
    }
}
