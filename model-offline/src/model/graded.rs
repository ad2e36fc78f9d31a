//! Models on graded nodes.

use super::{ModelError, TissueModel};
use crate::discretization::nodes::graded::{Grading, InterfaceFit, graded_nodes};
use crate::discretization::{Integration, Method, Planar};
use crate::scene::Scene;

/// More nodes than this are not tried.
const MAX_NODES: usize = 40_000;
/// A graded model at one level.
///
/// # Errors
/// [`ModelError`] as for any model.
pub fn graded_model(scene: &Scene, method: Method, level: i32) -> Result<TissueModel, ModelError> {
    let features = scene.features();
    let fit = if method.integration.is_nodal() { InterfaceFit::Between } else { InterfaceFit::On };
    let elements = matches!(method.integration, Integration::FemT6);
    let grading = Grading::level(&features, if elements { level } else { level + KERNEL_LEVELS }, fit);
    let nodes = graded_nodes(&features, &grading);
    if nodes.len() > MAX_NODES {
        return Err(ModelError::TooManyNodes { nodes: nodes.len(), limit: MAX_NODES });
    }
    let planar = Planar::new(&scene.outline, &scene.inclusion_outlines(), nodes, None, method)?;
    TissueModel::on(scene, planar, grading.finest)
}

/// Kernels and linear triangles start this many levels finer than quadratic triangles, whose nodes carry more.
const KERNEL_LEVELS: i32 = 2;
