//! The fewest dimensions and paddles that a scene in space needs: the plane-strain slice through needle and target
//! against the body, and one paddle against two.
//!
//! 1. **Body**: quadratic tetrahedra within the tolerance (or the scene's own spacing or level), every paddle and pair.
//! 2. **Slice**: the plane through needle, target and the best single paddle of the body, or the next best that makes a
//!    slice with that paddle ([`slice`](crate::study::slice)), by quadratic triangles within a tenth of the tolerance.
//! 3. **Dimension**: the slice will do where all that it says of the best paddle is within the tolerance of the body:
//!    how far a correction from its Jacobian moves the target (λ, which should be 1; the estimates of both models come
//!    on top), what that moves across the plane,
//!    what the insertion moves across the plane, what a loop by its table leaves there, and which paddle is the best.
//! 4. **Paddles**: one will do where, within its limits, it leaves no more than the tolerance of what the target moves
//!    by without help, and a table that knows of no inclusions still leads to the right side.
//!
//! No decision looks at a clock.

mod chart;
mod closed_loop;
mod comparison;
mod paddles;
mod verdict;
mod written;

pub use closed_loop::ClosedLoop;
pub use comparison::{Feedback, Left, PaddleInBoth, WithoutHelp};
pub use paddles::PaddleSet;
pub use verdict::{RejectedInSpace, SpaceAlternative, SpaceVerdict};

use super::FitError;
use super::cost::{cost, cost_in_space};
use crate::discretization::{Discretization, Integration, Method, Resolution};
use crate::placement::space::SpaceStudy;
use crate::placement::{PlacementOptions, PlacementStudy};
use crate::scene::TissueVariant;
use crate::scene::space::SpaceScene;
use crate::study::slice::{LeftOut, Slice, SliceError, Through};
use serde::Serialize;
use std::time::Instant;

/// What the slice may be wrong by, of the tolerance: it costs next to nothing, and what it leaves open counts against it.
const SLICE_SHARE: f64 = 0.1;

/// No scene may ask for less.
const TIGHTEST: f64 = 1e-4;

/// What one of the two models is, and what it costs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedModel {
    /// Integration rule.
    pub integration: Integration,
    /// Refinement level, where one was found or given.
    pub level: Option<i32>,
    /// Nodes.
    pub nodes: usize,
    /// Estimated worst error of the controllability measures; none where the scene gives its spacing or level.
    pub error_estimate: Option<f64>,
    /// Cost of all Jacobians at rest by operations counted, in seconds of one core.
    pub cost_s: f64,
    /// Time that the whole study took, s: told, and not decided by.
    pub wall_s: f64,
}

/// The best paddles, by index; none where nothing controls the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct BestPaddles {
    /// Least way to control the target.
    pub dynamic: Option<u32>,
    /// Least displacement of the target with the paddle held still.
    #[serde(rename = "static")]
    pub fixture: Option<u32>,
}

/// The slice beside the body.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SliceInBody {
    /// What it is called: `y = 0.5, along the needle`.
    pub plane: String,
    /// Unit normal of the plane.
    pub normal: [f64; 3],
    /// The plane is normal·x = offset, length units.
    pub offset: f64,
    /// What fixes it.
    pub through: Through,
    /// Paddles that it does not have.
    pub left_out: Vec<LeftOut>,
    /// Its model.
    pub model: FittedModel,
    /// Its best paddles.
    pub optimum: BestPaddles,
    /// The target without help, in both.
    pub without_help: WithoutHelp,
    /// The insertion into the body with the body's best paddle (where the slice has it, else the slice's own) by the
    /// slice's table; none where it cannot be followed.
    pub closed_loop: Option<ClosedLoop>,
}

/// What a scene in space needs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceFit {
    /// Scene name.
    pub scene: String,
    /// 3.
    pub dimension: u32,
    /// Tissue.
    pub tissue: TissueVariant,
    /// Unit of length.
    pub length_unit: String,
    /// Relative error asked for.
    pub tolerance: f64,
    /// What is needed.
    pub verdict: SpaceVerdict,
    /// The body's model.
    pub body: FittedModel,
    /// The slice; none where there is none.
    pub slice: Option<SliceInBody>,
    /// Why there is none.
    pub slice_failure: Option<String>,
    /// The body's best single paddles.
    pub optimum: BestPaddles,
    /// Every paddle in both.
    pub paddles: Vec<PaddleInBoth>,
    /// The best single paddle to control.
    pub one: PaddleSet,
    /// The best pair to control; none where the scene has none.
    pub two: Option<PaddleSet>,
    /// Time of the fit itself, s.
    pub fit_wall_s: f64,
    /// The slice's scene file.
    #[serde(skip)]
    pub slice_text: Option<String>,
}

/// Fits dimension and number of paddles to a scene whose text is `text`. `begin` and `progress` are those of
/// [`SpaceStudy::run`].
///
/// # Errors
/// [`ModelError`](crate::ModelError) when the body cannot be modelled within the tolerance, or no paddle
/// controls the target. A slice that there is not, or that cannot be modelled, is a result.
pub fn fit_in_space(
    scene: &SpaceScene,
    text: &str,
    tolerance: f64,
    threads: usize,
    progress: (&dyn Fn(u64), &(dyn Fn() + Sync)),
) -> Result<SpaceFit, FitError> {
    let start = Instant::now();
    let quadratic = |tolerance: f64| {
        let mut wanted = scene.clone();
        wanted.discretization = Discretization::new(Resolution::Tolerance(tolerance), Method::new(Integration::FemT10));
        wanted
    };
    let run = |scene: &SpaceScene| SpaceStudy::run(scene, threads, progress.0, progress.1);
    let study = match scene.discretization.resolution {
        Resolution::Tolerance(_) => run(&quadratic(tolerance))?,
        Resolution::Spacing(_) | Resolution::Level(_) => run(scene)?,
    };
    let wanted = quadratic((SLICE_SHARE * tolerance).max(TIGHTEST));
    let best = |all: &[u32]| all.first().copied();
    let single = &study.placement.optimum_single;
    let optimum = BestPaddles { dynamic: best(&single.dynamic), fixture: best(&single.fixture) };
    let (one, two) = paddles::best_sets(&study)?;
    let sliced = sliced(&wanted, text, &from_the_best(&study), threads);
    let planar = sliced.as_ref().ok();
    let paddles = comparison::paddles(&study, planar.map(|(slice, planar)| (slice, planar)));
    let beside = planar.map(|(slice, planar)| beside(&study, slice, planar, optimum.dynamic)).transpose()?;
    let mut fit = SpaceFit {
        scene: scene.name.clone(),
        dimension: 3,
        tissue: scene.tissue(),
        length_unit: scene.length_unit.clone(),
        tolerance,
        verdict: SpaceVerdict::default(),
        body: model_in_space(&study),
        slice: beside,
        slice_failure: sliced.as_ref().err().cloned(),
        optimum,
        paddles,
        one,
        two,
        fit_wall_s: 0.0,
        slice_text: sliced.ok().map(|(slice, _)| slice.text),
    };
    fit.verdict = verdict::verdict(&fit);
    fit.fit_wall_s = start.elapsed().as_secs_f64();
    Ok(fit)
}

/// A slice held against the body, whose best paddle is `best`.
fn beside(
    study: &SpaceStudy,
    slice: &Slice,
    planar: &PlacementStudy,
    best: Option<u32>,
) -> Result<SliceInBody, FitError> {
    let (plane, own) = (&slice.plane, planar.placement.optimum);
    let has = |index: &u32| slice.scene.paddles.iter().any(|paddle| paddle.index == *index);
    let followed = best.filter(has).or(own.dynamic_paddle);
    let closed_loop = followed.map(|paddle| closed_loop::follow(study, slice, planar, paddle)).transpose()?;
    Ok(SliceInBody {
        plane: plane.name(&study.model.scene().length_unit).replace('\u{a0}', " "),
        normal: plane.normal.into(),
        offset: plane.offset,
        through: slice.through,
        left_out: slice.left_out.clone(),
        model: model_in_plane(planar),
        optimum: BestPaddles { dynamic: own.dynamic_paddle, fixture: Some(own.static_paddle) },
        without_help: comparison::without_help(study, slice, planar),
        closed_loop: closed_loop.flatten(),
    })
}

/// The slice through the best paddle and its study, or why there is none. Where that plane makes no slice, the first
/// that has the best paddle of those through the others, from the next best on; where none has, the first.
fn sliced(scene: &SpaceScene, text: &str, best: &[u32], threads: usize) -> Result<(Slice, PlacementStudy), String> {
    let mut first: Option<Result<Slice, SliceError>> = None;
    for paddle in best {
        match Slice::of(scene, text, Some(*paddle)) {
            Ok(slice) => {
                let has_best = slice.scene.paddles.iter().any(|paddle| Some(&paddle.index) == best.first());
                if has_best || !matches!(first, Some(Ok(_))) {
                    first = Some(Ok(slice));
                }
                if has_best {
                    break;
                }
            }
            // One plane alone.
            Err(SliceError::NotFree { .. }) => {
                first = Some(Slice::of(scene, text, None));
                break;
            }
            Err(error) => first = first.or(Some(Err(error))),
        }
    }
    let slice = first.unwrap_or(Err(SliceError::NoPaddle)).map_err(|error| error.to_string())?;
    let options = PlacementOptions { threads, ..PlacementOptions::default() };
    let study = PlacementStudy::run(&slice.scene, &options).map_err(|error| format!("the slice: {error}"))?;
    Ok((slice, study))
}

/// Paddles from the best to control on, by index.
fn from_the_best(study: &SpaceStudy) -> Vec<u32> {
    let mut all: Vec<_> = study.placement.paddles.iter().map(|p| (p.index, p.answer.controllability_measure)).collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    all.into_iter().map(|(index, _)| index).collect()
}

fn model_in_space(study: &SpaceStudy) -> FittedModel {
    let Discretization { resolution, method, .. } = study.model.scene().discretization;
    let found = study.error_estimate.as_ref();
    FittedModel {
        integration: method.integration,
        // Those of quadratic tetrahedra, which `fit` refines, are whole.
        level: found.map(|estimate| estimate.level as i32).or(match resolution {
            Resolution::Level(level) => Some(level),
            _ => None,
        }),
        nodes: study.model.nodes(),
        error_estimate: found.map(|estimate| estimate.controllability),
        cost_s: cost_in_space(&study.model),
        wall_s: study.wall_s,
    }
}

fn model_in_plane(study: &PlacementStudy) -> FittedModel {
    FittedModel {
        integration: study.model.planar().method().integration,
        level: study.error_estimate.map(|estimate| estimate.level),
        nodes: study.model.nodes(),
        error_estimate: study.error_estimate.map(|estimate| estimate.controllability),
        cost_s: cost(&study.model),
        wall_s: study.wall_s,
    }
}
