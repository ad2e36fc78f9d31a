//! Rows 7 to 12 and 16: samples that are old, lost, doubled, in the wrong order, frozen, or rare.

use firmware::detection::{
    FROZEN_SAMPLES, FROZEN_TRAVEL, NEEDLE_CONTRADICTION_TRAVEL, SAFE_AGE_FLOOR_NS, TARGET_SAMPLES_TO_HOLD,
    TARGET_SAMPLES_TO_SAFE, TICKS_TO_HOLD,
};
use firmware::inputs::Discard;
use firmware::{Faults, Mode, Settings};

use super::{FOR_EVER, Trial, comes_back, during, same_motion, stays_safe_until_rearmed};
use crate::bench::error::SimError;
use crate::bench::faults::closed_loop::{ClosedLoop, Setup};
use crate::bench::faults::evidence::{Evidence, carries, is_in};
use crate::bench::faults::fault::{Fault, Stream};

/// Ages in ticks past which a stream leads to HOLD and to SAFE.
fn age_limits(stream: Stream, settings: &Settings) -> [u64; 2] {
    let period = settings.loop_period_ns;
    let target = |samples: u64| (settings.target_latency_ns + samples * settings.target_period_ns) / period;
    let floor = SAFE_AGE_FLOOR_NS / period;
    match stream {
        Stream::Target => [target(TARGET_SAMPLES_TO_HOLD), target(TARGET_SAMPLES_TO_SAFE).max(floor)],
        Stream::Needle | Stream::Paddle | Stream::SecondPaddle => [TICKS_TO_HOLD, floor.max(10 * TICKS_TO_HOLD)],
    }
}

/// The streams of encoders: a sample on every tick.
fn at_loop_rate<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
) -> impl Iterator<Item = Stream> {
    trial.streams().iter().copied().filter(|stream| *stream != Stream::Target)
}

/// Goes on until a target sample has just arrived; its age then, ticks.
fn after_a_target_sample<const D: usize, const N: usize, const P: usize>(bench: &mut ClosedLoop<'_, D, N, P>) -> u64 {
    let period = bench.setup().settings.loop_period_ns;
    loop {
        if let Some(exchange) = bench.step()
            && let Some(sample) = exchange.inputs.target
        {
            return (exchange.inputs.time_ns - sample.time_ns) / period;
        }
    }
}

/// Row 7: a stream that stops leads to HOLD on the first tick past its first limit and to SAFE past its second.
pub(crate) fn stale<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(7);
    for stream in trial.streams().iter().copied() {
        let mut bench = trial.running(&mut random)?;
        let age = if stream == Stream::Target { after_a_target_sample(&mut bench) } else { 0 };
        let [hold, safe] = age_limits(stream, &bench.setup().settings).map(|limit| limit - age + 1);
        bench.inject(Fault::Lost(stream), 1000);
        let held = bench.until(1000, is_in(Mode::Hold));
        evidence.detect(held, hold, || format!("{stream:?} to HOLD"));
        evidence.require(held == Some(hold), || format!("{stream:?}: HOLD after {held:?} ticks, due after {hold}"));
        let latched = bench.until(1000, is_in(Mode::Safe)).zip(held).map(|(more, held)| held + more);
        evidence.detect(latched, safe, || format!("{stream:?} to SAFE"));
        evidence.require(latched == Some(safe), || format!("{stream:?}: SAFE after {latched:?}, due after {safe}"));
        bench.run(1000);
        stays_safe_until_rearmed(&mut bench, evidence, || format!("{stream:?}"));
        evidence.close(&bench, || format!("{stream:?}"));
    }
    // Samples that arrive, all of them, but older than the limit.
    for stream in at_loop_rate(trial) {
        let mut bench = trial.running(&mut random)?;
        bench.inject(Fault::Late(stream, TICKS_TO_HOLD + 3), FOR_EVER);
        evidence.detect(bench.until(50, is_in(Mode::Hold)), TICKS_TO_HOLD + 1, || format!("late {stream:?}"));
        bench.run(500);
        evidence.expect_mode(&bench, Mode::Hold, || format!("late {stream:?}"));
        evidence.close(&bench, || format!("late {stream:?}"));
    }
    Ok(())
}

/// Row 8: gaps in the sequence are counted exactly.
pub(crate) fn gaps<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(8);
    for stream in trial.streams().iter().copied() {
        for gap in [1, 10, 1000] {
            let what = || format!("{gap} of {stream:?}");
            let mut setup = trial.setup();
            setup.shuttles = true;
            let mut bench = trial.running_with(setup, &mut random)?;
            let mut ticks = gap;
            if stream == Stream::Target {
                after_a_target_sample(&mut bench);
                ticks = gap * bench.setup().settings.target_period_ns / bench.setup().settings.loop_period_ns;
            }
            let missed = stream.account(bench.state.ledger()).lost;
            during(&mut bench, Fault::Lost(stream), ticks);
            let found = bench.until(40, carries(Faults::SAMPLE_GAP)).map(|after| after + ticks);
            evidence.detect(found, ticks + 20, what);
            bench.run(100);
            let counted = stream.account(bench.state.ledger()).lost - missed;
            evidence.require(counted == gap, || format!("{}: {counted} counted", what()));
            evidence.close(&bench, what);
        }
    }
    Ok(())
}

/// Row 9: a sample that arrives twice is used once.
pub(crate) fn duplicates<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(9);
    let mut twins = trial.twins(&mut random)?;
    twins[1].inject(Fault::Duplicated(Stream::Target), 1000);
    let same = same_motion(&mut twins, 1100);
    evidence.require(same, || "Target: a duplicate moved the paddle".to_owned());
    let [_, doubled] = &twins;
    let duplicates = Stream::Target.account(doubled.state.ledger()).duplicates;
    let repeated = doubled.audit.tally(Stream::Target).repeated;
    evidence.injected += repeated;
    evidence.detected += duplicates;
    evidence.require(duplicates == repeated && repeated == 50, || {
        format!("Target: {duplicates} duplicates counted of {repeated} read, 50 sent")
    });
    evidence.expect_mode(doubled, Mode::Run, || "Target".to_owned());
    evidence.close(doubled, || "Target".to_owned());
    // At loop rate a duplicate takes the place of the sample that arrives with it.
    for stream in at_loop_rate(trial) {
        let mut bench = trial.running(&mut random)?;
        for _ in 0..100 {
            let found = bench.inject(Fault::Duplicated(stream), 1).until(3, carries(Faults::DUPLICATE));
            evidence.detect(found, 2, || format!("{stream:?}"));
            bench.run(3);
        }
        let counted = stream.account(bench.state.ledger()).duplicates;
        evidence.require(counted == 100, || format!("{stream:?}: {counted} of 100 duplicates counted"));
        evidence.expect_mode(&bench, Mode::Run, || format!("{stream:?}"));
        evidence.close(&bench, || format!("{stream:?}"));
    }
    Ok(())
}

/// Row 10: a sample that arrives after a newer one is discarded and counted.
pub(crate) fn reordered<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(10);
    let encoders = at_loop_rate(trial).map(|stream| (stream, 2, 5));
    for (stream, late, spacing) in encoders.chain([(Stream::Target, 30, 80)]) {
        let mut bench = trial.running(&mut random)?;
        for _ in 0..20 {
            if stream == Stream::Target {
                // The next one is late.
                after_a_target_sample(&mut bench);
                bench.run(15);
            }
            let ticks = if stream == Stream::Target { 10 } else { 1 };
            let found = bench.inject(Fault::Late(stream, late), ticks).until(spacing, carries(Faults::OUT_OF_ORDER));
            evidence.detect(found, spacing, || format!("{stream:?}"));
            bench.run(spacing);
        }
        let counted = stream.account(bench.state.ledger()).discarded_for(Discard::Late);
        evidence.require(counted == 20, || format!("{stream:?}: {counted} of 20 discarded as late"));
        evidence.expect_mode(&bench, Mode::Run, || format!("{stream:?}"));
        evidence.close(&bench, || format!("{stream:?}"));
    }
    Ok(())
}

/// Row 11: a value that stays while the sequence advances and the needle moves is detected.
pub(crate) fn frozen<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(11);
    let setup = trial.setup();
    let period_s = setup.settings.loop_period_ns as f64 * 1e-9;
    let range = trial.table.validity.depth_end - trial.table.validity.depth_start;
    let ticks_of = |travel: f64| (travel * range / setup.speed / period_s).ceil() as u64;
    let travel_ticks = ticks_of(FROZEN_TRAVEL);
    let samples = u64::from(FROZEN_SAMPLES) + 1;
    let per_target = setup.settings.target_period_ns / setup.settings.loop_period_ns;
    for stream in trial.streams().iter().copied() {
        let code = Faults::FROZEN;
        let limit = match stream {
            Stream::Needle => ticks_of(NEEDLE_CONTRADICTION_TRAVEL),
            // The first frozen sample is a new value; the travel counts from sample to sample.
            Stream::Target => (samples + 1) * per_target + travel_ticks,
            // The command has to go away from where it was.
            Stream::Paddle | Stream::SecondPaddle => 1500,
        };
        let [mut healthy, mut bench] = trial.twins(&mut random)?;
        let (depth, injected) = (bench.depth(), bench.injected);
        bench.inject(Fault::Frozen(stream), FOR_EVER);
        let found = bench.until(3000, carries(code));
        evidence.detect(found, limit, || format!("{stream:?}"));
        // The witnesses: samples were changed on their way, while the needle itself went on.
        let moved = bench.depth() - depth;
        evidence.require(bench.injected > injected && moved > 0.0, || format!("{stream:?}: nothing was frozen"));
        let alarm = healthy.until(found.unwrap_or(limit), carries(code));
        evidence.require(alarm.is_none(), || format!("{stream:?}: {code} without the fault after {alarm:?} ticks"));
        let stopped = bench.mode() == Mode::Safe || bench.until(500, is_in(Mode::Safe)).is_some();
        evidence.require(stopped, || format!("{stream:?}: no SAFE"));
        evidence.close(&bench, || format!("{stream:?}"));
    }
    Ok(())
}

/// Row 12: a target sensor of 30 Hz in a loop of 1 kHz makes no oscillation.
pub(crate) fn slow_sensor<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    const MS: u64 = 1_000_000;
    let setup = Setup { settings: Settings::new(MS, 33_333_333, 20 * MS), noise: 0.0, speed: 0.0, ..trial.setup() };
    let offset = 0.01 * trial.table.validity.depth_end;
    for sign in [1.0, -1.0] {
        let mut bench = ClosedLoop::new(trial.table, setup)?;
        bench.tissue().push = sign * offset;
        evidence.injected += 1;
        // The paddle needs longer than a sample for the first correction, which costs a little overshoot.
        let mut overshoot: f64 = 0.0;
        for _ in 0..4000 {
            bench.step();
            overshoot = overshoot.max(-sign * bench.error_sideways());
        }
        let left = bench.error.norm();
        evidence.require(overshoot < 0.01 * offset, || format!("overshoot of {overshoot} of {offset}"));
        evidence.require(left < 1e-6 * offset, || format!("{left} of {offset} is left"));
        evidence.detected += u64::from(overshoot < 0.01 * offset);
        evidence.expect_mode(&bench, Mode::Run, || "30 Hz".to_owned());
        evidence.close(&bench, || "30 Hz".to_owned());
    }
    Ok(())
}

/// Row 16: the target is lost for 1 to 500 ticks: HOLD, then SAFE; the return keeps the limits.
pub(crate) fn target_lost<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(16);
    let settings = trial.setup().settings;
    let [hold, safe] = age_limits(Stream::Target, &settings);
    let per_target = settings.target_period_ns / settings.loop_period_ns;
    for ticks in [1, 10, 20, 50, 100, 200, 280, 350, 500] {
        for fault in [Fault::Hidden, Fault::Lost(Stream::Target)] {
            let what = || format!("{fault:?} for {ticks} ticks");
            let mut bench = trial.running(&mut random)?;
            let age = after_a_target_sample(&mut bench);
            let over = bench.now() + ticks + 3 * per_target;
            bench.inject(fault, ticks);
            // A sensor that says so is believed at once; silence takes its time.
            let affected = ticks / per_target;
            let limit = if fault == Fault::Hidden { per_target } else { hold - age + 1 };
            if (fault == Fault::Hidden && affected > 0) || ticks > limit {
                evidence.detect(bench.until(ticks, |command| command.state != Mode::Run as u32), limit, what);
            } else {
                evidence.injected += 1;
            }
            bench.run(over - bench.now());
            if ticks > safe - age + per_target {
                evidence.expect_mode(&bench, Mode::Safe, what);
                stays_safe_until_rearmed(&mut bench, evidence, what);
            } else if ticks + per_target < safe - age {
                comes_back(&mut bench, 2 * per_target, evidence, what);
            }
            bench.run(200);
            evidence.close(&bench, what);
        }
    }
    Ok(())
}
