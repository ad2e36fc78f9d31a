//! Rows 1 to 6: overruns, clocks, counters.

use firmware::detection::{MAX_SUCCESSIVE_OVERRUNS, TICKS_TO_HOLD};
use firmware::{Faults, Inputs, Mode};

use super::{Trial, comes_back, integral_bits, stays_safe_until_rearmed};
use crate::bench::error::SimError;
use crate::bench::faults::closed_loop::ClosedLoop;
use crate::bench::faults::evidence::{Evidence, carries, is_in};
use crate::bench::faults::fault::{Event, Fault, Stream, below};
use crate::record::recording::{Record, Recording, RecordingHeader};
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::time::mode::RunMode;

/// Row 1: a step over its budget is counted, whole periods are skipped, the phase stays, nothing runs twice.
pub(crate) fn overrun<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(1);
    for (periods, skipped) in [(0.5, 0), (1.0, 0), (3.5, 3)] {
        let mut bench = trial.running(&mut random)?;
        let before = bench.state.ledger().ticks.skipped;
        bench.inject(Fault::SlowStep(periods), 1).run(1);
        if skipped > 0 {
            let found = bench.until(10, carries(Faults::TICKS_SKIPPED));
            evidence.detect(found, skipped + 1, || format!("{periods} periods"));
        } else {
            evidence.injected += 1;
        }
        bench.run(200);
        let counted = bench.state.ledger().ticks.skipped - before;
        evidence.require(counted == skipped, || format!("{periods} periods: {counted} skipped instead of {skipped}"));
        // The release after it and every later one lie on the old grid: checked by the bench on every tick.
        evidence.expect_mode(&bench, Mode::Run, || format!("{periods} periods"));
        evidence.close(&bench, || format!("{periods} periods"));
    }
    Ok(())
}

/// Row 2: an overrun on every tick leads to SAFE.
pub(crate) fn overrun_on_every_tick<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(2);
    for (periods, spacing) in [(1.5, 2), (3.5, 4)] {
        let mut bench = trial.running(&mut random)?;
        bench.inject(Fault::SlowStep(periods), 200);
        let found = bench.until(200, is_in(Mode::Safe));
        let limit = 1 + spacing * u64::from(MAX_SUCCESSIVE_OVERRUNS);
        evidence.detect(found, limit, || format!("{periods} periods"));
        let cause = bench.state.faults();
        evidence.require(cause.contains(Faults::OVERRUN), || format!("{periods} periods: SAFE for {cause}"));
        bench.run(200);
        stays_safe_until_rearmed(&mut bench, evidence, || format!("{periods} periods"));
        evidence.close(&bench, || format!("{periods} periods"));
    }
    Ok(())
}

/// Row 3: the peer stops for 100 ms: one gap, HOLD, and RUN on fresh data.
pub(crate) fn peer_stopped<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = trial.random(3);
    for lost in [false, true] {
        let what = || if lost { "samples lost" } else { "sequences stand still" }.to_owned();
        let mut bench = trial.running(&mut random)?;
        if lost {
            for stream in trial.streams().iter().copied() {
                bench.inject(Fault::Lost(stream), 100);
            }
        } else {
            bench.inject(Fault::PeerStopped, 100);
        }
        let missed = bench.state.ledger().needle.lost;
        evidence.detect(bench.until(100, is_in(Mode::Hold)), TICKS_TO_HOLD + 1, what);
        let (hold, run) = (bench.audit.modes[0], bench.audit.modes[1]);
        bench.run(100 - TICKS_TO_HOLD - 1);
        evidence.require(bench.audit.modes[1] == run, || format!("{}: RUN in the gap", what()));
        comes_back(&mut bench, 100, evidence, what);
        bench.run(300);
        let held = bench.audit.modes[0] - hold;
        evidence.require(held < 200, || format!("{}: {held} ticks in HOLD: more than one gap", what()));
        let gap = bench.state.ledger().needle.lost - missed;
        let expected = if lost { 100 } else { 0 };
        evidence.require(gap == expected, || format!("{}: {gap} samples missed instead of {expected}", what()));
        evidence.expect_mode(&bench, Mode::Run, what);
        evidence.close(&bench, what);
    }
    Ok(())
}

/// Row 4: jumps of the wall clock by an hour leave no trace in the record: the same bytes. A steady clock that jumps as
/// far does leave one.
pub(crate) fn wall_clock<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    const HOUR_NS: i64 = 3_600_000_000_000;
    let mut random = trial.random(4);
    let untouched = run_with(trial, &[], evidence)?;
    for jumps in [&[HOUR_NS] as &[i64], &[-HOUR_NS], &[HOUR_NS, -HOUR_NS], &[2 * HOUR_NS]] {
        let mut from = 0;
        let events: Vec<Event> = jumps
            .iter()
            .map(|by_ns| {
                from += 1 + below(&mut random, 900);
                Event { fault: Fault::WallClock(*by_ns), from, until: from + 1 }
            })
            .collect();
        let run = run_with(trial, &events, evidence)?;
        // The witness: a clock that the controller does not know.
        let jumped = run.wall_ns - untouched.wall_ns;
        evidence.require(jumps.last() == Some(&jumped), || format!("the wall clock is off by {jumped} ns"));
        evidence.injected += jumps.len() as u64;
        evidence.require(run.record == untouched.record, || format!("{jumps:?}: the records differ"));
    }
    let back = Event { fault: Fault::ClockBack(HOUR_NS.cast_unsigned()), from: 1000, until: 1001 };
    let mut not_required = Evidence::default();
    let steady = run_with(trial, &[back], &mut not_required)?;
    evidence.require(steady.record != untouched.record, || "a jump of the steady clock leaves no trace".to_owned());
    evidence.notes.push("no code reads the wall clock: forbidden by .clippy.toml".to_owned());
    Ok(())
}

/// What is left of 2000 ticks.
struct WallClockRun {
    record: Vec<u8>,
    /// What a wall clock shows at the end, ns.
    wall_ns: i64,
}

fn run_with<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    events: &[Event],
    evidence: &mut Evidence,
) -> Result<WallClockRun, SimError> {
    let mut bench = ClosedLoop::new(trial.table, trial.setup())?;
    for event in events {
        bench.inject_at(*event);
    }
    let exchanges: Vec<ControllerTick> = (0..2000).filter_map(|_| bench.step()).collect();
    evidence.expect_mode(&bench, Mode::Run, || "wall clock".to_owned());
    evidence.close(&bench, || "wall clock".to_owned());
    Ok(WallClockRun { record: recording(trial, &bench, &exchanges), wall_ns: bench.wall_clock_ns() })
}

fn recording<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    bench: &ClosedLoop<'_, D, N, P>,
    exchanges: &[ControllerTick],
) -> Vec<u8> {
    let header = RecordingHeader {
        mode: RunMode::Lockstep,
        seed: trial.seed,
        scene_hash: trial.table.scene_hash,
        settings: bench.setup().settings,
        table: Vec::new(),
    };
    let records = exchanges.iter().map(|exchange| Record { tick: *exchange, truth: None }).collect();
    Recording { header, records }.encode()
}

/// Row 5: a tick from the past, or from the far future, is rejected: SAFE at once, nothing of it is used.
pub(crate) fn clock_back<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    const MS: u64 = 1_000_000;
    let mut random = trial.random(5);
    for back_ns in [MS + 1, 5 * MS, 3_600_000 * MS] {
        let what = || format!("{back_ns} ns back");
        let mut bench = trial.running(&mut random)?;
        let integral = integral_bits(&bench.state);
        let consumed = bench.state.ledger().needle.consumed;
        let found = bench.inject(Fault::ClockBack(back_ns), 1).until(1, carries(Faults::CLOCK_REVERSED));
        evidence.detect(found, 1, what);
        evidence.expect_mode(&bench, Mode::Safe, what);
        let untouched = integral == integral_bits(&bench.state) && consumed == bench.state.ledger().needle.consumed;
        evidence.require(untouched, || format!("{}: the rejected tick changed something", what()));
        stays_safe_until_rearmed(&mut bench, evidence, what);
        evidence.close(&bench, what);
    }
    let bench = trial.running(&mut random)?;
    let Some(last) = bench.last else { return Ok(()) };
    for ahead_ns in [0, 300 * MS, 3_600_000 * MS, 1 << 62] {
        let inputs =
            Inputs { tick: last.inputs.tick + 1, time_ns: last.inputs.time_ns + MS + ahead_ns, ..Inputs::default() };
        let command = bench.foresee(&inputs);
        let rejected = carries(Faults::CLOCK_JUMPED)(&command) && is_in(Mode::Safe)(&command);
        if ahead_ns > 0 {
            evidence.detect(rejected.then_some(1), 1, || format!("{ahead_ns} ns ahead"));
        } else {
            evidence.require(!rejected, || "a tick in time is taken for a jump".to_owned());
        }
    }
    Ok(())
}

/// Row 6: counters that wrap are no event: same motion, same accounts, gaps counted across the wrap.
pub(crate) fn counter_wrap<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let bench = |sequence| -> Result<ClosedLoop<'_, D, N, P>, crate::bench::error::SimError> {
        let mut setup = trial.setup();
        setup.sequence = sequence;
        Ok(ClosedLoop::new(trial.table, setup)?)
    };
    // The wrap between two samples, and in the middle of ten lost ones.
    for start in [u32::MAX - 5, u32::MAX - 505] {
        let mut twins = [bench(0)?, bench(start)?];
        let same = (0..2000u64).all(|tick| {
            if tick == 500 {
                for bench in &mut twins {
                    bench.inject(Fault::Lost(Stream::Needle), 10);
                }
            }
            super::same_motion(&mut twins, 1)
        });
        evidence.injected += 1;
        evidence.require(same, || format!("start at {start}: another motion than from 0"));
        let [zero, wrapping] = &twins;
        evidence
            .require(zero.state.ledger() == wrapping.state.ledger(), || format!("start at {start}: other accounts"));
        let missed = wrapping.state.ledger().needle.lost;
        evidence.require(missed == 10, || format!("start at {start}: {missed} missed instead of 10"));
        evidence.detected += u64::from(missed == 10 && same);
        evidence.expect_mode(wrapping, Mode::Run, || format!("start at {start}"));
        evidence.close(wrapping, || format!("start at {start}"));
    }
    Ok(())
}
