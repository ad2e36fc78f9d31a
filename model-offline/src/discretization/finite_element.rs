//! Finite-element baselines on the same nodes, integrated by the same assembly: linear and quadratic triangles.

use super::nodal_cells::{Across, NodalCell};
use super::{Quadrature, Stencil};
use crate::geometry::{Point, Point2, cross};
use std::collections::BTreeMap;

/// Triangles with their nodes: three corners, or also the middles of the edges 01, 12, 20.
#[derive(Debug, Clone)]
pub struct Elements {
    corners: Vec<[u32; 3]>,
    middles: Option<Vec<[u32; 3]>>,
    positions: Vec<Point2>,
}

impl Elements {
    /// Linear triangles.
    pub fn linear(nodes: Vec<Point2>, triangles: Vec<[u32; 3]>) -> Self {
        Self { corners: triangles, middles: None, positions: nodes }
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
        Self { corners: triangles, middles: Some(middles), positions: nodes }
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
                area: super::triangulation::area(&self.positions, t),
            })
            .collect()
    }

    /// One point per linear triangle, three per quadratic one (exact for the energy of a linear law).
    pub fn rule(&self) -> Quadrature<2> {
        let mut rule = Quadrature::default();
        for (cell, t) in self.corners.iter().enumerate() {
            let slopes = self.barycentric_slopes(t);
            let area = super::triangulation::area(&self.positions, t);
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
        let barycentric = |t: &[u32; 3]| -> [f64; 3] {
            let p = t.map(|i| self.positions[i as usize]);
            let twice = cross(p[1] - p[0], p[2] - p[0]);
            std::array::from_fn(|i| cross(p[(i + 1) % 3] - x, p[(i + 2) % 3] - x) / twice)
        };
        let lowest = |l: &[f64; 3]| l.iter().copied().fold(f64::INFINITY, f64::min);
        let best = self
            .corners
            .iter()
            .enumerate()
            .map(|(cell, t)| (cell, barycentric(t)))
            .max_by(|a, b| lowest(&a.1).total_cmp(&lowest(&b.1)));
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

    fn barycentric_slopes(&self, t: &[u32; 3]) -> [Point<2>; 3] {
        let p = t.map(|i| self.positions[i as usize]);
        let twice = cross(p[1] - p[0], p[2] - p[0]);
        std::array::from_fn(|i| {
            let opposite = p[(i + 2) % 3] - p[(i + 1) % 3];
            Point2::new(-opposite.y, opposite.x) / twice
        })
    }
}

fn push_sorted(rule: &mut Quadrature<2>, weight: f64, cell: usize, pairs: impl Iterator<Item = (u32, Point<2>)>) {
    let mut pairs: Vec<_> = pairs.collect();
    pairs.sort_unstable_by_key(|p| p.0);
    let (nodes, gradients): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    rule.push(weight, cell, &nodes, &gradients);
}
