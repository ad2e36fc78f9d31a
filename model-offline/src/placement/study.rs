//! The placement study: every paddle, static and dynamic.

use super::rest::{RestResponse, rest_responses};
use crate::discretization::Resolution;
use crate::model::{ModelError, TissueModel};
use crate::solver::equilibrium::{Failure, FailureReason, NewtonSettings};
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

/// Above this condition number a Jacobian controls nothing that a real paddle could use.
pub const MAX_JACOBIAN_CONDITION: f64 = 1e8;

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

/// The insertion with the paddle as a fixture.
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
    /// The insertion with this paddle as a fixture.
    #[serde(rename = "static")]
    pub fixture: StaticStudy,
}

/// The best paddle for each approach, by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Optimum {
    /// Smallest largest orthogonal displacement as a fixture.
    #[serde(rename = "static")]
    pub fixture: u32,
    /// Smallest controllability measure.
    pub dynamic: u32,
}

/// A whole placement study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Placement {
    /// Results by paddle, in the scene's order.
    pub paddles: Vec<PaddleResult>,
    /// The best paddles.
    pub optimum: Optimum,
}

/// Runs `work` for 0..count on at most `threads` threads; results come in order, whatever the number of threads.
pub fn parallel<T: Send>(count: usize, threads: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let mut results: Vec<(usize, T)> = std::thread::scope(|scope| {
        let worker = || {
            let mut done = Vec::new();
            loop {
                let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if i >= count {
                    return done;
                }
                done.push((i, work(i)));
            }
        };
        let handles: Vec<_> = (1..threads.min(count)).map(|_| scope.spawn(worker)).collect();
        let mut results = worker();
        for handle in handles {
            results.extend(handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        results
    });
    results.sort_by_key(|r| r.0);
    results.into_iter().map(|r| r.1).collect()
}

/// Studies every paddle of the model's scene.
///
/// # Errors
/// [`ModelError`] when a Jacobian cannot be computed; a static run that stops early is a result, not an error.
pub fn place(
    model: &TissueModel,
    settings: NewtonSettings,
    threads: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<Placement, ModelError> {
    place_on(model, model, settings, threads, progress)
}

/// The same with the insertion followed to depth on a model of its own (see
/// [`profile_model`](super::adaptive::profile_model)).
///
/// # Errors
/// [`ModelError`] when a Jacobian cannot be computed.
pub fn place_on(
    model: &TissueModel,
    profile: &TissueModel,
    settings: NewtonSettings,
    threads: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<Placement, ModelError> {
    let rest = rest_responses(model)?;
    let paddles =
        parallel(rest.len(), threads, |paddle| study_paddle(profile, &rest[paddle], paddle, settings, progress))
            .into_iter()
            .collect::<Result<Vec<_>, _>>()?;
    let optimum = rank(&paddles, model.scene().needle.orthogonal());
    Ok(Placement { paddles, optimum })
}

/// Settings for the static study of a scene. On nodes refined to a tolerance the law loses stability under the needle's
/// edge long before the full depth; finding that depth to an eighth of an increment is enough there.
pub fn settings_for(scene: &crate::scene::Scene) -> NewtonSettings {
    match scene.discretization.resolution {
        Resolution::Spacing(_) => NewtonSettings::default(),
        Resolution::Tolerance(_) | Resolution::Level(_) => {
            NewtonSettings { max_cutbacks: 3, max_iterations: 8, ..NewtonSettings::default() }
        }
    }
}

/// Number of times [`place`] calls its progress function.
pub fn progress_steps(model: &TissueModel) -> u64 {
    model.scene().paddles.len() as u64 * u64::from(model.scene().needle.increments)
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
    settings: NewtonSettings,
    progress: &(dyn Fn() + Sync),
) -> Result<PaddleResult, ModelError> {
    let scene = model.scene();
    let index = scene.paddles[paddle].index;
    let normal = scene.needle.orthogonal();
    let mut body = model.body(Some(paddle), settings)?;

    let mut fixture = StaticStudy {
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
        progress();
        let depth = scene.needle.depth * f64::from(increment) / f64::from(increments);
        let outcome = body.drive(depth, Vector2::zeros()).and_then(|()| body.actuation_jacobian());
        match outcome {
            Ok(jacobian) => {
                let displacement = body.target_displacement();
                let orthogonal = displacement.dot(&normal);
                fixture.depth.push(depth);
                fixture.target_displacement.push(displacement.into());
                fixture.orthogonal.push(orthogonal);
                fixture.max_orthogonal = fixture.max_orthogonal.max(orthogonal.abs());
                fixture.reached_depth = depth;
                jacobians.push(rows(&jacobian));
            }
            Err(Failure { reason, detail, .. }) => {
                fixture.reached_depth = body.depth();
                fixture.failure = Some(StaticFailure { reason, depth: body.depth(), detail });
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
        fixture,
    })
}

/// J⁻¹ n: the paddle displacement that moves the target by one along n and not at all across.
///
/// # Errors
/// The condition number, when it is beyond [`MAX_JACOBIAN_CONDITION`].
pub fn best_direction(jacobian: &Matrix2<f64>, normal: Vector2<f64>) -> Result<Vector2<f64>, f64> {
    let values = jacobian.singular_values();
    let condition = values.max() / values.min();
    match jacobian.try_inverse() {
        Some(inverse) if condition <= MAX_JACOBIAN_CONDITION => Ok(inverse * normal),
        _ => Err(condition),
    }
}

/// Rows of a matrix as arrays.
pub fn rows(m: &Matrix2<f64>) -> [[f64; 2]; 2] {
    [[m[(0, 0)], m[(0, 1)]], [m[(1, 0)], m[(1, 1)]]]
}

/// The best paddles. A fixture that did not reach the depth ranks below every one that did. When none did, they are
/// compared over the depth that all of them reached, or by their small-depth limit when there is none.
fn rank(paddles: &[PaddleResult], normal: Vector2<f64>) -> Optimum {
    let complete = paddles.iter().any(|p| p.fixture.failure.is_none());
    let common = paddles.iter().map(|p| p.fixture.depth.len()).min().unwrap_or(0);
    let key = |p: &PaddleResult| match &p.fixture.failure {
        None => p.fixture.max_orthogonal,
        Some(_) if complete => f64::INFINITY,
        Some(_) if common > 0 => p.fixture.orthogonal[..common].iter().fold(0.0, |m, x| f64::max(m, x.abs())),
        Some(_) => Vector2::from(p.target_per_depth).dot(&normal).abs(),
    };
    let fixture = paddles.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
    let dynamic = paddles.iter().min_by(|a, b| a.controllability_measure.total_cmp(&b.controllability_measure));
    Optimum { fixture: fixture.map_or(0, |p| p.index), dynamic: dynamic.map_or(0, |p| p.index) }
}
