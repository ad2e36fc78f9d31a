//! Essential boundary conditions: nodal values prescribed exactly, or weakly by terms of the energy.

use super::tissue::Tissue;
use crate::discretization::Stencil;
use crate::linalg::Pattern;
use std::sync::Arc;

/// Rows Λ_b of the constrained nodes: `u(X_b) = Σ_I Ψ_I(X_b) d_I`.
#[derive(Debug, Clone, Default)]
pub struct ConstrainedRows {
    offsets: Vec<u32>,
    nodes: Vec<u32>,
    values: Vec<f64>,
}

impl ConstrainedRows {
    /// One row per stencil.
    pub fn new<'a, const D: usize>(stencils: impl Iterator<Item = &'a Stencil<D>>) -> Self {
        let mut rows = Self { offsets: vec![0], ..Self::default() };
        for stencil in stencils {
            rows.nodes.extend_from_slice(&stencil.nodes);
            rows.values.extend_from_slice(&stencil.values);
            rows.offsets.push(rows.nodes.len() as u32);
        }
        rows
    }

    /// Number of constrained nodes.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Whether nothing is constrained.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether every row is one unknown to rounding, and no sum of several.
    pub(crate) fn are_unknowns(&self) -> bool {
        (0..self.len()).all(|b| self.row(b).1.iter().filter(|value| value.abs() > 1e-12).count() == 1)
    }

    pub(crate) fn row(&self, b: usize) -> (&[u32], &[f64]) {
        let range = self.offsets[b] as usize..self.offsets[b + 1] as usize;
        (&self.nodes[range.clone()], &self.values[range])
    }

    /// The node lists of the rows, for the sparsity pattern.
    pub fn node_lists(&self) -> impl Iterator<Item = &[u32]> + Clone {
        (0..self.len()).map(|b| self.row(b).0)
    }

    /// Adds `stiffness Λᵀ Λ` to a matrix: springs between what every row interpolates and its place.
    ///
    /// # Panics
    /// When the pattern misses a pair of a row's nodes.
    pub(crate) fn add_springs<const D: usize>(&self, pattern: &Pattern, stiffness: f64, matrix: &mut [f64]) {
        for b in 0..self.len() {
            let (nodes, values) = self.row(b);
            for (column, &j) in nodes.iter().enumerate() {
                let stride = pattern.column_length(j);
                for (&i, value) in nodes[column..].iter().zip(&values[column..]) {
                    let at = pattern.block_position(i, j).expect("the pattern covers the rows");
                    for k in 0..D {
                        matrix[at + k * stride + k] += stiffness * value * values[column];
                    }
                }
            }
        }
    }

    /// `out = Λ d`, D numbers per row.
    pub fn apply<const D: usize>(&self, d: &[f64], out: &mut [f64]) {
        for (b, out) in out.chunks_exact_mut(D).enumerate() {
            let (nodes, values) = self.row(b);
            out.fill(0.0);
            for (&i, value) in nodes.iter().zip(values) {
                for (o, x) in out.iter_mut().zip(&d[i as usize * D..]) {
                    *o += value * x;
                }
            }
        }
    }

    /// `out += Λᵀ y`.
    pub fn add_transpose<const D: usize>(&self, y: &[f64], out: &mut [f64]) {
        for (b, y) in y.chunks_exact(D).enumerate() {
            let (nodes, values) = self.row(b);
            for (&i, value) in nodes.iter().zip(values) {
                for (o, x) in out[i as usize * D..].iter_mut().zip(y) {
                    *o += value * x;
                }
            }
        }
    }
}

/// Displacements that are imposed weakly, by terms of the energy instead of constraints (Nitsche's method).
pub trait WeaklyImposed: std::fmt::Debug + Send + Sync {
    /// How many numbers are prescribed.
    fn prescribed(&self) -> usize;
    /// Nodes that interact, list by list, each ascending.
    fn node_lists(&self) -> Vec<&[u32]>;
    /// Adds energy and its gradient at coefficients `d`, for the prescribed numbers.
    fn add_force(&self, tissue: &Tissue, d: &[f64], prescribed: &[f64], force: &mut [f64]) -> f64;
    /// Adds the second derivative at coefficients and prescribed numbers.
    fn add_tangent(&self, tissue: &Tissue, at: (&[f64], &[f64]), pattern: &Pattern, values: &mut [f64]);
    /// The same with what keeps it stable suited to coefficients `d`; none where that is so already.
    fn adapted(&self, tissue: &Tissue, d: &[f64]) -> Option<Arc<dyn WeaklyImposed>>;
    /// Adds the force that unit rates of the prescribed numbers cause: −∂(force)/∂(prescribed) · rates.
    fn add_response(&self, tissue: &Tissue, d: &[f64], rates: &[f64], out: &mut [f64]);
}

/// Everything that is prescribed on a body: nodal values, boundary values imposed weakly, or both.
#[derive(Debug, Clone, Default)]
pub struct Constraints {
    /// Rows of the constrained nodes.
    pub rows: ConstrainedRows,
    /// Values that terms of the energy impose.
    pub weak: Option<Arc<dyn WeaklyImposed>>,
}

impl From<ConstrainedRows> for Constraints {
    fn from(rows: ConstrainedRows) -> Self {
        Self { rows, weak: None }
    }
}

impl From<Arc<dyn WeaklyImposed>> for Constraints {
    fn from(weak: Arc<dyn WeaklyImposed>) -> Self {
        Self { rows: ConstrainedRows::default(), weak: Some(weak) }
    }
}
