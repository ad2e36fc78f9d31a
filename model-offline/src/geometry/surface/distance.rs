//! How far a point is from a closed surface, and on which side.

use super::TriangleSurface;
use super::curved::CurvedPiece;
use super::foot::{Facet, Foot, Normals, nearest};
use super::pieces::Plane;
use crate::geometry::implicit::{Implicit, Sheet};
use crate::geometry::point::Point;
use rstar::RTree;

/// A surface without gaps that does not meet itself and faces outwards, and how far points are from it.
#[derive(Debug, Clone)]
pub struct CheckedSurface {
    pub(super) surface: TriangleSurface,
    pub(super) tree: RTree<Facet>,
    pub(super) normals: Normals,
    pub(super) notes: Vec<String>,
    pub(super) volumes: Vec<f64>,
    pub(super) bounds: (Point<3>, Point<3>),
    /// What lies between sharp edges; nothing where there are none.
    pub(super) pieces: Vec<Piece>,
    /// How far the points that several pieces share may be from one of them.
    pub(super) precision: f64,
}

/// What of a surface lies between sharp edges.
#[derive(Debug, Clone)]
pub(super) enum Piece {
    Flat(Plane),
    Curved(Box<CurvedPiece>),
}

impl CheckedSurface {
    /// Its nearest point; none for a point that is no point.
    fn foot(&self, x: &Point<3>) -> Option<Foot> {
        if !x.iter().all(|c| c.is_finite()) {
            return None;
        }
        let facet = self.tree.nearest_neighbor(&[x.x, x.y, x.z])?;
        let (foot, feature) = nearest(&facet.corners, x);
        let normal = self.normals.at(&self.surface, facet.triangle as usize, feature);
        Some(Foot { way: x - foot, normal, beyond: false, size: (self.bounds.1 - self.bounds.0).norm() })
    }
}

impl Implicit for CheckedSurface {
    /// The distance to the surface, negative inside.
    fn level(&self, x: &Point<3>) -> f64 {
        self.foot(x).map_or(f64::INFINITY, |foot| foot.level())
    }

    /// Of unit length. On the surface the normal; it jumps where two parts of the surface are equally far.
    fn gradient(&self, x: &Point<3>) -> Point<3> {
        self.foot(x).map_or_else(Point::<3>::zeros, |foot| foot.gradient())
    }

    fn bounds(&self) -> Option<(Point<3>, Point<3>)> {
        Some(self.extent())
    }

    /// What lies between sharp edges.
    fn sheets(&self) -> Vec<Sheet<'_>> {
        if self.pieces.is_empty() {
            return vec![Sheet::Smooth(self)];
        }
        let sheets = self.pieces.iter().map(|piece| match piece {
            Piece::Flat(plane) => plane.sheet(),
            Piece::Curved(piece) => Sheet::Smooth(piece.as_ref()),
        });
        sheets.collect()
    }

    fn precision(&self) -> f64 {
        self.precision
    }

    fn is_measured(&self) -> bool {
        true
    }
}
