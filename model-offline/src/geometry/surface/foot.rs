//! The nearest point of triangles to a point, by a tree of boxes, and on which side of them it is: by the angle-weighted
//! pseudonormal (Bærentzen & Aanæs 2005), which is right at edges and corners, too.

use super::TriangleSurface;
use crate::geometry::point::Point;
use rstar::{AABB, PointDistance, RTreeObject};

/// A triangle in the tree.
#[derive(Debug, Clone)]
pub(super) struct Facet {
    pub(super) triangle: u32,
    pub(super) corners: [Point<3>; 3],
    pub(super) envelope: AABB<[f64; 3]>,
}

impl Facet {
    pub(super) fn of(surface: &TriangleSurface, triangle: usize) -> Self {
        let corners = surface.corners(triangle);
        let envelope = AABB::from_points(&corners.map(<[f64; 3]>::from));
        Self { triangle: triangle as u32, corners, envelope }
    }
}

impl RTreeObject for Facet {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        self.envelope
    }
}

impl PointDistance for Facet {
    fn distance_2(&self, x: &[f64; 3]) -> f64 {
        let x = Point::<3>::from(*x);
        (nearest(&self.corners, &x).0 - x).norm_squared()
    }
}

/// What of a triangle is nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Feature {
    Face,
    /// From corner k to corner k + 1.
    Edge(usize),
    Corner(usize),
}

/// Nearest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
pub(super) fn nearest(t: &[Point<3>; 3], x: &Point<3>) -> (Point<3>, Feature) {
    let [a, b, c] = t;
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let (ax, bx, cx) = (x - a, x - b, x - c);
    let (d1, d2) = (ab.dot(&ax), ac.dot(&ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, Feature::Corner(0));
    }
    let (d3, d4) = (ab.dot(&bx), ac.dot(&bx));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, Feature::Corner(1));
    }
    let (d5, d6) = (ab.dot(&cx), ac.dot(&cx));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, Feature::Corner(2));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return (b + bc * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), Feature::Edge(1));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    // Along the normal from the point: no digit is lost along the face.
    let normal = ab.cross(&ac);
    (x - normal * (ax.dot(&normal) / normal.norm_squared()), Feature::Face)
}

/// Outward normals of faces, edges and corners.
#[derive(Debug, Clone)]
pub(super) struct Normals {
    faces: Vec<Point<3>>,
    /// Of the edge from corner k to corner k + 1 of every triangle.
    edges: Vec<[Point<3>; 3]>,
    vertices: Vec<Point<3>>,
}

impl Normals {
    /// With the triangle across every edge; none where the surface ends.
    pub(super) fn of(surface: &TriangleSurface, across: &[[u32; 3]]) -> Self {
        let all = 0..surface.triangles.len();
        let face = |t: usize| {
            let [a, b, c] = surface.corners(t);
            (b - a).cross(&(c - a)).normalize()
        };
        let faces: Vec<Point<3>> = all.clone().map(face).collect();
        let beside = |t: u32| faces.get(t as usize).copied().unwrap_or_default();
        let edges = all.clone().map(|t| across[t].map(|other| faces[t] + beside(other))).collect();
        let mut vertices = vec![Point::<3>::zeros(); surface.vertices.len()];
        for t in all {
            let x = surface.corners(t);
            for k in 0..3 {
                let (u, v) = (x[(k + 1) % 3] - x[k], x[(k + 2) % 3] - x[k]);
                let angle = u.cross(&v).norm().atan2(u.dot(&v));
                vertices[surface.triangles[t][k] as usize] += faces[t] * angle;
            }
        }
        Self { faces, edges, vertices }
    }

    /// That of a feature of a triangle; not of unit length.
    pub(super) fn at(&self, surface: &TriangleSurface, t: usize, feature: Feature) -> Point<3> {
        match feature {
            Feature::Face => self.faces[t],
            Feature::Edge(k) => self.edges[t][k],
            Feature::Corner(k) => self.vertices[surface.triangles[t][k] as usize],
        }
    }
}

/// How a point lies to the nearest one of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Foot {
    /// From the surface to the point.
    pub(super) way: Point<3>,
    /// Outward normal of the surface there, of any length.
    pub(super) normal: Point<3>,
    /// Whether it lies beyond the surface's rim: there the surface goes on as a plane.
    pub(super) beyond: bool,
    /// Size of the surface.
    pub(super) size: f64,
}

impl Foot {
    /// Distance, negative inside.
    pub(super) fn level(&self) -> f64 {
        if self.beyond {
            return self.normal.normalize().dot(&self.way);
        }
        if self.way.dot(&self.normal) < 0.0 { -self.way.norm() } else { self.way.norm() }
    }

    /// Of unit length; on the surface its normal.
    pub(super) fn gradient(&self) -> Point<3> {
        // So near to the surface the way is rounding.
        if self.beyond || self.way.norm() <= 1e-12 * self.size {
            return self.normal.normalize();
        }
        self.way.normalize() * if self.way.dot(&self.normal) < 0.0 { -1.0 } else { 1.0 }
    }
}
