//! What one paddle cannot give is asked of the other.

use nalgebra::{SMatrix, SVector};

use super::Controller;
use super::feedback::Setting;
use super::state::{columns, of_columns};
use crate::scalar::Scalar;

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Controller<'_, T, D, N, P> {
    /// Adds to each goal what the other paddle's goal has beyond its limit: what that would have moved the target
    /// orthogonally to the needle, by the paddle's own inverse. Returns whether all of it was, but for less than half; what
    /// then is beyond this paddle's limit, too, is nobody's to give.
    ///
    /// Continuous, because an excess grows from 0, and without a memory, so that nothing winds up.
    #[inline(always)]
    pub(super) fn hand_over(&self, goals: &mut SMatrix<T, D, P>, setting: &Setting<'_, T, D, P>) -> bool {
        if P == 1 {
            return false;
        }
        let excess = self.beyond_limits(goals);
        if columns(&excess).as_flattened().iter().all(|component| *component == T::ZERO) {
            return false;
        }
        let (added, recovered) = self.taken_over(&excess, setting);
        *goals += added;
        recovered
    }

    /// The same for a correction of what feedback has added, `integral`: only what the correction makes the excess larger by,
    /// because what there was is handed over anyway.
    #[inline(always)]
    pub(super) fn hand_over_correction(
        &self,
        integral: &SMatrix<T, D, P>,
        correction: SMatrix<T, D, P>,
        setting: &Setting<'_, T, D, P>,
    ) -> SMatrix<T, D, P> {
        if P == 1 {
            return correction;
        }
        let setpoint = setting.feed_forward + integral;
        let more = self.beyond_limits(&(setpoint + correction)) - self.beyond_limits(&setpoint);
        correction + self.taken_over(&more, setting).0
    }

    /// How far each goal is outside of the admissible positions.
    fn beyond_limits(&self, goals: &SMatrix<T, D, P>) -> SMatrix<T, D, P> {
        let mut excess = [[T::ZERO; D]; P];
        for ((excess, goal), paddle) in excess.iter_mut().zip(columns(goals)).zip(&self.runtime.paddles) {
            let goal = SVector::from(*goal);
            *excess = (goal - paddle.limits.clamp_position(&goal)).into();
        }
        of_columns(excess)
    }

    /// What each paddle moves instead of the excess of the others, and whether that does more than half as much.
    #[inline(never)] // The loop's stack does not carry it while nothing saturates.
    fn taken_over(&self, excess: &SMatrix<T, D, P>, setting: &Setting<'_, T, D, P>) -> (SMatrix<T, D, P>, bool) {
        let jacobians = setting.location.jacobian();
        let mut taken = [[T::ZERO; D]; P];
        let (mut missed, mut wanted) = (T::ZERO, T::ZERO);
        for (place, (taken, jacobian)) in taken.iter_mut().zip(&jacobians).enumerate() {
            let mut others = SVector::<T, D>::zeros();
            for (other, (excess, jacobian)) in columns(excess).iter().zip(&jacobians).enumerate() {
                if other != place {
                    others += jacobian * SVector::from(*excess);
                }
            }
            let lost = self.table.orthogonal.tr_mul(&others);
            let [own] = self.runtime.direction.solve(&[*jacobian], &self.table.orthogonal, &[T::one()]);
            let given = own * lost;
            missed += (self.table.orthogonal.tr_mul(&(jacobian * given)) - lost).norm_squared();
            wanted += lost.norm_squared();
            *taken = given.into();
        }
        (of_columns(taken), missed < wanted * T::of(0.25))
    }
}
