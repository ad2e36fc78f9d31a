//! The rules of what sees the target.

use super::{Checked, Validator};
use crate::number::short;
use crate::scene::schema::Located;
use crate::scene::sensor::{Outages, Sensor, SensorPreset};

/// Slowest and fastest sensor that is no wrong unit, Hz.
const RATES: [f64; 2] = [0.1, 1e5];
/// Longest latency that is no wrong unit, s.
const LONGEST_LATENCY: f64 = 60.0;
/// Noise past which a number has another unit, length.
const MOST_NOISE: f64 = 1e6;
/// Shortest and longest outage, and time between two, s.
const OUTAGES: [f64; 2] = [1e-3, 1e6];

impl Validator<'_> {
    /// The sensor: a preset with keys of the scene's own.
    pub(super) fn sensor(&self, depth: f64) -> Checked<Sensor> {
        let section = &self.file.sensor;
        let unit = &self.file.scene.units.length;
        let preset = section.preset.as_ref().map_or(SensorPreset::of_unit(unit), |preset| *preset.get());
        let mut sensor = preset.sensor(depth, unit).map_err(|error| {
            // Only a preset that is named can be refused.
            let span = section.preset.as_ref().map_or(0..0, Located::span);
            self.error(span, error.to_string(), error.help())
        })?;
        let unchanged = sensor;
        if let Some(rate) = &section.rate {
            sensor.rate = *rate.get();
            let [least, most] = RATES;
            if !(least..=most).contains(&sensor.rate) {
                return Err(self.error(
                    rate.span(),
                    format!("rate: {} Hz is no sensor", sensor.rate),
                    format!("give measurements per second, from {least} to {most}"),
                ));
            }
        }
        if let Some(latency) = &section.latency {
            sensor.latency = self.not_negative(latency, "latency")?;
            if sensor.latency > LONGEST_LATENCY {
                return Err(self.error(
                    latency.span(),
                    format!("latency: {} s is longer than a minute", sensor.latency),
                    "give the time from a measurement to its arrival in seconds",
                ));
            }
        }
        if let Some(noise) = &section.noise {
            sensor.noise = self.not_negative(noise, "noise")?;
            if sensor.noise > MOST_NOISE {
                let message = format!("noise: {} is no sensor of a target in this body", short(sensor.noise));
                return Err(self.error(noise.span(), message, "give a standard deviation in length units"));
            }
        }
        if let Some(quantisation) = &section.quantisation {
            sensor.quantisation = self.not_negative(quantisation, "quantisation")?;
            if sensor.quantisation > MOST_NOISE {
                let message =
                    format!("quantisation: {} is no sensor of a target in this body", short(sensor.quantisation));
                return Err(self.error(
                    quantisation.span(),
                    message,
                    "give the step between two readings in length units",
                ));
            }
        }
        if let Some(bias) = &section.bias {
            sensor.bias = self.point(bias.get(), bias.span(), "bias")?;
        }
        if let Some(outages) = &section.outages {
            let every = self.outage(&outages.get().every, "every")?;
            let last = self.outage(&outages.get().last, "last")?;
            sensor.outages = Some(Outages { every, last });
        }
        sensor.is_changed = sensor != unchanged;
        Ok(sensor)
    }

    fn outage(&self, seconds: &Located<f64>, what: &str) -> Checked<f64> {
        let [least, most] = OUTAGES;
        if (least..=most).contains(seconds.get()) {
            return Ok(*seconds.get());
        }
        let message = format!("{what}: {} s is no outage", seconds.get());
        Err(self.error(seconds.span(), message, format!("give seconds, from {least} to {most}")))
    }
}
