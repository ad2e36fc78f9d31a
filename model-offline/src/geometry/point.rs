//! Points and vectors.

/// A point or vector in D dimensions, in scene length units.
pub type Point<const D: usize> = nalgebra::SVector<f64, D>;

/// A point or vector of the plane, in scene length units.
pub type Point2 = Point<2>;

/// The z component of `a × b`: twice the signed area of the triangle (0, a, b).
#[inline]
pub fn cross(a: Point2, b: Point2) -> f64 {
    a.x * b.y - a.y * b.x
}
