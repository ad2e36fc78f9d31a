//! A spacing wanted at every place of a body: given on the triangles of a mesh, made to grow no faster than nodes may.

use crate::geometry::{Point2, cross};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A spacing that varies linearly over the triangles of a mesh.
#[derive(Debug, Clone)]
pub struct Sizing {
    nodes: Vec<Point2>,
    triangles: Vec<[u32; 3]>,
    /// Spacing at the nodes.
    spacing: Vec<f64>,
    slope: f64,
    boxes: RTree<GeomWithData<Rectangle<[f64; 2]>, u32>>,
    near: RTree<GeomWithData<[f64; 2], u32>>,
}

impl Sizing {
    /// The largest spacing that is nowhere more than its triangle `wants`, nor grows by more than `slope` per length.
    pub fn new(nodes: &[Point2], triangles: &[[u32; 3]], wants: &[f64], slope: f64) -> Self {
        let mut spacing = vec![f64::INFINITY; nodes.len()];
        for (t, wanted) in triangles.iter().zip(wants) {
            for &i in t {
                spacing[i as usize] = spacing[i as usize].min(*wanted);
            }
        }
        grow_no_faster(nodes, triangles, slope, &mut spacing);
        let corner = |i: u32| [nodes[i as usize].x, nodes[i as usize].y];
        let around = |(t, &[a, b, c]): (usize, &[u32; 3])| {
            let (a, b, c) = (corner(a), corner(b), corner(c));
            GeomWithData::new(Rectangle::from_aabb(AABB::from_points(&[a, b, c])), t as u32)
        };
        let at = |i: u32| GeomWithData::new(corner(i), i);
        Self {
            boxes: RTree::bulk_load(triangles.iter().enumerate().map(around).collect()),
            near: RTree::bulk_load((0..nodes.len() as u32).map(at).collect()),
            nodes: nodes.to_vec(),
            triangles: triangles.to_vec(),
            spacing,
            slope,
        }
    }

    /// Spacing wanted at `x`; outside of the mesh what its nearest node allows there.
    pub fn at(&self, x: Point2) -> f64 {
        let inside = |t: &u32| {
            let weights = self.weights(*t, x);
            weights.iter().all(|w| *w >= 0.0).then_some((*t, weights))
        };
        let boxes = self.boxes.locate_all_at_point(&[x.x, x.y]).map(|b| &b.data);
        if let Some((t, weights)) = boxes.filter_map(inside).next() {
            return self.triangles[t as usize].iter().zip(weights).map(|(i, w)| w * self.spacing[*i as usize]).sum();
        }
        self.near.nearest_neighbor(&[x.x, x.y]).map_or(f64::INFINITY, |node| {
            let i = node.data as usize;
            self.spacing[i] + self.slope * (self.nodes[i] - x).norm()
        })
    }

    /// Barycentric coordinates.
    fn weights(&self, t: u32, x: Point2) -> [f64; 3] {
        let corners = self.triangles[t as usize].map(|i| self.nodes[i as usize]);
        let twice = cross(corners[1] - corners[0], corners[2] - corners[0]);
        std::array::from_fn(|k| cross(corners[(k + 1) % 3] - x, corners[(k + 2) % 3] - x) / twice)
    }
}

/// Lowers what is more than `slope` times the way along edges above a neighbour, the smallest first.
fn grow_no_faster(nodes: &[Point2], triangles: &[[u32; 3]], slope: f64, spacing: &mut [f64]) {
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); nodes.len()];
    for t in triangles {
        for k in 0..3 {
            neighbours[t[k] as usize].extend([t[(k + 1) % 3], t[(k + 2) % 3]]);
        }
    }
    // Positive numbers are ordered as their bits are.
    let key = |s: f64, i: usize| Reverse((s.to_bits(), i as u32));
    let mut queue: BinaryHeap<_> = spacing.iter().enumerate().map(|(i, &s)| key(s, i)).collect();
    while let Some(Reverse((bits, i))) = queue.pop() {
        let here = f64::from_bits(bits);
        if here > spacing[i as usize] {
            continue;
        }
        for &j in &neighbours[i as usize] {
            let most = here + slope * (nodes[i as usize] - nodes[j as usize]).norm();
            if most < spacing[j as usize] {
                spacing[j as usize] = most;
                queue.push(key(most, j as usize));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of squares of side 1, each cut along its diagonal; the first wants a tenth, the others more than they get.
    fn strip() -> Sizing {
        let nodes: Vec<Point2> = (0..=10).flat_map(|i| [0.0, 1.0].map(|y| Point2::new(f64::from(i), y))).collect();
        let triangles: Vec<[u32; 3]> =
            (0..10).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]).collect();
        let wanted: Vec<f64> = (0..20).map(|t| if t < 2 { 0.1 } else { 2.0 }).collect();
        Sizing::new(&nodes, &triangles, &wanted, 0.3)
    }

    #[test]
    fn spacing_is_what_triangles_want_and_grows_no_faster_than_it_may() {
        let sizing = strip();
        let at = |x: f64, y: f64| sizing.at(Point2::new(x, y));
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(at(0.4, 0.3), 0.1);
        // Along the edge that lies straight: 0.3 more per length from the last corner of the first square.
        for x in [1.0, 2.0, 4.5, 7.0] {
            close(at(x, 0.0), 0.1 + 0.3 * (x - 1.0));
        }
        // Far away everything has what it wants.
        close(at(8.5, 0.5), 2.0);
        // Outside of the mesh: from the nearest node on.
        close(at(0.0, -2.0), 0.1 + 0.3 * 2.0);
    }

    #[test]
    fn nodes_are_no_farther_apart_than_is_wanted() {
        use crate::discretization::nodes::graded::{Grading, InterfaceFit, graded_nodes, sized_nodes};
        let features = crate::scene::Scene::bundled("paper").unwrap().without_inclusions().features();
        let (low, high) = features.outline.bounds();
        let around = [low, Point2::new(high.x, low.y), high, Point2::new(low.x, high.y)];
        let grading = Grading::level(&features, 0, InterfaceFit::Between);
        let wanted = 0.25 * grading.coarsest;
        let sizing = Sizing::new(&around, &[[0, 1, 2], [0, 2, 3]], &[wanted; 2], grading.slope);
        let (graded, sized) = (graded_nodes(&features, &grading), sized_nodes(&features, &grading, &sizing));
        // A square of side `wanted` has about a node, wherever gradings have fewer.
        let even = features.outline.area() / (wanted * wanted);
        assert!((graded.len() as f64) < 0.5 * even && (sized.len() as f64) > even, "{} {}", graded.len(), sized.len());
    }
}
