//! Invariants that every table in use satisfies.

use nalgebra::{SMatrix, SVector};

use super::{Knot, Table, TableError};
use crate::scalar::Scalar;

/// Largest admitted [`condition_number`] of a Jacobian. Past it, one part in a thousand of noise or model error along
/// the weak direction moves the paddle as much as the signal does, and no gain margin covers that.
pub const CONDITION_LIMIT: f64 = 1e3;

/// Condition number ‖J‖·‖J⁻¹‖ in the Frobenius norm; infinite for a singular matrix.
///
/// Between the spectral condition number and D times it, and much cheaper than singular values.
pub fn condition_number<T: Scalar, const D: usize>(jacobian: &SMatrix<T, D, D>) -> f64 {
    match jacobian.try_inverse() {
        Some(inverse) => jacobian.norm().to_f64() * inverse.norm().to_f64(),
        None => f64::INFINITY,
    }
}

impl<T: Scalar, const D: usize> Table<T, D> {
    /// Checks every invariant that the controller relies on.
    ///
    /// # Errors
    /// The first invariant that does not hold, as its own [`TableError`].
    pub fn validate(&self) -> Result<(), TableError> {
        self.validate_geometry()?;
        self.validate_limits()?;
        self.validate_knots()
    }

    fn validate_geometry(&self) -> Result<(), TableError> {
        finite("target position", self.target_position.as_slice())?;
        let [start, end] = &self.paddle.segment;
        finite("paddle segment", start.as_slice())?;
        finite("paddle segment", end.as_slice())?;
        unit("needle axis", &self.needle_axis)?;
        unit("orthogonal direction", &self.orthogonal)?;
        let cosine = self.needle_axis.dot(&self.orthogonal).to_f64();
        ensure(cosine.abs() <= T::UNIT_TOLERANCE, TableError::NotOrthogonal)
    }

    fn validate_limits(&self) -> Result<(), TableError> {
        positive("paddle displacement limit", self.paddle.max_displacement)?;
        positive("paddle rate limit", self.paddle.max_rate)?;
        positive("valid paddle displacement", self.validity.paddle_displacement)?;
        positive("needle speed limit", self.validity.needle_speed)?;
        ensure(self.paddle.max_displacement <= self.validity.paddle_displacement, TableError::DisplacementRange)?;
        finite("gains", &[self.gains.loop_gain, self.gains.lambda_max])?;
        let gain = self.gains.loop_gain.to_f64();
        ensure(gain > 0.0 && gain < 1.0 && self.gains.lambda_max.to_f64() >= 1.0, TableError::Gains)
    }

    fn validate_knots(&self) -> Result<(), TableError> {
        let (Some(first), Some(last)) = (self.knots.first(), self.knots.last()) else {
            return Err(TableError::TooFewKnots { found: 0 });
        };
        ensure(self.knots.len() >= 2, TableError::TooFewKnots { found: self.knots.len() })?;
        finite("validity depth range", &[self.validity.depth_start, self.validity.depth_end])?;
        for knot in &self.knots {
            knot.validate_finite()?;
        }
        for (index, pair) in self.knots.windows(2).enumerate() {
            if let [shallow, deep] = pair {
                ensure(shallow.depth < deep.depth, TableError::DepthOrder { knot: index + 1 })?;
            }
        }
        ensure(
            first.depth == self.validity.depth_start && last.depth == self.validity.depth_end,
            TableError::DepthRange,
        )?;
        for (index, knot) in self.knots.iter().enumerate() {
            ensure(condition_number(&knot.jacobian) <= CONDITION_LIMIT, TableError::IllConditioned { knot: index })?;
            ensure(
                knot.paddle_path.norm() <= self.paddle.max_displacement,
                TableError::PathBeyondLimit { knot: index },
            )?;
        }
        Ok(())
    }
}

impl<T: Scalar, const D: usize> Knot<T, D> {
    fn validate_finite(&self) -> Result<(), TableError> {
        finite("knot depth", &[self.depth])?;
        finite("knot Jacobian", self.jacobian.as_slice())?;
        finite("knot paddle path", self.paddle_path.as_slice())?;
        finite("knot paddle path slope", self.paddle_path_slope.as_slice())?;
        finite("knot target displacement", self.target_displacement.as_slice())?;
        finite("knot target displacement slope", self.target_displacement_slope.as_slice())?;
        finite("knot static target displacement", self.static_target_displacement.as_slice())
    }
}

fn ensure(holds: bool, error: TableError) -> Result<(), TableError> {
    if holds { Ok(()) } else { Err(error) }
}

/// Not inlined: it is called a dozen times, and speed does not matter here.
#[inline(never)]
fn finite<T: Scalar>(field: &'static str, values: &[T]) -> Result<(), TableError> {
    ensure(values.iter().all(|value| value.to_f64().is_finite()), TableError::NotFinite { field })
}

#[inline(never)]
fn positive<T: Scalar>(field: &'static str, value: T) -> Result<(), TableError> {
    finite(field, &[value])?;
    ensure(value.to_f64() > 0.0, TableError::NotPositive { field })
}

fn unit<T: Scalar, const D: usize>(field: &'static str, vector: &SVector<T, D>) -> Result<(), TableError> {
    finite(field, vector.as_slice())?;
    ensure((vector.norm().to_f64() - 1.0).abs() <= T::UNIT_TOLERANCE, TableError::NotUnit { field })
}
