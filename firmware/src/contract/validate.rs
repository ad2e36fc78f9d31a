//! Invariants that every table in use satisfies.

use nalgebra::{SMatrix, SVector};

use super::bounds::TableBounds;
use super::{Field, Knot, Table, TableError};
use crate::scalar::Scalar;

/// Largest admitted [`condition_number`] of a Jacobian. Past it, one part in a thousand of noise or model error along
/// the weak direction moves the paddle as much as the signal does, and no gain margin covers that.
pub const CONDITION_LIMIT: f64 = 1e3;

/// How much larger than the table's own geometry a length of it may be.
const LENGTH_MARGIN: f64 = 10.0;
/// Depth range and distance from paddle to target differ at most by this factor.
const ASPECT_LIMIT: f64 = 1e3;
/// Most often that the paddle may cross its range in a second, and the needle the table: faster, and the monitors that
/// follow from the speeds could no longer tell a fault from motion.
const CROSSINGS_PER_SECOND: f64 = 100.0;
/// Largest ‖J‖: tissue does not amplify what moves it.
const JACOBIAN_LIMIT: f64 = 100.0;
/// Largest motion of the target per motion of the needle that drags it.
const DRAG_LIMIT: f64 = 3.0;
/// A slope m at a knot lifts a cubic over an interval h by up to 4/27·m·h.
const HERMITE_LIFT: f64 = 4.0 / 27.0;

/// Condition number ‖J‖·‖J⁻¹‖ in the Frobenius norm; infinite for a singular matrix.
///
/// Between the spectral condition number and D times it, and much cheaper than singular values.
pub fn condition_number<T: Scalar, const D: usize>(jacobian: &SMatrix<T, D, D>) -> f64 {
    match jacobian.try_inverse() {
        Some(inverse) => jacobian.norm().to_f64() * inverse.norm().to_f64(),
        None => f64::INFINITY,
    }
}

/// Condition number of [J₁ … J_P] with each paddle in units of its limit, in the Frobenius norm: with
/// M = Σ wₚ·Jₚ·Jₚᵀ it is √(tr M · tr M⁻¹). For one paddle, [`condition_number`].
///
/// That of the orthogonal rows alone is never larger: singular values interlace.
fn joint_condition_number<T: Scalar, const D: usize, const P: usize>(
    jacobians: &[SMatrix<T, D, D>; P],
    weights: &[T; P],
) -> f64 {
    if let [jacobian] = jacobians.as_slice() {
        return condition_number(jacobian);
    }
    let weighted = jacobians.iter().zip(weights).map(|(jacobian, weight)| jacobian * jacobian.transpose() * *weight);
    let joint = weighted.fold(SMatrix::<T, D, D>::zeros(), |sum, term| sum + term);
    match joint.try_inverse() {
        Some(inverse) => libm::sqrt(joint.trace().to_f64() * inverse.trace().to_f64()),
        None => f64::INFINITY,
    }
}

/// What a motion of each paddle may cost: the squares of their limits, over that of the largest.
pub(crate) fn relative_weights<T: Scalar, const P: usize>(max_displacements: &[T; P]) -> [T; P] {
    let largest =
        max_displacements.iter().fold(T::zero(), |largest, limit| if *limit > largest { *limit } else { largest });
    max_displacements.map(|limit| {
        let ratio = limit / largest;
        ratio * ratio
    })
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Table<T, D, N, P> {
    /// Checks every invariant that the controller relies on.
    ///
    /// # Errors
    /// The first invariant that does not hold, as its own [`TableError`].
    pub fn validate(&self) -> Result<(), TableError> {
        self.validate_geometry()?;
        self.validate_limits()?;
        self.validate_knots()?;
        self.validate_proportions()
    }

    fn validate_geometry(&self) -> Result<(), TableError> {
        finite(Field::TargetPosition, self.target_position.as_slice())?;
        for paddle in &self.paddles {
            let [start, end] = &paddle.extent;
            finite(Field::PaddleExtent, start.as_slice())?;
            finite(Field::PaddleExtent, end.as_slice())?;
        }
        unit(Field::NeedleAxis, &self.needle_axis)?;
        // As arrays: copies of column views have a check of their own that no compiler proves.
        let mut others = self.orthogonal.data.0.iter();
        while let Some(direction) = others.next() {
            let direction = SVector::from(*direction);
            unit(Field::OrthogonalDirection, &direction)?;
            let is_orthogonal = |other: &SVector<T, D>| other.dot(&direction).to_f64().abs() <= T::UNIT_TOLERANCE;
            let among_each_other = others.clone().all(|other| is_orthogonal(&SVector::from(*other)));
            ensure(is_orthogonal(&self.needle_axis) && among_each_other, TableError::NotOrthogonal)?;
        }
        Ok(())
    }

    fn validate_limits(&self) -> Result<(), TableError> {
        for paddle in &self.paddles {
            positive(Field::PaddleDisplacementLimit, paddle.max_displacement)?;
            positive(Field::PaddleRateLimit, paddle.max_rate)?;
        }
        positive(Field::ValidPaddleDisplacement, self.validity.paddle_displacement)?;
        positive(Field::NeedleSpeedLimit, self.validity.needle_speed)?;
        for paddle in &self.paddles {
            ensure(paddle.max_displacement <= self.validity.paddle_displacement, TableError::DisplacementRange)?;
        }
        finite(Field::Gains, &[self.gains.loop_gain, self.gains.lambda_max])?;
        let gain = self.gains.loop_gain.to_f64();
        ensure(gain > 0.0 && gain < 1.0 && self.gains.lambda_max.to_f64() >= 1.0, TableError::Gains)
    }

    fn validate_knots(&self) -> Result<(), TableError> {
        let (Some(first), Some(last)) = (self.knots.first(), self.knots.last()) else {
            return Err(TableError::TooFewKnots { found: 0 });
        };
        ensure(self.knots.len() >= 2, TableError::TooFewKnots { found: self.knots.len() })?;
        finite(Field::ValidityDepthRange, &[self.validity.depth_start, self.validity.depth_end])?;
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
        let weights = relative_weights(&self.paddles.each_ref().map(|paddle| paddle.max_displacement));
        for (index, knot) in self.knots.iter().enumerate() {
            let condition = joint_condition_number(&knot.jacobian, &weights);
            ensure(condition <= CONDITION_LIMIT, TableError::IllConditioned { knot: index })?;
            for (path, paddle) in knot.paddle_path.column_iter().zip(&self.paddles) {
                ensure(path.norm() <= paddle.max_displacement, TableError::PathBeyondLimit { knot: index })?;
            }
        }
        Ok(())
    }
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Table<T, D, N, P> {
    /// Every number against the table's own geometry: what is finite but out of all proportion would switch off the
    /// monitors that follow from it.
    fn validate_proportions(&self) -> Result<(), TableError> {
        let depth = (self.validity.depth_end - self.validity.depth_start).to_f64();
        let reach = |end: &SVector<T, D>| (end - self.target_position).norm().to_f64();
        let ends = self.paddles.iter().flat_map(|paddle| &paddle.extent);
        let distance = ends.map(reach).fold(0.0, f64::max);
        in_proportion(Field::DepthRange, depth, ASPECT_LIMIT * distance)?;
        in_proportion(Field::DistanceFromPaddleToTarget, distance, ASPECT_LIMIT * depth)?;
        let extent = LENGTH_MARGIN * (depth + distance);
        in_proportion(Field::ValidPaddleDisplacement, self.validity.paddle_displacement.to_f64(), extent)?;
        for paddle in &self.paddles {
            let fastest = CROSSINGS_PER_SECOND * paddle.max_displacement.to_f64();
            in_proportion(Field::PaddleRateLimit, paddle.max_rate.to_f64(), fastest)?;
        }
        in_proportion(Field::NeedleSpeedLimit, self.validity.needle_speed.to_f64(), CROSSINGS_PER_SECOND * depth)?;
        let bounds = TableBounds::of(self);
        for norm in bounds.jacobian_norm {
            in_proportion(Field::KnotJacobian, norm, JACOBIAN_LIMIT)?;
        }
        in_proportion(Field::TargetDisplacement, bounds.target_displacement, extent)?;
        in_proportion(Field::TargetDisplacementSlope, bounds.target_slope, DRAG_LIMIT)?;
        for (lift, paddle) in bounds.path_lift.iter().zip(&self.paddles) {
            in_proportion(Field::PaddlePathSlope, HERMITE_LIFT * lift, paddle.max_displacement.to_f64())?;
        }
        Ok(())
    }
}

impl<T: Scalar, const D: usize, const P: usize> Knot<T, D, P> {
    fn validate_finite(&self) -> Result<(), TableError> {
        finite(Field::KnotDepth, &[self.depth])?;
        for jacobian in &self.jacobian {
            finite(Field::KnotJacobian, jacobian.as_slice())?;
        }
        finite(Field::KnotPaddlePath, self.paddle_path.as_slice())?;
        finite(Field::KnotPaddlePathSlope, self.paddle_path_slope.as_slice())?;
        finite(Field::KnotTargetDisplacement, self.target_displacement.as_slice())?;
        finite(Field::KnotTargetDisplacementSlope, self.target_displacement_slope.as_slice())?;
        finite(Field::KnotStaticTargetDisplacement, self.static_target_displacement.as_slice())
    }
}

fn ensure(holds: bool, error: TableError) -> Result<(), TableError> {
    if holds { Ok(()) } else { Err(error) }
}

/// Not inlined: it is called a dozen times, and speed does not matter here.
#[inline(never)]
fn finite<T: Scalar>(field: Field, values: &[T]) -> Result<(), TableError> {
    ensure(values.iter().all(|value| value.to_f64().is_finite()), TableError::NotFinite { field })
}

#[inline(never)]
fn positive<T: Scalar>(field: Field, value: T) -> Result<(), TableError> {
    finite(field, &[value])?;
    ensure(value.to_f64() > 0.0, TableError::NotPositive { field })
}

/// Not a number is out of proportion, too: overflow on the way here.
#[inline(never)]
fn in_proportion(field: Field, value: f64, limit: f64) -> Result<(), TableError> {
    ensure(value <= limit, TableError::Implausible { field })
}

fn unit<T: Scalar, const D: usize>(field: Field, vector: &SVector<T, D>) -> Result<(), TableError> {
    finite(field, vector.as_slice())?;
    ensure((vector.norm().to_f64() - 1.0).abs() <= T::UNIT_TOLERANCE, TableError::NotUnit { field })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

    /// Of diagonal matrices every one of them is known: √(Σm · Σ1/m) with m = w₁a₁² + w₂a₂².
    #[test]
    fn condition_numbers_of_diagonal_jacobians_are_known() {
        let one = Matrix2::from_diagonal(&Vector2::new(1.0, 2.0));
        assert!((condition_number(&one) - 2.5).abs() < 1e-12);
        assert_eq!(joint_condition_number(&[one], &[0.3]), condition_number(&one));
        let (first, second) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.5, 0.0, -1.0));
        let together = joint_condition_number(&[first, second].map(|a| Matrix3::from_diagonal(&a)), &[1.0, 0.25]);
        let m = [1.0 + 0.25 * 0.25, 4.0, 9.0 + 0.25];
        let known: f64 = m.iter().sum::<f64>() * m.iter().map(|m| 1.0 / m).sum::<f64>();
        assert!((together - known.sqrt()).abs() < 1e-12, "{together}");
        assert_eq!(joint_condition_number(&[Matrix2::<f64>::zeros(); 2], &[1.0, 1.0]), f64::INFINITY);
    }

    #[test]
    fn a_motion_costs_what_the_limits_say() {
        assert_eq!(relative_weights(&[2.0, 4.0, 1.0]), [0.25, 1.0, 0.0625]);
    }
}
