//! Local refinement of a triangulation by newest-vertex bisection: nested, conforming, and never worse in shape than a
//! few times bisected (Mitchell, ACM Trans. Math. Softw. 15, 1989; marking of edges as in Funken, Praetorius & Wissgott,
//! Comput. Methods Appl. Math. 11, 2011).

use super::features::Features;
use super::graded::{Grading, InterfaceFit, graded_nodes};
use crate::discretization::cells::triangulation::{TriangulationError, triangulate_along};
use crate::geometry::{Point2, Polygon, distance_to_segment};
use std::collections::{BTreeMap, BTreeSet};

/// Triangles with their corners counter-clockwise; the next bisection of a triangle cuts the edge from its first to its
/// second corner.
#[derive(Debug, Clone)]
pub struct Triangulation {
    /// Corners' positions.
    pub nodes: Vec<Point2>,
    /// Corner numbers.
    pub triangles: Vec<[u32; 3]>,
}

/// Longest edges of triangles at a shaft, over its length: along it, and at its tip.
const ALONG_THE_SHAFT: f64 = 0.1;
const AT_THE_TIP: f64 = 0.03;
/// Rounds of refinement along a shaft: each halves triangles at least.
const MOST_ROUNDS: usize = 24;

/// An edge by its ends, the lower number first.
type Edge = (u32, u32);

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}

impl Triangulation {
    /// A coarse triangulation whose edges follow the outline, the inclusions and the needle's contact.
    ///
    /// # Errors
    /// [`TriangulationError`] where the nodes do not follow the outline.
    pub fn coarse(features: &Features, level: i32) -> Result<Self, TriangulationError> {
        let nodes = graded_nodes(features, &Grading::level(features, level, InterfaceFit::On));
        let mut lines: Vec<(Point2, Point2)> = features.inclusions.iter().flat_map(Polygon::edges).collect();
        lines.extend(features.contact.windows(2).map(|s| (s[0], s[1])));
        lines.extend(features.shaft.map(|[entry, tip]| (entry, tip)));
        let mut triangles = triangulate_along(&nodes, &features.outline, &lines)?;
        for t in &mut triangles {
            let length = |e: usize| (nodes[t[e] as usize] - nodes[t[(e + 1) % 3] as usize]).norm();
            let longest = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
            t.rotate_left(longest);
        }
        let mesh = Self { nodes, triangles };
        Ok(match features.shaft {
            Some(shaft) => mesh.refined_along(shaft),
            None => mesh,
        })
    }

    /// Triangles at a shaft become so small that its forces are resolved: what else is refined for asks nothing of it.
    fn refined_along(mut self, [entry, tip]: [Point2; 2]) -> Self {
        let length = (tip - entry).norm();
        for _ in 0..MOST_ROUNDS {
            let node = |i: u32| self.nodes[i as usize];
            let too_large = |t: &[u32; 3]| {
                let touches = t.iter().any(|&i| distance_to_segment(node(i), entry, tip) <= 1e-9 * length);
                let size = (0..3).map(|e| (node(t[e]) - node(t[(e + 1) % 3])).norm()).fold(0.0, f64::max);
                let centre = (node(t[0]) + node(t[1]) + node(t[2])) / 3.0;
                let wanted = ((centre - tip).norm()).clamp(AT_THE_TIP * length, ALONG_THE_SHAFT * length);
                touches && size > wanted
            };
            let marked: Vec<usize> = (0..self.triangles.len()).filter(|&t| too_large(&self.triangles[t])).collect();
            if marked.is_empty() {
                break;
            }
            self = self.bisected(&marked).0;
        }
        self
    }

    /// Every triangle cut into four, with the triangle that each came from.
    pub fn refined(&self) -> (Self, Vec<u32>) {
        self.bisected(&(0..self.triangles.len()).collect::<Vec<_>>())
    }

    /// The same for the given triangles; others are cut where that is needed to keep the triangulation conforming.
    pub fn bisected(&self, marked: &[usize]) -> (Self, Vec<u32>) {
        let cut = self.edges_to_cut(marked);
        let mut nodes = self.nodes.clone();
        let mut middle_of: BTreeMap<Edge, u32> = BTreeMap::new();
        for &(a, b) in &cut {
            middle_of.insert((a, b), nodes.len() as u32);
            nodes.push((self.nodes[a as usize] + self.nodes[b as usize]) * 0.5);
        }
        let (mut triangles, mut parents) = (Vec::new(), Vec::new());
        for (parent, &[a, b, c]) in self.triangles.iter().enumerate() {
            let middle = |p, q| middle_of.get(&edge(p, q)).copied();
            let before = triangles.len();
            match middle(a, b) {
                None => triangles.push([a, b, c]),
                Some(m) => {
                    // Two halves, each cut again where the edge opposite to m is.
                    match middle(b, c) {
                        None => triangles.push([b, c, m]),
                        Some(n) => triangles.extend([[m, b, n], [c, m, n]]),
                    }
                    match middle(c, a) {
                        None => triangles.push([c, a, m]),
                        Some(n) => triangles.extend([[m, c, n], [a, m, n]]),
                    }
                }
            }
            parents.extend(std::iter::repeat_n(parent as u32, triangles.len() - before));
        }
        (Self { nodes, triangles }, parents)
    }

    /// All edges of the marked triangles, and the first edge of every triangle that loses another one.
    fn edges_to_cut(&self, marked: &[usize]) -> BTreeSet<Edge> {
        let edges = |[a, b, c]: [u32; 3]| [edge(a, b), edge(b, c), edge(c, a)];
        let mut cut: BTreeSet<Edge> = marked.iter().flat_map(|&t| edges(self.triangles[t])).collect();
        loop {
            let before = cut.len();
            for &t in &self.triangles {
                let [first, second, third] = edges(t);
                if cut.contains(&second) || cut.contains(&third) {
                    cut.insert(first);
                }
            }
            if cut.len() == before {
                return cut;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cross;
    use crate::scene::Scene;

    fn area(mesh: &Triangulation, t: &[u32; 3]) -> f64 {
        let [a, b, c] = t.map(|i| mesh.nodes[i as usize]);
        0.5 * cross(b - a, c - a)
    }

    #[test]
    fn bisection_keeps_area_orientation_and_conformity() {
        let features = Scene::bundled("paper-hull").unwrap().features();
        let mut mesh = Triangulation::coarse(&features, -2).unwrap();
        for round in 0..6 {
            // Towards the target, and once everything.
            let near = |t: &[u32; 3]| t.iter().any(|&i| (mesh.nodes[i as usize] - features.target).norm() < 0.15);
            let marked: Vec<usize> =
                mesh.triangles.iter().enumerate().filter(|(_, t)| round == 3 || near(t)).map(|(i, _)| i).collect();
            let (finer, parents) = mesh.bisected(&marked);
            assert_eq!(parents.len(), finer.triangles.len());
            let total: f64 = finer.triangles.iter().map(|t| area(&finer, t)).sum();
            assert!((total - features.outline.area()).abs() < 1e-12 * total);
            assert!(finer.triangles.iter().all(|t| area(&finer, t) > 0.0));
            // Every inner edge has exactly two triangles: no hanging nodes.
            let mut directed = BTreeSet::new();
            for &[a, b, c] in &finer.triangles {
                assert!([(a, b), (b, c), (c, a)].into_iter().all(|e| directed.insert(e)));
            }
            let boundary = directed.iter().filter(|(a, b)| !directed.contains(&(*b, *a)));
            for (a, b) in boundary {
                let middle = (finer.nodes[*a as usize] + finer.nodes[*b as usize]) * 0.5;
                assert!(features.outline.distance_to_boundary(middle) < 1e-12);
            }
            mesh = finer;
        }
    }

    #[test]
    fn cutting_everything_gives_four_children_each() {
        let mesh = Triangulation::coarse(&Scene::bundled("paper").unwrap().features(), -1).unwrap();
        let (finer, parents) = mesh.refined();
        assert_eq!(finer.triangles.len(), 4 * mesh.triangles.len());
        for (t, parent) in finer.triangles.iter().zip(parents) {
            let share = area(&finer, t) / area(&mesh, &mesh.triangles[parent as usize]);
            assert!((share - 0.25).abs() < 1e-12);
        }
    }
}
