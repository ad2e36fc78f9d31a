//! Plant and controller as two processes over real shared memory, with short insertions.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use host_sim::bench::result::RunResult;
use host_sim::record::recording::Recording;
use host_sim::report::directory::read_run;
use serde_json::Value;

fn host_sim() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
}

fn run(out: &Path, extra: &[&str]) -> Output {
    host_sim()
        .args(["run", "--tissue", "homogeneous", "--quiet"])
        .args(["--insertion-time", "0.4", "--duration", "0.5", "--out"])
        .arg(out)
        .args(extra)
        .output()
        .unwrap()
}

fn succeeded(output: &Output) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {stderr}", output.status);
}

/// Every file of ours in shared memory and in the directory for temporary files that belongs to `process`.
fn left_behind(process: u32) -> Vec<PathBuf> {
    let ours = format!("run-{process}-");
    ["/dev/shm".into(), std::env::temp_dir()]
        .into_iter()
        .flat_map(|directory: PathBuf| std::fs::read_dir(directory).into_iter().flatten())
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.to_string_lossy().contains(&ours))
        .collect()
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_replays() {
    let folder = tempfile::tempdir().unwrap();
    let recordings: Vec<Vec<u8>> = ["a", "b", "c"]
        .iter()
        .map(|name| {
            let out = folder.path().join(name);
            let seed = if *name == "c" { "8" } else { "7" };
            succeeded(&run(&out, &["--mode", "lockstep", "--seed", seed]));
            std::fs::read(out.join("homogeneous-dynamic.rec")).unwrap()
        })
        .collect();
    assert!(recordings[0] == recordings[1], "same seed");
    assert!(recordings[0] != recordings[2], "another seed");

    let path = folder.path().join("a/homogeneous-dynamic.rec");
    let replayed = host_sim().arg("replay").arg(&path).output().unwrap();
    succeeded(&replayed);

    // A command altered under a whole chain is found by the replay.
    let mut forged = Recording::decode(&recordings[0]).unwrap();
    let record = &mut forged.records[300];
    record.tick.command.displacement[0][0] += f64::EPSILON;
    std::fs::write(&path, forged.encode()).unwrap();
    let replayed = host_sim().arg("replay").arg(&path).output().unwrap();
    assert_eq!(replayed.status.code(), Some(1));
    let message = String::from_utf8_lossy(&replayed.stderr).replace(['\n', '│'], " ");
    assert!(message.contains("1 of"), "{message}");

    std::fs::write(&path, &recordings[0][..5000]).unwrap();
    let replayed = host_sim().arg("replay").arg(&path).output().unwrap();
    assert_eq!(replayed.status.code(), Some(2), "cut off");
}

/// A record of a recording and its hash, as the format has them.
const RECORD_BYTES: usize = 384 + 32;

/// A recording that is damaged is refused, and says how its first part can be had; that part replays and is exported.
#[test]
fn a_damaged_recording_is_salvaged_up_to_the_damage() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    succeeded(&run(&out, &["--mode", "lockstep"]));
    let (recording, csv) = (out.join("homogeneous-dynamic.rec"), folder.path().join("ticks.csv"));
    let whole = std::fs::read(&recording).unwrap();
    // As the run counted them, not as they are read.
    let ledger = read_run(&out).unwrap().cases[0].strategies.dynamic.as_ref().unwrap().ledger.clone().unwrap();
    let ticks = usize::try_from(ledger.ticks.due).unwrap();
    let mut altered = whole.clone();
    let place = altered.len() - 101 * RECORD_BYTES + 40;
    altered[place] ^= 1;
    let salvaged = |arguments: &[&str]| host_sim().args(arguments).arg(&recording).output().unwrap();
    let csv_of = csv.to_str().unwrap();
    for (bytes, kept, damage) in [
        (&whole[..whole.len() - 1], ticks, "without an end mark"),
        (&whole[..whole.len() - 50 * RECORD_BYTES - 7], ticks - 50, "without an end mark"),
        (&altered[..], ticks - 100, "the chain breaks at record"),
    ] {
        std::fs::write(&recording, bytes).unwrap();
        for command in [&["replay"][..], &["export", "--csv", csv_of]] {
            let refused = salvaged(command);
            let said = String::from_utf8_lossy(&refused.stderr).into_owned();
            assert_eq!(refused.status.code(), Some(2), "{said}");
            assert!(said.contains("--salvage") && !csv.exists(), "{said}");
        }
        let replayed = salvaged(&["replay", "--salvage"]);
        succeeded(&replayed);
        let said = String::from_utf8_lossy(&replayed.stdout).into_owned();
        assert!(said.contains(damage) && said.contains(&format!("{kept} of {kept} commands agree")), "{said}");
        succeeded(&salvaged(&["export", "--salvage", "--csv", csv_of]));
        assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), kept + 1);
        std::fs::remove_file(&csv).unwrap();
    }
    // Without a single whole record there is nothing to salvage.
    std::fs::write(&recording, &whole[..whole.len() - (ticks + 1) * RECORD_BYTES]).unwrap();
    for command in [&["replay"][..], &["replay", "--salvage"]] {
        let refused = salvaged(command);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains("record again") && !said.contains("--salvage"), "{said}");
    }
    // Salvage of a whole one is a replay like any other.
    std::fs::write(&recording, &whole).unwrap();
    let replayed = salvaged(&["replay", "--salvage"]);
    succeeded(&replayed);
    assert!(!String::from_utf8_lossy(&replayed.stdout).contains("damaged"));
}

#[test]
fn both_modes_account_for_everything() {
    let folder = tempfile::tempdir().unwrap();
    for mode in ["lockstep", "free-run"] {
        let out = folder.path().join(mode);
        succeeded(&run(&out, &["--mode", mode]));
        let result = read_run(&out).unwrap();
        // Other programs find the controlled paddle under one name, whatever drove its time.
        let written: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
        let written = &written["cases"][0]["strategies"];
        assert!(written["dynamic"]["mode"] == mode && written["dynamic_free_run"].is_null(), "{mode}");
        let strategies = &result.cases[0].strategies;
        assert_eq!(
            (strategies.dynamic.is_some(), strategies.dynamic_free_run.is_some()),
            (mode == "lockstep", mode != "lockstep")
        );
        // As older versions wrote it.
        let mut older: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
        if mode == "free-run" {
            let strategies = older["cases"][0]["strategies"].as_object_mut().unwrap();
            let dynamic = strategies.insert("dynamic".to_owned(), Value::Null).unwrap();
            strategies.insert("dynamic_free_run".to_owned(), dynamic);
        }
        assert!(serde_json::from_value::<RunResult>(older).unwrap() == result);
        let dynamic = strategies.dynamic.as_ref().or(strategies.dynamic_free_run.as_ref()).unwrap();
        let ledger = dynamic.ledger.as_ref().unwrap();
        assert_eq!(ledger.unaccounted, 0, "{ledger:?}");
        assert!(ledger.ticks.due >= 500);
        assert_eq!(mode == "free-run", dynamic.timing.is_some());
        std::fs::remove_file(out.join("report.html")).unwrap();
        let pictures = out.join("figures");
        succeeded(&host_sim().arg("report").arg(&out).arg("--svg-dir").arg(&pictures).output().unwrap());
        assert!(out.join("report.html").is_file());
        assert!(pictures.join("scene.svg").is_file());
        assert_eq!(mode == "free-run", pictures.join("timing-histogram.svg").is_file());
        assert!(dynamic.frames.len() > 2, "the report's slider needs the body along the way");
        // The pictures' states are solved once more in full: the last one is the run's own end. On a machine that is too
        // busy for the full model in free-run the reduced one has run.
        let close = if dynamic.plant.full_step_us.is_some() { 1e-3 } else { 1e-6 };
        let end = dynamic.frames.last().unwrap().nodes.iter().zip(&dynamic.deformed_nodes);
        assert!(end.into_iter().all(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) < close), "{:?}", dynamic.plant);
    }
}

/// A run that goes on until it is killed, and its controller.
fn endless(out: &Path) -> (Child, u32) {
    let mut plant = host_sim()
        .args(["run", "--tissue", "homogeneous", "--quiet"])
        .args(["--mode", "free-run", "--duration", "60", "--threads", "1"])
        .args(["--rate", "500", "--insertion-time", "1", "--out"])
        .arg(out)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let children = format!("/proc/{0}/task/{0}/children", plant.id());
    let until = Instant::now() + Duration::from_secs(120);
    loop {
        let found = std::fs::read_to_string(&children).unwrap_or_default();
        if let Some(controller) = found.split_whitespace().next() {
            // In the middle of things: after the handshake.
            std::thread::sleep(Duration::from_millis(300));
            return (plant, controller.parse().unwrap());
        }
        assert!(Instant::now() < until, "the controller has not started");
        assert!(plant.try_wait().unwrap().is_none(), "the plant has ended");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn signal(process: u32, name: &str) {
    let status = Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap();
    assert!(status.success());
}

fn wait_until_gone(process: u32) {
    let until = Instant::now() + Duration::from_secs(30);
    // A zombie has ended as well; who reaps it is not ours to say.
    let alive = || std::fs::read_to_string(format!("/proc/{process}/stat")).is_ok_and(|stat| !stat.contains(") Z "));
    while alive() {
        assert!(Instant::now() < until, "process {process} goes on");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_killed_controller_ends_the_run_with_a_message_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    for name in ["KILL", "TERM"] {
        let (plant, controller) = endless(&out);
        let id = plant.id();
        signal(controller, name);
        let output = plant.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("controller process has died"), "{message}");
        assert_eq!(left_behind(id), Vec::<PathBuf>::new());
        assert!(!out.exists(), "no report of a void run");
    }
}

#[test]
fn a_killed_plant_leaves_nothing_and_its_controller_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let (mut plant, controller) = endless(&folder.path().join("report"));
    let id = plant.id();
    signal(id, "KILL");
    let mut stderr = plant.stderr.take().unwrap();
    plant.wait().unwrap();
    wait_until_gone(controller);
    let mut message = String::new();
    std::io::Read::read_to_string(&mut stderr, &mut message).unwrap();
    assert!(message.contains("plant process has died"), "{message}");
    assert_eq!(left_behind(id), Vec::<PathBuf>::new());
}

#[test]
fn ctrl_c_ends_both() {
    let folder = tempfile::tempdir().unwrap();
    let (plant, controller) = endless(&folder.path().join("report"));
    let id = plant.id();
    signal(id, "INT");
    let output = plant.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(message.contains("Ctrl-C"), "{message}");
    wait_until_gone(controller);
    assert_eq!(left_behind(id), Vec::<PathBuf>::new());
}

#[test]
fn bad_input_has_exit_code_2_and_no_output() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let table = folder.path().join("bad.table");
    std::fs::write(&table, b"no table").unwrap();
    let table = table.to_str().unwrap();
    let bad: [&[&str]; 6] = [
        &["--scene", "no-such-scene.toml"],
        &["--rate", "-5"],
        &["--noise", "nan"],
        &["--table", table],
        &["--target-rate", "5000"],
        &["--insertion-time", "0"],
    ];
    for extra in bad {
        let output =
            host_sim().args(["run", "--tissue", "homogeneous", "--out"]).arg(&out).args(extra).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{extra:?}: {message}");
        assert!(!message.is_empty() && !out.exists());
    }
}

#[test]
fn two_terminals_find_each_other_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    succeeded(&run(&out, &["--mode", "lockstep"]));
    let recording = std::fs::read(out.join("homogeneous-dynamic.rec")).unwrap();
    let table = folder.path().join("paper.table");
    std::fs::write(&table, Recording::decode(&recording).unwrap().header.table).unwrap();
    for (i, plant_first) in [true, false].into_iter().enumerate() {
        let link = format!("hand-{}-{i}", std::process::id());
        let plant = || {
            host_sim()
                .args(["plant", "--tissue", "homogeneous", "--link", &link])
                .args(["--insertion-time", "0.4", "--duration", "0.5"])
                .stdout(Stdio::null())
                .spawn()
                .unwrap()
        };
        let controller = || {
            host_sim()
                .args(["controller", "--link", &link, "--table"])
                .arg(&table)
                .stdout(Stdio::null())
                .spawn()
                .unwrap()
        };
        let (mut first, mut second) = if plant_first {
            let first = plant();
            std::thread::sleep(Duration::from_millis(200));
            (first, controller())
        } else {
            let first = controller();
            std::thread::sleep(Duration::from_millis(200));
            (first, plant())
        };
        assert!(first.wait().unwrap().success());
        assert!(second.wait().unwrap().success());
        let root = std::env::temp_dir().join(format!("stillpoint-{link}"));
        assert!(!root.exists(), "nothing stays behind");
    }
}

/// What somebody does about a controller in SAFE.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Operator {
    Waits,
    Rearms,
}

/// A controller in free-run whose plant is stopped for a while: its last mode and its recording.
fn after_a_stopped_plant(folder: &Path, operator: Operator) -> (String, Recording) {
    let link = format!("rearm-{}-{operator:?}", std::process::id());
    let [table, record, json] = ["own.table", "controller.rec", "controller.json"].map(|name| folder.join(name));
    // The record of another run would be long enough at once.
    let _ = std::fs::remove_file(&record);
    let common = ["--link", &link, "--mode", "free-run", "--rate", "200", "--patience", "20"];
    let mut controller = host_sim();
    controller.arg("controller").args(common).arg("--table").arg(&table).stdout(Stdio::null());
    let mut controller = controller.arg("--record").arg(&record).arg("--json").arg(&json).spawn().unwrap();
    let mut plant = host_sim();
    plant.arg("plant").args(common).args(["--tissue", "homogeneous", "--paddle", "3", "--insertion-time", "6"]);
    let mut plant = plant.stdout(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    // Until the record has grown by some ticks in RUN.
    while std::fs::metadata(&record).map_or(0, |metadata| metadata.len()) < 100_000 {
        assert!(started.elapsed() < Duration::from_secs(60), "nothing is recorded");
        std::thread::sleep(Duration::from_millis(20));
    }
    signal(plant.id(), "STOP");
    std::thread::sleep(Duration::from_millis(1500));
    signal(plant.id(), "CONT");
    std::thread::sleep(Duration::from_millis(300));
    if operator == Operator::Rearms {
        succeeded(&host_sim().arg("rearm").arg(controller.id().to_string()).output().unwrap());
    }
    assert!(plant.wait().unwrap().success() && controller.wait().unwrap().success());
    let accounts: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    succeeded(&host_sim().arg("replay").arg(&record).output().unwrap());
    (accounts["handover"]["final_state"].to_string(), Recording::read(&record).unwrap())
}

#[test]
fn a_controller_leaves_safe_when_somebody_rearms_it_and_not_before() {
    use firmware::Mode;
    let folder = tempfile::tempdir().unwrap();
    let scene = model_offline::scene::Scene::bundled("paper").unwrap();
    let (model, _) = model_offline::placement::discretise(&scene.without_inclusions()).unwrap();
    let options = model_offline::table::TableOptions { knots: 3, ..Default::default() };
    let table = model_offline::table::build(&model, 3, &options).unwrap();
    std::fs::write(folder.path().join("own.table"), model_offline::table::to_bytes(&table).unwrap()).unwrap();
    for operator in [Operator::Waits, Operator::Rearms] {
        let (last, recording) = after_a_stopped_plant(folder.path(), operator);
        let modes: Vec<u32> = recording.records.iter().map(|record| record.tick.command.state).collect();
        let safe = modes.iter().position(|mode| *mode == Mode::Safe as u32).expect("the ages lead to SAFE");
        assert!(modes[..safe].contains(&(Mode::Run as u32)));
        let runs_again = modes[safe..].contains(&(Mode::Run as u32));
        assert_eq!(runs_again, operator == Operator::Rearms, "{operator:?}: final state {last}");
    }
}

#[test]
fn only_a_controller_can_be_rearmed() {
    // This process is none, and must not die of the attempt.
    let refused = host_sim().arg("rearm").arg(std::process::id().to_string()).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("no controller"));
}
