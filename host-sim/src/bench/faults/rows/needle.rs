//! Rows 30 to 32: a needle that leaves the table, turns back, or is too fast.

use firmware::contract::frames::to_plane;
use firmware::{Faults, Mode};
use nalgebra::Vector2;

use super::{Trial, comes_back};
use crate::bench::error::SimError;
use crate::bench::faults::closed_loop::{ClosedLoop, Setup};
use crate::bench::faults::evidence::{Evidence, carries};
use crate::bench::faults::fault::Fault;
use crate::bench::faults::tissue::LinearTissue;

/// Row 30: past the last knot the feed-forward stays at its last value, and says so.
pub(crate) fn beyond_the_table(trial: &Trial<'_>, evidence: &mut Evidence) -> Result<(), SimError> {
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
            let expected = last.paddle_path + Vector2::from(to_plane(added[0]));
            let off = (Vector2::from(to_plane(command.displacement[0])) - expected).norm();
            evidence.require(off < 1e-12, || format!("depth {}: {off} off the last knot's path", needle.depth));
        }
    }
    evidence.expect_mode(&bench, Mode::Run, || "past the table".to_owned());
    evidence.close(&bench, || "past the table".to_owned());
    Ok(())
}

/// Row 31: the needle turns back in the middle: the command goes on without a step.
pub(crate) fn reversal(trial: &Trial<'_>, evidence: &mut Evidence) -> Result<(), SimError> {
    let mut random = trial.random(31);
    for factor in [-1.0, -3.0] {
        let what = || format!("speed × {factor}");
        let mut bench = trial.running(&mut random)?;
        let period_s = bench.setup().settings.loop_period_ns as f64 * 1e-9;
        let slope = trial.table.knots.iter().map(|knot| knot.paddle_path_slope.norm()).fold(0.0, f64::max);
        bench.inject(Fault::NeedleSpeed(factor), 400);
        let (started_at, mut least, mut turned, mut heard) = (bench.depth(), bench.depth(), None, None);
        // A step: more than feed-forward at this speed and one correction of the feedback explain.
        let direction = trial.table.knots.iter().filter_map(|knot| knot.jacobian[0].try_inverse());
        let measure = direction.map(|inverse| (inverse * trial.table.orthogonal).norm()).fold(0.0, f64::max);
        let mut last = bench.last.map(|last| Vector2::from(to_plane(last.command.displacement[0])));
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
            let now = Vector2::from(to_plane(exchange.command.displacement[0]));
            let speed = bench.setup().speed * factor.abs();
            let noise = 8.0 * bench.setup().noise;
            let explained = 2.0 * slope * speed * period_s + bench.loop_gain() * measure * (error + noise);
            let step = last.map_or(0.0, |last| (now - last).norm());
            evidence.require(step <= explained, || format!("{}: step of {step}, {explained} explained", what()));
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
pub(crate) fn too_fast(trial: &Trial<'_>, evidence: &mut Evidence) -> Result<(), SimError> {
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
