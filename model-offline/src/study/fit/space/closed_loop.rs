//! The insertion into the body with a controller that has the slice's table: followed, not estimated.

use super::comparison::{Frame, Left};
use super::verdict::NEGLIGIBLE;
use crate::model::ModelError;
use crate::model::space::SpaceBody;
use crate::placement::PlacementStudy;
use crate::placement::space::rest::SpaceResponse;
use crate::placement::space::study::SpaceAnswer;
use crate::placement::space::workflow::coarse;
use crate::placement::space::{InsertionModel, SpaceStudy};
use crate::placement::study::PaddleResult;
use crate::solver::equilibrium::NewtonSettings;
use crate::study::slice::Slice;
use nalgebra::{DMatrix, Matrix2, Vector3};
use serde::Serialize;

/// Corrections at each increment at most.
const MOST_CORRECTIONS: u32 = 30;
/// Error in the plane that is none, over the target's displacement without help.
const ENOUGH: f64 = 1e-3;

/// An insertion into the body by the slice's table: the paddle's way by what the slice knows of depth and Jacobians,
/// without and with corrections of what is seen in the plane. Length units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClosedLoop {
    /// The paddle.
    pub paddle: u32,
    /// The last increment that body and slice reached.
    pub depth: f64,
    /// What is left there by the table alone.
    pub table_alone: Left,
    /// What is left there with corrections at every increment until there is no error in the plane.
    pub with_feedback: Left,
    /// Without a paddle, at that depth.
    pub without_help: f64,
    /// Corrections that an increment took at most.
    pub corrections: u32,
    /// Whether they took the error in the plane away.
    pub converges: bool,
}

/// Follows it; none where the slice's paddle controls nothing, or no increment can be followed.
///
/// # Errors
/// [`ModelError`] when the body cannot be meshed or is not stable at rest.
pub(super) fn follow(
    study: &SpaceStudy,
    slice: &Slice,
    planar: &PlacementStudy,
    index: u32,
) -> Result<Option<ClosedLoop>, ModelError> {
    let Some(table) = planar.placement.paddles.iter().find(|p| p.index == index && p.best_direction.is_some()) else {
        return Ok(None);
    };
    let scene = study.model.scene();
    let insertions = InsertionModel::new(scene, coarse(scene)?, study.model.clone(), rest(study));
    let (place, limit) = (scene.paddle_position(index)?, scene.actuator.max_displacement);
    let settings = NewtonSettings { max_cutbacks: 3, ..NewtonSettings::default() };
    let (mut alone, mut fed) = (insertions.body(&[place], settings)?, insertions.body(&[place], settings)?);
    let frame = Frame::new(slice);
    let without_help = &study.placement.no_paddle.static_study;
    let along = Vector3::from(study.placement.no_paddle.target_per_depth).norm() * scene.needle.depth;
    let enough = ENOUGH * without_help.max_orthogonal.max(NEGLIGIBLE * along);
    let (mut found, mut offset): (Option<ClosedLoop>, Vector3<f64>) = (None, Vector3::zeros());
    for (k, &depth) in table.static_study.depth.iter().enumerate().take(without_help.orthogonal.len()) {
        let Some(unit) = correction(&frame, table, k) else { break };
        let forward = unit * -table.static_study.orthogonal[k];
        if alone.drive(depth, &[forward]).is_err() {
            break;
        }
        let (mut corrections, mut last) = (0, f64::INFINITY);
        let converges = loop {
            if fed.drive(depth, &[forward + offset]).is_err() {
                // A loop that takes the body where it has no equilibrium does not converge; one without corrections is none.
                break if corrections > 0 { Some(false) } else { None };
            }
            let error = fed.target_displacement().dot(&frame.normal);
            if error.abs() <= enough {
                break Some(true);
            }
            // A loop that is led away may still end up somewhere: not here, where its paddle would be at its limit.
            let is_away = error.abs() >= last || (forward + offset).norm() > limit;
            if corrections == MOST_CORRECTIONS || is_away {
                break Some(false);
            }
            last = error.abs();
            corrections += 1;
            offset -= unit * error;
        };
        let Some(converges) = converges else { break };
        let left = |body: &SpaceBody<'_>| frame.left(&body.target_displacement());
        let before = found.as_ref().map_or((0, true), |before| (before.corrections, before.converges));
        found = Some(ClosedLoop {
            paddle: index,
            depth,
            table_alone: left(&alone),
            with_feedback: left(&fed),
            without_help: without_help.orthogonal[k],
            corrections: corrections.max(before.0),
            converges: converges && before.1,
        });
    }
    Ok(found)
}

/// J⁻¹n of the slice at an increment, in space.
fn correction(frame: &Frame<'_>, table: &PaddleResult, increment: usize) -> Option<Vector3<f64>> {
    let jacobian = Matrix2::from_row_slice(&table.jacobians.get(increment)?.concat());
    Some(frame.in_space(jacobian.try_inverse()? * frame.slice.scene.needle.orthogonal()))
}

/// What the body answers at rest, in the order of its sets: every paddle, every pair, none.
fn rest(study: &SpaceStudy) -> Vec<SpaceResponse> {
    let placement = &study.placement;
    let of = |answer: &SpaceAnswer| SpaceResponse {
        jacobian: DMatrix::from_fn(3, answer.jacobian[0].len(), |r, c| answer.jacobian[r][c]),
        target_per_depth: answer.target_per_depth.into(),
        controllability: None,
    };
    let none = SpaceResponse {
        jacobian: DMatrix::zeros(3, 0),
        target_per_depth: placement.no_paddle.target_per_depth.into(),
        controllability: None,
    };
    let singles = placement.paddles.iter().map(|paddle| of(&paddle.answer));
    singles.chain(placement.pairs.iter().map(|pair| of(&pair.answer))).chain([none]).collect()
}
