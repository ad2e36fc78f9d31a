//! What of a body's surface is held: patches of boundary triangles, their nodes and their rims.

use crate::discretization::TetMesh;
use crate::geometry::{Implicit, Point, is_reentrant};
use std::collections::{BTreeMap, BTreeSet};

/// A node this far outside of a region, over the size of the body, is in it but for rounding.
const ROUNDING: f64 = 1e-8;
/// The surface turns by no more than this where a patch ends in the middle of a face: cos 30°.
const SMOOTH: f64 = 0.866;
/// A body's edge turns by more than this: cos 18°.
const SHARP: f64 = 0.95;
/// What is round an edge is looked at this share of its length away.
const BESIDE: f64 = 0.1;
/// A patch is a strip if its narrow side is below this part of its extent.
const NARROW: f64 = 1.0 / 3.0;

/// The boundary triangles of a body.
#[derive(Debug)]
pub(super) struct Surface<'m> {
    mesh: &'m TetMesh,
    triangles: Vec<[u32; 3]>,
    size: f64,
}

impl<'m> Surface<'m> {
    pub(super) fn new(mesh: &'m TetMesh, size: f64) -> Self {
        Self { triangles: mesh.boundary(), mesh, size }
    }

    /// The triangles of a patch: all corners in the region, and the middle too.
    pub(super) fn patch(&self, regions: &[&dyn Implicit]) -> Vec<[u32; 3]> {
        let tolerance = ROUNDING * self.size;
        let holds = |region: &&dyn Implicit, t: &[u32; 3]| {
            let corners = t.map(|i| self.mesh.nodes[i as usize]);
            let middle = corners.iter().sum::<Point<3>>() / 3.0;
            corners.iter().all(|x| region.holds(x, tolerance)) && region.holds(&middle, tolerance)
        };
        self.triangles.iter().filter(|t| regions.iter().any(|region| holds(region, t))).copied().collect()
    }

    /// Edges where a patch ends and the surface goes on smoothly: there the solution is singular like √r.
    pub(super) fn rim(&self, patch: &[[u32; 3]]) -> Vec<(u32, u32)> {
        let inside: BTreeSet<[u32; 3]> = patch.iter().copied().collect();
        let smooth = |a: &[u32; 3], b: &[u32; 3]| self.normal(a).dot(&self.normal(b)) > SMOOTH;
        self.edges_where(|_, a, b| inside.contains(a) != inside.contains(b) && smooth(a, b))
    }

    /// The body's own re-entrant edges: there the solution is singular too, round a right angle like r^0.54.
    pub(super) fn reentrant(&self, body: &dyn Implicit) -> Vec<(u32, u32)> {
        // Without edges, creases are those of the mesh.
        if body.sheets().len() < 2 {
            return Vec::new();
        }
        let at = |n: u32| self.mesh.nodes[n as usize];
        self.edges_where(|(x, y), a, b| {
            let (middle, length) = (0.5 * (at(x) + at(y)), (at(y) - at(x)).norm());
            self.normal(a).dot(&self.normal(b)) < SHARP && is_reentrant(body, &middle, BESIDE * length)
        })
    }

    /// Edges between two triangles of which something is the case.
    fn edges_where(&self, is: impl Fn((u32, u32), &[u32; 3], &[u32; 3]) -> bool) -> Vec<(u32, u32)> {
        let mut beside: BTreeMap<(u32, u32), Vec<&[u32; 3]>> = BTreeMap::new();
        for t in &self.triangles {
            for edge in edges(t) {
                beside.entry(edge).or_default().push(t);
            }
        }
        let found = beside.into_iter().filter(|(edge, beside)| matches!(beside[..], [a, b] if is(*edge, a, b)));
        found.map(|(edge, _)| edge).collect()
    }

    /// Twice the narrow side of the rectangle with a patch's area and rim (its hydraulic diameter, where it is a strip); infinite
    /// for what is less than three times as long as wide. Length units.
    pub(super) fn narrow_width(&self, patch: &[[u32; 3]]) -> f64 {
        let at = |n: u32| self.mesh.nodes[n as usize];
        let area: f64 = patch.iter().map(|&[a, b, c]| 0.5 * (at(b) - at(a)).cross(&(at(c) - at(a))).norm()).sum();
        let mut once: BTreeMap<(u32, u32), bool> = BTreeMap::new();
        patch.iter().flat_map(edges).for_each(|edge| {
            once.entry(edge).and_modify(|once| *once = false).or_insert(true);
        });
        let ends = once.into_iter().filter(|(_, once)| *once);
        let quarter = ends.map(|((a, b), _)| (at(b) - at(a)).norm()).sum::<f64>() / 4.0;
        // What has no rim, as the whole of a surface or of a void's, has no ends.
        if quarter == 0.0 {
            return f64::INFINITY;
        }
        // The sides are the roots of s² − 2 s · quarter + area; discs have none.
        let side = quarter - (quarter * quarter - area).max(0.0).sqrt();
        let corners = || patch.iter().flatten().map(|n| at(*n));
        let low = corners().fold(Point::<3>::repeat(f64::INFINITY), |a, b| a.inf(&b));
        let high = corners().fold(Point::<3>::repeat(f64::NEG_INFINITY), |a, b| a.sup(&b));
        if side < NARROW * (high - low).max() { 2.0 * side } else { f64::INFINITY }
    }

    /// All triangles, outwards.
    pub(super) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// All edges of the surface.
    pub(super) fn edges(&self) -> BTreeSet<(u32, u32)> {
        self.triangles.iter().flat_map(edges).collect()
    }

    fn normal(&self, t: &[u32; 3]) -> Point<3> {
        let [a, b, c] = t.map(|i| self.mesh.nodes[i as usize]);
        (b - a).cross(&(c - a)).normalize()
    }
}

/// Corners of a patch, and of quadratic elements the middle nodes of its edges, ascending.
pub(super) fn nodes_of(patch: &[[u32; 3]], middles: &BTreeMap<(u32, u32), u32>) -> Vec<u32> {
    let corners = patch.iter().flatten().copied();
    let between = patch.iter().flat_map(edges).filter_map(|edge| middles.get(&edge).copied());
    corners.chain(between).collect::<BTreeSet<u32>>().into_iter().collect()
}

/// A corner of a part of the mesh that has no triangle of these nodes; none where every part has one. Parts are what common
/// faces join.
pub(super) fn loose<'n>(mesh: &TetMesh, held: impl Iterator<Item = &'n u32>) -> Option<Point<3>> {
    let held: BTreeSet<u32> = held.copied().collect();
    // Three corners of an element, and no part turns about them. What meets in a corner or an edge alone turns about it.
    let is_held = |corners: &[u32; 4]| corners.iter().filter(|node| held.contains(node)).count() >= 3;
    let mut reached: Vec<bool> = mesh.tetrahedra.iter().map(is_held).collect();
    let mut beyond: Vec<u32> = (0..).zip(&reached).filter(|(_, held)| **held).map(|(t, _)| t).collect();
    let neighbours = mesh.neighbours();
    while let Some(t) = beyond.pop() {
        for next in neighbours[t as usize].into_iter().flatten() {
            if !std::mem::replace(&mut reached[next as usize], true) {
                beyond.push(next);
            }
        }
    }
    let first = reached.iter().position(|reached| !reached)?;
    Some(mesh.nodes[mesh.tetrahedra[first][0] as usize])
}

/// The part of a mesh that each of its elements belongs to, counted from 0 in their order. Parts are what common faces join.
pub(super) fn parts(mesh: &TetMesh) -> Vec<u32> {
    let neighbours = mesh.neighbours();
    let mut part = vec![u32::MAX; mesh.tetrahedra.len()];
    let mut count = 0;
    for first in 0..part.len() {
        if part[first] != u32::MAX {
            continue;
        }
        part[first] = count;
        let mut beyond = vec![first as u32];
        while let Some(t) = beyond.pop() {
            for next in neighbours[t as usize].into_iter().flatten() {
                if part[next as usize] == u32::MAX {
                    part[next as usize] = count;
                    beyond.push(next);
                }
            }
        }
        count += 1;
    }
    part
}

/// Whether two patches have triangles in common, and not just an edge or a corner.
pub(super) fn overlap(a: &[[u32; 3]], b: &[[u32; 3]]) -> bool {
    let of_a: BTreeSet<&[u32; 3]> = a.iter().collect();
    b.iter().any(|triangle| of_a.contains(triangle))
}

/// Edges of a triangle, the lower number first.
pub(super) fn edges(t: &[u32; 3]) -> [(u32, u32); 3] {
    [0, 1, 2].map(|k| {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        (a.min(b), a.max(b))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::meshing::{Request, stuff};
    use crate::geometry::Solid;

    fn cuboid(max: [f64; 3]) -> Solid {
        Solid::Box { min: Point::<3>::zeros(), max: Point::<3>::from(max) }
    }

    /// Of the edges of a mesh those on a body's inner edge alone; a bore whose facets are coarse has none.
    #[test]
    fn a_mesh_knows_the_inner_edges_of_its_body() {
        let reentrant = |body: &Solid, size: f64| -> Vec<[Point<3>; 2]> {
            let size = |_: &Point<3>| size;
            let request = Request {
                body,
                interfaces: &[],
                patches: &[],
                size: &size,
                lattice: None,
                most_nodes: 100_000,
                pinned: &[],
            };
            let mesh = stuff(&request).unwrap();
            let found = Surface::new(&mesh, 1.0).reentrant(body);
            found.into_iter().map(|(a, b)| [mesh.nodes[a as usize], mesh.nodes[b as usize]]).collect()
        };
        let l = Solid::Union(vec![cuboid([0.8, 0.4, 0.3]), cuboid([0.4, 0.4, 0.6])]);
        for size in [0.1, 0.07] {
            let found = reentrant(&l, size);
            let length: f64 = found.iter().map(|[a, b]| (b - a).norm()).sum();
            assert!((length - 0.4).abs() < 1e-9, "{length}");
            assert!(found.iter().flatten().all(|x| (x.x - 0.4).abs() < 1e-9 && (x.z - 0.3).abs() < 1e-9));
        }
        let ball = |at: f64| Solid::Sphere { centre: Point::<3>::new(at, 0.0, 0.0), radius: 1.0 };
        let circle = 2.0 * std::f64::consts::PI * 0.75_f64.sqrt();
        let chords: f64 =
            reentrant(&Solid::Union(vec![ball(0.0), ball(1.0)]), 0.3).iter().map(|[a, b]| (b - a).norm()).sum();
        assert!((chords / circle - 1.0).abs() < 0.03, "{chords} of {circle}");
        let (from, to) = (Point::<3>::new(0.5, 0.5, -1.0), Point::<3>::new(0.5, 0.5, 2.0));
        let bore = Solid::Difference(vec![cuboid([1.0; 3]), Solid::Cylinder { from, to, radius: 0.2 }]);
        let dent = Solid::Sphere { centre: Point::<3>::new(0.5, 0.5, 1.0), radius: 0.3 };
        for body in [cuboid([1.0; 3]), bore, Solid::Difference(vec![cuboid([1.0; 3]), dent])] {
            assert_eq!(reentrant(&body, 0.2), Vec::<[Point<3>; 2]>::new());
        }
    }
}
