//! What a slice says of paddles and target, and what the body makes of that.

use crate::placement::PlacementStudy;
use crate::placement::space::SpaceStudy;
use crate::placement::space::study::{SpaceAnswer, SpacePaddleResult, SpaceStatic};
use crate::placement::study::{PaddleResult, StaticStudy};
use crate::study::slice::Slice;
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::Serialize;

/// A component is rounding below this part of the vector.
const ROUNDING: f64 = 1e-9;

/// The target without a paddle, at the deepest increment that body and slice both reached. Length units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WithoutHelp {
    /// That depth; the needle's where they have none in common, and displacements are those of small depths.
    pub depth: f64,
    /// In the body, in the slice's plane, orthogonal to the needle.
    pub body_in_plane: f64,
    /// In the body, across the plane: what the slice cannot see.
    pub body_across_plane: f64,
    /// In the body, along the needle.
    pub body_axial: f64,
    /// In the slice, orthogonal to the needle.
    pub slice_in_plane: f64,
    /// In the slice, along the needle.
    pub slice_axial: f64,
}

/// One paddle in body and slice.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaddleInBoth {
    /// Its index.
    pub index: u32,
    /// In the body, the worst direction: 1/σ_min(NᵀJ).
    pub body: f64,
    /// The estimated relative error of that; none where the scene gives its spacing or level.
    pub body_error: Option<f64>,
    /// In the body, the direction that the slice has, and the target nowhere else: ‖J⁻¹n‖. None without a slice.
    pub body_in_plane: Option<f64>,
    /// In the slice: ‖J⁻¹n‖. None where the slice does not have it.
    pub slice: Option<f64>,
    /// The body's over the slice's, of the same direction.
    pub ratio: Option<f64>,
    /// What corrections from the slice's Jacobian do in the body.
    pub feedback: Option<Feedback>,
}

/// What corrections from a slice's Jacobian do in the body. Displacements of the target orthogonal to the needle,
/// length units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Feedback {
    /// λ: how far the target moves in the plane, for a unit that the slice's Jacobian asks for; 1 would be right. A
    /// loop that corrects the whole error at each step converges for 0 < λ < 2.
    pub gain: f64,
    /// |1 − λ|.
    pub gain_mismatch: f64,
    /// How far it moves across the plane, for the same unit.
    pub across: f64,
    /// The insertion with the slice's table alone, estimated by what Jacobians at rest say.
    pub table_alone: Left,
    /// The insertion with feedback, which takes away all that is in the plane, estimated likewise.
    pub with_feedback: Left,
}

/// What is left of the target's displacement, orthogonal to the needle. Length units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Left {
    /// In the plane.
    pub in_plane: f64,
    /// Across it.
    pub across_plane: f64,
}

impl Left {
    /// Both together.
    pub fn whole(&self) -> f64 {
        self.in_plane.hypot(self.across_plane)
    }
}

/// Directions of a slice in the body.
pub(super) struct Frame<'a> {
    pub(super) slice: &'a Slice,
    /// In the plane, orthogonal to the needle.
    pub(super) normal: Vector3<f64>,
    /// Across the plane.
    across: Vector3<f64>,
}

impl<'a> Frame<'a> {
    pub(super) fn new(slice: &'a Slice) -> Self {
        let mut frame = Self { slice, normal: Vector3::zeros(), across: slice.plane.normal };
        frame.normal = frame.in_space(slice.scene.needle.orthogonal());
        frame
    }

    pub(super) fn in_space(&self, v: Vector2<f64>) -> Vector3<f64> {
        self.slice.plane.directions[0] * v.x + self.slice.plane.directions[1] * v.y
    }

    /// What is left of a displacement orthogonal to the needle.
    pub(super) fn left(&self, displacement: &Vector3<f64>) -> Left {
        let across_plane = unless_rounding(displacement.dot(&self.across), displacement.norm());
        Left { in_plane: displacement.dot(&self.normal), across_plane }
    }
}

/// Displacements at the deepest increment of both; at the needle's depth by what they are at small ones, where there is
/// none.
fn at_common_depth(
    body: (&SpaceStatic, [f64; 3]),
    slice: &StaticStudy,
    depth: f64,
) -> (f64, Vector3<f64>, Vector2<f64>) {
    match body.0.depth.len().min(slice.depth.len()).checked_sub(1) {
        Some(last) => (
            slice.depth[last],
            Vector3::from(body.0.target_displacement[last]),
            Vector2::from(slice.target_displacement[last]),
        ),
        None => (depth, Vector3::from(body.1) * depth, Vector2::from(slice.target_per_depth) * depth),
    }
}

/// Nothing where a part of something so large is rounding.
fn unless_rounding(part: f64, whole: f64) -> f64 {
    if part.abs() <= ROUNDING * whole { 0.0 } else { part }
}

/// The target without help.
pub(super) fn without_help(study: &SpaceStudy, slice: &Slice, planar: &PlacementStudy) -> WithoutHelp {
    let (frame, needle) = (Frame::new(slice), &slice.scene.needle);
    let none = &study.placement.no_paddle;
    let in_slice = &planar.placement.no_paddle.static_study;
    let (depth, body, plane) = at_common_depth((&none.static_study, none.target_per_depth), in_slice, needle.depth);
    let (of_body, of_slice) = (body.norm(), plane.norm());
    WithoutHelp {
        depth,
        body_in_plane: unless_rounding(body.dot(&frame.normal), of_body),
        body_across_plane: unless_rounding(body.dot(&frame.across), of_body),
        body_axial: unless_rounding(body.dot(&study.model.scene().needle.axis), of_body),
        slice_in_plane: unless_rounding(plane.dot(&needle.orthogonal()), of_slice),
        slice_axial: unless_rounding(plane.dot(&needle.axis), of_slice),
    }
}

/// Every paddle of the body, beside what the slice says of it.
pub(super) fn paddles(study: &SpaceStudy, planar: Option<(&Slice, &PlacementStudy)>) -> Vec<PaddleInBoth> {
    let error = |place: usize| study.error_estimate.as_ref().and_then(|estimate| estimate.by_set.get(place).copied());
    let one = |(place, result): (usize, &SpacePaddleResult)| {
        let (body, body_error) = (result.answer.controllability_measure, error(place));
        let Some((slice, planar)) = planar else {
            return PaddleInBoth {
                index: result.index,
                body,
                body_error,
                body_in_plane: None,
                slice: None,
                ratio: None,
                feedback: None,
            };
        };
        let frame = Frame::new(slice);
        let in_plane = jacobian(&result.answer).try_inverse().map_or(f64::INFINITY, |j| (j * frame.normal).norm());
        let found = planar.placement.paddles.iter().find(|paddle| paddle.index == result.index);
        let measure = found.map(|paddle| paddle.controllability_measure);
        PaddleInBoth {
            index: result.index,
            body,
            body_error,
            body_in_plane: Some(in_plane),
            slice: measure,
            ratio: measure.map(|measure| in_plane / measure),
            feedback: found.and_then(|paddle| feedback(&frame, &result.answer, paddle)),
        }
    };
    study.placement.paddles.iter().enumerate().map(one).collect()
}

fn jacobian(answer: &SpaceAnswer) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| answer.jacobian[r][c])
}

/// What a correction J⁻¹n of the slice does in the body; none where the slice's paddle controls nothing.
fn feedback(frame: &Frame<'_>, body: &SpaceAnswer, slice: &PaddleResult) -> Option<Feedback> {
    let correction = frame.in_space(slice.best_direction?.into());
    let moved = jacobian(body) * correction;
    let gain = moved.dot(&frame.normal);
    let across = unless_rounding(moved.dot(&frame.across), moved.norm());
    let needle = &frame.slice.scene.needle;
    let displaced = (&body.static_study, body.target_per_depth);
    let (_, in_body, in_slice) = at_common_depth(displaced, &slice.static_study, needle.depth);
    let Left { in_plane, across_plane } = frame.left(&in_body);
    let told = in_slice.dot(&needle.orthogonal());
    Some(Feedback {
        gain,
        gain_mismatch: (1.0 - gain).abs(),
        across,
        table_alone: Left { in_plane: in_plane - gain * told, across_plane: across_plane - across * told },
        with_feedback: Left { in_plane: 0.0, across_plane: across_plane - across / gain * in_plane },
    })
}
