//! Which nodes a point of a body sees: kernels do not reach across notches and slots (the visibility criterion of
//! Belytschko, Lu & Gu, Int. J. Numer. Meth. Eng. 37, 1994). In a convex body every point sees every other.

use crate::geometry::{Location, Point, Point2, Polygon, cross, distance_to_segment};
use rstar::primitives::{GeomWithData, Line};
use rstar::{AABB, RTree};

/// Whether a kernel acts from one place on another.
pub trait Sight<const D: usize>: std::fmt::Debug + Send + Sync {
    /// Whether the straight way from `a` to `b` stays in the body.
    fn sees(&self, a: &Point<D>, b: &Point<D>) -> bool;
}

/// An edge in the tree, with its ends.
type Edge = GeomWithData<Line<[f64; 2]>, (Point2, Point2)>;

/// Sight inside an outline that is not convex.
#[derive(Debug)]
pub struct OutlineSight {
    outline: Polygon,
    edges: RTree<Edge>,
    tolerance: f64,
}

/// Lengths below this, over the body's size, are rounding.
const ROUNDING: f64 = 1e-9;

impl OutlineSight {
    /// None where every point sees every other.
    pub fn of(outline: &Polygon) -> Option<Self> {
        if outline.is_convex() {
            return None;
        }
        let edge = |(a, b): (Point2, Point2)| GeomWithData::new(Line::new([a.x, a.y], [b.x, b.y]), (a, b));
        Some(Self {
            edges: RTree::bulk_load(outline.edges().map(edge).collect()),
            tolerance: ROUNDING * outline.size(),
            outline: outline.clone(),
        })
    }

    /// Whether the open segments cross, by more than rounding.
    fn cross(&self, (a, b): (&Point2, &Point2), (p, q): (Point2, Point2)) -> bool {
        let apart = |from: Point2, to: Point2, u: Point2, v: Point2| {
            let along = (to - from).normalize();
            let (u, v) = (cross(along, u - from), cross(along, v - from));
            u.abs() > self.tolerance && v.abs() > self.tolerance && (u > 0.0) != (v > 0.0)
        };
        apart(p, q, *a, *b) && apart(*a, *b, p, q)
    }
}

impl Sight<2> for OutlineSight {
    fn sees(&self, a: &Point2, b: &Point2) -> bool {
        if (b - a).norm() <= self.tolerance {
            return true;
        }
        let (low, high) = (a.inf(b), a.sup(b));
        let margin = Point2::repeat(self.tolerance);
        let (low, high) = (low - margin, high + margin);
        let window = AABB::from_corners([low.x, low.y], [high.x, high.y]);
        let near: Vec<_> = self.edges.locate_in_envelope_intersecting(&window).map(|edge| edge.data).collect();
        near.iter().all(|edge| !self.cross((a, b), *edge)) && self.inside_between_corners(a, b, &near)
    }
}

impl OutlineSight {
    /// Whether the way is inside on every piece between the corners that it touches: from wall to wall, and along the mouth
    /// of a slot, it crosses nothing and leads through the void all the same.
    fn inside_between_corners(&self, a: &Point2, b: &Point2, near: &[(Point2, Point2)]) -> bool {
        if near.is_empty() {
            return true;
        }
        let along = b - a;
        let on_the_way = |corner: &&Point2| distance_to_segment(**corner, *a, *b) <= self.tolerance;
        let corners = near.iter().flat_map(|(p, q)| [p, q]).filter(on_the_way);
        let mut stations: Vec<f64> = corners.map(|c| (c - a).dot(&along) / along.norm_squared()).collect();
        stations.extend([0.0, 1.0]);
        stations.sort_by(f64::total_cmp);
        stations.windows(2).all(|piece| {
            let middle = a + along * (0.5 * (piece[0] + piece[1]));
            self.outline.locate(middle, self.tolerance) != Location::Outside
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slotted() -> OutlineSight {
        let corners = [[0., 0.], [6., 0.], [6., 4.], [3.1, 4.], [3.1, 2.], [2.9, 2.], [2.9, 4.], [0., 4.]];
        OutlineSight::of(&Polygon::new(corners.map(Point2::from).to_vec()).unwrap()).unwrap()
    }

    #[test]
    fn a_slot_hides_what_is_behind_it_and_nothing_else() {
        let sight = slotted();
        let sees = |a: [f64; 2], b: [f64; 2]| sight.sees(&Point2::from(a), &Point2::from(b));
        assert!(!sees([2.5, 3.0], [3.5, 3.0]), "across");
        assert!(!sees([2.9, 3.0], [3.1, 3.2]), "from wall to wall");
        assert!(!sees([2.9, 3.0], [3.5, 3.0]), "from a wall to the other block");
        assert!(sees([2.5, 1.5], [3.5, 1.5]), "below the slot");
        assert!(sees([2.9, 2.0], [2.9, 4.0]), "along a wall");
        assert!(sees([2.9, 3.0], [2.0, 3.5]), "from a wall into its own block");
        assert!(sees([2.9, 2.0], [3.1, 2.0]), "along the bottom of the slot");
        assert!(!sees([2.0, 4.0], [3.5, 4.0]), "along the top, over the mouth");
    }

    #[test]
    fn a_convex_body_has_nothing_to_hide() {
        let square = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(Point2::from).to_vec();
        assert!(OutlineSight::of(&Polygon::new(square).unwrap()).is_none());
    }
}
