//! Rows 39, 40 and 44: memory and disk that are full or taken away.

use std::process::Command;

use firmware::Mode;
use rustix::process::Signal;

use super::deaths::reaches;
use super::stage::{Process, Stage, left_behind, ms, pause, read_json, unaccounted};
use crate::bench::error::SimError;
use crate::bench::faults::evidence::Evidence;
use crate::exchange::Space;
use crate::record::error::FileError;
use crate::runtime::controller::process::ControllerResult;
use crate::runtime::plant::process::PlantResult;

/// Runs a script in a mount namespace of its own: as root, or where ordinary users may make one.
fn in_own_namespace<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    script: &str,
) -> Result<Process, SimError> {
    let mut command = Command::new("unshare");
    if rustix::process::geteuid().is_root() {
        command.arg("--mount");
    } else {
        command.args(["--user", "--map-root-user", "--mount"]);
    }
    command.args(["sh", "-c", script]);
    stage.start_command(command)
}

/// Whether a small file system can be mounted here.
fn can_mount<const D: usize, const N: usize, const P: usize>(stage: &Stage<'_, D, N, P>) -> Result<bool, SimError> {
    let probe = in_own_namespace(stage, "mount -t tmpfs -o size=64k tmpfs /dev/shm");
    Ok(probe.is_ok_and(|mut probe| probe.code() == Some(0)))
}

/// Row 39: shared memory that is full is an error at the start; memory that fills up later does not reach the loop.
pub(crate) fn memory_full<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    if !can_mount(stage)? {
        evidence.not_run = Some("needs root, or a user namespace, to mount a small tmpfs".to_owned());
        return Ok(());
    }
    // Both processes in the namespace; their exit codes in words, so that a signal (128 and more) is seen.
    let pair = |size: &str, more: &str| {
        let (program, link) = (stage.program.display(), stage.link());
        let common = format!("--mode free-run --link {link} --patience {}", stage.patience());
        let plant = stage.plant_arguments().collect::<Vec<_>>().join(" ");
        format!(
            "mount -t tmpfs -o size={size} tmpfs /dev/shm || exit 3; {more} \
             {program} controller {common} --table {} & c=$!; \
             {program} plant {common} {plant} --insertion-time 1.5 --duration 2; p=$?; wait $c; \
             echo codes $p $?. >&2",
            stage.table_file.display(),
        )
    };
    // The control: with room, both go through.
    let mut process = in_own_namespace(stage, &pair("64m", ""))?;
    let ended = process.code().is_some();
    let message = process.message();
    evidence.require(ended && message.contains("codes 0 0."), || format!("64m: {message}"));
    for size in ["4k", "64k", "256k", "1m", "2m", "4000k"] {
        let mut process = in_own_namespace(stage, &pair(size, ""))?;
        evidence.injected += 1;
        let ended = process.code().is_some();
        let message = process.message();
        let refused = ended && message.contains("codes 1 1.") && message.contains("shared memory");
        evidence.detected += u64::from(refused);
        evidence.require(refused, || format!("{size}: {message}"));
    }
    // Filled up to the last page in the middle of things.
    let after_s = stage.after_the_start(ms(800)).as_secs_f64();
    let fill = format!("(sleep {after_s:.3}; dd if=/dev/zero of=/dev/shm/filler bs=4k) &");
    let mut process = in_own_namespace(stage, &pair("8m", &fill))?;
    evidence.injected += 1;
    let ended = process.code().is_some();
    let message = process.message();
    let went_on = ended && message.contains("codes 0 0.") && message.contains("No space left");
    evidence.detected += u64::from(went_on);
    evidence.require(went_on, || format!("filled up later: {message}"));
    Ok(())
}

/// Row 40: the files are deleted under it: the loop goes on, and without a plant it is SAFE.
pub(crate) fn file_deleted<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let link = stage.link();
    let (mut controller, record, json) = stage.controller(&link, &[])?;
    let (mut plant, _) = stage.plant(&link, &["--duration", "60"])?;
    let armed = reaches(&record, Mode::Run, &mut controller);
    evidence.require(armed, || format!("no RUN: {}", controller.message()));
    let space = Space::new(&link)?;
    for path in space.traces() {
        let removed = if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        evidence.injected += u64::from(removed.is_ok());
    }
    let kept = space.traces();
    evidence.require(kept.is_empty() && evidence.injected > 0, || format!("still there: {kept:?}"));
    let records = || {
        let bytes = std::fs::read(&record).unwrap_or_default();
        crate::record::recording::Recording::growing(&bytes).map(|recording| recording.records).unwrap_or_default()
    };
    let before = records().len();
    pause(ms(500));
    let now = records();
    let running = now.last().is_some_and(|record| record.tick.command.state == Mode::Run as u32);
    let went_on = now.len() > before + 200 && running;
    evidence
        .require(went_on, || format!("{} ticks in 500 ms after the deletion, in RUN: {running}", now.len() - before));
    plant.kill();
    pause(ms(700));
    // Its marks are gone, so that nobody can tell that the plant is dead; the age of its samples can.
    controller.signal(Signal::TERM);
    let code = controller.code();
    evidence.require(code == Some(1), || format!("ended with {code:?}: {}", controller.message()));
    let result = read_json::<ControllerResult>(&json);
    evidence.require(result.is_some(), || "no accounts were left".to_owned());
    if let Some(result) = result {
        let safe = result.accounts.final_state == Some(Mode::Safe);
        evidence.require(safe, || format!("ended in {:?}", result.accounts.final_state));
        evidence.unaccounted += unaccounted(&result, None);
        evidence.final_state = safe.then_some(Mode::Safe);
        evidence.detected += if went_on && safe { evidence.injected } else { 0 };
    }
    let left = left_behind(&link)?;
    evidence.require(left.is_empty(), || format!("left behind {left:?}"));
    Ok(())
}

/// Row 44: the disk of the log is full: the loop does not notice, what is lost is counted.
pub(crate) fn disk_full<const D: usize, const N: usize, const P: usize>(
    stage: &Stage<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let small = stage.path("small");
    std::fs::create_dir(&small).map_err(FileError::write(&small))?;
    let mut places = vec![("/dev/full".to_owned(), String::new())];
    if can_mount(stage)? {
        let mount = format!("mount -t tmpfs -o size=128k tmpfs {} && exec", small.display());
        places.push((small.join("log.rec").display().to_string(), mount));
    } else {
        evidence.notes.push("no small tmpfs could be mounted: /dev/full only".to_owned());
    }
    for (place, mount) in places {
        let what = || place.clone();
        let link = stage.link();
        let json = stage.path("controller.json");
        let command = format!(
            "{} controller --mode free-run --link {link} --patience {} --table {} --json {} --record {place}",
            stage.program.display(),
            stage.patience(),
            stage.table_file.display(),
            json.display()
        );
        let mut controller = if mount.is_empty() {
            stage.start(&command.split(' ').skip(1).collect::<Vec<_>>())?
        } else {
            in_own_namespace(stage, &format!("{mount} {command}"))?
        };
        let (mut plant, plant_json) = stage.plant(&link, &["--insertion-time", "1.5", "--duration", "2"])?;
        let codes = [plant.code(), controller.code()];
        evidence.require(codes == [Some(0); 2], || {
            format!("{}: plant and controller ended with {codes:?}: {}", what(), controller.message())
        });
        let result = read_json::<ControllerResult>(&json);
        let plant = read_json::<PlantResult>(&plant_json);
        evidence.require(result.is_some() && plant.is_some(), || format!("{}: no accounts", what()));
        let (Some(result), Some(plant)) = (result, plant) else { continue };
        evidence.unaccounted += unaccounted(&result, Some(&plant));
        evidence.max_error = Some(evidence.max_error.unwrap_or(0.0).max(plant.largest_error));
        let record = result.accounts.record.clone().unwrap_or_default();
        let lost = record.lost_in_ring + record.lost_on_disk;
        evidence.injected += record.offered;
        evidence.detected += lost + record.written;
        evidence.require(lost > 1000 && record.error.is_some(), || format!("{}: {record:?}", what()));
        // Where it ends depends on who stops first; nearly all of the time it must have been in RUN.
        let ticks = result.accounts.ticks;
        evidence.require(2 * ticks.run > ticks.due, || format!("{}: {ticks:?}", what()));
        evidence.final_state = Some(Mode::Run);
        evidence.notes.push(format!("{place}: {} of {} ticks written, {lost} lost", record.written, record.offered));
        let left = left_behind(&link)?;
        evidence.require(left.is_empty(), || format!("{}: left behind {left:?}", what()));
    }
    Ok(())
}
