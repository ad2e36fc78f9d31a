//! Targets that jump: a wrong association.

use crate::detection::GATE_MOTION;
use crate::inputs::ledger::Discard;
use crate::inputs::sample::are_within;
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Cumulated motion of needle and paddle, length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Travel<const D: usize = 2, const P: usize = 1> {
    pub(crate) needle: f64,
    /// Of each paddle along each axis: square roots are dear.
    pub(crate) paddles: [[f64; D]; P],
}

impl<const D: usize, const P: usize> Default for Travel<D, P> {
    fn default() -> Self {
        Self { needle: 0.0, paddles: [[0.0; D]; P] }
    }
}

/// How far apart two positions of a paddle between two travels are at most, length. Larger plus (√2 − 1) times smaller
/// component is the norm along the axes and between them, and at most 8 % more elsewhere; with a third component the
/// same of those two and the third, at most 17 %.
#[inline(always)]
fn farthest<const D: usize>(now: &[f64; D], before: &[f64; D]) -> f64 {
    let together = |x: f64, y: f64| x.max(y) + (core::f64::consts::SQRT_2 - 1.0) * x.min(y);
    // Written out: compiled for size, a fold is a call.
    match (now.as_slice(), before.as_slice()) {
        ([x, y], [u, v]) => together(x - u, y - v),
        ([x, y, z], [u, v, w]) => together(together(x - u, y - v), z - w),
        _ => 0.0,
    }
}

/// Accepted samples that are remembered; the motion since the oldest one may show in the newest measurement.
const GATE_HISTORY: usize = 8;
// Indices of the ring wrap with those of the machine.
const _: () = assert!(GATE_HISTORY.is_power_of_two());

/// Refuses target samples that jump further than motion and noise can explain (wrong association).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InnovationGate<const D: usize = 2, const P: usize = 1> {
    /// Motion so far.
    pub(crate) travel: Travel<D, P>,
    /// Motion at the arrival of the last accepted samples: a ring, from `newest` on ever older.
    at_arrival: [Travel<D, P>; GATE_HISTORY],
    newest: usize,
}

impl<const D: usize, const P: usize> Default for InnovationGate<D, P> {
    fn default() -> Self {
        Self { travel: Travel::default(), at_arrival: [Travel::default(); GATE_HISTORY], newest: 0 }
    }
}

impl<const D: usize, const P: usize> InnovationGate<D, P> {
    /// A target sample has been accepted now.
    pub(crate) fn accept(&mut self) {
        self.newest = self.newest.wrapping_sub(1) % GATE_HISTORY;
        if let Some(oldest) = self.at_arrival.get_mut(self.newest) {
            *oldest = self.travel;
        }
    }

    /// Motion at the arrival of the accepted sample so many before the newest.
    fn at_arrival(&self, samples_ago: usize) -> Travel<D, P> {
        self.at_arrival.get(self.newest.wrapping_add(samples_ago) % GATE_HISTORY).copied().unwrap_or_default()
    }

    /// |y − y_previous| ≤ 8σ√2 + 3·(slope·needle travel + Σ ‖Jₚ‖·paddle travel) + floor, where the travel reaches back
    /// to everything that can lie between the two measurements.
    pub(crate) fn check<T: Scalar>(
        &self,
        runtime: &Runtime<T, P>,
        previous: &[f64; D],
        current: &[f64; D],
    ) -> Result<(), Discard> {
        let reach = (runtime.delay_samples as usize + 1).min(GATE_HISTORY - 1);
        let oldest = self.at_arrival(reach);
        let mut motion = runtime.target_slope * (self.travel.needle - oldest.needle);
        for ((now, before), paddle) in self.travel.paddles.iter().zip(&oldest.paddles).zip(&runtime.paddles) {
            motion += paddle.jacobian_norm * farthest(now, before);
        }
        let gate = GATE_MOTION * motion + runtime.target_jump;
        if are_within(current, previous, gate) { Ok(()) } else { Err(Discard::Innovation) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Larger component plus (√2 − 1) times the smaller one, and the same of those two and the third.
    #[test]
    fn what_was_travelled_is_a_difference() {
        const K: f64 = core::f64::consts::SQRT_2 - 1.0;
        assert!((farthest(&[5.0, 1.0], &[1.0, 0.5]) - (4.0 + 0.5 * K)).abs() < 1e-15);
        assert!((farthest(&[1.5, 1.0, 7.0], &[1.0, 0.5, 3.0]) - (4.0 + (0.5 + 0.5 * K) * K)).abs() < 1e-15);
        assert_eq!(farthest(&[2.0; 3], &[2.0; 3]), 0.0);
    }
}
