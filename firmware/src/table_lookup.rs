//! Interpolation of the table in needle depth.
//!
//! The feed-forward path and the target displacement are cubic Hermite in depth (their slopes are in the table); the
//! Jacobian is linear. Depths outside the table are clamped to its ends and flagged: nothing is ever extrapolated.

use nalgebra::{SMatrix, SVector};

use crate::contract::{Knot, Table};
use crate::scalar::{Scalar, bounded};

/// A depth located in the table: the two knots around it and the position between them.
#[derive(Clone, Copy, Debug)]
pub struct TableLocation<'t, T: Scalar, const D: usize = 2, const P: usize = 1> {
    left: &'t Knot<T, D, P>,
    right: &'t Knot<T, D, P>,
    /// Distance of the knots, length.
    interval: T,
    /// 0 at the left knot, 1 at the right one.
    fraction: T,
    /// Where this is: the depth that was asked for, moved into the table.
    pub depth: T,
    /// The depth was outside the table and has been moved to its nearest end.
    pub clamped: bool,
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Table<T, D, N, P> {
    /// Locates `depth` by bisection; `None` only for a table with fewer than two knots, which validation refuses.
    pub fn locate(&self, depth: T) -> Option<TableLocation<'_, T, D, P>> {
        let (first, last) = (self.knots.first()?, self.knots.last()?);
        let inside = bounded(depth, first.depth, last.depth);
        let right_index =
            self.knots.partition_point(|knot| knot.depth <= inside).min(self.knots.len().saturating_sub(1)).max(1);
        let (left, right) = (self.knots.get(right_index - 1)?, self.knots.get(right_index)?);
        let interval = right.depth - left.depth;
        Some(TableLocation {
            left,
            right,
            interval,
            depth: inside,
            fraction: (inside - left.depth) / interval,
            clamped: inside != depth,
        })
    }
}

impl<T: Scalar, const D: usize, const P: usize> TableLocation<'_, T, D, P> {
    /// Feed-forward paddle displacements, length; a column per paddle.
    pub fn paddle_path(&self) -> SMatrix<T, D, P> {
        self.hermite(
            (&self.left.paddle_path, &self.left.paddle_path_slope),
            (&self.right.paddle_path, &self.right.paddle_path_slope),
        )
    }

    /// Target displacement along the feed-forward path, length.
    pub fn target_displacement(&self) -> SVector<T, D> {
        self.hermite(
            (&self.left.target_displacement, &self.left.target_displacement_slope),
            (&self.right.target_displacement, &self.right.target_displacement_slope),
        )
    }

    /// Target displacement with the paddles held at zero, length.
    pub fn static_target_displacement(&self) -> SVector<T, D> {
        self.left.static_target_displacement.lerp(&self.right.static_target_displacement, self.fraction)
    }

    /// Actuation Jacobian of each paddle; rows target, columns paddle.
    pub fn jacobian(&self) -> [SMatrix<T, D, D>; P] {
        let mut jacobians = [SMatrix::zeros(); P];
        for (jacobian, (left, right)) in jacobians.iter_mut().zip(self.left.jacobian.iter().zip(&self.right.jacobian)) {
            *jacobian = left.zip_map(right, |left, right| left + (right - left) * self.fraction);
        }
        jacobians
    }

    /// Cubic through values and slopes at both knots, with s the fraction and h the interval:
    /// p = p₀ + s·(h·m₀ + s·((3Δ − 2h·m₀ − h·m₁) + s·(h·m₀ + h·m₁ − 2Δ))), Δ = p₁ − p₀.
    fn hermite<const C: usize>(
        &self,
        (left, left_slope): (&SMatrix<T, D, C>, &SMatrix<T, D, C>),
        (right, right_slope): (&SMatrix<T, D, C>, &SMatrix<T, D, C>),
    ) -> SMatrix<T, D, C> {
        let s = self.fraction;
        let (two, three) = (T::of(2.0), T::of(3.0));
        // One component at a time: every operation on vectors would be a loop of its own in code compiled for size. No index,
        // so that none can be out of bounds however the loops are compiled.
        let mut path = *left;
        let right = right.as_slice().iter().zip(right_slope.as_slice());
        for ((path, left_slope), (right, right_slope)) in
            path.as_mut_slice().iter_mut().zip(left_slope.as_slice()).zip(right)
        {
            let left = *path;
            let rise = *right - left;
            let start = *left_slope * self.interval;
            let end = *right_slope * self.interval;
            let quadratic = rise * three - start * two - end;
            let cubic = start + end - rise * two;
            *path = left + (start + (quadratic + cubic * s) * s) * s;
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use crate::contract::example::table;

    #[test]
    fn hermite_reproduces_a_cubic_and_its_knots() {
        let mut table = table();
        let path = |z: f64| Vector2::new(z - 3.0 * z * z, 2.0 * z * z * z);
        for knot in &mut table.knots {
            let z = knot.depth;
            knot.paddle_path = path(z);
            knot.paddle_path_slope = Vector2::new(1.0 - 6.0 * z, 6.0 * z * z);
        }
        for step in 0..=100 {
            let depth = 0.1 * f64::from(step) / 100.0;
            let location = table.locate(depth).unwrap();
            assert!(!location.clamped);
            assert!((location.paddle_path() - path(depth)).norm() < 1e-15);
        }
    }

    #[test]
    fn jacobians_are_linear_between_knots() {
        let mut table = table();
        let [at_start] = table.knots[0].jacobian;
        for knot in &mut table.knots {
            knot.jacobian = [at_start * (1.0 + 10.0 * knot.depth)];
        }
        for step in 0..=100 {
            let depth = 0.1 * f64::from(step) / 100.0;
            let [found] = table.locate(depth).unwrap().jacobian();
            assert!((found - at_start * (1.0 + 10.0 * depth)).norm() < 1e-15, "{depth}: {found}");
        }
    }

    #[test]
    fn outside_is_clamped_and_flagged() {
        let table = table();
        for (outside, end) in [(-0.01, 0.0), (0.11, 0.1)] {
            let (clamped, at_end) = (table.locate(outside).unwrap(), table.locate(end).unwrap());
            assert!(clamped.clamped && !at_end.clamped);
            assert_eq!(clamped.paddle_path(), at_end.paddle_path());
            assert_eq!(clamped.jacobian(), at_end.jacobian());
        }
    }
}
