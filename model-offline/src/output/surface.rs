//! Nodes as a surface of triangles: what pictures of results colour.

use serde::Serialize;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation as _};

/// Triangles smaller than this part of the largest one are slivers along the edge.
const SLIVER: f64 = 1e-6;

struct Site {
    position: Point2<f64>,
    index: usize,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Triangles between nodes that cover what is inside of an outline, as indices of nodes; none when they cannot be formed.
pub fn triangles(nodes: &[[f64; 2]], outline: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let sites = nodes.iter().enumerate();
    let sites = sites.map(|(index, [x, y])| Site { position: Point2::new(*x, *y), index }).collect();
    let Ok(triangulation) = DelaunayTriangulation::<Site>::bulk_load(sites) else {
        return Vec::new();
    };
    let smallest = SLIVER * triangulation.inner_faces().map(|face| face.area()).fold(0.0, f64::max);
    triangulation
        .inner_faces()
        .filter(|face| face.area() > smallest)
        .map(|face| face.vertices().map(|vertex| vertex.data().index))
        .filter(|corners| inside(outline, middle(&corners.map(|corner| nodes[corner]))))
        .collect()
}

/// Mean of points.
pub fn middle(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| points.iter().map(|point| point[i]).sum::<f64>() / points.len().max(1) as f64)
}

/// Whether a point is inside of a polygon.
pub fn inside(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    edges(polygon)
        .filter(|([ax, ay], [bx, by])| (ay > &y) != (by > &y) && x < ax + (y - ay) / (by - ay) * (bx - ax))
        .count()
        % 2
        == 1
}

/// From each corner of a polygon to the next.
pub fn edges(polygon: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    polygon.iter().copied().zip(polygon.iter().copied().cycle().skip(1))
}

/// A point between nodes: three of them, and so much of each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interpolated {
    corners: [usize; 3],
    weights: [f64; 3],
}

impl Interpolated {
    /// Of a point of the body at rest: linear in its triangle, and beyond the edge as in the nearest one; none without
    /// triangles.
    pub fn new(rest: &[[f64; 2]], triangles: &[[usize; 3]], point: [f64; 2]) -> Option<Self> {
        let of = |corners: &[usize; 3]| {
            let weights = barycentric(corners.map(|corner| rest[corner]), point);
            Self { corners: *corners, weights }
        };
        // The one whose least weight is largest holds the point, or is nearest in its own measure.
        triangles.iter().map(of).max_by(|a, b| a.least().total_cmp(&b.least()))
    }

    /// The least of its weights; negative outside of the triangle.
    pub(super) fn least(&self) -> f64 {
        self.weights.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The same of one value for each of these nodes, between them also beyond the edge.
    pub(super) fn value(&self, values: &[f64]) -> f64 {
        let weights = self.weights.map(|weight| weight.max(0.0));
        let sum: f64 = self.corners.iter().zip(weights).map(|(corner, weight)| weight * values[*corner]).sum();
        sum / weights.iter().sum::<f64>()
    }

    /// The same of what these nodes have.
    pub fn of(&self, nodes: &[[f64; 2]]) -> [f64; 2] {
        [0, 1].map(|k| self.corners.iter().zip(self.weights).map(|(corner, weight)| weight * nodes[*corner][k]).sum())
    }
}

/// How points between nodes move with them.
#[derive(Debug)]
pub(super) struct Motion<'a> {
    pub(super) rest: &'a [[f64; 2]],
    pub(super) moved: &'a [[f64; 2]],
    pub(super) triangles: &'a [[usize; 3]],
}

impl Motion<'_> {
    /// Where a point of the body at rest is now.
    pub(super) fn of(&self, point: [f64; 2]) -> [f64; 2] {
        let Some(between) = Interpolated::new(self.rest, self.triangles, point) else { return point };
        let (rest, moved) = (between.of(self.rest), between.of(self.moved));
        [0, 1].map(|k| point[k] + moved[k] - rest[k])
    }
}

fn barycentric([a, b, c]: [[f64; 2]; 3], p: [f64; 2]) -> [f64; 3] {
    let twice = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let whole = twice(a, b, c);
    [twice(p, b, c) / whole, twice(a, p, c) / whole, twice(a, b, p) / whole]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L of nodes: its area is covered once, the notch is not.
    #[test]
    fn triangles_cover_the_outline_and_no_notch() {
        let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
        let all = (0..=4).flat_map(|i| (0..=4).map(move |j| [f64::from(i), f64::from(j)]));
        let nodes: Vec<[f64; 2]> = all.filter(|[x, y]| *x <= 2.0 || *y <= 2.0).collect();
        let area = |corners: &[usize; 3]| {
            let [a, b, c] = corners.map(|corner| nodes[corner]);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
        };
        let found = triangles(&nodes, &outline);
        assert!((found.iter().map(area).sum::<f64>() - 12.0).abs() < 1e-12);
        assert_eq!(triangles(&nodes[..2], &outline), [[0; 3]; 0]);
    }

    /// A linear motion is itself everywhere, also beyond the last node.
    #[test]
    fn points_move_with_the_nodes_around_them() {
        let all = (0..=3).flat_map(|i| (0..=3).map(move |j| [f64::from(i), f64::from(j)]));
        let rest: Vec<[f64; 2]> = all.collect();
        let to = |[x, y]: [f64; 2]| [x + 0.1 * y + 0.5, y - 0.2 * x];
        let moved: Vec<[f64; 2]> = rest.iter().map(|p| to(*p)).collect();
        let triangles = triangles(&rest, &[[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]]);
        let motion = Motion { rest: &rest, moved: &moved, triangles: &triangles };
        for point in [[1.2, 2.7], [0.0, 0.0], [3.05, 1.5]] {
            let (found, expected) = (motion.of(point), to(point));
            assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?} {expected:?}");
        }
    }
}
