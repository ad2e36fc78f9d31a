//! Limit cycles from a rate-limited actuator with delay: linear theory knows the gain and the delay, not the size of the
//! error. Simulated with the controller's own limits, with and without its anti-windup.

use std::collections::VecDeque;

use firmware::limits::{Limits, PositionLimit};
use model_offline::study::Extent;
use nalgebra::Vector1;

use super::behaviour::Behaviour;

/// Loop ticks per target sample.
const TICKS_PER_SAMPLE: usize = 20;
/// Target samples simulated.
const SAMPLES: usize = 3_000;
/// Last samples, over which the error is judged.
const JUDGED: usize = 300;
/// Position limit over the error at the start: an actuator that could undo the error many times.
const REACH: f64 = 20.0;

/// Delay of the loops, target samples.
pub const DELAYS: [u32; 2] = [1, 2];

/// How the integral is kept while the actuator is at its rate limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// It takes every correction: what a textbook integrator does.
    Plain,
    /// As the controller does it: a correction that asks for more of what is still pending is not taken.
    AntiWindup,
}

impl Integrator {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain-integral",
            Self::AntiWindup => "anti-windup",
        }
    }
}

/// One cell of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// How the integral is kept.
    pub integrator: Integrator,
    /// Delay d, target samples.
    pub delay: u32,
    /// Gain over its limit by linear theory.
    pub gain_share: f64,
    /// Error at the start over what the actuator moves in one target sample.
    pub amplitude: f64,
    /// What the error does.
    pub behaviour: Behaviour,
    /// Largest error of the last samples over that at the start.
    pub remaining: f64,
}

/// Simulates one loop: scalar plant e = 1 + u, measured every 20 ticks, `delay` samples late.
pub fn simulate(integrator: Integrator, delay: u32, gain: f64, amplitude: f64) -> (Behaviour, f64) {
    let max_step = 1.0 / (amplitude * TICKS_PER_SAMPLE as f64);
    let limits = Limits { shape: PositionLimit::Norm, max_displacement: REACH, max_step };
    let zero = Vector1::zeros();
    let (mut integral, mut paddle) = (zero, zero);
    let mut pending: VecDeque<f64> = std::iter::repeat_n(1.0, delay as usize).collect();
    let mut late = 0.0_f64;
    for sample in 0..SAMPLES {
        let error = 1.0 + paddle.x;
        pending.push_back(error);
        let measured = pending.pop_front().unwrap_or(error);
        let correction = Vector1::new(-gain * measured);
        integral = match integrator {
            Integrator::Plain => limits.clamp_position(&(integral + correction)),
            Integrator::AntiWindup => limits.integrate(&integral, &correction, &zero, &paddle),
        };
        for _ in 0..TICKS_PER_SAMPLE {
            paddle = limits.command(&paddle, &integral).displacement;
        }
        if sample + JUDGED >= SAMPLES {
            late = late.max(error.abs());
        }
    }
    let behaviour = if late < 1e-3 {
        Behaviour::Settles
    } else if late < 0.5 * REACH {
        Behaviour::Cycles
    } else {
        // From end to end of what the actuator can reach: only the limits bound it.
        Behaviour::Diverges
    };
    (behaviour, late)
}

/// The whole map.
pub fn map(extent: Extent) -> Vec<Cell> {
    let (gains, amplitudes) = match extent {
        Extent::Quick => (9, 9),
        Extent::Full => (17, 17),
    };
    let log = |from: f64, to: f64, count: u32, i: u32| from * (to / from).powf(f64::from(i) / f64::from(count - 1));
    let mut cells = Vec::new();
    for integrator in [Integrator::Plain, Integrator::AntiWindup] {
        for delay in DELAYS {
            let limit = firmware::loop_stability::gain_limit(0.0, delay);
            for g in 0..gains {
                for a in 0..amplitudes {
                    let (gain_share, amplitude) = (log(0.08, 1.6, gains, g), log(0.1, 100.0, amplitudes, a));
                    let (behaviour, remaining) = simulate(integrator, delay, gain_share * limit, amplitude);
                    cells.push(Cell { integrator, delay, gain_share, amplitude, behaviour, remaining });
                }
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_errors_follow_linear_theory() {
        for integrator in [Integrator::Plain, Integrator::AntiWindup] {
            for delay in DELAYS {
                let limit = firmware::loop_stability::gain_limit(0.0, delay);
                assert_eq!(
                    simulate(integrator, delay, 0.95 * limit, 0.1).0,
                    Behaviour::Settles,
                    "{integrator:?} {delay}"
                );
                assert_ne!(
                    simulate(integrator, delay, 1.05 * limit, 0.1).0,
                    Behaviour::Settles,
                    "{integrator:?} {delay}"
                );
            }
        }
    }
}
