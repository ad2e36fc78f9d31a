//! What no causal controller can do: the least error that a sensor and a paddle allow.
//!
//! The table leaves `d(t) = Σ aₖ hₖ(t)` over: hₖ is what it does not know of needle and tissue, what moves the patient, and so on,
//! as it is in this run. A controller that is told every hₖ beforehand, and that the factors aₖ are independent and standard
//! normal, cannot do better than to remove the conditional mean of `d` given the samples that have arrived, because what the
//! paddle has done already is known to it. What is left has the variance
//!
//! ```text
//! h(t)ᵀ · (1 + Σ (h(tⱼ) h(tⱼ)ᵀ + g(tⱼ) g(tⱼ)ᵀ) / σ²)⁻¹ · h(t)        over all samples with tⱼ + latency ≤ t
//! ```
//!
//! where h is across the needle and g along it: a sample shows both, and what moves along the needle tells of the same factor.
//!
//! and this is the least mean square error of *every* causal controller (the conditional mean is the estimator of least variance;
//! Anderson & Moore, Optimal Filtering, 1979, section 2.3). One that knows less, as all real ones do, leaves more. It is a mean over
//! the factors: a single run may be luckier. Delay is in it: before the first sample arrives, all of `d` is left.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::in_process::Errors;

/// What no causal controller can leave less than, length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Bound {
    /// With the sensor as it is. As `peak` the largest expected error: an expected largest one is no smaller.
    pub sensor: Errors,
    /// With a sensor that is as late and has no noise.
    pub delay: Errors,
    /// Largest error with a sensor that shows what will be, because of the paddle's rate.
    pub paddle: f64,
}

/// A displacement that a controller does not know but for its size, and when: one per moment.
pub(super) struct Unknown<'a> {
    /// Moments, s, rising.
    pub(super) times_s: &'a [f64],
    /// Displacements at every moment, across the needle and along it, length. What is left across it counts.
    pub(super) shapes: &'a [Vec<[f64; 2]>],
    /// The first moment whose error counts.
    pub(super) counts_from: usize,
}

/// What a sensor shows of it.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// From one sample to the next, s.
    pub(super) period_s: f64,
    /// From a sample to the first motion because of it, s.
    pub(super) latency_s: f64,
    /// Standard deviation of a sample, length.
    pub(super) noise: f64,
}

impl Unknown<'_> {
    /// The least expected error of any causal controller with this sensor.
    pub(super) fn least_error(&self, seen: &Seen) -> Errors {
        let Self { times_s, shapes, counts_from } = self;
        let at = |moment: usize, component: usize| {
            DVector::from_iterator(shapes.len(), shapes.iter().map(|shape| shape[moment][component]))
        };
        let largest = shapes.iter().flatten().flatten().fold(0.0_f64, |most, value| most.max(value.abs()));
        // An exact sensor is one whose noise nobody sees.
        let noise = seen.noise.max(1e-9 * largest);
        let begin_s = times_s.first().copied().unwrap_or(0.0);
        let mut information = DMatrix::identity(shapes.len(), shapes.len());
        let mut covariance = information.clone();
        let (mut sampled, mut count) = (0, 0.0);
        let (mut peak, mut squares) = (0.0_f64, 0.0);
        for (moment, time_s) in times_s.iter().enumerate() {
            let before = count;
            // The moments of the samples that have arrived by now; rounding delays none by a whole moment.
            while sampled < moment && begin_s + count * seen.period_s + seen.latency_s <= time_s + 1e-9 {
                while times_s[sampled] + 1e-9 < begin_s + count * seen.period_s {
                    sampled += 1;
                }
                for shown in [at(sampled, 0), at(sampled, 1)] {
                    information += &shown * shown.transpose() / (noise * noise);
                }
                count += 1.0;
            }
            if count > before {
                covariance = information.clone().cholesky().map_or(covariance, |factor| factor.inverse());
            }
            if moment >= *counts_from {
                let left = at(moment, 0);
                let variance = left.dot(&(&covariance * &left)).max(0.0);
                squares += variance;
                peak = peak.max(variance);
            }
        }
        let counted = times_s.len().saturating_sub(*counts_from).max(1) as f64;
        // E|e| of a normal error.
        Errors { peak: (peak * core::f64::consts::FRAC_2_PI).sqrt(), rms: (squares / counted).sqrt() }
    }
}

/// The largest error that a paddle leaves which knows everything and moves the target by at most `rate` per second against a
/// `displacement` at these times: half of what any two moments are too far apart.
pub(super) fn least_error_at_rate(times_s: &[f64], displacement: &[f64], rate: f64) -> f64 {
    let one_way = |sign: f64| {
        let ahead = times_s.iter().zip(displacement).map(|(time_s, value)| sign * value - rate * time_s);
        let (mut least, mut excess) = (f64::INFINITY, 0.0_f64);
        for value in ahead {
            least = least.min(value);
            excess = excess.max(value - least);
        }
        excess
    };
    0.5 * one_way(1.0).max(one_way(-1.0))
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution as _, StandardNormal};
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::SeedableRng as _;

    use super::*;

    const SEEN: Seen = Seen { period_s: 0.1, latency_s: 0.25, noise: 0.3 };

    fn moments(count: usize) -> Vec<f64> {
        (0..count).map(|k| 0.01 * k as f64).collect()
    }

    fn unknown<'a>(times_s: &'a [f64], shapes: &'a [Vec<[f64; 2]>]) -> Unknown<'a> {
        Unknown { times_s, shapes, counts_from: 0 }
    }

    /// What moves across the needle only.
    fn across(shape: &[f64]) -> Vec<[f64; 2]> {
        shape.iter().map(|value| [*value, 0.0]).collect()
    }

    /// What moves twice as far along the needle is seen five times as well: as with a fifth of the noise's variance.
    #[test]
    fn motion_along_the_needle_tells_of_motion_across_it() {
        let times_s = moments(400);
        let shape: Vec<f64> = times_s.iter().map(|time_s| f64::sin(3.0 * time_s)).collect();
        let oblique: Vec<[f64; 2]> = shape.iter().map(|value| [*value, 2.0 * value]).collect();
        let both = unknown(&times_s, &[oblique]).least_error(&SEEN);
        let clearer = Seen { noise: SEEN.noise / 5f64.sqrt(), ..SEEN };
        let one = unknown(&times_s, &[across(&shape)]).least_error(&clearer);
        assert!((both.rms - one.rms).abs() < 1e-12 && (both.peak - one.peak).abs() < 1e-12, "{both:?} {one:?}");
    }

    /// Of a constant, n samples leave 1/(1 + n/σ²).
    #[test]
    fn of_a_constant_it_is_the_mean_of_the_samples() {
        let times_s = moments(1001);
        let least = unknown(&times_s, &[across(&[1.0; 1001])]).least_error(&SEEN);
        let variance = |moment: usize| {
            let arrived = if moment < 25 { 0 } else { (moment - 25) / 10 + 1 };
            1.0 / (1.0 + arrived as f64 / 0.09)
        };
        let exact = ((0..1001).map(variance).sum::<f64>() / 1001.0).sqrt();
        assert!((least.rms - exact).abs() < 1e-12, "{} {exact}", least.rms);
        assert!((least.peak - (2.0 / core::f64::consts::PI).sqrt()).abs() < 1e-12, "{}", least.peak);
    }

    /// Without noise a factor is known as soon as it has been seen.
    #[test]
    fn without_noise_only_the_delay_is_left() {
        let times_s = moments(500);
        let shape: Vec<f64> = times_s.iter().map(|time_s| f64::sin(3.0 * time_s)).collect();
        let least = unknown(&times_s, &[across(&shape)]).least_error(&Seen { noise: 0.0, ..SEEN });
        // The first sample shows nothing, the second one is taken at 0.1 s and arrives at 0.35.
        let exact = (shape[..35].iter().map(|value| value * value).sum::<f64>() / 500.0).sqrt();
        assert!((least.rms - exact).abs() < 1e-6, "{} {exact}", least.rms);
    }

    /// Two shapes, and the textbook's least squares with a prior on simulated samples: on average this much is left, and an
    /// estimator that is told less leaves more.
    #[test]
    fn it_is_what_the_best_estimator_leaves_on_average() {
        let times_s = moments(300);
        let shapes = [
            times_s.iter().map(|time_s| 0.4 * time_s * time_s).collect::<Vec<f64>>(),
            times_s.iter().map(|time_s| f64::cos(5.0 * time_s)).collect(),
        ];
        let least = unknown(&times_s, &shapes.each_ref().map(|shape| across(shape))).least_error(&SEEN);
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (mut best, mut poorer, trials) = (0.0, 0.0, 2000);
        for _ in 0..trials {
            let factors = [normal(), normal()];
            let truth = |moment: usize| factors[0] * shapes[0][moment] + factors[1] * shapes[1][moment];
            let samples: Vec<f64> = (0..30).map(|k| truth(10 * k) + 0.3 * normal()).collect();
            for moment in 0..300 {
                let arrived = if moment < 25 { 0 } else { (moment - 25) / 10 + 1 };
                let rows = DMatrix::from_fn(arrived, 2, |k, shape| shapes[shape][10 * k]);
                let seen = DVector::from_fn(arrived, |k, _| samples[k]);
                let normal_matrix = rows.tr_mul(&rows) + DMatrix::identity(2, 2) * 0.09;
                let found = normal_matrix.lu().solve(&rows.tr_mul(&seen)).unwrap();
                let estimate = found[0] * shapes[0][moment] + found[1] * shapes[1][moment];
                let last = if arrived == 0 { 0.0 } else { samples[arrived - 1] };
                best += (truth(moment) - estimate).powi(2);
                poorer += (truth(moment) - last).powi(2);
            }
        }
        let root = |sum: f64| (sum / f64::from(trials) / 300.0).sqrt();
        assert!((root(best) / least.rms - 1.0).abs() < 0.03, "{} {}", root(best), least.rms);
        assert!(root(poorer) > 1.2 * least.rms);
    }

    #[test]
    fn where_nothing_is_unknown_nothing_must_be_left() {
        let times_s = moments(100);
        let least = unknown(&times_s, &[]).least_error(&SEEN);
        assert_eq!((least.peak, least.rms), (0.0, 0.0));
    }

    /// A jump by 1, seen beforehand, at a rate of 2 per second: half of it is left, whenever it is begun. A ramp of 3 per second
    /// over a second leaves half of the missing 1.
    #[test]
    fn a_slow_paddle_is_half_of_the_way_late() {
        let times_s = moments(201);
        let jump: Vec<f64> = times_s.iter().map(|time_s| if *time_s < 1.0 { 0.0 } else { -1.0 }).collect();
        assert!((least_error_at_rate(&times_s, &jump, 2.0) - 0.5 * (1.0 - 0.02)).abs() < 1e-12);
        let ramp: Vec<f64> = times_s.iter().map(|time_s| 3.0 * time_s.min(1.0)).collect();
        assert!((least_error_at_rate(&times_s, &ramp, 2.0) - 0.5).abs() < 1e-12);
        assert_eq!(least_error_at_rate(&times_s, &ramp, 3.0 + 1e-9), 0.0);
    }
}
