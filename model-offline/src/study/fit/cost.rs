//! What a model costs, counted and not timed: the same number on every machine, under every load.
//!
//! Operations are weighed by the time they took on one core (Xeon, 2.x GHz, AVX-512), on 386 to 5,741 nodes by SCNI with
//! supports 1.49 and 2.0 and by quadratic triangles; the sum was within a third of the time there. Only ratios matter.

use crate::discretization::{Basis, Integration};
use crate::model::TissueModel;
use crate::model::space::SpaceModel;

/// Seconds per shape function evaluated with its moment matrix, linear basis; the quadratic one has four times as many
/// entries in that matrix.
const PER_SHAPE_FUNCTION: f64 = 60e-9;
const QUADRATIC: f64 = 4.0;
/// Seconds per node of triangles.
const PER_ELEMENT_NODE: f64 = 1.1e-6;
/// Seconds per floating-point operation of a factorisation, and per entry of the factor: storing it, three rounds of
/// back-substitution, its share of the ordering.
const PER_FLOP: f64 = 0.025e-9;
const PER_ENTRY: f64 = 12e-9;
const PER_ENTRY_ORDERED: f64 = 6e-9;

/// Cost of nodes, shape functions and all paddles' Jacobians, in seconds of one core of the kind that it was calibrated on.
pub(super) fn cost(model: &TissueModel) -> f64 {
    let factor = model.analysis().symbolic();
    // Paddles on nodes of their own are attached to one factor, others have one each.
    let factors = if model.attaches_to_one_factor() { 1.0 } else { model.scene().paddles.len() as f64 };
    let entries = factor.entries();
    shape_functions(model) + PER_ENTRY_ORDERED * entries + factors * (PER_FLOP * factor.flops() + PER_ENTRY * entries)
}

fn shape_functions(model: &TissueModel) -> f64 {
    let method = model.planar().method();
    let nodes = model.nodes() as f64;
    // Points per node at which shape functions are evaluated.
    let points = match method.integration {
        _ if method.integration.is_element() => return PER_ELEMENT_NODE * nodes,
        Integration::Dni => 1.0,
        Integration::Scni => 8.0,
        Integration::ScniStabilised | Integration::Mscni => 12.0,
        Integration::Nsni => 11.0,
        _ => 15.0,
    };
    let neighbours = (2.0 * method.support).powi(2);
    let basis = if method.basis == Basis::Quadratic { QUADRATIC } else { 1.0 };
    PER_SHAPE_FUNCTION * points * neighbours * basis * nodes
}

/// Seconds per node of tetrahedra, their middle nodes among them.
const PER_TETRAHEDRON_NODE: f64 = 12e-6;
/// Points per node of a nodal rule in space, and what its basis costs: 4 by 4 moment matrices in place of 3 by 3.
const POINTS_IN_SPACE: f64 = 24.0;
const BASIS_IN_SPACE: f64 = 2.0;

/// The same in space: one factorisation, from which all paddles and pairs are condensed. Within a factor of 1.6 of the
/// time on five bodies of 1,413 to 25,331 nodes of quadratic tetrahedra.
pub(super) fn cost_in_space(model: &SpaceModel) -> f64 {
    let condensing = model.condensing_analysis();
    let factor = condensing.analysis.symbolic();
    let entries = factor.entries();
    let method = model.spatial().method();
    let nodes = model.nodes() as f64;
    let shapes = match method.integration.is_element() {
        true => PER_TETRAHEDRON_NODE * nodes,
        false => PER_SHAPE_FUNCTION * BASIS_IN_SPACE * POINTS_IN_SPACE * (2.0 * method.support).powi(3) * nodes,
    };
    let rows = |paddle: usize| 3.0 * model.paddle_nodes(paddle).len() as f64;
    let scene = model.scene();
    let singles: Vec<f64> = (0..scene.paddles.len()).map(rows).collect();
    // Dense factors of what is attached.
    let dense = singles.iter().copied().chain(scene.pairs.iter().map(|[a, b]| singles[*a] + singles[*b]));
    let flops = factor.flops() + dense.map(|rows| rows.powi(3) / 3.0).sum::<f64>();
    shapes + (PER_ENTRY_ORDERED + PER_ENTRY) * entries + PER_FLOP * flops
}
