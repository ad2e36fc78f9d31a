//! The constant stabilisation of an integration rule: energy `½ Σ_q μ₀(cell) Σ_IJ B_IJ(q) d_I·d_J`, with the packed
//! matrices B of the [rule](crate::discretization::Quadrature) and the shear modulus at rest μ₀ of the cell's tissue.

use super::tissue::Tissue;
use crate::discretization::Quadrature;
use nalgebra::{DMatrix, DVector};

/// Adds the force `μ₀ B d` of one point, component by component; returns its energy `½ μ₀ dᵀ B d`.
pub(super) fn add_force<const D: usize>(
    nodes: &[u32],
    matrix: &[f64],
    shear: f64,
    coefficients: &[f64],
    force: &mut [f64],
) -> f64 {
    let (mut energy, mut next) = (0.0, 0);
    for (column, &j) in nodes.iter().enumerate() {
        for &i in &nodes[column..] {
            let (i, j, b) = (i as usize * D, j as usize * D, shear * matrix[next]);
            next += 1;
            for k in 0..D {
                let (di, dj) = (coefficients[i + k], coefficients[j + k]);
                force[i + k] += b * dj;
                if i == j {
                    energy += 0.5 * b * di * dj;
                } else {
                    force[j + k] += b * di;
                    energy += b * di * dj;
                }
            }
        }
    }
    energy
}

/// The stabilisation between some columns of coefficients, `S_mn = c_mᵀ (μ₀ B) c_n`: what is left of it in a reduced
/// basis, exactly, because it does not depend on the state.
pub fn project<const D: usize>(rule: &Quadrature<D>, tissue: &Tissue, columns: &[&[f64]]) -> DMatrix<f64> {
    let mut projected = DMatrix::zeros(columns.len(), columns.len());
    for (n, column) in columns.iter().enumerate() {
        let mut force = vec![0.0; column.len()];
        for point in rule.points().filter(|p| !p.stabilisation.is_empty()) {
            let shear = tissue.rest_shear_modulus(point.cell);
            add_force::<D>(point.nodes, point.stabilisation, shear, column, &mut force);
        }
        let force = DVector::from_vec(force);
        for (m, other) in columns.iter().enumerate() {
            projected[(m, n)] = force.dot(&nalgebra::DVectorView::from_slice(other, other.len()));
        }
    }
    projected
}
