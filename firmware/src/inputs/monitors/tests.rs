//! Detection limits of the monitors, as probabilities over generated noise.

use std::vec;
use std::vec::Vec;

use super::*;
use crate::contract::example::table;
use crate::detection::{BUCKET_EVENT, FOLLOWING_FRACTION, FOLLOWING_SAMPLES, MAX_SUCCESSIVE_OVERRUNS};
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
    let tolerance = FOLLOWING_FRACTION * table.paddle.max_displacement;
    let mut noise = Noise(7);
    let mut trips = |offset: f64, deviation: f64, samples: usize| {
        let mut monitor = FollowingMonitor::default();
        (0..samples).any(|_| {
            let [x, y] = noise.normal();
            let measured = [offset + deviation * x, deviation * y];
            monitor.enter(FollowingMonitor::follows(&runtime, &measured, &[0.0; 2], 0.0))
        })
    };
    // False alarm: noise of half the tolerance leaves it in 1 sample of 18. Detection: off by twice the tolerance.
    assert!(!trips(0.0, 0.5 * tolerance, 200_000));
    assert!((0..1000).all(|_| trips(2.0 * tolerance, 0.5 * tolerance, 40)));
    assert!((0..1000).all(|_| trips(2.0 * tolerance, 2.0 * tolerance, 200)));
}
