//! Targets that jump: a wrong association.

use crate::detection::GATE_MOTION;
use crate::inputs::ledger::Discard;
use crate::inputs::sample::are_within;
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Cumulated motion of needle and paddle, length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Travel {
    pub(crate) needle: f64,
    /// Along each axis: square roots are dear.
    pub(crate) paddle: [f64; 2],
}

impl Travel {
    /// How far apart two positions of the paddle since `before` are at most, length. Larger plus (√2 − 1) times smaller
    /// component is the norm along the axes and between them, and at most 8 % more elsewhere.
    fn paddle_since(&self, before: &Self) -> f64 {
        let (x, y) = (self.paddle[0] - before.paddle[0], self.paddle[1] - before.paddle[1]);
        x.max(y) + (core::f64::consts::SQRT_2 - 1.0) * x.min(y)
    }
}

/// Accepted samples that are remembered; the motion since the oldest one may show in the newest measurement.
const GATE_HISTORY: usize = 8;
// Indices of the ring wrap with those of the machine.
const _: () = assert!(GATE_HISTORY.is_power_of_two());

/// Refuses target samples that jump further than motion and noise can explain (wrong association).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct InnovationGate {
    /// Motion so far.
    pub(crate) travel: Travel,
    /// Motion at the arrival of the last accepted samples: a ring, from `newest` on ever older.
    at_arrival: [Travel; GATE_HISTORY],
    newest: usize,
}

impl InnovationGate {
    /// A target sample has been accepted now.
    pub(crate) fn accept(&mut self) {
        self.newest = self.newest.wrapping_sub(1) % GATE_HISTORY;
        if let Some(oldest) = self.at_arrival.get_mut(self.newest) {
            *oldest = self.travel;
        }
    }

    /// Motion at the arrival of the accepted sample so many before the newest.
    fn at_arrival(&self, samples_ago: usize) -> Travel {
        self.at_arrival.get(self.newest.wrapping_add(samples_ago) % GATE_HISTORY).copied().unwrap_or_default()
    }

    /// |y − y_previous| ≤ 8σ√2 + 3·(slope·needle travel + ‖J‖·paddle travel) + floor, where the travel reaches back
    /// to everything that can lie between the two measurements.
    pub(crate) fn check<T: Scalar>(
        &self,
        runtime: &Runtime<T>,
        previous: &[f64; 2],
        current: &[f64; 2],
    ) -> Result<(), Discard> {
        let reach = (runtime.delay_samples as usize + 1).min(GATE_HISTORY - 1);
        let oldest = self.at_arrival(reach);
        let motion = runtime.target_slope * (self.travel.needle - oldest.needle)
            + runtime.jacobian_norm * self.travel.paddle_since(&oldest);
        let gate = GATE_MOTION * motion + runtime.target_jump;
        if are_within(current, previous, gate) { Ok(()) } else { Err(Discard::Innovation) }
    }
}
