//! Finite-element baselines on the same nodes, integrated by the same assembly: linear and quadratic triangles.

use crate::discretization::cells::nodal_cells::{Across, NodalCell};
use crate::discretization::{Quadrature, Stencil};
use crate::geometry::{Point, Point2, cross};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::collections::BTreeMap;

/// Triangles with their nodes: three corners, or also the middles of the edges 01, 12, 20.
#[derive(Debug, Clone)]
pub struct Elements {
    corners: Vec<[u32; 3]>,
    middles: Option<Vec<[u32; 3]>>,
    positions: Vec<Point2>,
    /// Bounding boxes of the triangles, with their numbers: for finding the one that a point is in.
    boxes: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>,
}

/// Boxes within this much of a point (relative to the body) are looked into, and a point this far outside a triangle in its
/// barycentric coordinates is on its edge but for rounding. The first is well above the second, so that no triangle is missed.
const BOX_MARGIN: f64 = 1e-9;
const ON_EDGE: f64 = 1e-12;

impl Elements {
    /// Linear triangles.
    pub fn linear(nodes: Vec<Point2>, triangles: Vec<[u32; 3]>) -> Self {
        Self { boxes: boxes(&nodes, &triangles), corners: triangles, middles: None, positions: nodes }
    }

    /// Quadratic triangles: nodes are added in the middle of every edge.
    pub fn quadratic(mut nodes: Vec<Point2>, triangles: Vec<[u32; 3]>) -> Self {
        let mut middle_of: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let middles = triangles
            .iter()
            .map(|t| {
                std::array::from_fn(|e| {
                    let (a, b) = (t[e], t[(e + 1) % 3]);
                    *middle_of.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        nodes.push((nodes[a as usize] + nodes[b as usize]) * 0.5);
                        nodes.len() as u32 - 1
                    })
                })
            })
            .collect();
        Self { boxes: boxes(&nodes, &triangles), corners: triangles, middles: Some(middles), positions: nodes }
    }

    /// All nodes, corners first.
    pub fn positions(&self) -> &[Point2] {
        &self.positions
    }

    /// The triangles as cells.
    pub fn cells(&self) -> Vec<NodalCell> {
        let mut owner: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let directed = |t: &[u32; 3], e: usize| (t[e], t[(e + 1) % 3]);
        for (cell, t) in self.corners.iter().enumerate() {
            owner.extend((0..3).map(|e| (directed(t, e), cell as u32)));
        }
        // The same edge, run the other way, belongs to the triangle across it.
        let across = |(a, b): (u32, u32)| owner.get(&(b, a)).map_or(Across::Outline(u32::MAX), |c| Across::Cell(*c));
        self.corners
            .iter()
            .map(|t| NodalCell {
                boundary: (0..3).map(|e| (self.positions[t[e] as usize], across(directed(t, e)))).collect(),
                area: crate::discretization::cells::triangulation::area(&self.positions, t),
            })
            .collect()
    }

    /// One point per linear triangle, three per quadratic one (exact for the energy of a linear law).
    pub fn rule(&self) -> Quadrature<2> {
        let mut rule = Quadrature::default();
        for (cell, t) in self.corners.iter().enumerate() {
            let slopes = self.barycentric_slopes(t);
            let area = crate::discretization::cells::triangulation::area(&self.positions, t);
            match &self.middles {
                None => push_sorted(&mut rule, area, cell, t.iter().copied().zip(slopes)),
                Some(middles) => {
                    for k in 0..3 {
                        let l: [f64; 3] = std::array::from_fn(|i| if i == k { 2.0 / 3.0 } else { 1.0 / 6.0 });
                        let corner = (0..3).map(|i| (t[i], slopes[i] * (4.0 * l[i] - 1.0)));
                        let middle = (0..3).map(|e| {
                            let n = (e + 1) % 3;
                            (middles[cell][e], (slopes[e] * l[n] + slopes[n] * l[e]) * 4.0)
                        });
                        push_sorted(&mut rule, area / 3.0, cell, corner.chain(middle));
                    }
                }
            }
        }
        rule
    }

    /// Values of the shape functions at a point; the triangle nearest to it is used where it lies outside all.
    pub fn value_stencil(&self, x: &Point<2>) -> Stencil<2> {
        let best = self.deepest(x, self.near(x)).filter(|found| lowest(&found.1) >= -ON_EDGE);
        // Outside all triangles, the nearest may be any.
        let best = best.or_else(|| self.deepest(x, 0..self.corners.len()));
        let Some((cell, l)) = best else { return Stencil::default() };
        // A node's own row is exactly one: rounding must not couple it to its neighbours.
        let l = l.map(|v| {
            if v.abs() < 1e-9 {
                0.0
            } else if (v - 1.0).abs() < 1e-9 {
                1.0
            } else {
                v
            }
        });
        let t = self.corners[cell];
        let mut pairs: Vec<(u32, f64)> = match &self.middles {
            None => (0..3).map(|i| (t[i], l[i])).collect(),
            Some(middles) => (0..3)
                .map(|i| (t[i], l[i] * (2.0 * l[i] - 1.0)))
                .chain((0..3).map(|e| (middles[cell][e], 4.0 * l[e] * l[(e + 1) % 3])))
                .collect(),
        };
        pairs.retain(|p| p.1 != 0.0);
        pairs.sort_unstable_by_key(|p| p.0);
        Stencil {
            nodes: pairs.iter().map(|p| p.0).collect(),
            values: pairs.iter().map(|p| p.1).collect(),
            gradients: Vec::new(),
        }
    }

    /// Triangles whose bounding box contains the point, in ascending order.
    fn near(&self, x: &Point<2>) -> Vec<usize> {
        let all = self.boxes.root().envelope();
        let margin = BOX_MARGIN * (Point2::from(all.upper()) - Point2::from(all.lower())).amax();
        let around = AABB::from_corners([x.x - margin, x.y - margin], [x.x + margin, x.y + margin]);
        let mut found: Vec<usize> = self.boxes.locate_in_envelope_intersecting(&around).map(|b| b.data).collect();
        found.sort_unstable();
        found
    }

    /// The triangle that the point is deepest in, with the point's barycentric coordinates.
    fn deepest(&self, x: &Point<2>, cells: impl IntoIterator<Item = usize>) -> Option<(usize, [f64; 3])> {
        cells
            .into_iter()
            .map(|cell| (cell, self.barycentric(&self.corners[cell], x)))
            .max_by(|a, b| lowest(&a.1).total_cmp(&lowest(&b.1)))
    }

    fn barycentric(&self, t: &[u32; 3], x: &Point<2>) -> [f64; 3] {
        let p = t.map(|i| self.positions[i as usize]);
        let twice = cross(p[1] - p[0], p[2] - p[0]);
        std::array::from_fn(|i| cross(p[(i + 1) % 3] - x, p[(i + 2) % 3] - x) / twice)
    }

    fn barycentric_slopes(&self, t: &[u32; 3]) -> [Point<2>; 3] {
        let p = t.map(|i| self.positions[i as usize]);
        let twice = cross(p[1] - p[0], p[2] - p[0]);
        std::array::from_fn(|i| {
            let opposite = p[(i + 2) % 3] - p[(i + 1) % 3];
            Point2::new(-opposite.y, opposite.x) / twice
        })
    }
}

fn lowest(barycentric: &[f64; 3]) -> f64 {
    barycentric.iter().copied().fold(f64::INFINITY, f64::min)
}

fn boxes(nodes: &[Point2], triangles: &[[u32; 3]]) -> RTree<GeomWithData<Rectangle<[f64; 2]>, usize>> {
    let of = |(cell, t): (usize, &[u32; 3])| {
        let [a, b, c] = t.map(|i| nodes[i as usize]);
        let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        GeomWithData::new(Rectangle::from_corners(low.into(), high.into()), cell)
    };
    RTree::bulk_load(triangles.iter().enumerate().map(of).collect())
}

fn push_sorted(rule: &mut Quadrature<2>, weight: f64, cell: usize, pairs: impl Iterator<Item = (u32, Point<2>)>) {
    let mut pairs: Vec<_> = pairs.collect();
    pairs.sort_unstable_by_key(|p| p.0);
    let (nodes, gradients): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    rule.push(weight, cell, &nodes, &gradients);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points in, on and outside of a fan of triangles: the tree finds what a look at every triangle does.
    #[test]
    fn the_triangle_of_a_point_is_the_one_that_a_full_search_finds() {
        let side = 12_u32;
        let at = |i: u32, j: u32| i * (side + 1) + j;
        let skew = |i: u32, j: u32| Point2::new(f64::from(i) + 0.3 * f64::from(j % 2), f64::from(j) / 3.0);
        let nodes: Vec<Point2> = (0..=side).flat_map(|i| (0..=side).map(move |j| skew(i, j))).collect();
        let squares = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
        let triangles: Vec<[u32; 3]> = squares
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let elements = Elements::quadratic(nodes, triangles);
        let mut points = elements.positions().to_vec();
        points.extend((0..500).map(|k| {
            let k = f64::from(k);
            Point2::new(-1.0 + 15.0 * (k * 0.618).fract(), -0.5 + 5.0 * (k * 0.414).fract())
        }));
        for x in points {
            let every = elements.deepest(&x, 0..elements.corners.len()).unwrap();
            let near = elements.deepest(&x, elements.near(&x)).filter(|found| lowest(&found.1) >= -ON_EDGE);
            assert!(near.is_none_or(|near| near == every), "{x:?}: {near:?} {every:?}");
            assert!(near.is_some() || lowest(&every.1) < -ON_EDGE, "{x:?} is inside and not found");
        }
    }
}
