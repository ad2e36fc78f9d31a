//! Largest values over a table.

use super::Table;
use crate::scalar::Scalar;

/// Largest values over all knots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TableBounds {
    /// Norm of the target displacement, with or without paddle motion, length.
    pub(crate) target_displacement: f64,
    /// |d(target displacement)/d(depth)|, with or without paddle motion.
    pub(crate) target_slope: f64,
    /// ‖J‖.
    pub(crate) jacobian_norm: f64,
    /// Slope of the paddle path at a knot times the interval beside it, length.
    pub(crate) path_lift: f64,
}

impl TableBounds {
    #[inline(never)]
    pub(crate) fn of<T: Scalar, const D: usize>(table: &Table<T, D>) -> Self {
        let mut bounds = Self::default();
        let raise = |bound: &mut f64, value: T| *bound = bound.max(value.to_f64());
        for knot in &table.knots {
            raise(&mut bounds.target_displacement, knot.target_displacement.norm());
            raise(&mut bounds.target_displacement, knot.static_target_displacement.norm());
            raise(&mut bounds.target_slope, knot.target_displacement_slope.norm());
            raise(&mut bounds.jacobian_norm, knot.jacobian.norm());
        }
        for pair in table.knots.windows(2) {
            if let [shallow, deep] = pair {
                let interval = deep.depth - shallow.depth;
                let rise = deep.static_target_displacement - shallow.static_target_displacement;
                raise(&mut bounds.target_slope, rise.norm() / interval);
                for knot in [shallow, deep] {
                    raise(&mut bounds.path_lift, knot.paddle_path_slope.norm() * interval);
                }
            }
        }
        bounds
    }
}
