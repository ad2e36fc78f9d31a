//! What nodes have, at other points of the same body: for pictures of bodies with nodes of their own on one surface.

use super::surface::{Interpolated, triangles};
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// Triangles that touch so many of the nearest nodes are looked at for one that holds a point.
const NEAREST: usize = 6;
/// A point so far outside of the best of them, in its barycentric coordinates, is looked for everywhere.
const OUTSIDE: f64 = -0.5;

/// Where points of a body at rest are between its nodes; linear in the triangles of a surface.
#[derive(Debug, Clone)]
pub struct Resampling {
    rest: Vec<[f64; 2]>,
    points: Vec<[f64; 2]>,
    between: Vec<Interpolated>,
}

impl Resampling {
    /// Of the `points` of a body with nodes `rest` and an outline; none where its nodes form no triangles.
    pub fn new(rest: &[[f64; 2]], points: &[[f64; 2]], outline: &[[f64; 2]]) -> Option<Self> {
        let all = triangles(rest, outline);
        let mut touching: Vec<Vec<[usize; 3]>> = vec![Vec::new(); rest.len()];
        for corners in &all {
            corners.iter().for_each(|corner| touching[*corner].push(*corners));
        }
        let tree = RTree::bulk_load(rest.iter().enumerate().map(|(i, node)| GeomWithData::new(*node, i)).collect());
        let of = |point: &[f64; 2]| {
            let near = tree.nearest_neighbor_iter(point).take(NEAREST);
            let near: Vec<[usize; 3]> = near.flat_map(|node| touching[node.data].iter().copied()).collect();
            Interpolated::new(rest, &near, *point)
                .filter(|found| found.least() >= OUTSIDE)
                .or_else(|| Interpolated::new(rest, &all, *point))
        };
        let between = points.iter().map(of).collect::<Option<_>>()?;
        Some(Self { rest: rest.to_vec(), points: points.to_vec(), between })
    }

    /// Where the points are when the nodes are at `moved`; empty where that is not one place for every node.
    pub fn moved(&self, moved: &[[f64; 2]]) -> Vec<[f64; 2]> {
        if moved.len() != self.rest.len() {
            return Vec::new();
        }
        let points = self.points.iter().zip(&self.between);
        // Displacements are what is interpolated: points at the edge stay on it.
        points.map(|(point, at)| [0, 1].map(|k| point[k] + at.of(moved)[k] - at.of(&self.rest)[k])).collect()
    }

    /// Values at the points, between those of nodes; empty where there is not one for every node.
    pub fn values(&self, values: &[f64]) -> Vec<f64> {
        if values.len() != self.rest.len() {
            return Vec::new();
        }
        self.between.iter().map(|at| at.value(values)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L and points that are not its nodes: what is linear in space comes out as it is, at the edge too, and across the notch
    /// nothing is taken from the other arm.
    #[test]
    fn what_is_linear_is_found_again_and_nothing_crosses_a_notch() {
        let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]];
        let lattice = |n: u32| {
            let at = move |i: u32| 4.0 * f64::from(i) / f64::from(n);
            let all = (0..=n).flat_map(move |i| (0..=n).map(move |j| [at(i), at(j)]));
            all.filter(|[x, y]| *x <= 1.0 || *y <= 1.0).collect::<Vec<_>>()
        };
        let (rest, points) = (lattice(16), lattice(28));
        let resampling = Resampling::new(&rest, &points, &outline).unwrap();
        let map = |[x, y]: [f64; 2]| [1.1 * x + 0.3 * y + 2.0, 0.9 * y - 0.2 * x];
        let moved = resampling.moved(&rest.iter().map(|node| map(*node)).collect::<Vec<_>>());
        assert_eq!(moved.len(), points.len());
        for (found, point) in moved.iter().zip(&points) {
            assert!((0..2).all(|k| (found[k] - map(*point)[k]).abs() < 1e-12), "{point:?} {found:?}");
        }
        // One arm is hot.
        let hot: Vec<f64> = rest.iter().map(|[x, _]| f64::from(*x > 1.0)).collect();
        for (value, [x, _]) in resampling.values(&hot).into_iter().zip(&points) {
            let expected = if *x >= 1.25 { 1.0 } else { ((x - 1.0) / 0.25).max(0.0) };
            assert!((value - expected).abs() < 1e-12, "{x} {value}");
        }
        assert!(resampling.moved(&rest[1..]).is_empty() && resampling.values(&[1.0]).is_empty());
        assert!(Resampling::new(&[[0.0, 0.0], [1.0, 0.0]], &points, &outline).is_none());
    }
}
