//! Rows 37, 38, 41 to 43 and 45: peers that should not be there, do not read, are not who they say, or panic.

use std::os::unix::fs::PermissionsExt;
use std::process::Command;
use std::time::Duration;

use firmware::contract::frames::{MAX_PADDLES, TARGET_VISIBLE};
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, Table, TargetSample};
use firmware::{Faults, Mode};
use iceoryx2::node::NodeBuilder;
use iceoryx2::prelude::{ServiceName, SignalHandlingMode};
use iceoryx2::service::ipc;
use nalgebra::SVector;
use rand_pcg::Pcg64;
use rustix::process::Signal;

use super::stage::{Stage, TIMEOUT, left_behind, ms, pause, read_json, unaccounted, wait_until};
use crate::bench::error::SimError;
use crate::bench::faults::evidence::{Evidence, carries};
use crate::bench::faults::fault::{below, between};
use crate::bench::faults::invariants::positions;
use crate::exchange::{ClockFrame, ClockKind, Departure, PlantPorts, Space};
use crate::record::recording::Recording;
use crate::runtime::controller::process::ControllerResult;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::plant::process::PlantResult;
use crate::runtime::signals;

fn nothing_left(link: &str, evidence: &mut Evidence) -> Result<(), SimError> {
    let left = left_behind(link)?;
    evidence.require(left.is_empty(), || format!("left behind {left:?}"));
    Ok(())
}

/// Takes over the accounts of a controller that the plant has told to stop.
fn close(evidence: &mut Evidence, controller: &std::path::Path, plant: &std::path::Path) -> Option<ControllerResult> {
    let result = read_json::<ControllerResult>(controller);
    let plant = read_json::<PlantResult>(plant);
    evidence.require(result.is_some() && plant.is_some(), || "no accounts were left".to_owned());
    let (result, plant) = (result?, plant?);
    let unaccounted = unaccounted(&result, Some(&plant));
    evidence.unaccounted += unaccounted;
    evidence.require(unaccounted == 0, || format!("{unaccounted} unaccounted"));
    evidence.max_error = Some(evidence.max_error.unwrap_or(0.0).max(plant.largest_error));
    evidence.final_state = result.accounts.final_state;
    Some(result)
}

/// Row 37: a second controller on the same link is refused, and the first does not notice.
pub(crate) fn two_controllers<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let link = stage.link();
    let (mut first, _, json) = stage.controller(&link, &[])?;
    // Many visits: somebody who goes looks dead for a moment, and must not be taken for the first. One takes 25 ms on a
    // quiet machine.
    let visits = stage.repetitions(200);
    let duration = format!("{:.3}", 2.5 + 0.05 * visits as f64);
    let (mut plant, plant_json) = stage.plant(&link, &["--insertion-time", "2", "--duration", &duration])?;
    pause(stage.after_the_start(ms(600)));
    for _ in 0..visits {
        let (mut second, ..) = stage.controller(&link, &[])?;
        let code = second.code();
        let message = second.message();
        let refused = code == Some(1) && message.contains("somebody else already");
        // A loaded machine may not get through all of them in time; how the plant ended is looked at below.
        if !refused && evidence.injected > 0 && plant.wait(Duration::ZERO).is_some() {
            break;
        }
        evidence.injected += 1;
        evidence.detected += u64::from(refused);
        evidence.require(refused, || format!("the second ended with {code:?}: {message}"));
    }
    let codes = [plant.code(), first.code()];
    evidence.require(codes == [Some(0); 2], || format!("plant and first controller ended with {codes:?}"));
    if let Some(result) = close(evidence, &json, &plant_json) {
        // Without a real-time policy a busy machine may have overrun it, which is no effect of the second one.
        let (state, faults) = (evidence.final_state, result.accounts.faults);
        let explained = state != Some(Mode::Safe) || faults.contains(Faults::OVERRUN);
        evidence.require(explained, || format!("the first ended in {state:?}: {faults}"));
        if state != Some(Mode::Run) {
            evidence.notes.push(format!("ended while it waited for samples, or too busy: {faults}"));
        }
    }
    nothing_left(&link, evidence)
}

/// Row 38: a reader that is stopped: the plant's loop goes on, what is overwritten is counted, and the reader goes on
/// with the newest sample.
pub(crate) fn never_reads<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let link = stage.link();
    let (mut controller, _, json) = stage.controller(&link, &[])?;
    let (mut plant, plant_json) = stage.plant(&link, &["--insertion-time", "2.5", "--duration", "3"])?;
    pause(stage.after_the_start(ms(1000)));
    controller.signal(Signal::STOP);
    pause(ms(1000));
    controller.signal(Signal::CONT);
    evidence.injected += 1;
    let codes = [plant.code(), controller.code()];
    evidence
        .require(codes == [Some(0); 2], || format!("plant and controller ended with {codes:?}: {}", plant.message()));
    if let Some(result) = close(evidence, &json, &plant_json) {
        let overwritten = result.accounts.needle.overwritten;
        evidence.detected += u64::from(overwritten > 500);
        evidence.require(overwritten > 500, || format!("only {overwritten} of 1000 samples overwritten"));
        if let Some(plant) = read_json::<PlantResult>(&plant_json) {
            let ran = plant.ticks;
            evidence.require(ran > 2000, || format!("the plant ran {ran} ticks in 3 s: it was blocked"));
            evidence.notes.push(format!("the plant ran {ran} ticks; {overwritten} needle samples overwritten"));
        }
    }
    nothing_left(&link, evidence)
}

/// Row 41: another user can neither read, nor join, nor prepare the place.
pub(crate) fn other_user<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    const NOBODY: [&str; 3] = ["--reuid=65534", "--regid=65534", "--clear-groups"];
    let link = stage.link();
    let (mut controller, ..) = stage.controller(&link, &[])?;
    let (mut plant, _) = stage.plant(&link, &["--duration", "60"])?;
    pause(stage.after_the_start(ms(700)));
    let traces = Space::new(&link)?.traces();
    evidence.require(traces.len() > 5, || format!("only {} names", traces.len()));
    for path in &traces {
        let mode = path.symlink_metadata().map_or(0o777, |metadata| metadata.permissions().mode());
        evidence.require(mode & 0o077 == 0, || format!("{} has mode {mode:o}", path.display()));
    }
    if rustix::process::geteuid().is_root() {
        let as_nobody = |program: &std::path::Path, arguments: &[&str]| -> Result<_, SimError> {
            let mut command = Command::new("setpriv");
            command.args(NOBODY).arg(program).args(arguments);
            stage.start_command(command)
        };
        for path in &traces {
            evidence.injected += 1;
            let mut reader = as_nobody("head".as_ref(), &["-c", "1", &path.to_string_lossy()])?;
            let code = reader.code();
            evidence.detected += u64::from(code == Some(1));
            evidence.require(code == Some(1), || format!("nobody could read {}: {code:?}", path.display()));
        }
        let table = stage.table_file.to_string_lossy().into_owned();
        let mut plant_of_nobody = vec!["plant", "--link", &link, "--patience", "2"];
        plant_of_nobody.extend(stage.plant_arguments());
        for arguments in [vec!["controller", "--table", &table, "--link", &link, "--patience", "2"], plant_of_nobody] {
            evidence.injected += 1;
            let mut intruder = as_nobody(&stage.program, &arguments)?;
            let code = intruder.code();
            let message = intruder.message();
            evidence.detected += u64::from(code == Some(1));
            evidence.require(code == Some(1) && message.contains("another user"), || {
                format!("{} of nobody ended with {code:?}: {message}", arguments[0])
            });
        }
        // The place prepared by somebody else before we come.
        let squatted = stage.link();
        let place = Space::directory_of(&squatted);
        let mut squatter = as_nobody("mkdir".as_ref(), &["-m", "777", &place.to_string_lossy()])?;
        evidence.injected += 1;
        let _ = squatter.code();
        let (mut victim, ..) = stage.controller(&squatted, &[])?;
        let code = victim.code();
        let message = victim.message();
        evidence.detected += u64::from(code == Some(1));
        evidence.require(code == Some(1) && message.contains("another user"), || {
            format!("a foreign directory was used: {code:?}: {message}")
        });
        let _ = std::fs::remove_dir(&place);
    } else {
        evidence.not_run = Some("needs root to become another user; only the permissions were checked".to_owned());
    }
    plant.kill();
    let _ = controller.wait(TIMEOUT);
    nothing_left(&link, evidence)
}

/// A number of any kind: mostly plausible, sometimes any bits at all.
fn any_number(random: &mut Pcg64) -> f64 {
    if below(random, 3) == 0 { f64::from_bits(below(random, u64::MAX)) } else { between(random, -0.1, 0.1) }
}

fn any_u32(random: &mut Pcg64) -> u32 {
    below(random, 1 << 32) as u32
}

/// Row 42: a plant that writes garbage into shared memory: every command keeps the limits, nothing panics.
pub(crate) fn garbage<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut random = Pcg64::new(u128::from(stage.seed), 42);
    for kind_at_end in [ClockKind::Stop as u32, 77] {
        let link = stage.link();
        let space = Space::new(&link)?;
        let outcome = garbage_on(stage, &space, &mut random, kind_at_end, evidence);
        space.leave::<ipc::Service>(Departure::Last);
        outcome?;
        nothing_left(&link, evidence)?;
    }
    Ok(())
}

/// Samples of one tick with numbers of all kinds in all places.
fn garbage_samples<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    tick: u64,
    time_ns: u64,
    random: &mut Pcg64,
) -> (NeedleSample, TargetSample, [Option<PaddleSample>; MAX_PADDLES]) {
    let place = |random: &mut Pcg64| std::array::from_fn(|i| if i < D { any_number(random) } else { 0.0 });
    let time = |random: &mut Pcg64| if below(random, 4) == 0 { below(random, u64::MAX) } else { time_ns };
    let sequence = |random: &mut Pcg64| if below(random, 4) == 0 { any_u32(random) } else { tick as u32 };
    let needle = NeedleSample {
        sequence: sequence(random),
        reserved: any_u32(random),
        time_ns: time(random),
        depth: any_number(random),
        velocity: any_number(random),
    };
    let paddle = |random: &mut Pcg64, index: u32| PaddleSample {
        sequence: sequence(random),
        paddle_index: if below(random, 100) == 0 { any_u32(random) } else { index },
        time_ns: time(random),
        displacement: place(random),
    };
    let mut paddles = [None; MAX_PADDLES];
    paddles[0] = Some(paddle(random, table.paddles[0].index));
    let target = TargetSample {
        sequence: sequence(random),
        flags: any_u32(random) | TARGET_VISIBLE,
        time_ns: time(random),
        displacement: place(random),
    };
    for (sample, known) in paddles.iter_mut().zip(&table.paddles).skip(1) {
        *sample = Some(paddle(random, known.index));
    }
    (needle, target, paddles)
}

/// The witness: how many samples of a tick are garbage, by arithmetic of this bench only.
fn garbage_among(
    tick: u64,
    time_ns: u64,
    needle: &NeedleSample,
    target: &TargetSample,
    paddles: &[Option<PaddleSample>; MAX_PADDLES],
) -> u64 {
    let is_garbage = |number: u32, stamp: u64, values: &[f64]| {
        let plausible = values.iter().all(|value| *value == 0.0 || (value.is_normal() && value.abs() <= 0.1));
        u64::from(number != tick as u32 || stamp != time_ns || !plausible)
    };
    let of_paddle = |paddle: &PaddleSample| is_garbage(paddle.sequence, paddle.time_ns, &paddle.displacement);
    is_garbage(needle.sequence, needle.time_ns, &[needle.depth, needle.velocity])
        + paddles.iter().flatten().map(of_paddle).sum::<u64>()
        + is_garbage(target.sequence, target.time_ns, &target.displacement)
}

fn garbage_on<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    space: &Space,
    random: &mut Pcg64,
    kind_at_end: u32,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    const TICKS: u64 = 5000;
    let mut ports = PlantPorts::<ipc::Service>::open_for(space, P)?;
    let (mut controller, _, json) = stage.controller(space.name(), &["--mode", "lockstep"])?;
    evidence.require(wait_until(TIMEOUT, || ports.has_peer()), || controller.message());
    ports.connect()?;
    let limits = stage.table.paddles.each_ref().map(|paddle| (paddle.max_displacement, paddle.max_rate * 1e-3));
    let mut last: Option<PaddleCommand> = None;
    for tick in 0..TICKS {
        signals::check()?;
        let time_ns = tick * 1_000_000;
        let (needle, target, paddles) = garbage_samples(stage.table, tick, time_ns, random);
        evidence.injected += garbage_among(tick, time_ns, &needle, &target, &paddles);
        ports.needle.send(needle)?;
        ports.send_paddles(&paddles)?;
        ports.target.send(target)?;
        ports.clock.send(ClockFrame::new(ClockKind::Step, tick, time_ns))?;
        let mut answer = None;
        wait_until_spinning(|| {
            answer = ports.command.oldest().ok().flatten();
            answer.is_some()
        });
        let Some(command) = answer else {
            evidence.require(false, || format!("tick {tick}: no answer: {}", controller.message()));
            return Ok(());
        };
        let now: [SVector<f64, D>; P] = positions(&command);
        let within = now.iter().zip(&limits).all(|(now, (most, _))| now.norm() <= most * (1.0 + 1e-9));
        evidence.require(command.tick == tick && within, || format!("tick {tick}: {command:?}"));
        // A command that is not valid is none.
        if let Some(last) = last.filter(|last| last.is_valid() && command.is_valid()) {
            let before: [SVector<f64, D>; P] = positions(&last);
            for ((now, before), (_, most)) in now.iter().zip(&before).zip(&limits) {
                let step = (now - before).norm();
                evidence.require(step <= most * (1.0 + 1e-9), || format!("tick {tick}: step of {step}"));
            }
        }
        last = Some(command);
    }
    ports.clock.send(ClockFrame { kind: kind_at_end, ..ClockFrame::default() })?;
    let code = controller.code();
    let expected = if kind_at_end == ClockKind::Stop as u32 { 0 } else { 1 };
    evidence.require(code == Some(expected), || format!("it ended with {code:?}: {}", controller.message()));
    if let Some(result) = read_json::<ControllerResult>(&json) {
        // Published cannot be known from sequence numbers that are garbage: the ledger must agree with itself.
        evidence.unaccounted += unaccounted(&result, None);
        let accounts = &result.accounts;
        let refused = [&accounts.needle, &accounts.target, &accounts.paddle].into_iter().chain(&accounts.second_paddle);
        evidence.detected += refused.map(|stream| stream.discarded.iter().sum::<u64>()).sum::<u64>();
        evidence.final_state = Some(Mode::Safe);
        evidence.require(result.accounts.final_state == Some(Mode::Safe), || {
            format!("ended in {:?}", result.accounts.final_state)
        });
    }
    evidence.notes = vec!["what is not refused is a sequence number of the past, or plausible by chance".to_owned()];
    Ok(())
}

fn wait_until_spinning(mut condition: impl FnMut() -> bool) {
    let until = std::time::Instant::now() + Duration::from_secs(5);
    while !condition() && std::time::Instant::now() < until && signals::check().is_ok() {
        std::hint::spin_loop();
    }
}

/// Row 43: a service of the same name and size with another type is refused.
pub(crate) fn other_layout<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let link = stage.link();
    let space = Space::new(&link)?;
    let setup = |what: String| RuntimeError::Protocol { peer: Role::Controller, what };
    {
        let node = NodeBuilder::new()
            .config(space.config())
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| setup(error.to_string()))?;
        let name: ServiceName = "needle".try_into().map_err(|_| setup("service name".to_owned()))?;
        // 32 bytes aligned to 8 as the needle's frame, but not that frame.
        let _service = node
            .service_builder(&name)
            .publish_subscribe::<[u64; 4]>()
            .max_publishers(1)
            .max_subscribers(1)
            .max_nodes(4)
            .create()
            .map_err(|error| setup(error.to_string()))?;
        for side in ["controller", "plant"] {
            let mut process = if side == "plant" {
                stage.plant(&link, &["--duration", "1"])?.0
            } else {
                stage.controller(&link, &[])?.0
            };
            evidence.injected += 1;
            let code = process.code();
            let message = process.message();
            let refused = code == Some(1) && message.contains("`needle`");
            evidence.detected += u64::from(refused);
            evidence.require(refused, || format!("the {side} ended with {code:?}: {message}"));
        }
    }
    space.leave::<ipc::Service>(Departure::Last);
    nothing_left(&link, evidence)
}

/// Row 45: a panic in the step: from that tick on the watchdog answers SAFE where the paddle was.
pub(crate) fn panic_in_step<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    for tick in [0, 700u64] {
        let link = stage.link();
        let panic_at = tick.to_string();
        let (mut controller, record, json) = stage.controller(&link, &["--panic-at", &panic_at])?;
        let (mut plant, plant_json) = stage.plant(&link, &["--keep", "--insertion-time", "1", "--duration", "1.5"])?;
        // A controller that panics before RUN never starts the needle: the plant gives up by itself.
        let plant_code = plant.code();
        evidence.require(plant_code == Some(if tick == 0 { 1 } else { 0 }), || format!("plant: {plant_code:?}"));
        evidence.injected += 1;
        let code = controller.code();
        evidence.require(code.is_some(), || format!("the controller ended with {code:?}: {}", controller.message()));
        if tick > 0 {
            close(evidence, &json, &plant_json);
        }
        let bytes = std::fs::read(&record).unwrap_or_default();
        let records = Recording::growing(&bytes).map(|recording| recording.records).unwrap_or_default();
        let place = records.iter().position(|record| record.tick.inputs.tick >= tick);
        let after = place.map_or(&[] as &[_], |place| &records[place..]);
        let before = place.and_then(|place| place.checked_sub(1)).map(|place| records[place].tick.command);
        let watchdog = after.iter().all(|record| {
            let command = &record.tick.command;
            let kept = before.is_none_or(|before| before.displacement == command.displacement);
            command.state == Mode::Safe as u32 && Faults::from_bits(command.faults).contains(Faults::WATCHDOG) && kept
        });
        let seen = !after.is_empty() && watchdog;
        evidence.require(seen, || format!("panic in tick {tick}: {} commands after it, not all SAFE", after.len()));
        evidence.detected += u64::from(seen);
        // The witness is what the process said; the control, the ticks before it.
        let message = controller.message();
        evidence.require(message.contains("panic on purpose"), || format!("no panic: {message}"));
        let early = records.iter().take(place.unwrap_or(0));
        let alarms = early.filter(|record| carries(Faults::WATCHDOG)(&record.tick.command)).count();
        evidence.require(alarms == 0, || format!("panic in tick {tick}: {alarms} commands of the watchdog before it"));
        let answered = after.first().map(|record| record.tick.inputs.tick - tick + 1);
        evidence.ticks_to_detect = evidence.ticks_to_detect.max(answered);
        nothing_left(&link, evidence)?;
    }
    evidence.final_state = Some(Mode::Safe);
    Ok(())
}
