//! A body in space, discretised, and what is known of its error.

use super::rest::{SpaceResponse, rest_responses};
use crate::discretization::{Integration, TetMesh};
use crate::model::ModelError;
use crate::model::space::SpaceModel;
use crate::model::space::meshing::{MeshSize, mesh};
use crate::scene::space::SpaceScene;
use serde::Serialize;

/// Nodes of the largest model that is refined to, a minute or two and about 8 GB: nodal rules couple a few hundred neighbours,
/// elements a few dozen.
const MOST_NODES: usize = 20_000;
const MOST_ELEMENT_NODES: usize = 120_000;

/// What a refinement found out about its own error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceErrorEstimate {
    /// Estimated worst relative error of the controllability measures, of paddles and pairs.
    pub controllability: f64,
    /// The same by paddle, then by pair, in the scene's order.
    pub by_set: Vec<f64>,
    /// Estimated relative errors of the measures without axial motion, in the same order. No tolerance is kept of them: where the
    /// target hardly follows in one direction they are large.
    pub full_by_set: Vec<f64>,
    /// Estimated errors of what the target does orthogonal to the needle, length per depth: in the same order, then without paddles.
    pub per_depth_by_set: Vec<f64>,
    /// The part of `controllability` that the reference leaves open; the whole where the model is its own.
    pub reference: f64,
    /// Nodes of the reference.
    pub reference_nodes: usize,
    /// Refinement level that was accepted; of a nodal rule it may be half of one ([`MeshSize::level`]).
    pub level: f64,
}

/// A discretised scene with its responses at rest and, where it asks for a tolerance, the estimated error.
#[derive(Debug)]
pub struct Discretised {
    /// The model.
    pub model: SpaceModel,
    /// Responses of every paddle, then every pair, then without any.
    pub rest: Vec<SpaceResponse>,
    /// Estimated error.
    pub estimate: Option<SpaceErrorEstimate>,
}

/// The model of a scene at a level, as [`answering`] makes it.
pub(super) fn at_level(scene: &SpaceScene, level: i32) -> Result<(SpaceModel, Vec<SpaceResponse>), ModelError> {
    answering(scene, &mesh(scene, &MeshSize::level(level))?)
}

/// Whether the model of a mesh can be factorised within minutes.
///
/// # Errors
/// [`ModelError::TooManyNodes`].
pub fn affordable(integration: Integration, mesh: &TetMesh) -> Result<(), ModelError> {
    let limit = if integration.is_element() { MOST_ELEMENT_NODES } else { MOST_NODES };
    // A tetrahedron more brings about seven thirds of a middle node.
    let nodes = if integration == Integration::FemT10 { 7 * mesh.nodes.len() } else { mesh.nodes.len() };
    if nodes > limit { Err(ModelError::TooManyNodes { nodes, limit }) } else { Ok(()) }
}

/// A model of a mesh with its responses at rest, unless it is too large to be factorised.
pub(super) fn answering(scene: &SpaceScene, mesh: &TetMesh) -> Result<(SpaceModel, Vec<SpaceResponse>), ModelError> {
    affordable(scene.discretization.method.integration, mesh)?;
    let model = SpaceModel::on(scene, mesh)?;
    let rest = rest_responses(&model)?;
    Ok((model, rest))
}
