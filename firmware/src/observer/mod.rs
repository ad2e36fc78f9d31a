//! What the table leaves over: the target's orthogonal displacement that feed-forward does not remove, estimated from
//! the target's sensor.
//!
//! Of tissue that is not the table's, d(z) is left at depth z: nothing at the surface, and then a slope that the table
//! is wrong by, which changes slowly. A Kalman filter estimates level and slope *in depth*, so that a needle that goes
//! faster or rests changes nothing in the model:
//!
//! ```text
//! level   l(z + Δz) = l + s·Δz + w_l,   var(w_l) = (σ_s·L)²·Δt/τ      the tissue moves by itself
//! slope   s(z + Δz) = s + w_s,          var(w_s) = σ_s²·|Δz|/L
//! sample  m = l + v,                    var(v) = σ²                    the sensor's noise
//! ```
//!
//! with σ_s the standard deviation of the slope before the first sample ([`TISSUE_SPREAD`]), L the depth range of the
//! table and τ [`LEVEL_TIME`]. So the ratio of σ to σ_s alone decides what the sensor is worth against the table: with
//! an exact sensor the estimate follows every sample, with a poor one it trusts the table until the samples together
//! say otherwise.
//!
//! Of a patient who breathes, the same sensor sees a displacement that comes again with every breath. With
//! [`Feedback::Harmonic`](crate::Feedback::Harmonic) it is a part of the state as soon as a whole breath has been seen, and is
//! predicted over the delay of the loop; see [`BreathBelief`].
//!
//! Two safeguards, because the model of the error is a model too: the gain never exceeds the one that the delayed loop
//! bears ([`crate::loop_stability`]), and innovations that keep their sign for longer than noise would widen the
//! covariance until the estimate follows (a patient who moves, tissue that is further off than was allowed for).

use crate::detection::{
    LEVEL_TIME, STEEPEST_SURPRISE, SURPRISE_GROWTH, SURPRISE_MEMORY, SURPRISE_SIGMAS, TISSUE_SPREAD,
};
use crate::scalar::{Scalar, bounded};

mod breathing;

pub use breathing::BreathBelief;
use breathing::{Breathing, Correction, News};

/// What is believed before the first sample, as variances; built once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief<T: Scalar> {
    /// Noise of a sample, length².
    pub noise: T,
    /// Slope in depth.
    pub slope: T,
    /// Change of the slope per length.
    pub slope_walk: T,
    /// Change of the level per second, length²/s.
    pub level_walk: T,
    /// Variance of the level past which surprise widens nothing any more, length².
    pub widest: T,
    /// Largest gain on the level.
    pub max_gain: T,
    /// What breaths are looked for with, if they are.
    pub breathing: Option<BreathBelief<T>>,
}

impl<T: Scalar> Belief<T> {
    /// Of a table whose target moves by at most `target_slope` per length over `depth_range` and by at most
    /// `target_range` in all, and a sensor with this standard deviation, length.
    pub fn new(noise: f64, target_slope: f64, depth_range: f64, target_range: f64, max_gain: f64) -> Self {
        // Where the table says that nothing moves, tissue that is another may still.
        let spread = TISSUE_SPREAD * target_slope.max(1e-3 * target_range / depth_range);
        // A sensor without stated noise still rounds.
        let noise = noise.max(1e-7 * target_range);
        let at_the_end = spread * depth_range;
        Self {
            noise: T::of(noise * noise),
            slope: T::of(spread * spread),
            slope_walk: T::of(spread * spread / depth_range),
            level_walk: T::of(at_the_end * at_the_end / LEVEL_TIME),
            widest: T::of(target_range * target_range),
            max_gain: T::of(max_gain),
            breathing: None,
        }
    }
}

/// Level and slope of the displacement that the table leaves, with their covariance.
///
/// ```
/// use firmware::observer::{Belief, Observer};
///
/// // 0.4 of noise on a target that the table has move by up to 0.2 per length, over a depth of 12.
/// let belief = Belief::<f64>::new(0.4, 0.2, 12.0, 10.0, 0.2);
/// let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
/// // One sample hardly counts; many that agree do.
/// observer.update(&belief, 1.0, 0.1, 0.03);
/// assert!(observer.at(0.1) < 0.01);
/// for _ in 0..300 {
///     observer.update(&belief, 1.0, 0.1, 0.03);
/// }
/// assert!((observer.at(0.1) - 1.0).abs() < 0.2);
/// // At rest nothing changes with time.
/// assert_eq!(observer.ahead(0.1), 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observer<T: Scalar> {
    level: T,
    slope: T,
    level_variance: T,
    covariance: T,
    slope_variance: T,
    /// Where the level holds, length.
    depth: T,
    /// Normalised innovations, summed with forgetting, and the variance of that sum.
    surprise: T,
    surprise_variance: T,
    breathing: Breathing<T>,
}

impl<T: Scalar> Observer<T> {
    /// At a depth, in a table that begins at `surface`, where nothing is left over. `level` is what somebody who placed
    /// the paddle beside its path has claimed, believed as far as it goes.
    pub fn starting(belief: &Belief<T>, level: T, depth: T, surface: T) -> Self {
        let inserted = depth - surface;
        Self {
            level,
            level_variance: belief.slope * inserted * inserted + level * level,
            covariance: belief.slope * inserted,
            slope_variance: belief.slope,
            depth,
            ..Self::default()
        }
    }

    /// Enters what the target's sensor showed beyond the table at `depth`, `elapsed` seconds after the sample before.
    pub fn update(&mut self, belief: &Belief<T>, measured: T, depth: T, elapsed: T) {
        let way = depth - self.depth;
        self.advance(belief, way, elapsed);
        self.breathing.advance(way, elapsed);
        self.depth = depth;
        let (breath, uncertain) = self.breathing.now();
        let innovation = measured - self.level - breath;
        self.widen_if_surprised(belief, innovation, belief.noise + uncertain);
        if self.breathing.is_predicted() {
            self.correct_all(belief, innovation, way);
        } else {
            let gains = self.gains(belief, way);
            self.correct(belief, innovation, gains);
        }
        if let Some(breaths) = &belief.breathing {
            match self.breathing.watch(breaths, measured, elapsed) {
                News::Nothing => {}
                News::Begins { middle, swing } => self.begin_to_predict(belief, middle, swing),
                News::Ends { left } => {
                    self.level += left;
                    self.level_variance += left * left;
                }
            }
        }
    }

    /// What level and slope have learnt of a patient who breathed was a breath.
    fn begin_to_predict(&mut self, belief: &Belief<T>, middle: T, swing: T) {
        (self.level, self.level_variance) = (middle, T::of(0.25 * 0.25) * swing * swing);
        (self.slope, self.slope_variance, self.covariance) = (T::zero(), belief.slope, T::zero());
    }

    /// The estimate at a depth, length, but for what a breath adds.
    pub fn at(&self, depth: T) -> T {
        self.level + self.slope * (depth - self.depth)
    }

    /// d(estimate)/d(depth).
    pub fn slope(&self) -> T {
        self.slope
    }

    /// What a breath adds to the estimate so many seconds after the last sample, length.
    pub fn ahead(&self, seconds: T) -> T {
        self.breathing.ahead(seconds)
    }

    /// Whether a breath has been seen, and the next ones are predicted.
    pub fn predicts_breaths(&self) -> bool {
        self.breathing.is_predicted()
    }

    fn advance(&mut self, belief: &Belief<T>, way: T, elapsed: T) {
        self.level += way * self.slope;
        let covariance = self.covariance + way * self.slope_variance;
        self.level_variance += way * (self.covariance + covariance) + belief.level_walk * elapsed;
        self.covariance = covariance;
        self.slope_variance += belief.slope_walk * way.abs();
    }

    /// Innovations of a filter whose model holds are white: their sum with forgetting stays within a few of its own
    /// standard deviations.
    fn widen_if_surprised(&mut self, belief: &Belief<T>, innovation: T, noise: T) {
        let memory = T::of(SURPRISE_MEMORY);
        self.surprise = self.surprise * memory + innovation / (self.level_variance + noise).sqrt();
        self.surprise_variance = self.surprise_variance * memory * memory + T::one();
        let expected = T::of(SURPRISE_SIGMAS * SURPRISE_SIGMAS) * self.surprise_variance;
        if self.surprise * self.surprise > expected && self.level_variance < belief.widest {
            let growth = T::of(SURPRISE_GROWTH);
            self.level_variance *= growth;
            if let Some(waves) = self.breathing.waves() {
                waves.widen(growth);
            }
            // At rest nothing would ever bring the slope's variance down again: what surprises then is no slope.
            if self.slope_variance < T::of(STEEPEST_SURPRISE) * belief.slope {
                self.covariance *= growth;
                self.slope_variance *= growth;
            }
        }
    }

    /// Kalman's gains on level and slope, no larger than what the delayed loop bears.
    fn gains(&self, belief: &Belief<T>, way: T) -> (T, T) {
        let variance = self.level_variance + belief.noise;
        let (level, slope) = (self.level_variance / variance, self.covariance / variance);
        let most = belief.max_gain;
        if level <= most {
            return (level, slope);
        }
        (most, bounded_slope(slope * (most / level), way, most))
    }

    /// In Joseph's form, which stays positive for any gains.
    fn correct(&mut self, belief: &Belief<T>, innovation: T, (level, slope): (T, T)) {
        self.level += level * innovation;
        self.slope += slope * innovation;
        let kept = T::one() - level;
        let covariance = self.covariance - slope * self.level_variance;
        self.slope_variance +=
            slope * (slope * (self.level_variance + belief.noise) - self.covariance - self.covariance);
        self.covariance = kept * covariance + level * slope * belief.noise;
        self.level_variance = kept * kept * self.level_variance + level * level * belief.noise;
    }

    /// The same with a breath's waves, which take their part of the gain that the loop bears.
    #[inline(never)] // Its temporaries are not on the stack of a loop without breaths.
    fn correct_all(&mut self, belief: &Belief<T>, innovation: T, way: T) {
        let Some(waves) = self.breathing.waves() else { return };
        let shares = waves.shares([self.level_variance, self.covariance]);
        let [level, slope] = shares.beside;
        let all = shares.in_all();
        let variance = all + belief.noise;
        let most = belief.max_gain * variance;
        let (mut part, mut part_of_slope) = (T::one(), T::one());
        if all > most {
            part = most / all;
            let gain = slope * part / variance;
            part_of_slope =
                if gain == T::zero() { part } else { bounded_slope(gain, way, belief.max_gain) / gain * part };
        }
        let correction = Correction { innovation: innovation / variance, variance, part, part_of_slope };
        waves.correct(&shares, &correction);
        self.level += level * part * correction.innovation;
        self.slope += slope * part_of_slope * correction.innovation;
        self.level_variance = left_of(self.level_variance, level * level * correction.lost(part, part));
        self.covariance -= level * slope * correction.lost(part, part_of_slope);
        let lost = slope * slope * correction.lost(part_of_slope, part_of_slope);
        self.slope_variance = left_of(self.slope_variance, lost);
    }
}

/// What is left of a variance; rounding leaves nothing less than none.
fn left_of<T: Scalar>(variance: T, lost: T) -> T {
    if variance > lost { variance - lost } else { T::zero() }
}

/// Gain on the slope beside `most` on the level, over a `way`: that of an α-β filter which keeps its bandwidth, β = α²/(2 − α)
/// per step, at most.
fn bounded_slope<T: Scalar>(slope: T, way: T, most: T) -> T {
    let steepest = most * most / (T::of(2.0) - most);
    let per_step = bounded(slope * way, -steepest, steepest);
    if way == T::zero() { slope } else { per_step / way }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, RowVector2, Vector2};
    use proptest::prelude::*;

    use super::*;

    const BELIEF: Belief<f64> = Belief {
        noise: 0.16,
        slope: 3e-5,
        slope_walk: 2.5e-6,
        level_walk: 1e-4,
        widest: 100.0,
        max_gain: 1.0,
        breathing: None,
    };

    /// The textbook's filter in matrices, without safeguards.
    struct Textbook {
        state: Vector2<f64>,
        covariance: Matrix2<f64>,
    }

    impl Textbook {
        fn update(&mut self, measured: f64, way: f64, elapsed: f64) {
            let advance = Matrix2::new(1.0, way, 0.0, 1.0);
            let walk = Matrix2::new(BELIEF.level_walk * elapsed, 0.0, 0.0, BELIEF.slope_walk * way.abs());
            self.state = advance * self.state;
            self.covariance = advance * self.covariance * advance.transpose() + walk;
            let row = RowVector2::new(1.0, 0.0);
            let gain = self.covariance * row.transpose() / (self.covariance[(0, 0)] + BELIEF.noise);
            self.state += gain * (measured - self.state[0]);
            self.covariance = (Matrix2::identity() - gain * row) * self.covariance;
        }
    }

    #[test]
    fn it_is_the_kalman_filter() {
        agrees_with_the_textbook(0.0);
    }

    /// A controller that is started with the needle in: the slope since the surface is what the level is uncertain by.
    #[test]
    fn it_is_the_kalman_filter_from_a_depth_on() {
        agrees_with_the_textbook(5.0);
    }

    /// From a needle that is so deep already, in a table that begins at 1.
    fn agrees_with_the_textbook(inserted: f64) {
        let mut observer = Observer::starting(&BELIEF, 0.0, 1.0 + inserted, 1.0);
        let since_the_surface = Vector2::new(inserted, 1.0);
        let covariance = since_the_surface * BELIEF.slope * since_the_surface.transpose();
        let mut textbook = Textbook { state: Vector2::zeros(), covariance };
        let mut depth = 1.0 + inserted;
        for k in 0..500 {
            // In, at rest, and out again; the samples swing about zero, so that nothing surprises.
            let way = if k < 200 {
                0.08
            } else if k < 300 {
                0.0
            } else {
                -0.03
            };
            depth += way;
            let measured = 0.4 * f64::sin(f64::from(k) * 2.3);
            observer.update(&BELIEF, measured, depth, 0.033);
            textbook.update(measured, way, 0.033);
            assert!((observer.level - textbook.state[0]).abs() < 1e-12, "{k}");
            assert!((observer.slope - textbook.state[1]).abs() < 1e-12, "{k}");
            assert!((observer.level_variance - textbook.covariance[(0, 0)]).abs() < 1e-12, "{k}");
            assert!((observer.slope_variance - textbook.covariance[(1, 1)]).abs() < 1e-12, "{k}");
        }
        assert!((observer.at(depth + 1.0) - observer.at(depth) - observer.slope()).abs() < 1e-12);
    }

    /// A slope that is constant, seen without noise, is known after some samples, and then nothing lags: an integral with
    /// this gain would stay 0.005 behind.
    #[test]
    fn a_ramp_leaves_no_offset() {
        let belief = Belief::<f64>::new(0.0, 0.2, 12.0, 10.0, 0.19);
        let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
        for k in 1..=250 {
            let depth = 0.048 * f64::from(k);
            observer.update(&belief, 0.02 * depth, depth, 0.02);
        }
        assert!((observer.at(12.0) - 0.24).abs() < 5e-5, "{}", observer.at(12.0));
        assert!((observer.slope() - 0.02).abs() < 2e-4, "{}", observer.slope());
    }

    /// A patient who moves: further than the table's spread would ever explain.
    #[test]
    fn surprise_makes_it_follow() {
        let follow = |jump: f64| {
            let belief = Belief::<f64>::new(0.4, 0.2, 12.0, 10.0, 0.19);
            let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
            (0..60).for_each(|_| observer.update(&belief, 0.0, 6.0, 0.033));
            let before = observer.level_variance;
            observer.update(&belief, jump, 6.0, 0.033);
            (0..20).for_each(|_| observer.update(&belief, jump, 6.0, 0.033));
            (observer.at(6.0) / jump, observer.level_variance / before)
        };
        let (followed, wider) = follow(2.0);
        assert!(followed > 0.7 && wider > 3.0, "{followed} {wider}");
        let (followed, wider) = follow(0.05);
        assert!(followed < 0.5 && wider < 1.5, "{followed} {wider}");
    }

    #[test]
    fn surprise_widens_the_slope_up_to_eight_times_what_was_thought() {
        for (part, grows) in [(63.9, true), (64.0, false), (64.1, false)] {
            let slope_variance = part * BELIEF.slope;
            let mut observer = Observer {
                surprise: 100.0,
                level_variance: 2.0,
                slope_variance,
                covariance: 1e-3,
                ..Observer::default()
            };
            observer.widen_if_surprised(&BELIEF, 0.0, BELIEF.noise);
            let growth = if grows { SURPRISE_GROWTH } else { 1.0 };
            assert_eq!(observer.level_variance, 2.0 * SURPRISE_GROWTH);
            assert_eq!(
                (observer.slope_variance, observer.covariance),
                (growth * slope_variance, growth * 1e-3),
                "{part}"
            );
        }
    }

    #[test]
    fn a_gain_that_the_loop_does_not_bear_is_lowered_for_level_and_slope_alike() {
        let belief = Belief { max_gain: 0.25, ..BELIEF };
        // Kalman's: 0.48/(0.48 + 0.16) = 3/4 and 0.08/(0.48 + 0.16) = 1/8.
        let observer = Observer { level_variance: 0.48, covariance: 0.08, ..Observer::default() };
        let (level, slope) = observer.gains(&belief, 0.0);
        assert_eq!(level, 0.25);
        assert!((slope - 1.0 / 24.0).abs() < 1e-15, "{slope}");
        // An α-β filter keeps its bandwidth with β = α²/(2 − α) per step: over a way of 2 that is less, in and out.
        for way in [2.0, -2.0] {
            let observer = Observer { level_variance: 0.48, covariance: 0.08 * way / 2.0, ..Observer::default() };
            let (_, slope) = observer.gains(&belief, way);
            assert!((slope * way - 0.25 * 0.25 / 1.75).abs() < 1e-15, "{slope}");
        }
    }

    /// Innovations over their standard deviation, summed: of 1 and 3 with a variance of 0.09 and noise of 0.16.
    #[test]
    fn surprise_is_a_sum_of_innovations_over_their_deviation() {
        let mut observer = Observer { level_variance: 0.09, slope_variance: 1e-9, ..Observer::default() };
        let widen = |observer: &mut Observer<f64>, by: f64| observer.widen_if_surprised(&BELIEF, by, 0.16);
        widen(&mut observer, 0.5);
        assert!((observer.surprise - 1.0).abs() < 1e-15 && observer.surprise_variance == 1.0);
        widen(&mut observer, 1.5);
        assert!((observer.surprise - (SURPRISE_MEMORY + 3.0)).abs() < 1e-14, "{}", observer.surprise);
        let expected = 1.0 + SURPRISE_MEMORY * SURPRISE_MEMORY;
        assert!((observer.surprise_variance - expected).abs() < 1e-15);
        assert_eq!(observer.level_variance, 0.09, "less than it takes");
    }

    /// After a paddle has been placed by somebody, the estimate begins with what they claim, and lets go of it.
    #[test]
    fn a_claim_holds_until_the_sensor_speaks() {
        let belief = Belief::<f64>::new(0.01, 0.2, 12.0, 10.0, 0.2);
        let mut observer = Observer::starting(&belief, 0.5, 0.0, 0.0);
        assert_eq!(observer.at(0.0), 0.5);
        for _ in 0..100 {
            observer.update(&belief, 0.0, 0.0, 0.02);
        }
        assert!(observer.at(0.0).abs() < 1e-3, "{}", observer.at(0.0));
    }

    /// The loop of estimate and paddle, whose true effect is λ times the assumed one, seen `delay` samples late.
    /// Returns the largest error of the last samples over the first one.
    fn residual(lambda: f64, delay: usize, noise: f64, way: f64) -> f64 {
        let gain = crate::loop_stability::default_gain(delay as u32, 1.3);
        let belief = Belief::<f64>::new(noise, 0.034 / 0.1, 0.1, 0.1, gain);
        let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
        let mut shown = std::collections::VecDeque::from(std::vec![0.0; delay + 1]);
        let mut last = 0.0f64;
        for k in 0..3000 {
            let depth = way * f64::from(k);
            let disturbance = 1e-3 + 0.02 * depth;
            let applied = shown.pop_front().unwrap();
            let error = disturbance - lambda * applied;
            observer.update(&belief, error + applied, depth, 0.02);
            shown.push_back(observer.at(depth + way * (delay + 1) as f64));
            last = if k < 2900 { 0.0 } else { last.max(error.abs()) };
            if error.abs() > 1e6 {
                return f64::INFINITY;
            }
        }
        last / 1e-3
    }

    /// Up to seven tenths of the effect that the integral with the same gain bears: the slope takes some of its margin
    /// (λ·(2α + β) < 4 without delay).
    #[test]
    fn the_loop_is_stable_where_the_gain_promises_it() {
        for delay in [0usize, 1, 2, 3, 5] {
            let limit = crate::loop_stability::gain_limit(0.0, delay as u32)
                / crate::loop_stability::default_gain(delay as u32, 1.3);
            for lambda in [0.5, 0.8, 1.0, 1.3, 0.7 * limit] {
                for (noise, way) in [(0.0, 4e-4), (0.0, 0.0), (1e-5, 4e-4), (1e-5, 0.0)] {
                    let left = residual(lambda, delay, noise, way);
                    assert!(left < 0.02, "delay {delay}, λ {lambda}, noise {noise}, way {way}: {left}");
                }
            }
            let beyond = residual(1.5 * limit, delay, 0.0, 0.0);
            assert!(beyond > 1.0, "delay {delay}: the limit means something, {beyond}");
        }
    }

    proptest! {
        /// Whatever is measured, wherever: covariances of something, and finite numbers.
        #[test]
        fn the_covariance_stays_one(
            noise in 0.0..1.0f64,
            samples in proptest::collection::vec((-20.0..20.0f64, 0.0..12.0f64, 0.0..10.0f64), 1..200),
        ) {
            let belief = Belief::<f64>::new(noise, 0.2, 12.0, 10.0, 0.25);
            let mut observer = Observer::starting(&belief, 0.3, 1.0, 0.0);
            for (measured, depth, elapsed) in samples {
                observer.update(&belief, measured, depth, elapsed);
                let Observer { level_variance, covariance, slope_variance, .. } = observer;
                prop_assert!(level_variance > 0.0 && slope_variance > 0.0);
                let determinant = level_variance * slope_variance - covariance * covariance;
                prop_assert!(determinant > -1e-9 * level_variance * slope_variance, "{observer:?}");
                prop_assert!(observer.at(6.0).is_finite() && observer.slope().is_finite());
            }
        }

        /// A long rest with a target that drifts and breathes, and then motion: nothing is left that the motion could blow up.
        #[test]
        fn a_long_rest_leaves_nothing_behind(
            noise in 1e-4..0.5f32,
            amplitude in 0.1..5.0f32,
            period_s in 1.0..10.0f32,
            drift in -0.3..0.3f32,
        ) {
            let belief = Belief::<f32>::new(f64::from(noise), 0.2, 12.0, 17.0, 0.19);
            let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
            let mut worst = 0.0f32;
            for k in 0..1500u16 {
                let time_s = f32::from(k) / 30.0;
                let depth = if k < 75 { 0.08 * f32::from(k) } else if k < 1200 { 6.0 } else { 6.0 + 0.02 * f32::from(k - 1200) };
                let phase = core::f64::consts::TAU * f64::from(time_s / period_s);
                let target = amplitude * libm::sin(phase) as f32 + drift * time_s.min(30.0);
                observer.update(&belief, target, depth, 1.0 / 30.0);
                worst = worst.max((observer.at(depth) - target).abs());
                prop_assert!(observer.at(depth).is_finite() && observer.slope_variance.is_finite(), "{observer:?}");
            }
            prop_assert!(worst < 3.0 * amplitude + 2.0, "{worst} of {amplitude}");
        }

        /// Lengths in any unit.
        #[test]
        fn units_do_not_matter(exponent in -6..6i32, seed in 0..1000u32) {
            let unit = 10f64.powi(exponent);
            let run = |unit: f64| {
                let belief = Belief::<f64>::new(0.4 * unit, 0.2, 12.0 * unit, 10.0 * unit, 0.25);
                let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
                for k in 0..100 {
                    let measured = f64::sin(f64::from(k * seed)) + 0.01 * f64::from(k);
                    observer.update(&belief, measured * unit, 0.1 * f64::from(k) * unit, 0.03);
                }
                observer.at(10.0 * unit) / unit
            };
            prop_assert!((run(unit) - run(1.0)).abs() < 1e-9);
        }
    }
}
