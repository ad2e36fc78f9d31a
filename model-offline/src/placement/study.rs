//! The placement study: every paddle, static and dynamic.

use super::adaptive::profile_model;
use super::controllability::rows;
use super::fixture::{self, Fixture};
use super::hindrance::{Hindrance, best_to_control, hindrance};
use super::rest::{RestResponse, rest_responses};
use crate::discretization::Resolution;
use crate::model::jumps::{Jump, TargetPath};
use crate::model::{Body, ModelError, TissueModel};
use crate::parallel;
use crate::scene::Scene;
use crate::solver::equilibrium::{Failure, FailureReason, NewtonSettings};
use nalgebra::{Matrix2, Vector2};
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
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct StaticStudy {
    /// d(target displacement)/d(depth) at zero depth.
    pub target_per_depth: [f64; 2],
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
    /// Where the tissue went over to another equilibrium on the way, the first time; none when it did not.
    pub jump: Option<Jump>,
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
    /// ‖J⁻¹ n‖: paddle displacement per orthogonal target displacement; infinite (`null` in JSON) where the paddle cannot
    /// control the target.
    pub controllability_measure: f64,
    /// J⁻¹ n; none where the paddle cannot control the target.
    pub best_direction: Option<[f64; 2]>,
    /// What keeps the paddle from holding the target; none when nothing does.
    pub hindrance: Option<Hindrance>,
    /// d(target displacement)/d(depth) at zero depth, paddle held.
    pub target_per_depth: [f64; 2],
    /// Jacobians along the insertion, at the depths of the static study.
    pub jacobians: Vec<[[f64; 2]; 2]>,
    /// The insertion with this paddle static.
    #[serde(rename = "static")]
    pub static_study: StaticStudy,
    /// Largest orthogonal displacement with this paddle static over that without a paddle, to the depth that both reached.
    pub static_over_no_paddle: Option<f64>,
}

/// The insertion without a paddle: what every paddle is held against.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoPaddle {
    /// The insertion.
    #[serde(rename = "static")]
    pub static_study: StaticStudy,
}

/// The best paddle for each approach, by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Optimum {
    /// Smallest largest orthogonal displacement with a static paddle.
    #[serde(rename = "static")]
    pub static_paddle: u32,
    /// Smallest controllability measure; none where no paddle can control the target.
    #[serde(rename = "dynamic")]
    pub dynamic_paddle: Option<u32>,
}

/// A whole placement study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Placement {
    /// Results by paddle, in the scene's order.
    pub paddles: Vec<PaddleResult>,
    /// The insertion without a paddle.
    pub no_paddle: NoPaddle,
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
/// a tolerance, the insertion is followed to depth on its [`profile_model`], which says only what the law's nonlinearity adds
/// where its nodes are fewer: at rest the insertion answers as the model itself, `u(d) = u_c(d) + (u′ − u_c′) d`, and so do
/// the Jacobians along it.
///
/// # Errors
/// [`ModelError`] when the body at rest cannot be solved. A static run that stops early and a paddle that cannot control
/// the target are results, not errors.
pub fn place(model: &TissueModel, options: &PlacementOptions<'_>) -> Result<Placement, ModelError> {
    model.needs_a_patch()?;
    let resolution = model.scene().discretization.resolution;
    let profile = match resolution {
        Resolution::Tolerance(_) => Cow::Owned(profile_model(model)?),
        Resolution::Spacing(_) | Resolution::Level(_) => Cow::Borrowed(model),
    };
    let newton = options.newton.unwrap_or_else(|| newton_for(resolution));
    let rest = rest_responses(model)?;
    // Every paddle, and none at the end of the list.
    let mut at_rest: Vec<Option<AtRest>> = vec![None; rest.len() + 1];
    if profile.nodes() != model.nodes() {
        let known = rest.iter().map(|r| AtRest { per_depth: r.target_per_depth, jacobian: Some(r.jacobian) });
        let without = AtRest { per_depth: model.body(None, newton)?.depth_sensitivity()?, jacobian: None };
        at_rest = known.chain([without]).map(Some).collect();
    }
    let insertions = parallel::map(rest.len() + 1, options.threads, |i| {
        follow(&profile, (i < rest.len()).then_some(i), newton, at_rest[i].as_ref(), options.progress)
    });
    let mut insertions = insertions.into_iter().collect::<Result<Vec<_>, _>>()?;
    let without = insertions.pop().unwrap_or_default();
    let scene = model.scene();
    let paddles: Vec<PaddleResult> = rest
        .iter()
        .zip(insertions)
        .zip(&scene.paddles)
        .map(|((rest, insertion), paddle)| paddle_result(paddle.index, rest, insertion, &without.study, scene))
        .collect();
    let optimum = rank(&paddles, scene.needle.orthogonal());
    let no_paddle = NoPaddle { static_study: without.study };
    Ok(Placement { paddles, no_paddle, optimum, profile_nodes: profile.nodes() })
}

/// Newton's settings for the static study. On nodes refined to a tolerance a law may lose stability under the needle's
/// edge before the full depth; finding that depth to an eighth of an increment is enough there. Iterations are not saved:
/// an increment that takes many is no increment that fails.
pub(super) fn newton_for(resolution: Resolution) -> NewtonSettings {
    match resolution {
        Resolution::Spacing(_) => NewtonSettings::default(),
        Resolution::Tolerance(_) | Resolution::Level(_) => {
            NewtonSettings { max_cutbacks: 3, ..NewtonSettings::default() }
        }
    }
}

/// Number of times [`place`] calls its progress function.
pub fn steps(scene: &Scene) -> u64 {
    (scene.paddles.len() as u64 + 1) * u64::from(scene.needle.increments)
}

/// The paddle that [controls the target best](best_to_control), by index; no static study is run.
///
/// # Errors
/// [`ModelError::NoPaddleControls`] when none can control the target; any other when the body at rest cannot be solved.
pub fn best_dynamic(model: &TissueModel) -> Result<u32, ModelError> {
    let best = best_to_control(&rest_responses(model)?).ok_or(ModelError::NoPaddleControls)?;
    Ok(model.scene().paddles[best].index)
}

/// One insertion with a paddle held still, or without one.
#[derive(Debug, Clone, Default)]
pub(super) struct FollowedInsertion {
    pub jacobians: Vec<[[f64; 2]; 2]>,
    pub study: StaticStudy,
}

/// What a better model answers at rest, with a paddle or without one.
#[derive(Debug, Clone, Copy)]
pub(super) struct AtRest {
    pub per_depth: Vector2<f64>,
    pub jacobian: Option<Matrix2<f64>>,
}

impl AtRest {
    /// What it answers beside a body, which is at rest.
    fn beside(&self, body: &mut Body<'_>, per_depth: Vector2<f64>) -> Result<Self, ModelError> {
        let own = self.jacobian.map(|_| body.actuation_jacobian()).transpose()?;
        let jacobian = self.jacobian.zip(own).map(|(better, own)| better - own);
        Ok(Self { per_depth: self.per_depth - per_depth, jacobian })
    }
}

/// Follows the insertion at the scene's increments, until it stops; where a better model has been heard, corrected by what it
/// answers at rest.
///
/// # Errors
/// [`ModelError`] when the body at rest cannot be solved.
pub(super) fn follow(
    model: &TissueModel,
    paddle: Option<usize>,
    newton: NewtonSettings,
    at_rest: Option<&AtRest>,
    progress: &(dyn Fn() + Sync),
) -> Result<FollowedInsertion, ModelError> {
    let scene = model.scene();
    let normal = scene.needle.orthogonal();
    let mut body = model.body(paddle, newton)?;
    let mut followed = FollowedInsertion::default();
    let study = &mut followed.study;
    let per_depth = body.depth_sensitivity()?;
    let beside = at_rest.map(|better| better.beside(&mut body, per_depth)).transpose()?;
    study.target_per_depth = at_rest.map_or(per_depth, |better| better.per_depth).into();
    let mut path = TargetPath::from_rest(&mut body, Vector2::zeros());
    let increments = scene.needle.increments;
    for increment in 1..=increments {
        progress();
        let depth = scene.needle.depth * f64::from(increment) / f64::from(increments);
        let mut outcome = body.drive(depth, Vector2::zeros());
        // Few cuts find where a law loses stability; what did not converge is asked again with all of them.
        if let Err(Failure { reason: FailureReason::NotConverged, .. }) = outcome {
            body.equilibrium_mut()
                .set_settings(NewtonSettings { max_cutbacks: NewtonSettings::default().max_cutbacks, ..newton });
            outcome = body.drive(depth, Vector2::zeros());
            body.equilibrium_mut().set_settings(newton);
        }
        let jacobian = outcome.and_then(|()| paddle.map(|_| body.actuation_jacobian()).transpose());
        match jacobian {
            Ok(jacobian) => {
                let added = beside.map_or_else(Vector2::zeros, |beside| beside.per_depth * depth);
                let displacement = body.target_displacement() + added;
                let orthogonal = displacement.dot(&normal);
                study.depth.push(depth);
                study.target_displacement.push(displacement.into());
                study.orthogonal.push(orthogonal);
                study.max_orthogonal = study.max_orthogonal.max(orthogonal.abs());
                study.reached_depth = depth;
                let added = beside.and_then(|beside| beside.jacobian).unwrap_or_else(Matrix2::zeros);
                followed.jacobians.extend(jacobian.map(|jacobian| rows(&(jacobian + added))));
                path.goes_on(&mut body);
            }
            Err(Failure { reason, detail, .. }) => {
                study.reached_depth = body.depth();
                study.failure = Some(StaticFailure { reason, depth: body.depth(), detail });
                break;
            }
        }
    }
    study.jump = path.jump();
    Ok(followed)
}

fn paddle_result(
    index: u32,
    rest: &RestResponse,
    insertion: FollowedInsertion,
    without: &StaticStudy,
    scene: &Scene,
) -> PaddleResult {
    PaddleResult {
        index,
        jacobian: rows(&rest.jacobian),
        condition: firmware::contract::condition_number(&rest.jacobian),
        controllability_measure: rest.controllability_measure,
        best_direction: rest.best_direction.map(Into::into),
        hindrance: hindrance(rest, scene),
        target_per_depth: rest.target_per_depth.into(),
        jacobians: insertion.jacobians,
        static_over_no_paddle: insertion.study.over(without),
        static_study: insertion.study,
    }
}

impl PaddleResult {
    /// The response at rest that it holds.
    pub(super) fn rest(&self) -> RestResponse {
        RestResponse {
            jacobian: Matrix2::from_row_slice(&self.jacobian.concat()),
            controllability_measure: self.controllability_measure,
            best_direction: self.best_direction.map(Into::into),
            target_per_depth: self.target_per_depth.into(),
        }
    }
}

impl StaticStudy {
    /// The depth over which insertions are compared that stopped early: to which all came that reached an increment; none where
    /// none did.
    pub fn common_depth<'a>(studies: impl Iterator<Item = &'a Self> + Clone) -> Option<f64> {
        let common = fixture::common(studies.clone().map(|study| &study.orthogonal[..]))?;
        studies.into_iter().find_map(|study| study.depth.get(common - 1)).copied()
    }

    /// Largest orthogonal displacement over that of another insertion, to the depth that both reached; none where they
    /// have no depth in common, or the other one does not move the target.
    pub fn over(&self, other: &Self) -> Option<f64> {
        fixture::over(&self.orthogonal, &other.orthogonal)
    }
}

/// The best paddles: as a [fixture](fixture::best), and to control the target.
fn rank(paddles: &[PaddleResult], normal: Vector2<f64>) -> Optimum {
    let fixtures: Vec<Fixture<'_>> = paddles
        .iter()
        .map(|p| Fixture {
            stopped: p.static_study.failure.as_ref().map(|failure| failure.depth),
            orthogonal: &p.static_study.orthogonal,
            per_depth: Vector2::from(p.target_per_depth).dot(&normal),
        })
        .collect();
    Optimum {
        static_paddle: fixture::best(&fixtures).map_or(0, |place| paddles[place].index),
        dynamic_paddle: best_to_control(&paddles.iter().map(PaddleResult::rest).collect::<Vec<_>>())
            .map(|place| paddles[place].index),
    }
}

#[cfg(test)]
mod tests {
    use super::super::adaptive::discretise;
    use super::*;
    use crate::discretization::{Integration, Method};

    /// Followed on few nodes, an insertion still begins as the model that was refined answers at rest.
    #[test]
    fn an_insertion_on_coarser_nodes_begins_as_the_accurate_model_answers() {
        let mut scene = Scene::bundled("paper").unwrap().without_inclusions();
        scene.discretization.method = Method::new(Integration::FemT6);
        scene.discretization.resolution = Resolution::Tolerance(0.003);
        scene.needle.depth *= 1e-4;
        scene.needle.increments = 1;
        let (model, _) = discretise(&scene).unwrap();
        let placement = place(&model, &PlacementOptions::default()).unwrap();
        assert!(placement.profile_nodes < model.nodes(), "{} nodes are followed themselves", model.nodes());
        let coarse = rest_responses(&profile_model(&model).unwrap()).unwrap();
        let off = |found: [f64; 2], rest: [f64; 2]| {
            (Vector2::from(found) - Vector2::from(rest)).norm() / Vector2::from(rest).norm()
        };
        for (paddle, coarse) in placement.paddles.iter().zip(coarse) {
            let study = &paddle.static_study;
            let slope = study.target_displacement[0].map(|u| u / study.depth[0]);
            let [followed, uncorrected] =
                [slope, coarse.target_per_depth.into()].map(|u| off(u, paddle.target_per_depth));
            assert!(followed < 1e-4 && uncorrected > 1e-3, "{}: {followed}, {uncorrected}", paddle.index);
            let [rest, along] = [paddle.jacobian, paddle.jacobians[0]].map(|j| Matrix2::from_row_slice(&j.concat()));
            assert!((along - rest).norm() < 1e-4 * rest.norm(), "{}: {along} {rest}", paddle.index);
            assert_eq!(study.target_per_depth, paddle.target_per_depth);
        }
        let none = &placement.no_paddle.static_study;
        assert!(off(none.target_displacement[0].map(|u| u / none.depth[0]), none.target_per_depth) < 1e-4);
    }
}
