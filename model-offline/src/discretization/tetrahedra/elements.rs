//! Finite elements on tetrahedra: linear and quadratic, integrated by the same assembly as everything else.
//!
//! Quadratic tetrahedra are isoparametric, `x(l) = Σ_i N_i(l) x_i`, so that a middle node may lie on a curved surface, and on an
//! edge that leaves the rim of a patch at the quarter point. There `x ∝ s²` along the edge, so that a displacement
//! quadratic in s has the √r with which displacements leave a rim (Barsoum, Int. J. Numer. Meth. Eng. 10, 1976).

use super::geometry::{EDGES, volume};
use super::shape::{RulePoint, four_points, fourteen_points, quadratic_slopes, quadratic_values};
use crate::discretization::meshing::TetMesh;
use crate::discretization::{Quadrature, Stencil};
use crate::geometry::Point;
use nalgebra::Matrix3;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::collections::BTreeMap;

type Boxes = RTree<GeomWithData<Rectangle<[f64; 3]>, usize>>;

/// Tetrahedra with their nodes: four corners, or also a middle node on every edge.
#[derive(Debug, Clone)]
pub struct TetElements {
    corners: Vec<[u32; 4]>,
    middles: Option<Vec<[u32; 6]>>,
    /// Whether a quadratic tetrahedron's middle nodes are the middles of straight edges.
    straight: Vec<bool>,
    positions: Vec<Point<3>>,
    /// Bounding boxes of the tetrahedra of the corners, with their numbers.
    boxes: Boxes,
}

/// An element that is turned inside out somewhere.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("tetrahedron {cell} at ({:.4}, {:.4}, {:.4}) is turned inside out by its middle nodes", at[0], at[1], at[2])]
pub struct InsideOut {
    /// Its number.
    pub cell: usize,
    /// Its first corner.
    pub at: [f64; 3],
}

/// Boxes within this much of a point, over the body, are looked into.
const BOX_MARGIN: f64 = 1e-9;
/// A point this far outside in barycentric coordinates is on the face but for rounding.
const ON_FACE: f64 = 1e-12;

impl TetElements {
    /// Linear tetrahedra.
    pub fn linear(mesh: &TetMesh) -> Self {
        Self {
            boxes: boxes(mesh),
            corners: mesh.tetrahedra.clone(),
            middles: None,
            straight: Vec::new(),
            positions: mesh.nodes.clone(),
        }
    }

    /// Quadratic tetrahedra. `place` says where the middle node of the edge between two corners goes; none leaves it in
    /// the middle. Elements that would be turned inside out keep straight edges with the nodes in the middle.
    pub fn quadratic(mesh: &TetMesh, place: impl Fn(u32, u32) -> Option<Point<3>>) -> Self {
        let mut positions = mesh.nodes.clone();
        let mut number: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut edges = Vec::new();
        let middles: Vec<[u32; 6]> = mesh
            .tetrahedra
            .iter()
            .map(|t| {
                EDGES.map(|[a, b]| {
                    let (a, b) = (t[a].min(t[b]), t[a].max(t[b]));
                    *number.entry((a, b)).or_insert_with(|| {
                        let middle = (mesh.nodes[a as usize] + mesh.nodes[b as usize]) * 0.5;
                        positions.push(place(a, b).unwrap_or(middle));
                        edges.push((a, b));
                        positions.len() as u32 - 1
                    })
                })
            })
            .collect();
        let mut elements = Self {
            boxes: boxes(mesh),
            straight: vec![false; middles.len()],
            corners: mesh.tetrahedra.clone(),
            middles: Some(middles),
            positions,
        };
        elements.straighten(mesh.nodes.len(), &edges);
        elements
    }

    /// Puts the middle nodes of elements that are turned inside out back into the middle, until none is.
    fn straighten(&mut self, corners: usize, edges: &[(u32, u32)]) {
        let middle = |positions: &[Point<3>], m: u32| {
            let (a, b) = edges[m as usize - corners];
            (positions[a as usize] + positions[b as usize]) * 0.5
        };
        let Some(middles) = self.middles.clone() else { return };
        loop {
            let mut moved = false;
            for (cell, of_cell) in middles.iter().enumerate() {
                if self.is_inside_out(cell) {
                    for &m in of_cell {
                        let straight = middle(&self.positions, m);
                        moved |= self.positions[m as usize] != straight;
                        self.positions[m as usize] = straight;
                    }
                }
            }
            if !moved {
                break;
            }
        }
        for (cell, m) in middles.iter().enumerate() {
            self.straight[cell] = m.iter().all(|&m| self.positions[m as usize] == middle(&self.positions, m));
        }
    }

    /// All nodes, corners first.
    pub fn positions(&self) -> &[Point<3>] {
        &self.positions
    }

    /// The middle node of every edge that has one, by its two corners, the lower number first.
    pub fn middles(&self) -> BTreeMap<(u32, u32), u32> {
        let all = self.middles.iter().flatten().zip(&self.corners);
        let edges =
            all.flat_map(|(m, t)| EDGES.iter().zip(m).map(|([a, b], &m)| ((t[*a].min(t[*b]), t[*a].max(t[*b])), m)));
        edges.collect()
    }

    /// One point per linear tetrahedron; four per straight quadratic one (exact for a linear law), fourteen where it is
    /// bent.
    ///
    /// # Errors
    /// [`InsideOut`] where an element's map is not one to one.
    pub fn rule(&self) -> Result<Quadrature<3>, InsideOut> {
        let mut rule = Quadrature::default();
        let (four, fourteen) = (four_points(), fourteen_points());
        for (cell, t) in self.corners.iter().enumerate() {
            match &self.middles {
                None => {
                    let slopes = self.barycentric_slopes(t);
                    push_sorted(&mut rule, volume(&self.positions, t), cell, t.iter().copied().zip(slopes));
                }
                Some(middles) => {
                    let points = if self.straight[cell] { &four } else { &fourteen };
                    for (l, share) in points {
                        let (gradients, jacobian) = self.quadratic_gradients(cell, l);
                        if jacobian.is_nan() || jacobian <= 0.0 {
                            return Err(InsideOut { cell, at: self.positions[t[0] as usize].into() });
                        }
                        let nodes = t.iter().chain(&middles[cell]).copied();
                        push_sorted(&mut rule, jacobian / 6.0 * share, cell, nodes.zip(gradients));
                    }
                }
            }
        }
        Ok(rule)
    }

    /// Nodes of a quadratic tetrahedron.
    fn nodes_of(&self, cell: usize) -> [u32; 10] {
        let middles = self.middles.as_ref().map_or([0; 6], |m| m[cell]);
        std::array::from_fn(|i| if i < 4 { self.corners[cell][i] } else { middles[i - 4] })
    }

    /// ∂x/∂(l₁, l₂, l₃) with l₀ = 1 − l₁ − l₂ − l₃, by columns, and the same derivatives of the shape functions.
    fn map_slopes(&self, cell: usize, l: &[f64; 4]) -> (Matrix3<f64>, [Point<3>; 10]) {
        let slopes = quadratic_slopes(l).map(|s| Point::<3>::new(s[1] - s[0], s[2] - s[0], s[3] - s[0]));
        let nodes = self.nodes_of(cell);
        let map = nodes
            .iter()
            .zip(&slopes)
            .fold(Matrix3::zeros(), |sum, (&i, slope)| sum + self.positions[i as usize] * slope.transpose());
        (map, slopes)
    }

    /// Gradients of the ten shape functions, and the determinant of the map.
    fn quadratic_gradients(&self, cell: usize, l: &[f64; 4]) -> ([Point<3>; 10], f64) {
        let (map, slopes) = self.map_slopes(cell, l);
        let inverse = map.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN)).transpose();
        (slopes.map(|slope| inverse * slope), map.determinant())
    }

    fn is_inside_out(&self, cell: usize) -> bool {
        let corners = (0..4).map(|k| std::array::from_fn(|i| if i == k { 0.97 } else { 0.01 }));
        let inside = fourteen_points().into_iter().map(|point: RulePoint| point.0);
        corners.chain(inside).any(|l: [f64; 4]| {
            let determinant = self.map_slopes(cell, &l).0.determinant();
            determinant.is_nan() || determinant <= 0.0
        })
    }

    /// Values of the shape functions at a point; the tetrahedron nearest to it is used where it lies outside all.
    pub fn value_stencil(&self, x: &Point<3>) -> Stencil<3> {
        let inside = self.deepest(x, self.near(x)).filter(|found| lowest(&found.1) >= -ON_FACE);
        let Some((cell, l)) = inside.or_else(|| self.deepest(x, 0..self.corners.len())) else {
            return Stencil::default();
        };
        // A node's own row is exactly one: rounding must not couple it to its neighbours.
        let settled = |l: [f64; 4]| {
            l.map(|v| match v {
                _ if v.abs() < 1e-9 => 0.0,
                _ if (v - 1.0).abs() < 1e-9 => 1.0,
                _ => v,
            })
        };
        let mut pairs: Vec<(u32, f64)> = match &self.middles {
            None => self.corners[cell].into_iter().zip(settled(l)).collect(),
            Some(_) => {
                let l = if self.straight[cell] { l } else { self.mapped_back(cell, x, l) };
                self.nodes_of(cell).into_iter().zip(quadratic_values(&settled(l))).collect()
            }
        };
        pairs.retain(|p| p.1 != 0.0);
        pairs.sort_unstable_by_key(|p| p.0);
        let (nodes, values) = pairs.into_iter().unzip();
        Stencil { nodes, values, gradients: Vec::new() }
    }

    /// Barycentric coordinates of a point in a bent element, by Newton's method from those of the straight one.
    fn mapped_back(&self, cell: usize, x: &Point<3>, mut l: [f64; 4]) -> [f64; 4] {
        let nodes = self.nodes_of(cell);
        for _ in 0..20 {
            let values = quadratic_values(&l);
            let at =
                nodes.iter().zip(values).fold(Point::<3>::zeros(), |s, (&i, v)| s + self.positions[i as usize] * v);
            let Some(step) = self.map_slopes(cell, &l).0.try_inverse().map(|inverse| inverse * (x - at)) else { break };
            (1..4).for_each(|k| l[k] += step[k - 1]);
            l[0] = 1.0 - l[1] - l[2] - l[3];
            if step.amax() < 1e-14 {
                break;
            }
        }
        l
    }

    /// Tetrahedra whose bounding box contains the point, in ascending order.
    fn near(&self, x: &Point<3>) -> Vec<usize> {
        let all = self.boxes.root().envelope();
        let margin = BOX_MARGIN * (Point::<3>::from(all.upper()) - Point::<3>::from(all.lower())).amax();
        let around = AABB::from_corners(x.map(|v| v - margin).into(), x.map(|v| v + margin).into());
        let mut found: Vec<usize> = self.boxes.locate_in_envelope_intersecting(&around).map(|b| b.data).collect();
        found.sort_unstable();
        found
    }

    /// The tetrahedron that the point is deepest in, with its barycentric coordinates there.
    fn deepest(&self, x: &Point<3>, cells: impl IntoIterator<Item = usize>) -> Option<(usize, [f64; 4])> {
        cells
            .into_iter()
            .map(|cell| (cell, self.barycentric(&self.corners[cell], x)))
            .max_by(|a, b| lowest(&a.1).total_cmp(&lowest(&b.1)))
    }

    fn barycentric(&self, t: &[u32; 4], x: &Point<3>) -> [f64; 4] {
        let slopes = self.barycentric_slopes(t);
        let from = x - self.positions[t[0] as usize];
        std::array::from_fn(|i| slopes[i].dot(&from) + if i == 0 { 1.0 } else { 0.0 })
    }

    fn barycentric_slopes(&self, t: &[u32; 4]) -> [Point<3>; 4] {
        let [a, b, c, d] = t.map(|i| self.positions[i as usize]);
        let (u, v, w) = (b - a, c - a, d - a);
        let six = u.cross(&v).dot(&w);
        let (b, c, d) = (v.cross(&w) / six, w.cross(&u) / six, u.cross(&v) / six);
        [-(b + c + d), b, c, d]
    }
}

fn lowest(barycentric: &[f64; 4]) -> f64 {
    barycentric.iter().copied().fold(f64::INFINITY, f64::min)
}

fn boxes(mesh: &TetMesh) -> Boxes {
    let of = |(cell, t): (usize, &[u32; 4])| {
        let [a, b, c, d] = t.map(|i| mesh.nodes[i as usize]);
        let (low, high) = (a.inf(&b).inf(&c).inf(&d), a.sup(&b).sup(&c).sup(&d));
        GeomWithData::new(Rectangle::from_corners(low.into(), high.into()), cell)
    };
    RTree::bulk_load(mesh.tetrahedra.iter().enumerate().map(of).collect())
}

fn push_sorted(rule: &mut Quadrature<3>, weight: f64, cell: usize, pairs: impl Iterator<Item = (u32, Point<3>)>) {
    let mut pairs: Vec<_> = pairs.collect();
    pairs.sort_unstable_by_key(|p| p.0);
    let (nodes, gradients): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    rule.push(weight, cell, &nodes, &gradients);
}
