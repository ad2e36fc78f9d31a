//! In which direction the paddle moves to remove an orthogonal error.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::contract::condition_number;
use crate::scalar::Scalar;

/// Condition number past which the inverse is damped. Below it the damped solution is the exact one, so that
/// well-placed paddles pay nothing; above it the paddle's excursion along the weak direction stays bounded.
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

/// Paddle direction per unit of orthogonal target displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// J⁻¹n: moves the target along n only, its axial position is left alone (the paper, section III.B).
    #[default]
    Inverse,
    /// Jₙᵀ/(Jₙ·Jₙᵀ) with Jₙ = nᵀJ: the shortest paddle motion; the target may also move along the axis.
    MinimumNorm,
}

impl Direction {
    /// Paddle displacement per unit of target displacement along `orthogonal` (n), from the actuation Jacobian J
    /// (rows target, columns paddle). Zero if the paddle cannot move the target.
    pub fn solve<T: Scalar, const D: usize>(
        self,
        jacobian: &SMatrix<T, D, D>,
        orthogonal: &SVector<T, D>,
    ) -> SVector<T, D> {
        match self {
            Self::Inverse => damped_inverse(jacobian, orthogonal),
            Self::MinimumNorm => {
                let row = jacobian.tr_mul(orthogonal);
                let squared = row.norm_squared();
                if squared > T::zero() { row / squared } else { row }
            }
        }
    }
}

/// Damped least squares (JᵀJ + μ²I)⁻¹Jᵀn with μ² = (‖J‖/κ_d)²·(1 − (κ_d/κ)²) past the condition number κ_d, and
/// μ = 0 up to it; continuous in κ (after Nakamura & Hanafusa, 1986).
fn damped_inverse<T: Scalar, const D: usize>(jacobian: &SMatrix<T, D, D>, orthogonal: &SVector<T, D>) -> SVector<T, D> {
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
    normal_matrix.try_inverse().map_or_else(SVector::zeros, |inverse| inverse * jacobian.tr_mul(orthogonal))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::contract::example::jacobian;

    #[test]
    fn the_inverse_leaves_the_axis_alone() {
        let n = Vector2::x();
        let moved = jacobian() * Direction::Inverse.solve(&jacobian(), &n);
        assert!((moved - n).norm() < 1e-14);
    }

    #[test]
    fn a_paddle_that_does_nothing_has_no_direction() {
        assert_eq!(Direction::MinimumNorm.solve(&Matrix2::<f64>::zeros(), &Vector2::x()), Vector2::zeros());
    }

    #[test]
    fn the_minimum_norm_is_shorter() {
        let n = Vector2::x();
        let shortest = Direction::MinimumNorm.solve(&jacobian(), &n);
        assert!((n.dot(&(jacobian() * shortest)) - 1.0).abs() < 1e-14);
        assert!(shortest.norm() < Direction::Inverse.solve(&jacobian(), &n).norm());
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
            let found = Direction::Inverse.solve(&jacobian, &n);
            assert!((found - expected).norm() < 1e-9 * expected.norm(), "{condition}: {found} {expected}");
        }
    }

    #[test]
    fn near_singular_directions_stay_bounded() {
        for exponent in 1..=12 {
            let smallest = 10f64.powi(-exponent);
            let n = Vector2::new(0.6, 0.8);
            let direction = Direction::Inverse.solve(&Matrix2::new(1.0, 0.0, 0.0, smallest), &n);
            assert!(direction.norm() <= DAMPING_CONDITION, "σ = {smallest}: {}", direction.norm());
        }
        assert_eq!(Direction::Inverse.solve(&Matrix2::<f64>::zeros(), &Vector2::x()), Vector2::zeros());
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
            let solved = Direction::Inverse.solve(&jacobian, &Vector2::new(0.6, 0.8));
            assert!((solved - expected).norm() < 1e-9 * expected.norm(), "σ {smallest}: {solved} {expected}");
        }
    }
}
