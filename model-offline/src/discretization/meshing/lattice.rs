//! The body-centred cubic lattice of an octree, graded (Labelle and Shewchuk, Isosurface Stuffing, 2007).
//!
//! Every tetrahedron has one corner in the centre of a leaf and an edge or a triangle on one of its faces. Between
//! leaves of one size the centres are joined to each other and to each edge of the face (a BCC tetrahedron, halved
//! where the edge has a node in its middle). A face with four smaller leaves behind it is a fan of eight triangles;
//! seen from one of these it is half of a square, cut by the diagonal that ends in the middle of the large face.

use super::octree::{Cube, Octree, ROOT};
use super::quality::volume6;
use crate::geometry::Point;

/// Nodes and tetrahedra of a lattice.
#[derive(Debug)]
pub(super) struct Lattice {
    /// Positions, length units.
    pub(super) nodes: Vec<Point<3>>,
    /// Of positive volume.
    pub(super) tetrahedra: Vec<[u32; 4]>,
}

type Site = [i64; 3];

/// Where the lattice lies in space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    /// Position of the lowest corner of the root, length units.
    pub(super) origin: Point<3>,
    /// Side of the root, length units.
    pub(super) side: f64,
}

impl Placement {
    /// Position of a site of the grid of units.
    pub(super) fn position(&self, site: Site) -> Point<3> {
        // Divided first, so that planes at multiples of the spacing are met to the last bit or two.
        self.origin + Point::from_fn(|k, _| self.side * (site[k] as f64 / ROOT as f64))
    }

    /// A number of units as a length.
    pub(super) fn length(&self, units: i64) -> f64 {
        self.side * (units as f64 / ROOT as f64)
    }
}

/// Tetrahedra of all leaves that `wanted` accepts.
pub(super) fn lattice(tree: &Octree, placement: &Placement, wanted: impl Fn(&Cube) -> bool) -> Lattice {
    let mut sites: Vec<[Site; 4]> = Vec::new();
    for leaf in tree.leaves().filter(|l| wanted(l)) {
        for axis in 0..3 {
            for forward in [false, true] {
                face_tetrahedra(tree, leaf, axis, forward, &mut sites);
            }
        }
    }
    let mut all: Vec<Site> = sites.iter().flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    let nodes: Vec<Point<3>> = all.iter().map(|s| placement.position(*s)).collect();
    let number = |s: &Site| all.binary_search(s).unwrap_or_default() as u32;
    let tetrahedra = sites
        .iter()
        .map(|t| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| number(&t[i]));
            let positive = volume6(&[a, b, c, d].map(|n| nodes[n as usize])) > 0.0;
            if positive { [a, b, c, d] } else { [b, a, c, d] }
        })
        .collect();
    Lattice { nodes, tetrahedra }
}

/// The tetrahedra between the centre of a leaf and one of its faces.
fn face_tetrahedra(tree: &Octree, leaf: &Cube, axis: usize, forward: bool, out: &mut Vec<[Site; 4]>) {
    let (centre, side) = (leaf.centre(), leaf.side);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    // Just behind the face, off its middle so as to be inside a leaf whatever its size.
    let mut behind = centre;
    behind[axis] += if forward { side / 2 } else { -side / 2 - 1 };
    let Some(next) = tree.find(behind) else { return };
    let mut middle = centre;
    middle[axis] += if forward { side / 2 } else { -side / 2 };
    let corner = |i: i64, j: i64| {
        let mut c = middle;
        c[u] += i * side / 2;
        c[v] += j * side / 2;
        c
    };
    let ring = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    let sides = || (0..4).map(|i| (ring[i], ring[(i + 1) % 4]));
    let halfway = |a: Site, b: Site| [0, 1, 2].map(|k| (a[k] + b[k]) / 2);
    if next.side == side {
        // Once per pair.
        if !forward {
            return;
        }
        for (a, b) in sides() {
            let m = halfway(a, b);
            if is_halved(tree, a, b, side) {
                out.extend([[centre, next.centre(), a, m], [centre, next.centre(), m, b]]);
            } else {
                out.push([centre, next.centre(), a, b]);
            }
        }
    } else if next.side < side {
        for (a, b) in sides() {
            let m = halfway(a, b);
            out.extend([[centre, middle, a, m], [centre, middle, m, b]]);
        }
    } else {
        // The corner in the middle of the large face and the one opposite to it.
        let mut hub = next.centre();
        hub[axis] = middle[axis];
        let at = (0..4).find(|i| ring[*i] == hub).unwrap_or_default();
        for turn in [1, 2] {
            out.push([centre, ring[at], ring[(at + turn) % 4], ring[(at + turn + 1) % 4]]);
        }
    }
}

/// Whether a leaf beside the edge from `a` to `b` is smaller than the edge is long.
fn is_halved(tree: &Octree, a: Site, b: Site, side: i64) -> bool {
    let along = (0..3).find(|k| a[*k] != b[*k]).unwrap_or_default();
    let (u, v) = ((along + 1) % 3, (along + 2) % 3);
    [(0, 0), (-1, 0), (0, -1), (-1, -1)].iter().any(|(i, j)| {
        let mut x = a;
        x[along] = a[along].min(b[along]);
        x[u] += i;
        x[v] += j;
        tree.find(x).is_some_and(|l| l.side < side)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::meshing::TetMesh;

    #[test]
    fn a_graded_lattice_fills_space_without_gaps_and_with_good_angles() {
        // Refined towards a point off the middle.
        let splits = |c: &Cube| {
            let x = c.centre().map(|x| x as f64 / ROOT as f64);
            let r = ((x[0] - 0.3).powi(2) + (x[1] - 0.41).powi(2) + (x[2] - 0.37).powi(2)).sqrt();
            c.side as f64 / ROOT as f64 > 0.02 + 0.3 * r
        };
        let tree = Octree::new(splits, usize::MAX).unwrap();
        let placement = Placement { origin: Point::zeros(), side: 1.0 };
        let Lattice { nodes, tetrahedra } = lattice(&tree, &placement, |_| true);
        let part = vec![0; tetrahedra.len()];
        let mesh = TetMesh { nodes, tetrahedra, part };
        // All of the boundary is the open ring of half pyramids along the root: inside every face is shared by two.
        let on_root = |n: &u32| {
            let x = mesh.nodes[*n as usize];
            x.iter().any(|x| *x == 0.0 || *x == 1.0) || x.iter().any(|x| *x < 0.2 || *x > 0.8)
        };
        assert!(mesh.boundary().iter().all(|t| t.iter().any(on_root)));
        let q = mesh.quality();
        assert!(q.min_dihedral > 29.9 && q.max_dihedral < 120.1 && q.min_volume > 0.0, "{q:?}");
    }
}
