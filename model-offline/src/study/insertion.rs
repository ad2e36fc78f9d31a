//! Finite depth: the insertion by every method and law, and what one tick of it costs a simulator.

use super::candidates::base_spacing;
use super::extent::Extent;
use super::measurement::{Job, Linearity, Measurement, MeasurementFailure, ModelKind};
use crate::discretization::{Discretization, Integration, Method, Resolution};
use crate::material::{Law, Material};
use crate::model::{ModelError, TissueModel};
use crate::placement::rest::rest_responses;
use crate::placement::study::best_dynamic;
use crate::reduction::{Condensed, Invalid, TrainingOptions, train};
use crate::scene::Scene;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::Vector2;
use std::convert::Infallible;
use std::time::Instant;

/// Barrier over the stiffness at rest that gives a law without a mesh limit at finite depth one (the paper's law loses
/// stability the earlier, the finer its nodes are; with 0.3 of its stiffness every method reaches the whole depth at
/// every spacing).
const BARRIER_SHARE: f64 = 0.3;
/// Ticks over which a step is timed; the insertion is that many pieces.
const TICKS: u32 = 2000;

/// The scene itself if its law has a limit at finite depth under mesh refinement, else with a barrier added to the
/// body's law and the inclusions' own; and the barrier added, stress units.
///
/// # Errors
/// [`ModelError::Material`] when the law cannot take a barrier.
pub fn with_mesh_limit(scene: &Scene) -> Result<(Scene, Option<f64>), ModelError> {
    if scene.material.has_mesh_limit() {
        return Ok((scene.clone(), None));
    }
    let beta = BARRIER_SHARE * Material::<2>::rest_stiffness(&scene.material);
    let with = |material: &Law| {
        let own = BARRIER_SHARE * Material::<2>::rest_stiffness(material);
        material.clone().with_barrier(own)
    };
    let mut limited = scene.clone();
    limited.material = with(&scene.material)?;
    for inclusion in &mut limited.inclusions {
        if let Some(material) = &mut inclusion.material {
            *material = with(material)?;
        }
    }
    Ok((limited, Some(beta)))
}

/// Target displacements along the insertion, paddle by paddle, at every increment.
pub type Profile = Vec<Vec<Vector2<f64>>>;

/// The insertion by every method, and the fine one that they are held against.
pub(super) struct InsertionComparison {
    pub points: Vec<Measurement>,
    pub reference: Profile,
    /// Distance of the reference's two levels.
    pub open: f64,
    pub reference_nodes: usize,
}

/// Depths of the increments.
fn depths(scene: &Scene) -> impl Iterator<Item = f64> + '_ {
    let n = scene.needle.increments;
    (1..=n).map(move |k| scene.needle.depth * f64::from(k) / f64::from(n))
}

/// Follows the insertion with every paddle static.
///
/// # Errors
/// [`Failure`] of the first paddle that does not reach the depth.
pub fn profile(model: &TissueModel) -> Result<Profile, Failure> {
    (0..model.scene().paddles.len())
        .map(|paddle| {
            let mut body = model.body(Some(paddle), NewtonSettings::default())?;
            depths(model.scene())
                .map(|depth| body.drive(depth, Vector2::zeros()).map(|()| body.target_displacement()))
                .collect()
        })
        .collect()
}

/// The insertion as the linear law has it.
///
/// # Errors
/// [`ModelError`] when too little of the body is constrained.
pub fn linear_profile(model: &TissueModel) -> Result<Profile, ModelError> {
    let responses = rest_responses(model)?;
    Ok(responses.iter().map(|r| depths(model.scene()).map(|depth| r.target_per_depth * depth).collect()).collect())
}

/// Worst distance of two profiles over the largest displacement of the second.
pub fn profile_distance(a: &Profile, b: &Profile) -> f64 {
    let all = || a.iter().flatten().zip(b.iter().flatten());
    let largest = b.iter().flatten().map(Vector2::norm).fold(f64::MIN_POSITIVE, f64::max);
    all().map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / largest
}

/// Quadratic triangles on graded nodes.
fn fine(scene: &Scene, level: i32) -> Discretization {
    scene.discretization.with(Resolution::Level(level), Method::new(Integration::FemT6))
}

fn build(scene: &Scene, discretization: Discretization) -> Result<TissueModel, ModelError> {
    TissueModel::new(&scene.with_discretization(discretization))
}

/// Runs the insertion with each method, by the nonlinear law and by the linear one.
pub(super) fn insertion_points(scene: &Scene, extent: Extent) -> Result<InsertionComparison, ModelError> {
    let finest = extent.choose(2, 1);
    let model = build(scene, fine(scene, finest))?;
    let (reference, coarser) = (profile(&model)?, profile(&build(scene, fine(scene, finest - 1))?)?);
    let open = profile_distance(&coarser, &reference);
    let base = base_spacing(scene);
    let nodes: &[Resolution] = match extent {
        Extent::Quick => &[Resolution::Spacing(base), Resolution::Level(-2)],
        Extent::Full => &[
            Resolution::Spacing(base),
            Resolution::Spacing(0.5 * base),
            Resolution::Level(-2),
            Resolution::Level(-1),
            Resolution::Level(0),
        ],
    };
    let mut points = Vec::new();
    for &integration in Integration::PLANAR {
        for &nodes in nodes {
            let candidate = scene.discretization.with(nodes, Method::new(integration));
            for law in [Linearity::Nonlinear, Linearity::Linear] {
                let mut point = Measurement::new(Job::Insertion, candidate, law);
                let start = Instant::now();
                let outcome = build(scene, candidate).and_then(|model| {
                    (point.nodes, point.spacing) = (model.nodes(), model.spacing());
                    match law {
                        Linearity::Linear => linear_profile(&model),
                        Linearity::Nonlinear => Ok(profile(&model)?),
                    }
                });
                point.wall_s = start.elapsed().as_secs_f64();
                match outcome {
                    Ok(profile) => point.error_static = profile_distance(&profile, &reference),
                    Err(error) => point.failure = Some(error.into()),
                }
                points.push(point);
            }
        }
    }
    Ok(InsertionComparison { points, reference, open, reference_nodes: model.nodes() })
}

/// Times one tick of a simulated insertion with each kind of plant.
pub(super) fn step_points(scene: &Scene, extent: Extent, reference: &Profile) -> Result<Vec<Measurement>, ModelError> {
    let base = base_spacing(scene);
    let mut candidates =
        vec![scene.discretization.with(Resolution::Spacing(base), Method::new(Integration::Scni)), fine(scene, -2)];
    if extent == Extent::Full {
        candidates.push(fine(scene, 0));
    }
    let mut points = Vec::new();
    for candidate in candidates {
        let model = build(scene, candidate)?;
        let index = best_dynamic(&model)?;
        let paddle = model.scene().paddle_position(index)?;
        let reference = vec![reference[paddle].clone()];
        let ticks = extent.choose(TICKS, 200);
        let mut body = model.body(Some(paddle), NewtonSettings::SMALL_STEPS)?;
        let full = time_ticks(scene, ticks, |depth| -> Result<_, Failure> {
            body.drive(depth, Vector2::zeros())?;
            Ok(body.target_displacement())
        });
        let empty = Measurement::new(Job::Step, candidate, Linearity::Nonlinear);
        let empty = Measurement { nodes: model.nodes(), spacing: model.spacing(), ..empty };
        points.push(timed(empty.clone(), &reference, full));
        points.push(reduced_point(scene, &model, paddle, &reference, empty.clone()));
        let condensed = std::hint::black_box(Condensed::new(&model, Some(paddle))?);
        let linear = time_ticks(scene, TICKS, |depth| -> Result<_, Infallible> {
            Ok(condensed.target_displacement(std::hint::black_box(depth), Vector2::zeros()))
        });
        let empty = Measurement { model_kind: ModelKind::Condensed, law: Linearity::Linear, ..empty };
        points.push(timed(empty, &reference, linear));
    }
    Ok(points)
}

/// One tick of a model reduced with the usual options.
fn reduced_point(
    scene: &Scene,
    model: &TissueModel,
    paddle: usize,
    reference: &Profile,
    empty: Measurement,
) -> Measurement {
    let empty = Measurement { model_kind: ModelKind::Reduced, ..empty };
    match train(model, Some(paddle), &TrainingOptions::default()) {
        Ok((reduced, _)) => {
            let mut body = reduced.body();
            let measured = time_ticks(scene, TICKS, |depth| -> Result<_, Invalid> {
                body.drive(depth, Vector2::zeros())?;
                Ok(body.target_displacement())
            });
            timed(empty, reference, measured)
        }
        Err(error) => Measurement { failure: Some(error.into()), ..empty },
    }
}

/// A point with its time and error, or with why it has none.
fn timed<E: Into<MeasurementFailure>>(
    mut point: Measurement,
    reference: &Profile,
    measured: Result<(f64, Profile), E>,
) -> Measurement {
    match measured {
        Ok((wall_s, profile)) => {
            point.wall_s = wall_s;
            point.error_static = profile_distance(&profile, reference);
        }
        Err(error) => point.failure = Some(error.into()),
    }
    point
}

/// Mean time of a tick over the insertion, best of three, and the displacements at the increments' depths.
///
/// # Errors
/// That of the first step that fails.
pub(super) fn time_ticks<E>(
    scene: &Scene,
    ticks: u32,
    mut step: impl FnMut(f64) -> Result<Vector2<f64>, E>,
) -> Result<(f64, Profile), E> {
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        step(0.0)?;
        let start = Instant::now();
        for tick in 1..=ticks {
            std::hint::black_box(step(scene.needle.depth * f64::from(tick) / f64::from(ticks))?);
        }
        best = best.min(start.elapsed().as_secs_f64() / f64::from(ticks));
    }
    let profile = depths(scene).map(step).collect::<Result<Vec<_>, _>>()?;
    Ok((best, vec![profile]))
}
