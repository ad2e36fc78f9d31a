//! Knots of tissue whose state depends on its past: along the insertion that the scene says, at its speed.

use super::{Followed, TableBuildError, check};
use crate::model::{ModelError, Pose, TissueModel};
use crate::needle::Course;
use crate::placement::controllability::best_direction;
use crate::solver::equilibrium::{Failure, FailureReason};
use firmware::contract::{Knot, MAX_KNOTS};
use nalgebra::Vector2;

/// Orthogonal error over the depth that the paddle path leaves at a knot.
const ENOUGH: f64 = 1e-7;
/// The same that is refused, over what is enough: where the skin gives way with one paddle and not with the next, there may be no better one.
const MOST: f64 = 1e5;
/// Positions of the paddle that are tried at a knot.
const ROUNDS: usize = 12;
/// Steps of the insertion between two knots: what is elastic, cut and relaxed needs small ones, the table does not.
const STEPS: usize = 4;

/// The knots down to where the tissue can be taken. Nobody breathes: a table knows no time.
///
/// # Errors
/// [`TableBuildError`] where there are not two.
pub(super) fn knots(model: &TissueModel, position: usize, count: usize) -> Result<Followed<2, 1>, TableBuildError> {
    let scene = model.scene();
    let (normal, depth) = (scene.needle.orthogonal(), scene.needle.depth);
    let interval = depth / (count - 1) as f64;
    let seconds = interval / scene.needle.speed / STEPS as f64;
    let index = scene.paddles[position].index;
    let steering = Steering { seconds, normal, enough: ENOUGH * depth, index };
    let mut still = Course::in_small_steps(model, Some(position))?;
    let mut steered = still.clone();
    let mut knots: heapless::Vec<Knot<f64, 2>, MAX_KNOTS> = heapless::Vec::new();
    // Paddle travel per step, as the last one needed it, in the direction that holds the target.
    let mut ahead = 0.0;
    for k in 0..count {
        let outcome = (|| {
            for step in 1..=if k > 0 { STEPS } else { 0 } {
                let share = step as f64 / STEPS as f64;
                let at = if k + 1 == count && step == STEPS { depth } else { interval * ((k - 1) as f64 + share) };
                still.take_in(Pose { depth: at, ..Pose::default() }, seconds)?;
                ahead = steering.step(&mut steered, at, ahead)?;
            }
            let jacobian = steered.actuation_jacobian()?;
            Ok::<_, TableBuildError>(Knot {
                depth: steered.pose().depth,
                jacobian: [jacobian],
                paddle_path: steered.pose().paddle,
                paddle_path_slope: Vector2::zeros(),
                target_displacement: steered.target_displacement(),
                target_displacement_slope: Vector2::zeros(),
                static_target_displacement: still.target_displacement(),
            })
        })();
        match outcome {
            Ok(knot) => {
                check(&knot, index, scene.actuator.max_displacement)?;
                // Capacity was checked before.
                let _ = knots.push(knot);
            }
            Err(error) if knots.len() < 2 => return Err(error),
            Err(error) => {
                slopes(&mut knots);
                return Ok(Followed { knots, ended: Some(error) });
            }
        }
    }
    slopes(&mut knots);
    Ok(Followed { knots, ended: None })
}

/// How a paddle is steered.
struct Steering {
    /// What a step takes, s.
    seconds: f64,
    normal: Vector2<f64>,
    /// Orthogonal error that may be left, length.
    enough: f64,
    /// The paddle, as the scene calls it.
    index: u32,
}

impl Steering {
    /// One step with the paddle where the target is on the needle's line after it; the paddle's travel.
    fn step(&self, course: &mut Course<'_>, depth: f64, ahead: f64) -> Result<f64, TableBuildError> {
        let direction = self.direction(course)?.normalize();
        let before = course.clone();
        let from = before.pose().paddle;
        let mut paddle = from + direction * ahead;
        let mut best = f64::INFINITY;
        for _ in 0..ROUNDS {
            let mut tried = before.clone();
            tried.take_in(Pose { depth, paddle, ..Pose::default() }, self.seconds)?;
            let error = self.normal.dot(&tried.target_displacement());
            let done = error.abs() <= self.enough || error.abs() > 0.9 * best;
            if error.abs() < best {
                *course = tried;
                best = error.abs();
            }
            if done {
                break;
            }
            paddle -= self.direction(course)? * error;
        }
        if best > MOST * self.enough {
            return Err(ModelError::Solve(Failure {
                reason: FailureReason::NotConverged,
                reached: 0.0,
                detail: format!("the paddle path at depth {depth:.4} leaves {best:.1e} of orthogonal error"),
            })
            .into());
        }
        Ok((course.pose().paddle - from).dot(&direction))
    }

    /// J⁻¹n with the needle as it is.
    fn direction(&self, course: &mut Course<'_>) -> Result<Vector2<f64>, TableBuildError> {
        let found = best_direction(&course.actuation_jacobian()?, self.normal);
        Ok(found
            .map_err(|singular| ModelError::Uncontrollable { paddle: self.index, condition: singular.condition })?)
    }
}

/// Slopes along the depth from the knots around.
fn slopes(knots: &mut [Knot<f64, 2>]) {
    let slope = |knots: &[Knot<f64, 2>], k: usize, of: fn(&Knot<f64, 2>) -> Vector2<f64>| {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(knots.len() - 1));
        (of(&knots[b]) - of(&knots[a])) / (knots[b].depth - knots[a].depth)
    };
    let found: Vec<_> = (0..knots.len())
        .map(|k| (slope(knots, k, |knot| knot.paddle_path), slope(knots, k, |knot| knot.target_displacement)))
        .collect();
    for (knot, (paddle, target)) in knots.iter_mut().zip(found) {
        (knot.paddle_path_slope, knot.target_displacement_slope) = (paddle, target);
    }
}
