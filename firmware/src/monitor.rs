//! Monitors of what single samples cannot show: frozen values, wrong associations, an actuator that does not follow,
//! a loop that diverges.

use crate::ledger::Discard;
use crate::runtime::Runtime;
use crate::scalar::Scalar;

/// Identical samples that are still a coincidence.
pub const FROZEN_SAMPLES: u32 = 5;
/// Travel that must change a value, part of the range of the depth or the paddle: well above any sensor's resolution.
pub const FROZEN_TRAVEL: f64 = 0.005;

/// Detects a value that stays bit-identical while the sequence advances and the needle moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FrozenMonitor {
    identical: u32,
    travel: f64,
}

impl FrozenMonitor {
    /// Enters whether the value is bit-identical and how far the needle went since the sample before it, length.
    pub(crate) fn check(&mut self, identical: bool, travel: f64, depth_range: f64) -> Result<(), Discard> {
        if !identical {
            *self = Self::default();
            return Ok(());
        }
        self.identical = self.identical.saturating_add(1);
        self.travel += travel;
        if self.identical >= FROZEN_SAMPLES && self.travel > FROZEN_TRAVEL * depth_range {
            Err(Discard::Frozen)
        } else {
            Ok(())
        }
    }
}

/// Detects a measured paddle position that stays bit-identical while the command goes away from where it was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FrozenPaddle {
    identical: u32,
    /// Command when the position was last seen to change, length.
    commanded: [f64; 2],
}

impl FrozenPaddle {
    /// Enters whether the position is bit-identical, the last command, and the sample's age, s.
    pub(crate) fn check<T: Scalar>(
        &mut self,
        runtime: &Runtime<T>,
        identical: bool,
        commanded: &[f64; 2],
        age: f64,
    ) -> Result<(), Discard> {
        if !identical || self.identical == 0 {
            *self = Self { identical: u32::from(identical), commanded: *commanded };
            return Ok(());
        }
        self.identical = self.identical.saturating_add(1);
        // What is on its way through the actuator cannot show yet.
        let range = runtime.limits.max_displacement.to_f64();
        let admitted = FROZEN_TRAVEL * range + runtime.unseen_motion(age);
        let (dx, dy) = (commanded[0] - self.commanded[0], commanded[1] - self.commanded[1]);
        let moved = dx * dx + dy * dy > admitted * admitted;
        if self.identical >= FROZEN_SAMPLES && moved { Err(Discard::Frozen) } else { Ok(()) }
    }
}

/// Cumulated motion of needle and paddle, length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Travel {
    pub(crate) needle: f64,
    pub(crate) paddle: f64,
}

/// Standard deviations of noise that one innovation may show: one false alarm in 10¹⁴ samples.
pub const GATE_SIGMAS: f64 = 8.0;
/// Motion that real tissue may add to what the table says.
pub const GATE_MOTION: f64 = 3.0;
/// Always admitted, part of the plausible range of the target: what a sensor without stated noise resolves.
pub const GATE_FLOOR: f64 = 0.01;
/// The same for a sensor whose noise is stated: only what the table may be wrong by between two samples.
pub const GATE_FLOOR_STATED: f64 = 0.002;
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

    /// Needle travel since the last accepted sample, length.
    pub(crate) fn needle_travel(&self) -> f64 {
        self.travel.needle - self.at_arrival(0).needle
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
            + runtime.jacobian_norm * (self.travel.paddle - oldest.paddle);
        let noise = GATE_SIGMAS * core::f64::consts::SQRT_2 * runtime.target_noise;
        let floor = if noise > 0.0 { GATE_FLOOR_STATED } else { GATE_FLOOR };
        let gate = noise + GATE_MOTION * motion + floor * runtime.target_range;
        let (dx, dy) = (current[0] - previous[0], current[1] - previous[1]);
        if dx * dx + dy * dy > gate * gate { Err(Discard::Innovation) } else { Ok(()) }
    }
}

/// Successive paddle samples off the command that are a fault: longer than any hiccup of a servo.
pub const FOLLOWING_SAMPLES: u32 = 20;

/// Trips when the paddle stays away from its command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FollowingMonitor {
    successive: u32,
}

impl FollowingMonitor {
    /// Enters a fresh paddle sample `age` seconds old; returns whether the fault is certain.
    pub(crate) fn update<T: Scalar>(
        &mut self,
        runtime: &Runtime<T>,
        measured: &[f64; 2],
        commanded: &[f64; 2],
        age: f64,
    ) -> bool {
        let admitted = runtime.following_error + runtime.unseen_motion(age);
        let (dx, dy) = (measured[0] - commanded[0], measured[1] - commanded[1]);
        let off = dx * dx + dy * dy > admitted * admitted;
        self.successive = if off { self.successive.saturating_add(1) } else { 0 };
        self.successive >= FOLLOWING_SAMPLES
    }
}

/// A window ends after this many time constants 1/g of the loop: enough for e³ of growth, too short for drift.
pub const DIVERGENCE_WINDOW: f64 = 3.0;
/// Growth of the error that is no transient. The lag behind a ramp approaches its end value from below.
pub const DIVERGENCE_GROWTH: f64 = 2.0;
/// Noise below which growth says nothing, standard deviations.
pub const DIVERGENCE_SIGMAS: f64 = 8.0;
/// Errors below this part of the plausible target range are left to the feedback.
pub const DIVERGENCE_FLOOR: f64 = 0.01;

/// Detects a loop with the wrong sign: the error grows while the feedback acts against it.
///
/// A loop of the right sign lags behind the steepest drift by at most slope·speed·(d + 1/g)·T, even when the
/// feed-forward is entirely wrong. An error that grows to twice its start and past twice this lag, while the
/// corrections should have removed it, means that they push the wrong way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DivergenceMonitor {
    samples: u32,
    start_error: f64,
    /// Correction applied since the start, as predicted change of the error, length.
    predicted: f64,
    /// Highest needle speed since re-arming, length/s.
    peak_speed: f64,
}

impl DivergenceMonitor {
    /// Enters a sample whose correction acts; returns whether the loop diverges.
    pub(crate) fn update<T: Scalar>(&mut self, runtime: &Runtime<T>, error: f64, needle_speed: f64) -> bool {
        let gain = runtime.gain.to_f64();
        self.peak_speed = self.peak_speed.max(needle_speed.abs());
        let lag_time = (f64::from(runtime.delay_samples) + 1.0 / gain) * runtime.target_period;
        let floor = (runtime.target_slope * self.peak_speed * lag_time)
            .max(DIVERGENCE_SIGMAS * runtime.target_noise)
            .max(DIVERGENCE_FLOOR * runtime.target_range);
        let magnitude = error.abs();
        if self.samples == 0 || f64::from(self.samples) * gain > DIVERGENCE_WINDOW || magnitude < self.start_error {
            *self = Self { samples: 0, start_error: magnitude, predicted: 0.0, ..*self };
        }
        self.samples += 1;
        let diverges = magnitude > DIVERGENCE_GROWTH * floor.max(self.start_error) && self.predicted >= floor;
        self.predicted += gain * magnitude;
        diverges
    }
}
