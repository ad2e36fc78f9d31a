//! What plant and controller must agree on: rates, latency, noise. The same options on both command lines.

use clap::{Args, ValueEnum};
use firmware::{Feedback, Settings};
use model_offline::scene::{IDEAL_NOISE_PER_DEPTH, Motion, Sensor, SensorPreset, UnknownLength};

use super::error::{OptionRange, OutOfRange};

/// Rates of the loop: a period of 10 µs is less than a step and an exchange take, and 50 s are no loop any more.
const RATE: OptionRange = OptionRange::new("--rate", 0.02, 1e5, " Hz");
const TARGET_RATE: OptionRange = OptionRange::new("--target-rate", 0.02, 1e5, " Hz");
const LATENCY: OptionRange = OptionRange::new("--latency", 0.0, 6e4, " ms");
const NOISE: OptionRange = OptionRange::new("--noise", 0.0, 1e6, " length units");

/// How measurements of the target become corrections, as command lines call it; see [`Feedback`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum FeedbackLaw {
    /// A fixed part of the error at every sample
    Integral,
    /// What the table leaves is estimated from sensor and table, as good as each is
    #[default]
    Observer,
    /// The same, and a patient's breaths are predicted once one has been seen
    Harmonic,
}

impl FeedbackLaw {
    /// As the controller calls it.
    pub const fn feedback(self) -> Feedback {
        match self {
            Self::Integral => Feedback::Integral,
            Self::Observer => Feedback::Observer,
            Self::Harmonic => Feedback::Harmonic,
        }
    }

    /// Its name on command lines and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Integral => "integral",
            Self::Observer => "observer",
            Self::Harmonic => "harmonic",
        }
    }

    /// What a patient asks for: the harmonic predictor where one breathes.
    pub fn for_patient(motion: &Motion) -> Self {
        if motion.breathing.is_some() { Self::Harmonic } else { Self::default() }
    }
}

/// Rate of the loop, and what sees the target, as command-line options: what is not given is the scene's.
#[derive(Args, Clone, Copy, Debug, PartialEq)]
pub struct LoopArgs {
    /// Rate of the control loop, Hz
    #[arg(long, default_value_t = LoopSettings::default().rate, value_name = "HZ")]
    pub rate: f64,
    /// What sees the target [default: the scene's, which is ultrasound where its unit of length is known, else ideal]
    #[arg(long, value_enum, value_name = "PRESET")]
    pub sensor: Option<SensorPreset>,
    /// Rate of the target sensor, Hz [default: the sensor's]
    #[arg(long, value_name = "HZ")]
    pub target_rate: Option<f64>,
    /// Time from a measurement of the target to its arrival, ms [default: the sensor's]
    #[arg(long, value_name = "MS")]
    pub latency: Option<f64>,
    /// Standard deviation of the target sensor per component, length [default: the sensor's]
    #[arg(long, value_name = "LENGTH")]
    pub noise: Option<f64>,
    /// How measurements of the target become corrections [default: observer; harmonic where the scene's patient breathes]
    #[arg(long, value_enum, value_name = "LAW")]
    pub feedback: Option<FeedbackLaw>,
}

impl LoopArgs {
    /// The sensor that is asked for; `own` where none is.
    ///
    /// # Errors
    /// [`UnknownLength`].
    pub fn sensor(&self, own: &Sensor, depth: f64, unit: &str) -> Result<Sensor, UnknownLength> {
        let preset = self.sensor.map_or(Ok(*own), |preset| preset.sensor(depth, unit))?;
        let mut sensor = preset;
        sensor.rate = self.target_rate.unwrap_or(sensor.rate);
        sensor.latency = self.latency.map_or(sensor.latency, |latency| 1e-3 * latency);
        sensor.noise = self.noise.unwrap_or(sensor.noise);
        sensor.is_changed |= sensor != preset;
        Ok(sensor)
    }

    /// The settings of a loop with this sensor and a patient who moves like this.
    ///
    /// # Errors
    /// [`OutOfRange`] names the option.
    pub fn settings(&self, sensor: &Sensor, motion: &Motion) -> Result<LoopSettings, OutOfRange> {
        let feedback = self.feedback.unwrap_or_else(|| FeedbackLaw::for_patient(motion));
        let settings = LoopSettings { rate: self.rate, feedback, ..LoopSettings::of(sensor) };
        settings.check()?;
        Ok(settings)
    }
}

/// Rates, latency and noise of the loop.
///
/// ```
/// use host_sim::LoopSettings;
///
/// let settings = LoopSettings { rate: 500.0, ..LoopSettings::default() };
/// assert_eq!(settings.period_ns(), 2_000_000);
/// assert!(LoopSettings { rate: 0.0, ..settings }.check().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopSettings {
    /// Rate of the control loop, Hz.
    pub rate: f64,
    /// Rate of the target sensor, Hz.
    pub target_rate: f64,
    /// Time from a measurement of the target to its arrival, ms.
    pub latency: f64,
    /// Standard deviation of the target sensor per component, length; none: 1e-4 of the insertion depth.
    pub noise: Option<f64>,
    /// Step of what the target sensor reports, length.
    pub quantisation: f64,
    /// How measurements of the target become corrections.
    pub feedback: FeedbackLaw,
}

impl Default for LoopSettings {
    /// 1 kHz, with the target seen at 50 Hz and 20 ms late.
    fn default() -> Self {
        let feedback = FeedbackLaw::default();
        Self { rate: 1000.0, target_rate: 50.0, latency: 20.0, noise: None, quantisation: 0.0, feedback }
    }
}

impl LoopSettings {
    /// A loop of 1 kHz with this sensor.
    pub fn of(sensor: &Sensor) -> Self {
        let Sensor { rate, latency, noise, quantisation, .. } = *sensor;
        Self { target_rate: rate, latency: 1e3 * latency, noise: Some(noise), quantisation, ..Self::default() }
    }

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
        self.noise.unwrap_or(IDEAL_NOISE_PER_DEPTH * depth)
    }

    /// What the controller is to expect of a sample: noise, and a step's own deviation.
    fn deviation(&self, depth: f64) -> f64 {
        match self.quantisation {
            0.0 => self.noise_for(depth),
            step => self.noise_for(depth).hypot(step / 12f64.sqrt()),
        }
    }

    /// Settings of the controller for an insertion to `depth`.
    pub fn settings(&self, depth: f64) -> Settings {
        let latency_ns = (self.latency * 1e6).round() as u64;
        Settings {
            target_noise: self.deviation(depth),
            feedback: self.feedback.feedback(),
            ..Settings::new(period_ns(self.rate), period_ns(self.target_rate), latency_ns)
        }
    }

    /// The options as another process takes them. Rust prints the shortest decimal that reads back the same number.
    pub fn to_arguments(self, depth: f64) -> [String; 10] {
        [
            "--rate".to_owned(),
            self.rate.to_string(),
            "--target-rate".to_owned(),
            self.target_rate.to_string(),
            "--latency".to_owned(),
            self.latency.to_string(),
            "--noise".to_owned(),
            self.deviation(depth).to_string(),
            "--feedback".to_owned(),
            self.feedback.name().to_owned(),
        ]
    }
}

fn period_ns(rate_hz: f64) -> u64 {
    (1e9 / rate_hz).round() as u64
}
