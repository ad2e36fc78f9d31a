//! Tables of tissue that goes over to another equilibrium between two knots.

use super::TableBuildError;
use crate::model::jumps::elsewhere;
use firmware::contract::Knot;

/// That a paddle's path goes elsewhere between these knots than its slopes at both say.
///
/// # Errors
/// [`TableBuildError::Jump`].
pub(super) fn refuse<const D: usize, const P: usize>(
    last: &Knot<f64, D, P>,
    next: &Knot<f64, D, P>,
) -> Result<(), TableBuildError> {
    let step = next.depth - last.depth;
    let slopes = [last.paddle_path_slope, next.paddle_path_slope].map(|slope| slope * step);
    match elsewhere(step, next.paddle_path - last.paddle_path, slopes) {
        Some(off) => Err(TableBuildError::Jump { from: last.depth, to: next.depth, off }),
        None => Ok(()),
    }
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

    /// As seen on an L of 80 mm whose surface folds beside the paddle: 5.4, 5.7 and 6.0 mm deep.
    #[test]
    fn a_path_that_turns_back_at_once_is_refused() {
        let before = [knot(5.4, 0.165, 0.04), knot(5.7, 0.177, 0.038)];
        assert_eq!(refuse(&before[0], &before[1]), Ok(()));
        let error = refuse(&before[1], &knot(6.0, 0.078, 0.02)).unwrap_err();
        assert!(matches!(error, TableBuildError::Jump { from: 5.7, to: 6.0, off } if off > 0.1), "{error}");
    }
}
