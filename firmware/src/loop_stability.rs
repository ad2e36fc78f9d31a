//! How much gain a delayed loop bears.
//!
//! With true Jacobian J, table Jacobian Ĵ, gain g and a delay of d target samples, the error obeys
//! e(k+1) = e(k) − g·J·Ĵ⁻¹·e(k−d). It is stable iff every eigenvalue λ of J·Ĵ⁻¹ has |arg λ| < 90° and
//! g·|λ| < 2 sin((π/2 − |arg λ|)/(2d + 1)).

use core::f64::consts::FRAC_PI_2;

/// Limit of g·|λ| for an eigenvalue with angle `argument` (rad) and a delay of `delay_samples`; 0 at and past 90°.
pub fn gain_limit(argument: f64, delay_samples: u32) -> f64 {
    let margin = FRAC_PI_2 - argument.abs();
    if margin > 0.0 { 2.0 * libm::sin(margin / f64::from(2 * delay_samples.min(MAX_DELAY_SAMPLES) + 1)) } else { 0.0 }
}

/// Longest delay that the analysis is asked for, target samples. A loop older than this is not worth closing:
/// its gain would be below 0.6 %.
pub const MAX_DELAY_SAMPLES: u32 = 64;

/// g·λ of the critically damped loop, dᵈ/(d+1)ᵈ⁺¹: the dominant pole is double and real, so that the error dies
/// fastest without overshoot. The characteristic equation zᵈ⁺¹ − zᵈ + gλ = 0 has its double root at z = d/(d+1).
pub fn critically_damped_gain(delay_samples: u32) -> f64 {
    let d = f64::from(delay_samples.min(MAX_DELAY_SAMPLES));
    // A power by multiplication: `pow` alone would take 3 KB of a microcontroller's flash.
    (0..delay_samples.min(MAX_DELAY_SAMPLES)).fold(1.0 / (d + 1.0), |gain, _| gain * (d / (d + 1.0)))
}

/// Default gain: the smaller of critical damping and half the stability limit, over the largest |λ| that model
/// errors are expected to reach. Critical damping is the smaller one for every delay (there is a test), so that the
/// limit and its sine need not be computed.
pub fn default_gain(delay_samples: u32, lambda_max: f64) -> f64 {
    critically_damped_gain(delay_samples) / lambda_max.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_those_of_the_published_table() {
        let delays = [0, 1, 2, 3, 5, 10];
        let rows: [(f64, [f64; 6]); 3] = [
            (0.0, [2.000, 1.000, 0.618, 0.445, 0.285, 0.149]),
            (30.0, [1.732, 0.684, 0.416, 0.298, 0.190, 0.100]),
            (60.0, [1.000, 0.347, 0.209, 0.149, 0.095, 0.050]),
        ];
        for (degrees, limits) in rows {
            for (delay, limit) in delays.into_iter().zip(limits) {
                let computed = gain_limit(degrees.to_radians(), delay);
                assert!((computed - limit).abs() < 5.1e-4, "{degrees}° d={delay}: {computed}");
            }
        }
        assert_eq!(gain_limit(FRAC_PI_2, 0), 0.0);
    }

    #[test]
    fn critical_damping_is_at_most_half_the_limit() {
        for delay in 0..=MAX_DELAY_SAMPLES {
            assert!(critically_damped_gain(delay) <= 0.5 * gain_limit(0.0, delay), "delay {delay}");
        }
    }

    #[test]
    fn critical_damping_and_default() {
        assert!((critically_damped_gain(1) - 0.25).abs() < 1e-12);
        assert!((critically_damped_gain(2) - 0.148).abs() < 2e-4);
        assert!((default_gain(1, 1.0) - 0.25).abs() < 1e-12);
        assert!((default_gain(1, 2.0) - 0.125).abs() < 1e-12);
        assert_eq!(default_gain(0, 0.5), 1.0);
    }

    /// |e(k)| after many samples of e(k+1) = e(k) − gλ·e(k−d), from e = 1.
    fn residual(gain: f64, delay: usize) -> f64 {
        let mut history = std::vec![1.0; delay + 1];
        for _ in 0..20_000 {
            let next = history[delay] - gain * history[0];
            history.remove(0);
            history.push(next);
            if next.abs() > 1e6 {
                return next.abs();
            }
        }
        history.into_iter().map(f64::abs).fold(0.0, f64::max)
    }

    #[test]
    fn simulation_agrees_on_both_sides_of_the_limit() {
        for delay in [0usize, 1, 2, 3, 5, 10] {
            let limit = gain_limit(0.0, delay as u32);
            assert!(residual(0.98 * limit, delay) < 1e-3, "delay {delay} should settle");
            assert!(residual(1.02 * limit, delay) > 1e3, "delay {delay} should diverge");
        }
    }
}
