//! Where paddles hold the target: Newton's method on their displacements, so that nothing is left of the target's way
//! orthogonal to the needle.

use super::controllability::least_displacements;
use crate::model::ModelError;
use crate::model::space::SpaceBody;
use crate::solver::equilibrium::{Failure, FailureReason};
use nalgebra::{DMatrix, DVector, MatrixXx2, Vector2, Vector3};

/// Steps of Newton's method.
const MOST_STEPS: usize = 12;
/// Orthogonal error over the body's size that is none, and that may be left where rounding ends Newton's method early.
const ENOUGH: f64 = 1e-12;
const MOST: f64 = 1e-9;

/// What holds the target at a state: the actuation Jacobian J, the least displacements of the paddles per orthogonal displacement of
/// the target, and what the needle does.
#[derive(Debug, Clone)]
pub struct Hold {
    /// J: 3 rows, three columns per paddle.
    pub jacobian: DMatrix<f64>,
    /// (NᵀJ)⁺: two columns.
    pub inverse: MatrixXx2<f64>,
    /// d(target)/d(depth), paddles still.
    pub per_depth: Vector3<f64>,
}

impl Hold {
    /// At the body's present state.
    ///
    /// # Errors
    /// [`ModelError::Solve`] when it is not stable, [`ModelError::NotHeld`] when its paddles do not control the target.
    pub fn of(body: &mut SpaceBody<'_>) -> Result<Self, ModelError> {
        let orthogonal = body.model().scene().needle.orthogonal();
        let jacobian = body.actuation_jacobian()?;
        let jacobian = DMatrix::from_column_slice(3, jacobian.ncols(), jacobian.as_slice());
        let across = orthogonal.transpose() * &jacobian;
        let inverse = least_displacements(&across).ok_or(ModelError::NotHeld { depth: body.depth() })?;
        let inverse = inverse.fixed_columns::<2>(0).into_owned();
        Ok(Self { jacobian, inverse, per_depth: body.depth_sensitivity()? })
    }

    /// d(paddles)/d(depth) that keeps the target on the needle's line.
    pub fn way(&self, body: &SpaceBody<'_>) -> DVector<f64> {
        &self.inverse * -(body.model().scene().needle.orthogonal().transpose() * self.per_depth)
    }
}

/// The target's displacement orthogonal to the needle.
fn error(body: &SpaceBody<'_>) -> Vector2<f64> {
    body.model().scene().needle.orthogonal().transpose() * body.target_displacement()
}

fn moved(body: &SpaceBody<'_>, by: &DVector<f64>) -> Vec<Vector3<f64>> {
    let steps = by.as_slice().chunks_exact(3).map(Vector3::from_column_slice);
    body.paddles().iter().zip(steps).map(|(at, step)| at + step).collect()
}

/// Takes a body to a depth with its paddles where the target is back on the needle's line.
///
/// # Errors
/// [`ModelError::Solve`] where that is not possible, [`ModelError::NotHeld`].
pub fn hold(body: &mut SpaceBody<'_>, depth: f64) -> Result<(), ModelError> {
    let ahead = Hold::of(body)?.way(body) * (depth - body.depth());
    let paddles = moved(body, &ahead);
    body.drive(depth, &paddles)?;
    let size = body.model().scene().size();
    for _ in 0..MOST_STEPS {
        let left = error(body);
        if left.norm() <= ENOUGH * size {
            return Ok(());
        }
        let back = Hold::of(body)?.inverse * -left;
        let paddles = moved(body, &back);
        body.drive(depth, &paddles)?;
    }
    let left = error(body).norm();
    if left <= MOST * size {
        return Ok(());
    }
    Err(ModelError::Solve(Failure {
        reason: FailureReason::NotConverged,
        reached: 0.0,
        detail: format!("the paddles' way at depth {depth:.4} leaves {left:.1e} of orthogonal error"),
    }))
}
