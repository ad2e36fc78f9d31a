//! Tetrahedral meshes.

use super::quality::{FACES, dihedral_angles, volume6};
use crate::geometry::Point;
use serde::Serialize;

/// Tetrahedra that tile a body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TetMesh {
    /// Positions, length units.
    pub nodes: Vec<Point<3>>,
    /// Four node numbers each; every volume is positive: (b − a) × (c − a) · (d − a) > 0.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Per tetrahedron: 0 in the body, 1 + i in interface i; where interfaces overlap, the last that holds it.
    pub part: Vec<u32>,
}

/// How good a mesh is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Smallest dihedral angle, degrees.
    pub min_dihedral: f64,
    /// Largest dihedral angle, degrees.
    pub max_dihedral: f64,
    /// Smallest volume, length units cubed.
    pub min_volume: f64,
    /// The tetrahedron with the smallest dihedral angle.
    pub worst: usize,
}

/// A tetrahedron, and how good it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Element {
    /// Its middle, length units.
    pub at: [f64; 3],
    /// Smallest dihedral angle, degrees.
    pub dihedral: f64,
    /// Volume, length units cubed.
    pub volume: f64,
}

impl TetMesh {
    /// So many tetrahedra with the smallest dihedral angles, the worst first.
    pub fn worst(&self, count: usize) -> Vec<Element> {
        let element = |t: usize| {
            let corners = self.corners(t);
            let dihedral = dihedral_angles(&corners).into_iter().fold(f64::INFINITY, f64::min).to_degrees();
            let at = corners.iter().sum::<Point<3>>() / 4.0;
            Element { at: at.into(), dihedral, volume: volume6(&corners) / 6.0 }
        };
        let mut all: Vec<Element> = (0..self.tetrahedra.len()).map(element).collect();
        all.sort_by(|a, b| a.dihedral.total_cmp(&b.dihedral));
        all.truncate(count);
        all
    }

    /// Corners of a tetrahedron.
    pub fn corners(&self, tetrahedron: usize) -> [Point<3>; 4] {
        self.tetrahedra[tetrahedron].map(|n| self.nodes[n as usize])
    }

    /// Volume per tetrahedron, length units cubed.
    pub fn volumes(&self) -> Vec<f64> {
        (0..self.tetrahedra.len()).map(|t| volume6(&self.corners(t)) / 6.0).collect()
    }

    /// Triangles of the boundary, outward by the right-hand rule, sorted by their nodes.
    pub fn boundary(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        for face in self.sorted_faces().chunk_by(|a, b| a.0 == b.0) {
            if let [(_, t, f)] = face {
                triangles.push(FACES[*f as usize].map(|c| self.tetrahedra[*t as usize][c]));
            }
        }
        triangles
    }

    /// Per tetrahedron, its neighbour across the face opposite to each corner; none at the boundary.
    pub fn neighbours(&self) -> Vec<[Option<u32>; 4]> {
        let mut neighbours = vec![[None; 4]; self.tetrahedra.len()];
        for face in self.sorted_faces().chunk_by(|a, b| a.0 == b.0) {
            if let [(_, t, f), (_, u, g)] = face {
                neighbours[*t as usize][*f as usize] = Some(*u);
                neighbours[*u as usize][*g as usize] = Some(*t);
            }
        }
        neighbours
    }

    /// Edges as pairs of nodes in increasing order, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let of = |t: &[u32; 4]| super::quality::EDGES.map(|[i, j]| [t[i].min(t[j]), t[i].max(t[j])]);
        let mut edges: Vec<[u32; 2]> = self.tetrahedra.iter().flat_map(of).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Extremes over all tetrahedra; infinite for a mesh without any.
    pub fn quality(&self) -> Quality {
        let mut q =
            Quality { min_dihedral: f64::INFINITY, max_dihedral: 0.0, min_volume: f64::INFINITY, worst: usize::MAX };
        for t in 0..self.tetrahedra.len() {
            let corners = self.corners(t);
            q.min_volume = q.min_volume.min(volume6(&corners) / 6.0);
            for angle in dihedral_angles(&corners).map(f64::to_degrees) {
                q.max_dihedral = q.max_dihedral.max(angle);
                if angle < q.min_dihedral {
                    (q.min_dihedral, q.worst) = (angle, t);
                }
            }
        }
        q
    }

    /// Every face of every tetrahedron: its nodes in increasing order, tetrahedron and face number; sorted.
    pub(super) fn sorted_faces(&self) -> Vec<([u32; 3], u32, u32)> {
        let mut faces = Vec::with_capacity(4 * self.tetrahedra.len());
        for (t, nodes) in (0_u32..).zip(&self.tetrahedra) {
            for (f, corners) in (0_u32..).zip(FACES) {
                let mut key = corners.map(|c| nodes[c]);
                key.sort_unstable();
                faces.push((key, t, f));
            }
        }
        faces.sort_unstable();
        faces
    }
}
