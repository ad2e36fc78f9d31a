//! How far paddles must go in space for the worst direction that the target may have to be moved in.
//!
//! N (3 × 2) is an orthonormal basis of the plane orthogonal to the needle, J (3 × 3 per paddle) the actuation Jacobian. With
//! the target's motion along the needle left free, a displacement Nβ takes paddles of least norm `(NᵀJ)⁺ β`, at worst
//! `1/σ_min(NᵀJ)` for |β| = 1. With no axial motion allowed it takes `J⁺Nβ`, at worst `‖J⁺N‖₂`, which is never less.

use super::super::controllability::{MAX_CONTROLLABILITY_MEASURE, MAX_JACOBIAN_CONDITION};
use crate::linalg::SingularValues;
use nalgebra::{DMatrix, Matrix3x2, Vector3};

/// What a Jacobian controls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controllability {
    /// 1/σ_min(NᵀJ); infinite where some orthogonal direction cannot be controlled.
    pub measure: f64,
    /// ‖J⁺N‖₂, the target's axial motion held at nothing; infinite where that cannot be had.
    pub full: f64,
    /// 1/σ_max(NᵀJ): the same as `measure` in the easiest direction.
    pub easiest: f64,
    /// The orthogonal direction in which `measure` is reached; its sign says nothing.
    pub worst_direction: Vector3<f64>,
    /// Condition number of NᵀJ.
    pub condition: f64,
}

impl Controllability {
    /// That of what controls nothing.
    pub(super) const NONE: Self = Self {
        measure: f64::INFINITY,
        full: f64::INFINITY,
        easiest: f64::INFINITY,
        worst_direction: Vector3::new(0.0, 0.0, 0.0),
        condition: f64::INFINITY,
    };

    /// That of a Jacobian with three rows and three columns per paddle.
    pub fn of(jacobian: &DMatrix<f64>, orthogonal: &Matrix3x2<f64>) -> Self {
        let whole = SingularValues::of(&(orthogonal.transpose() * jacobian)).zip(SingularValues::of(jacobian));
        let Some((across, whole)) = whole else { return Self::NONE };
        let (least, most) = (across.least(), across.most());
        let cut = whole.most() / MAX_JACOBIAN_CONDITION;
        let axially_held = (whole.least() > cut).then(|| whole.pseudo_inverse(cut) * orthogonal);
        let full = axially_held.and_then(|way| Some(SingularValues::of(&way)?.most())).unwrap_or(f64::INFINITY);
        let usable = |measure: f64| if measure <= MAX_CONTROLLABILITY_MEASURE { measure } else { f64::INFINITY };
        Self {
            measure: usable(1.0 / least),
            full: usable(full),
            easiest: 1.0 / most,
            worst_direction: orthogonal * across.left.column(1),
            condition: most / least,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J = diag(2, 4, 5) and the needle along z: the worst direction is x with 1/2; nothing is gained axially.
    #[test]
    fn a_diagonal_jacobian_has_the_measures_that_one_reads_off() {
        let n = Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        let one = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![2.0, 4.0, 5.0]));
        let found = Controllability::of(&one, &n);
        assert!((found.measure - 0.5).abs() < 1e-15 && (found.full - 0.5).abs() < 1e-15);
        assert!((found.easiest - 0.25).abs() < 1e-15 && (found.worst_direction.x.abs() - 1.0).abs() < 1e-15);
        // A second paddle that does the same halves the square of the norm.
        let both = DMatrix::from_fn(3, 6, |r, c| one[(r, c % 3)]);
        assert!((Controllability::of(&both, &n).measure - 0.5 / 2.0_f64.sqrt()).abs() < 1e-15);
    }

    /// Orthogonal motion that drags the target along the axis is free in the first measure and not in the second.
    #[test]
    fn axial_motion_costs_where_it_is_not_allowed() {
        let n = Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        let j = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 3.0, 0.0, 1.0]);
        let found = Controllability::of(&j, &n);
        assert!((found.measure - 1.0).abs() < 1e-14);
        // J⁻¹ e_x = (1, 0, −3).
        assert!((found.full - 10.0_f64.sqrt()).abs() < 1e-12);
        let singular = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
        let found = Controllability::of(&singular, &n);
        assert!((found.measure - 1.0).abs() < 1e-14 && found.full.is_infinite());
    }
}
