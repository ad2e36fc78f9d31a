//! Shapes as a file gives them, before the scene makes anything of them.

use super::role::{Meaning, Role};
use crate::geometry::{Point2, bounds, signed_area};
use crate::material::Preset;

/// Details below this part of the body's size are left out: nothing that a node spacing of a few percent could show.
pub(super) const DETAIL: f64 = 2e-3;
/// Ends this near to each other, part of the shape's size, are meant to meet.
const MEETS: f64 = 1e-3;
/// Coordinates beyond this leave no digits for anything else.
const LARGEST: f64 = 1e100;

/// A line, a closed loop or a point.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    /// What it is called in messages.
    pub(super) told: String,
    pub(super) role: Option<Role>,
    pub(super) preset: Option<Preset>,
    /// y upwards; of a closed loop the first point is not repeated.
    pub(super) points: Vec<Point2>,
    pub(super) closed: bool,
}

impl Shape {
    pub(super) fn new(told: String, meaning: Meaning, mut points: Vec<Point2>, closed: bool) -> Self {
        points.dedup();
        let (low, high) = bounds(&points);
        let size = (high - low).norm();
        let meets = points.len() > 3 && (points[0] - points[points.len() - 1]).norm() <= MEETS * size;
        if meets {
            points.pop();
        }
        Self { told, role: meaning.role, preset: meaning.preset, points, closed: closed || meets }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.points.iter().all(|p| p.iter().all(|x| x.abs() <= LARGEST))
    }

    pub(super) fn area(&self) -> f64 {
        signed_area(&self.points).abs()
    }

    /// Both ends of a line, or of a thin shape along its length.
    pub(super) fn ends(&self) -> Option<[Point2; 2]> {
        let (first, last) = (*self.points.first()?, *self.points.last()?);
        if !self.closed {
            return Some([first, last]);
        }
        // The middles of the two short sides: what is half way between the corners that are farthest from each other.
        let far = |from: Point2| {
            let distance = |p: &&Point2| (**p - from).norm();
            self.points.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
        };
        let a = far(first)?;
        let b = far(a)?;
        let axis = b - a;
        let middle = |near: bool| {
            let close = self.points.iter().filter(|p| {
                let way = (**p - a).dot(&axis) / axis.norm_squared();
                if near { way < 0.15 } else { way > 0.85 }
            });
            let points: Vec<Point2> = close.copied().collect();
            points.iter().sum::<Point2>() / (points.len().max(1) as f64)
        };
        Some([middle(true), middle(false)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thin_shape_has_the_ends_of_its_length() {
        let corners = [[0.0, 0.0], [10.0, 0.0], [10.0, 1.0], [0.0, 1.0]].map(Point2::from).to_vec();
        let shape = Shape::new(String::new(), Meaning::default(), corners, true);
        let ends = shape.ends().unwrap();
        let is = |a: [f64; 2], b: [f64; 2]| {
            let (a, b) = (Point2::from(a), Point2::from(b));
            ends == [a, b] || ends == [b, a]
        };
        assert!(is([0.0, 0.5], [10.0, 0.5]), "{ends:?}");
    }

    #[test]
    fn a_loop_whose_ends_meet_is_closed() {
        let ends = |last: [f64; 2]| {
            let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], last].map(Point2::from).to_vec();
            let shape = Shape::new(String::new(), Meaning::default(), points, false);
            (shape.closed, shape.points.len())
        };
        assert_eq!((ends([0.0, 5e-4]), ends([0.0, 5e-2])), ((true, 3), (false, 4)));
    }
}
