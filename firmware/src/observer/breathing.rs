//! A displacement that comes again with every breath: two waves that turn with time, and what finds their period.
//!
//! ```text
//! d(t) = c₁ + c₂,   cₖ' = k·ω·sₖ,   sₖ' = −k·ω·cₖ        k = 1, 2
//! ```
//!
//! cos⁴, the usual model of breathing, has these two waves and no other (Lujan et al., Medical Physics 26, 1999). They are
//! four more states of the observer's Kalman filter, which turn with time and walk by a part of a breath's size from one to the
//! next; their covariances with each other and with level and slope are kept in blocks of two by two.
//!
//! Nothing is predicted before a whole breath has been seen: two rises through the middle between the last top and the last
//! bottom of the smoothed signal. Noise does not make a top, because the signal must fall by several of its standard
//! deviations from it. Every later breath corrects the period, and a breath that does not come ends the prediction.

use super::{Belief, left_of};
use crate::detection::{
    BREATH_CHANGE, BREATH_GAP, BREATH_LEARNS, BREATH_SIGMAS, BREATH_SMOOTHING, BREATH_WANDER, BREATHS_MISSED,
    LONGEST_BREATH, SHORTEST_BREATH,
};
use crate::scalar::Scalar;

/// A swing counts from this many steps on.
const STEPS_PER_SWING: f64 = 2.5;
/// Size of the second wave over the first (cos⁴), as far as it is known before.
const SECOND_WAVE: f64 = 0.5;

/// What breaths are looked for with; built once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BreathBelief<T: Scalar> {
    /// Part of a sample that the smoothed signal takes.
    share: T,
    /// A top is one once the smoothed signal has fallen this far from it, length.
    step: T,
}

impl<T: Scalar> BreathBelief<T> {
    /// Of a sensor with this period, s, and noise, length, whose target moves by at most `target_range`, length.
    pub(super) fn new(target_period: f64, noise: f64, target_range: f64) -> Self {
        let share = (target_period / BREATH_SMOOTHING).min(1.0);
        let smoothed = noise * libm::sqrt(share / (2.0 - share));
        Self { share: T::of(share), step: T::of((BREATH_SIGMAS / STEPS_PER_SWING * smoothed).max(1e-3 * target_range)) }
    }
}

/// Two numbers that turn into each other: a wave's displacement now and a quarter of a turn later.
type Pair<T> = [T; 2];
/// Covariances of two pairs: rows for the first, columns for the second.
type Block<T> = [[T; 2]; 2];
/// Covariances of a pair with itself: first, of both, second.
type Variance<T> = [T; 3];

/// Cosine and sine of an angle.
#[derive(Clone, Copy, Debug)]
struct Turn<T> {
    cos: T,
    sin: T,
}

impl<T: Scalar> Turn<T> {
    /// By `angle`, rad: a rotation whatever the angle is, to 8e-6 up to half a turn either way and 6e-8 up to a quarter.
    ///
    /// Padé's approximation of the tangent of an eighth, tan y ≈ y·(15 − y²)/(15 − 6y²), is the half of a quarter of it; what
    /// is more than half a turn is taken off before, because a sensor may be away for several breaths.
    fn by(angle: T) -> Self {
        let turns = angle * T::of(core::f64::consts::FRAC_1_PI * 0.5);
        let angle = if turns.abs() > T::of(0.5) { (turns - turns.round()) * T::two_pi() } else { angle };
        let eighth = T::of(0.125) * angle;
        let squared = eighth * eighth;
        let opposite = eighth * (T::of(15.0) - squared);
        let adjacent = T::of(15.0) - T::of(6.0) * squared;
        let (square, other) = (adjacent * adjacent, opposite * opposite);
        let scale = T::one() / (square + other);
        let product = adjacent * opposite;
        Self { cos: (square - other) * scale, sin: (product + product) * scale }.twice().twice()
    }

    fn twice(self) -> Self {
        let product = self.cos * self.sin;
        Self { cos: self.cos * self.cos - self.sin * self.sin, sin: product + product }
    }

    fn pair(self, [now, later]: Pair<T>) -> Pair<T> {
        [self.cos * now + self.sin * later, self.cos * later - self.sin * now]
    }

    fn rows(self, [[a, b], [c, d]]: Block<T>) -> Block<T> {
        let ([a, c], [b, d]) = (self.pair([a, c]), self.pair([b, d]));
        [[a, b], [c, d]]
    }

    fn columns(self, [first, second]: Block<T>) -> Block<T> {
        [self.pair(first), self.pair(second)]
    }

    fn variance(self, [first, both, second]: Variance<T>) -> Variance<T> {
        let Self { cos: doubled, sin: doubled_sin } = self.twice();
        let product = self.cos * self.sin * (second - first);
        let turned = self.cos * self.cos * first + doubled_sin * both + self.sin * self.sin * second;
        [turned, product + doubled * both, first + second - turned]
    }
}

/// Where the smoothed signal is on its way up and down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Swing<T: Scalar> {
    /// The smoothed signal, from the first sample on.
    smooth: Option<T>,
    /// The farthest that it has been since it turned, length.
    extreme: T,
    /// Whether it rises; unknown until it has gone by a step.
    rises: Option<bool>,
    top: Option<T>,
    bottom: Option<T>,
    /// Since it last rose through the middle, s.
    since_rise: Option<T>,
    /// Whether the sensor was away meanwhile: a rise may have been missed.
    has_gap: bool,
}

/// A rise through the middle.
struct Rise<T> {
    /// Since the one before, s.
    period: Option<T>,
    /// Between bottom and top, length.
    middle: T,
    /// From bottom to top, length.
    swing: T,
}

impl<T: Scalar> Swing<T> {
    fn watch(&mut self, belief: &BreathBelief<T>, measured: T, elapsed: T) -> Option<Rise<T>> {
        if self.smooth.is_none() {
            self.extreme = measured;
        }
        let mut before = self.smooth.unwrap_or(measured);
        if elapsed > T::of(BREATH_GAP * SHORTEST_BREATH) {
            // What was smoothed is gone, and the time until the next rise will be no period.
            before = measured;
            self.has_gap = true;
            self.since_rise = self.since_rise.map(|_| T::zero());
        } else {
            self.since_rise = self.since_rise.map(|since| since + elapsed);
        }
        let now = before + belief.share * (measured - before);
        self.smooth = Some(now);
        match self.rises {
            Some(true) if now > self.extreme => self.extreme = now,
            Some(false) if now < self.extreme => self.extreme = now,
            Some(true) if now < self.extreme - belief.step => {
                (self.top, self.rises, self.extreme) = (Some(self.extreme), Some(false), now);
            }
            Some(false) if now > self.extreme + belief.step => {
                (self.bottom, self.rises, self.extreme) = (Some(self.extreme), Some(true), now);
            }
            None if (now - self.extreme).abs() > belief.step => {
                (self.rises, self.extreme) = (Some(now > self.extreme), now);
            }
            _ => {}
        }
        let swing = self.top? - self.bottom?;
        let middle = self.bottom? + T::of(0.5) * swing;
        if self.rises == Some(true) && before < middle && middle <= now && swing > T::of(STEPS_PER_SWING) * belief.step
        {
            let since = self.since_rise.replace(T::zero());
            let period = if core::mem::take(&mut self.has_gap) { None } else { since };
            return Some(Rise { period, middle, swing });
        }
        None
    }
}

/// What a breath does to the target, and when the next one comes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Breathing<T: Scalar> {
    swing: Swing<T>,
    /// 2π over the period, rad/s, and the waves; none until a breath has been seen.
    waves: Option<Waves<T>>,
    /// The last breath took another time than those before: once is a pause, twice is another period.
    doubted: bool,
}

/// Both waves, and what is known of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Waves<T: Scalar> {
    rate: T,
    first: Pair<T>,
    second: Pair<T>,
    of_first: Variance<T>,
    of_second: Variance<T>,
    /// Of the first (rows) with the second.
    between: Block<T>,
    /// Of each (rows) with level and slope.
    first_beside: Block<T>,
    second_beside: Block<T>,
}

/// Covariances of what is measured with the states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shares<T: Scalar> {
    /// With level and slope.
    pub(super) beside: Pair<T>,
    first: Pair<T>,
    second: Pair<T>,
}

impl<T: Scalar> Shares<T> {
    /// Of what is measured itself.
    pub(super) fn in_all(&self) -> T {
        let ([level, _], [first, _], [second, _]) = (self.beside, self.first, self.second);
        level + first + second
    }
}

/// A correction: parts of Kalman's gains that are taken, on the slope less than on everything else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correction<T: Scalar> {
    /// Innovation over its variance.
    pub(super) innovation: T,
    /// Variance of the innovation.
    pub(super) variance: T,
    pub(super) part: T,
    pub(super) part_of_slope: T,
}

impl<T: Scalar> Correction<T> {
    /// What a covariance loses per product of shares. Joseph's form, `P − K hᵀ − h Kᵀ + K σ² Kᵀ`, whose gains are parts a, b
    /// of h/σ², is `P − h hᵀ (a + b − ab)/σ²`: positive for any parts.
    pub(super) fn lost(&self, one: T, other: T) -> T {
        (one + other - one * other) / self.variance
    }
}

fn less<T: Scalar>([first, both, second]: Variance<T>, lost: T, [a, b]: Pair<T>) -> Variance<T> {
    let scaled = lost * a;
    [left_of(first, scaled * a), both - scaled * b, left_of(second, lost * b * b)]
}

fn less_between<T: Scalar>([upper, lower]: Block<T>, [a, b]: Pair<T>, columns: Pair<T>) -> Block<T> {
    let row = |[first, second]: Pair<T>, share: T| {
        let [one, other] = columns;
        [first - share * one, second - share * other]
    };
    [row(upper, a), row(lower, b)]
}

impl<T: Scalar> Waves<T> {
    fn beginning(period: T, swing: T) -> Self {
        let (half, rate) = (T::of(0.5) * swing, T::two_pi() / period);
        let deviation = T::of(0.25) * swing;
        let variance = deviation * deviation;
        let (zero, second) = (T::zero(), T::of(SECOND_WAVE * SECOND_WAVE) * variance);
        Self {
            rate,
            // The smoothed signal rises through its middle now; the signal did so before.
            first: Turn::by(rate * T::of(BREATH_SMOOTHING)).pair([zero, half]),
            second: [zero; 2],
            of_first: [variance, zero, variance],
            of_second: [second, zero, second],
            between: [[zero; 2]; 2],
            first_beside: [[zero; 2]; 2],
            second_beside: [[zero; 2]; 2],
        }
    }

    /// The waves turn, and are less certain; the level goes along its slope by `way`.
    #[inline(never)] // Its temporaries are not on the loop's stack beside those of a correction.
    fn advance(&mut self, way: T, elapsed: T) {
        let angle = self.rate * elapsed;
        let first = Turn::by(angle);
        let second = first.twice();
        // Over a period 2π/ω, the part of a breath that the next one may differ by.
        let walk = T::of(BREATH_WANDER * BREATH_WANDER / core::f64::consts::TAU) * self.size() * angle;
        let wider = |[a, both, b]: Variance<T>, walk: T| [a + walk, both, b + walk];
        let along = |block: Block<T>| block.map(|[level, slope]| [level + way * slope, slope]);
        self.first = first.pair(self.first);
        self.second = second.pair(self.second);
        self.of_first = wider(first.variance(self.of_first), walk);
        self.of_second = wider(second.variance(self.of_second), T::of(SECOND_WAVE * SECOND_WAVE) * walk);
        self.between = second.columns(first.rows(self.between));
        self.first_beside = along(first.rows(self.first_beside));
        self.second_beside = along(second.rows(self.second_beside));
    }

    /// What surprises is another breath as likely as anything else: the waves are less certain by this factor, as long as
    /// they are known better than by half of their size.
    pub(super) fn widen(&mut self, growth: T) {
        let [first, ..] = self.of_first;
        if first < T::of(0.25) * self.size() {
            self.of_first = self.of_first.map(|variance| growth * variance);
            self.of_second = self.of_second.map(|variance| growth * variance);
            self.between = self.between.map(|row| row.map(|variance| growth * variance));
        }
    }

    /// Of the first wave, length².
    fn size(&self) -> T {
        let [now, later] = self.first;
        now * now + later * later
    }

    fn now(&self) -> T {
        let ([first, _], [second, _]) = (self.first, self.second);
        first + second
    }

    /// What they add to the variance of what is measured.
    fn variance(&self) -> T {
        let ([first, ..], [second, ..], [[between, _], _]) = (self.of_first, self.of_second, self.between);
        let ([[level, _], _], [[level_too, _], _]) = (self.first_beside, self.second_beside);
        let twice = between + level + level_too;
        first + second + twice + twice
    }

    /// Covariances of what is measured with the states; level and slope have these with the level alone.
    pub(super) fn shares(&self, [level, slope]: Pair<T>) -> Shares<T> {
        let ([[a, b], [c, _]], [p, q, _], [r, s, _]) = (self.between, self.of_first, self.of_second);
        let [[first_level, first_slope], [first_later, _]] = self.first_beside;
        let [[second_level, second_slope], [second_later, _]] = self.second_beside;
        Shares {
            beside: [level + first_level + second_level, slope + first_slope + second_slope],
            first: [p + a + first_level, q + c + first_later],
            second: [r + a + second_level, s + b + second_later],
        }
    }

    /// Enters a correction.
    pub(super) fn correct(&mut self, shares: &Shares<T>, correction: &Correction<T>) {
        let Correction { innovation, part, part_of_slope, .. } = *correction;
        let (lost, beside_lost) = (correction.lost(part, part), correction.lost(part, part_of_slope));
        let step = part * innovation;
        let moved = |[now, later]: Pair<T>, [a, b]: Pair<T>| [now + a * step, later + b * step];
        let Shares { beside: [level, slope], first, second } = *shares;
        let line = [lost * level, beside_lost * slope];
        self.first = moved(self.first, first);
        self.second = moved(self.second, second);
        self.of_first = less(self.of_first, lost, first);
        self.of_second = less(self.of_second, lost, second);
        self.between = less_between(self.between, first, second.map(|share| lost * share));
        self.first_beside = less_between(self.first_beside, first, line);
        self.second_beside = less_between(self.second_beside, second, line);
    }

    fn ahead(&self, seconds: T) -> T {
        let turn = Turn::by(self.rate * seconds);
        let ([first, _], [second, _]) = (turn.pair(self.first), turn.twice().pair(self.second));
        first + second
    }
}

/// What a sample taught about breathing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum News<T> {
    Nothing,
    /// From now on it is predicted; breaths have this middle and this size, length.
    Begins {
        middle: T,
        swing: T,
    },
    /// No longer; the waves came to this, length.
    Ends {
        left: T,
    },
}

impl<T: Scalar> Breathing<T> {
    /// The waves, where breaths are predicted.
    pub(super) fn waves(&mut self) -> Option<&mut Waves<T>> {
        self.waves.as_mut()
    }

    /// Whether breaths are predicted.
    pub(super) fn is_predicted(&self) -> bool {
        self.waves.is_some()
    }

    /// Time goes on, and the level along its slope by `way`.
    pub(super) fn advance(&mut self, way: T, elapsed: T) {
        if let Some(waves) = &mut self.waves {
            waves.advance(way, elapsed);
        }
    }

    /// Displacement now, length, and what it adds to the variance of what is measured, length².
    pub(super) fn now(&self) -> (T, T) {
        self.waves.as_ref().map_or((T::zero(), T::zero()), |waves| (waves.now(), waves.variance()))
    }

    /// Displacement in so many seconds, length.
    pub(super) fn ahead(&self, seconds: T) -> T {
        self.waves.as_ref().map_or(T::zero(), |waves| waves.ahead(seconds))
    }

    /// Looks for breaths.
    #[inline(never)] // See `Waves::advance`.
    pub(super) fn watch(&mut self, belief: &BreathBelief<T>, measured: T, elapsed: T) -> News<T> {
        let rise = self.swing.watch(belief, measured, elapsed);
        let seen = rise.and_then(|rise| Some((rise.period?, rise.middle, rise.swing)));
        let breath = T::of(SHORTEST_BREATH)..=T::of(LONGEST_BREATH);
        match (&mut self.waves, seen.filter(|(period, ..)| breath.contains(period))) {
            (None, Some((period, middle, swing))) => {
                self.waves = Some(Waves::beginning(period, swing));
                News::Begins { middle, swing }
            }
            (Some(waves), Some((period, _, swing))) => {
                let rate = T::two_pi() / period;
                if (rate - waves.rate).abs() <= T::of(BREATH_CHANGE) * waves.rate {
                    waves.rate += T::of(BREATH_LEARNS) * (rate - waves.rate);
                    self.doubted = false;
                } else {
                    // The phase is known either way.
                    let period = if self.doubted { period } else { T::two_pi() / waves.rate };
                    *waves = Waves::beginning(period, swing);
                    self.doubted = !self.doubted;
                }
                News::Nothing
            }
            (Some(waves), None) => {
                let longest = T::of(BREATHS_MISSED) * T::two_pi();
                if self.swing.since_rise.is_some_and(|since| since * waves.rate <= longest) {
                    return News::Nothing;
                }
                let left = waves.now();
                // Until it rises again is a pause and no period.
                (self.waves, self.doubted, self.swing.since_rise) = (None, false, None);
                News::Ends { left }
            }
            (None, None) => News::Nothing,
        }
    }
}

impl<T: Scalar> Belief<T> {
    /// The same of a patient who may breathe, seen every `target_period` seconds.
    #[must_use]
    pub fn with_breathing(self, target_period: f64) -> Self {
        let (noise, range) = (libm::sqrt(self.noise.to_f64()), libm::sqrt(self.widest.to_f64()));
        Self { breathing: Some(BreathBelief::new(target_period, noise, range)), ..self }
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{PI, TAU};

    use nalgebra::{Matrix2, SMatrix, SVector};
    use proptest::prelude::*;

    use super::*;
    use crate::observer::Observer;

    const ULTRASOUND_S: f64 = 1.0 / 30.0;

    /// A sensor's noise: sums of twelve uniform numbers, standard deviation 1.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            let mut uniform = || {
                self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (self.0 >> 11) as f64 / (1u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    fn belief(noise: f64) -> Belief<f64> {
        Belief::new(noise, 0.2, 12.0, 10.0, 0.1).with_breathing(ULTRASOUND_S)
    }

    /// As Lujan et al. have it.
    fn lujan(amplitude: f64, period_s: f64, time_s: f64) -> f64 {
        amplitude * (1.0 - (PI * time_s / period_s).cos().powi(4))
    }

    /// An observer that has seen this for so long at depth 0.
    fn having_seen(belief: &Belief<f64>, seconds: f64, target: impl Fn(f64) -> f64, seed: u64) -> Observer<f64> {
        let mut noise = Noise(seed);
        let mut observer = Observer::starting(belief, 0.0, 0.0, 0.0);
        for k in 0..(seconds / ULTRASOUND_S) as u32 {
            let time_s = f64::from(k) * ULTRASOUND_S;
            let measured = target(time_s) + belief.noise.sqrt() * noise.next();
            observer.update(belief, measured, 0.0, ULTRASOUND_S);
        }
        observer
    }

    /// Root mean square of what is wrong with the displacement that is foretold for `ahead_s` later, over the last `counted`
    /// seconds.
    fn foretold(belief: &Belief<f64>, seconds: f64, ahead_s: f64, target: &dyn Fn(f64) -> f64) -> f64 {
        let mut noise = Noise(7);
        let mut observer = Observer::starting(belief, 0.0, 0.0, 0.0);
        let samples = (seconds / ULTRASOUND_S) as u32;
        let (mut squares, mut counted) = (0.0, 0.0);
        for k in 0..samples {
            let time_s = f64::from(k) * ULTRASOUND_S;
            observer.update(belief, target(time_s) + belief.noise.sqrt() * noise.next(), 0.0, ULTRASOUND_S);
            if time_s > 0.5 * seconds {
                let off = observer.at(0.0) + observer.ahead(ahead_s) - target(time_s + ahead_s);
                (squares, counted) = (squares + off * off, counted + 1.0);
            }
        }
        f64::sqrt(squares / counted)
    }

    #[test]
    fn a_turn_is_a_rotation_by_its_angle() {
        for k in -400..=400 {
            let angle = 0.05 * f64::from(k);
            let [now, later] = Turn::by(angle).pair([0.6, 0.8]);
            assert!((now.hypot(later) - 1.0).abs() < 1e-14, "{angle}");
            let exact = 0.6 * angle.cos() + 0.8 * angle.sin();
            let within_a_turn = (angle / TAU - (angle / TAU).round()).abs() * TAU;
            let bound = if within_a_turn < PI / 2.0 { 6e-8 } else { 8e-6 };
            assert!((now - exact).abs() < bound, "{angle}: {now} {exact}");
        }
    }

    #[test]
    fn it_is_the_kalman_filter_of_six_states() {
        agrees_with_six_states(10.0);
    }

    /// Gains that the loop does not bear are lowered together, that on the slope to what its way bears; the covariance is then
    /// Joseph's, which holds for any gains.
    #[test]
    fn it_is_a_filter_of_six_states_with_lower_gains_where_the_loop_bears_no_more() {
        agrees_with_six_states(0.05);
        agrees_with_six_states(0.01);
    }

    /// A detector that takes every sample as it is, and turns after a step of 1.
    fn swings(samples: &[f64]) -> Swing<f64> {
        let belief = BreathBelief { share: 1.0, step: 1.0 };
        let mut swing = Swing::default();
        for sample in samples {
            let _ = swing.watch(&belief, *sample, ULTRASOUND_S);
        }
        swing
    }

    #[test]
    fn a_swing_turns_where_it_is_farthest_once_it_has_come_back_by_a_step() {
        // Less than a step is no direction.
        assert_eq!((swings(&[5.0, 5.9, 4.2, 5.9]).rises, swings(&[5.0, 6.1]).rises), (None, Some(true)));
        assert_eq!(swings(&[5.0, 3.9]).rises, Some(false));
        // Up first: a top, and no bottom before it has turned again.
        let up = swings(&[5.0, 7.0, 8.0, 7.5, 8.5, 7.6]);
        assert_eq!((up.rises, up.extreme, up.top, up.bottom), (Some(true), 8.5, None, None));
        let turned = swings(&[5.0, 7.0, 8.0, 8.5, 7.4, 6.0, 6.9]);
        assert_eq!((turned.rises, turned.extreme, turned.top, turned.bottom), (Some(false), 6.0, Some(8.5), None));
        let up_again = swings(&[5.0, 8.5, 6.0, 7.1, 9.0]);
        assert_eq!((up_again.rises, up_again.top, up_again.bottom), (Some(true), Some(8.5), Some(6.0)));
        // Down first: the other way round.
        let down = swings(&[5.0, 3.0, 2.0, 2.9]);
        assert_eq!((down.rises, down.extreme, down.top, down.bottom), (Some(false), 2.0, None, None));
        let turned = swings(&[5.0, 3.0, 2.0, 3.1]);
        assert_eq!((turned.rises, turned.top, turned.bottom), (Some(true), None, Some(2.0)));
    }

    #[test]
    fn a_breath_begins_in_its_middle_uncertain_by_a_quarter_of_its_swing() {
        let waves = Waves::beginning(4.0, 6.0);
        assert!((waves.rate - PI / 2.0).abs() < 1e-15);
        // The signal has gone on by the time that smoothing takes.
        let since = BREATH_SMOOTHING * waves.rate;
        assert!((waves.first[0] - 3.0 * since.sin()).abs() < 1e-6 && (waves.first[1] - 3.0 * since.cos()).abs() < 1e-6);
        let quarter = 1.5 * 1.5;
        assert_eq!((waves.of_first, waves.second), ([quarter, 0.0, quarter], [0.0; 2]));
        let second = SECOND_WAVE * SECOND_WAVE * quarter;
        assert_eq!(waves.of_second, [second, 0.0, second]);
    }

    /// As long as they are known better than by half of their size.
    #[test]
    fn surprise_widens_the_waves_up_to_half_of_their_size() {
        let known = Waves {
            first: [3.0, 4.0],
            of_second: [1.0, 0.5, 2.0],
            between: [[0.1, 0.2], [0.3, 0.4]],
            ..Waves::beginning(4.0, 6.0)
        };
        for (variance, grows) in [(6.2, true), (6.25, false), (6.3, false)] {
            let before = Waves { of_first: [variance, 1.0, 3.0], ..known };
            let mut after = before;
            after.widen(2.0);
            let expected = Waves {
                of_first: [2.0 * variance, 2.0, 6.0],
                of_second: [2.0, 1.0, 4.0],
                between: [[0.2, 0.4], [0.6, 0.8]],
                ..before
            };
            assert_eq!(after, if grows { expected } else { before }, "{variance}");
        }
    }

    /// The textbook's filter in matrices of six by six, without any other safeguard.
    fn agrees_with_six_states(max_gain: f64) {
        let belief = Belief { max_gain, ..belief(0.4) };
        let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
        let breath = |time_s: f64| lujan(3.0, 4.0, time_s);
        let mut k = 0;
        while !observer.predicts_breaths() {
            observer.update(&belief, breath(f64::from(k) * ULTRASOUND_S), 0.0, ULTRASOUND_S);
            k += 1;
        }
        // What level and slope were widened by is no part of this.
        (observer.surprise, observer.surprise_variance) = (0.0, 0.0);
        let of = |observer: &Observer<f64>| {
            let waves = observer.breathing.waves.unwrap();
            let mut state = SVector::<f64, 6>::zeros();
            let mut covariance = SMatrix::<f64, 6, 6>::zeros();
            let ([first, first_later], [second, second_later]) = (waves.first, waves.second);
            state.copy_from_slice(&[observer.level, observer.slope, first, first_later, second, second_later]);
            let line = Matrix2::new(
                observer.level_variance,
                observer.covariance,
                observer.covariance,
                observer.slope_variance,
            );
            let mut put = |row: usize, column: usize, block: &Matrix2<f64>| {
                covariance.fixed_view_mut::<2, 2>(row, column).copy_from(block);
                covariance.fixed_view_mut::<2, 2>(column, row).copy_from(&block.transpose());
            };
            let of_itself = |[first, both, second]: Variance<f64>| Matrix2::new(first, both, both, second);
            let block = |[[a, b], [c, d]]: Block<f64>| Matrix2::new(a, b, c, d);
            put(0, 0, &line);
            put(2, 2, &of_itself(waves.of_first));
            put(4, 4, &of_itself(waves.of_second));
            put(2, 4, &block(waves.between));
            put(2, 0, &block(waves.first_beside));
            put(4, 0, &block(waves.second_beside));
            (state, covariance, waves.rate)
        };
        let (mut depth, mut lowered) = (0.0, 0);
        for step in 0..100 {
            let (state, covariance, rate) = of(&observer);
            let mut transition = SMatrix::<f64, 6, 6>::identity();
            let way = 0.08;
            transition[(0, 1)] = way;
            let Turn { cos, sin } = Turn::by(rate * ULTRASOUND_S);
            let first = Matrix2::new(cos, sin, -sin, cos);
            transition.fixed_view_mut::<2, 2>(2, 2).copy_from(&first);
            transition.fixed_view_mut::<2, 2>(4, 4).copy_from(&(first * first));
            let size = state.fixed_rows::<2>(2).norm_squared();
            let walk = BREATH_WANDER.powi(2) / TAU * size * rate * ULTRASOUND_S;
            let walks = [belief.level_walk * ULTRASOUND_S, belief.slope_walk * way, walk, walk, walk / 4.0, walk / 4.0];
            let before = transition * covariance * transition.transpose() + SMatrix::from_diagonal(&walks.into());
            let row = SMatrix::<f64, 1, 6>::from([1.0, 0.0, 1.0, 0.0, 1.0, 0.0].map(|x| [x]));
            let mut gain = before * row.transpose() / ((row * before * row.transpose()).x + belief.noise);
            let seen = (row * gain).x;
            if seen > max_gain {
                gain *= max_gain / seen;
                let steepest = max_gain * max_gain / (2.0 - max_gain) / way;
                gain[1] = gain[1].clamp(-steepest, steepest);
                lowered += 1;
            }
            let measured = breath(f64::from(k + step) * ULTRASOUND_S) + 0.02 * depth;
            let expected = transition * state;
            let expected = expected + gain * (measured - (row * expected).x);
            let kept = SMatrix::<f64, 6, 6>::identity() - gain * row;
            let after = kept * before * kept.transpose() + gain * belief.noise * gain.transpose();
            depth += way;
            (observer.surprise, observer.surprise_variance) = (0.0, 0.0);
            observer.update(&belief, measured, depth, ULTRASOUND_S);
            let (state, covariance, rate_now) = of(&observer);
            assert!((state - expected).amax() < 1e-12, "{step}: {state} {expected}");
            assert!((covariance - after).amax() < 1e-12 * after.amax().max(1.0), "{step}: {covariance} {after}");
            let beside_the_level = (row * after * row.transpose()).x - after[(0, 0)];
            let of_waves = observer.breathing.waves.unwrap().variance();
            assert!((of_waves - beside_the_level).abs() < 1e-12 * after.amax().max(1.0), "{step}: {of_waves}");
            if rate_now != rate {
                break;
            }
        }
        assert!(depth > 2.0 && (lowered > 10) == (max_gain < 1.0), "{depth} {lowered}");
    }

    /// cos⁴ is a level and two waves: what is left without noise is what the period is off by, and nothing once that is
    /// right.
    #[test]
    fn a_breath_that_repeats_itself_is_foretold() {
        for (period_s, amplitude) in [(2.0, 1.0), (4.0, 3.0), (5.5, 8.0), (10.0, 2.0)] {
            let left = foretold(&belief(0.0), 60.0, 0.1, &|time_s| lujan(amplitude, period_s, time_s));
            assert!(left < 0.01 * amplitude, "{period_s} s: {left} of {amplitude}");
        }
    }

    /// With an ultrasound's noise, over its delay: better than the observer that follows behind, several times.
    #[test]
    fn with_noise_it_beats_following() {
        for period_s in [3.0, 4.0, 5.0] {
            let breath = |time_s: f64| lujan(3.0, period_s, time_s);
            let predicted = foretold(&belief(0.4), 60.0, 0.1, &breath);
            let followed = foretold(&Belief { breathing: None, ..belief(0.4) }, 60.0, 0.1, &breath);
            assert!(predicted < 0.25 && followed > 3.0 * predicted, "{period_s} s: {predicted} {followed}");
        }
    }

    /// Two rises through the middle take more than one breath and less than two and a half.
    #[test]
    fn nothing_is_foretold_before_a_breath_has_been_seen() {
        let breath = |time_s: f64| lujan(3.0, 4.0, time_s);
        for (seconds, foretells) in [(4.0, false), (10.0, true)] {
            let observer = having_seen(&belief(0.4), seconds, breath, 3);
            assert_eq!(observer.predicts_breaths(), foretells, "{seconds} s");
        }
        let observer = having_seen(&belief(0.4), 40.0, breath, 3);
        let period_s = TAU / observer.breathing.waves.unwrap().rate;
        assert!((period_s - 4.0).abs() < 0.2, "{period_s}");
    }

    #[test]
    fn what_is_no_breath_is_not_foretold() {
        for seed in 0..40 {
            let seen = |target: &dyn Fn(f64) -> f64| having_seen(&belief(0.4), 60.0, target, seed).predicts_breaths();
            assert!(!seen(&|_| 0.0), "noise, {seed}");
            assert!(
                !having_seen(&belief(0.4), 1800.0, |_| 0.0, seed).predicts_breaths(),
                "half an hour of noise, {seed}"
            );
            assert!(!seen(&|time_s| 0.1 * time_s), "a needle that goes in, {seed}");
            assert!(!seen(&|time_s| if time_s < 20.0 { 0.0 } else { 3.0 }), "a jerk, {seed}");
            assert!(!seen(&|time_s| 5.0 * (-(time_s - 20.0).powi(2)).exp()), "a cough, {seed}");
            assert!(!seen(&|time_s| 3.0 * f64::sin(TAU * time_s)), "a tremor, {seed}");
        }
    }

    /// A signal that stands exactly in the middle on its way up has risen once, and one that has moved by a step exactly has
    /// not turned.
    #[test]
    fn a_rise_through_the_middle_is_one() {
        let belief = BreathBelief { share: 1.0, step: 0.25 };
        let mut swing = Swing::default();
        let breath = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0];
        let rises = breath.map(|measured| swing.watch(&belief, measured, 0.5));
        let periods: std::vec::Vec<Option<f64>> = rises.into_iter().flatten().map(|rise| rise.period).collect();
        assert_eq!(periods, [None, Some(2.0)]);
        let mut still = Swing::default();
        still.watch(&belief, 0.0, 0.5);
        still.watch(&belief, 0.25, 0.5);
        assert_eq!(still.rises, None);
        still.watch(&belief, 0.25 + 1e-9, 0.5);
        assert_eq!(still.rises, Some(true));
    }

    /// A breath that is held ends the prediction; what is left is followed.
    #[test]
    fn a_held_breath_ends_it() {
        let held = |time_s: f64| lujan(3.0, 4.0, f64::min(time_s, 22.0));
        let observer = having_seen(&belief(0.1), 22.0, held, 5);
        assert!(observer.predicts_breaths());
        let observer = having_seen(&belief(0.1), 40.0, held, 5);
        assert!(!observer.predicts_breaths());
        assert!((observer.at(0.0) - 3.0).abs() < 0.1, "{}", observer.at(0.0));
    }

    /// What is foretold goes into the level as it ends, with the doubt that this brings: the estimate goes on from where it was.
    #[test]
    fn the_end_of_a_breath_is_no_jump() {
        for (held_at_s, unit) in [(21.0, 1.0), (22.0, 1.0), (23.0, 1.0), (22.0, 0.01)] {
            let held = |time_s: f64| lujan(3.0 * unit, 4.0, f64::min(time_s, held_at_s));
            let belief = Belief::new(0.1 * unit, 0.2 * unit, 12.0, 10.0 * unit, 0.1).with_breathing(ULTRASOUND_S);
            let mut observer = having_seen(&belief, held_at_s, held, 5);
            let mut noise = Noise(11);
            let (mut before, mut was_uncertain) = (0.0, 0.0);
            while observer.predicts_breaths() {
                before = observer.at(0.0) + observer.ahead(ULTRASOUND_S);
                was_uncertain = observer.level_variance;
                observer.update(&belief, held(held_at_s) + 0.1 * unit * noise.next(), 0.0, ULTRASOUND_S);
            }
            let jump = (observer.at(0.0) - before).abs();
            assert!(jump < 0.1 * unit, "{held_at_s} s: {before} {}", observer.at(0.0));
            // By no more than what the whole breath was.
            let more = observer.level_variance - was_uncertain;
            assert!(more > 0.0 && more < (3.0 * unit).powi(2), "{held_at_s} s: {more}");
        }
    }

    /// Deeper and quicker breaths are taken up.
    #[test]
    fn a_breath_that_changes_is_followed() {
        for (before_s, after_s) in [(5.0, 4.0), (6.0, 3.5), (3.0, 6.0), (2.0, 4.0)] {
            let changes =
                |time_s: f64| if time_s < 20.0 { lujan(2.0, before_s, time_s) } else { lujan(4.0, after_s, time_s) };
            let left = foretold(&belief(0.1), 80.0, 0.1, &changes);
            assert!(left < 0.25, "{before_s} s and then {after_s} s: {left}");
        }
    }

    /// A camera that loses the target for a while: the breath goes on meanwhile, and nothing is learnt from the time between
    /// the two rises that were seen.
    #[test]
    fn a_breath_goes_on_while_the_sensor_is_away() {
        let scenes = [2.0, 4.0, 5.5].map(|period_s| [40.0, 41.1, 42.2, 43.3].map(|from_s| (period_s, from_s)));
        for (period_s, from_s) in scenes.into_iter().flatten() {
            for away_s in [0.5, 1.0, 2.0, 3.1, 6.0, 9.0] {
                let scene = || std::format!("{period_s} s, away for {away_s} s at {from_s} s");
                let breath = |time_s: f64| lujan(3.0, period_s, time_s);
                let belief = belief(0.1);
                let mut observer = having_seen(&belief, from_s, breath, 3);
                let from_s = (from_s / ULTRASOUND_S).floor() * ULTRASOUND_S - ULTRASOUND_S;
                let exact = breath(from_s + away_s);
                let foretold = observer.at(0.0) + observer.ahead(away_s);
                // The period is known to some hundredths, and the whole breath is 3.
                let bound = 0.25 + 0.04 * 3.0 * TAU * away_s / period_s;
                assert!((foretold - exact).abs() < bound, "{}: {foretold} {exact}", scene());
                let mut noise = Noise(9);
                let mut worst = 0.0f64;
                for k in 0..450u32 {
                    let time_s = from_s + away_s + f64::from(k) * ULTRASOUND_S;
                    let elapsed = if k == 0 { away_s } else { ULTRASOUND_S };
                    observer.update(&belief, breath(time_s) + 0.1 * noise.next(), 0.0, elapsed);
                    let rate = observer.breathing.waves.expect("it is still foretold").rate;
                    assert!((rate * period_s / TAU - 1.0).abs() < 0.06, "{}: {rate}", scene());
                    let off = observer.at(0.0) + observer.ahead(0.1) - breath(time_s + 0.1);
                    worst = if k < 15 { worst } else { worst.max(off.abs()) };
                }
                assert!(worst < 0.6, "{}: {worst}", scene());
            }
        }
    }

    /// A patient who holds the breath: what is predicted before and after has the patient's period, and the pause is none.
    #[test]
    fn a_pause_is_no_period() {
        let period_s = 4.0;
        for (held_s, ends) in [(1.4, false), (1.8, false), (4.0, true), (7.0, true), (15.0, true)] {
            for at_s in [40.0, 41.0, 42.0] {
                // Time within the breath, which stands still for a while.
                let target = |time_s: f64| lujan(3.0, period_s, (time_s - held_s).max(time_s.min(at_s)));
                let belief = belief(0.1);
                let mut noise = Noise(3);
                let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
                let (mut ended, mut worst) = (false, 0.0f64);
                for k in 0..(80.0 / ULTRASOUND_S) as u32 {
                    let time_s = f64::from(k) * ULTRASOUND_S;
                    observer.update(&belief, target(time_s) + 0.1 * noise.next(), 0.0, ULTRASOUND_S);
                    ended |= time_s > 20.0 && !observer.predicts_breaths();
                    if let Some(waves) = observer.breathing.waves {
                        let wrong = (waves.rate * period_s / TAU - 1.0).abs();
                        assert!(wrong < 0.1, "held for {held_s} s at {at_s} s: {wrong} at {time_s} s");
                    }
                    let off = observer.at(0.0) + observer.ahead(0.1) - target(time_s + 0.1);
                    worst = if time_s < at_s + held_s + 3.0 * period_s { worst } else { worst.max(off.abs()) };
                }
                assert!(observer.predicts_breaths() && worst < 0.5, "held for {held_s} s at {at_s} s: {worst}");
                assert_eq!(ended, ends, "held for {held_s} s at {at_s} s");
            }
        }
    }

    /// The loop of estimate and paddle whose true effect is λ times the assumed one, with a breath that the observer
    /// expects, of this period, and a needle that goes on in time. Root mean square of the last breaths.
    fn held<T: Scalar>(lambda: f64, delay: usize, period_s: f64, speed: f64) -> f64 {
        let gain = crate::loop_stability::default_gain(delay as u32, 1.3);
        let belief = Belief::<T>::new(0.1, 0.2, 12.0, 10.0, gain).with_breathing(ULTRASOUND_S);
        let mut random = Noise(11);
        let mut observer = Observer::starting(&belief, T::ZERO, T::ZERO, T::ZERO);
        let mut shown = std::collections::VecDeque::from(std::vec![0.0; delay + 1]);
        let (mut squares, mut counted) = (0.0, 0.0);
        for k in 0..6000 {
            let time_s = f64::from(k) * ULTRASOUND_S;
            // In, and out again: a table is not without an end.
            let at = |time_s: f64| speed * (25.0 - ((time_s + 25.0) % 50.0 - 25.0).abs());
            let applied = shown.pop_front().unwrap();
            let error = lujan(3.0, period_s, time_s) + 0.1 * at(time_s) - lambda * applied;
            let measured = T::of(error + applied + 0.1 * random.next());
            observer.update(&belief, measured, T::of(at(time_s)), T::of(ULTRASOUND_S));
            let ahead_s = (delay + 1) as f64 * ULTRASOUND_S;
            shown.push_back((observer.at(T::of(at(time_s + ahead_s))) + observer.ahead(T::of(ahead_s))).to_f64());
            if k > 3000 {
                (squares, counted) = (squares + error * error, counted + 1.0);
            }
        }
        f64::sqrt(squares / counted)
    }

    /// Tissue that the table is wrong about does not make the prediction swing.
    #[test]
    fn the_loop_stays_stable_with_other_tissue() {
        for period_s in [4.0, 2.0, 1.7] {
            for delay in [1, 3, 5] {
                for lambda in [0.5, 0.8, 1.0, 1.3, 1.6] {
                    for speed in [0.0, 0.3] {
                        let double = held::<f64>(lambda, delay, period_s, speed);
                        let single = held::<f32>(lambda, delay, period_s, speed);
                        let scene = || std::format!("{period_s} s, delay {delay}, λ {lambda}, speed {speed}");
                        assert!(double < 0.25 && single < 0.25, "{}: {double} {single}", scene());
                    }
                }
            }
        }
    }

    proptest! {
        /// Whatever is measured, whenever: finite numbers, and variances of something.
        #[test]
        fn variances_stay_some(
            noise in 0.0..1.0f64,
            samples in proptest::collection::vec((-20.0..20.0f64, 0.0..3.0f64), 1..400),
            period_s in 1.5..12.0f64,
        ) {
            let belief = belief(noise);
            let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
            for k in 0..600 {
                observer.update(&belief, lujan(5.0, period_s, f64::from(k) * ULTRASOUND_S), 0.0, ULTRASOUND_S);
            }
            for (measured, elapsed) in samples {
                observer.update(&belief, measured, 0.0, elapsed);
                let variances = observer.breathing.waves.map(|waves| [waves.of_first, waves.of_second]);
                prop_assert!(variances.iter().flatten().all(|[a, both, b]| *a >= 0.0 && *b >= 0.0 && both * both <= 1.0001 * a * b), "{observer:?}");
                prop_assert!(observer.ahead(0.1).is_finite() && observer.at(0.0).is_finite());
            }
        }

        /// The same in single precision, of an exact sensor whose samples count whole.
        #[test]
        fn single_precision_leaves_no_variance_below_none(
            samples in proptest::collection::vec((-20.0..20.0f32, 0.0..12.0f32, 0.0..3.0f32), 1..400),
        ) {
            let belief = Belief::<f32>::new(0.0, 0.2, 12.0, 10.0, 1.0).with_breathing(ULTRASOUND_S);
            let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
            for k in 0..600 {
                let breath = lujan(5.0, 4.0, f64::from(k) * ULTRASOUND_S) as f32;
                observer.update(&belief, breath, 0.0, ULTRASOUND_S as f32);
            }
            for (measured, depth, elapsed) in samples {
                observer.update(&belief, measured, depth, elapsed);
                prop_assert!(observer.level_variance >= 0.0 && observer.slope_variance >= 0.0, "{observer:?}");
                prop_assert!(observer.at(6.0).is_finite() && observer.ahead(0.1).is_finite(), "{observer:?}");
                prop_assert!(observer.surprise.is_finite() && observer.surprise_variance.is_finite(), "{observer:?}");
                let waves = observer.breathing.waves.map(|waves| [waves.of_first, waves.of_second]);
                // Within rounding of the larger one.
                let some = |[a, both, b]: Variance<f32>| a >= 0.0 && b >= 0.0 && both * both <= a * b + 1e-5 * a.max(b).powi(2);
                prop_assert!(waves.iter().flatten().all(|block| some(*block)), "{observer:?}");
            }
        }

        /// Lengths in any unit.
        #[test]
        fn units_do_not_matter(exponent in -6..6i32) {
            let unit = 10f64.powi(exponent);
            let seen = |unit: f64| {
                let belief = Belief::<f64>::new(0.1 * unit, 0.2, 12.0 * unit, 10.0 * unit, 0.1).with_breathing(ULTRASOUND_S);
                let mut observer = Observer::starting(&belief, 0.0, 0.0, 0.0);
                for k in 0..600 {
                    observer.update(&belief, unit * lujan(3.0, 4.0, f64::from(k) * ULTRASOUND_S), 0.0, ULTRASOUND_S);
                }
                observer.ahead(0.1) / unit
            };
            prop_assert!((seen(unit) - seen(1.0)).abs() < 1e-9);
        }
    }
}
