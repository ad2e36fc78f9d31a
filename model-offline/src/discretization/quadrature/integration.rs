//! Rules that integrate the weak form. Every rule is a list of points with a weight and the gradients of the shape
//! functions there, so that assembly knows one loop only: `∫ W(F) dΩ ≈ Σ_q w_q W(I + Σ_I d_I ⊗ g_I(q))`.

use crate::discretization::approximation::shape_functions::Wanted;
use crate::discretization::cells::nodal_cells::{Across, NodalCell};
use crate::discretization::method::{Basis, Consistency};
use crate::discretization::{ShapeError, ShapeFunctions, Stencil};
use crate::geometry::{Point, Point2};

/// Integration points with the gradients of the shape functions that are not zero there (compressed rows).
#[derive(Debug, Clone, Default)]
pub struct Quadrature<const D: usize> {
    weights: Vec<f64>,
    cells: Vec<u32>,
    offsets: Vec<u32>,
    nodes: Vec<u32>,
    gradients: Vec<Point<D>>,
    /// Packed lower triangles of the points' stabilisation matrices, point by point; empty when the rule has none.
    stabilisation: Vec<f64>,
    stabilisation_offsets: Vec<u32>,
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
    /// Stabilisation matrix B, whose energy is `½ μ₀ Σ_IJ B_IJ d_I·d_J` with the cell's shear modulus at rest: lower
    /// triangle, column by column over `nodes`; empty when the rule needs none.
    pub stabilisation: &'a [f64],
}

impl<const D: usize> QuadraturePoint<'_, D> {
    /// B_IJ of the nodes at places `i` and `j` of the point's list; 0 when the rule needs no stabilisation.
    pub fn stabilisation_entry(&self, i: usize, j: usize) -> f64 {
        let (row, column) = (i.max(j), i.min(j));
        // Columns before this one hold n, n − 1, … entries.
        let start = column * self.nodes.len() - column * column.saturating_sub(1) / 2;
        self.stabilisation.get(start + row - column).copied().unwrap_or(0.0)
    }
}

impl<const D: usize> Quadrature<D> {
    /// Appends a point with a stabilisation matrix (packed lower triangle, column by column over `nodes`).
    ///
    /// # Panics
    /// When the matrix has not the size that `nodes` say, or points without one came before.
    pub fn push_stabilised(
        &mut self,
        (weight, cell): (f64, usize),
        nodes: &[u32],
        gradients: &[Point<D>],
        matrix: &[f64],
    ) {
        assert_eq!(matrix.len(), nodes.len() * (nodes.len() + 1) / 2, "a packed lower triangle");
        if self.stabilisation_offsets.is_empty() {
            self.stabilisation_offsets.push(0);
        }
        assert_eq!(self.stabilisation_offsets.len(), self.weights.len() + 1, "all points have a matrix, or none");
        self.push(weight, cell, nodes, gradients);
        self.stabilisation.extend_from_slice(matrix);
        self.stabilisation_offsets.push(self.stabilisation.len() as u32);
    }

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
        let matrix = match self.stabilisation_offsets.get(q..q + 2) {
            Some(&[from, to]) => from as usize..to as usize,
            _ => 0..0,
        };
        QuadraturePoint {
            weight: self.weights[q],
            cell: self.cells[q],
            nodes: &self.nodes[row.clone()],
            gradients: &self.gradients[row],
            stabilisation: &self.stabilisation[matrix],
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
        shape.evaluate(&x, node, &candidates, Wanted::GRADIENTS, &mut stencil)?;
        rule.push(cell.area, node, &stencil.nodes, &stencil.gradients);
    }
    Ok(rule)
}

/// Two-point Gauss rule on [0, 1]: positions and weights.
pub(in crate::discretization) const GAUSS_2: [(f64, f64); 2] =
    [(0.211_324_865_405_187_1, 0.5), (0.788_675_134_594_812_9, 0.5)];

/// Three-point Gauss rule on [0, 1]: positions and weights.
pub(in crate::discretization) const GAUSS_3: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Stabilised conforming nodal integration: the gradient averaged over the nodal cell by the divergence theorem,
/// `g_I(L) = (1/A_L) ∮ Ψ_I n dΓ`, two Gauss points per cell edge. Passes the linear patch test
/// (Chen, Wu, Yoon & You 2001). On a lattice it shares direct nodal integration's ghost modes: fields that alternate from
/// node to node have no mean gradient over any inner cell, so that the symbol of the stiffness vanishes at (π, 0), (0, π) and
/// (π, π), and only the boundary keeps them from being free.
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
        average.compute(node, cell, &GAUSS_2)?;
        rule.push(cell.area, node, &average.nodes, &average.gradients);
    }
    Ok(rule)
}

/// Naturally stabilised nodal integration (Hillman & Chen 2016): the energy of a cell is that of the gradient's linear
/// variation over it. Here the variation is sampled at four points `F ± s_j ∂_j F`, `s_j = √(2 M_j / A)`, with M_j the
/// second moment of the cell about its node: to second order this is NSNI's `W + ½ Σ_j (M_j/A) ∂_jF : 𝔸 : ∂_jF`, and it
/// stays the derivative of an energy at finite strain.
///
/// [Corrected](Consistency::Corrected), the average of the gradient over the cell is replaced by SCNI's, which makes the rule
/// variationally consistent to first order (patch test) while the gradient's variation keeps the stabilisation.
///
/// # Errors
/// [`ShapeError`] names the node whose moment matrix fails.
pub fn naturally_stabilised_nodal(
    shape: &ShapeFunctions<'_, 2>,
    cells: &[NodalCell],
    consistency: Consistency,
) -> Result<Quadrature<2>, ShapeError> {
    let mut rule = Quadrature::default();
    let mut average = CellAverage::new(shape);
    let mut candidates = Vec::new();
    let (mut field, mut derivative) = (Stencil::default(), [Stencil::default(), Stencil::default()]);
    for (node, cell) in cells.iter().enumerate() {
        let x = shape.cloud().positions()[node];
        shape.cloud().covering(&x, &x, &mut candidates);
        shape.evaluate(&x, node, &candidates, Wanted::GRADIENTS, &mut field)?;
        for (axis, stencil) in derivative.iter_mut().enumerate() {
            shape.evaluate(&x, node, &candidates, Wanted::implicit_gradient(axis), stencil)?;
        }
        let mean = if consistency == Consistency::Corrected {
            average.compute(node, cell, &GAUSS_2)?;
            (average.nodes.clone(), average.gradients.clone())
        } else {
            (field.nodes.clone(), field.gradients.clone())
        };
        let moments = second_moments(cell, x);
        for (axis, stencil) in derivative.iter().enumerate() {
            // ∂_j g_I: the gradient of the implicit derivative.
            let reach = (2.0 * moments[axis] / cell.area).sqrt();
            for side in [reach, -reach] {
                let (nodes, gradients) = add_scaled(&mean.0, &mean.1, &stencil.nodes, &stencil.gradients, side);
                rule.push(0.25 * cell.area, node, &nodes, &gradients);
            }
        }
    }
    Ok(rule)
}

/// Gauss points in triangular background cells: three per triangle (degree 2), or six (degree 4) for the quadratic
/// basis.
///
/// [Corrected](Consistency::Corrected), the mean gradient over every triangle is shifted to its boundary average, which makes the rule
/// variationally consistent to first order.
///
/// # Errors
/// [`ShapeError`] names a node near the point at which the moment matrix fails.
pub fn gauss(
    shape: &ShapeFunctions<'_, 2>,
    triangles: &[[u32; 3]],
    cells: &[NodalCell],
    basis: Basis,
    consistency: Consistency,
) -> Result<Quadrature<2>, ShapeError> {
    let mut rule = Quadrature::default();
    let mut average = CellAverage::new(shape);
    let mut candidates = Vec::new();
    let points: &[([f64; 3], f64)] = match basis {
        Basis::Linear => &TRIANGLE_3,
        Basis::Quadratic => &TRIANGLE_6,
    };
    for (index, (triangle, cell)) in triangles.iter().zip(cells).enumerate() {
        let corners: Vec<Point2> = cell.corners();
        let node = triangle[0] as usize;
        let mut stencils = Vec::with_capacity(points.len());
        for (l, _) in points {
            let x = corners[0] * l[0] + corners[1] * l[1] + corners[2] * l[2];
            shape.cloud().covering(&x, &x, &mut candidates);
            let mut stencil = Stencil::default();
            shape.evaluate(&x, node, &candidates, Wanted::GRADIENTS, &mut stencil)?;
            stencils.push(stencil);
        }
        if consistency == Consistency::Corrected {
            average.compute(node, cell, &GAUSS_3)?;
        }
        // shift = boundary average − mean of the points.
        let (mut nodes, mut shift) = (average.nodes.clone(), average.gradients.clone());
        if consistency == Consistency::Corrected {
            for (stencil, (_, weight)) in stencils.iter().zip(points) {
                (nodes, shift) = add_scaled(&nodes, &shift, &stencil.nodes, &stencil.gradients, -weight);
            }
        }
        for (stencil, (_, weight)) in stencils.iter().zip(points) {
            let (nodes, gradients) = add_scaled(&nodes, &shift, &stencil.nodes, &stencil.gradients, 1.0);
            rule.push(weight * cell.area, index, &nodes, &gradients);
        }
    }
    Ok(rule)
}

/// Degree 2 on a triangle (Strang & Fix 1973): barycentric coordinates, weight over the area.
const TRIANGLE_3: [([f64; 3], f64); 3] = {
    const A: f64 = 2.0 / 3.0;
    const B: f64 = 1.0 / 6.0;
    [([A, B, B], 1.0 / 3.0), ([B, A, B], 1.0 / 3.0), ([B, B, A], 1.0 / 3.0)]
};

/// Degree 4 on a triangle (Dunavant 1985).
pub(in crate::discretization) const TRIANGLE_6: [([f64; 3], f64); 6] = {
    const A: f64 = 0.445_948_490_915_965;
    const WA: f64 = 0.223_381_589_678_011;
    const B: f64 = 0.091_576_213_509_771;
    const WB: f64 = 0.109_951_743_655_322;
    const A1: f64 = 1.0 - 2.0 * A;
    const B1: f64 = 1.0 - 2.0 * B;
    [([A1, A, A], WA), ([A, A1, A], WA), ([A, A, A1], WA), ([B1, B, B], WB), ([B, B1, B], WB), ([B, B, B1], WB)]
};

/// Sum of two sparse rows of gradients, the second scaled; nodes ascending.
fn add_scaled(
    a_nodes: &[u32],
    a: &[Point<2>],
    b_nodes: &[u32],
    b: &[Point<2>],
    scale: f64,
) -> (Vec<u32>, Vec<Point<2>>) {
    let (mut nodes, mut sum) = (Vec::new(), Vec::new());
    let (mut i, mut j) = (0, 0);
    while i < a_nodes.len() || j < b_nodes.len() {
        let next_a = a_nodes.get(i).copied().unwrap_or(u32::MAX);
        let next_b = b_nodes.get(j).copied().unwrap_or(u32::MAX);
        let mut value = Point::zeros();
        if next_a <= next_b {
            value += a[i];
            i += 1;
        }
        if next_b <= next_a {
            value += b[j] * scale;
            j += 1;
        }
        nodes.push(next_a.min(next_b));
        sum.push(value);
    }
    (nodes, sum)
}

/// Second moments ∫ (x_j − X_j)² dΩ of a cell about a point, exact for polygons.
fn second_moments(cell: &NodalCell, about: Point2) -> Point2 {
    cell.edges().fold(Point2::zeros(), |sum, (a, b, _)| {
        let (a, b) = (a - about, b - about);
        let twice = crate::geometry::cross(a, b);
        sum + (a.component_mul(&a) + a.component_mul(&b) + b.component_mul(&b)) * (twice / 12.0)
    })
}

/// Computes `(1/A) ∮ Ψ_I n dΓ` for one cell after another, without allocating per cell.
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
        Self {
            shape,
            candidates: Vec::new(),
            stencil: Stencil::default(),
            sum: vec![Point::zeros(); shape.cloud().len()],
            nodes: Vec::new(),
            gradients: Vec::new(),
        }
    }

    /// Fills `nodes` and `gradients`; `node` is the one that an error names, `points` the rule per edge.
    fn compute(&mut self, node: usize, cell: &NodalCell, points: &[(f64, f64)]) -> Result<(), ShapeError> {
        let (low, high) = cell
            .boundary
            .iter()
            .fold((Point2::repeat(f64::INFINITY), Point2::repeat(f64::NEG_INFINITY)), |(low, high), c| {
                (low.inf(&c.0), high.sup(&c.0))
            });
        self.shape.cloud().covering(&low, &high, &mut self.candidates);
        self.nodes.clear();
        self.gradients.clear();
        for (a, b, across) in cell.edges() {
            let normal = Point2::new(b.y - a.y, a.x - b.x);
            if normal.norm_squared() == 0.0 || across == Across::Bridge {
                continue;
            }
            for (s, weight) in points {
                let x = a + (b - a) * *s;
                self.shape.evaluate(&x, node, &self.candidates, Wanted::VALUES, &mut self.stencil)?;
                for (&i, &value) in self.stencil.nodes.iter().zip(&self.stencil.values) {
                    self.nodes.push(i);
                    self.sum[i as usize] += normal * (weight * value);
                }
            }
        }
        self.nodes.sort_unstable();
        self.nodes.dedup();
        for &i in &self.nodes {
            self.gradients.push(std::mem::take(&mut self.sum[i as usize]) / cell.area);
        }
        Ok(())
    }
}
