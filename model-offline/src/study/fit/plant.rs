//! What a simulator should solve, and how far that is from a finer model.

use super::LAW_NODES;
use super::discretization::build;
use super::rejection::{Alternative, Rejected, RejectionReason};
use crate::discretization::Discretization;
use crate::model::{Body, ModelError, TissueModel, graded_model};
use crate::placement::study::best_dynamic;
use crate::reduction::online::ReducedBody;
use crate::reduction::{Condensed, Invalid, ReducedModel, TrainingOptions, train};
use crate::scene::Scene;
use crate::scene::schema::PlantModel;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use crate::study::insertion::{linear_profile, profile, profile_distance, time_ticks, with_mesh_limit};
use crate::study::measurement::Linearity;
use nalgebra::Vector2;
use serde::Serialize;
use std::convert::Infallible;
use std::sync::Arc;

/// Depths at which the plant is held against a finer model.
const STATIONS: u32 = 10;
/// Ticks over which a plant's step is timed.
const TICKS: u32 = 500;

/// The chosen plant's target displacement along the insertion, the best paddle held still, against the full nonlinear model
/// two levels finer; that of a world against the one with all effects, one level finer, where the chosen nodes can be followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndToEnd {
    /// Worst error over the largest displacement; none where the finer model cannot be had or goes nowhere.
    pub error: Option<f64>,
    /// Depth up to which both went, length units.
    pub depth: f64,
    /// Nodes of the finer model.
    pub nodes: usize,
}

/// What a simulator should solve.
pub(super) struct FittedPlant {
    pub law: Linearity,
    pub plant: PlantModel,
    /// Depth up to which it holds, length units.
    pub depth: f64,
    /// Time of a step, µs; not a number where it was not timed.
    pub step_us: f64,
    /// Paddle that the insertion is followed with, by its place.
    paddle: Option<usize>,
    /// Depths and target displacements along the insertion, that paddle held still.
    path: Vec<(f64, Vector2<f64>)>,
}

/// The cheapest plant that keeps the tolerance on the model's scene, and what was not chosen.
pub(super) fn plant(
    model: &TissueModel,
    tolerance: f64,
    threads: usize,
) -> Result<(FittedPlant, Vec<Rejected>), ModelError> {
    let law_error = linear_law_error(model)?;
    let paddle = model.paddle_position(best_dynamic(model)?);
    if law_error <= tolerance {
        return Ok((condensed(model, paddle)?, Vec::new()));
    }
    let mut rejected = vec![Rejected::new(Alternative::LinearLaw, RejectionReason::LinearLaw(law_error))];
    let options = TrainingOptions { threads, ..TrainingOptions::to(tolerance) };
    let plant = match train(model, paddle, &options) {
        Ok((trained, report)) => reduced(model, &trained, report.domain.depth, paddle),
        Err(error) => {
            rejected.push(Rejected::new(Alternative::ReducedPlant, RejectionReason::NotReduced(error)));
            full(model, paddle)?
        }
    };
    Ok((plant, rejected))
}

fn condensed(model: &TissueModel, paddle: Option<usize>) -> Result<FittedPlant, ModelError> {
    let condensed = Condensed::new(model, paddle)?;
    let scene = model.scene();
    let depth = scene.needle.depth;
    let at = |depth| -> Result<_, Infallible> {
        Ok(condensed.target_displacement(std::hint::black_box(depth), Vector2::zeros()))
    };
    let (law, plant) = (Linearity::Linear, PlantModel::Condensed);
    Ok(FittedPlant { law, plant, depth, step_us: step_us(scene, depth, at), paddle, path: path(depth, at) })
}

fn reduced(model: &TissueModel, trained: &Arc<ReducedModel>, depth: f64, paddle: Option<usize>) -> FittedPlant {
    let at = |body: &mut ReducedBody, depth| -> Result<_, Invalid> {
        body.drive(depth, Vector2::zeros())?;
        Ok(body.target_displacement())
    };
    let (mut followed, mut timed) = (trained.body(), trained.body());
    FittedPlant {
        law: Linearity::Nonlinear,
        plant: PlantModel::Reduced,
        depth,
        step_us: step_us(model.scene(), depth, |depth| at(&mut timed, depth)),
        paddle,
        path: path(depth, |depth| at(&mut followed, depth)),
    }
}

fn full(model: &TissueModel, paddle: Option<usize>) -> Result<FittedPlant, ModelError> {
    let scene = model.scene();
    let at = |body: &mut Body<'_>, depth| -> Result<_, Failure> {
        body.drive(depth, Vector2::zeros())?;
        Ok(body.target_displacement())
    };
    let mut farthest = model.body(paddle, NewtonSettings::SMALL_STEPS)?;
    // As far as the tissue goes.
    let _ = farthest.drive(scene.needle.depth, Vector2::zeros());
    let depth = farthest.depth();
    let (mut followed, mut timed) =
        (model.body(paddle, NewtonSettings::default())?, model.body(paddle, NewtonSettings::SMALL_STEPS)?);
    Ok(FittedPlant {
        law: Linearity::Nonlinear,
        plant: PlantModel::Full,
        depth,
        step_us: step_us(scene, depth, |depth| at(&mut timed, depth)),
        paddle,
        path: path(depth, |depth| at(&mut followed, depth)),
    })
}

/// Error of the target displacement over the whole insertion by the law's small-strain limit.
fn linear_law_error(model: &TissueModel) -> Result<f64, ModelError> {
    let (limited, _) = with_mesh_limit(model.scene())?;
    let compared = if model.nodes() <= LAW_NODES {
        TissueModel::new(&limited)?
    } else {
        graded_model(&limited, limited.discretization.method, -2)?
    };
    let nonlinear = profile(&compared)?;
    Ok(profile_distance(&linear_profile(&compared)?, &nonlinear))
}

/// Time of a step over the insertion to `depth`, µs; NaN where it fails.
fn step_us<E>(scene: &Scene, depth: f64, step: impl FnMut(f64) -> Result<Vector2<f64>, E>) -> f64 {
    let mut shallow = scene.clone();
    shallow.needle.depth = depth;
    time_ticks(&shallow, TICKS, step).map_or(f64::NAN, |(seconds, _)| 1e6 * seconds)
}

/// Stations along an insertion to `depth`, as far as there is an answer.
fn path<E>(depth: f64, mut at: impl FnMut(f64) -> Result<Vector2<f64>, E>) -> Vec<(f64, Vector2<f64>)> {
    let stations = (1..=STATIONS).map(|k| depth * f64::from(k) / f64::from(STATIONS));
    stations.map_while(|depth| Some((depth, at(depth).ok()?))).collect()
}

/// The plant's path against that of the full model two levels finer.
pub(super) fn end_to_end(scene: &Scene, chosen: &Discretization, plant: &FittedPlant) -> Result<EndToEnd, ModelError> {
    let none = EndToEnd { error: None, depth: 0.0, nodes: 0 };
    let finer = Discretization { resolution: chosen.resolution.finer().finer(), ..*chosen };
    let Ok(model) = build(scene, &finer) else {
        return Ok(none);
    };
    let mut body = model.body(plant.paddle, NewtonSettings::default())?;
    let depth = plant.path.last().map_or(0.0, |station| station.0);
    let truth = path(depth, |depth| body.drive(depth, Vector2::zeros()).map(|()| body.target_displacement()));
    let largest = truth.iter().map(|station| station.1.norm()).fold(0.0, f64::max);
    let apart = plant.path.iter().zip(&truth).map(|(a, b)| (a.1 - b.1).norm()).fold(0.0, f64::max);
    let nodes = model.nodes();
    Ok(match truth.last() {
        Some(last) if largest > 0.0 => EndToEnd { error: Some(apart / largest), depth: last.0, nodes },
        _ => EndToEnd { nodes, ..none },
    })
}
