//! Rows 33 to 36: processes that are killed, and what the others make of it.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use firmware::{Faults, Mode};
use rand_pcg::Pcg64;

use super::stage::{Process, Stage, children, descriptors, left_behind, ms, pause, read_json, unaccounted, wait_until};
use crate::bench::error::SimError;
use crate::bench::faults::evidence::Evidence;
use crate::bench::faults::fault::below;
use crate::record::error::RecordError;
use crate::record::files::read_recording;
use crate::record::recording::{Record, Recording};
use crate::record::replay::replay;
use crate::runtime::controller::process::ControllerResult;
use crate::runtime::plant::process::PlantResult;
use crate::runtime::signals;

/// Pairs of processes at work at once.
const WORKERS: u64 = 4;

/// The records of a file whose end mark is there; they must replay bit by bit.
fn whole_and_replayed(path: &Path) -> Result<Vec<Record>, RecordError> {
    let recording = Recording::read(path)?;
    replay(&recording, path)?;
    Ok(recording.records)
}

/// The whole records of a file that may have been cut off; they must replay bit by bit.
fn cut_off_and_replayed(path: &Path) -> Result<Vec<Record>, RecordError> {
    let recording = Recording::growing(&read_recording(path)?)
        .map_err(|source| RecordError::Recording { path: path.to_owned(), source })?;
    replay(&recording, path)?;
    Ok(recording.records)
}

/// Row 33: the simulator is killed at 200 seeded phases, from its first millisecond on.
pub(crate) fn plant_killed<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    undisturbed(stage, evidence)?;
    let repetitions = stage.repetitions(200);
    let shared = Mutex::new(evidence);
    let next = AtomicU64::new(0);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..WORKERS)
            .map(|_| {
                scope.spawn(|| -> Result<(), SimError> {
                    loop {
                        let trial = next.fetch_add(1, Ordering::Relaxed);
                        if trial >= repetitions {
                            return Ok(());
                        }
                        signals::check()?;
                        let mut random = Pcg64::new(u128::from(stage.seed) << 64 | u128::from(trial), 33);
                        // Half of them within the start, half in the middle of things.
                        let phase =
                            if trial.is_multiple_of(2) { below(&mut random, 60) } else { below(&mut random, 900) };
                        // What it computes before it looks for a controller is no part of that; it takes more or less.
                        let phase = phase + stage.lead_ms() * (80 + below(&mut random, 60)) / 100;
                        let mut own = Evidence::default();
                        kill_plant(stage, phase, &mut own)?;
                        if let Ok(mut shared) = shared.lock() {
                            shared.merge(own);
                        }
                    }
                })
            })
            .collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap_or(Ok(())))
    })
}

fn kill_plant<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    phase: u64,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let what = || format!("killed after {phase} ms");
    let link = stage.link();
    let (mut controller, record, json) = stage.controller(&link, &[])?;
    let (mut plant, _) = stage.plant(&link, &["--duration", "60"])?;
    pause(ms(phase));
    plant.kill();
    let killed = plant.was_killed();
    evidence.require(killed, || format!("{}: it had ended before: {}", what(), plant.message()));
    evidence.injected += u64::from(killed);
    let code = controller.code();
    evidence.require(code == Some(1), || format!("{}: the controller ended with {code:?}", what()));
    let result = read_json::<ControllerResult>(&json);
    evidence.require(result.is_some(), || format!("{}: the controller has no accounts", what()));
    // Without a state the plant had not been there yet: nothing was to be made safe.
    if let Some(result) = result.filter(|result| result.accounts.final_state.is_some()) {
        let unaccounted = unaccounted(&result, None);
        evidence.unaccounted += unaccounted;
        evidence.require(unaccounted == 0, || format!("{}: {unaccounted} unaccounted", what()));
        let was_run = result.accounts.ticks.run > 0;
        let expected = if was_run { Mode::Safe } else { Mode::Hold };
        let state = result.accounts.final_state;
        evidence.require(state == Some(expected), || format!("{}: ended in {state:?} instead of {expected:?}", what()));
        match whole_and_replayed(&record) {
            Ok(records) => {
                let fresh = records.iter().rposition(|record| record.tick.inputs.needle.is_some());
                let safe = records.iter().position(|record| record.tick.command.state == Mode::Safe as u32);
                if let (true, Some(fresh), Some(safe)) = (was_run, fresh, safe) {
                    let ticks = records[safe].tick.inputs.tick.saturating_sub(records[fresh].tick.inputs.tick);
                    evidence.ticks_to_detect = evidence.ticks_to_detect.max(Some(ticks));
                    evidence.final_state = Some(Mode::Safe);
                }
                evidence.detected += u64::from(code == Some(1) && state == Some(expected));
            }
            Err(error) => evidence.require(false, || format!("{}: its record: {error}", what())),
        }
    } else {
        evidence.detected += u64::from(code == Some(1));
    }
    let left = left_behind(&link)?;
    evidence.require(left.is_empty(), || format!("{}: left behind {left:?}", what()));
    Ok(())
}

/// Waits until a controller has a whole record of `mode`.
pub(super) fn reaches(record: &Path, mode: Mode, process: &mut Process) -> bool {
    wait_until(ms(5000), || {
        let bytes = std::fs::read(record).unwrap_or_default();
        let found = Recording::growing(&bytes)
            .is_ok_and(|recording| recording.records.iter().any(|r| r.tick.command.state == mode as u32));
        found || process.wait(ms(0)).is_some()
    })
}

/// A controller that takes over starts disarmed and does not move the paddle.
fn takes_over_gently(records: &[Record], evidence: &mut Evidence, what: &dyn Fn() -> String) {
    let Some(first) = records.first() else {
        evidence.require(false, || format!("{}: no record", what()));
        return;
    };
    evidence.require(first.tick.command.state == Mode::Hold as u32, || format!("{}: does not start in HOLD", what()));
    let adopted = records.iter().find(|record| record.tick.command.is_valid());
    let Some(Record { tick, .. }) = adopted else {
        evidence.require(false, || format!("{}: never heard where the paddle is", what()));
        return;
    };
    let measured = tick.inputs.paddles.map(|sample| sample.unwrap_or_default().displacement.map(f64::to_bits));
    let commanded = tick.command.displacement.map(|of| of.map(f64::to_bits));
    evidence.require(measured == commanded, || format!("{}: its first command is a motion", what()));
    evidence.detected += u64::from(measured == commanded);
}

/// Row 34: the controller is killed and restarted while the plant goes on.
pub(crate) fn controller_restarted<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = Pcg64::new(u128::from(stage.seed), 34);
    let link = stage.link();
    let (mut plant, json) = stage.plant(&link, &["--keep", "--insertion-time", "6", "--duration", "16"])?;
    let started = std::time::Instant::now();
    let mut kills = 0;
    for trial in 0..8 {
        // On a busy machine fewer of them: the last one has to find the plant at work.
        if started.elapsed() > ms(9000) {
            break;
        }
        signals::check()?;
        let what = || format!("controller {trial}");
        let (mut controller, record, _) = stage.controller(&link, &[])?;
        let armed = reaches(&record, Mode::Run, &mut controller);
        evidence.require(armed, || format!("{}: no RUN: {}", what(), controller.message()));
        pause(ms(below(&mut random, 300)));
        if plant.wait(ms(0)).is_some() {
            break;
        }
        controller.kill();
        kills += 1;
        evidence.require(controller.was_killed(), || format!("{}: it had ended before", what()));
        evidence.injected += 1;
        match cut_off_and_replayed(&record) {
            Ok(records) => takes_over_gently(&records, evidence, &what),
            Err(error) => evidence.require(false, || format!("{}: its record: {error}", what())),
        }
    }
    let (mut last, record, accounts) = stage.controller(&link, &[])?;
    let plant_code = plant.code();
    evidence.require(plant_code == Some(0), || format!("the plant ended with {plant_code:?}: {}", plant.message()));
    let code = last.code();
    evidence.require(code == Some(0), || format!("the last controller ended with {code:?}: {}", last.message()));
    let what = || "the last controller".to_owned();
    match whole_and_replayed(&record) {
        Ok(records) => takes_over_gently(&records, evidence, &what),
        Err(error) => evidence.require(false, || format!("its record: {error}")),
    }
    evidence.injected += 1;
    if let Some(result) = read_json::<ControllerResult>(&accounts) {
        evidence.unaccounted += unaccounted(&result, None);
        evidence.final_state = (result.accounts.final_state == Some(Mode::Run)).then_some(Mode::Run);
        // Without a real-time policy a busy machine may have overrun it.
        let (state, faults) = (result.accounts.final_state, result.accounts.faults);
        let explained = state != Some(Mode::Safe) || faults.contains(Faults::OVERRUN);
        evidence.require(explained, || format!("ended in {state:?}: {faults}"));
    }
    let limit = stage.table.paddles.iter().map(|paddle| paddle.max_rate).fold(0.0, f64::max) * 1e-3 * (1.0 + 1e-6);
    match read_json::<PlantResult>(&json) {
        Some(result) => {
            evidence.max_error = Some(result.largest_error);
            evidence.require(result.controllers == kills + 1, || {
                format!("the plant saw {} controllers instead of {}", result.controllers, kills + 1)
            });
            evidence.require(result.largest_step <= limit, || {
                format!("the paddle moved {} in a tick, at most {limit} is allowed", result.largest_step)
            });
        }
        None => evidence.require(false, || "the plant has left no account".to_owned()),
    }
    let left = left_behind(&link)?;
    evidence.require(left.is_empty(), || format!("left behind {left:?}"));
    Ok(())
}

/// Row 35: killed in the middle of creating services; the next ones get through in bounded time.
pub(crate) fn killed_at_start<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = Pcg64::new(u128::from(stage.seed), 35);
    let link = stage.link();
    let space = crate::exchange::Space::new(&link)?;
    // How long an undisturbed one takes to its first mark in shared memory, so that kills fall around it.
    let mark_us = {
        let empty = space.traces();
        let started = std::time::Instant::now();
        let (mut controller, ..) = stage.controller(&link, &[])?;
        wait_until(ms(5000), || space.traces() != empty || controller.wait(ms(0)).is_some());
        u64::try_from(started.elapsed().as_micros()).unwrap_or(u64::MAX).min(1_000_000)
    };
    let mut in_the_middle = 0;
    for trial in 0..stage.repetitions(100) {
        signals::check()?;
        let before = space.traces();
        let mut process =
            if trial % 2 == 0 { stage.controller(&link, &[])?.0 } else { stage.plant(&link, &["--duration", "60"])?.0 };
        pause(std::time::Duration::from_micros(below(&mut random, 3 * mark_us)));
        process.kill();
        evidence.require(process.was_killed(), || format!("it had ended before: {}", process.message()));
        evidence.injected += 1;
        in_the_middle += u64::from(space.traces() != before);
    }
    // The witness: some had left marks when they died.
    evidence.require(in_the_middle > 0, || "none was killed while it made its services".to_owned());
    let started = std::time::Instant::now();
    let failed = evidence.failed;
    pair_works(stage, &link, evidence)?;
    evidence.detected += if evidence.failed == failed { evidence.injected } else { 0 };
    let took = started.elapsed().as_secs_f64();
    evidence.notes.push(format!(
        "{in_the_middle} of {} had left marks; the pair after them took {took:.2} s for an insertion of 0.5 s",
        evidence.injected
    ));
    let left = left_behind(&link)?;
    evidence.require(left.is_empty(), || format!("left behind {left:?}"));
    Ok(())
}

/// The control: where nothing is killed, both end well.
fn undisturbed<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut own = Evidence::default();
    pair_works(stage, &stage.link(), &mut own)?;
    own.require(own.final_state == Some(Mode::Run), || "without the fault it does not end in RUN".to_owned());
    evidence.merge(Evidence { final_state: None, ..own });
    Ok(())
}

/// A short insertion with fresh processes on this link must go through.
fn pair_works<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    link: &str,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let (mut controller, _, json) = stage.controller(link, &[])?;
    let (mut plant, plant_json) = stage.plant(link, &["--insertion-time", "0.4", "--duration", "0.5"])?;
    let codes = [plant.code(), controller.code()];
    evidence.require(codes == [Some(0); 2], || {
        format!("plant and controller ended with {codes:?}: {} {}", plant.message(), controller.message())
    });
    if let Some(result) = read_json::<ControllerResult>(&json) {
        evidence.unaccounted += unaccounted(&result, read_json::<PlantResult>(&plant_json).as_ref());
        evidence.final_state = (result.accounts.final_state == Some(Mode::Run)).then_some(Mode::Run);
    }
    Ok(())
}

/// Row 36: 100 controllers come and are killed; nothing grows.
pub(crate) fn cycles<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    /// Cycles after which everything has been used once.
    const SETTLED: u64 = 5;
    let repetitions = stage.repetitions(100).max(SETTLED + 5);
    let before = [descriptors("self"), children()];
    let link = stage.link();
    let space = crate::exchange::Space::new(&link)?;
    let (mut plant, _) = stage.plant(&link, &["--keep", "--duration", "600"])?;
    let mut settled = [0; 2];
    let mut now = [0; 2];
    for cycle in 1..=repetitions {
        signals::check()?;
        let (mut controller, record, _) = stage.controller(&link, &[])?;
        let armed = reaches(&record, Mode::Run, &mut controller);
        evidence.require(armed, || format!("cycle {cycle}: no RUN: {}", controller.message()));
        now = [space.traces().len(), plant.descriptors()];
        if cycle == SETTLED {
            settled = now;
        }
        controller.kill();
        let _ = std::fs::remove_file(record);
        evidence.injected += 1;
        evidence.detected += u64::from(armed);
        if plant.wait(ms(0)).is_some() {
            evidence.require(false, || format!("cycle {cycle}: the plant has ended: {}", plant.message()));
            break;
        }
    }
    evidence.require(now == settled, || {
        format!("names in shared memory and descriptors of the plant went from {settled:?} to {now:?}")
    });
    plant.kill();
    drop(plant);
    let (mut last, ..) = stage.controller(&link, &[])?;
    let _ = last.wait(ms(10_000));
    drop(last);
    let left = left_behind(&link)?;
    let left_after = left.len();
    evidence.require(left.is_empty(), || format!("left behind {left:?}"));
    let after = [descriptors("self"), children()];
    evidence.require(before == after, || format!("descriptors and children here went from {before:?} to {after:?}"));
    evidence.notes.push(format!(
        "with a controller: {} names in shared memory and {} descriptors of the plant after cycle {SETTLED}, {} and {} \
         after cycle {repetitions}; names left at the end {left_after}; descriptors and children of this process {before:?} \
         before, {after:?} after",
        settled[0], settled[1], now[0], now[1]
    ));
    Ok(())
}
