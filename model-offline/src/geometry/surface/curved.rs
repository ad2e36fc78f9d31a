//! A curved piece of a surface between sharp edges, gone on with beyond them: a sheet of its own.

use super::TriangleSurface;
use super::foot::{Facet, Feature, Foot, Normals, nearest};
use crate::geometry::implicit::{Implicit, Sheet};
use crate::geometry::point::{Point, box_of};
use rstar::RTree;
use std::collections::HashMap;

/// Triangles that hang together, their own rim known.
#[derive(Debug, Clone)]
pub(super) struct CurvedPiece {
    surface: TriangleSurface,
    tree: RTree<Facet>,
    normals: Normals,
    /// Whether the piece ends at the edge from corner k to corner k + 1 of every triangle.
    ends: Vec<[bool; 3]>,
    /// Whether it ends at the vertex.
    rim: Vec<bool>,
    bounds: (Point<3>, Point<3>),
}

impl CurvedPiece {
    /// The triangles of a surface that are of this piece; none if there are none.
    pub(super) fn of(whole: &TriangleSurface, across: &[[u32; 3]], piece_of: &[u32], piece: u32) -> Option<Self> {
        let members: Vec<usize> = (0..piece_of.len()).filter(|t| piece_of[*t] == piece).collect();
        let place: HashMap<u32, u32> = members.iter().zip(0..).map(|(t, place)| (*t as u32, place)).collect();
        let mut vertex: HashMap<u32, u32> = HashMap::new();
        let mut surface = TriangleSurface::default();
        for t in &members {
            surface.triangles.push(whole.triangles[*t].map(|v| {
                *vertex.entry(v).or_insert_with(|| {
                    surface.vertices.push(whole.vertices[v as usize]);
                    surface.vertices.len() as u32 - 1
                })
            }));
        }
        let own = |t: &usize| across[*t].map(|other| place.get(&other).copied().unwrap_or(u32::MAX));
        let across: Vec<[u32; 3]> = members.iter().map(own).collect();
        let ends: Vec<[bool; 3]> = across.iter().map(|other| other.map(|t| t == u32::MAX)).collect();
        let mut rim = vec![false; surface.vertices.len()];
        for (triangle, ends) in surface.triangles.iter().zip(&ends) {
            for k in (0..3).filter(|k| ends[*k]) {
                [triangle[k], triangle[(k + 1) % 3]].iter().for_each(|v| rim[*v as usize] = true);
            }
        }
        let bounds = box_of(&surface.vertices)?;
        let tree = RTree::bulk_load((0..surface.triangles.len()).map(|t| Facet::of(&surface, t)).collect());
        Some(Self { normals: Normals::of(&surface, &across), tree, ends, rim, bounds, surface })
    }

    fn foot(&self, x: &Point<3>) -> Option<Foot> {
        let facet = self.tree.nearest_neighbor(&[x.x, x.y, x.z])?;
        let t = facet.triangle as usize;
        let (foot, feature) = nearest(&facet.corners, x);
        let beyond = match feature {
            Feature::Face => false,
            Feature::Edge(k) => self.ends[t][k],
            Feature::Corner(k) => self.rim[self.surface.triangles[t][k] as usize],
        };
        let normal = self.normals.at(&self.surface, t, feature);
        Some(Foot { way: x - foot, normal, beyond, size: (self.bounds.1 - self.bounds.0).norm() })
    }
}

impl Implicit for CurvedPiece {
    /// The distance to the piece with the sign of its side; beyond its rim that to the plane that touches it there.
    fn level(&self, x: &Point<3>) -> f64 {
        self.foot(x).map_or(f64::INFINITY, |foot| foot.level())
    }

    fn gradient(&self, x: &Point<3>) -> Point<3> {
        self.foot(x).map_or_else(Point::<3>::zeros, |foot| foot.gradient())
    }

    fn bounds(&self) -> Option<(Point<3>, Point<3>)> {
        Some(self.bounds)
    }

    fn sheets(&self) -> Vec<Sheet<'_>> {
        vec![Sheet::Smooth(self)]
    }

    fn away(&self, x: &Point<3>) -> f64 {
        self.foot(x).map_or(f64::INFINITY, |foot| if foot.beyond { foot.way.norm() } else { 0.0 })
    }
}
