//! Settings and table, built once into the numbers that a step uses.

use super::{Settings, SettingsError, check, check_periods};
use crate::contract::{Faults, Paddle, Table, TableBounds, relative_weights};
use crate::detection::{
    DEPTH_MARGIN, FOLLOWING_FRACTION, GATE_FLOOR, GATE_FLOOR_STATED, GATE_SIGMAS, NEEDLE_SPEED_MARGIN, PADDLE_MARGIN,
    RESOLUTION_PER_FOLLOWING_ERROR, SAFE_AGE_FLOOR_NS, TARGET_MARGIN, TARGET_SAMPLES_TO_HOLD, TARGET_SAMPLES_TO_SAFE,
    TICKS_TO_HOLD,
};
use crate::law::{Direction, Feedback};
use crate::limits::Limits;
use crate::loop_stability;
use crate::observer::Belief;
use crate::scalar::Scalar;
use crate::units::seconds;

/// Limits of the age of an input, ns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AgeLimits {
    pub(crate) hold_ns: u64,
    pub(crate) safe_ns: u64,
}

/// What a step uses of one paddle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PaddleRuntime<T: Scalar> {
    /// Identity, as in the table.
    pub(crate) index: u32,
    pub(crate) limits: Limits<T>,
    /// Rate limit, length/s.
    pub(crate) rate: f64,
    /// Largest plausible measured displacement, length.
    pub(crate) range: f64,
    pub(crate) following_error: f64,
    /// What its sensor resolves, length.
    pub(crate) resolution: f64,
    /// Largest ‖J‖.
    pub(crate) jacobian_norm: f64,
}

/// Settings and table in the form that a step uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Runtime<T: Scalar, const P: usize = 1> {
    pub(crate) paddles: [PaddleRuntime<T>; P],
    /// What a motion of each paddle may cost: the squares of their limits over that of the largest.
    pub(crate) weights: [T; P],
    pub(crate) gain: T,
    pub(crate) feedback: Feedback,
    /// What the observer believes.
    pub(crate) belief: Belief<T>,
    /// Longest time from a measurement of the target to the tick that uses it, ns.
    pub(crate) history_ns: u64,
    pub(crate) direction: Direction,
    pub(crate) loop_period_ns: u64,
    pub(crate) actuator_delay_ns: u64,
    pub(crate) delay_samples: u32,
    /// Target period, s.
    pub(crate) target_period: f64,
    pub(crate) target_noise: f64,
    pub(crate) needle_age: AgeLimits,
    /// From which age of the needle's samples on it holds, s.
    pub(crate) needle_gap: f64,
    pub(crate) target_age: AgeLimits,
    pub(crate) paddle_age: AgeLimits,
    /// Depths that the table covers.
    pub(crate) table_depth: (f64, f64),
    /// Depths that are plausible.
    pub(crate) plausible_depth: (f64, f64),
    pub(crate) needle_speed: f64,
    /// Fastest needle that is plausible.
    pub(crate) plausible_speed: f64,
    /// Largest plausible target displacement, length.
    pub(crate) target_range: f64,
    /// How far two samples of the target may be apart without any motion, length.
    pub(crate) target_jump: f64,
    /// Largest |d(target displacement)/d(depth)|, with or without paddle motion.
    pub(crate) target_slope: f64,
    /// Until a command shows in a measured position, s.
    pub(crate) unseen_delay: f64,
    /// Codes of monitors that are off.
    #[cfg(feature = "switches")]
    pub(crate) off: Faults,
}

impl<T: Scalar, const P: usize> Runtime<T, P> {
    /// Validates `settings` and combines them with a valid `table`.
    pub(crate) fn new<const D: usize, const N: usize>(
        table: &Table<T, D, N, P>,
        settings: &Settings,
    ) -> Result<Self, SettingsError> {
        let () = Table::<T, D, N, P>::SHAPE;
        check_periods(settings)?;
        let delay_samples = settings.delay_samples();
        if delay_samples > loop_stability::MAX_DELAY_SAMPLES {
            return Err(SettingsError::Delay { samples: delay_samples });
        }
        let lambda_max = settings.lambda_max.unwrap_or(table.gains.lambda_max.to_f64());
        check("lambda_max", "from 1 to 100", (1.0..=100.0).contains(&lambda_max))?;
        // Not limited to the stable range: stability is charted on both sides of its limit.
        let gain = settings.loop_gain.unwrap_or(loop_stability::default_gain(delay_samples, lambda_max));
        check("loop gain", "above 0 and at most 2", gain > 0.0 && gain <= 2.0)?;
        let noise = settings.target_noise;
        check("target noise", "finite and not negative", noise.is_finite() && noise >= 0.0)?;
        let following_error = settings.following_error.unwrap_or(1.0);
        check("following error", "finite and positive", following_error.is_finite() && following_error > 0.0)?;
        let bounds = TableBounds::of(table);
        let mut norms = bounds.jacobian_norm.into_iter();
        let paddles = table
            .paddles
            .each_ref()
            .map(|paddle| PaddleRuntime::new(paddle, norms.next().unwrap_or_default(), settings));
        let loop_age = AgeLimits {
            hold_ns: TICKS_TO_HOLD * settings.loop_period_ns,
            safe_ns: SAFE_AGE_FLOOR_NS.max(10 * TICKS_TO_HOLD * settings.loop_period_ns),
        };
        let target_age = AgeLimits {
            hold_ns: settings.target_latency_ns + TARGET_SAMPLES_TO_HOLD * settings.target_period_ns,
            safe_ns: SAFE_AGE_FLOOR_NS
                .max(settings.target_latency_ns + TARGET_SAMPLES_TO_SAFE * settings.target_period_ns),
        };
        let (start, end) = (table.validity.depth_start.to_f64(), table.validity.depth_end.to_f64());
        let margin = DEPTH_MARGIN * (end - start);
        let moved = paddles.iter().map(|paddle| paddle.jacobian_norm * paddle.limits.max_displacement.to_f64());
        let target_range = moved.fold(TARGET_MARGIN * bounds.target_displacement, |sum, moved| sum + moved);
        let belief = Belief::new(noise, bounds.target_slope, end - start, target_range, gain.min(1.0));
        let belief = match settings.feedback {
            Feedback::Harmonic => belief.with_breathing(seconds(settings.target_period_ns)),
            Feedback::Integral | Feedback::Observer => belief,
        };
        Ok(Self {
            paddles,
            weights: relative_weights(&table.paddles.each_ref().map(|paddle| paddle.max_displacement)),
            gain: T::of(gain),
            feedback: settings.feedback,
            belief,
            history_ns: settings.target_latency_ns
                + TARGET_SAMPLES_TO_HOLD * settings.target_period_ns
                + settings.actuator_delay_ns,
            direction: settings.direction.unwrap_or(Direction::default_in(D)),
            loop_period_ns: settings.loop_period_ns,
            actuator_delay_ns: settings.actuator_delay_ns,
            delay_samples,
            target_period: seconds(settings.target_period_ns),
            target_noise: noise,
            needle_age: loop_age,
            needle_gap: seconds(loop_age.hold_ns),
            target_age,
            paddle_age: loop_age,
            table_depth: (start, end),
            plausible_depth: (start - margin, end + margin),
            needle_speed: table.validity.needle_speed.to_f64(),
            plausible_speed: NEEDLE_SPEED_MARGIN * table.validity.needle_speed.to_f64(),
            target_range,
            target_jump: unexplained_jump(noise, target_range),
            target_slope: bounds.target_slope,
            unseen_delay: seconds(settings.actuator_delay_ns.saturating_add(settings.loop_period_ns)),
            #[cfg(feature = "switches")]
            off: Faults::NONE,
        })
    }
}

impl<T: Scalar> PaddleRuntime<T> {
    /// Of a paddle of the table and the largest norm of its Jacobian.
    fn new<const D: usize>(paddle: &Paddle<T, D>, jacobian_norm: f64, settings: &Settings) -> Self {
        let max_displacement = paddle.max_displacement.to_f64();
        let rate = paddle.max_rate.to_f64();
        let following_error = settings.following_error.unwrap_or(FOLLOWING_FRACTION * max_displacement);
        Self {
            index: paddle.index,
            limits: Limits {
                shape: settings.position_limit,
                max_displacement: paddle.max_displacement,
                max_step: T::of(rate * seconds(settings.loop_period_ns)),
            },
            rate,
            range: PADDLE_MARGIN * max_displacement,
            following_error,
            resolution: RESOLUTION_PER_FOLLOWING_ERROR * following_error,
            jacobian_norm,
        }
    }

    /// What the command may have moved since a position that was measured `age` s ago was asked for, when a command
    /// shows after `delay` s at the latest, length.
    pub(crate) fn unseen_motion(&self, age: f64, delay: f64) -> f64 {
        self.rate * (age + delay)
    }
}

/// How far noise alone sets two samples of the target apart, length: 8σ√2 and a part of the target's range.
fn unexplained_jump(target_noise: f64, target_range: f64) -> f64 {
    let noise = GATE_SIGMAS * core::f64::consts::SQRT_2 * target_noise;
    noise + target_range * if noise > 0.0 { GATE_FLOOR_STATED } else { GATE_FLOOR }
}

impl<T: Scalar, const P: usize> Runtime<T, P> {
    /// What remains of `faults` when some monitors are off: everything, outside of test benches.
    #[inline(always)]
    pub(crate) fn seen(&self, faults: Faults) -> Faults {
        #[cfg(feature = "switches")]
        let faults = Faults::from_bits(faults.bits() & !self.off.bits());
        faults
    }

    /// Extent of the table in depth, length.
    pub(crate) fn depth_range(&self) -> f64 {
        self.table_depth.1 - self.table_depth.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::example::table;

    const MS: u64 = 1_000_000;

    #[test]
    fn delay_counts_the_samples_that_cannot_show_a_correction() {
        assert_eq!(Settings::new(MS, 20 * MS, 20 * MS).delay_samples(), 1);
        assert_eq!(Settings::new(MS, 20 * MS, 0).delay_samples(), 0);
        assert_eq!(Settings::new(MS, 20 * MS, 39 * MS).delay_samples(), 2);
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refuse = |settings| Runtime::new(&table(), &settings).unwrap_err();
        let good = Settings::new(MS, 20 * MS, 20 * MS);
        Runtime::new(&table(), &good).unwrap();
        assert_eq!(refuse(Settings { loop_period_ns: 0, ..good }), SettingsError::Period { field: "loop period" });
        assert_eq!(refuse(Settings { target_period_ns: 1, ..good }), SettingsError::TargetFasterThanLoop);
        assert!(matches!(refuse(Settings { target_latency_ns: 2_000 * MS, ..good }), SettingsError::Delay { .. }));
        for gain in [f64::NAN, 0.0, -1.0, 3.0] {
            assert!(matches!(refuse(Settings { loop_gain: Some(gain), ..good }), SettingsError::Range { .. }));
        }
        assert!(matches!(refuse(Settings { target_noise: f64::INFINITY, ..good }), SettingsError::Range { .. }));
    }

    #[test]
    fn the_limits_follow_from_settings_and_table() {
        let settings = Settings { actuator_delay_ns: 3 * MS, ..Settings::new(2 * MS, 20 * MS, 30 * MS) };
        let runtime = Runtime::new(&table(), &settings).unwrap();
        assert_eq!((runtime.needle_age.hold_ns, runtime.needle_age.safe_ns), (10 * MS, 250 * MS));
        assert_eq!((runtime.paddle_age.hold_ns, runtime.paddle_age.safe_ns), (10 * MS, 250 * MS));
        assert_eq!((runtime.target_age.hold_ns, runtime.target_age.safe_ns), (90 * MS, 330 * MS));
        let slow = Runtime::new(&table(), &Settings::new(20 * MS, 20 * MS, 0)).unwrap();
        assert_eq!((slow.needle_age.hold_ns, slow.needle_age.safe_ns), (100 * MS, 1000 * MS));
        assert_eq!((slow.target_age.hold_ns, slow.target_age.safe_ns), (60 * MS, 300 * MS));
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        let slope = (0.02f64 * 0.02 + 0.1 * 0.1).sqrt();
        let jacobian = (0.3f64.powi(2) + 0.05f64.powi(2) + 0.04f64.powi(2) + 0.25f64.powi(2)).sqrt();
        let [paddle] = runtime.paddles;
        close(paddle.limits.max_step, 0.1 * 2e-3);
        close(runtime.target_slope, slope);
        close(paddle.jacobian_norm, jacobian);
        close(runtime.target_range, 3.0 * 0.1 * slope + jacobian * 0.05);
        close(paddle.range, 0.055);
        close(paddle.following_error, 0.001);
        close(paddle.resolution, 0.0001);
        close(runtime.plausible_speed, 1.0);
        close(runtime.depth_range(), 0.1);
        close(Runtime { table_depth: (1.0, 3.0), ..runtime }.depth_range(), 2.0);
        close(runtime.plausible_depth.0, -0.1);
        close(runtime.plausible_depth.1, 0.2);
        close(paddle.unseen_motion(0.01, runtime.unseen_delay), 0.1 * (0.01 + 0.005));
        assert_eq!((runtime.delay_samples, runtime.gain, paddle.index, runtime.weights), (1, 0.25, 3, [1.0]));
    }

    #[cfg(feature = "switches")]
    #[test]
    fn codes_of_monitors_that_are_off_are_not_seen_and_all_others_are() {
        let runtime = Runtime::new(&table(), &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
        let faults = Faults::FROZEN | Faults::INNOVATION;
        assert_eq!(runtime.seen(faults), faults);
        let switched = Runtime { off: Faults::FROZEN | Faults::OVERRUN, ..runtime };
        assert_eq!(switched.seen(faults), Faults::INNOVATION);
    }

    #[test]
    fn a_refusal_says_what_to_do() {
        let good = Settings::new(MS, 20 * MS, 20 * MS);
        for (settings, words) in [
            (Settings { loop_period_ns: 0, ..good }, "loop period must be above 0"),
            (Settings { target_period_ns: MS / 2, ..good }, "raise the loop rate"),
            (Settings { target_latency_ns: 10_000 * MS, ..good }, "lower the latency"),
            (Settings { target_noise: f64::NAN, ..good }, "must be"),
        ] {
            let refusal = Runtime::new(&table(), &settings).unwrap_err();
            assert!(std::format!("{refusal}").contains(words), "{refusal}");
        }
    }

    #[test]
    fn settings_are_refused_at_their_limits() {
        let good = Settings::new(MS, 20 * MS, 20 * MS);
        let runtime = |settings: Settings| Runtime::new(&table(), &settings);
        let ten_s = 10_000 * MS;
        for (settings, holds) in [
            (Settings { loop_period_ns: ten_s, target_period_ns: ten_s, ..good }, true),
            (Settings { target_latency_ns: ten_s, ..Settings::new(ten_s, ten_s, 0) }, true),
            (Settings { target_latency_ns: ten_s + 1, ..Settings::new(ten_s, ten_s, 0) }, false),
            (Settings { loop_period_ns: ten_s + 1, target_period_ns: ten_s + 1, ..good }, false),
            (Settings { target_period_ns: ten_s + 1, ..good }, false),
            (Settings { target_period_ns: MS, target_latency_ns: 0, ..good }, true),
            (Settings { target_period_ns: MS - 1, ..good }, false),
            (Settings { target_period_ns: ten_s, target_latency_ns: ten_s, ..good }, true),
            (Settings { target_period_ns: ten_s, target_latency_ns: ten_s + 1, ..good }, false),
            (Settings { target_period_ns: ten_s, actuator_delay_ns: ten_s + 1, ..good }, false),
            (Settings { target_latency_ns: (65 * 20 - 3) * MS, ..good }, true),
            (Settings { target_latency_ns: (65 * 20 - 2) * MS, ..good }, false),
            (Settings { lambda_max: Some(1.0), ..good }, true),
            (Settings { lambda_max: Some(0.99), ..good }, false),
            (Settings { lambda_max: Some(100.0), ..good }, true),
            (Settings { lambda_max: Some(100.1), ..good }, false),
            (Settings { loop_gain: Some(2.0), ..good }, true),
            (Settings { loop_gain: Some(2.01), ..good }, false),
            (Settings { target_noise: -1e-9, ..good }, false),
            (Settings { following_error: Some(0.0), ..good }, false),
            (Settings { following_error: Some(f64::INFINITY), ..good }, false),
            (Settings { following_error: Some(1e-9), ..good }, true),
        ] {
            assert_eq!(runtime(settings).is_ok(), holds, "{settings:?}");
        }
        let halved = runtime(Settings { lambda_max: Some(2.0), ..good }).unwrap();
        assert_eq!(halved.gain, 0.125);
    }
}
