//! Rows 30 to 32: a needle that leaves the table, turns back, or is too fast.

use firmware::{Faults, Mode};
use nalgebra::SVector;

use super::{Trial, comes_back, largest, law, steepest};
use crate::bench::error::SimError;
use crate::bench::faults::closed_loop::{ClosedLoop, Setup};
use crate::bench::faults::evidence::{Evidence, carries};
use crate::bench::faults::fault::Fault;
use crate::bench::faults::invariants::positions;
use crate::bench::faults::tissue::LinearTissue;
use crate::world::truth::from_frame;

/// Row 30: past the last knot the feed-forward stays at its last value, and says so.
pub(crate) fn beyond_the_table<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut short = trial.table.clone();
    let kept = 2 * short.knots.len() / 3;
    short.knots.truncate(kept);
    let Some(last) = short.knots.last().cloned() else { return Ok(()) };
    short.validity.depth_end = last.depth;
    let mut bench = ClosedLoop::new(&short, Setup { depth_end: trial.table.validity.depth_end, ..trial.setup() })?;
    *bench.tissue() = LinearTissue::new(trial.table);
    let mut outside_since = None;
    for _ in 0..9000 {
        let Some(exchange) = bench.step() else { continue };
        let Some(needle) = exchange.inputs.needle else { continue };
        let command = exchange.command;
        let faults = Faults::from_bits(command.faults);
        let flagged = faults.contains(Faults::DEPTH_CLAMPED);
        let outside = needle.depth > last.depth;
        evidence.require(flagged == outside, || format!("depth {}: flagged {flagged}", needle.depth));
        if !outside {
            continue;
        }
        if outside_since.is_none() {
            outside_since = Some(bench.now());
            evidence.detect(flagged.then_some(1), 1, || "depth past the table".to_owned());
        }
        // No extrapolation: the command is the last value of the path and what the feedback adds, unless limited.
        if faults.intersection(Faults::POSITION_LIMITED | Faults::RATE_LIMITED).is_empty()
            && let Some(added) = bench.state.added()
        {
            let now: [SVector<f64, D>; P] = positions(&command);
            let off =
                |place: usize| (now[place] - (last.paddle_path.column(place) + from_frame::<D>(added[place]))).norm();
            let off = (0..P).map(off).fold(0.0, f64::max);
            evidence.require(off < 1e-12, || format!("depth {}: {off} off the last knot's path", needle.depth));
        }
    }
    evidence.expect_mode(&bench, Mode::Run, || "past the table".to_owned());
    evidence.close(&bench, || "past the table".to_owned());
    Ok(())
}

/// Row 31: the needle turns back in the middle: the command goes on without a step.
pub(crate) fn reversal<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(31);
    for factor in [-1.0, -3.0] {
        let what = || format!("speed × {factor}");
        let mut bench = trial.running(&mut random)?;
        let period_s = bench.setup().settings.loop_period_ns as f64 * 1e-9;
        let slopes = steepest(trial.table);
        bench.inject(Fault::NeedleSpeed(factor), 400);
        let (started_at, mut least, mut turned, mut heard) = (bench.depth(), bench.depth(), None, None);
        // A step: more than feed-forward at this speed and one correction of the feedback explain.
        let measures = largest(trial.table, |knot| law(trial.table, knot).map(|direction| direction.norm()));
        let mut last: Option<[SVector<f64, D>; P]> = bench.last.map(|last| positions(&last.command));
        for tick in 1..=600u64 {
            let (error, before) = (bench.max_error, bench.depth());
            let Some(exchange) = bench.step() else { continue };
            if bench.depth() < before {
                turned = turned.or(Some(tick));
            }
            if exchange.inputs.needle.is_some_and(|needle| needle.velocity < 0.0) {
                heard = heard.or(Some(tick));
            }
            least = least.min(bench.depth());
            let now: [SVector<f64, D>; P] = positions(&exchange.command);
            let speed = bench.setup().speed * factor.abs();
            let noise = 8.0 * bench.setup().noise;
            for place in 0..P {
                let (slope, measure) = (slopes[place], measures[place]);
                let explained = 2.0 * slope * speed * period_s + bench.loop_gain() * measure * (error + noise);
                let step = last.map_or(0.0, |last| (now[place] - last[place]).norm());
                evidence.require(step <= explained, || format!("{}: step of {step}, {explained} explained", what()));
            }
            last = Some(now);
        }
        // The needle itself has turned, and the controller, which heard of it at once, has gone on.
        evidence.detect(heard.zip(turned).map(|(heard, turned)| heard.saturating_sub(turned) + 1), 2, what);
        let back = 0.2 * bench.setup().speed * factor.abs();
        evidence.require(started_at - least > back, || format!("{}: back by {} only", what(), started_at - least));
        evidence.expect_mode(&bench, Mode::Run, what);
        evidence.close(&bench, what);
    }
    Ok(())
}

/// Row 32: a needle faster than the table holds for: HOLD on that very tick, RUN when it is slower again.
pub(crate) fn too_fast<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(32);
    let limit = trial.table.validity.needle_speed;
    for excess in [1.2, 2.0] {
        let what = || format!("{excess} × the limit");
        let mut bench = trial.running(&mut random)?;
        let factor = excess * limit / bench.setup().speed;
        bench.inject(Fault::NeedleSpeed(factor), 150);
        let mut exact = true;
        let mut first = None;
        for tick in 1..=150u64 {
            let Some(exchange) = bench.step() else { continue };
            let Some(needle) = exchange.inputs.needle else { continue };
            let fast = needle.velocity.abs() > limit;
            let command = exchange.command;
            exact &= fast == carries(Faults::NEEDLE_TOO_FAST)(&command);
            exact &= !fast || command.state == Mode::Hold as u32;
            if fast && first.is_none() {
                first = Some(tick);
                evidence.detect((command.state == Mode::Hold as u32).then_some(1), 1, what);
            }
        }
        evidence.require(first.is_some(), || format!("{}: never too fast", what()));
        evidence.require(exact, || format!("{}: HOLD and speed disagree", what()));
        comes_back(&mut bench, 400, evidence, what);
        evidence.close(&bench, what);
    }
    Ok(())
}
