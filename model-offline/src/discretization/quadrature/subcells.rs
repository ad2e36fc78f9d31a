//! Stabilised conforming nodal integration that sees how the gradient varies inside a nodal cell.
//!
//! The mean gradient over a cell cannot see deformations that alternate from node to node: on a lattice the symbol of
//! SCNI (and of DNI) vanishes at (π, 0), (0, π) and (π, π), and what holds such modes is the boundary alone. Here every
//! nodal cell L is cut into the triangles K between its node and its edges, and the variation of the triangles' mean
//! gradients about the cell's is given energy:
//!
//! - [`scni_stabilised`]: `E = Σ_L V_L W(F_L) + ½ α μ₀ Σ_L Σ_{K⊂L} A_K ‖F_K − F_L‖²`. The second sum is quadratic in the
//!   coefficients and the same for every component of the displacement, so it is one constant scalar matrix: assembly
//!   costs what SCNI costs. ‖QF‖ = ‖F‖ for every rotation Q, so it is frame-indifferent; it vanishes for linear fields, so
//!   patch tests stay what they are. The stabilising modulus is the shear modulus at rest, which does not grow when a
//!   tissue is nearly incompressible (after Puso, Chen, Zywicz & Elmer, Int. J. Numer. Meth. Eng. 74, 2008).
//! - [`modified_scni`]: `E = Σ_K A_K W(F_K)`, modified SCNI with the full law (Chen, Hu, Puso, Wu & Zhang, LNCSE 57, 2006).
//!   It follows the law's own loss of stiffness, at the cost of the law evaluated in every triangle.

use super::integration::GAUSS_2;
use crate::discretization::approximation::shape_functions::Wanted;
use crate::discretization::cells::nodal_cells::{Across, NodalCell};
use crate::discretization::{Quadrature, ShapeError, ShapeFunctions, Stencil};
use crate::geometry::{Point, Point2, cross};

/// Weight α of the stabilisation: with 1 the least share of its energy that any lattice wave keeps is 0.37 (see the
/// Bloch symbols), with 0.3 it is 0.12: where the cell's own energy vanishes the weight enters linearly, and a script that
/// shares no code with this crate finds 0.395 and 0.118 for support 1.49, 0.373 and 0.117 for support 2.
pub const STABILISATION: f64 = 1.0;
/// Triangles below this share of their cell's area have none: the node lies on that edge.
const DEGENERATE: f64 = 1e-12;
/// Nor have those whose area is not this many times what rounding leaves of it: far from the origin corners that are one,
/// of four cells that meet, lie apart by rounding, and what is between them has gradients of any size.
const ROUNDED: f64 = 1e4;
/// Ends of an edge that differ by less than this, over the support's half-width, are the same: two cells compute them each.
const SAME_END: f64 = 1e-12;
/// Nor do they where it is by so many roundings of their coordinates.
const ROUNDINGS: f64 = 16.0;

/// SCNI with the constant stabilisation of weight `alpha`; see the module documentation.
///
/// # Errors
/// [`ShapeError`] names the node in whose cell the moment matrix fails.
pub fn scni_stabilised(
    shape: &ShapeFunctions<'_, 2>,
    cells: &[NodalCell],
    alpha: f64,
) -> Result<Quadrature<2>, ShapeError> {
    let mut rule = Quadrature::default();
    let mut subcells = Subcells::new(shape);
    let mut matrix = Vec::new();
    for (node, cell) in cells.iter().enumerate() {
        subcells.compute(node, cell)?;
        let n = subcells.nodes.len();
        matrix.clear();
        matrix.resize(n * (n + 1) / 2, 0.0);
        for (area, gradients) in subcells.triangles() {
            let variation: Vec<Point<2>> = gradients.iter().zip(&subcells.mean).map(|(k, l)| k - l).collect();
            let mut next = matrix.iter_mut();
            for (column, gj) in variation.iter().enumerate() {
                for (gi, b) in variation[column..].iter().zip(&mut next) {
                    *b += alpha * area * gi.dot(gj);
                }
            }
        }
        rule.push_stabilised((cell.area, node), &subcells.nodes, &subcells.mean, &matrix);
    }
    Ok(rule)
}

/// Modified SCNI: the law in every node–edge triangle of the nodal cells.
///
/// # Errors
/// [`ShapeError`] names the node in whose cell the moment matrix fails.
pub fn modified_scni(shape: &ShapeFunctions<'_, 2>, cells: &[NodalCell]) -> Result<Quadrature<2>, ShapeError> {
    let mut rule = Quadrature::default();
    let mut subcells = Subcells::new(shape);
    for (node, cell) in cells.iter().enumerate() {
        subcells.compute(node, cell)?;
        // A cell that its node does not see all of (at a notch) has triangles that overlap; its mean serves there.
        if subcells.areas.is_empty() || subcells.areas.iter().any(|a| *a < -subcells.no_area) {
            rule.push(cell.area, node, &subcells.nodes, &subcells.mean);
            continue;
        }
        subcells.make_consistent();
        for (area, gradients) in subcells.triangles() {
            rule.push(area, node, &subcells.nodes, gradients);
        }
    }
    Ok(rule)
}

/// Mean gradients over one cell after another and over its node–edge triangles, from their boundaries:
/// `(1/A) ∮ Ψ_I n dΓ`. Edges and spokes (from the node to the corners) are integrated once each, so that the triangles'
/// gradients average to the cell's to rounding.
struct Subcells<'a, 'c> {
    shape: &'a ShapeFunctions<'c, 2>,
    /// Nodes whose gradients do not all vanish, ascending.
    nodes: Vec<u32>,
    /// Mean gradients over the cell.
    mean: Vec<Point<2>>,
    /// Signed areas of the triangles.
    areas: Vec<f64>,
    /// Triangles of no larger area are degenerate.
    no_area: f64,
    /// Mean gradients over the triangles, one row of `nodes.len()` after the other.
    gradients: Vec<Point<2>>,
    candidates: Vec<u32>,
    stencil: Stencil<2>,
    /// By node, the edges of its cell that cells before it have integrated already.
    shared: Vec<Vec<SharedEdge>>,
}

/// An edge between two cells, as the second of them goes along it.
struct SharedEdge {
    from: Point2,
    to: Point2,
    /// Nodes whose shape functions do not all vanish along it, ascending, with the means.
    means: Vec<(u32, f64)>,
}

impl<'a, 'c> Subcells<'a, 'c> {
    fn new(shape: &'a ShapeFunctions<'c, 2>) -> Self {
        Self {
            shape,
            nodes: Vec::new(),
            mean: Vec::new(),
            areas: Vec::new(),
            no_area: 0.0,
            gradients: Vec::new(),
            candidates: Vec::new(),
            stencil: Stencil::default(),
            shared: (0..shape.cloud().len()).map(|_| Vec::new()).collect(),
        }
    }

    /// Triangles that are not degenerate: area and gradients. Areas of triangles that the cell's shape turns over count
    /// as positive: what is summed over them is an energy.
    fn triangles(&self) -> impl Iterator<Item = (f64, &[Point<2>])> {
        self.areas
            .iter()
            .map(|a| a.abs())
            // A cell that is empty has neither triangles nor nodes.
            .zip(self.gradients.chunks_exact(self.nodes.len().max(1)))
            .filter(|(area, _)| *area > self.no_area)
    }

    /// The next cell: nodes are taken in ascending order, each once, so that an edge between two of them is integrated once.
    fn compute(&mut self, node: usize, cell: &NodalCell) -> Result<(), ShapeError> {
        let x = self.shape.cloud().positions()[node];
        let corners: Vec<Point2> = cell.boundary.iter().map(|c| c.0).collect();
        let (low, high) = corners.iter().fold((x, x), |(low, high), c| (low.inf(c), high.sup(c)));
        self.shape.cloud().covering(&low, &high, &mut self.candidates);
        let n = corners.len();
        // A cell that its node does not see all of has no triangles: the mean gradient serves in all of it.
        let seen = corners.iter().all(|corner| self.shape.cloud().sees(corner, node as u32));
        let known = std::mem::take(&mut self.shared[node]);
        let edges = (0..n)
            .map(|k| self.edge(node, &known, [corners[k], corners[(k + 1) % n]], cell.boundary[k].1))
            .collect::<Result<Vec<_>, _>>()?;
        let spokes = match seen {
            true => (0..n).map(|k| self.mean_values(node, x, corners[k])).collect::<Result<Vec<_>, _>>()?,
            false => Vec::new(),
        };
        let used: Vec<usize> = (0..self.candidates.len())
            .filter(|&i| spokes.iter().chain(&edges).any(|values| values[i] != 0.0))
            .collect();
        self.nodes.clear();
        self.nodes.extend(used.iter().map(|&i| self.candidates[i]));
        self.mean.clear();
        self.mean.resize(used.len(), Point::zeros());
        self.areas.clear();
        self.gradients.clear();
        for k in 0..n {
            let (a, b) = (corners[k], corners[(k + 1) % n]);
            let area = 0.5 * cross(a - x, b - x);
            for (place, &i) in used.iter().enumerate() {
                let across = normal(a, b) * edges[k][i];
                self.mean[place] += across / cell.area;
                if !seen {
                    continue;
                }
                let around = across + normal(x, a) * spokes[k][i] + normal(b, x) * spokes[(k + 1) % n][i];
                self.gradients.push(if area == 0.0 { Point::zeros() } else { around / area });
            }
            self.areas.extend(seen.then_some(area));
        }
        let total: f64 = self.areas.iter().map(|a| a.abs()).sum();
        let rounding = f64::EPSILON * low.amax().max(high.amax()) * (high - low).norm();
        self.no_area = (DEGENERATE * total).max(ROUNDED * rounding);
        Ok(())
    }

    /// Shifts the triangles' gradients so that they average to the cell's: on an edge through the node, which has no
    /// triangle, the Gauss points of the whole edge and of the two spokes along it differ.
    fn make_consistent(&mut self) {
        let n = self.nodes.len();
        let mut missing = self.mean.clone();
        let total: f64 = self.triangles().map(|(area, _)| area).sum();
        for (area, gradients) in self.triangles() {
            for (m, g) in missing.iter_mut().zip(gradients) {
                *m -= g * (area / total);
            }
        }
        for row in self.gradients.chunks_exact_mut(n) {
            for (g, m) in row.iter_mut().zip(&missing) {
                *g += m;
            }
        }
    }

    /// Means of the candidates' shape functions along an edge of a node's cell.
    fn edge(
        &mut self,
        node: usize,
        known: &[SharedEdge],
        [a, b]: [Point2; 2],
        across: Across,
    ) -> Result<Vec<f64>, ShapeError> {
        if across == Across::Bridge {
            return Ok(vec![0.0; self.candidates.len()]);
        }
        let rounding = f64::EPSILON * a.amax().max(b.amax());
        let same = (SAME_END * self.shape.cloud().half_widths()[node]).max(ROUNDINGS * rounding);
        if let Some(edge) = known.iter().find(|e| (e.from - a).amax() <= same && (e.to - b).amax() <= same) {
            let mut means = edge.means.iter().peekable();
            let mean = |i: &u32| means.next_if(|(node, _)| node == i).map_or(0.0, |(_, mean)| *mean);
            return Ok(self.candidates.iter().map(mean).collect());
        }
        let values = self.mean_values(node, a, b)?;
        if let Across::Cell(other) = across
            && other as usize > node
        {
            let means = self.candidates.iter().copied().zip(values.iter().copied()).filter(|(_, mean)| *mean != 0.0);
            self.shared[other as usize].push(SharedEdge { from: b, to: a, means: means.collect() });
        }
        Ok(values)
    }

    /// Means of the candidates' shape functions along a segment; `node` is the one that an error names.
    fn mean_values(&mut self, node: usize, a: Point2, b: Point2) -> Result<Vec<f64>, ShapeError> {
        let mut values = vec![0.0; self.candidates.len()];
        if a == b {
            return Ok(values);
        }
        for (s, weight) in GAUSS_2 {
            let x = a + (b - a) * s;
            self.shape.evaluate(&x, node, &self.candidates, Wanted::VALUES, &mut self.stencil)?;
            let mut at = 0;
            for (i, value) in self.stencil.nodes.iter().zip(&self.stencil.values) {
                while self.candidates[at] != *i {
                    at += 1;
                }
                values[at] += weight * value;
            }
        }
        Ok(values)
    }
}

/// Outward normal of the edge from `a` to `b` of a loop that runs counter-clockwise, times its length.
fn normal(a: Point2, b: Point2) -> Point2 {
    Point2::new(b.y - a.y, a.x - b.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Basis, NodeCloud};

    /// A node that others leave nothing of the body has a cell without corners: it takes no part in either rule, and the others are
    /// what they were.
    #[test]
    fn a_cell_without_any_part_of_the_body_takes_no_part() {
        let lattice = (0..9).map(|n| Point2::new(f64::from(n % 3), f64::from(n / 3)));
        let positions: Vec<Point2> = lattice.chain([Point2::new(1.3, 1.2)]).collect();
        let square = |x: &Point2| NodalCell {
            boundary: [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
                .map(|corner| (x + Point2::from(corner), Across::Outline(u32::MAX)))
                .to_vec(),
            area: 1.0,
        };
        let mut cells: Vec<NodalCell> = positions[..9].iter().map(square).collect();
        let cloud = NodeCloud::new(positions, vec![2.6; 10]);
        let shape = ShapeFunctions::new(&cloud, Basis::Linear);
        let rules = |cells: &[NodalCell]| {
            [scni_stabilised(&shape, cells, STABILISATION).unwrap(), modified_scni(&shape, cells).unwrap()]
        };
        let without = rules(&cells);
        cells.push(NodalCell { boundary: Vec::new(), area: 0.0 });
        for (with, without) in rules(&cells).iter().zip(&without) {
            assert_eq!(with.len(), without.len() + 1);
            for (point, same) in with.points().zip(without.points()) {
                assert_eq!((point.cell, point.weight, point.nodes), (same.cell, same.weight, same.nodes));
            }
            let last = with.point(without.len());
            assert!(last.cell == 9 && last.weight == 0.0 && last.nodes.is_empty());
        }
    }
}
