//! Detection limits of the monitors, as probabilities over generated noise.

use std::vec;
use std::vec::Vec;

use super::*;
use crate::contract::example::table;
use crate::detection::{BUCKET_EVENT, FOLLOWING_FRACTION, FOLLOWING_SAMPLES, MAX_SUCCESSIVE_OVERRUNS};
use crate::inputs::sample::Measurement;
use crate::settings::{Runtime, Settings};

/// Uniform numbers in 0..1: the 64-bit generator of Knuth's MMIX, upper 53 bits.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Two independent normal numbers (Box and Muller).
    fn normal(&mut self) -> [f64; 2] {
        let (radius, angle) = ((-2.0 * (1.0 - self.uniform()).ln()).sqrt(), core::f64::consts::TAU * self.uniform());
        [radius * angle.cos(), radius * angle.sin()]
    }
}

/// Probability that a bucket for `limit` events has overflowed after `samples` of which each is an event with
/// probability `share`: the distribution over its levels, step by step.
fn overflow(share: f64, limit: u32, samples: usize) -> f64 {
    let full = (BUCKET_EVENT * limit) as usize;
    let mut levels = vec![0.0; full];
    levels[0] = 1.0;
    let mut overflowed = 0.0;
    for _ in 0..samples {
        let mut next = vec![0.0; full];
        for (level, probability) in levels.iter().enumerate() {
            match next.get_mut(level + BUCKET_EVENT as usize) {
                Some(place) => *place += share * probability,
                None => overflowed += share * probability,
            }
            next[level.saturating_sub(1)] += (1.0 - share) * probability;
        }
        levels = next;
    }
    overflowed
}

#[test]
fn events_in_a_row_fill_the_bucket_exactly() {
    for limit in [1, MAX_SUCCESSIVE_OVERRUNS, FOLLOWING_SAMPLES] {
        let mut bucket = LeakyBucket::default();
        let full: Vec<bool> = (0..limit).map(|_| bucket.enter(true, limit)).collect();
        assert_eq!(full.iter().filter(|full| **full).count(), 1);
        assert!(full[limit as usize - 1]);
        // Full for as long as events go on, and no fuller: it runs out as from the brim.
        for _ in 0..1000 {
            assert!(bucket.enter(true, limit));
        }
        assert!(!bucket.enter(false, limit));
        assert!((0..BUCKET_EVENT * limit - 1).map(|_| bucket.enter(false, limit)).all(|full| !full));
        assert_eq!(bucket, LeakyBucket::default());
    }
}

#[test]
fn the_bucket_overflows_as_often_as_its_distribution_says() {
    let mut noise = Noise(1);
    for (share, samples) in [(0.3, 100), (0.3, 200), (0.25, 400), (0.2, 400), (0.15, 1000)] {
        let expected = overflow(share, FOLLOWING_SAMPLES, samples);
        let trials = 4000;
        let found = (0..trials)
            .filter(|_| {
                let mut bucket = LeakyBucket::default();
                (0..samples).any(|_| bucket.enter(noise.uniform() < share, FOLLOWING_SAMPLES))
            })
            .count();
        let (trials, found) = (f64::from(trials), found as f64);
        let deviation = (expected * (1.0 - expected) * trials).sqrt().max(1.0);
        assert!((found - expected * trials).abs() < 5.0 * deviation, "{share}: {found} of {trials}, {expected}");
    }
}

/// What [`BUCKET_EVENT`] promises.
#[test]
fn detection_and_false_alarm_of_the_buckets() {
    // A paddle that is off in 19 of 20 samples is found within 30 ms at 1 kHz, in half of them within 0.12 s, in a
    // third within 0.4 s.
    for (share, samples) in [(0.95, 30), (0.5, 120), (1.0 / 3.0, 400)] {
        assert!(overflow(share, FOLLOWING_SAMPLES, samples) > 0.9999, "{share}");
    }
    // One that is off in 1 of 20 by noise is left alone: less than one false alarm in 10¹² in 100 s.
    assert!(overflow(0.05, FOLLOWING_SAMPLES, 100_000) < 1e-12);
    // Skipped releases before every other tick: within 80 ticks; before 1 in 100, as a busy machine has them: left alone.
    assert!(overflow(0.5, MAX_SUCCESSIVE_OVERRUNS, 80) > 0.9999);
    assert!(overflow(0.01, MAX_SUCCESSIVE_OVERRUNS, 100_000) < 1e-12);
}

#[test]
fn following_error_over_noise() {
    let table = table();
    let settings = Settings::new(1_000_000, 20_000_000, 20_000_000);
    let runtime = Runtime::new(&table, &settings).unwrap();
    let tolerance = FOLLOWING_FRACTION * table.paddles[0].max_displacement;
    let mut noise = Noise(7);
    let mut trips = |offset: f64, deviation: f64, samples: usize| {
        let mut monitor = FollowingMonitor::default();
        (0..samples).any(|_| {
            let [x, y] = noise.normal();
            let measured = [offset + deviation * x, deviation * y];
            monitor.enter({
                let unseen = runtime.paddles[0].unseen_motion(0.0, runtime.unseen_delay);
                FollowingMonitor::follows(&runtime.paddles[0], &measured, &[0.0; 2], unseen)
            })
        })
    };
    // False alarm: noise of half the tolerance leaves it in 1 sample of 18. Detection: off by twice the tolerance.
    assert!(!trips(0.0, 0.5 * tolerance, 200_000));
    assert!((0..1000).all(|_| trips(2.0 * tolerance, 0.5 * tolerance, 40)));
    assert!((0..1000).all(|_| trips(2.0 * tolerance, 2.0 * tolerance, 200)));
}

const MS: u64 = 1_000_000;

/// The table of the examples: depth range 0.1, paddle range 0.05 at 0.1 per second, ‖J‖ = 0.3964, target slope 0.102.
fn runtime(settings: &Settings) -> Runtime<f64> {
    Runtime::new(&table(), settings).unwrap()
}

fn settings() -> Settings {
    Settings::new(MS, 20 * MS, 20 * MS)
}

fn sample(tick: u64, values: [f64; 2]) -> Measurement {
    Measurement { sequence: tick as u32, time_ns: tick * MS, values }
}

/// The largest value, to 1 part in 10⁹, that `passes` lets through, between 0 and `most`.
fn threshold(most: f64, passes: impl Fn(f64) -> bool) -> f64 {
    assert!(passes(0.0) && !passes(most));
    let (mut low, mut high) = (0.0, most);
    while high - low > 1e-9 * most {
        let middle = 0.5 * (low + high);
        *(if passes(middle) { &mut low } else { &mut high }) = middle;
    }
    low
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-6 * expected.abs(), "{found} instead of {expected}");
}

#[test]
fn the_gate_is_noise_and_three_times_the_motion_since_the_delay() {
    let slope = (0.02f64 * 0.02 + 0.1 * 0.1).sqrt();
    let jacobian = (0.3f64.powi(2) + 0.05f64.powi(2) + 0.04f64.powi(2) + 0.25f64.powi(2)).sqrt();
    // Largest target displacement: static, at the end. Plausible: three times that and what the paddle can do.
    let range = 3.0 * 0.1 * slope + jacobian * 0.05;
    for (noise, floor) in [(0.0, 0.01), (1e-4, 0.002)] {
        // A delay of 1 sample: motion since the arrival of the second sample before the last one counts.
        let runtime = runtime(&Settings { target_noise: noise, ..settings() });
        let mut gate = InnovationGate::<2, 1>::default();
        // Since the second sample before the last one the paddle has gone 0.012 along x and 0.016 along y.
        for (needle, [x, y]) in [(0.5, [0.5, 0.1]), (0.01, [0.0; 2]), (0.0, [0.011, 0.016]), (0.003, [0.001, 0.0])] {
            gate.travel.needle += needle;
            let [way] = &mut gate.travel.paddles;
            *way = [way[0] + x, way[1] + y];
            gate.accept();
        }
        gate.travel.needle += 0.004;
        let gate_width = threshold(1.0, |jump| gate.check(&runtime, &[0.0, 1.0], &[jump, 1.0]).is_ok());
        let apart = 0.016 + (2f64.sqrt() - 1.0) * 0.012;
        let motion = slope * (0.003 + 0.004) + jacobian * apart;
        close(gate_width, 8.0 * 2f64.sqrt() * noise + 3.0 * motion + floor * range);
    }
}

#[test]
fn the_gate_reaches_back_no_further_than_it_remembers() {
    let far = Settings { target_latency_ns: 640 * MS, ..settings() };
    let runtime = runtime(&far);
    let mut gate = InnovationGate::<2, 1>::default();
    for _ in 0..20 {
        gate.travel.needle += 0.001;
        gate.accept();
    }
    let slope = (0.02f64 * 0.02 + 0.1 * 0.1).sqrt();
    let width = threshold(1.0, |jump| gate.check(&runtime, &[0.0; 2], &[jump, 0.0]).is_ok());
    close(width, 3.0 * slope * 0.007 + 0.01 * runtime.target_range);
}

/// Errors of a loop of gain 0.25: those that grow past twice their start and twice the floor, while the corrections
/// should have removed the floor.
#[test]
fn divergence_needs_growth_and_corrections() {
    let runtime = runtime(&settings());
    assert_eq!(runtime.gain, 0.25);
    let floor = 0.01 * runtime.target_range;
    let trips = |errors: &[f64], speed: f64| {
        let mut monitor = DivergenceMonitor::default();
        errors.iter().position(|error| monitor.update(&runtime, *error, 0.25 * error.abs(), speed))
    };
    // Start at 1.1 floors: predicted after k samples is the sum of a quarter of each.
    assert_eq!(trips(&[1.1 * floor, 1.6 * floor, 1.9 * floor, 2.3 * floor], 0.0), Some(3));
    assert_eq!(trips(&[1.1 * floor, -1.6 * floor, 1.9 * floor, -2.3 * floor], 0.0), Some(3), "of either sign");
    assert_eq!(trips(&[1.1 * floor, 1.6 * floor, 1.9 * floor, 2.1 * floor], 0.0), None, "less than twice its start");
    let start = 1.1 * floor;
    assert_eq!(trips(&[start, 1.6 * floor, 1.9 * floor, 2.0 * start], 0.0), None, "exactly twice its start");
    assert_eq!(trips(&[0.5 * floor, 0.9 * floor, 1.2 * floor, 1.9 * floor], 0.0), None, "less than twice the floor");
    assert_eq!(trips(&[1.1 * floor, 1.0 * floor, 2.3 * floor], 0.0), None, "a smaller one begins a new window");
    let again = [2.0 * floor, 1.1 * floor, 1.6 * floor, 1.9 * floor, 2.3 * floor];
    assert_eq!(trips(&again, 0.0), Some(4), "twice the start of the new window");
    assert_eq!(trips(&[1.1 * floor, 2.3 * floor], 0.0), None, "the corrections have not removed the floor yet");
    // A window ends after 3/g = 12 samples: slow growth is drift.
    let slow: Vec<f64> = (0..60).map(|i| floor * 1.02f64.powi(i)).collect();
    assert_eq!(trips(&slow, 0.0), None);
    let fast: Vec<f64> = (0..60).map(|i| floor * 1.1f64.powi(i)).collect();
    assert!(trips(&fast, 0.0).is_some());
    let after = |samples: usize| {
        let between = std::iter::repeat_n(1.9 * floor, samples - 1);
        trips(&std::iter::once(1.1 * floor).chain(between).chain([2.3 * floor]).collect::<Vec<f64>>(), 0.0)
    };
    assert_eq!((after(12), after(13)), (Some(12), None), "the last sample of a window, and the first of the next");
    // With a needle that moves the lag counts: slope·speed·(d + 1/g)·T = 0.102·0.1·5·0.02.
    let lag = (0.02f64 * 0.02 + 0.1 * 0.1).sqrt() * 0.1 * 5.0 * 0.02;
    assert!(lag > 2.0 * floor);
    assert_eq!(trips(&[1.1 * floor, 1.6 * floor, 1.9 * floor, 2.3 * floor], 0.1), None);
    let grown = [1.1 * lag, 1.6 * lag, 1.9 * lag, 2.3 * lag];
    assert_eq!(trips(&grown, -0.1), Some(3));
    // And the noise of a sensor that states it, eight deviations.
    let noisy = self::runtime(&Settings { target_noise: floor, ..settings() });
    let mut monitor = DivergenceMonitor::default();
    assert!(![1.1, 1.6, 1.9, 2.3].iter().any(|part| monitor.update(&noisy, part * floor, 0.25 * part * floor, 0.0)));
    assert!([8.1, 12.0, 14.0, 17.0].iter().any(|part| monitor.update(&noisy, part * floor, 0.25 * part * floor, 0.0)));
}

#[test]
fn the_peak_speed_of_the_needle_is_remembered() {
    let runtime = runtime(&settings());
    let lag = (0.02f64 * 0.02 + 0.1 * 0.1).sqrt() * 0.1 * 5.0 * 0.02;
    let mut monitor = DivergenceMonitor::default();
    monitor.update(&runtime, 0.0, 0.0, -0.1);
    let below = [0.6, 0.9, 1.2, 1.5, 1.8];
    assert!(!below.iter().any(|part| monitor.update(&runtime, part * lag, 0.25 * part * lag, 0.0)));
}

#[test]
fn a_frozen_value_is_the_fifth_alike_after_the_followed_thing_has_left() {
    let value = sample(0, [0.3, 0.4]);
    assert!(value.is_like(Some(&value)) && !value.is_like(Some(&sample(1, [0.3, 0.5]))) && !value.is_like(None));
    let mut monitor = FrozenMonitor::default();
    monitor.accept(false, &[0.0; 2]);
    for tick in 1..5 {
        assert_eq!(monitor.check(true, &[9.0, 0.0], 1.0), Ok(()), "sample {tick}");
        monitor.accept(true, &[1.0, 0.0]);
    }
    let check = |followed: f64| monitor.check(true, &[followed, 0.0], 1.0);
    close(threshold(9.0, |beyond| check(1.0 + beyond).is_ok()), 1.0);
    assert!(check(2.1).is_err());
    assert_eq!(monitor.check(false, &[9.0, 0.0], 1.0), Ok(()), "it changes");
    monitor.accept(false, &[9.0, 0.0]);
    assert_eq!(monitor.check(true, &[0.0; 2], 1.0), Ok(()));
}

#[test]
fn a_resolution_is_the_smallest_change_between_its_bounds() {
    let mut resolution = SensorStep::default();
    close(resolution.unseen_motion(2.0), 4.0 * 0.025 * 2.0);
    resolution.accept(&sample(0, [0.3, 0.4]), None);
    resolution.accept(&sample(1, [0.3, 0.4]), Some(&sample(0, [0.3, 0.4])));
    close(resolution.unseen_motion(2.0), 4.0 * 0.025 * 2.0);
    resolution.accept(&sample(2, [0.33, 0.44]), Some(&sample(1, [0.3, 0.4])));
    close(resolution.unseen_motion(4.0), 4.0 * 0.05);
    resolution.accept(&sample(3, [0.5, 0.44]), Some(&sample(2, [0.33, 0.44])));
    close(resolution.unseen_motion(4.0), 4.0 * 0.05);
    resolution.accept(&sample(4, [0.5, 0.44 + 1e-9]), Some(&sample(3, [0.5, 0.44])));
    close(resolution.unseen_motion(4.0), 4.0 * 0.0005 * 4.0);
}

#[test]
fn contradictions_of_the_needle_are_measured_over_a_window() {
    let runtime = runtime(&settings());
    let next = |monitor: &NeedleMonitor, now: &Measurement, before: &Measurement| monitor.next(&runtime, now, before);
    // From rest at depth 0.05: the depth may jump by 0.5 % of the range, and a quarter of the jump.
    let first = sample(0, [0.05, 0.0]);
    let begun = NeedleMonitor::beginning_with(&first);
    close(threshold(0.01, |jump| next(&begun, &sample(1, [0.05 + jump, 0.0]), &first).is_ok()), 0.0005 / 0.75);
    // The velocity is integrated by the trapezoidal rule; a change of it within one interval is its own uncertainty.
    let steady = sample(0, [0.05, 0.1]);
    let begun_steady = NeedleMonitor::beginning_with(&steady);
    let behind = threshold(0.01, |by| next(&begun_steady, &sample(4, [0.0504 - by, 0.1]), &steady).is_ok());
    close(behind, 0.0005 + 0.25 * 0.0004);
    let unsure = threshold(0.01, |by| next(&begun_steady, &sample(4, [0.0502 - by, 0.0]), &steady).is_ok());
    // The motion itself is larger than what is claimed: x = 0.0005 + (x − 0.0002)/4 + 0.0002.
    close(unsure, 0.00065 / 0.75);
    // A window ends past 2 % of the range, and after a gap; what was off before is forgotten.
    let second = sample(1, [0.0506, 0.0]);
    let off = next(&begun, &second, &first).unwrap();
    assert!(next(&off, &sample(2, [0.0512, 0.0]), &second).is_err());
    let later = sample(7, [0.0506, 0.0]);
    let ended = next(&off, &later, &second).unwrap();
    assert!(next(&ended, &sample(8, [0.0512, 0.0]), &later).is_ok());
    let soon = sample(6, [0.0506, 0.0]);
    let goes_on = next(&off, &soon, &second).unwrap();
    assert!(next(&goes_on, &sample(7, [0.0512, 0.0]), &soon).is_err(), "5 ticks are no gap");
    // 2 % of the range: off by 0.0005 from the start at 0.1 per second, and by 0.00069 more after so many ticks.
    for (ticks, forgotten) in [(10, false), (12, true)] {
        let depth = |tick: u64| 0.0505 + 1e-4 * tick as f64;
        let mut before = sample(4, [depth(4), 0.1]);
        let mut monitor = next(&begun_steady, &before, &steady).unwrap();
        for tick in 5..5 + ticks {
            let now = sample(tick, [depth(tick), 0.1]);
            monitor = next(&monitor, &now, &before).unwrap();
            before = now;
        }
        let now = sample(5 + ticks, [depth(5 + ticks) + 0.00069, 0.1]);
        assert_eq!(next(&monitor, &now, &before).is_ok(), forgotten, "{ticks} ticks");
    }
}

#[test]
fn a_window_of_the_needle_ends_after_10_s() {
    let runtime = runtime(&settings());
    // Creeps without saying so; the depth may be off by 0.000667 within a window.
    let refused = |per_tick: f64| {
        let mut before = sample(0, [0.05, 0.0]);
        let mut monitor = NeedleMonitor::beginning_with(&before);
        (1..30_000).find(|tick| {
            let now = sample(*tick, [0.05 + per_tick * *tick as f64, 0.0]);
            let next = monitor.next(&runtime, &now, &before);
            monitor = next.unwrap_or_default();
            before = now;
            next.is_err()
        })
    };
    assert_eq!(refused(6.6e-8), None);
    assert_eq!(refused(6.7e-8), Some(9951));
    assert_eq!(refused(8e-8), Some(8334));
}

#[test]
fn rest_takes_as_long_as_a_sample_may_be_old() {
    let runtime = runtime(&settings());
    let resolution = 0.1 * FOLLOWING_FRACTION * 0.05;
    let enter = |monitor: &mut RestMonitor, sample: &Measurement| {
        monitor.enter(runtime.paddles[0].resolution, runtime.paddle_age.hold_ns, sample)
    };
    let mut monitor = RestMonitor::default();
    let states: Vec<Motion> = (0..8).map(|tick| enter(&mut monitor, &sample(tick, [0.01, 0.0]))).collect();
    assert_eq!(states[..5], [Motion::Unknown; 5]);
    assert_eq!(states[5..], [Motion::Resting; 3]);
    assert_eq!(enter(&mut monitor, &sample(8, [0.01 + 0.99 * resolution, 0.0])), Motion::Resting);
    assert_eq!(enter(&mut monitor, &sample(9, [0.01 + 1.01 * resolution, 0.0])), Motion::Moving);
    assert_eq!(enter(&mut monitor, &sample(10, [0.01 + 1.01 * resolution, 0.0])), Motion::Unknown);
    // A gap longer than that begins anew, without a word about motion.
    let mut monitor = RestMonitor::default();
    for tick in [0, 4, 9] {
        enter(&mut monitor, &sample(tick, [0.01, 0.0]));
    }
    assert_eq!(enter(&mut monitor, &sample(14, [0.01, 0.0])), Motion::Resting);
    assert_eq!(enter(&mut monitor, &sample(20, [0.01, 0.0])), Motion::Unknown);
}

#[test]
fn a_paddle_follows_within_the_error_and_what_is_on_its_way() {
    let runtime = runtime(&settings());
    for age in [0.0, 0.003] {
        let paddle = &runtime.paddles[0];
        let unseen = paddle.unseen_motion(age, runtime.unseen_delay);
        let off = threshold(0.05, |off| FollowingMonitor::follows(paddle, &[off, 0.01], &[0.0, 0.01], unseen));
        close(off, 0.001 + 0.1 * (age + 0.002));
    }
}

/// In space the way of each paddle counts with its own Jacobian: along all three axes, at most 17 % more than its norm.
#[test]
fn the_gate_in_space_adds_up_what_both_paddles_do() {
    let table = crate::controller::space_table();
    let runtime = Runtime::<f64, 2>::new(&table, &settings()).unwrap();
    for way in [[0.003, 0.001, 0.002], [0.0, 0.0, 0.004], [0.002, 0.002, 0.002], [0.001, 0.005, 0.0]] {
        let norm = nalgebra::Vector3::from(way).norm();
        let widened = |place: usize| {
            let mut gate = InnovationGate::<3, 2>::default();
            let width = |gate: &InnovationGate<3, 2>| {
                threshold(1.0, |jump| gate.check(&runtime, &[0.0, 0.0, 1.0], &[0.0, jump, 1.0]).is_ok())
            };
            let still = width(&gate);
            gate.travel.paddles[place] = way;
            (width(&gate) - still) / (3.0 * runtime.paddles[place].jacobian_norm)
        };
        for place in 0..2 {
            let farthest = widened(place);
            assert!(farthest >= norm * (1.0 - 1e-6) && farthest <= 1.18 * norm, "{way:?}: {farthest} {norm}");
        }
    }
    assert!(runtime.paddles[0].jacobian_norm != runtime.paddles[1].jacobian_norm, "nothing told them apart");
}
