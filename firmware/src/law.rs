//! In which direction the paddles move to remove an orthogonal error.
//!
//! With N the directions orthogonal to the needle and J = [J₁ … J_P] the actuation Jacobians of all paddles, an orthogonal
//! displacement e of the target is moved by the w = G·e for which Σ ‖wₚ‖²/cₚ is least, where cₚ is the square of paddle p's
//! largest displacement: a paddle that may go twice as far goes four times as far for the same effect.

use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};

use crate::contract::condition_number;
use crate::scalar::Scalar;

/// Condition number past which an inverse is damped. Below it the damped solution is the exact one, so that
/// well-placed paddles pay nothing; above it the excursion along the weak direction stays bounded.
pub const DAMPING_CONDITION: f64 = 1e2;

/// How measurements of the target become corrections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Feedback {
    /// Every sample moves the paddle by a fixed part of the error: no belief about sensor or tissue, the fewest
    /// instructions. What the table leaves grows with the depth, so that it lags behind; noise goes through.
    Integral,
    /// What the table leaves is estimated from sensor and table, as good as each is, and removed: see
    /// [`crate::observer`].
    #[default]
    Observer,
    /// The observer, which predicts a patient's breaths as well, once it has seen one.
    Harmonic,
}

/// Paddle directions per unit of orthogonal target displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// J⁺N: moves the target orthogonally to the needle only, its axial position is left alone (the paper, section
    /// III.B). J⁻¹n for the one paddle of the plane.
    #[default]
    Inverse,
    /// (NᵀJ)⁺: the shortest motion of the paddles; the target may also move along the axis.
    MinimumNorm,
}

impl Direction {
    /// What a table in this space is controlled with unless somebody chooses: in the plane one direction is to be left
    /// alone beside the one to be removed, and one paddle does both; in space that takes motions several times as long.
    pub const fn default_in(dimension: usize) -> Self {
        if dimension > 2 { Self::MinimumNorm } else { Self::Inverse }
    }

    /// Displacement of each paddle per unit of target displacement along each column of `orthogonal` (N), from the
    /// actuation Jacobians (rows target, columns paddle) and the squares of the paddles' limits over that of the largest.
    /// Zero if the paddles cannot move the target.
    pub fn solve<T: Scalar, const D: usize, const N: usize, const P: usize>(
        self,
        jacobians: &[SMatrix<T, D, D>; P],
        orthogonal: &SMatrix<T, D, N>,
        weights: &[T; P],
    ) -> [SMatrix<T, D, N>; P] {
        match (self, jacobians.as_slice()) {
            // Of a single paddle no weight matters, and its inverse is cheaper than one of squares.
            (Self::Inverse, [jacobian]) => [damped_inverse(jacobian, orthogonal); P],
            (Self::Inverse, _) => {
                let mut columns = [SMatrix::zeros(); P];
                for (column, jacobian) in columns.iter_mut().zip(jacobians) {
                    *column = jacobian.transpose();
                }
                weighted(&columns, orthogonal, weights)
            }
            (Self::MinimumNorm, _) => {
                let mut columns = [SMatrix::zeros(); P];
                for (column, jacobian) in columns.iter_mut().zip(jacobians) {
                    *column = jacobian.tr_mul(orthogonal);
                }
                if N == 1 { along_rows(columns, weights) } else { weighted(&columns, &SMatrix::identity(), weights) }
            }
        }
    }
}

/// What minimises Σ ‖wₚ‖²/cₚ with Σ Aₚ·wₚ = one column of `wanted` (R × N): wₚ = cₚ·Aₚᵀ·M⁻¹·wanted with M = Σ cₚ·Aₚ·Aₚᵀ,
/// from the columns Aₚᵀ (D × R).
///
/// Damped as [`damped_inverse`] is: M + μ²I with μ² = (tr M/κ_d²)·(1 − (κ_d/κ)²) past κ_d, where κ² = tr M · tr M⁻¹ is the
/// condition number of [√c₁·A₁ …] in the Frobenius norm.
#[inline(never)]
fn weighted<T: Scalar, const D: usize, const R: usize, const N: usize, const P: usize>(
    columns: &[SMatrix<T, D, R>; P],
    wanted: &SMatrix<T, R, N>,
    weights: &[T; P],
) -> [SMatrix<T, D, N>; P] {
    let mut joint = SMatrix::<T, R, R>::zeros();
    for (column, weight) in columns.iter().zip(weights) {
        joint += column.tr_mul(column) * *weight;
    }
    let size = joint.trace();
    let limit = T::of(DAMPING_CONDITION * DAMPING_CONDITION);
    let inverse = joint.try_inverse();
    // In squares. What is singular up to rounding may have any inverse, even a negative one.
    let condition = inverse.as_ref().map(|inverse| size * inverse.trace()).filter(|condition| *condition > T::zero());
    let inverse = match condition {
        Some(condition) if condition <= limit => inverse,
        _ => {
            let undamped = condition.map_or(T::zero(), |condition| limit / condition);
            let damping = size / limit * (T::one() - undamped);
            (joint + SMatrix::identity() * damping).try_inverse()
        }
    };
    let answer = inverse.map_or_else(SMatrix::zeros, |inverse| inverse * wanted);
    let mut directions = [SMatrix::zeros(); P];
    for ((direction, column), weight) in directions.iter_mut().zip(columns).zip(weights) {
        *direction = column * answer * *weight;
    }
    directions
}

/// The same for one direction, whose M is a number: rows and their weighted squares.
#[inline(always)]
fn along_rows<T: Scalar, const D: usize, const N: usize, const P: usize>(
    mut rows: [SMatrix<T, D, N>; P],
    weights: &[T; P],
) -> [SMatrix<T, D, N>; P] {
    let mut squares = rows.iter().zip(weights).map(|(row, weight)| row.norm_squared() * *weight);
    let first = squares.next().unwrap_or_else(T::zero);
    let squared = squares.fold(first, |sum, square| sum + square);
    if squared > T::zero() {
        for (row, weight) in rows.iter_mut().zip(weights) {
            *row = *row * *weight / squared;
        }
    }
    rows
}

/// Damped least squares (JᵀJ + μ²I)⁻¹JᵀN with μ² = (‖J‖/κ_d)²·(1 − (κ_d/κ)²) past the condition number κ_d, and
/// μ = 0 up to it; continuous in κ (after Nakamura & Hanafusa, 1986).
fn damped_inverse<T: Scalar, const D: usize, const N: usize>(
    jacobian: &SMatrix<T, D, D>,
    orthogonal: &SMatrix<T, D, N>,
) -> SMatrix<T, D, N> {
    // The condition number in squares, from the inverse that is needed anyway.
    if let Some(inverse) = jacobian.try_inverse() {
        let squared = jacobian.norm_squared().to_f64() * inverse.norm_squared().to_f64();
        if squared <= DAMPING_CONDITION * DAMPING_CONDITION {
            return inverse * orthogonal;
        }
    }
    let condition = condition_number(jacobian);
    let ratio = DAMPING_CONDITION / condition;
    let scale = jacobian.norm() / T::of(DAMPING_CONDITION);
    let damping = scale * scale * T::of(1.0 - ratio * ratio);
    let normal_matrix = jacobian.tr_mul(jacobian) + SMatrix::identity() * damping;
    normal_matrix.try_inverse().map_or_else(SMatrix::zeros, |inverse| inverse * jacobian.tr_mul(orthogonal))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::contract::example::jacobian;

    /// Of one paddle in the plane.
    fn solve(direction: Direction, jacobian: Matrix2<f64>, n: &Vector2<f64>) -> Vector2<f64> {
        let [solved] = direction.solve(&[jacobian], n, &[1.0]);
        solved
    }

    #[test]
    fn the_inverse_leaves_the_axis_alone() {
        let n = Vector2::x();
        let moved = jacobian() * solve(Direction::Inverse, jacobian(), &n);
        assert!((moved - n).norm() < 1e-14);
    }

    #[test]
    fn a_paddle_that_does_nothing_has_no_direction() {
        assert_eq!(solve(Direction::MinimumNorm, Matrix2::<f64>::zeros(), &Vector2::x()), Vector2::zeros());
    }

    #[test]
    fn the_minimum_norm_is_shorter() {
        let n = Vector2::x();
        let shortest = solve(Direction::MinimumNorm, jacobian(), &n);
        assert!((n.dot(&(jacobian() * shortest)) - 1.0).abs() < 1e-14);
        assert!(shortest.norm() < solve(Direction::Inverse, jacobian(), &n).norm());
    }

    /// μ = 0 up to the condition number κ_d, by the formula in the documentation of `damped_inverse` past it.
    #[test]
    fn damping_begins_where_it_is_said_to() {
        let n = Vector2::new(0.6, 0.8);
        for condition in [20.0, 50.0, 99.0, 101.0, 1e3] {
            // Its condition number in the Frobenius norm is x + 1/x.
            let x: f64 = 0.5 * (condition + (condition * condition - 4.0_f64).sqrt());
            let jacobian = Matrix2::new(3.0, 0.0, 0.0, 3.0 / x);
            let ratio = DAMPING_CONDITION / condition;
            let damping = if ratio >= 1.0 {
                0.0
            } else {
                jacobian.norm_squared() / (DAMPING_CONDITION * DAMPING_CONDITION) * (1.0 - ratio * ratio)
            };
            let expected = Vector2::from_fn(|k, _| {
                let entry = jacobian[(k, k)];
                entry * n[k] / (entry * entry + damping)
            });
            let found = solve(Direction::Inverse, jacobian, &n);
            assert!((found - expected).norm() < 1e-9 * expected.norm(), "{condition}: {found} {expected}");
        }
    }

    /// Two paddles in the plane with unequal limits: of all w with Σ nᵀJₚ·wₚ = 1 the one of least Σ ‖wₚ‖²/cₚ, which Lagrange's condition
    /// makes wₚ = cₚ·Jₚᵀn over the sum of cₚ·‖Jₚᵀn‖².
    #[test]
    fn limits_weigh_how_several_share_one_direction() {
        let n = Vector2::new(0.6, 0.8);
        let jacobians = [jacobian(), Matrix2::new(0.2, -0.1, 0.3, 0.5)];
        let weights = [0.25, 9.0];
        let found = Direction::MinimumNorm.solve(&jacobians, &n, &weights);
        let rows = jacobians.map(|jacobian| jacobian.tr_mul(&n));
        let sum: f64 = rows.iter().zip(weights).map(|(row, weight)| weight * row.norm_squared()).sum();
        for ((found, row), weight) in found.iter().zip(rows).zip(weights) {
            assert!((found - row * (weight / sum)).norm() < 1e-14, "{found} {row} {weight}");
        }
        let moved: f64 = jacobians.iter().zip(found).map(|(jacobian, w)| n.dot(&(jacobian * w))).sum();
        assert!((moved - 1.0).abs() < 1e-14);
    }

    /// A second paddle that moves nothing changes nothing of how the first one is damped.
    #[test]
    fn several_are_damped_as_one() {
        let n = Vector2::new(0.6, 0.8);
        for condition in [20.0, 99.0, 101.0, 1e3] {
            let x: f64 = 0.5 * (condition + (condition * condition - 4.0_f64).sqrt());
            let jacobian = Matrix2::new(3.0, 0.2, 0.0, 3.0 / x);
            let expected = solve(Direction::Inverse, jacobian, &n);
            let [found, still] = Direction::Inverse.solve(&[jacobian, Matrix2::zeros()], &n, &[1.0, 1.0]);
            assert!((found - expected).norm() < 1e-9 * expected.norm(), "{condition}: {found} {expected}");
            assert_eq!(still, Vector2::zeros());
        }
    }

    #[test]
    fn near_singular_directions_stay_bounded() {
        for exponent in 1..=12 {
            let smallest = 10f64.powi(-exponent);
            let n = Vector2::new(0.6, 0.8);
            let direction = solve(Direction::Inverse, Matrix2::new(1.0, 0.0, 0.0, smallest), &n);
            assert!(direction.norm() <= DAMPING_CONDITION, "σ = {smallest}: {}", direction.norm());
        }
        assert_eq!(solve(Direction::Inverse, Matrix2::<f64>::zeros(), &Vector2::x()), Vector2::zeros());
    }

    #[test]
    fn past_the_condition_limit_the_inverse_is_damped_by_the_formula() {
        for smallest in [1e-1, 1e-2, 3e-3, 1e-4] {
            // Singular values 2 and 2σ along the axes: (σ² + μ²)⁻¹σ for each, by hand.
            let jacobian = Matrix2::new(2.0, 0.0, 0.0, 2.0 * smallest);
            let condition = (1.0 + smallest * smallest) / smallest;
            let ratio = (DAMPING_CONDITION / condition).min(1.0);
            let norm = 2.0 * (1.0 + smallest * smallest).sqrt();
            let damping = (norm / DAMPING_CONDITION).powi(2) * (1.0 - ratio * ratio);
            let component = |value: f64, n: f64| value / (value * value + damping) * n;
            let expected = Vector2::new(component(2.0, 0.6), component(2.0 * smallest, 0.8));
            let solved = solve(Direction::Inverse, jacobian, &Vector2::new(0.6, 0.8));
            assert!((solved - expected).norm() < 1e-9 * expected.norm(), "σ {smallest}: {solved} {expected}");
        }
    }
}
