//! A state of a body, as its pictures and files show it.

use crate::material::Matrix;
use crate::mechanics::assembly::displacement_gradient;
use crate::model::TissueModel;

/// A state of a body and its needle.
#[derive(Debug, Clone, Copy)]
pub struct State<'a> {
    /// Nodal coefficients, two numbers per node.
    pub coefficients: &'a [f64],
    /// Needle depth, length.
    pub depth: f64,
    /// Whether the needle is in the tissue, and not pushing it.
    pub within: bool,
}

/// Displacement gradient of every cell: the average over its integration points.
pub(crate) fn cell_gradients(model: &TissueModel, coefficients: &[f64]) -> Vec<Matrix<2>> {
    let mut sums = vec![(Matrix::<2>::zeros(), 0.0); model.cells().len()];
    for (q, point) in model.rule().points().enumerate() {
        let (sum, weight) = &mut sums[point.cell as usize];
        *sum += displacement_gradient(model.rule(), q, coefficients) * point.weight;
        *weight += point.weight;
    }
    sums.into_iter().map(|(sum, weight)| sum / weight).collect()
}
