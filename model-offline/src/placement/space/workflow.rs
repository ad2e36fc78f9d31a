//! From a scene in space to a placement: mesh, refine if a tolerance is asked for, study every paddle and pair.
//!
//! A model's error is estimated against quadratic tetrahedra whose middle nodes at the rims of patches have the solution's own
//! √r ([`TetElements`](crate::discretization::tetrahedra::TetElements)); their own error is estimated by the next coarser mesh. From a mesh to
//! the one with half the size at the rims it falls by at least a half, so that the difference of the two is no less than what
//! is left; it is taken times [`SAFETY`].

use super::insertion::InsertionModel;
use super::rest::{SpaceResponse, rest_responses};
use super::study::{SpacePlacement, place_in_space, steps};
use crate::discretization::{Integration, Method, Resolution, TetMesh};
use crate::model::space::SpaceModel;
use crate::model::space::meshing::{MeshSize, even_mesh, mesh};
use crate::model::{DecidedBy, ModelError};
use crate::parallel;
use crate::scene::space::SpaceScene;
use crate::solver::equilibrium::{Failure, FailureReason};
use serde::Serialize;
use std::time::Instant;

/// A mesh is finer than another where every patch has so many times its nodes.
const GROWN: f64 = 1.3;
/// What a difference of two meshes is multiplied by.
pub const SAFETY: f64 = 1.5;
/// Share of the tolerance that the reference of another method may leave open.
const REFERENCE_SHARE: f64 = 0.5;
/// Estimated error of the measures that insertions leave open at rest, at most. On the bundled scenes meshes that claim it are 0.8 % (`block`),
/// 1.5 % (`scan`) and less than 3.8 % (`mound`) off; each further halving costs four times as much, and feedback makes up for it.
const AT_REST: f64 = 0.15;
/// Levels that refinement begins with, and ends with.
const LEVELS: std::ops::RangeInclusive<i32> = 0..=5;
/// Nodes of the largest model that is refined to, a minute or two and about 8 GB: nodal rules couple a few hundred neighbours,
/// elements a few dozen.
const MOST_NODES: usize = 20_000;
const MOST_ELEMENT_NODES: usize = 120_000;

/// What a refinement found out about its own error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceErrorEstimate {
    /// Estimated worst relative error of the controllability measures, of paddles and pairs.
    pub controllability: f64,
    /// The same by paddle, then by pair, in the scene's order.
    pub by_set: Vec<f64>,
    /// The part of it that the reference leaves open; the whole where the model is its own.
    pub reference: f64,
    /// Nodes of the reference.
    pub reference_nodes: usize,
    /// Refinement level that was accepted.
    pub level: i32,
}

/// A placement in space with everything that is known about it.
#[derive(Debug)]
pub struct SpaceStudy {
    /// The model that the Jacobians are of.
    pub model: SpaceModel,
    /// What the study found.
    pub placement: SpacePlacement,
    /// Estimated error, where the scene asks for a tolerance.
    pub error_estimate: Option<SpaceErrorEstimate>,
    /// Time that it took, s.
    pub wall_s: f64,
}

/// A discretised scene with its responses at rest and, where it asks for a tolerance, the estimated error.
#[derive(Debug)]
pub struct Discretised {
    /// The model.
    pub model: SpaceModel,
    /// Responses of every paddle, then every pair, then without any.
    pub rest: Vec<SpaceResponse>,
    /// Estimated error.
    pub estimate: Option<SpaceErrorEstimate>,
}

impl SpaceStudy {
    /// Discretises the scene at its resolution and studies every paddle and pair. `progress` is told how many steps there are,
    /// and then called for each.
    ///
    /// # Errors
    /// [`ModelError`] when the scene cannot be modelled, its tolerance not be reached, or a Jacobian not be computed.
    pub fn run(
        scene: &SpaceScene,
        threads: usize,
        begin: &dyn Fn(u64),
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self, ModelError> {
        let start = Instant::now();
        let Discretised { model, rest, estimate: error_estimate } = parallel::within(threads, || discretise(scene))?;
        begin(steps(&model));
        let insertions = InsertionModel::new(scene, coarse(scene)?, model.clone(), rest);
        let placement = place_in_space(&insertions, threads, progress)?;
        Ok(Self { model, placement, error_estimate, wall_s: start.elapsed().as_secs_f64() })
    }
}

/// Discretises a scene at its spacing or level, or refines it to its tolerance.
///
/// # Errors
/// [`ModelError`], among them [`ModelError::ToleranceNotReached`] with the estimate that was reached.
pub fn discretise(scene: &SpaceScene) -> Result<Discretised, ModelError> {
    let (mesh, tolerance) = match scene.discretization.resolution {
        Resolution::Spacing(spacing) => (even_mesh(scene, spacing)?, None),
        Resolution::Level(level) => (mesh(scene, &MeshSize::level(level))?, None),
        Resolution::Tolerance(tolerance) => (Default::default(), Some(tolerance)),
    };
    if let Some(tolerance) = tolerance {
        return refine(scene, tolerance);
    }
    let model = SpaceModel::on(scene, &mesh)?;
    Ok(Discretised { rest: rest_responses(&model)?, model, estimate: None })
}

/// The model of a scene at its spacing or level, with its responses at rest; not if that is too large to be factorised.
///
/// # Errors
/// [`ModelError`], as of [`discretise`], and [`ModelError::TooManyNodes`].
pub fn at_resolution(scene: &SpaceScene) -> Result<(SpaceModel, Vec<SpaceResponse>), ModelError> {
    match scene.discretization.resolution {
        Resolution::Spacing(spacing) => answering(scene, &even_mesh(scene, spacing)?),
        Resolution::Level(level) => at_level(scene, level),
        Resolution::Tolerance(_) => discretise(scene).map(|found| (found.model, found.rest)),
    }
}

/// Index of the single paddle that controls the target best, at rest, by the scene's own discretization.
///
/// # Errors
/// [`ModelError`], as of [`at_resolution`], and [`ModelError::NoPaddleControls`].
pub fn best_single(scene: &SpaceScene) -> Result<u32, ModelError> {
    let (_, rest) = at_resolution(scene)?;
    let singles =
        scene.paddles.iter().zip(&rest).filter_map(|(paddle, r)| Some((paddle.index, r.controllability?.measure)));
    let best = singles.filter(|(_, measure)| measure.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1));
    best.map(|(index, _)| index).ok_or(ModelError::NoPaddleControls)
}

/// The model of a scene at its spacing or level, or at the tolerance that it was refined to.
///
/// # Errors
/// [`ModelError`], as of [`discretise`].
pub fn model(scene: &SpaceScene) -> Result<SpaceModel, ModelError> {
    match scene.discretization.resolution {
        Resolution::Spacing(spacing) => SpaceModel::on(scene, &even_mesh(scene, spacing)?),
        Resolution::Level(level) => SpaceModel::on(scene, &mesh(scene, &MeshSize::level(level))?),
        Resolution::Tolerance(_) => Ok(discretise(scene)?.model),
    }
}

fn at_level(scene: &SpaceScene, level: i32) -> Result<(SpaceModel, Vec<SpaceResponse>), ModelError> {
    answering(scene, &mesh(scene, &MeshSize::level(level))?)
}

/// Whether the model of a mesh can be factorised within minutes.
///
/// # Errors
/// [`ModelError::TooManyNodes`].
pub fn affordable(integration: Integration, mesh: &TetMesh) -> Result<(), ModelError> {
    let limit = if integration.is_element() { MOST_ELEMENT_NODES } else { MOST_NODES };
    // A tetrahedron more brings about seven thirds of a middle node.
    let nodes = if integration == Integration::FemT10 { 7 * mesh.nodes.len() } else { mesh.nodes.len() };
    if nodes > limit { Err(ModelError::TooManyNodes { nodes, limit }) } else { Ok(()) }
}

/// A model of a mesh with its responses at rest, unless it is too large to be factorised.
fn answering(scene: &SpaceScene, mesh: &TetMesh) -> Result<(SpaceModel, Vec<SpaceResponse>), ModelError> {
    affordable(scene.discretization.method.integration, mesh)?;
    let model = SpaceModel::on(scene, mesh)?;
    let rest = rest_responses(&model)?;
    Ok((model, rest))
}

/// Relative distances of the controllability measures, by paddle and pair; 0 where neither controls the target, infinite where
/// one does.
pub fn distances(found: &[SpaceResponse], reference: &[SpaceResponse]) -> Vec<f64> {
    let measure = |response: &SpaceResponse| response.controllability.map(|c| c.measure);
    let pairs = found.iter().zip(reference).filter_map(|(a, b)| measure(a).zip(measure(b)));
    pairs.map(|(a, b)| distance(a, b)).collect()
}

fn distance(found: f64, reference: f64) -> f64 {
    match [found, reference].map(f64::is_infinite) {
        [true, true] => 0.0,
        [false, false] => (found / reference - 1.0).abs(),
        _ => f64::INFINITY,
    }
}

/// What is left open on the finer of two meshes whose answers are so far apart. Two meshes may agree by accident (the pair 1 + 2 of
/// `block` does): nothing is taken to be better than the median.
fn estimates(distances: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = distances.iter().copied().filter(|d| d.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    distances.iter().map(|d| SAFETY * d.max(median)).collect()
}

/// Indices of the paddles of every set that has a measure: of singles, then of pairs.
fn sets(scene: &SpaceScene) -> impl Iterator<Item = Vec<u32>> {
    let index = |at: usize| scene.paddles[at].index;
    let singles = (0..scene.paddles.len()).map(move |paddle| vec![index(paddle)]);
    singles.chain(scene.pairs.iter().map(move |pair| pair.map(index).to_vec()))
}

/// Whose estimate decides. Of equal estimates, as those that the median has raised, the one whose answers are farther apart.
fn decided_by(scene: &SpaceScene, estimates: &[f64], apart: &[f64]) -> DecidedBy {
    let mut all: Vec<_> = sets(scene).zip(estimates).zip(apart).collect();
    all.sort_by(|a, b| b.1.total_cmp(a.1));
    DecidedBy::measures(all.into_iter().map(|((paddles, &estimate), _)| (paddles, estimate)), None)
}

/// The best estimate that a refinement has come to, and whose it is.
type Best = Option<(f64, DecidedBy)>;

fn worst(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

/// Quadratic tetrahedra on finer and finer meshes, until their own estimate is within `open`.
struct Reference {
    model: SpaceModel,
    rest: Vec<SpaceResponse>,
    errors: Vec<f64>,
    level: i32,
}

impl Reference {
    fn within(scene: &SpaceScene, open: f64) -> Result<Self, ModelError> {
        let scene = scene.with_method(Method::new(Integration::FemT10));
        let mut best: Best = None;
        let mut coarser: Option<(Vec<usize>, Vec<SpaceResponse>)> = None;
        let (mut failed, mut memory) = (None, None);
        for level in *LEVELS.start() - 1..=*LEVELS.end() {
            let (model, rest) = match at_level(&scene, level) {
                Ok(found) => found,
                // The coarsest meshes may not see every patch, the finest may not be affordable.
                Err(error) if error.is_too_large() && coarser.is_some() => {
                    memory = error.missing_memory();
                    break;
                }
                Err(_) if coarser.is_none() && level <= *LEVELS.start() => continue,
                // One level may meet what is near a surface badly where the next does not.
                Err(error @ ModelError::Mesh(_)) => {
                    failed = Some(error);
                    continue;
                }
                Err(error) => return Err(error),
            };
            let on_patches = model.nodes_on_patches();
            if let Some((before, coarser)) = &coarser {
                // Where a level's sizes change nothing on a patch, nothing is learnt of it: two answers with one error
                // agree.
                if before.iter().zip(&on_patches).any(|(before, now)| (*now as f64) < GROWN * *before as f64) {
                    continue;
                }
                let apart = distances(coarser, &rest);
                let errors = estimates(&apart);
                let estimate = worst(&errors);
                if estimate <= open {
                    return Ok(Self { model, rest, errors, level });
                }
                if best.as_ref().is_none_or(|best| estimate < best.0) {
                    best = Some((estimate, decided_by(&scene, &errors, &apart)));
                }
            }
            coarser = Some((on_patches, rest));
        }
        // Without an estimate, no two meshes that could be afforded differ on every patch.
        Err(match best {
            Some((reached, decided_by)) => {
                ModelError::ToleranceNotReached { tolerance: open, reached, decided_by, memory }
            }
            None => match memory {
                Some(detail) => Failure { reason: FailureReason::TooLarge, reached: 0.0, detail }.into(),
                None => failed.unwrap_or(ModelError::NothingToCompare),
            },
        })
    }
}

/// What a reference that fails its share of a tolerance says of the whole: what was asked for, and what could have been kept.
fn of_the_whole(error: ModelError, tolerance: f64) -> ModelError {
    match error {
        ModelError::ToleranceNotReached { reached, decided_by, memory, .. } => {
            let whole = 1.0 / REFERENCE_SHARE;
            ModelError::ToleranceNotReached {
                tolerance,
                reached: whole * reached,
                decided_by: decided_by.scaled(whole),
                memory,
            }
        }
        other => other,
    }
}

fn refine(scene: &SpaceScene, tolerance: f64) -> Result<Discretised, ModelError> {
    let method = scene.discretization.method;
    if method.integration == Integration::FemT10 {
        let Reference { model, rest, errors, level } = Reference::within(scene, tolerance)?;
        let controllability = worst(&errors);
        let estimate = SpaceErrorEstimate {
            controllability,
            by_set: errors,
            reference: controllability,
            reference_nodes: model.nodes(),
            level,
        };
        return Ok(Discretised { model, rest, estimate: Some(estimate) });
    }
    let reference =
        Reference::within(scene, REFERENCE_SHARE * tolerance).map_err(|error| of_the_whole(error, tolerance))?;
    let (mut best, mut memory): (Best, _) = (None, None);
    let mut level = *LEVELS.start();
    while level <= *LEVELS.end() {
        let (model, rest) = match at_level(scene, level) {
            Ok(found) => found,
            Err(error) if error.is_too_large() && best.is_some() => {
                memory = error.missing_memory();
                break;
            }
            Err(error) => return Err(error),
        };
        let apart = distances(&rest, &reference.rest);
        let errors: Vec<f64> = apart.iter().zip(&reference.errors).map(|(a, open)| a + open).collect();
        let controllability = worst(&errors);
        if controllability <= tolerance {
            let estimate = SpaceErrorEstimate {
                controllability,
                by_set: errors,
                reference: worst(&reference.errors),
                reference_nodes: reference.model.nodes(),
                level,
            };
            return Ok(Discretised { model, rest, estimate: Some(estimate) });
        }
        if best.as_ref().is_none_or(|best| controllability < best.0) {
            best = Some((controllability, decided_by(scene, &errors, &apart)));
        }
        // The error falls with the size at the rims, which a level halves: levels that cannot do are not tried.
        let left = worst(&apart) / (tolerance - worst(&reference.errors));
        level += (left.log2().floor() as i32).clamp(1, 2);
    }
    let (reached, decided_by) = best.unwrap_or((f64::INFINITY, DecidedBy::Whole));
    Err(ModelError::ToleranceNotReached { tolerance, reached, decided_by, memory })
}

/// The model of a scene's insertions. At rest it answers as the scene's own discretization does; where that is given by a tolerance
/// alone, as quadratic tetrahedra within it or within an estimated 15 %, which is far above what is left.
///
/// # Errors
/// [`ModelError`], as of [`discretise`].
pub fn insertion_model(scene: &SpaceScene) -> Result<InsertionModel, ModelError> {
    let mut wanted = scene.clone();
    if let Resolution::Tolerance(tolerance) = wanted.discretization.resolution {
        wanted = wanted.with_method(Method::new(Integration::FemT10));
        wanted.discretization.resolution = Resolution::Tolerance(tolerance.max(AT_REST));
    }
    let Discretised { model, rest, .. } = discretise(&wanted)?;
    Ok(InsertionModel::new(scene, coarse(scene)?, model, rest))
}

/// The model that insertions are followed on. Linear tetrahedra on the coarsest mesh that sees every patch: they cost a tenth of any
/// other method, and go as deep as it.
///
/// # Errors
/// [`ModelError`] when no mesh sees every patch.
pub fn coarse(scene: &SpaceScene) -> Result<SpaceModel, ModelError> {
    let scene = scene.with_method(Method::new(Integration::FemT4));
    let mut outcome = Err(ModelError::NoPaddleControls);
    for level in LEVELS {
        outcome = mesh(&scene, &MeshSize::level(level)).and_then(|mesh| SpaceModel::on(&scene, &mesh));
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_are_as_far_apart_one_way_as_the_other() {
        assert_eq!(distance(f64::INFINITY, f64::INFINITY), 0.0);
        assert!((distance(1.1, 1.0) - 0.1).abs() < 1e-12);
        // One says that the target is controlled, and the other that it is not.
        assert_eq!([distance(f64::INFINITY, 2.0), distance(2.0, f64::INFINITY)], [f64::INFINITY; 2]);
        let with = |measure: f64| SpaceResponse {
            jacobian: nalgebra::DMatrix::zeros(3, 3),
            target_per_depth: nalgebra::Vector3::zeros(),
            controllability: Some(crate::placement::space::Controllability { measure, ..unit() }),
        };
        let nobody = SpaceResponse { controllability: None, ..with(1.0) };
        let found = distances(&[with(1.5), with(f64::INFINITY), nobody.clone()], &[with(1.0), with(3.0), nobody]);
        assert_eq!(found, [0.5, f64::INFINITY]);
    }

    fn unit() -> crate::placement::space::Controllability {
        let n = nalgebra::Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        crate::placement::space::Controllability::of(&nalgebra::DMatrix::identity(3, 3), &n)
    }

    /// `block` has eight paddles and pairs of them.
    #[test]
    fn the_set_that_is_farthest_apart_decides() {
        let scene = SpaceScene::bundled("block").unwrap();
        let all: Vec<Vec<u32>> = sets(&scene).collect();
        let mut apart = vec![0.01; all.len()];
        apart[3] = 0.05;
        let last = all.len() - 1;
        apart[last] = 0.07;
        let decided = decided_by(&scene, &estimates(&apart), &apart);
        assert_eq!(decided, DecidedBy::Measure { paddles: all[last].clone(), others: Some(1.5 * 0.05) });
        // Of two sets the median is the larger distance: both have one estimate, and the second has caused it.
        let mut two = scene.clone();
        two.paddles.truncate(2);
        two.pairs.clear();
        let apart = [0.01, 0.03];
        let found = estimates(&apart);
        assert_eq!(found[0], found[1]);
        let DecidedBy::Measure { paddles, others } = decided_by(&two, &found, &apart) else { panic!() };
        assert_eq!((paddles, others), (vec![two.paddles[1].index], Some(found[0])));
        // One mesh says that the second paddle controls the target, and the other that it does not; the first agrees.
        let apart = [0.01, f64::INFINITY];
        let decided_by = decided_by(&two, &estimates(&apart), &apart);
        let told = ModelError::ToleranceNotReached { tolerance: 0.1, reached: f64::INFINITY, decided_by, memory: None }
            .to_string();
        assert!(
            told.contains("the best estimate is infinite (of the measure of paddle 2; 0.015 of all else)"),
            "{told}"
        );
    }

    #[test]
    fn a_reference_that_fails_its_half_is_told_as_the_tolerance_that_was_asked_for() {
        let decided_by = DecidedBy::Measure { paddles: vec![2, 5], others: Some(0.001) };
        let memory = Some("to factorise 9 unknowns".to_owned());
        let of_half = ModelError::ToleranceNotReached { tolerance: 0.002, reached: 0.0057, decided_by, memory };
        let told = of_the_whole(of_half, 0.004);
        let ModelError::ToleranceNotReached { tolerance, reached, .. } = &told else { panic!("{told}") };
        assert!(*tolerance == 0.004 && (reached - 0.0114).abs() < 1e-12, "{tolerance} {reached}");
        let text = told.to_string();
        assert!(
            text.contains(
                "0.0114 (of the measure of paddles 2 + 5; 0.002 of all else); a finer model did not fit into memory (to factorise \
                 9 unknowns); take a larger tolerance, leave that pair out of the scene, or"
            ),
            "{text}"
        );
    }
}
