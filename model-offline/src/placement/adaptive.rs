//! Refinement to a tolerance: no node more than the controllability measures need.
//!
//! Nodes are graded towards the singular points, level by level. The error of a level is estimated against an
//! *independent* method, quadratic triangles on graded nodes, refined until two levels agree well within the tolerance
//! (their error halves from level to level, see [`Grading::level`]); what those two leave open is added to the estimate.

use super::model::{ModelError, TissueModel};
use super::rest::{RestResponse, rest_responses};
use crate::discretization::graded::{Grading, InterfaceFit, graded_nodes};
use crate::discretization::{Method, Planar};
use crate::scene::schema::{Basis, Integration};
use crate::scene::{Resolution, Scene};
use serde::Serialize;

/// Levels tried before giving up; nodes grow about 1.7-fold per level.
const MAX_LEVEL: u32 = 9;
/// More nodes than this are not tried.
const MAX_NODES: usize = 40_000;
/// Share of the tolerance that the reference may leave open.
const REFERENCE_SHARE: f64 = 0.12;

/// What a refinement found out about its own error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorEstimate {
    /// Estimated worst relative error of the controllability measures.
    pub controllability: f64,
    /// Estimated worst error of the small-depth target displacement, over the largest one.
    pub target_displacement: f64,
    /// The part of both that the reference solution leaves open.
    pub reference: f64,
    /// Nodes of the reference solution.
    pub reference_nodes: usize,
    /// Refinement level that was accepted.
    pub level: u32,
}

impl ErrorEstimate {
    fn worst(&self) -> f64 {
        self.controllability.max(self.target_displacement)
    }
}

/// Discretises a scene at its spacing, or refines it to its tolerance.
///
/// # Errors
/// [`ModelError`], among them [`ModelError::ToleranceNotReached`] with the estimate that was reached.
pub fn discretise(scene: &Scene) -> Result<(TissueModel, Option<ErrorEstimate>), ModelError> {
    match scene.discretization.resolution {
        Resolution::Spacing(_) => Ok((TissueModel::new(scene)?, None)),
        Resolution::Tolerance(tolerance) => {
            let (model, estimate) = refine(scene, tolerance)?;
            Ok((model, Some(estimate)))
        }
    }
}

/// The model on which to follow the insertion to depth, for a model refined to a tolerance: itself while it is small,
/// else the coarsest graded one. With the paper's law the finite-depth profile has no mesh limit (finer nodes resolve
/// the needle's edge better and lose stability earlier), so refining it buys nothing.
///
/// # Errors
/// [`ModelError`] as for any model.
pub fn profile_model(model: &TissueModel) -> Result<TissueModel, ModelError> {
    if model.nodes() <= PROFILE_NODES {
        return Ok(model.clone());
    }
    graded_model(model.scene(), model.planar().method(), 0)
}

/// Largest model on which the finite-depth profile is followed.
const PROFILE_NODES: usize = 1500;

/// A graded model at one level.
///
/// # Errors
/// [`ModelError`] as for any model.
pub fn graded_model(scene: &Scene, method: Method, level: u32) -> Result<TissueModel, ModelError> {
    let nodal = matches!(method.integration, Integration::Dni | Integration::Scni | Integration::Nsni);
    let fit = if nodal { InterfaceFit::Between } else { InterfaceFit::On };
    let elements = matches!(method.integration, Integration::FemT6);
    let grading = Grading::level(scene, if elements { level } else { level + KERNEL_LEVELS }, fit);
    let nodes = graded_nodes(scene, &grading);
    if nodes.len() > MAX_NODES {
        return Err(ModelError::TooManyNodes { nodes: nodes.len(), limit: MAX_NODES });
    }
    let planar = Planar::new(&scene.outline, &scene.inclusion_outlines(), nodes, None, method)?;
    TissueModel::on(scene, planar, grading.finest)
}

/// Kernels and linear triangles start this many levels finer than quadratic triangles, whose nodes carry more.
const KERNEL_LEVELS: u32 = 2;

fn refine(scene: &Scene, tolerance: f64) -> Result<(TissueModel, ErrorEstimate), ModelError> {
    let spec = scene.discretization;
    let method = Method { integration: spec.integration, basis: spec.basis, support: spec.support, consistent: true };
    let reference = Reference::compute(scene, REFERENCE_SHARE * tolerance)?;
    let mut best: Option<ErrorEstimate> = None;
    for level in 0..=MAX_LEVEL {
        let model = match graded_model(scene, method, level) {
            Ok(model) => model,
            Err(ModelError::TooManyNodes { .. }) => break,
            Err(error) => return Err(error),
        };
        let estimate = reference.estimate(&rest_responses(&model)?, level);
        if estimate.worst() <= tolerance {
            return Ok((model, estimate));
        }
        if best.is_none_or(|b| estimate.worst() < b.worst()) {
            best = Some(estimate);
        }
    }
    let reached = best.map_or(f64::INFINITY, |b| b.worst());
    Err(ModelError::ToleranceNotReached { tolerance, reached })
}

/// A solution on quadratic triangles, fine enough to judge others by.
struct Reference {
    responses: Vec<RestResponse>,
    open: f64,
    nodes: usize,
}

impl Reference {
    fn compute(scene: &Scene, share: f64) -> Result<Self, ModelError> {
        let method = Method { integration: Integration::FemT6, basis: Basis::Linear, support: 2.0, consistent: true };
        let mut coarse = rest_responses(&graded_model(scene, method, 0)?)?;
        for level in 1..=MAX_LEVEL {
            let model = graded_model(scene, method, level)?;
            let fine = rest_responses(&model)?;
            let largest = largest_displacement(&fine);
            // Errors halve from level to level, so the distance to the coarser level bounds the error of the finer one
            // with room to spare. Extrapolating would not: with inclusions, errors of either sign mix.
            let open = fine
                .iter()
                .zip(&coarse)
                .map(|(f, c)| {
                    let measure = (f.controllability_measure / c.controllability_measure - 1.0).abs();
                    measure.max((f.target_per_depth - c.target_per_depth).norm() / largest)
                })
                .fold(0.0, f64::max);
            if open <= share || level == MAX_LEVEL {
                return Ok(Self { responses: fine, open, nodes: model.nodes() });
            }
            coarse = fine;
        }
        unreachable!("the last level returns")
    }

    fn estimate(&self, responses: &[RestResponse], level: u32) -> ErrorEstimate {
        let largest = largest_displacement(&self.responses);
        let worst = |error: &dyn Fn(&RestResponse, &RestResponse) -> f64| {
            responses.iter().zip(&self.responses).map(|(r, s)| error(r, s)).fold(0.0, f64::max) + self.open
        };
        ErrorEstimate {
            controllability: worst(&|r, s| (r.controllability_measure / s.controllability_measure - 1.0).abs()),
            target_displacement: worst(&|r, s| (r.target_per_depth - s.target_per_depth).norm() / largest),
            reference: self.open,
            reference_nodes: self.nodes,
            level,
        }
    }
}

fn largest_displacement(responses: &[RestResponse]) -> f64 {
    responses.iter().map(|r| r.target_per_depth.norm()).fold(f64::MIN_POSITIVE, f64::max)
}
