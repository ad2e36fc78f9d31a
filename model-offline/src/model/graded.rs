//! Models on graded nodes.

use super::{ModelError, TissueModel};
use crate::discretization::nodes::graded::{Grading, InterfaceFit, graded_nodes, sized_nodes};
use crate::discretization::nodes::sizing::Sizing;
use crate::discretization::{Integration, Method, Planar};
use crate::geometry::Point2;
use crate::scene::Scene;

/// More nodes than this are not tried.
const MAX_NODES: usize = 40_000;
/// A graded model at one level.
///
/// # Errors
/// [`ModelError`] as for any model.
pub fn graded_model(scene: &Scene, method: Method, level: i32) -> Result<TissueModel, ModelError> {
    let grading = grading(scene, method, level);
    model_on(scene, method, graded_nodes(&scene.features(), &grading), &grading)
}

/// The same with nodes no farther apart than is `wanted` of the growth of the spacing at this level.
///
/// # Errors
/// [`ModelError`] as for any model.
pub fn sized_model(
    scene: &Scene,
    method: Method,
    level: i32,
    wanted: impl FnOnce(f64) -> Sizing,
) -> Result<TissueModel, ModelError> {
    let grading = grading(scene, method, level);
    model_on(scene, method, sized_nodes(&scene.features(), &grading, &wanted(grading.slope)), &grading)
}

fn grading(scene: &Scene, method: Method, level: i32) -> Grading {
    let fit = if method.integration.is_nodal() { InterfaceFit::Between } else { InterfaceFit::On };
    let elements = matches!(method.integration, Integration::FemT6);
    Grading::level(&scene.features(), if elements { level } else { level + KERNEL_LEVELS }, fit)
}

fn model_on(scene: &Scene, method: Method, nodes: Vec<Point2>, grading: &Grading) -> Result<TissueModel, ModelError> {
    if nodes.len() > MAX_NODES {
        return Err(ModelError::TooManyNodes { nodes: nodes.len(), limit: MAX_NODES });
    }
    let planar = Planar::new(&scene.outline, &scene.inclusion_outlines(), nodes, None, method)?;
    TissueModel::on(scene, planar, grading.finest)
}

/// Kernels and linear triangles start this many levels finer than quadratic triangles, whose nodes carry more.
const KERNEL_LEVELS: i32 = 2;
