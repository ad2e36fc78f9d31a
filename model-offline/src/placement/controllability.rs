//! Which way a paddle controls the target, and how much of its way that takes.

use nalgebra::{Matrix2, Vector2};

/// Above this condition number a Jacobian controls nothing that a real paddle could use.
pub const MAX_JACOBIAN_CONDITION: f64 = 1e8;
/// A paddle that must go farther than this many times the target's way controls nothing either: what the target then
/// answers is little more than what the discretization leaves.
pub const MAX_CONTROLLABILITY_MEASURE: f64 = 1e6;

/// A Jacobian that cannot be inverted to any use.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the actuation Jacobian is singular (condition number {condition:.1e})")]
pub struct SingularJacobian {
    /// Its condition number.
    pub condition: f64,
}

/// J⁻¹ n: the paddle displacement that moves the target by one along n and not at all across. Its length is the
/// controllability measure.
///
/// # Errors
/// [`SingularJacobian`] when the condition number is beyond [`MAX_JACOBIAN_CONDITION`], or the length beyond
/// [`MAX_CONTROLLABILITY_MEASURE`].
pub fn best_direction(jacobian: &Matrix2<f64>, normal: Vector2<f64>) -> Result<Vector2<f64>, SingularJacobian> {
    let values = jacobian.singular_values();
    let condition = values.max() / values.min();
    let direction =
        jacobian.try_inverse().filter(|_| condition <= MAX_JACOBIAN_CONDITION).map(|inverse| inverse * normal);
    direction.filter(|d| d.norm() <= MAX_CONTROLLABILITY_MEASURE).ok_or(SingularJacobian { condition })
}

/// Rows of a matrix as arrays.
pub fn rows(m: &Matrix2<f64>) -> [[f64; 2]; 2] {
    [[m[(0, 0)], m[(0, 1)]], [m[(1, 0)], m[(1, 1)]]]
}
