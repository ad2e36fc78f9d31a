//! What plant and controller must agree on: rates, latency, noise. The same options on both command lines.

use clap::Args;
use firmware::Settings;

use super::error::{OptionRange, OutOfRange};

/// Standard deviation of the target sensor when none is given, part of the insertion depth.
pub const DEFAULT_NOISE_PER_DEPTH: f64 = 1e-4;

/// Rates of the loop: a period of 10 µs is less than a step and an exchange take, and 50 s are no loop any more.
const RATE: OptionRange = OptionRange::new("--rate", 0.02, 1e5, " Hz");
const TARGET_RATE: OptionRange = OptionRange::new("--target-rate", 0.02, 1e5, " Hz");
const LATENCY: OptionRange = OptionRange::new("--latency", 0.0, 6e4, " ms");
const NOISE: OptionRange = OptionRange::new("--noise", 0.0, 1e6, " length units");

/// Rates, latency and noise of the loop, as command-line options.
///
/// ```
/// use host_sim::LoopSettings;
///
/// let settings = LoopSettings { rate: 500.0, ..LoopSettings::default() };
/// assert_eq!(settings.period_ns(), 2_000_000);
/// assert!(LoopSettings { rate: 0.0, ..settings }.check().is_err());
/// ```
#[derive(Args, Clone, Copy, Debug, PartialEq)]
pub struct LoopSettings {
    /// Rate of the control loop, Hz
    #[arg(long, default_value_t = Self::default().rate, value_name = "HZ")]
    pub rate: f64,
    /// Rate of the target sensor, Hz
    #[arg(long, default_value_t = Self::default().target_rate, value_name = "HZ")]
    pub target_rate: f64,
    /// Time from a measurement of the target to its arrival, ms
    #[arg(long, default_value_t = Self::default().latency, value_name = "MS")]
    pub latency: f64,
    /// Standard deviation of the target sensor per component, length [default: 1e-4 of the insertion depth]
    #[arg(long, value_name = "LENGTH")]
    pub noise: Option<f64>,
}

impl Default for LoopSettings {
    /// 1 kHz, with the target seen at 50 Hz and 20 ms late.
    fn default() -> Self {
        Self { rate: 1000.0, target_rate: 50.0, latency: 20.0, noise: None }
    }
}

impl LoopSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`OutOfRange`] names the option.
    pub fn check(&self) -> Result<(), OutOfRange> {
        RATE.check(self.rate)?;
        TARGET_RATE.check(self.target_rate)?;
        LATENCY.check(self.latency)?;
        NOISE.check(self.noise.unwrap_or(0.0))
    }

    /// Period of the loop, ns.
    pub fn period_ns(&self) -> u64 {
        period_ns(self.rate)
    }

    /// Noise for an insertion to `depth`, length.
    pub fn noise_for(&self, depth: f64) -> f64 {
        self.noise.unwrap_or(DEFAULT_NOISE_PER_DEPTH * depth)
    }

    /// Settings of the controller for an insertion to `depth`.
    pub fn settings(&self, depth: f64) -> Settings {
        let latency_ns = (self.latency * 1e6).round() as u64;
        Settings {
            target_noise: self.noise_for(depth),
            ..Settings::new(period_ns(self.rate), period_ns(self.target_rate), latency_ns)
        }
    }

    /// The options as another process takes them. Rust prints the shortest decimal that reads back the same number.
    pub fn to_arguments(self, depth: f64) -> [String; 8] {
        [
            "--rate".to_owned(),
            self.rate.to_string(),
            "--target-rate".to_owned(),
            self.target_rate.to_string(),
            "--latency".to_owned(),
            self.latency.to_string(),
            "--noise".to_owned(),
            self.noise_for(depth).to_string(),
        ]
    }
}

fn period_ns(rate_hz: f64) -> u64 {
    (1e9 / rate_hz).round() as u64
}
