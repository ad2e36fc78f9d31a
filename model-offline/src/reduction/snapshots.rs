//! States of the full model: those that a reduced model is made of, and those that it is judged by.

use super::error::TrainingError;
use super::lifting::control_values;
use super::online::Domain;
use crate::model::Body;
use crate::parallel;
use crate::random::SplitMix64;
use crate::solver::equilibrium::{Failure, LinearSolver, NewtonSettings};
use nalgebra::Vector2;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Depths of the snapshots over the trained depth, with a paddle. Denser towards the end, where the response bends most.
const DEPTHS: [f64; 5] = [0.0, 0.3, 0.6, 0.8, 1.0];
/// The same without a paddle, where depth is all there is: enough for modes that are used and modes that watch them.
const DEPTHS_ALONE: [f64; 12] = [0.08, 0.17, 0.25, 0.33, 0.42, 0.5, 0.58, 0.67, 0.75, 0.83, 0.92, 1.0];
/// Less than this part of the depth asked for is not worth training.
const SHALLOWEST: f64 = 0.02;
/// Part of the range that the tissue was found to reach that is trained: the very end is singular.
const KEPT: f64 = 0.9;
/// What the paddle's range is shrunk by where only its ends lose stability, and down to which part of it.
const NARROWER: f64 = 0.7;
const NARROWEST: f64 = 0.5;
/// How often the range is shrunk because a state in it has no stable equilibrium.
const SHRINKS: u32 = 5;
/// Where the tissue loses stability on the way, finding that depth to an eighth of a step is enough.
pub(super) const SNAPSHOT_SETTINGS: NewtonSettings = NewtonSettings {
    residual_tolerance: 1e-9,
    step_tolerance: 1e-8,
    max_iterations: 12,
    max_cutbacks: 3,
    line_search: true,
    require_stability: true,
    reuse_tangent: false,
    linear_solver: LinearSolver::BySize,
};

/// A state of the full model.
#[derive(Debug, Clone)]
pub(super) struct Snapshot {
    pub controls: [f64; 3],
    pub coefficients: Vec<f64>,
    pub target: Vector2<f64>,
}

/// Where snapshots are taken, over the domain.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// Paddle positions over the domain's largest.
    places: Vec<Vector2<f64>>,
    /// Depths over the domain's.
    depths: &'static [f64],
}

impl Grid {
    /// For a body without a paddle.
    pub(super) fn of_depths() -> Self {
        Self { places: vec![Vector2::zeros()], depths: &DEPTHS_ALONE }
    }

    /// Three by three paddle positions, at every depth.
    pub(super) fn with_paddle() -> Self {
        let place = |k: i32| Vector2::new(f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0);
        Self { places: (0..9).map(place).collect(), depths: &DEPTHS }
    }
}

/// Everything that the full model is asked.
pub(super) struct States {
    pub snapshots: Vec<Snapshot>,
    /// Drawn independently and uniformly from the domain.
    pub drawn: Vec<Snapshot>,
    pub domain: Domain,
}

/// Snapshots, and `drawn` further states, over as much of the range asked for as has stable equilibria everywhere.
///
/// # Errors
/// [`TrainingError::TooShallow`] or [`TrainingError::Unstable`].
pub(super) fn states(
    at_rest: &Body<'_>,
    grid: &Grid,
    mut asked: Domain,
    drawn: u32,
    threads: usize,
) -> Result<States, TrainingError> {
    let wanted = asked;
    let mut failed = None;
    for _ in 0..=SHRINKS {
        let narrows = asked.paddle.amax() > NARROWEST * wanted.paddle.amax();
        let taken = take_snapshots(at_rest, grid, asked, narrows, threads);
        if taken.reached < asked.depth {
            let deepest = if taken.reached_alone < asked.depth { taken.reached_alone } else { taken.reached };
            // Every insertion goes deep and few paddles go far: room for the paddle is given up first, where that helps.
            if taken.reached_alone == asked.depth && narrows {
                asked.paddle *= NARROWER;
            } else {
                asked.depth = KEPT * deepest;
            }
            failed = Some(TrainingError::TooShallow { reached: deepest, asked: wanted.depth });
            if asked.depth < SHALLOWEST * wanted.depth {
                break;
            }
            continue;
        }
        match draw(at_rest, asked, 0..drawn, threads) {
            Ok(drawn) => return Ok(States { snapshots: taken.snapshots, drawn, domain: asked }),
            Err(error) => failed = Some(error),
        }
        asked = Domain { depth: KEPT * asked.depth, paddle: asked.paddle * KEPT };
    }
    Err(failed.unwrap_or(TrainingError::TooShallow { reached: 0.0, asked: wanted.depth }))
}

/// Full solutions on a grid of paddle positions and depths.
struct Taken {
    snapshots: Vec<Snapshot>,
    /// Depth that was reached with the paddle everywhere.
    reached: f64,
    /// Depth that was reached with the paddle where it rests.
    reached_alone: f64,
}

/// Where the paddle rests first: where that fails nothing else matters, and neither does how far the others get when the first
/// of them fails and the range of the paddle `narrows` then.
fn take_snapshots(at_rest: &Body<'_>, grid: &Grid, asked: Domain, narrows: bool, threads: usize) -> Taken {
    let stop = AtomicBool::new(false);
    let run = |place: &Vector2<f64>| {
        let mut body = at_rest.clone();
        let place = place.component_mul(&asked.paddle);
        // The paddle's way is not what is looked for, and long: as carefully as it takes.
        body.equilibrium_mut().set_settings(NewtonSettings::default());
        let mut taken = Vec::new();
        let mut reached = 0.0;
        if body.drive(0.0, place).is_ok() {
            body.equilibrium_mut().set_settings(SNAPSHOT_SETTINGS);
            for depth in grid.depths.iter().map(|share| share * asked.depth) {
                if stop.load(Ordering::Relaxed) || body.drive(depth, place).is_err() {
                    break;
                }
                taken.push(snapshot(&body));
            }
            reached = body.depth();
        }
        if reached < asked.depth && narrows {
            stop.store(true, Ordering::Relaxed);
        }
        (taken, reached)
    };
    let alone = grid.places.iter().position(|place| *place == Vector2::zeros());
    let rested = alone.map(|k| (k, run(&grid.places[k])));
    if let Some((_, (_, reached))) = rested
        && reached < asked.depth
    {
        return Taken { snapshots: Vec::new(), reached, reached_alone: reached };
    }
    let others: Vec<usize> = (0..grid.places.len()).filter(|k| Some(*k) != alone).collect();
    let mut runs = parallel::map(others.len(), threads, |k| run(&grid.places[others[k]]));
    let reached = runs.iter().map(|run| run.1).fold(asked.depth, f64::min);
    let reached_alone = if rested.is_some() { asked.depth } else { reached };
    if let Some((k, rested)) = rested {
        runs.insert(k, rested);
    }
    // The state at rest teaches nothing.
    let snapshots = runs.into_iter().flat_map(|run| run.0).filter(|s| s.controls.iter().any(|c| *c != 0.0)).collect();
    Taken { snapshots, reached, reached_alone }
}

fn snapshot(body: &Body<'_>) -> Snapshot {
    Snapshot {
        controls: control_values(body.depth(), body.paddle()),
        coefficients: body.equilibrium().coefficients().to_vec(),
        target: body.target_displacement(),
    }
}

/// Full solutions at states drawn from the domain, the same at every training.
fn draw(at_rest: &Body<'_>, domain: Domain, which: Range<u32>, threads: usize) -> Result<Vec<Snapshot>, TrainingError> {
    let first = which.start;
    let states = parallel::map(which.len(), threads, |k| {
        let mut random = SplitMix64(u64::from(first) + k as u64);
        let depth = random.unit() * domain.depth;
        let place = Vector2::new(random.symmetric(), random.symmetric()).component_mul(&domain.paddle);
        let mut body = at_rest.clone();
        body.equilibrium_mut().set_settings(NewtonSettings::default());
        body.drive(depth, place).map_err(|failure| unstable(depth, place, failure))?;
        Ok(snapshot(&body))
    });
    states.into_iter().collect()
}

fn unstable(depth: f64, place: Vector2<f64>, failure: Failure) -> TrainingError {
    TrainingError::Unstable { depth, x: place.x, y: place.y, failure }
}
