//! Refinement to a tolerance: no node more than the controllability measures need.
//!
//! Nodes are graded towards the singular points, level by level. The error of a level is estimated against an
//! *independent* method, quadratic triangles on graded nodes, extrapolated (their error halves from level to level, see
//! [`Grading::level`](crate::discretization::graded::Grading::level)); what the extrapolation leaves open is added to the estimate. Quadratic triangles themselves are
//! judged by the distance to their own coarser levels.

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
    let reference = Reference::compute(scene, REFERENCE_SHARE * tolerance)?;
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
        let estimate = reference.estimate(&rest_responses(&model)?, level);
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

/// Refines quadratic triangles until their levels agree within the tolerance; they need no other reference.
fn refine_elements(scene: &Scene, method: Method, tolerance: f64) -> Result<(TissueModel, ErrorEstimate), ModelError> {
    let mut levels = Levels::default();
    let mut reached = f64::INFINITY;
    for level in (first_level(tolerance) - 1).max(MIN_LEVEL)..=MAX_LEVEL {
        let model = match graded_model(scene, method, level) {
            Ok(model) => model,
            Err(ModelError::TooManyNodes { .. }) => break,
            Err(error) => return Err(error),
        };
        let reference_nodes = levels.finest.as_ref().map_or(0, |finest| finest.nodes);
        levels.push(&model)?;
        let Some((controllability, target_displacement)) = levels.error() else { continue };
        let estimate = ErrorEstimate { controllability, target_displacement, reference: 0.0, reference_nodes, level };
        if estimate.worst() <= tolerance {
            return Ok((model, estimate));
        }
        reached = reached.min(estimate.worst());
    }
    Err(ModelError::ToleranceNotReached { tolerance, reached })
}

/// The last three levels of quadratic triangles. Their error halves from level to level: what the finest is wrong by is
/// its distance to the level before it, or a third of that to the one before that. Both are looked at, because cells of
/// the interior halve only every second level: two levels that share them may agree by accident.
#[derive(Debug, Default)]
struct Levels {
    finest: Option<Level>,
    before: Option<Level>,
    before_that: Option<Level>,
}

#[derive(Debug)]
struct Level {
    responses: Vec<RestResponse>,
    nodes: usize,
}

impl Levels {
    fn push(&mut self, model: &TissueModel) -> Result<(), ModelError> {
        let level = Level { responses: rest_responses(model)?, nodes: model.nodes() };
        self.before_that = self.before.take();
        self.before = self.finest.replace(level);
        Ok(())
    }

    /// Estimated error of the finest level: of the measures, and of the displacements over the largest. None before there
    /// are three levels.
    fn error(&self) -> Option<(f64, f64)> {
        let (Some(finest), Some(before), Some(before_that)) = (&self.finest, &self.before, &self.before_that) else {
            return None;
        };
        let near = distance(&before.responses, &finest.responses);
        let far = distance(&before_that.responses, &finest.responses);
        Some((near.0.max(far.0 / 3.0), near.1.max(far.1 / 3.0)))
    }

    /// What the levels tend to.
    fn limit(&self) -> Option<Vec<RestResponse>> {
        let (finest, before_that) = (self.finest.as_ref()?, self.before_that.as_ref()?);
        Some(finest.responses.iter().zip(&before_that.responses).map(|(f, c)| extrapolated(f, c)).collect())
    }
}

/// A solution on quadratic triangles, extrapolated, to judge others by.
#[derive(Debug, Clone)]
pub struct Reference {
    responses: Vec<RestResponse>,
    /// What it leaves open: worst relative error of its finest level.
    pub open: f64,
    /// Nodes of the finer level.
    pub nodes: usize,
}

impl Reference {
    /// Refines until the levels leave no more open than `share`, or as far as nodes are accepted.
    ///
    /// # Errors
    /// [`ModelError`] as for any model.
    pub fn compute(scene: &Scene, share: f64) -> Result<Self, ModelError> {
        let method = Method::new(Integration::FemT6);
        let mut levels = Levels::default();
        let mut finest = None;
        for level in -1..=MAX_LEVEL {
            let model = match graded_model(scene, method, level) {
                Ok(model) => model,
                Err(ModelError::TooManyNodes { .. }) if finest.is_some() => break,
                Err(error) => return Err(error),
            };
            levels.push(&model)?;
            let (Some(error), Some(responses)) = (levels.error(), levels.limit()) else { continue };
            // Extrapolation removes most of what the finest level leaves; all of it is taken to remain. Around
            // inclusions, where the order is not quite one, half of it was too little (0.17 % against 0.12 % on
            // `paper-hull`).
            let open = error.0.max(error.1);
            finest = Some(Self { responses, open, nodes: model.nodes() });
            if open <= share {
                break;
            }
        }
        finest.ok_or(ModelError::ToleranceNotReached { tolerance: share, reached: f64::INFINITY })
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
        let (controllability, target_displacement) = distance(responses, &self.responses);
        ErrorEstimate {
            controllability: controllability + self.open,
            target_displacement: target_displacement + self.open,
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

/// The limit of a sequence whose error halves from level to level, from one level and that two before it.
fn extrapolated(fine: &RestResponse, coarse: &RestResponse) -> RestResponse {
    RestResponse {
        controllability_measure: (4.0 * fine.controllability_measure - coarse.controllability_measure) / 3.0,
        target_per_depth: (fine.target_per_depth * 4.0 - coarse.target_per_depth) / 3.0,
        ..*fine
    }
}
