//! How far paddles must go in space for the worst direction that the target may have to be moved in.
//!
//! N (3 × 2) is an orthonormal basis of the plane orthogonal to the needle, J (3 × 3 per paddle) the actuation Jacobian. With
//! the target's motion along the needle left free, a displacement Nβ takes paddles of least norm `(NᵀJ)⁺ β`, at worst
//! `1/σ_min(NᵀJ)` for |β| = 1. With no axial motion allowed it takes `J⁺Nβ`, at worst `‖J⁺N‖₂`, which is never less.

use super::super::controllability::{MAX_CONTROLLABILITY_MEASURE, MAX_JACOBIAN_CONDITION};
use crate::linalg::SingularValues;
use nalgebra::storage::Storage;
use nalgebra::{DMatrix, Dim, Matrix, Matrix3x2, Vector3};

/// (NᵀJ)⁺: the least displacements of the paddles per orthogonal displacement of the target. None where they could not be had
/// by any use: of a condition number beyond [`MAX_JACOBIAN_CONDITION`], or longer than [`MAX_CONTROLLABILITY_MEASURE`].
pub fn least_displacements<R: Dim, C: Dim, S: Storage<f64, R, C>>(
    across: &Matrix<f64, R, C, S>,
) -> Option<DMatrix<f64>> {
    let found = SingularValues::of(across)?;
    let (least, most) = (found.least(), found.most());
    let is_usable = least * MAX_JACOBIAN_CONDITION >= most && least * MAX_CONTROLLABILITY_MEASURE >= 1.0;
    is_usable.then(|| found.pseudo_inverse(0.0))
}

/// Motion over that which is wanted that counts as none.
const AXIAL_MOTION: f64 = 1e-8;

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
        // Nothing has no direction in which it is least.
        let Some((across, whole)) = whole.filter(|(across, _)| across.most() > 0.0) else { return Self::NONE };
        let (least, most) = (across.least(), across.most());
        // What J cannot do may be a motion that nobody asks for, such as one along the needle alone.
        let way = whole.pseudo_inverse(1.0 / MAX_JACOBIAN_CONDITION) * orthogonal;
        let is_held = (jacobian * &way - orthogonal).amax() <= AXIAL_MOTION;
        let full = SingularValues::of(&way).filter(|_| is_held).map_or(f64::INFINITY, |way| way.most());
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
    use nalgebra::Matrix2x3;

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

    /// Where only motion along the needle cannot be had, nothing is missing; what J cannot do at all is told as that.
    #[test]
    fn what_nobody_asks_for_may_be_out_of_reach() {
        let n = Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        let no_axial = DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
        let found = Controllability::of(&no_axial, &n);
        assert!((found.measure - 0.5).abs() < 1e-15 && (found.full - 0.5).abs() < 1e-15, "{found:?}");
        for nothing in
            [DMatrix::zeros(3, 3), DMatrix::from_row_slice(3, 3, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])]
        {
            assert_eq!(Controllability::of(&nothing, &n), Controllability::NONE);
        }
    }

    #[test]
    fn displacements_that_no_paddle_could_go_are_none() {
        let across = |least: f64, most: f64| least_displacements(&Matrix2x3::new(most, 0.0, 0.0, 0.0, least, 0.0));
        let found = across(0.1, 2.0).unwrap();
        assert!((found[(0, 0)] - 0.5).abs() < 1e-15 && (found[(1, 1)] - 10.0).abs() < 1e-14);
        assert_eq!(found.shape(), (3, 2));
        // The condition number, the length, no rank, nothing.
        for [least, most] in [[1.0, 2e8], [1e-7, 2e-7], [0.0, 1.0], [0.0, 0.0], [f64::NAN, 1.0]] {
            assert_eq!(across(least, most), None, "{least} {most}");
        }
        // As small a length unit as one likes changes no ratio of lengths, and this is one: no absolute cut.
        assert!(across(2e-6, 2e-6).is_some());
    }
}
