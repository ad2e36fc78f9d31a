//! How a body at rest is condensed to what its paddles and its target take.

use crate::discretization::{Quadrature, Stencil};
use crate::geometry::Point;
use crate::mechanics::ConstrainedRows;
use crate::solver::analysis::Analysis;

/// How a body is condensed to what paddles and target take.
#[derive(Debug)]
pub(crate) struct Condensing {
    /// Sparsity and elimination order.
    pub(crate) analysis: Analysis,
    /// Nodes that are eliminated last.
    pub(crate) retained: usize,
    /// Where displacements are sums of several unknowns: rows `u(X_b) − p_b` of the nodes of each and of its port p_b, a node
    /// more, numbered after all others. A port carries nothing but a spring to what it stands for. It keeps what has to be
    /// eliminated last to one node per displacement, where its kernels' neighbours would be three to five.
    pub(crate) ports: Option<ConstrainedRows>,
}

impl Condensing {
    /// To ports of some rows, with whatever else may be constrained.
    pub(super) fn to_ports<'r, const D: usize>(
        rule: &Quadrature<D>,
        positions: &[Point<D>],
        constrained: impl Iterator<Item = &'r [u32]> + Clone,
        rows: &[&Stencil<D>],
    ) -> Self {
        let nodes = positions.len() as u32;
        let retained: Vec<u32> = (nodes..nodes + rows.len() as u32).collect();
        let ported: Vec<Stencil<D>> = rows.iter().zip(&retained).map(|(row, &port)| row.ported(port)).collect();
        // A port lies where its row interpolates.
        let places: Vec<f64> = positions.iter().flat_map(|x| x.iter().copied()).collect();
        let positions: Vec<Point<D>> =
            positions.iter().copied().chain(rows.iter().map(|row| row.interpolate(&places))).collect();
        let lists = constrained.map(|list| -> &[u32] { list }).chain(ported.iter().map(|row| row.nodes.as_slice()));
        let analysis = Analysis::retaining(rule, &positions, lists, &retained);
        Self { analysis, retained: retained.len(), ports: Some(ConstrainedRows::new(ported.iter())) }
    }
}
