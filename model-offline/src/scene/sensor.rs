//! What sees the target.

use crate::choice::choice;
use crate::geometry::Point2;
use serde::Serialize;

choice! {
    /// A kind of sensor, with numbers of the order that the literature reports; each may be overridden.
    pub enum SensorPreset {
        /// 50 Hz, 20 ms late, noise of 1e-4 of the insertion's depth: better than any sensor that sees into tissue. For
        /// scenes without a unit of length, and to see what the rest of a loop can do.
        Ideal,
        /// Markers in a transparent phantom, or an optical tracker: 60 Hz, 20 ms late, 0.05 mm.
        Camera,
        /// Speckle tracking in B-mode ultrasound: 30 Hz, two frames late, 0.4 mm (reported: 0.3 to 0.5 mm).
        Ultrasound,
        /// Real-time magnetic resonance: 5 Hz, 300 ms late, 0.5 mm, in steps of half a pixel of 1 mm.
        Mri,
    }
}

/// What sees the target. Lengths are the scene's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sensor {
    /// What it began as, before keys of its own.
    pub preset: SensorPreset,
    /// Whether the scene has numbers of its own besides.
    pub is_changed: bool,
    /// Rate, Hz.
    pub rate: f64,
    /// From a measurement to its arrival, s.
    pub latency: f64,
    /// Standard deviation of each component, length.
    pub noise: f64,
    /// Step of what it reports, length; 0: none.
    pub quantisation: f64,
    /// Added to every measurement, length.
    pub bias: Point2,
    /// Times without measurements.
    pub outages: Option<Outages>,
}

/// Times without measurements, which begin at random.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Outages {
    /// Mean time from the end of one to the beginning of the next, s.
    pub every: f64,
    /// How long each lasts, s.
    pub last: f64,
}

/// Noise of the ideal sensor, part of the insertion's depth.
pub const IDEAL_NOISE_PER_DEPTH: f64 = 1e-4;

/// A preset has lengths in mm, and the scene's unit of length is none that is known.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the sensor {} has lengths in mm, and the unit of length {unit:?} is none of {}", preset.name(), KNOWN_UNITS)]
pub struct UnknownLength {
    /// What was asked for.
    pub preset: SensorPreset,
    /// Label of the unit.
    pub unit: String,
}

impl UnknownLength {
    /// What to do.
    pub fn help(&self) -> &'static str {
        "name the unit in [scene] units, or give rate, latency, and noise by themselves (preset \"ideal\" is in parts of \
         the depth)"
    }
}

const KNOWN_UNITS: &str = "um, mm, cm, m, in";

/// Millimetres per unit of length, where its label says so.
pub(crate) fn millimetres(unit: &str) -> Option<f64> {
    match unit {
        "um" | "µm" | "μm" => Some(1e-3),
        "mm" => Some(1.0),
        "cm" => Some(10.0),
        "m" => Some(1e3),
        "in" | "inch" => Some(25.4),
        _ => None,
    }
}

impl SensorPreset {
    /// What a scene without a sensor of its own is seen by: ultrasound where its unit of length is known.
    pub fn of_unit(unit: &str) -> Self {
        if millimetres(unit).is_some() { Self::Ultrasound } else { Self::Ideal }
    }

    /// Its numbers for an insertion to `depth` in a scene with this unit of length.
    ///
    /// # Errors
    /// [`UnknownLength`].
    pub fn sensor(self, depth: f64, unit: &str) -> Result<Sensor, UnknownLength> {
        let (rate, latency, noise_mm, step_mm) = match self {
            Self::Ideal => (50.0, 0.02, None, 0.0),
            Self::Camera => (60.0, 0.02, Some(0.05), 0.0),
            Self::Ultrasound => (30.0, 0.066, Some(0.4), 0.0),
            Self::Mri => (5.0, 0.3, Some(0.5), 0.5),
        };
        let per_mm = millimetres(unit).map(|unit_mm| 1.0 / unit_mm);
        let (noise, quantisation) = match (noise_mm, per_mm) {
            (None, _) => (IDEAL_NOISE_PER_DEPTH * depth, 0.0),
            (Some(noise_mm), Some(per_mm)) => (noise_mm * per_mm, step_mm * per_mm),
            (Some(_), None) => return Err(UnknownLength { preset: self, unit: unit.to_owned() }),
        };
        let bias = Point2::zeros();
        Ok(Sensor { preset: self, is_changed: false, rate, latency, noise, quantisation, bias, outages: None })
    }
}

/// Period of the loop that tables suggest a gain for, ns.
const LOOP_PERIOD_NS: u64 = 1_000_000;

impl Sensor {
    /// Delay of a loop of 1 kHz that sees the target with it, in its samples.
    pub fn delay_samples(&self) -> u32 {
        let [period_ns, latency_ns] = [1.0 / self.rate, self.latency].map(|seconds| (1e9 * seconds).round() as u64);
        firmware::Settings::new(LOOP_PERIOD_NS, period_ns, latency_ns).delay_samples()
    }

    /// How reports call it.
    pub fn title(&self) -> String {
        let changed = if self.is_changed { ", changed" } else { "" };
        format!("{}{changed}", self.preset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_is_the_same_in_every_unit() {
        for (unit, unit_mm) in [("mm", 1.0), ("cm", 10.0), ("m", 1e3), ("in", 25.4), ("um", 1e-3)] {
            assert_eq!(SensorPreset::of_unit(unit), SensorPreset::Ultrasound);
            let sensor = SensorPreset::Ultrasound.sensor(1.0, unit).unwrap();
            assert!((sensor.noise * unit_mm - 0.4).abs() < 1e-12, "{unit}: {sensor:?}");
            let sensor = SensorPreset::Mri.sensor(1.0, unit).unwrap();
            assert!((sensor.quantisation * unit_mm - 0.5).abs() < 1e-12, "{unit}: {sensor:?}");
        }
    }

    /// What is measured until a correction acts, latency and two ticks later, in whole samples: 22 ms of 20, 22 of 16.7, 68 of
    /// 33.3, 302 of 200.
    #[test]
    fn a_loop_is_as_many_samples_late_as_its_sensor_says() {
        use SensorPreset::{Camera, Ideal, Mri, Ultrasound};
        let late = [Ideal, Camera, Ultrasound, Mri].map(|preset| preset.sensor(1.0, "mm").unwrap().delay_samples());
        assert_eq!(late, [1, 1, 2, 1]);
    }

    #[test]
    fn without_a_unit_only_the_ideal_sensor_is_known() {
        assert_eq!(SensorPreset::of_unit("1"), SensorPreset::Ideal);
        assert_eq!(SensorPreset::Ideal.sensor(0.1, "1").unwrap().noise, 1e-5);
        let refused = SensorPreset::Camera.sensor(0.1, "1").unwrap_err();
        assert!(refused.to_string().contains("\"1\"") && refused.to_string().contains("camera"), "{refused}");
    }
}
