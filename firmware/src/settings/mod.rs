//! Settings in physical units: everything that the user may choose.

use core::fmt;
use core::num::NonZeroU64;

use serde::{Deserialize, Serialize};

use crate::law::{Direction, Feedback};
use crate::limits::PositionLimit;
use crate::loop_stability;
use crate::schedule::quotient;

mod runtime;

pub(crate) use runtime::{AgeLimits, PaddleRuntime, Runtime};

/// What the user may choose. [`Settings::new`] gives defaults that follow from the rates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Period of the loop, ns.
    pub loop_period_ns: u64,
    /// Period of the target sensor, ns; usually many loop periods.
    pub target_period_ns: u64,
    /// Longest time from the measurement of the target to its arrival, ns.
    pub target_latency_ns: u64,
    /// Time from a command to the paddle being there, ns.
    pub actuator_delay_ns: u64,
    /// Standard deviation of the target sensor per component, length.
    pub target_noise: f64,
    /// How measurements of the target become corrections.
    pub feedback: Feedback,
    /// Loop gain g per target sample, of an observer the largest; `None`: [`loop_stability::default_gain`].
    pub loop_gain: Option<f64>,
    /// Largest |λ| of J·Ĵ⁻¹ over the expected model errors; `None`: the table's.
    pub lambda_max: Option<f64>,
    /// Direction of the feedback; `None`: that of the table's space, [`Direction::default_in`].
    pub direction: Option<Direction>,
    /// Shape of the position limit.
    pub position_limit: PositionLimit,
    /// Admitted distance between measured and commanded paddle at rest, length; `None`: 2 % of each paddle's range.
    pub following_error: Option<f64>,
}

impl Settings {
    /// Defaults for a loop and a target sensor with these periods and this latency, ns.
    pub const fn new(loop_period_ns: u64, target_period_ns: u64, target_latency_ns: u64) -> Self {
        Self {
            loop_period_ns,
            target_period_ns,
            target_latency_ns,
            actuator_delay_ns: loop_period_ns,
            target_noise: 0.0,
            feedback: Feedback::Observer,
            loop_gain: None,
            lambda_max: None,
            direction: None,
            position_limit: PositionLimit::Norm,
            following_error: None,
        }
    }

    /// Delay d of the loop, target samples: how many samples still show the old state after a correction.
    ///
    /// A correction for a measurement at t acts from t + latency + one tick + actuator delay on; all samples measured
    /// up to then, ⌊that / target period⌋ of them, do not show it.
    pub const fn delay_samples(&self) -> u32 {
        let late_ns = self.target_latency_ns.saturating_add(self.loop_period_ns).saturating_add(self.actuator_delay_ns);
        let Some(target_period_ns) = NonZeroU64::new(self.target_period_ns) else {
            return u32::MAX;
        };
        let samples = quotient(late_ns, target_period_ns);
        if samples < u32::MAX as u64 { samples as u32 } else { u32::MAX }
    }
}

/// Refusal of settings; `Display` says what to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingsError {
    /// A period is zero or longer than [`LONGEST_PERIOD_NS`].
    Period {
        /// Field.
        field: &'static str,
    },
    /// The target sensor is faster than the loop.
    TargetFasterThanLoop,
    /// The loop is too old for feedback.
    Delay {
        /// Delay in target samples.
        samples: u32,
    },
    /// A number is NaN, infinite or out of its range.
    Range {
        /// Field.
        field: &'static str,
        /// What is admitted.
        admitted: &'static str,
    },
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Period { field } => write!(f, "{field} must be above 0 and at most 10 s"),
            Self::TargetFasterThanLoop => {
                write!(f, "the target sensor is faster than the loop: raise the loop rate")
            }
            Self::Delay { samples } => write!(
                f,
                "the target is {samples} samples old when a correction acts, at most {} are sensible: \
                 lower the latency",
                loop_stability::MAX_DELAY_SAMPLES
            ),
            Self::Range { field, admitted } => write!(f, "{field} must be {admitted}"),
        }
    }
}

impl core::error::Error for SettingsError {}

/// Longest period of loop and sensor: slower is a wrong unit.
pub const LONGEST_PERIOD_NS: u64 = 10_000_000_000;

fn check_periods(settings: &Settings) -> Result<(), SettingsError> {
    let admitted = 1..=LONGEST_PERIOD_NS;
    if !admitted.contains(&settings.loop_period_ns) {
        return Err(SettingsError::Period { field: "loop period" });
    }
    if !admitted.contains(&settings.target_period_ns) {
        return Err(SettingsError::Period { field: "target period" });
    }
    if settings.target_latency_ns > LONGEST_PERIOD_NS || settings.actuator_delay_ns > LONGEST_PERIOD_NS {
        return Err(SettingsError::Period { field: "latency and actuator delay" });
    }
    if settings.target_period_ns < settings.loop_period_ns {
        return Err(SettingsError::TargetFasterThanLoop);
    }
    Ok(())
}

fn check(field: &'static str, admitted: &'static str, holds: bool) -> Result<(), SettingsError> {
    if holds { Ok(()) } else { Err(SettingsError::Range { field, admitted }) }
}
