//! Where a polygon lies and how large it is: nearest points of its boundary, centroid, width, where a line leaves it.

use super::point::{Point2, cross};
use super::polygon::{Polygon, signed_area};

/// The point of a closed loop's edges that is nearest to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Its edge: k runs from vertex k to vertex k + 1.
    pub edge: usize,
    /// Where on the edge, 0 at its first vertex, 1 at its last.
    pub fraction: f64,
    /// The point.
    pub point: Point2,
    /// How far that is.
    pub distance: f64,
}

/// The nearest point on the edges of a closed loop of vertices; none where there is no edge.
pub fn nearest_on_loop(vertices: &[Point2], p: Point2) -> Option<Nearest> {
    let edges = (0..vertices.len()).map(|edge| {
        let (a, b) = (vertices[edge], vertices[(edge + 1) % vertices.len()]);
        let along = b - a;
        let length2 = along.norm_squared();
        let fraction = if length2 > 0.0 { ((p - a).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        // The ends are the vertices to the last digit. Elsewhere the way is across the edge: on a level or an upright one the
        // point keeps its other coordinate, and far from the origin no digit is lost along the edge.
        let point = match fraction {
            0.0 => a,
            1.0 => b,
            _ => {
                let across = Point2::new(-along.y, along.x) / length2.sqrt();
                p + across * across.dot(&(a - p))
            }
        };
        Nearest { edge, fraction, point, distance: (p - point).norm() }
    });
    edges.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

impl Polygon {
    /// Length of the boundary.
    pub fn perimeter(&self) -> f64 {
        self.edges().map(|(a, b)| (b - a).norm()).sum()
    }

    /// Centre of mass of the enclosed area.
    pub fn centroid(&self) -> Point2 {
        let v = self.vertices();
        // Relative to the first vertex: far from the origin the digits are kept.
        let moments = (1..v.len() - 1).map(|i| {
            let (a, b) = (v[i] - v[0], v[i + 1] - v[0]);
            (a + b) * (cross(a, b) / 6.0)
        });
        v[0] + moments.fold(Point2::zeros(), |sum, moment| sum + moment) / signed_area(v)
    }

    /// Smallest distance of two parallel lines between which it fits.
    pub fn width(&self) -> f64 {
        let hull = convex_hull(self.vertices());
        // Narrowest along the normal of one edge of the hull.
        let across = |i: usize| {
            let (a, b) = (hull[i], hull[(i + 1) % hull.len()]);
            let along = (b - a).normalize();
            hull.iter().map(|p| cross(along, p - a)).fold(0.0, f64::max)
        };
        (0..hull.len()).map(across).fold(f64::INFINITY, f64::min)
    }

    /// How far a line from `from` along the unit vector `axis` stays within, where it first comes out; none where it is
    /// not within right after its start. Ways shorter than `tolerance` do not count.
    pub fn way_inside(&self, from: Point2, axis: Point2, tolerance: f64) -> Option<f64> {
        let crossing = |(a, b): (Point2, Point2)| {
            let (edge, to) = (b - a, a - from);
            let by = cross(axis, edge);
            let (way, on_edge) = (cross(to, edge) / by, cross(to, axis) / by);
            (way > tolerance && (-1e-9..=1.0 + 1e-9).contains(&on_edge)).then_some(way)
        };
        let mut ways: Vec<f64> = self.edges().filter_map(crossing).collect();
        ways.sort_by(f64::total_cmp);
        let within = |low: f64, high: f64| self.contains(from + axis * (0.5 * (low + high)));
        let first = *ways.first()?;
        if !within(0.0, first) {
            return None;
        }
        // Where it only touches a corner it goes on inside.
        let next = ways.windows(2).find(|pair| pair[1] - pair[0] > tolerance && !within(pair[0], pair[1]));
        next.map(|pair| pair[0]).or(ways.last().copied())
    }
}

/// Convex hull, counter-clockwise (Andrew 1979).
fn convex_hull(points: &[Point2]) -> Vec<Point2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = Point2>| {
        let mut chain: Vec<Point2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if cross(b - a, p - a) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let lower = half(&mut sorted.iter().copied());
    [lower, half(&mut sorted.iter().rev().copied())].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(v: &[[f64; 2]]) -> Polygon {
        Polygon::new(v.iter().map(|p| Point2::from(*p)).collect()).unwrap()
    }

    /// An L of three unit squares: centroid (5/6, 5/6) by hand; its gap counts with its width.
    #[test]
    fn an_l_has_the_centroid_and_the_width_of_three_squares_wherever_it_lies() {
        for shift in [0.0, 1e6] {
            let v = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
            let l = polygon(&v.map(|[x, y]| [x + shift, y - shift]));
            let centroid = l.centroid() - Point2::new(shift, -shift);
            assert!((centroid - Point2::repeat(5.0 / 6.0)).norm() < 1e-9, "{centroid}");
            assert_eq!(l.perimeter(), 8.0);
            assert_eq!(l.width(), 2.0);
        }
    }

    #[test]
    fn a_turned_rectangle_is_as_wide_as_its_shorter_side() {
        for turn in [0.0, 0.3, 1.1, 2.5_f64] {
            let at = |x: f64, y: f64| [x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos()];
            let turned = polygon(&[at(0.0, 0.0), at(7.0, 0.0), at(7.0, 2.0), at(3.0, 2.0), at(0.0, 2.0)]);
            assert!((turned.width() - 2.0).abs() < 1e-12, "{turn}: {}", turned.width());
        }
        // Narrowest across its longest side.
        let triangle = polygon(&[[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]]);
        assert!((triangle.width() - 12.0 / 5.0).abs() < 1e-12, "{}", triangle.width());
    }

    #[test]
    fn a_line_leaves_where_it_first_comes_out() {
        let u =
            polygon(&[[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]);
        let way = |from: [f64; 2], axis: [f64; 2]| u.way_inside(from.into(), Point2::from(axis).normalize(), 1e-9);
        assert_eq!(way([0.0, 1.5], [1.0, 0.0]), Some(1.0), "into the gap");
        assert_eq!(way([0.0, 0.5], [1.0, 0.0]), Some(3.0), "below the gap");
        assert_eq!(way([0.0, 1.5], [-1.0, 0.0]), None, "out at once");
        assert_eq!(way([0.5, 2.0], [0.0, 1.0]), None);
        // Through the notch's corner (1, 1), which it only touches.
        let touching = way([0.0, 2.0], [1.0, -1.0]).unwrap();
        assert!((touching - 8.0_f64.sqrt()).abs() < 1e-12, "{touching}");
    }

    #[test]
    fn the_nearest_point_is_on_the_edge_it_says() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(Point2::from);
        let at = |p: [f64; 2]| nearest_on_loop(&square, p.into()).unwrap();
        let right = at([2.5, 0.5]);
        assert_eq!((right.edge, right.fraction, right.point, right.distance), (1, 0.25, [2.0, 0.5].into(), 0.5));
        let closing = at([-1.0, 1.5]);
        assert_eq!((closing.edge, closing.fraction, closing.point), (3, 0.25, [0.0, 1.5].into()));
        assert_eq!(at([3.0, 3.0]).point, Point2::repeat(2.0));
        // Which a third of the edge and its length would not give.
        assert_eq!(at([2.1, 2.0 / 3.0]).point, Point2::new(2.0, 2.0 / 3.0));
        assert!(nearest_on_loop(&[], Point2::zeros()).is_none());
    }
}
