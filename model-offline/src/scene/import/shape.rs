//! Shapes as a file gives them, before the scene makes anything of them.

use super::role::{Meaning, Role};
use crate::geometry::{Point2, bounds, distance_to_segment, signed_area};
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

/// A closed loop without vertices that lie on the line between others (Ramer, Douglas and Peucker).
pub(super) fn simplified(points: &[Point2], tolerance: f64) -> Vec<Point2> {
    let mut open: Vec<Point2> = points.to_vec();
    while open.len() > 1 && (open[0] - open[open.len() - 1]).norm() <= 1e-9 * tolerance.max(f64::MIN_POSITIVE) {
        open.pop();
    }
    // Two far corners split the loop into two open lines. Both are corners: the lowest-left and the one farthest away.
    let first =
        (0..open.len()).min_by(|&a, &b| (open[a].x + open[a].y).total_cmp(&(open[b].x + open[b].y))).unwrap_or(0);
    open.rotate_left(first);
    let far =
        (0..open.len()).max_by(|&a, &b| (open[a] - open[0]).norm().total_cmp(&(open[b] - open[0]).norm())).unwrap_or(0);
    let mut kept = keep(&open[..=far], tolerance);
    kept.pop();
    let back: Vec<Point2> = open[far..].iter().chain(open.first()).copied().collect();
    kept.extend(keep(&back, tolerance));
    kept.pop();
    kept
}

/// The points of an open line that matter, ends included. Not recursive: lines from files may be long.
fn keep(line: &[Point2], tolerance: f64) -> Vec<Point2> {
    let Some(end) = line.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut matters = vec![false; line.len()];
    (matters[0], matters[end]) = (true, true);
    let mut open = vec![(0, end)];
    while let Some((from, to)) = open.pop() {
        let off = |i: usize| distance_to_segment(line[i], line[from], line[to]);
        if let Some(i) = (from + 1..to).max_by(|&a, &b| off(a).total_cmp(&off(b)))
            && off(i) > tolerance
        {
            matters[i] = true;
            open.extend([(from, i), (i, to)]);
        }
    }
    line.iter().zip(matters).filter_map(|(p, matters)| matters.then_some(*p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_points_on_its_edges_keeps_its_four_corners() {
        let edge = |a: [f64; 2], b: [f64; 2]| {
            (0..10).map(move |i| Point2::from(a) + (Point2::from(b) - Point2::from(a)) * (f64::from(i) / 10.0))
        };
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let points: Vec<Point2> = (0..4).flat_map(|i| edge(corners[i], corners[(i + 1) % 4])).collect();
        assert_eq!(simplified(&points, 1e-3), corners.map(Point2::from));
    }

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
