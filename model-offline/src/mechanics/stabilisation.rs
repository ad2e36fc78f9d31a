//! The constant stabilisation of an integration rule: energy `½ Σ_q μ₀(cell) Σ_IJ B_IJ(q) d_I·d_J`, with the packed
//! matrices B of the [rule](crate::discretization::Quadrature) and the shear modulus at rest μ₀ of the cell's tissue.

use super::blocks::BlockPositions;
use super::tissue::Tissue;
use crate::discretization::Quadrature;
use crate::linalg::Pattern;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The stabilisation of a tissue, summed over all points once: it does not depend on the state, and couples equal
/// components alone, so that a number per pair of nodes is all of it.
#[derive(Debug, Clone)]
pub struct Stabilisation {
    pattern: Arc<Pattern>,
    /// A number per block of the pattern; empty where the rule has no stabilisation.
    weights: Vec<f64>,
}

impl Stabilisation {
    /// That of a rule on a tissue; `blocks` are the rule's in the pattern.
    pub fn new<const D: usize>(
        rule: &Quadrature<D>,
        tissue: &Tissue,
        blocks: &BlockPositions,
        pattern: &Arc<Pattern>,
    ) -> Self {
        let mut weights = Vec::new();
        if rule.points().any(|point| !point.stabilisation.is_empty()) {
            weights.resize(pattern.stored_blocks(), 0.0);
        }
        let mut positions = blocks.in_order();
        for point in rule.points() {
            let shear = if point.stabilisation.is_empty() { 0.0 } else { tissue.rest_shear_modulus(point.cell) };
            let mut packed = point.stabilisation.iter();
            for (column, &j) in point.nodes.iter().enumerate() {
                for at in positions.by_ref().take(point.nodes.len() - column) {
                    if let Some(b) = packed.next() {
                        weights[pattern.block_at(j, at)] += shear * b;
                    }
                }
            }
        }
        Self { pattern: Arc::clone(pattern), weights }
    }

    /// Whether the rule has any.
    pub(super) fn acts(&self) -> bool {
        !self.weights.is_empty()
    }

    /// Adds so many times another one of the same pattern.
    pub(super) fn add_scaled(&mut self, other: &Self, factor: f64) {
        self.weights.resize(self.weights.len().max(other.weights.len()), 0.0);
        self.weights.iter_mut().zip(&other.weights).for_each(|(sum, weight)| *sum += factor * weight);
    }

    /// Adds its force; returns its energy.
    pub(super) fn add_force<const D: usize>(&self, coefficients: &[f64], force: &mut [f64]) -> f64 {
        if self.weights.is_empty() {
            return 0.0;
        }
        0.5 * self.pattern.add_scalar_product::<D>(&self.weights, coefficients, force)
    }

    /// Adds its tangent, laid out by its pattern.
    pub(super) fn add_tangent(&self, values: &mut [f64]) {
        if !self.weights.is_empty() {
            self.pattern.add_scalar_blocks(&self.weights, values);
        }
    }

    /// Between some columns of coefficients, `S_mn = c_mᵀ S c_n`: what is left of it in a reduced basis, exactly.
    pub fn project<const D: usize>(&self, columns: &[&[f64]]) -> DMatrix<f64> {
        let mut projected = DMatrix::zeros(columns.len(), columns.len());
        for (n, column) in columns.iter().enumerate() {
            let mut force = vec![0.0; column.len()];
            self.add_force::<D>(column, &mut force);
            let force = DVector::from_vec(force);
            for (m, other) in columns.iter().enumerate() {
                projected[(m, n)] = force.dot(&nalgebra::DVectorView::from_slice(other, other.len()));
            }
        }
        projected
    }
}
