//! Refinement to a tolerance: no node more than the controllability measures need.
//!
//! The error of a model is estimated against an *independent* method: quadratic triangles refined where the answers ask
//! for it, with an error that nested meshes certify (see the module `goal_oriented`). Nodes of other methods are graded
//! towards the singular points, level by level, until their distance to that, with what it leaves open, is within the
//! tolerance. Quadratic triangles themselves are judged by the mesh in which each of them is cut into four.

use super::goal_oriented::{self, Certified};
use super::rest::{RestResponse, rest_responses};
use crate::discretization::graded::{MAX_LEVEL, MIN_LEVEL};
use crate::discretization::{Integration, Method, Resolution};
use crate::model::{ModelError, TissueModel, graded_model};
use crate::scene::Scene;
use serde::Serialize;

/// From this tolerance on, refinement starts at the coarsest level; below it, the coarsest levels could only agree by
/// accident.
const LOOSE: f64 = 0.03;
/// Levels by which refinement goes on at most in one go.
const LONGEST_SKIP: i32 = 2;
/// Share of the tolerance that the reference may leave open.
const REFERENCE_SHARE: f64 = 0.25;
/// The same where that decides.
const SHARP_SHARE: f64 = 0.08;

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
    pub level: i32,
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
        Resolution::Tolerance(tolerance) => {
            let (model, estimate) = refine(scene, tolerance)?;
            Ok((model, Some(estimate)))
        }
        Resolution::Spacing(_) | Resolution::Level(_) => Ok((TissueModel::new(scene)?, None)),
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

fn refine(scene: &Scene, tolerance: f64) -> Result<(TissueModel, ErrorEstimate), ModelError> {
    let method = scene.discretization.method;
    if method.integration == Integration::FemT6 {
        return refine_elements(scene, method, tolerance);
    }
    let mut reference = Reference::compute(scene, REFERENCE_SHARE * tolerance)?;
    let mut best: Option<ErrorEstimate> = None;
    let mut level = first_level(tolerance);
    let mut tried = level - 1;
    while level <= MAX_LEVEL {
        let model = match graded_model(scene, method, level) {
            Ok(model) => model,
            // Levels were skipped on the way here: the finest that can be afforded is among them.
            Err(ModelError::TooManyNodes { .. }) if level > tried + 1 => {
                level -= 1;
                continue;
            }
            Err(ModelError::TooManyNodes { .. }) => break,
            Err(error) => return Err(error),
        };
        let responses = rest_responses(&model)?;
        let mut estimate = reference.estimate(&responses, level);
        if estimate.worst() > tolerance
            && estimate.worst() - reference.open <= tolerance
            && !reference.is_sharp(tolerance)
        {
            // What the reference leaves open decides: sharpening it costs less than another level, and serves all to come.
            reference = Reference::compute(scene, SHARP_SHARE * tolerance)?;
            estimate = reference.estimate(&responses, level);
        }
        if estimate.worst() <= tolerance {
            return Ok((model, estimate));
        }
        tried = level;
        // A level halves the error at best, so those that could not reach the tolerance are not tried; but what the
        // coarsest levels leave says little about the finer ones.
        level += ((estimate.worst() / tolerance).log2().floor() as i32).clamp(1, LONGEST_SKIP);
        if best.is_none_or(|b| estimate.worst() < b.worst()) {
            best = Some(estimate);
        }
    }
    let reached = best.map_or(f64::INFINITY, |b| b.worst());
    Err(ModelError::ToleranceNotReached { tolerance, reached })
}

fn first_level(tolerance: f64) -> i32 {
    if tolerance >= LOOSE { MIN_LEVEL } else { 0 }
}

/// Refines quadratic triangles where the answers ask for it; they need no other reference.
fn refine_elements(scene: &Scene, method: Method, tolerance: f64) -> Result<(TissueModel, ErrorEstimate), ModelError> {
    let mut level = MIN_LEVEL - 1;
    let mut estimate = None;
    let (certified, reached) = goal_oriented::refine(scene, |certified| {
        level += 1;
        let reference = Reference::from_certified(certified);
        let found = reference.estimate(&certified.responses, level);
        estimate = Some(found);
        found.worst() <= tolerance
    })?;
    let Some(estimate) = estimate.filter(|_| reached) else {
        let reached = estimate.map_or(f64::INFINITY, |e| e.worst());
        return Err(ModelError::ToleranceNotReached { tolerance, reached });
    };
    let planar = certified.model.planar().clone();
    debug_assert_eq!(method.integration, Integration::FemT6);
    Ok((TissueModel::on(scene, planar, certified.model.spacing())?, estimate))
}

/// A solution on quadratic triangles, extrapolated, to judge others by.
#[derive(Debug, Clone)]
pub struct Reference {
    responses: Vec<RestResponse>,
    open_by_paddle: Vec<f64>,
    open_displacement: f64,
    /// What it leaves open: worst relative error, of all paddles' measures and of the displacements.
    pub open: f64,
    /// Nodes of the finer mesh.
    pub nodes: usize,
}

impl Reference {
    /// Refines until what the limit leaves open is no more than `share`, or as far as nodes are accepted.
    ///
    /// # Errors
    /// [`ModelError`] as for any model.
    pub fn compute(scene: &Scene, share: f64) -> Result<Self, ModelError> {
        let (certified, _) = goal_oriented::refine(scene, |certified| certified.worst_open() <= share)?;
        Ok(Self::from_certified(&certified))
    }

    fn from_certified(certified: &Certified) -> Self {
        Self {
            responses: certified.limit.clone(),
            open_by_paddle: certified.open.clone(),
            open_displacement: certified.open_displacement,
            open: certified.worst_open(),
            nodes: certified.nodes,
        }
    }

    fn is_sharp(&self, tolerance: f64) -> bool {
        self.open <= SHARP_SHARE * tolerance
    }

    /// Estimated relative errors of the controllability measures, paddle by paddle: the distance to the limit, and what
    /// that leaves open.
    pub fn errors(&self, responses: &[RestResponse]) -> Vec<f64> {
        let off = responses
            .iter()
            .zip(&self.responses)
            .map(|(found, limit)| (found.controllability_measure / limit.controllability_measure - 1.0).abs());
        off.zip(&self.open_by_paddle).map(|(off, open)| off + open).collect()
    }

    /// Worst relative distance of the controllability measures, and of the small-depth target displacements over the
    /// largest one.
    pub fn distance(&self, responses: &[RestResponse]) -> (f64, f64) {
        distance(responses, &self.responses)
    }

    /// The extrapolated responses.
    pub fn responses(&self) -> &[RestResponse] {
        &self.responses
    }

    fn estimate(&self, responses: &[RestResponse], level: i32) -> ErrorEstimate {
        let (_, target_displacement) = distance(responses, &self.responses);
        ErrorEstimate {
            controllability: self.errors(responses).into_iter().fold(0.0, f64::max),
            target_displacement: target_displacement + self.open_displacement,
            reference: self.open,
            reference_nodes: self.nodes,
            level,
        }
    }
}

/// Worst relative distance of the measures, and of the displacements over the largest one.
pub fn distance(a: &[RestResponse], b: &[RestResponse]) -> (f64, f64) {
    let largest = b.iter().map(|r| r.target_per_depth.norm()).fold(f64::MIN_POSITIVE, f64::max);
    a.iter().zip(b).fold((0.0, 0.0), |(measure, displacement): (f64, f64), (a, b)| {
        (
            measure.max((a.controllability_measure / b.controllability_measure - 1.0).abs()),
            displacement.max((a.target_per_depth - b.target_per_depth).norm() / largest),
        )
    })
}
