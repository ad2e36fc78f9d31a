//! Rules that integrate the weak form. Every rule is a list of points with a weight and the gradients of the shape
//! functions there, so that assembly knows one loop only: `∫ W(F) dΩ ≈ Σ_q w_q W(I + Σ_I d_I ⊗ g_I(q))`.

use super::nodal_cells::NodalCell;
use super::shape_functions::Reproduce;
use super::{Point, ShapeError, ShapeFunctions, Stencil};
use crate::scene::geometry::Point2;

/// Integration points with the gradients of the shape functions that are not zero there (compressed rows).
#[derive(Debug, Clone, Default)]
pub struct Quadrature<const D: usize> {
    weights: Vec<f64>,
    cells: Vec<u32>,
    offsets: Vec<u32>,
    nodes: Vec<u32>,
    gradients: Vec<Point<D>>,
}

/// One integration point.
#[derive(Debug, Clone, Copy)]
pub struct QuadraturePoint<'a, const D: usize> {
    /// Weight: reference volume (per unit thickness in the plane), length units to the power D.
    pub weight: f64,
    /// The cell it belongs to, which decides the material.
    pub cell: u32,
    /// Nodes I, ascending.
    pub nodes: &'a [u32],
    /// Gradients g_I, per length unit.
    pub gradients: &'a [Point<D>],
}

impl<const D: usize> Quadrature<D> {
    /// Appends a point.
    ///
    /// # Panics
    /// When there is not one gradient per node.
    pub fn push(&mut self, weight: f64, cell: usize, nodes: &[u32], gradients: &[Point<D>]) {
        assert_eq!(nodes.len(), gradients.len(), "one gradient per node");
        if self.offsets.is_empty() {
            self.offsets.push(0);
        }
        self.weights.push(weight);
        self.cells.push(cell as u32);
        self.nodes.extend_from_slice(nodes);
        self.gradients.extend_from_slice(gradients);
        self.offsets.push(self.nodes.len() as u32);
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// Point q.
    #[inline]
    pub fn point(&self, q: usize) -> QuadraturePoint<'_, D> {
        let row = self.offsets[q] as usize..self.offsets[q + 1] as usize;
        QuadraturePoint {
            weight: self.weights[q],
            cell: self.cells[q],
            nodes: &self.nodes[row.clone()],
            gradients: &self.gradients[row],
        }
    }

    /// All points in order.
    pub fn points(&self) -> impl Iterator<Item = QuadraturePoint<'_, D>> + '_ {
        (0..self.len()).map(|q| self.point(q))
    }

    /// Total number of (point, node) pairs.
    pub fn pairs(&self) -> usize {
        self.nodes.len()
    }
}

/// Direct nodal integration: weight = area of the nodal cell, gradient at the node. Cheap; blind to modes that
/// alternate from node to node (Chen, Wu, Yoon & You 2001).
///
/// # Errors
/// [`ShapeError`] names the node whose moment matrix fails.
pub fn direct_nodal(shape: &ShapeFunctions<'_, 2>, cells: &[NodalCell]) -> Result<Quadrature<2>, ShapeError> {
    let mut rule = Quadrature::default();
    let (mut candidates, mut stencil) = (Vec::new(), Stencil::default());
    for (node, cell) in cells.iter().enumerate() {
        let x = shape.cloud().positions()[node];
        shape.cloud().covering(&x, &x, &mut candidates);
        shape.evaluate(&x, node, &candidates, Reproduce::Field, true, &mut stencil)?;
        rule.push(cell.area, node, &stencil.nodes, &stencil.gradients);
    }
    Ok(rule)
}

/// Two-point Gauss rule on [0, 1], each point with weight ½.
const GAUSS_2: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Stabilised conforming nodal integration: the gradient averaged over the nodal cell by the divergence theorem,
/// `g_I(L) = (1/A_L) ∮ Ψ_I n dΓ`, two Gauss points per cell edge. Passes the linear patch test and has no spurious
/// zero-energy modes (Chen, Wu, Yoon & You 2001).
///
/// # Errors
/// [`ShapeError`] names the node in whose cell the moment matrix fails.
pub fn stabilised_conforming_nodal(
    shape: &ShapeFunctions<'_, 2>,
    cells: &[NodalCell],
) -> Result<Quadrature<2>, ShapeError> {
    let mut average = CellAverage::new(shape);
    let mut rule = Quadrature::default();
    for (node, cell) in cells.iter().enumerate() {
        average.begin(cell);
        for (a, b, _) in cell.edges() {
            average.add_edge(node, a, b)?;
        }
        average.finish(cell.area);
        rule.push(cell.area, node, &average.nodes, &average.gradients);
    }
    Ok(rule)
}

/// Accumulates `∮ Ψ_I n dΓ` over one nodal cell after another, without allocating per cell.
struct CellAverage<'a, 'c> {
    shape: &'a ShapeFunctions<'c, 2>,
    candidates: Vec<u32>,
    stencil: Stencil<2>,
    /// The sum by node, all zero between cells.
    sum: Vec<Point<2>>,
    nodes: Vec<u32>,
    gradients: Vec<Point<2>>,
}

impl<'a, 'c> CellAverage<'a, 'c> {
    fn new(shape: &'a ShapeFunctions<'c, 2>) -> Self {
        let sum = vec![Point::zeros(); shape.cloud().len()];
        Self {
            shape,
            candidates: Vec::new(),
            stencil: Stencil::default(),
            sum,
            nodes: Vec::new(),
            gradients: Vec::new(),
        }
    }

    fn begin(&mut self, cell: &NodalCell) {
        let (low, high) = crate::scene::geometry::bounds(&cell.corners());
        self.shape.cloud().covering(&low, &high, &mut self.candidates);
        self.nodes.clear();
        self.gradients.clear();
    }

    fn add_edge(&mut self, node: usize, a: Point2, b: Point2) -> Result<(), ShapeError> {
        let weighted_normal = Point2::new(b.y - a.y, a.x - b.x) * 0.5;
        if weighted_normal.norm_squared() == 0.0 {
            return Ok(());
        }
        for s in GAUSS_2 {
            let x = a + (b - a) * s;
            self.shape.evaluate(&x, node, &self.candidates, Reproduce::Field, false, &mut self.stencil)?;
            for (&i, &value) in self.stencil.nodes.iter().zip(&self.stencil.values) {
                self.nodes.push(i);
                self.sum[i as usize] += weighted_normal * value;
            }
        }
        Ok(())
    }

    fn finish(&mut self, area: f64) {
        self.nodes.sort_unstable();
        self.nodes.dedup();
        for &i in &self.nodes {
            self.gradients.push(std::mem::take(&mut self.sum[i as usize]) / area);
        }
    }
}
