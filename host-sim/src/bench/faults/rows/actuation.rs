//! Rows 19 to 25: saturation, the actuator, the sign and the identity of the plant, Jacobians near singularity.

use firmware::contract::{MAX_TABLE_BYTES, Table, encode};
use firmware::detection::{FOLLOWING_FRACTION, FOLLOWING_SAMPLES, FROZEN_TRAVEL};
use firmware::{Faults, Feedback, Mode, Settings, loop_stability};
use nalgebra::{Rotation2, Rotation3, SMatrix, Unit, Vector3};

use super::{FOR_EVER, Trial, comes_back, excursions, largest, stays_safe_until_rearmed, steepest};
use crate::bench::error::SimError;
use crate::bench::faults::closed_loop::{ClosedLoop, Setup};
use crate::bench::faults::evidence::{Evidence, carries};
use crate::bench::faults::fault::Fault;
use crate::bench::faults::tissue::sideways;
use crate::world::actuator::ActuatorModel;
use crate::world::truth::from_frame;

const MS: u64 = 1_000_000;

/// Push of the target up to which no paddle is at its limit, length.
fn reach<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) -> f64 {
    let ranges =
        table.paddles.iter().zip(excursions(table, &sideways())).map(|(paddle, worst)| paddle.max_displacement / worst);
    ranges.fold(f64::INFINITY, f64::min)
}

/// Push that no motion of the paddles can take away, length. In the plane the law leaves the axis alone, and there is one way only;
/// in space each paddle can move the target along the push by its range times the norm of that row of its Jacobian, at most.
fn beyond_reach<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) -> f64 {
    if D == 2 {
        return reach(table);
    }
    let direction = table.orthogonal * sideways::<N>();
    let rows = largest(table, |knot| knot.jacobian.map(|jacobian| jacobian.tr_mul(&direction).norm()));
    table.paddles.iter().zip(rows).map(|(paddle, row)| paddle.max_displacement * row).sum()
}

/// Row 19: the paddle at the end of its range: clamped, no windup, back without overshoot.
pub(crate) fn position_saturation<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let reach = beyond_reach(trial.table);
    for sign in [1.0, -1.0] {
        let what = || format!("push of {sign} × 1.5 reach");
        let mut bench = ClosedLoop::new(trial.table, Setup { noise: 0.0, speed: 0.0, ..trial.setup() })?;
        bench.run(200);
        // Out in 15 s, 5 s there, and back.
        let rate = 0.1 * reach;
        bench.inject(Fault::Push(sign * rate), 15_000);
        evidence.detect(bench.until(15_000, carries(Faults::POSITION_LIMITED)), 12_000, what);
        bench.run(20_000 - (bench.now() - 200));
        evidence.expect_mode(&bench, Mode::Run, what);
        let left = sign * bench.error_sideways();
        evidence.require(left > 0.3 * reach, || format!("{}: only {left} is left over", what()));
        bench.max_error = 0.0;
        bench.inject(Fault::Push(-sign * rate), 15_000);
        let lag = rate * 0.02 * (2.0 + 1.0 / bench.loop_gain());
        let mut worst: f64 = 0.0;
        for _ in 0..15_000 {
            bench.step();
            worst = worst.max(-sign * bench.error_sideways());
        }
        // Behind a ramp the error is the ramp's lag; anything beyond would be windup.
        evidence.require(worst < lag, || format!("{}: overshoot of {worst} past the lag {lag}", what()));
        bench.run(1000);
        let error = bench.error.norm();
        evidence.require(error < 0.01 * lag + 1e-9, || format!("{}: {error} is left at the end", what()));
        evidence.expect_mode(&bench, Mode::Run, what);
        evidence.close(&bench, what);
    }
    Ok(())
}

/// Row 20: a paddle that is too slow for its feed-forward: limited, no windup, there without overshoot.
pub(crate) fn rate_saturation<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut table = trial.table.clone();
    let setup = Setup { noise: 0.0, ..trial.setup() };
    let mut setup = setup;
    for (place, steepest) in steepest(trial.table).into_iter().enumerate() {
        let max_rate = 0.5 * steepest * setup.speed;
        (table.paddles[place].max_rate, setup.actuators[place].max_rate) = (max_rate, max_rate);
    }
    let mut bench = ClosedLoop::new(&table, setup)?;
    evidence.detect(bench.until(3000, carries(Faults::RATE_LIMITED)), 3000, || "slow paddle".to_owned());
    bench.run(6000 - bench.now());
    let late = bench.error.normalize();
    let mut overshoot: f64 = 0.0;
    for _ in 0..10_000 {
        bench.step();
        overshoot = overshoot.max(-late.dot(&bench.error));
    }
    evidence.require(overshoot <= 0.02 * bench.max_error, || {
        format!("overshoot of {overshoot}, the largest error was {}", bench.max_error)
    });
    let error = bench.error.norm();
    evidence.require(error < 1e-3 * bench.max_error + 1e-9, || format!("{error} is left at the end"));
    evidence.expect_mode(&bench, Mode::Run, || "slow paddle".to_owned());
    evidence.close(&bench, || "slow paddle".to_owned());
    Ok(())
}

/// Row 21: an actuator that is stuck or reaches half of its commands trips the following error.
pub(crate) fn actuator_broken<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(21);
    let broken =
        trial.paddles().flat_map(|(place, _)| [(place, Fault::Stuck(place)), (place, Fault::ActuatorGain(place, 0.5))]);
    for (place, fault) in broken {
        let what = || format!("{fault:?}");
        let mut bench = trial.running(&mut random)?;
        bench.inject(fault, FOR_EVER);
        // When the distance is first past what is admitted: arithmetic of its own. A paddle that does not move at all
        // is known sooner than one that moves too little.
        let settings = bench.setup().settings;
        let table = trial.table;
        let delay_s = (settings.actuator_delay_ns + settings.loop_period_ns) as f64 * 1e-9;
        let part = if fault == Fault::Stuck(place) { FROZEN_TRAVEL } else { FOLLOWING_FRACTION };
        let limits = &table.paddles[place];
        let admitted = part * limits.max_displacement + limits.max_rate * delay_s;
        let mut off_since = None;
        let mut tripped = None;
        for tick in 1..=6000u64 {
            let commanded = bench.last.map(|last| from_frame::<D>(last.command.displacement[place]));
            if let Some(exchange) = bench.step()
                && let (Some(sample), Some(commanded)) = (exchange.inputs.paddles[place], commanded)
            {
                // What is past it for a moment only is jitter of the command.
                let off = (from_frame::<D>(sample.displacement) - commanded).norm() > admitted;
                off_since = if off { off_since.or(Some(tick)) } else { None };
                let faults = Faults::from_bits(exchange.command.faults);
                if !faults.intersection(Faults::FOLLOWING_ERROR | Faults::FROZEN).is_empty() {
                    tripped = Some(tick);
                    break;
                }
            }
        }
        let ticks = tripped.zip(off_since).map(|(tripped, off)| tripped.saturating_sub(off) + 1);
        evidence.detect(ticks, u64::from(FOLLOWING_SAMPLES), what);
        bench.run(300);
        evidence.expect_mode(&bench, Mode::Safe, what);
        evidence.close(&bench, what);
    }
    evidence.notes.push("ticks from the moment when the distance is past what is admitted".to_owned());
    Ok(())
}

/// Row 22: lag and delay of the actuator, 0 to 10 ticks: the integral, whose limit is known, is stable right up to it; at
/// the default gain always.
pub(crate) fn actuator_late<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut table = trial.table.clone();
    table.paddles.iter_mut().for_each(|paddle| paddle.max_rate = 1e3);
    let start = 1e-5 * table.validity.depth_end;
    let mut growth = |delay: u32, lag_s: f64, gain: Option<f64>| -> Result<f64, crate::bench::error::SimError> {
        let mut setup = Setup { noise: 0.0, speed: 0.0, ..trial.setup() };
        // A target sample on every tick, at once: a delay of k ticks is a delay of k samples.
        setup.settings = Settings {
            feedback: if gain.is_some() { Feedback::Integral } else { Feedback::default() },
            loop_gain: gain,
            actuator_delay_ns: u64::from(delay) * MS + (2.0 * lag_s * 1e9) as u64,
            ..Settings::new(MS, MS, 0)
        };
        for actuator in &mut setup.actuators {
            *actuator = ActuatorModel { delay_ticks: delay, lag_s, max_rate: 1e3, ..*actuator };
        }
        let mut bench = ClosedLoop::new(&table, setup)?;
        bench.run(100);
        bench.tissue().push = start;
        bench.run(4000);
        bench.max_error = 0.0;
        bench.run(200);
        let end = bench.max_error;
        evidence.injected += 1;
        evidence.close(&bench, || format!("delay {delay}, gain {gain:?}"));
        Ok(end / start)
    };
    let mut seen = Vec::new();
    for delay in 0..=10 {
        let limit = loop_stability::gain_limit(0.0, delay);
        let below = growth(delay, 0.0, Some(0.9 * limit))?;
        // A gain of 2 is the largest that the settings admit, and the limit without delay.
        let above = (delay > 0).then(|| growth(delay, 0.0, Some((1.1 * limit).min(2.0)))).transpose()?;
        let default = growth(delay, 0.0, None)?;
        let lagging = growth(0, f64::from(delay) * 1e-3, None)?;
        seen.push((delay, below, above, default, lagging));
    }
    for (delay, below, above, default, lagging) in seen {
        evidence.require(below < 1.0, || format!("delay {delay}: grows {below}-fold at 0.9 of the limit"));
        evidence.require(default < 1e-2, || format!("delay {delay}: {default} is left at the default gain"));
        evidence.require(lagging < 1e-2, || format!("lag {delay} ms: {lagging} is left at the default gain"));
        evidence.detected += u64::from(below < 1.0) + u64::from(default < 1e-2) + u64::from(lagging < 1e-2);
        // The control: past the limit the same loop does grow.
        if let Some(above) = above {
            evidence.require(above > 1.0, || format!("delay {delay}: shrinks to {above} at 1.1 of the limit"));
            evidence.detected += u64::from(above > 1.0);
        }
    }
    let arrivals = [0, 10].map(|delay| arrival(&table, trial, delay));
    let [at_once, late] = arrivals;
    evidence.require(late? == at_once? + 10, || "the actuator is not as late as it was told to be".to_owned());
    Ok(())
}

/// The witness: ticks until a paddle whose actuator is this many ticks late has moved at all.
fn arrival<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    trial: &Trial<'_, D, N, P>,
    delay: u32,
) -> Result<u64, SimError> {
    let mut setup = Setup { noise: 0.0, ..trial.setup() };
    setup.actuators.iter_mut().for_each(|actuator| actuator.delay_ticks = delay);
    setup.settings.actuator_delay_ns = 10 * MS;
    let mut bench = ClosedLoop::new(table, setup)?;
    let start = bench.paddles();
    Ok((0..1000)
        .find(|_| {
            bench.step();
            bench.paddles() != start
        })
        .unwrap_or(u64::MAX / 2))
}

/// Row 23: tissue that answers with the wrong sign leads to SAFE; with the right sign and up to half again as strong,
/// or pushed with up to a third of what the paddle can follow, it never does.
pub(crate) fn sign_error<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    for (gain, seed) in [(-1.0, 1), (-0.5, 2), (-1.5, 3), (-1.0, 4)] {
        let what = || format!("response × {gain}");
        let mut bench = ClosedLoop::new(trial.table, Setup { seed: trial.seed + seed, ..trial.setup() })?;
        bench.inject(Fault::TissueGain(gain), FOR_EVER);
        bench.run(500);
        evidence.detect(bench.until(6000, carries(Faults::DIVERGENCE)), 4000, what);
        bench.run(50);
        evidence.expect_mode(&bench, Mode::Safe, what);
        evidence.close(&bench, what);
    }
    let crossings = trial.table.paddles.iter().map(|paddle| paddle.max_rate / paddle.max_displacement);
    let follow = reach(trial.table) * crossings.fold(f64::INFINITY, f64::min);
    for gain in [0.3, 0.7, 1.0, 1.5] {
        for push in [0.0, 0.1, -0.1, 0.33, -0.33] {
            let what = || format!("response × {gain}, push {push}");
            for speed in [0.0, trial.setup().speed] {
                let mut bench = ClosedLoop::new(trial.table, Setup { speed, ..trial.setup() })?;
                bench.inject(Fault::TissueGain(gain), FOR_EVER).run(500);
                // To a tenth of the reach, at that rate.
                let ticks =
                    if push == 0.0 { 0 } else { (0.1 * reach(trial.table) / (push * follow).abs() * 1e3) as u64 };
                bench.inject(Fault::Push(push * follow * gain), ticks).run(5000);
                let faults = bench.state.faults();
                evidence.require(!faults.contains(Faults::DIVERGENCE), || format!("{}: false alarm", what()));
                evidence.close(&bench, what);
            }
        }
    }
    evidence.final_state = Some(Mode::Safe);
    Ok(())
}

/// Row 24: another paddle than the table's is known by its identity; one that lies about it, by the loop that it makes
/// unstable. A wrong one with which the loop is stable is no danger.
pub(crate) fn wrong_paddle<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(24);
    let wrong = trial.table.paddles.iter().enumerate().flat_map(|(place, paddle)| {
        // In space the other paddle, too.
        let other = trial.table.paddles.iter().map(|paddle| paddle.index).find(|index| *index != paddle.index);
        [0, paddle.index + 1, u32::MAX].into_iter().chain(other).map(move |index| (place, index))
    });
    for (place, index) in wrong {
        let what = || format!("paddle {index} in place {place}");
        let mut bench = trial.running(&mut random)?;
        let found = bench.inject(Fault::PaddleIdentity(place, index), 10).until(1, carries(Faults::PADDLE_IDENTITY));
        evidence.detect(found, 1, what);
        bench.run(20);
        stays_safe_until_rearmed(&mut bench, evidence, what);
        evidence.close(&bench, what);
    }
    for degrees in [0.0, 30.0, -45.0, 150.0, 180.0, -160.0f64] {
        let what = || format!("response turned by {degrees}°");
        let mut bench = ClosedLoop::new(trial.table, trial.setup())?;
        bench.tissue().turn = about_the_needle(trial.table, degrees.to_radians());
        if degrees.abs() > 90.0 {
            evidence.detect(bench.until(6000, carries(Faults::DIVERGENCE)), 4500, what);
            bench.run(50);
            evidence.expect_mode(&bench, Mode::Safe, what);
        } else {
            bench.run(6500);
            evidence.expect_mode(&bench, Mode::Run, what);
            let settled = bench.error.norm();
            let bound = 4.0 * (N as f64).sqrt() * bench.setup().noise;
            evidence.require(settled < bound, || format!("{}: {settled} is left", what()));
        }
        evidence.close(&bench, what);
    }
    evidence.final_state = Some(Mode::Safe);
    Ok(())
}

/// A turn by an angle, rad: in space about an axis that is none of the scene's.
fn turned<const D: usize>(angle: f64) -> SMatrix<f64, D, D> {
    let solid = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(0.3, -0.5, 0.8)), angle).into_inner();
    let flat = Rotation2::new(angle).into_inner();
    SMatrix::from_fn(|i, j| if D == 2 { flat[(i, j)] } else { solid[(i, j)] })
}

/// A turn about the needle by an angle, rad; in the plane, which has no such axis, about the target.
fn about_the_needle<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    angle: f64,
) -> SMatrix<f64, D, D> {
    if D == 2 {
        return turned(angle);
    }
    let axis = Vector3::from_fn(|i, _| table.needle_axis[i]);
    let solid = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle).into_inner();
    SMatrix::from_fn(|i, j| solid[(i, j)])
}

/// Row 25: Jacobians with σmin from 1e-1 to 1e-12: refused past the condition limit, harmless up to it.
pub(crate) fn near_singular<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    for exponent in 1..=12 {
        for angle in [0.3, 1.2, 2.5f64] {
            let what = || format!("σmin = 1e-{exponent}");
            let mut table = trial.table.clone();
            let [left, right] = [angle, 2.0 * angle + 0.1].map(turned::<D>);
            for knot in &mut table.knots {
                // The same of all paddles in the target's weak direction, or they would help each other.
                let singular_values = SMatrix::from_fn(|i, j| match (i == j, i + 1 == D) {
                    (false, _) => 0.0,
                    (true, false) => 0.3,
                    (true, true) => 0.3 * 10f64.powi(-exponent),
                });
                knot.jacobian = [left * singular_values * right; P];
                (knot.paddle_path, knot.paddle_path_slope) = (SMatrix::zeros(), SMatrix::zeros());
            }
            evidence.injected += 1;
            let mut buffer = vec![0; MAX_TABLE_BYTES];
            if encode(&table, &mut buffer).is_err() {
                evidence.require(exponent >= 3, || format!("{}: refused although controllable", what()));
                evidence.detected += 1;
                continue;
            }
            evidence.require(exponent <= 3, || format!("{}: accepted past the condition limit", what()));
            let setup = Setup { speed: 0.0, ..trial.setup() };
            let mut bench = ClosedLoop::new(&table, setup)?;
            bench.inject(Fault::Push(1e-3 * table.validity.depth_end), 3000).run(6000);
            evidence.detected += u64::from(bench.invariants.count() == 0);
            comes_back(&mut bench, 1, evidence, what);
            evidence.close(&bench, what);
        }
    }
    Ok(())
}
