//! Largest values over a table.

use super::Table;
use crate::scalar::Scalar;

/// Largest values over all knots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TableBounds<const P: usize = 1> {
    /// Norm of the target displacement, with or without paddle motion, length.
    pub(crate) target_displacement: f64,
    /// |d(target displacement)/d(depth)|, with or without paddle motion.
    pub(crate) target_slope: f64,
    /// ‖J‖ of each paddle.
    pub(crate) jacobian_norm: [f64; P],
    /// Slope of each paddle's path at a knot times the interval beside it, length.
    pub(crate) path_lift: [f64; P],
}

impl<const P: usize> TableBounds<P> {
    #[inline(never)]
    pub(crate) fn of<T: Scalar, const D: usize, const N: usize>(table: &Table<T, D, N, P>) -> Self {
        let mut bounds =
            Self { target_displacement: 0.0, target_slope: 0.0, jacobian_norm: [0.0; P], path_lift: [0.0; P] };
        let raise = |bound: &mut f64, value: T| *bound = bound.max(value.to_f64());
        for knot in &table.knots {
            raise(&mut bounds.target_displacement, knot.target_displacement.norm());
            raise(&mut bounds.target_displacement, knot.static_target_displacement.norm());
            raise(&mut bounds.target_slope, knot.target_displacement_slope.norm());
            for (bound, jacobian) in bounds.jacobian_norm.iter_mut().zip(&knot.jacobian) {
                raise(bound, jacobian.norm());
            }
        }
        for pair in table.knots.windows(2) {
            if let [shallow, deep] = pair {
                let interval = deep.depth - shallow.depth;
                let rise = deep.static_target_displacement - shallow.static_target_displacement;
                raise(&mut bounds.target_slope, rise.norm() / interval);
                for knot in [shallow, deep] {
                    for (bound, slope) in bounds.path_lift.iter_mut().zip(knot.paddle_path_slope.column_iter()) {
                        raise(bound, slope.norm() * interval);
                    }
                }
            }
        }
        bounds
    }
}
