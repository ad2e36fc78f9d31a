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

/// Lowest and highest coordinates; none without points.
pub fn box_of<'a>(points: impl IntoIterator<Item = &'a Point<3>>) -> Option<(Point<3>, Point<3>)> {
    let grow = |bounds: Option<(Point<3>, Point<3>)>, x: &Point<3>| match bounds {
        Some((low, high)) => Some((low.inf(x), high.sup(x))),
        None => Some((*x, *x)),
    };
    points.into_iter().fold(None, grow)
}

/// A point as messages show it.
pub(crate) fn shown(x: &Point<3>) -> String {
    format!("({}, {}, {})", digits(x.x), digits(x.y), digits(x.z))
}

/// Six significant digits, and no more than the number has.
pub(crate) fn digits(x: f64) -> String {
    let rounded = format!("{x:.5e}").parse().unwrap_or(x);
    if rounded == 0.0 || (1e-4..1e7).contains(&f64::abs(rounded)) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}
