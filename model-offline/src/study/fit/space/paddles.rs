//! One paddle or two: how far they go, against how far they can.

use crate::linalg::SingularValues;
use crate::model::ModelError;
use crate::placement::space::SpaceStudy;
use crate::placement::space::rest::CondensedRest;
use crate::placement::space::study::SpaceAnswer;
use nalgebra::{DMatrix, Vector3};
use serde::Serialize;

/// Singular values below this part of the largest are none.
const SINGULAR: f64 = 1e-9;

/// What one paddle or two take to hold the target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaddleSet {
    /// Their indices.
    pub paddles: Vec<u32>,
    /// 1/σ_min(NᵀJ).
    pub measure: f64,
    /// Largest displacement of a paddle that takes the target's displacement by the insertion back to the needle's
    /// line, length units, by the Jacobian at rest.
    pub stroke: f64,
    /// The same over the paddles' limit, `max_displacement`.
    pub stroke_over_limit: f64,
    /// What its speed takes over `max_rate`, at the needle's speed.
    pub rate_over_limit: f64,
    /// Part of the target's displacement that is left where a paddle is at its limit.
    pub left_at_limit: f64,
    /// A disturbance as large as the target's displacement without help, in the worst direction: stroke over the limit.
    pub worst_over_limit: f64,
    /// Displacement of the paddles, root mean square, per standard deviation of a sensor's noise in each direction.
    pub noise_gain: f64,
    /// Largest |1 − λ| of a table that knows of no inclusions; none where there are none. From 1 on corrections may
    /// lead to the wrong side.
    pub without_knowing: Option<f64>,
}

/// The best single paddle to control, and the best pair.
pub(super) fn best_sets(study: &SpaceStudy) -> Result<(PaddleSet, Option<PaddleSet>), ModelError> {
    let placement = &study.placement;
    let single = placement.paddles.iter().find(|p| placement.optimum_single.dynamic == [p.index]);
    let single = single.ok_or(ModelError::NoPaddleControls)?;
    let pair = placement.pairs.iter().find(|p| placement.optimum.dynamic == p.paddles);
    let homogeneous = study.model.without_inclusions();
    let known = match study.model.scene().inclusions.is_empty() {
        true => None,
        false => Some(CondensedRest::new(&homogeneous)?),
    };
    let set = |indices: Vec<u32>, answer: &SpaceAnswer| -> Result<PaddleSet, ModelError> {
        let scene = study.model.scene();
        let places: Vec<usize> = indices.iter().map(|index| scene.paddle_position(*index)).collect::<Result<_, _>>()?;
        let believed = known.as_ref().map(|rest| rest.response(&places)).transpose()?;
        Ok(of(study, indices, answer, believed.map(|response| response.jacobian)))
    };
    let two = pair.map(|pair| set(pair.paddles.to_vec(), &pair.answer)).transpose()?;
    Ok((set(vec![single.index], &single.answer)?, two))
}

fn of(study: &SpaceStudy, paddles: Vec<u32>, answer: &SpaceAnswer, believed: Option<DMatrix<f64>>) -> PaddleSet {
    let scene = study.model.scene();
    let (needle, limits) = (&scene.needle, &scene.actuator);
    let orthogonal = needle.orthogonal();
    let across = |jacobian: &DMatrix<f64>| orthogonal.transpose() * jacobian;
    let inverse = |of: &DMatrix<f64>| {
        let found = SingularValues::of(&across(of));
        found.map_or_else(|| DMatrix::zeros(of.ncols(), 2), |found| found.pseudo_inverse(SINGULAR))
    };
    let jacobian = DMatrix::from_fn(3, answer.jacobian[0].len(), |r, c| answer.jacobian[r][c]);
    let correction = inverse(&jacobian);
    let stroke_of = |displacement: &Vector3<f64>| {
        let all = &correction * (orthogonal.transpose() * displacement);
        all.as_slice().chunks_exact(3).map(|one| Vector3::from_column_slice(one).norm()).fold(0.0, f64::max)
    };
    let study_of = &answer.static_study;
    let per_depth = |(depth, u): (&f64, &[f64; 3])| (*depth, stroke_of(&Vector3::from(*u)));
    let mut strokes: Vec<(f64, f64)> =
        study_of.depth.iter().zip(&study_of.target_displacement).map(per_depth).collect();
    if strokes.is_empty() {
        strokes.push((needle.depth, stroke_of(&(Vector3::from(answer.target_per_depth) * needle.depth))));
    }
    let stroke = strokes.iter().map(|(_, stroke)| *stroke).fold(0.0, f64::max);
    let mut before = (0.0, 0.0);
    let steepest = strokes.iter().map(|&(depth, stroke)| {
        let slope = (stroke - before.1).abs() / (depth - before.0);
        before = (depth, stroke);
        slope
    });
    let rate = steepest.fold(0.0, f64::max) * needle.speed;
    let none = &study.placement.no_paddle;
    // Of an insertion that stopped at once nothing is known but how it would have begun.
    let without_help = match none.static_study.depth.is_empty() {
        true => needle.axis.cross(&Vector3::from(none.target_per_depth)).norm() * needle.depth,
        false => none.static_study.max_orthogonal,
    };
    let over = stroke / limits.max_displacement;
    PaddleSet {
        paddles,
        measure: answer.controllability_measure,
        stroke,
        stroke_over_limit: over,
        rate_over_limit: rate / limits.max_rate,
        left_at_limit: if over > 1.0 { 1.0 - 1.0 / over } else { 0.0 },
        worst_over_limit: answer.controllability_measure * without_help / limits.max_displacement,
        noise_gain: correction.norm(),
        without_knowing: believed.map(|believed| {
            let gains = across(&jacobian) * inverse(&believed);
            let gains = nalgebra::Matrix2::from_fn(|r, c| gains[(r, c)]);
            gains.complex_eigenvalues().iter().map(|gain| (gain - 1.0).norm()).fold(0.0, f64::max)
        }),
    }
}
