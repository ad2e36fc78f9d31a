//! The placement study in space: every paddle and every pair of them, static and dynamic.

use super::controllability::Controllability;
use super::insertion::InsertionModel;
use super::rest::{SpaceResponse, all_sets};
use crate::model::ModelError;
use crate::model::space::SpaceModel;
use crate::parallel;
use crate::placement::fixture::{self, Fixture};
use crate::placement::study::StaticFailure;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::{DMatrix, Vector3};
use serde::Serialize;

/// The insertion with static paddles: attached, and held still.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SpaceStatic {
    /// Needle depths, from the first increment.
    pub depth: Vec<f64>,
    /// Target displacement at these depths.
    pub target_displacement: Vec<[f64; 3]>,
    /// Length of its part orthogonal to the needle.
    pub orthogonal: Vec<f64>,
    /// Its part along the needle.
    pub axial: Vec<f64>,
    /// Largest orthogonal displacement.
    pub max_orthogonal: f64,
    /// Estimated errors of `orthogonal` because what is not linear in the depth is of a coarser model.
    pub nonlinear_error: Vec<f64>,
    /// How far the needle got.
    pub reached_depth: f64,
    /// Why it stopped there; none when it reached the full depth.
    pub failure: Option<StaticFailure>,
}

impl SpaceStatic {
    /// Largest orthogonal displacement over that of another insertion, to the depth that both reached; none where they
    /// have no depth in common, or the other one does not move the target.
    pub fn over(&self, other: &Self) -> Option<f64> {
        fixture::over(&self.orthogonal, &other.orthogonal)
    }

    /// Largest orthogonal displacement of the first increments, with its estimated error, where the response at rest is off by
    /// `per_depth`; the largest may be at another depth than it seems.
    pub fn largest(&self, increments: usize, per_depth: f64) -> (f64, f64) {
        let errors = self.depth.iter().zip(&self.nonlinear_error).map(|(depth, error)| per_depth * depth + error);
        let of_all = self.orthogonal.iter().copied().zip(errors).take(increments);
        let (largest, its_error) = of_all.clone().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
        let at_most = of_all.map(|(orthogonal, error)| orthogonal + error).fold(0.0, f64::max);
        (largest, its_error.max(at_most - largest))
    }
}

/// What paddles do together, one or two of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceAnswer {
    /// Actuation Jacobian at zero depth, needle held: rows target x, y, z, three columns per paddle.
    pub jacobian: Vec<Vec<f64>>,
    /// Condition number of NᵀJ.
    pub condition: f64,
    /// 1/σ_min(NᵀJ), the target's motion along the needle left free; infinite (`null` in JSON) where the target cannot be
    /// controlled.
    pub controllability_measure: f64,
    /// ‖J⁺N‖₂, no motion along the needle allowed; infinite (`null`) where that cannot be had.
    pub controllability_full: f64,
    /// 1/σ_max(NᵀJ): the same in the easiest direction.
    pub controllability_easiest: f64,
    /// Orthogonal direction in which `controllability_measure` is reached.
    pub worst_direction: [f64; 3],
    /// d(target displacement)/d(depth) at zero depth, paddles held.
    pub target_per_depth: [f64; 3],
    /// The insertion with these paddles static.
    #[serde(rename = "static")]
    pub static_study: SpaceStatic,
}

/// One paddle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpacePaddleResult {
    /// Paddle index, as in the scene.
    pub index: u32,
    /// What it does.
    #[serde(flatten)]
    pub answer: SpaceAnswer,
}

/// Two paddles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpacePairResult {
    /// Their indices, as in the scene.
    pub paddles: [u32; 2],
    /// What they do.
    #[serde(flatten)]
    pub answer: SpaceAnswer,
}

/// The insertion without a paddle: what every paddle is held against.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceNoPaddle {
    /// d(target displacement)/d(depth) at zero depth.
    pub target_per_depth: [f64; 3],
    /// The insertion.
    #[serde(rename = "static")]
    pub static_study: SpaceStatic,
}

/// The best for each approach, by index.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SpaceOptimum {
    /// Smallest largest orthogonal displacement.
    #[serde(rename = "static")]
    pub fixture: Vec<u32>,
    /// Smallest controllability measure; empty where nothing controls the target.
    pub dynamic: Vec<u32>,
}

/// A whole placement study.
#[derive(Debug, Clone, PartialEq)]
pub struct SpacePlacement {
    /// Results by paddle, in the scene's order.
    pub paddles: Vec<SpacePaddleResult>,
    /// Results by pair, in the scene's order.
    pub pairs: Vec<SpacePairResult>,
    /// The insertion without a paddle.
    pub no_paddle: SpaceNoPaddle,
    /// The best pairs of paddles that do not overlap; the best paddles where there are none.
    pub optimum: SpaceOptimum,
    /// The best single paddles.
    pub optimum_single: SpaceOptimum,
    /// Nodes of the model on which the insertion was followed to depth.
    pub profile_nodes: usize,
}

impl SpacePlacement {
    /// What paddles, then pairs do, in the scene's order, with their indices.
    pub fn sets(&self) -> impl Iterator<Item = (&[u32], &SpaceAnswer)> {
        let singles = self.paddles.iter().map(|paddle| (std::slice::from_ref(&paddle.index), &paddle.answer));
        singles.chain(self.pairs.iter().map(|pair| (&pair.paddles[..], &pair.answer)))
    }

    /// Insertions with paddles, then pairs, then none held still, by place in this order.
    pub fn static_study(&self, set: usize) -> Option<&SpaceStatic> {
        self.sets().map(|(_, answer)| &answer.static_study).chain([&self.no_paddle.static_study]).nth(set)
    }

    /// Number of sets; the place of none.
    pub fn without(&self) -> usize {
        self.paddles.len() + self.pairs.len()
    }
}

/// Number of times [`place_in_space`] calls its progress function.
pub fn steps(model: &SpaceModel) -> u64 {
    all_sets(model).len() as u64 * u64::from(model.scene().needle.increments)
}

/// Studies every paddle and pair of a scene: as accurately as its model of insertions answers at rest, along the insertion with
/// what the law's nonlinearity adds on that.
///
/// # Errors
/// [`ModelError`] when the body at rest cannot be solved. A static run that stops early and paddles that cannot control the
/// target are results, not errors.
pub fn place_in_space(
    insertions: &InsertionModel,
    threads: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<SpacePlacement, ModelError> {
    let (model, rest) = (insertions.accurate(), insertions.rest());
    let (scene, sets) = (model.scene(), all_sets(model));
    insertions.prepare();
    let studies = parallel::map(sets.len(), threads, |s| follow(insertions, &sets[s], progress));
    let mut studies = studies.into_iter().collect::<Result<Vec<_>, _>>()?;
    let without = studies.pop().unwrap_or_default();
    let mut answers = rest.iter().zip(studies).map(|(rest, study)| answer(rest, study));
    let paddles: Vec<SpacePaddleResult> = scene
        .paddles
        .iter()
        .zip(answers.by_ref())
        .map(|(paddle, answer)| SpacePaddleResult { index: paddle.index, answer })
        .collect();
    let pairs: Vec<SpacePairResult> = scene
        .pairs
        .iter()
        .zip(answers)
        .map(|(pair, answer)| SpacePairResult { paddles: pair.map(|p| scene.paddles[p].index), answer })
        .collect();
    let axis = scene.needle.axis;
    let optimum_single = best(paddles.iter().map(|p| (vec![p.index], &p.answer)), axis);
    // Two paddles cannot be in one place.
    let apart = |pair: &[usize; 2]| !model.overlapping().contains(pair);
    let apart: Vec<&SpacePairResult> =
        scene.pairs.iter().zip(&pairs).filter(|(pair, _)| apart(pair)).map(|(_, result)| result).collect();
    let optimum = match apart.is_empty() {
        true => optimum_single.clone(),
        false => best(apart.iter().map(|p| (p.paddles.to_vec(), &p.answer)), axis),
    };
    let per_depth = rest.last().map_or_else(Vector3::zeros, |r| r.target_per_depth);
    let no_paddle = SpaceNoPaddle { target_per_depth: per_depth.into(), static_study: without };
    Ok(SpacePlacement { paddles, pairs, no_paddle, optimum, optimum_single, profile_nodes: insertions.nodes() })
}

fn answer(rest: &SpaceResponse, static_study: SpaceStatic) -> SpaceAnswer {
    let controls = rest.controllability.unwrap_or(Controllability::NONE);
    SpaceAnswer {
        jacobian: rows(&rest.jacobian),
        condition: controls.condition,
        controllability_measure: controls.measure,
        controllability_full: controls.full,
        controllability_easiest: controls.easiest,
        worst_direction: controls.worst_direction.into(),
        target_per_depth: rest.target_per_depth.into(),
        static_study,
    }
}

fn rows(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Where a field is off by a small share, what is of second order in it is by twice that; and twice again, because what was left to
/// meshes of five to eight times the nodes, which are off themselves, was up to 2.5 times that share (`block`, `mound`, two more bodies).
const BEYOND_REST: f64 = 4.0;

/// Follows the insertion at the scene's increments with some paddles attached and still, until it stops.
///
/// To first order in the depth the model that goes deep answers as the accurate one; what it adds to that is off, and is judged by how
/// far its own answer at rest is.
fn follow(
    insertions: &InsertionModel,
    attached: &[usize],
    progress: &(dyn Fn() + Sync),
) -> Result<SpaceStatic, ModelError> {
    let needle = &insertions.scene().needle;
    let axis = needle.axis;
    // As on graded nodes in the plane: where the law loses its stability matters to an eighth of an increment.
    let mut body = insertions.body(attached, NewtonSettings { max_cutbacks: 3, ..NewtonSettings::default() })?;
    let still = vec![Vector3::zeros(); attached.len()];
    let mut study = SpaceStatic::default();
    let rest = insertions.rest_of(attached)?.fixed_view::<3, 1>(0, 0).into_owned();
    let beside = body.beside().map_or_else(Vector3::zeros, |beside| beside.column(0).into_owned());
    let off = if beside.norm() < rest.norm() { beside.norm() / rest.norm() } else { 1.0 };
    for increment in 1..=needle.increments {
        progress();
        let depth = needle.depth * f64::from(increment) / f64::from(needle.increments);
        match body.drive(depth, &still) {
            Ok(()) => {
                let displacement = body.target_displacement();
                let axial = displacement.dot(&needle.axis);
                let orthogonal = (displacement - needle.axis * axial).norm();
                study.depth.push(depth);
                study.target_displacement.push(displacement.into());
                study.orthogonal.push(orthogonal);
                study.axial.push(axial);
                let nonlinear = axis.cross(&(displacement - rest * depth)).norm();
                study.nonlinear_error.push(BEYOND_REST * off * nonlinear);
                study.max_orthogonal = study.max_orthogonal.max(orthogonal);
                study.reached_depth = depth;
            }
            Err(Failure { reason, detail, .. }) => {
                study.reached_depth = body.depth();
                study.failure = Some(StaticFailure { reason, depth: body.depth(), detail });
                break;
            }
        }
    }
    Ok(study)
}

/// The best of some: as a [fixture](fixture::best), and to control the target.
fn best<'a>(candidates: impl Iterator<Item = (Vec<u32>, &'a SpaceAnswer)>, axis: Vector3<f64>) -> SpaceOptimum {
    let all: Vec<(Vec<u32>, &SpaceAnswer)> = candidates.collect();
    let fixtures: Vec<Fixture<'_>> = all
        .iter()
        .map(|(_, answer)| Fixture {
            stopped: answer.static_study.failure.as_ref().map(|failure| failure.depth),
            orthogonal: &answer.static_study.orthogonal,
            per_depth: axis.cross(&Vector3::from(answer.target_per_depth)).norm(),
        })
        .collect();
    let controlling = all.iter().filter(|(_, answer)| answer.controllability_measure.is_finite());
    let dynamic = controlling.min_by(|a, b| a.1.controllability_measure.total_cmp(&b.1.controllability_measure));
    let named = |found: Option<&(Vec<u32>, &SpaceAnswer)>| found.map_or_else(Vec::new, |(name, _)| name.clone());
    SpaceOptimum { fixture: named(fixture::best(&fixtures).map(|place| &all[place])), dynamic: named(dynamic) }
}
