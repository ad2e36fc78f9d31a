//! The boundary of a body as people see it: sides between corners, and the parts of them that face up or down. A drawn curve
//! has many short edges, and is one side.

use crate::geometry::{Point2, Polygon, cross};

/// The outline turns by more than this at a corner, by less within a curve, rad: 25°.
const CORNER: f64 = 0.436;
/// An edge longer than this part of the body's size is a side of its own, corner or not.
const LONG: f64 = 0.115;
/// Ends this near to a corner are the corner, as a part of what lies between them.
const NEAR: f64 = 0.04;

/// Consecutive edges of the outline, counter-clockwise, by their points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stretch(pub(super) Vec<Point2>);

impl Stretch {
    pub(super) fn ends(&self) -> [Point2; 2] {
        [self.0[0], self.0[self.0.len() - 1]]
    }

    pub(super) fn edges(&self) -> impl DoubleEndedIterator<Item = [Point2; 2]> + '_ {
        self.0.windows(2).map(|edge| [edge[0], edge[1]])
    }

    pub(super) fn length(&self) -> f64 {
        self.edges().map(|[a, b]| (b - a).norm()).sum()
    }

    pub(super) fn lowest(&self) -> f64 {
        self.0.iter().map(|p| p.y).fold(f64::INFINITY, f64::min)
    }

    /// The point at a way along it.
    fn at(&self, mut way: f64) -> Point2 {
        for [a, b] in self.edges() {
            let length = (b - a).norm();
            if way <= length {
                return a + (b - a) * (way / length);
            }
            way -= length;
        }
        self.ends()[1]
    }

    /// What lies between two ways along it, `from` < `to`. An end that nearly is a corner becomes one: between them there would
    /// be an edge that only the smallest nodes see.
    pub(super) fn between(&self, from: f64, to: f64) -> Self {
        let near = NEAR * (to - from);
        let mut points = vec![self.at(from)];
        let mut way = 0.0;
        for [a, b] in self.edges() {
            if (way - from).abs() <= near {
                points[0] = a;
            }
            way += (b - a).norm();
            if way > from + near && way < to - near {
                points.push(b);
            } else if (way - to).abs() <= near {
                points.push(b);
                return Self(points);
            }
        }
        points.push(self.at(to));
        Self(points)
    }

    /// Its longest parts of edges that are wanted.
    pub(super) fn runs(&self, wanted: impl Fn([Point2; 2]) -> bool) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        let mut goes_on = false;
        for edge in self.edges() {
            let is = wanted(edge);
            match runs.last_mut() {
                Some(run) if is && goes_on => run.0.push(edge[1]),
                _ if is => runs.push(Self(edge.to_vec())),
                _ => {}
            }
            goes_on = is;
        }
        runs
    }
}

/// The sides of a body. One without corners has a single side, which begins where it is nearest to `seam`.
pub(super) fn sides(outline: &Polygon, seam: Point2) -> Vec<Stretch> {
    let long = LONG * outline.size();
    between_corners(outline, seam, |edge| edge > long)
}

fn between_corners(outline: &Polygon, seam: Point2, is_long: impl Fn(f64) -> bool) -> Vec<Stretch> {
    let points = outline.vertices();
    let count = points.len();
    let is_corner = |i: &usize| {
        let (before, after) = (points[*i] - points[(i + count - 1) % count], points[(i + 1) % count] - points[*i]);
        let turn = cross(before, after).atan2(before.dot(&after)).abs();
        turn > CORNER || is_long(before.norm()) || is_long(after.norm())
    };
    let mut corners: Vec<usize> = (0..count).filter(is_corner).collect();
    if corners.is_empty() {
        let far = |i: &usize| (points[*i] - seam).norm();
        corners.extend((0..count).min_by(|a, b| far(a).total_cmp(&far(b))));
    }
    let ends = corners.iter().copied().skip(1).chain(corners.first().map(|first| first + count));
    let side = |(from, to): (&usize, usize)| Stretch((*from..=to).map(|i| points[i % count]).collect());
    corners.iter().zip(ends).map(side).collect()
}

/// Parts between corners that face upwards (`up` = 1) or downwards (−1) and are at most so steep, as the cosine of their slope.
pub(super) fn facing(outline: &Polygon, up: f64, steepest: f64) -> Vec<Stretch> {
    // The interior is on the left of every edge. What has no corner begins on the right, where it faces neither way.
    let faces = |[a, b]: [Point2; 2]| up * (a.x - b.x) >= steepest * (b - a).norm();
    let rightmost = outline.vertices().iter().max_by(|a, b| a.x.total_cmp(&b.x)).copied().unwrap_or_default();
    between_corners(outline, rightmost, |_| false).iter().flat_map(|side| side.runs(faces)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[[f64; 2]]) -> Polygon {
        Polygon::new(points.iter().map(|p| Point2::from(*p)).collect()).unwrap()
    }

    fn circle(corners: u32) -> Polygon {
        let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / f64::from(corners);
        polygon(&(0..corners).map(|i| [angle(i).cos(), angle(i).sin()]).collect::<Vec<_>>())
    }

    #[test]
    fn a_square_has_four_sides_and_a_circle_one() {
        let square = polygon(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert_eq!(sides(&square, Point2::zeros()).len(), 4);
        assert_eq!(facing(&square, 1.0, 0.7), [Stretch(vec![[2.0, 2.0].into(), [0.0, 2.0].into()])]);
        assert_eq!(facing(&square, -1.0, 0.7), [Stretch(vec![[0.0, 0.0].into(), [2.0, 0.0].into()])]);
        let round = circle(80);
        let whole = sides(&round, Point2::new(0.0, -2.0));
        assert!(whole.len() == 1 && whole[0].0.len() == 81 && whole[0].ends().map(|p| p.y.round()) == [-1.0; 2]);
        assert!((whole[0].length() - round.perimeter()).abs() < 1e-12);
        // A quarter of it faces each way.
        for up in [-1.0, 1.0] {
            let [part] = &facing(&round, up, 0.7)[..] else { panic!("one part") };
            assert!((part.length() / round.perimeter() - 0.25).abs() < 0.03 && up * part.0[10].y > 0.7, "{part:?}");
        }
    }

    /// Its long edges are sides of their own, with the arcs between them; what faces down goes around the corners.
    #[test]
    fn a_rounded_square_has_four_long_sides() {
        let arc = |k: u32| (0..=6).map(move |i| std::f64::consts::FRAC_PI_2 * (f64::from(k) + f64::from(i) / 6.0));
        let corner = |k: u32| [[5.0, 5.0], [-5.0, 5.0], [-5.0, -5.0], [5.0, -5.0]][k as usize];
        let on = |k: u32| arc(k).map(move |a| [corner(k)[0] + a.cos(), corner(k)[1] + a.sin()]);
        let rounded = polygon(&(0..4).flat_map(on).collect::<Vec<_>>());
        let lengths: Vec<f64> = sides(&rounded, Point2::zeros()).iter().map(Stretch::length).collect();
        assert_eq!(lengths.iter().filter(|length| (**length - 10.0).abs() < 1e-9).count(), 4, "{lengths:?}");
        assert_eq!(lengths.len(), 8);
        let [below] = &facing(&rounded, -1.0, 0.7)[..] else { panic!("one part") };
        assert!((below.length() - 10.0 - std::f64::consts::FRAC_PI_2).abs() < 0.02, "{}", below.length());
    }

    #[test]
    fn two_legs_face_down_and_so_does_the_bridge_between_them() {
        let legs = [[0, 0], [2, 0], [2, 3], [4, 3], [4, 0], [6, 0], [6, 4], [0, 4]].map(|p| p.map(f64::from));
        let lowest: Vec<f64> = facing(&polygon(&legs), -1.0, 0.7).iter().map(Stretch::lowest).collect();
        assert_eq!(lowest, [0.0, 3.0, 0.0]);
    }

    #[test]
    fn a_part_of_a_stretch_keeps_the_corners_within_it() {
        let bent = Stretch([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(Point2::from).to_vec());
        assert_eq!(bent.between(1.0, 4.5).0, [[1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.5, 2.0]].map(Point2::from));
        for (from, to) in [(2.0, 4.0), (1.95, 4.05), (2.05, 3.95)] {
            assert_eq!(bent.between(from, to).0, [[2.0, 0.0], [2.0, 2.0]].map(Point2::from), "{from} {to}");
        }
        let runs = bent.runs(|[a, b]| a.y == b.y);
        assert!(runs.len() == 2 && runs.iter().all(|run| run.0.len() == 2), "{runs:?}");
    }
}
