//! Tetrahedra that change, with the tetrahedra around every node at hand.

use super::quality::{EDGES, FACES, worst_sine};
use crate::geometry::Point;

/// Marks the nodes of a tetrahedron that is gone.
const GONE: [u32; 4] = [u32::MAX; 4];

/// A tetrahedral complex under construction.
#[derive(Debug, Default)]
pub(super) struct Complex {
    /// Positions, length units.
    pub(super) nodes: Vec<Point<3>>,
    tetrahedra: Vec<[u32; 4]>,
    /// As in a mesh.
    part: Vec<u32>,
    around: Vec<Vec<u32>>,
    free: Vec<u32>,
}

/// The nodes around an edge in order, from face to face.
#[derive(Debug, Clone)]
pub(super) struct Ring {
    /// Such that (a, b, nodes[i], nodes[i + 1]) has positive volume.
    pub(super) nodes: Vec<u32>,
    /// Whether the last is followed by the first; else the edge lies on the boundary and so do its triangles with the
    /// first and the last.
    pub(super) closed: bool,
}

impl Complex {
    pub(super) fn new(nodes: Vec<Point<3>>, tetrahedra: Vec<[u32; 4]>) -> Self {
        let around = vec![Vec::with_capacity(24); nodes.len()];
        let mut complex = Self { nodes, around, ..Self::default() };
        for t in tetrahedra {
            complex.insert(t, 0);
        }
        complex
    }

    /// All tetrahedra with their numbers.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u32, [u32; 4])> {
        (0..).zip(&self.tetrahedra).filter(|(_, t)| **t != GONE).map(|(i, t)| (i, *t))
    }

    pub(super) fn tetrahedron(&self, t: u32) -> [u32; 4] {
        self.tetrahedra[t as usize]
    }

    pub(super) fn is_gone(&self, t: u32) -> bool {
        self.tetrahedra[t as usize] == GONE
    }

    pub(super) fn part(&self, t: u32) -> u32 {
        self.part[t as usize]
    }

    pub(super) fn set_part(&mut self, t: u32, part: u32) {
        self.part[t as usize] = part;
    }

    pub(super) fn corners(&self, nodes: [u32; 4]) -> [Point<3>; 4] {
        nodes.map(|n| self.nodes[n as usize])
    }

    pub(super) fn centroid(&self, nodes: [u32; 4]) -> Point<3> {
        self.corners(nodes).iter().sum::<Point<3>>() / 4.0
    }

    /// The tetrahedra around a node.
    pub(super) fn star(&self, node: u32) -> &[u32] {
        &self.around[node as usize]
    }

    /// Sine of the worst dihedral angle of the tetrahedra around a node.
    pub(super) fn star_quality(&self, node: u32) -> f64 {
        let quality = |t: &u32| worst_sine(&self.corners(self.tetrahedron(*t)));
        self.star(node).iter().map(quality).fold(f64::INFINITY, f64::min)
    }

    /// Nodes joined to a node, in increasing order.
    pub(super) fn neighbours(&self, node: u32) -> Vec<u32> {
        let mut all: Vec<u32> = self.star(node).iter().flat_map(|t| self.tetrahedron(*t)).collect();
        all.sort_unstable();
        all.dedup();
        all.retain(|n| *n != node);
        all
    }

    /// The tetrahedra around the edge from `a` to `b`.
    pub(super) fn edge_star(&self, a: u32, b: u32) -> Vec<u32> {
        self.star(a).iter().copied().filter(|t| self.tetrahedron(*t).contains(&b)).collect()
    }

    pub(super) fn has_edge(&self, a: u32, b: u32) -> bool {
        self.star(a).iter().any(|t| self.tetrahedron(*t).contains(&b))
    }

    /// The nodes around an edge; none if the tetrahedra around it do not form one fan.
    pub(super) fn ring(&self, a: u32, b: u32, star: &[u32]) -> Option<Ring> {
        let mut steps: Vec<[u32; 2]> = star.iter().map(|t| across(self.tetrahedron(*t), a, b)).collect();
        // Begin after a gap, if there is one.
        let first = (0..steps.len()).find(|i| steps.iter().all(|s| s[1] != steps[*i][0]));
        let closed = first.is_none();
        let begin = steps.swap_remove(first.unwrap_or(0));
        let mut nodes = vec![begin[0], begin[1]];
        while let Some(i) = steps.iter().position(|s| s[0] == nodes[nodes.len() - 1]) {
            nodes.push(steps.swap_remove(i)[1]);
        }
        if closed && nodes.pop() != Some(begin[0]) {
            return None;
        }
        steps.is_empty().then_some(Ring { nodes, closed })
    }

    /// Adds a tetrahedron.
    pub(super) fn insert(&mut self, nodes: [u32; 4], part: u32) -> u32 {
        let t = self.free.pop().unwrap_or_else(|| {
            self.tetrahedra.push(GONE);
            self.part.push(0);
            self.tetrahedra.len() as u32 - 1
        });
        self.tetrahedra[t as usize] = nodes;
        self.part[t as usize] = part;
        for n in nodes {
            self.around[n as usize].push(t);
        }
        t
    }

    /// Takes a tetrahedron away.
    pub(super) fn remove(&mut self, t: u32) {
        for n in std::mem::replace(&mut self.tetrahedra[t as usize], GONE) {
            self.around[n as usize].retain(|u| *u != t);
        }
        self.free.push(t);
    }

    /// Adds a node that no tetrahedron has yet.
    pub(super) fn add_node(&mut self, x: Point<3>) -> u32 {
        self.nodes.push(x);
        self.around.push(Vec::with_capacity(24));
        self.nodes.len() as u32 - 1
    }

    /// Splits the edge from `a` to `b` at node `m`, and all tetrahedra around it in two.
    pub(super) fn split_edge(&mut self, a: u32, b: u32, m: u32) {
        for t in self.edge_star(a, b) {
            let (nodes, part) = (self.tetrahedron(t), self.part(t));
            self.remove(t);
            for end in [a, b] {
                self.insert(nodes.map(|n| if n == end { m } else { n }), part);
            }
        }
    }

    /// Edges of the tetrahedra that `wanted` accepts, as increasing pairs, sorted.
    pub(super) fn edges(&self, wanted: impl Fn(&[u32; 4]) -> bool) -> Vec<[u32; 2]> {
        let of = |t: [u32; 4]| EDGES.map(|[i, j]| [t[i].min(t[j]), t[i].max(t[j])]);
        let mut edges: Vec<[u32; 2]> = self.iter().map(|(_, t)| t).filter(wanted).flat_map(of).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }
}

/// The two corners off the edge from `a` to `b`, in the order that makes (a, b, c, d) positive.
fn across(t: [u32; 4], a: u32, b: u32) -> [u32; 2] {
    let at = |n: u32| t.iter().position(|m| *m == n).unwrap_or_default();
    let (i, j) = (at(a), at(b));
    // The face opposite to a runs b → c → d outward when (a, b, c, d) is positive.
    let face = FACES[i];
    let k = face.iter().position(|c| *c == j).unwrap_or_default();
    [t[face[(k + 1) % 3]], t[face[(k + 2) % 3]]]
}
