//! Rows 46 to 51: what goes wrong with one paddle of two, or between them.

use firmware::contract::PaddleCommand;
use firmware::detection::{FOLLOWING_SAMPLES, TICKS_TO_HOLD};
use firmware::{Faults, Mode};
use nalgebra::SVector;

use super::{FOR_EVER, Trial, comes_back, excursions, motion_bits};
use crate::bench::error::SimError;
use crate::bench::faults::closed_loop::{ClosedLoop, Setup};
use crate::bench::faults::evidence::{Evidence, carries, is_in};
use crate::bench::faults::fault::{Fault, Stream};

/// The controller says of the paddle in this place and of no other that it is the one.
fn is_told_apart(faults: Faults, place: usize) -> bool {
    faults.contains(Faults::SECOND_PADDLE) == (place > 0)
}

/// Lets ticks pass; whether no paddle was told to move in any of them.
fn all_stay<const D: usize, const N: usize, const P: usize>(bench: &mut ClosedLoop<'_, D, N, P>, ticks: u64) -> bool {
    let before = bench.last.map(|last| motion_bits(&last.command));
    (0..ticks).all(|_| {
        let now = bench.step().map(|exchange| motion_bits(&exchange.command));
        now.is_none() || now == before
    })
}

/// Row 46: samples of one paddle stop: both are held where they are on the first tick past the limit, and told apart; RUN by
/// itself when the samples come back, SAFE when they do not.
pub(crate) fn lost<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(46);
    for (place, stream) in trial.paddles() {
        let what = || format!("{stream:?}");
        let [mut healthy, mut bench] = trial.twins(&mut random)?;
        let injected = bench.injected;
        bench.inject(Fault::Lost(stream), 100);
        let held = bench.until(100, is_in(Mode::Hold));
        evidence.detect(held, TICKS_TO_HOLD + 1, what);
        let faults = bench.state.faults();
        evidence.require(faults.contains(Faults::PADDLE_STALE) && is_told_apart(faults, place), || {
            format!("{}: HOLD for {faults}", what())
        });
        let left = 100 - held.unwrap_or_default();
        evidence.require(all_stay(&mut bench, left), || format!("{}: a paddle moved in HOLD", what()));
        // The witnesses: its samples were lost, and no other's.
        let others = trial.paddles().filter(|(other, _)| *other != place);
        let gone = bench.audit.tally(stream).lost;
        let untouched = others.map(|(_, other)| bench.audit.tally(other).lost).sum::<u64>() == 0;
        evidence.require(bench.injected == injected + 100 && gone == 100 && untouched, || {
            format!("{}: {gone} lost", what())
        });
        comes_back(&mut bench, 20, evidence, what);
        let alarm = healthy.until(120, |command| command.faults != 0);
        evidence.require(alarm.is_none(), || format!("{}: a code without the fault", what()));
        bench.run(100).inject(Fault::Lost(stream), FOR_EVER);
        evidence.require(bench.until(1000, is_in(Mode::Safe)).is_some(), || format!("{}: no SAFE", what()));
        let faults = bench.state.faults();
        evidence.require(faults.contains(Faults::PADDLE_DEAD) && is_told_apart(faults, place), || {
            format!("{}: SAFE for {faults}", what())
        });
        evidence.require(all_stay(&mut bench, 100), || format!("{}: a paddle moved in SAFE", what()));
        evidence.close(&bench, what);
    }
    Ok(())
}

/// Row 47: the samples of one paddle go on with the same position: known from that paddle alone, and SAFE for both.
pub(crate) fn frozen<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(47);
    for (place, stream) in trial.paddles() {
        let what = || format!("{stream:?}");
        let [mut healthy, mut bench] = trial.twins(&mut random)?;
        bench.inject(Fault::Frozen(stream), FOR_EVER);
        let found = bench.until(3000, carries(Faults::FROZEN));
        evidence.detect(found, 1500, what);
        let faults = bench.state.faults();
        evidence.require(is_told_apart(faults, place), || format!("{}: {faults}", what()));
        let refused = |stream: Stream| stream.account(bench.state.ledger()).discarded.iter().sum::<u64>();
        let others = trial.paddles().filter(|(other, _)| *other != place).map(|(_, other)| refused(other)).sum::<u64>();
        evidence.require(refused(stream) > 0 && others == 0, || format!("{}: {others} of another refused", what()));
        let alarm = healthy.until(found.unwrap_or(1500), carries(Faults::FROZEN));
        evidence.require(alarm.is_none(), || format!("{}: FROZEN without the fault", what()));
        let stopped = bench.mode() == Mode::Safe || bench.until(500, is_in(Mode::Safe)).is_some();
        evidence.require(stopped, || format!("{}: no SAFE", what()));
        evidence.require(all_stay(&mut bench, 100), || format!("{}: a paddle moved in SAFE", what()));
        evidence.close(&bench, what);
    }
    Ok(())
}

/// Row 48: one paddle does not follow: SAFE, said of that one, and the other is not moved any more.
pub(crate) fn broken<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(48);
    for (place, _) in trial.paddles() {
        for fault in [Fault::Stuck(place), Fault::ActuatorGain(place, 0.5)] {
            let what = || format!("{fault:?}");
            let [mut healthy, mut bench] = trial.twins(&mut random)?;
            let injected = bench.injected;
            bench.inject(fault, FOR_EVER);
            let codes = Faults::FOLLOWING_ERROR | Faults::FROZEN;
            let is_found =
                move |command: &PaddleCommand| !Faults::from_bits(command.faults).intersection(codes).is_empty();
            let found = bench.until(6000, is_found);
            evidence.detect(found, 6000, what);
            let faults = bench.state.faults();
            evidence.require(is_told_apart(faults, place), || format!("{}: {faults}", what()));
            evidence.require(bench.injected > injected, || format!("{}: nothing was injected", what()));
            let alarm = healthy.until(found.unwrap_or(6000), is_found);
            evidence.require(alarm.is_none(), || format!("{}: a code without the fault", what()));
            let stopped = bench.mode() == Mode::Safe || bench.until(500, is_in(Mode::Safe)).is_some();
            evidence.require(stopped, || format!("{}: no SAFE", what()));
            evidence.require(all_stay(&mut bench, 300), || format!("{}: a paddle moved in SAFE", what()));
            evidence.close(&bench, what);
        }
    }
    Ok(())
}

/// Row 49: a push for which one paddle would have to go further than it may: it stays at its limit, the other gives the rest,
/// and the target is held. With ranges that are too short for both, it is not.
pub(crate) fn at_its_limit<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    /// What the first one is asked for, in units of its range.
    const ASKED: f64 = 1.15;
    // Along the first direction one of them has much more to do than the other.
    let along = SVector::from_fn(|i, _| if i == 0 { 1.0 } else { 0.0 });
    let parts = excursions(trial.table, &along).into_iter().zip(&trial.table.paddles);
    let push = ASKED / parts.map(|(way, paddle)| way / paddle.max_displacement).fold(0.0, f64::max);
    for sign in [1.0, -1.0] {
        for enough in [true, false] {
            let what = || format!("push of {:e}, {}", sign * push, if enough { "enough" } else { "not enough" });
            let mut table = trial.table.clone();
            if !enough {
                table.paddles.iter_mut().for_each(|paddle| paddle.max_displacement *= 0.5);
            }
            let mut bench = ClosedLoop::new(&table, Setup { noise: 0.0, speed: 0.0, ..trial.setup() })?;
            bench.tissue().push_direction = along;
            bench.run(200);
            bench.inject(Fault::Push(sign * push / 10.0), 10_000);
            let limited = bench.until(10_000, carries(Faults::POSITION_LIMITED));
            let left = 12_000 - (bench.now() - 200);
            bench.run(left);
            let error = bench.error.norm();
            let at = bench.paddles();
            let ranges: [f64; P] =
                std::array::from_fn(|place| at[place].norm() / table.paddles[place].max_displacement);
            let most = ranges.into_iter().fold(0.0, f64::max);
            if enough {
                evidence.detect(limited, 10_000, what);
                // The witnesses: one is at its limit, and another one is not.
                let free = ranges.into_iter().any(|range| range < 0.999);
                evidence.require(most > 0.999 && free, || format!("{}: of their ranges {ranges:?}", what()));
                evidence.require(error < 1e-4 * push, || format!("{}: {error:e} is left", what()));
            } else {
                evidence.require(error > 0.1 * push, || format!("{}: only {error:e} is left", what()));
            }
            evidence.expect_mode(&bench, Mode::Run, what);
            evidence.close(&bench, what);
        }
    }
    Ok(())
}

/// Row 50: each paddle's position arrives as the other's, with the identity that is expected: neither follows.
pub(crate) fn samples_exchanged<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    exchanged(trial, Fault::SamplesExchanged, evidence)
}

/// Row 51: each actuator has the other paddle's commands: neither follows.
pub(crate) fn commands_exchanged<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    exchanged(trial, Fault::CommandsExchanged, evidence)
}

/// Found at the latest when the needle arrives: by then the paddles are further apart than a paddle may be from where it was
/// told to be. From the start on, and from somewhere in the middle.
fn exchanged<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    fault: Fault,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let insertion = (trial.table.validity.depth_end / trial.setup().speed * 1e3) as u64;
    for from in [0, 1500] {
        let what = || format!("{fault:?} from tick {from}");
        let [mut healthy, mut bench] =
            [ClosedLoop::new(trial.table, trial.setup())?, ClosedLoop::new(trial.table, trial.setup())?];
        for bench in [&mut healthy, &mut bench] {
            bench.run(from);
        }
        let injected = bench.injected;
        bench.inject(fault, FOR_EVER);
        let found = bench.until(6000, carries(Faults::FOLLOWING_ERROR));
        evidence.detect(found, insertion + u64::from(FOLLOWING_SAMPLES), what);
        let alarm = healthy.until(6000, carries(Faults::FOLLOWING_ERROR));
        evidence.require(alarm.is_none(), || format!("{}: FOLLOWING_ERROR without the fault", what()));
        evidence.require(bench.injected > injected, || format!("{}: nothing was injected", what()));
        evidence.require(all_stay(&mut bench, 100), || format!("{}: a paddle moved in SAFE", what()));
        evidence.expect_mode(&bench, Mode::Safe, what);
        evidence.close(&bench, what);
    }
    Ok(())
}
