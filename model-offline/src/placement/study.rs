//! The placement study: every paddle, static and dynamic.

use super::adaptive::profile_model;
use super::controllability::rows;
use super::rest::{RestResponse, rest_responses};
use crate::discretization::Resolution;
use crate::model::{ModelError, TissueModel};
use crate::parallel;
use crate::scene::Scene;
use crate::solver::equilibrium::{Failure, FailureReason, NewtonSettings};
use nalgebra::Vector2;
use serde::Serialize;
use std::borrow::Cow;

/// Why and where a static run ended before the full depth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StaticFailure {
    /// What happened.
    pub reason: FailureReason,
    /// Depth of the last converged state, length units.
    pub depth: f64,
    /// Numbers behind the reason.
    pub detail: String,
}

/// The insertion with a static paddle: attached, and held still.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StaticStudy {
    /// Needle depths, from the first increment.
    pub depth: Vec<f64>,
    /// Target displacement at these depths.
    pub target_displacement: Vec<[f64; 2]>,
    /// Its component orthogonal to the needle.
    pub orthogonal: Vec<f64>,
    /// Largest absolute orthogonal displacement.
    pub max_orthogonal: f64,
    /// How far the needle got.
    pub reached_depth: f64,
    /// Why it stopped there; none when it reached the full depth.
    pub failure: Option<StaticFailure>,
}

/// What the study says about one paddle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaddleResult {
    /// Paddle index, as in the scene.
    pub index: u32,
    /// Actuation Jacobian at zero depth, needle held: rows target x, y, columns paddle x, y.
    pub jacobian: [[f64; 2]; 2],
    /// Condition number ‖J‖·‖J⁻¹‖ in the Frobenius norm, as the controller judges it.
    pub condition: f64,
    /// ‖J⁻¹ n‖: paddle displacement per orthogonal target displacement.
    pub controllability_measure: f64,
    /// J⁻¹ n.
    pub best_direction: [f64; 2],
    /// d(target displacement)/d(depth) at zero depth, paddle held.
    pub target_per_depth: [f64; 2],
    /// Jacobians along the insertion, at the depths of the static study.
    pub jacobians: Vec<[[f64; 2]; 2]>,
    /// The insertion with this paddle static.
    #[serde(rename = "static")]
    pub static_study: StaticStudy,
}

/// The best paddle for each approach, by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Optimum {
    /// Smallest largest orthogonal displacement with a static paddle.
    #[serde(rename = "static")]
    pub static_paddle: u32,
    /// Smallest controllability measure.
    #[serde(rename = "dynamic")]
    pub dynamic_paddle: u32,
}

/// A whole placement study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Placement {
    /// Results by paddle, in the scene's order.
    pub paddles: Vec<PaddleResult>,
    /// The best paddles.
    pub optimum: Optimum,
    /// Nodes of the model on which the insertion was followed to depth.
    pub profile_nodes: usize,
}

/// How a placement study runs.
///
/// # Example
/// ```
/// use model_offline::placement::PlacementOptions;
///
/// let options = PlacementOptions { threads: 2, ..PlacementOptions::default() };
/// assert!(options.newton.is_none()); // those that suit the resolution
/// ```
#[derive(Clone, Copy)]
pub struct PlacementOptions<'a> {
    /// Threads to use; the result does not depend on them.
    pub threads: usize,
    /// Settings of Newton's method along the insertion; when absent, those that suit the scene's resolution.
    pub newton: Option<NewtonSettings>,
    /// Called [`steps`] times along the way.
    pub progress: &'a (dyn Fn() + Sync),
}

impl std::fmt::Debug for PlacementOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { threads, newton, .. } = self;
        f.debug_struct("PlacementOptions").field("threads", threads).field("newton", newton).finish_non_exhaustive()
    }
}

impl Default for PlacementOptions<'_> {
    /// All threads, silent.
    fn default() -> Self {
        Self { threads: parallel::available(), newton: None, progress: &|| {} }
    }
}

/// Studies every paddle of the model's scene. Jacobians at rest are those of the model itself; on a model that was refined to
/// a tolerance, the insertion is followed to depth on its [`profile_model`].
///
/// # Errors
/// [`ModelError`] when a Jacobian cannot be computed; a static run that stops early is a result, not an error.
pub fn place(model: &TissueModel, options: &PlacementOptions<'_>) -> Result<Placement, ModelError> {
    let resolution = model.scene().discretization.resolution;
    let profile = match resolution {
        Resolution::Tolerance(_) => Cow::Owned(profile_model(model)?),
        Resolution::Spacing(_) | Resolution::Level(_) => Cow::Borrowed(model),
    };
    let newton = options.newton.unwrap_or_else(|| newton_for(resolution));
    let rest = rest_responses(model)?;
    let paddles = parallel::map(rest.len(), options.threads, |paddle| {
        study_paddle(&profile, &rest[paddle], paddle, &PlacementOptions { newton: Some(newton), ..*options })
    });
    let paddles = paddles.into_iter().collect::<Result<Vec<_>, _>>()?;
    let optimum = rank(&paddles, model.scene().needle.orthogonal());
    Ok(Placement { paddles, optimum, profile_nodes: profile.nodes() })
}

/// Newton's settings for the static study. On nodes refined to a tolerance the law loses stability under the needle's
/// edge long before the full depth; finding that depth to an eighth of an increment is enough there.
fn newton_for(resolution: Resolution) -> NewtonSettings {
    match resolution {
        Resolution::Spacing(_) => NewtonSettings::default(),
        Resolution::Tolerance(_) | Resolution::Level(_) => {
            NewtonSettings { max_cutbacks: 3, max_iterations: 8, ..NewtonSettings::default() }
        }
    }
}

/// Number of times [`place`] calls its progress function.
pub fn steps(scene: &Scene) -> u64 {
    scene.paddles.len() as u64 * u64::from(scene.needle.increments)
}

/// The paddle with the smallest controllability measure, by index; no static study is run.
///
/// # Errors
/// [`ModelError`] when a Jacobian cannot be computed.
pub fn best_dynamic(model: &TissueModel) -> Result<u32, ModelError> {
    let measures = rest_responses(model)?;
    let best = model
        .scene()
        .paddles
        .iter()
        .zip(&measures)
        .min_by(|a, b| a.1.controllability_measure.total_cmp(&b.1.controllability_measure));
    Ok(best.map_or(0, |b| b.0.index))
}

fn study_paddle(
    model: &TissueModel,
    rest: &RestResponse,
    paddle: usize,
    options: &PlacementOptions<'_>,
) -> Result<PaddleResult, ModelError> {
    let scene = model.scene();
    let index = scene.paddles[paddle].index;
    let normal = scene.needle.orthogonal();
    let mut body = model.body(Some(paddle), options.newton.unwrap_or_default())?;

    let mut study = StaticStudy {
        depth: Vec::new(),
        target_displacement: Vec::new(),
        orthogonal: Vec::new(),
        max_orthogonal: 0.0,
        reached_depth: 0.0,
        failure: None,
    };
    let mut jacobians = Vec::new();
    let increments = scene.needle.increments;
    for increment in 1..=increments {
        (options.progress)();
        let depth = scene.needle.depth * f64::from(increment) / f64::from(increments);
        let outcome = body.drive(depth, Vector2::zeros()).and_then(|()| body.actuation_jacobian());
        match outcome {
            Ok(jacobian) => {
                let displacement = body.target_displacement();
                let orthogonal = displacement.dot(&normal);
                study.depth.push(depth);
                study.target_displacement.push(displacement.into());
                study.orthogonal.push(orthogonal);
                study.max_orthogonal = study.max_orthogonal.max(orthogonal.abs());
                study.reached_depth = depth;
                jacobians.push(rows(&jacobian));
            }
            Err(Failure { reason, detail, .. }) => {
                study.reached_depth = body.depth();
                study.failure = Some(StaticFailure { reason, depth: body.depth(), detail });
                break;
            }
        }
    }
    Ok(PaddleResult {
        index,
        jacobian: rows(&rest.jacobian),
        condition: firmware::contract::condition_number(&rest.jacobian),
        controllability_measure: rest.controllability_measure,
        best_direction: rest.best_direction.into(),
        target_per_depth: rest.target_per_depth.into(),
        jacobians,
        static_study: study,
    })
}

/// The best paddles. A static paddle that did not reach the depth ranks below every one that did. When none did, they are
/// compared over the depth that all of them reached, or by their small-depth limit when there is none.
fn rank(paddles: &[PaddleResult], normal: Vector2<f64>) -> Optimum {
    let complete = paddles.iter().any(|p| p.static_study.failure.is_none());
    let common = paddles.iter().map(|p| p.static_study.depth.len()).min().unwrap_or(0);
    let key = |p: &PaddleResult| match &p.static_study.failure {
        None => p.static_study.max_orthogonal,
        Some(_) if complete => f64::INFINITY,
        Some(_) if common > 0 => p.static_study.orthogonal[..common].iter().fold(0.0, |m, x| f64::max(m, x.abs())),
        Some(_) => Vector2::from(p.target_per_depth).dot(&normal).abs(),
    };
    let static_paddle = paddles.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
    let dynamic_paddle = paddles.iter().min_by(|a, b| a.controllability_measure.total_cmp(&b.controllability_measure));
    Optimum {
        static_paddle: static_paddle.map_or(0, |p| p.index),
        dynamic_paddle: dynamic_paddle.map_or(0, |p| p.index),
    }
}
