//! How far points are from triangles.

use super::foot::Facet;
use crate::geometry::point::Point;
use rstar::{AABB, RTree};

/// Triangles to which distances are asked for, closed or not.
#[derive(Debug)]
pub(crate) struct Facets(RTree<Facet>);

impl Facets {
    /// Triangles by their corners, length units.
    pub(crate) fn new(triangles: impl Iterator<Item = [Point<3>; 3]>) -> Self {
        let facet = |(triangle, corners): (u32, [Point<3>; 3])| {
            let envelope = AABB::from_points(&corners.map(<[f64; 3]>::from));
            Facet { triangle, corners, envelope }
        };
        Self(RTree::bulk_load((0..).zip(triangles).map(facet).collect()))
    }

    /// From a point to the nearest triangle, length units; infinite where there is none.
    pub(crate) fn distance(&self, x: &Point<3>) -> f64 {
        let nearest = self.0.nearest_neighbor_iter_with_distance_2(&[x.x, x.y, x.z]).next();
        nearest.map_or(f64::INFINITY, |(_, squared)| squared.sqrt())
    }
}
