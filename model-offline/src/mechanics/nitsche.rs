//! Nitsche's method: displacements imposed weakly on the boundary, with consistent terms (Nitsche 1971; for meshfree
//! methods Fernández-Méndez & Huerta 2004).
//!
//! Adds to the energy `∮ [ −(P N)·(u − g) + β/2 |u − g|² ] dΓ`, with P from the gradient of the adjoining cell, so that for
//! SCNI the boundary term is the very integral that the cell's gradient was averaged with and the linear patch test holds
//! to rounding. The tangent is whole, its term with ∂²P/∂F² (u − g) too: laws answer no third derivatives of their energy,
//! so that this one is a central difference of their tangents.
//!
//! β follows the law: where the tissue has grown stiffer than at rest, the penalty that keeps the boundary terms stable must
//! too. It is fixed while Newton's method runs, and taken anew before every increment.

use super::constraints::WeaklyImposed;
use super::tissue::Tissue;
use crate::discretization::Planar;
use crate::discretization::boundary::BoundaryPoint;
use crate::geometry::Point;
use crate::linalg::Pattern;
use crate::material::{Material, Matrix, Tensor4};
use std::sync::Arc;

/// Penalty β over (stiffness / cell size).
const PENALTY: f64 = 40.0;
/// Growth of the stiffness from which on β is taken anew.
const STIFFER: f64 = 1.1;
/// Step of the central differences of tangents.
const STEP: f64 = 1e-4;

/// Boundary points whose displacement is imposed weakly.
#[derive(Debug, Clone, Default)]
pub struct Nitsche {
    points: Vec<WeakPoint>,
}

#[derive(Debug, Clone)]
struct WeakPoint {
    weight: f64,
    normal: Point<2>,
    cell: u32,
    beta: f64,
    /// Size of the cell.
    size: f64,
    /// Union of the nodes of the shape functions and of the cell's gradient, ascending.
    nodes: Vec<u32>,
    values: Vec<f64>,
    gradients: Vec<Point<2>>,
}

impl Nitsche {
    /// Holds the given points of a body.
    pub fn new(planar: &Planar, tissue: &Tissue, points: impl IntoIterator<Item = BoundaryPoint>) -> Self {
        let rows = planar.cell_gradients();
        let points = points
            .into_iter()
            .map(|p| {
                let (cell_nodes, cell_gradients) = &rows[p.cell as usize];
                let mut nodes: Vec<u32> = cell_nodes.iter().chain(&p.stencil.nodes).copied().collect();
                nodes.sort_unstable();
                nodes.dedup();
                let pick = |list: &[u32], i: u32| list.binary_search(&i).ok();
                let values = nodes.iter().map(|&i| pick(&p.stencil.nodes, i).map_or(0.0, |k| p.stencil.values[k]));
                let gradients =
                    nodes.iter().map(|&i| pick(cell_nodes, i).map_or_else(Point::zeros, |k| cell_gradients[k]));
                let size = planar.cells()[p.cell as usize].area.sqrt();
                WeakPoint {
                    weight: p.weight,
                    normal: p.normal,
                    cell: p.cell,
                    beta: PENALTY * stiffness(tissue, p.cell, &Matrix::zeros()) / size,
                    size,
                    values: values.collect(),
                    gradients: gradients.collect(),
                    nodes,
                }
            })
            .collect();
        Self { points }
    }
}

/// The largest A_ijij of a cell's tissue.
fn stiffness(tissue: &Tissue, cell: u32, h: &Matrix<2>) -> f64 {
    let largest =
        |a: &Tensor4<2>| [a[0][0][0][0], a[0][1][0][1], a[1][0][1][0], a[1][1][1][1]].into_iter().fold(0.0, f64::max);
    tissue.parts(cell).map(|(material, factor)| factor * largest(&material.tangent(h))).sum()
}

impl WeaklyImposed for Nitsche {
    fn adapted(&self, tissue: &Tissue, d: &[f64]) -> Option<Arc<dyn WeaklyImposed>> {
        let beta = |p: &WeakPoint| PENALTY * stiffness(tissue, p.cell, &p.kinematics(d, &[0.0, 0.0]).0) / p.size;
        let now: Vec<f64> = self.points.iter().map(beta).collect();
        if !self.points.iter().zip(&now).any(|(p, now)| *now > STIFFER * p.beta) {
            return None;
        }
        let mut adapted = self.clone();
        adapted.points.iter_mut().zip(now).for_each(|(p, now)| p.beta = p.beta.max(now));
        Some(Arc::new(adapted))
    }

    fn prescribed(&self) -> usize {
        2 * self.points.len()
    }

    fn node_lists(&self) -> Vec<&[u32]> {
        self.points.iter().map(|p| p.nodes.as_slice()).collect()
    }

    fn add_force(&self, tissue: &Tissue, d: &[f64], prescribed: &[f64], force: &mut [f64]) -> f64 {
        let mut energy = 0.0;
        for (p, g) in self.points.iter().zip(prescribed.chunks_exact(2)) {
            let (h, gap) = p.kinematics(d, g);
            let traction = p.stress(tissue, &h) * p.normal;
            energy += p.weight * (0.5 * p.beta * gap.norm_squared() - traction.dot(&gap));
            let pull = (gap * p.beta - traction) * p.weight;
            // (A : δF N)·gap = δF : T with T_kl = gap_i A_ijkl N_j.
            let t = p.adjoint(tissue, &h, &gap);
            for ((&i, value), gradient) in p.nodes.iter().zip(&p.values).zip(&p.gradients) {
                let f = pull * *value - t * gradient * p.weight;
                force[2 * i as usize] += f.x;
                force[2 * i as usize + 1] += f.y;
            }
        }
        energy
    }

    fn add_response(&self, tissue: &Tissue, d: &[f64], rates: &[f64], out: &mut [f64]) {
        for (p, rate) in self.points.iter().zip(rates.chunks_exact(2)) {
            let (h, _) = p.kinematics(d, &[0.0, 0.0]);
            let rate = Point::<2>::new(rate[0], rate[1]);
            let t = p.adjoint(tissue, &h, &rate);
            for ((&i, value), gradient) in p.nodes.iter().zip(&p.values).zip(&p.gradients) {
                let f = (rate * (p.beta * value) - t * gradient) * p.weight;
                out[2 * i as usize] += f.x;
                out[2 * i as usize + 1] += f.y;
            }
        }
    }

    fn add_tangent(&self, tissue: &Tissue, (d, prescribed): (&[f64], &[f64]), pattern: &Pattern, values: &mut [f64]) {
        for (p, g) in self.points.iter().zip(prescribed.chunks_exact(2)) {
            let (h, gap) = p.kinematics(d, g);
            let a = p.tangent(tissue, &h);
            let curvature = p.curvature(tissue, &h, &gap);
            // c_I[i][k] = A_ijkl N_j g_I,l.
            let coupling: Vec<Matrix<2>> = p
                .gradients
                .iter()
                .map(|g| {
                    Matrix::from_fn(|i, k| {
                        (0..2)
                            .flat_map(|j| (0..2).map(move |l| (j, l)))
                            .map(|(j, l)| a[i][j][k][l] * p.normal[j] * g[l])
                            .sum()
                    })
                })
                .collect();
            for (column, &j) in p.nodes.iter().enumerate() {
                let stride = pattern.column_length(j);
                for (row, &i) in p.nodes.iter().enumerate().skip(column) {
                    let block = (Matrix::identity() * (p.beta * p.values[row] * p.values[column])
                        - coupling[column] * p.values[row]
                        - coupling[row].transpose() * p.values[column]
                        - contracted(&curvature, &p.gradients[row], &p.gradients[column]))
                        * p.weight;
                    let at = pattern.block_position(i, j).expect("the pattern covers the imposed points");
                    for k in 0..2 {
                        for r in 0..2 {
                            values[at + k * stride + r] += block[(r, k)];
                        }
                    }
                }
            }
        }
    }
}

/// B_km = g_l S_klmn g'_n.
fn contracted(s: &Tensor4<2>, row: &Point<2>, column: &Point<2>) -> Matrix<2> {
    Matrix::from_fn(|k, m| {
        (0..2).flat_map(|l| (0..2).map(move |n| (l, n))).map(|(l, n)| row[l] * s[k][l][m][n] * column[n]).sum()
    })
}

impl WeakPoint {
    /// Displacement gradient of the cell, and u − g.
    fn kinematics(&self, d: &[f64], g: &[f64]) -> (Matrix<2>, Point<2>) {
        let mut h = Matrix::zeros();
        let mut gap = Point::<2>::new(-g[0], -g[1]);
        for ((&i, value), gradient) in self.nodes.iter().zip(&self.values).zip(&self.gradients) {
            let d = Point::<2>::new(d[2 * i as usize], d[2 * i as usize + 1]);
            h += d * gradient.transpose();
            gap += d * *value;
        }
        (h, gap)
    }

    fn stress(&self, tissue: &Tissue, h: &Matrix<2>) -> Matrix<2> {
        tissue.parts(self.cell).fold(Matrix::zeros(), |sum, (m, factor)| sum + m.respond(h).pk1_stress * factor)
    }

    fn tangent(&self, tissue: &Tissue, h: &Matrix<2>) -> Tensor4<2> {
        let mut a: Tensor4<2> = Default::default();
        for (material, factor) in tissue.parts(self.cell) {
            let part = material.tangent(h);
            for (sum, row) in a.iter_mut().flatten().flatten().flatten().zip(part.iter().flatten().flatten().flatten())
            {
                *sum += factor * row;
            }
        }
        a
    }

    /// ∂T_kl/∂F_mn of the adjoint T of the gap: the third derivative of the energy, as a central difference.
    fn curvature(&self, tissue: &Tissue, h: &Matrix<2>, gap: &Point<2>) -> Tensor4<2> {
        let mut slope: Tensor4<2> = Default::default();
        if tissue.is_linear() || gap.norm() == 0.0 {
            return slope;
        }
        for (m, n) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let at = |step: f64| {
                let mut h = *h;
                h[(m, n)] += step;
                self.adjoint(tissue, &h, gap)
            };
            let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            for (k, l) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                // Third derivatives do not depend on their order: the differences, which do by rounding, are averaged.
                slope[k][l][m][n] += 0.5 * difference[(k, l)];
                slope[m][n][k][l] += 0.5 * difference[(k, l)];
            }
        }
        slope
    }

    /// T_kl = v_i A_ijkl N_j.
    fn adjoint(&self, tissue: &Tissue, h: &Matrix<2>, v: &Point<2>) -> Matrix<2> {
        let a = self.tangent(tissue, h);
        Matrix::from_fn(|k, l| {
            (0..2).flat_map(|i| (0..2).map(move |j| (i, j))).map(|(i, j)| v[i] * a[i][j][k][l] * self.normal[j]).sum()
        })
    }
}
