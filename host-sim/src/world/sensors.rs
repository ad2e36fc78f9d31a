//! Sensors: their own rates, latency and seeded noise.
//!
//! All randomness comes from PCG-64 (XSL-RR 128/64), an algorithm that is fixed by name: the same seed gives the same
//! samples on every machine.

use std::collections::VecDeque;

use firmware::contract::frames::TARGET_VISIBLE;
use firmware::contract::{NeedleSample, PaddleSample, TargetSample};
use nalgebra::Vector2;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::needle::NeedleMotion;

/// Stream numbers of the generator: sensors do not share random numbers.
const TARGET_STREAM: u128 = 1;

/// The target's camera: samples at its own rate, which arrive late.
#[derive(Clone, Debug)]
pub struct TargetSensor {
    period_ns: u64,
    latency_ns: u64,
    /// Standard deviation per component, length.
    noise: f64,
    random: Pcg64,
    sequence: u32,
    next_ns: Option<u64>,
    on_their_way: VecDeque<TargetSample>,
}

impl TargetSensor {
    /// A sensor with this period and latency, ns, and noise (standard deviation per component, length).
    pub fn new(period_ns: u64, latency_ns: u64, noise: f64, seed: u64) -> Self {
        Self {
            period_ns: period_ns.max(1),
            latency_ns,
            noise,
            random: Pcg64::new(u128::from(seed), TARGET_STREAM),
            sequence: 0,
            next_ns: None,
            on_their_way: VecDeque::new(),
        }
    }

    /// Measures if a measurement is due at `time_ns`.
    pub fn measure(&mut self, time_ns: u64, displacement: &Vector2<f64>) {
        let due_ns = *self.next_ns.get_or_insert(time_ns);
        if time_ns < due_ns {
            return;
        }
        // The phase stays, also when the plant has skipped ticks.
        let periods = (time_ns - due_ns) / self.period_ns + 1;
        self.next_ns = Some(due_ns + periods * self.period_ns);
        let measured = displacement.map(|component| component + self.noise * self.normal());
        self.on_their_way.push_back(TargetSample {
            sequence: self.sequence,
            flags: TARGET_VISIBLE,
            time_ns,
            displacement: measured.into(),
        });
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// The next sample that has arrived by `time_ns`, oldest first.
    pub fn arrived(&mut self, time_ns: u64) -> Option<TargetSample> {
        let first = self.on_their_way.front()?;
        if first.time_ns + self.latency_ns <= time_ns { self.on_their_way.pop_front() } else { None }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.random)
    }
}

/// Needle and paddle encoders: a sample per plant tick, exact and without latency.
#[derive(Clone, Copy, Debug)]
pub struct Encoders {
    sequence: u32,
    paddle_index: u32,
}

impl Encoders {
    /// Encoders of the needle and of the paddle of this index.
    pub fn new(paddle_index: u32) -> Self {
        Self { sequence: 0, paddle_index }
    }

    /// The same, whose first samples carry this sequence number.
    #[must_use]
    pub fn starting_at(self, sequence: u32) -> Self {
        Self { sequence, ..self }
    }

    /// Samples of one tick.
    pub fn sample(
        &mut self,
        time_ns: u64,
        needle: NeedleMotion,
        paddle: &Vector2<f64>,
    ) -> (NeedleSample, PaddleSample) {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let needle = NeedleSample { sequence, reserved: 0, time_ns, depth: needle.depth, velocity: needle.velocity };
        let paddle =
            PaddleSample { sequence, paddle_index: self.paddle_index, time_ns, displacement: (*paddle).into() };
        (needle, paddle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn samples(seed: u64, noise: f64) -> Vec<(u64, TargetSample)> {
        let mut sensor = TargetSensor::new(20 * MS, 25 * MS, noise, seed);
        let mut arrived = Vec::new();
        for tick in 0..200 {
            let time_ns = 7 + tick * MS;
            sensor.measure(time_ns, &Vector2::new(tick as f64, 0.0));
            while let Some(sample) = sensor.arrived(time_ns) {
                arrived.push((time_ns, sample));
            }
        }
        arrived
    }

    #[test]
    fn every_sample_arrives_once_and_late_by_the_latency() {
        let arrived = samples(1, 0.0);
        assert_eq!(arrived.len(), 9, "measured at 0, 20, ... 160 ms");
        for (i, (time_ns, sample)) in arrived.iter().enumerate() {
            assert_eq!(sample.sequence as usize, i);
            assert_eq!(sample.time_ns, 7 + 20 * MS * i as u64);
            assert_eq!(*time_ns, sample.time_ns + 25 * MS);
            assert_eq!(sample.displacement, [20.0 * i as f64, 0.0]);
        }
    }

    #[test]
    fn noise_follows_the_seed_alone() {
        assert_eq!(samples(3, 0.1), samples(3, 0.1));
        assert_ne!(samples(3, 0.1), samples(4, 0.1));
    }

    #[test]
    fn noise_has_the_stated_deviation() {
        let mut sensor = TargetSensor::new(1, 0, 0.5, 11);
        let count = 20_000;
        let mut squares = 0.0;
        for time_ns in 0..count {
            sensor.measure(time_ns, &Vector2::zeros());
            let sample = sensor.arrived(time_ns).expect("no latency");
            squares += sample.displacement[0].powi(2);
        }
        let deviation = (squares / count as f64).sqrt();
        assert!((deviation - 0.5).abs() < 0.01, "{deviation}");
    }
}
