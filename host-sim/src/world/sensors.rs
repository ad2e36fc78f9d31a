//! Sensors: their own rates, latency and seeded noise.
//!
//! All randomness comes from PCG-64 (XSL-RR 128/64), an algorithm that is fixed by name: the same seed gives the same
//! samples on every machine.

use std::collections::VecDeque;

use firmware::contract::frames::{MAX_PADDLES, TARGET_VISIBLE};
use firmware::contract::{NeedleSample, PaddleSample, TargetSample};
use model_offline::scene::{Outages, Sensor};
use nalgebra::SVector;
use rand_distr::{Distribution, Exp1, StandardNormal};
use rand_pcg::Pcg64;

use super::needle::NeedleMotion;
use super::simulation::Simulation;
use super::truth::to_frame;

/// Stream numbers of the generator: sensors do not share random numbers.
const TARGET_STREAM: u128 = 1;
const OUTAGE_STREAM: u128 = 2;

/// The target's camera, in D dimensions: samples at its own rate, which arrive late.
#[derive(Clone, Debug)]
pub struct TargetSensor<const D: usize = 2> {
    period_ns: u64,
    latency_ns: u64,
    /// Standard deviation per component, length.
    noise: f64,
    /// Step of what is reported, length; 0: none.
    quantisation: f64,
    /// Added to every measurement, length.
    bias: SVector<f64, D>,
    outages: Option<OutageSchedule>,
    random: Pcg64,
    sequence: u32,
    next_ns: Option<u64>,
    on_their_way: VecDeque<TargetSample>,
}

impl<const D: usize> TargetSensor<D> {
    /// A sensor with this period and latency, ns, and noise (standard deviation per component, length).
    pub fn new(period_ns: u64, latency_ns: u64, noise: f64, seed: u64) -> Self {
        Self {
            period_ns: period_ns.max(1),
            latency_ns,
            noise,
            quantisation: 0.0,
            bias: SVector::zeros(),
            outages: None,
            random: Pcg64::new(u128::from(seed), TARGET_STREAM),
            sequence: 0,
            next_ns: None,
            on_their_way: VecDeque::new(),
        }
    }

    /// The rates, the latency, the noise and the seed of a simulation.
    pub fn of(simulation: &Simulation) -> Self {
        let settings = simulation.loop_settings.settings(simulation.depth);
        let noise = simulation.loop_settings.noise_for(simulation.depth);
        Self::new(settings.target_period_ns, settings.target_latency_ns, noise, simulation.seed)
    }

    /// The same with results in steps of this length; 0: none.
    #[must_use]
    pub fn quantised(self, step: f64) -> Self {
        Self { quantisation: step, ..self }
    }

    /// Measures if a measurement is due at `time_ns`.
    pub fn measure(&mut self, time_ns: u64, displacement: &SVector<f64, D>) {
        let due_ns = *self.next_ns.get_or_insert(time_ns);
        if time_ns < due_ns {
            return;
        }
        // The phase stays, also when the plant has skipped ticks.
        let periods = (time_ns - due_ns) / self.period_ns + 1;
        self.next_ns = Some(due_ns + periods * self.period_ns);
        let mut measured = displacement.map(|component| component + self.noise * self.normal()) + self.bias;
        if self.quantisation > 0.0 {
            measured = measured.map(|component| (component / self.quantisation).round() * self.quantisation);
        }
        let sees = !self.outages.as_mut().is_some_and(|outages| outages.is_out(time_ns));
        self.on_their_way.push_back(TargetSample {
            sequence: self.sequence,
            flags: if sees { TARGET_VISIBLE } else { 0 },
            time_ns,
            displacement: to_frame(&measured),
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

impl TargetSensor {
    /// The same with the bias, the steps and the outages of this one.
    #[must_use]
    pub fn with_defects_of(self, sensor: &Sensor, seed: u64) -> Self {
        let outages = sensor.outages.map(|outages| OutageSchedule::new(outages, seed));
        Self { quantisation: sensor.quantisation, bias: sensor.bias, outages, ..self }
    }
}

/// When nothing is seen: gaps of exponential length between outages.
#[derive(Clone, Debug)]
struct OutageSchedule {
    outages: Outages,
    random: Pcg64,
    /// The outage that is next or now, ns.
    next_ns: Option<[u64; 2]>,
}

impl OutageSchedule {
    fn new(outages: Outages, seed: u64) -> Self {
        Self { outages, random: Pcg64::new(u128::from(seed), OUTAGE_STREAM), next_ns: None }
    }

    /// Called with times that do not go back.
    fn is_out(&mut self, time_ns: u64) -> bool {
        let mut next_ns = self.next_ns.unwrap_or_else(|| self.after(time_ns));
        while time_ns >= next_ns[1] {
            next_ns = self.after(next_ns[1]);
        }
        self.next_ns = Some(next_ns);
        time_ns >= next_ns[0]
    }

    fn after(&mut self, time_ns: u64) -> [u64; 2] {
        let gap_s: f64 = Exp1.sample(&mut self.random);
        let begins_ns = time_ns.saturating_add((1e9 * self.outages.every * gap_s) as u64);
        [begins_ns, begins_ns.saturating_add(((1e9 * self.outages.last) as u64).max(1))]
    }
}

/// Needle and paddle encoders: a sample per plant tick, exact and without latency.
#[derive(Clone, Copy, Debug)]
pub struct Encoders {
    sequence: u32,
    paddles: [Option<u32>; MAX_PADDLES],
}

impl Encoders {
    /// Encoders of the needle and of the paddle of this index.
    pub fn new(paddle_index: u32) -> Self {
        Self::of(&[paddle_index])
    }

    /// Encoders of the needle and of the paddles of these indices, as many as a controller moves.
    pub fn of(paddles: &[u32]) -> Self {
        Self { sequence: 0, paddles: std::array::from_fn(|place| paddles.get(place).copied()) }
    }

    /// The same, whose first samples carry this sequence number.
    #[must_use]
    pub fn starting_at(self, sequence: u32) -> Self {
        Self { sequence, ..self }
    }

    /// Samples of one tick, of the paddles where they are.
    pub fn sample<const D: usize>(
        &mut self,
        time_ns: u64,
        needle: NeedleMotion,
        paddles: &[SVector<f64, D>],
    ) -> (NeedleSample, [Option<PaddleSample>; MAX_PADDLES]) {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let needle = NeedleSample { sequence, reserved: 0, time_ns, depth: needle.depth, velocity: needle.velocity };
        let sample = |place: usize| {
            let (paddle_index, displacement) = (self.paddles[place]?, to_frame(paddles.get(place)?));
            Some(PaddleSample { sequence, paddle_index, time_ns, displacement })
        };
        (needle, std::array::from_fn(sample))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_offline::scene::Scene;
    use nalgebra::Vector2;

    const MS: u64 = 1_000_000;

    fn samples(seed: u64, noise: f64) -> Vec<(u64, TargetSample)> {
        let mut sensor: TargetSensor = TargetSensor::new(20 * MS, 25 * MS, noise, seed);
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
            assert_eq!(sample.displacement, [20.0 * i as f64, 0.0, 0.0]);
        }
    }

    #[test]
    fn noise_follows_the_seed_alone() {
        assert_eq!(samples(3, 0.1), samples(3, 0.1));
        assert_ne!(samples(3, 0.1), samples(4, 0.1));
    }

    #[test]
    fn bias_and_steps_are_those_of_the_scene() {
        let scene = Scene::bundled("paper").unwrap();
        let defects = Sensor { quantisation: 0.25, bias: Vector2::new(0.1, -1.0), ..scene.sensor };
        let mut sensor = TargetSensor::new(1, 0, 0.0, 1).with_defects_of(&defects, 1);
        sensor.measure(0, &Vector2::new(0.3, 0.3));
        let sample = sensor.arrived(0).unwrap();
        assert_eq!(sample.displacement, [0.5, -0.75, 0.0], "0.4 and −0.7 in steps of a quarter");
        assert!(sample.is_visible());
    }

    #[test]
    fn outages_are_as_long_and_as_rare_as_stated() {
        let scene = Scene::bundled("paper").unwrap();
        let defects = Sensor { outages: Some(Outages { every: 3.0, last: 0.5 }), ..scene.sensor };
        let mut sensor = TargetSensor::new(10 * MS, 0, 0.0, 1).with_defects_of(&defects, 7);
        let seen: Vec<bool> = (0..400_000)
            .map(|k| {
                sensor.measure(k * 10 * MS, &Vector2::zeros());
                sensor.arrived(k * 10 * MS).unwrap().is_visible()
            })
            .collect();
        let out: Vec<usize> = seen.chunk_by(|a, b| a == b).filter(|run| !run[0]).map(<[bool]>::len).collect();
        assert!(out.iter().filter(|length| **length == 50).count() > out.len() / 2, "{out:?}");
        let share = seen.iter().filter(|seen| !**seen).count() as f64 / seen.len() as f64;
        assert!((share - 0.5 / 3.5).abs() < 0.01, "{share}");
    }

    #[test]
    fn noise_has_the_stated_deviation() {
        let mut sensor: TargetSensor = TargetSensor::new(1, 0, 0.5, 11);
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
