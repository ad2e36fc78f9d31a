//! How far a point is from a closed surface, and on which side: the nearest triangle by a tree of boxes, the sign by
//! the angle-weighted pseudonormal (Bærentzen & Aanæs 2005), which is right at edges and corners, too.

use super::TriangleSurface;
use crate::geometry::implicit::{Implicit, Sheet};
use crate::geometry::point::Point;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// A surface without gaps that does not meet itself and faces outwards, and how far points are from it.
#[derive(Debug, Clone)]
pub struct CheckedSurface {
    pub(super) surface: TriangleSurface,
    pub(super) tree: RTree<Facet>,
    pub(super) normals: Normals,
    pub(super) notes: Vec<String>,
    pub(super) volumes: Vec<f64>,
    pub(super) bounds: (Point<3>, Point<3>),
}

/// A triangle in the tree.
#[derive(Debug, Clone)]
pub(super) struct Facet {
    pub(super) triangle: u32,
    corners: [Point<3>; 3],
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
enum Feature {
    Face,
    /// From corner k to corner k + 1.
    Edge(usize),
    Corner(usize),
}

/// Nearest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
fn nearest(t: &[Point<3>; 3], x: &Point<3>) -> (Point<3>, Feature) {
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
    /// With the triangle across every edge.
    pub(super) fn of(surface: &TriangleSurface, across: &[[u32; 3]]) -> Self {
        let all = 0..surface.triangles.len();
        let face = |t: usize| {
            let [a, b, c] = surface.corners(t);
            (b - a).cross(&(c - a)).normalize()
        };
        let faces: Vec<Point<3>> = all.clone().map(face).collect();
        let edges = all.clone().map(|t| across[t].map(|other| faces[t] + faces[other as usize])).collect();
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
}

impl CheckedSurface {
    /// The nearest point of the surface and the outward normal there, not of unit length; none for a point that is no
    /// point.
    fn foot(&self, x: &Point<3>) -> Option<(Point<3>, Point<3>)> {
        if !x.iter().all(|c| c.is_finite()) {
            return None;
        }
        let facet = self.tree.nearest_neighbor(&[x.x, x.y, x.z])?;
        let t = facet.triangle as usize;
        let (foot, feature) = nearest(&facet.corners, x);
        let normal = match feature {
            Feature::Face => self.normals.faces[t],
            Feature::Edge(k) => self.normals.edges[t][k],
            Feature::Corner(k) => self.normals.vertices[self.surface.triangles[t][k] as usize],
        };
        Some((foot, normal))
    }
}

impl Implicit for CheckedSurface {
    /// The distance to the surface, negative inside.
    fn level(&self, x: &Point<3>) -> f64 {
        self.foot(x).map_or(f64::INFINITY, |(foot, normal)| {
            let way = x - foot;
            if way.dot(&normal) < 0.0 { -way.norm() } else { way.norm() }
        })
    }

    /// Of unit length. On the surface the normal; it jumps where two parts of the surface are equally far.
    fn gradient(&self, x: &Point<3>) -> Point<3> {
        let Some((foot, normal)) = self.foot(x) else { return Point::<3>::zeros() };
        let way = x - foot;
        // So near to the surface the way is rounding.
        if way.norm() <= 1e-12 * (self.extent().1 - self.extent().0).norm() {
            return normal.normalize();
        }
        way.normalize() * if way.dot(&normal) < 0.0 { -1.0 } else { 1.0 }
    }

    fn bounds(&self) -> Option<(Point<3>, Point<3>)> {
        Some(self.extent())
    }

    fn sheets(&self) -> Vec<Sheet<'_>> {
        vec![Sheet::Smooth(self)]
    }
}
