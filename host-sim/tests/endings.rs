//! How processes end, and what of them is left: signals are obeyed within a second, children die with their parents, and
//! what is left all the same is swept by the next start.

mod emulator;
mod missing;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Every command ends within a second of a signal.
const ENDS_WITHIN: Duration = Duration::from_secs(1);

fn host_sim() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
}

fn start(arguments: &[&str]) -> Child {
    start_in(&std::env::temp_dir(), arguments)
}

/// The same with another directory for temporary files, where links are.
fn start_in(place: &Path, arguments: &[&str]) -> Child {
    let mut command = host_sim();
    command.env("TMPDIR", place).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn signal(process: u32, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap().success());
}

fn is_alive(process: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{process}/stat")).is_ok_and(|stat| !stat.contains(") Z "))
}

fn wait_for<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + Duration::from_secs(120);
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(Instant::now() < until, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Children of a process, of all its threads.
fn children(process: u32) -> Vec<u32> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let lists = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("children")).ok());
    lists.flat_map(|list| list.split_whitespace().filter_map(|id| id.parse().ok()).collect::<Vec<_>>()).collect()
}

fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ")
}

/// Names in shared memory and directories that contain `part`.
fn traces(part: &str) -> Vec<PathBuf> {
    traces_in(&std::env::temp_dir(), part)
}

fn traces_in(place: &Path, part: &str) -> Vec<PathBuf> {
    let entries = [Path::new("/dev/shm"), place].map(std::fs::read_dir);
    let paths = entries.into_iter().flatten().flatten().flatten().map(|entry| entry.path());
    paths
        .filter(|path| path.to_string_lossy().contains(part) && path.to_string_lossy().contains("stillpoint"))
        .collect()
}

/// Whether a process has a handler for SIGTERM: bit 14 of those that it catches.
fn catches_term(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim();
    u64::from_str_radix(caught, 16).unwrap() & (1 << 14) != 0
}

/// SIGTERM after `after`: exit code 1 with a word, soon. A machine that stood still for a second is asked once more.
fn obeys(arguments: &[&str], after: Duration) {
    let is_soon = (0..2).any(|_| ends_after_term(arguments, after) < ENDS_WITHIN);
    assert!(is_soon, "{arguments:?}: twice not within {ENDS_WITHIN:?}");
}

/// How long a process takes to its end after SIGTERM.
fn ends_after_term(arguments: &[&str], after: Duration) -> Duration {
    let mut child = start(arguments);
    std::thread::sleep(after);
    // A busy machine may not have come to `main` by then, and nothing can be asked of a program before.
    wait_for("it catches SIGTERM", || catches_term(child.id()).then_some(()));
    signal(child.id(), "TERM");
    let asked = Instant::now();
    // Its own end counts: whoever holds its pipes open is another matter.
    wait_for("it goes on", || child.try_wait().unwrap());
    let took = asked.elapsed();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", message(&output));
    assert!(message(&output).contains("SIGTERM"), "{arguments:?}: {}", message(&output));
    took
}

/// One at a time: who polls with real-time priority takes a processor from all others for as long as it does, and a neighbour that is
/// measured meanwhile is late for no fault of its own.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn signals_are_obeyed_at_once_everywhere() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let out = out.to_str().unwrap();
    let millis = Duration::from_millis;
    // The table, the periodic loops, a loop that never sleeps, one that sleeps for 10 s.
    obeys(&["timing", "--seconds", "300"], millis(150));
    obeys(&["timing", "--seconds", "300"], millis(2500));
    obeys(&["timing", "--seconds", "60", "--rate", "100000"], millis(2500));
    obeys(&["timing", "--seconds", "300", "--rate", "0.1"], millis(2500));
    // Placement and table, then the insertions without a controller.
    obeys(&["run", "--out", out, "--quiet"], millis(60));
    obeys(&["run", "--out", out, "--quiet", "--insertion-time", "1000", "--threads", "1"], millis(2500));
    // Random schedules, and rows that wait for processes.
    obeys(&["faults", "--only", "1", "--seeds", "1000000"], millis(2500));
    obeys(&["faults", "--only", "38"], millis(1200));
    for (row, after) in [("33", 2500), ("34", 2500), ("35", 600), ("36", 2500)] {
        obeys(&["faults", "--only", row], millis(after));
    }
    obeys(&["run", "--out", out, "--quiet", "--mode", "free-run", "--insertion-time", "60"], millis(4000));
    let link = format!("test-signals-{}", std::process::id());
    obeys(&["plant", "--link", &link], millis(1500));
    assert!(!Path::new(out).exists());
    assert_eq!(traces(&link), Vec::<PathBuf>::new());
}

#[test]
fn a_plant_to_which_no_controller_comes_leaves_no_older_account() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("plant.json");
    std::fs::write(&json, r#"{"ticks": 7}"#).unwrap();
    let link = format!("test-unserved-{}", std::process::id());
    let plant = start(&["plant", "--link", &link, "--patience", "0.1", "--json", json.to_str().unwrap()]);
    let output = plant.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", message(&output));
    let account: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(account["ticks"], 0);
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let ended = words(account["ended"].as_str().unwrap());
    assert!(ended.contains("no answer from the controller"), "{ended}");
    assert!(words(&message(&output)).contains(&ended), "{ended}: {}", message(&output));
}

#[test]
fn a_polling_peer_dies_with_a_killed_parent() {
    let _alone = alone();
    let mut timing = start(&["timing", "--seconds", "30"]);
    let peer = wait_for("no peer has started", || children(timing.id()).first().copied());
    signal(timing.id(), "KILL");
    timing.wait().unwrap();
    wait_for("the peer goes on without its parent", || (!is_alive(peer)).then_some(()));
}

/// Two that poll with real-time priority at once, two processes each, where there are two processors: whoever spins lets the
/// other's partner run. Without that all four waited for ever, and the machine with them.
#[test]
fn two_that_poll_at_once_both_end() {
    let _alone = alone();
    let mut both = [(); 2].map(|()| start(&["timing", "--rate", "1000", "--seconds", "0.5"]));
    let until = Instant::now() + Duration::from_secs(60);
    while both.iter_mut().any(|child| child.try_wait().unwrap().is_none()) && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(20));
    }
    for mut child in both {
        let ended = child.try_wait().unwrap().is_some();
        children(child.id()).into_iter().for_each(|peer| signal(peer, "KILL"));
        let _ = child.kill();
        let output = child.wait_with_output().unwrap();
        assert!(ended, "it waits for ever: {}", message(&output));
    }
}

#[test]
fn an_emulator_dies_with_its_run() {
    // Without QEMU, or the target for bare metal, there is no emulator.
    if emulator::image(firmware::scalar::ScalarKind::F64).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    for name in ["TERM", "INT", "KILL"] {
        let mut run = start(&[
            "run",
            "--tissue",
            "homogeneous",
            "--controller",
            "qemu",
            "--mode",
            "lockstep",
            "--out",
            out.to_str().unwrap(),
        ]);
        let command = |process: u32| std::fs::read_to_string(format!("/proc/{process}/comm")).unwrap_or_default();
        let emulator = wait_for("no emulator has started", || {
            if let Some(status) = run.try_wait().unwrap() {
                let mut said = String::new();
                std::io::Read::read_to_string(&mut run.stderr.take().unwrap(), &mut said).unwrap();
                panic!("{status} without an emulator: {said}");
            }
            let mut all = children(run.id()).into_iter().flat_map(children);
            all.find(|process| command(*process).starts_with("qemu-system"))
        });
        signal(run.id(), name);
        run.wait().unwrap();
        wait_for("the emulator goes on without its run", || (!is_alive(emulator)).then_some(()));
    }
}

#[test]
fn what_killed_processes_leave_is_swept_by_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    // Its own, where no other test's processes sweep; short, since sockets have short names.
    let place = tempfile::Builder::new().prefix("sw").tempdir_in("/tmp").unwrap();
    let place = place.path();
    let mut run = start_in(
        place,
        &[
            "run",
            "--tissue",
            "homogeneous",
            "--mode",
            "free-run",
            "--rate",
            "200",
            "--insertion-time",
            "60",
            "--threads",
            "1",
            "--quiet",
            "--out",
            out.to_str().unwrap(),
        ],
    );
    let mark = format!("run-{}-", run.id());
    let controller = wait_for("no controller has started", || {
        let child = children(run.id()).first().copied();
        child.filter(|_| traces_in(place, &mark).len() > 5)
    });
    // Neither can tidy up after the other.
    signal(controller, "STOP");
    signal(run.id(), "KILL");
    signal(controller, "KILL");
    run.wait().unwrap();
    wait_for("the controller lives", || (!is_alive(controller)).then_some(()));
    assert!(!traces_in(place, &mark).is_empty());
    let link = format!("test-sweep-{}", std::process::id());
    let next = start_in(place, &["plant", "--link", &link, "--patience", "0.1"]).wait_with_output().unwrap();
    assert_eq!(traces_in(place, &mark), Vec::<PathBuf>::new());
    assert!(message(&next).contains(&mark), "{}", message(&next));
}

#[test]
fn a_process_without_descriptors_removes_nobodys_link() {
    let link = format!("test-descriptors-{}", std::process::id());
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("paper.table");
    let made = host_sim()
        .args(["run", "--tissue", "homogeneous", "--mode", "lockstep", "--insertion-time", "0.2", "--quiet", "--out"])
        .arg(folder.path().join("report"))
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", message(&made));
    let recording = std::fs::read(folder.path().join("report/homogeneous-dynamic.rec")).unwrap();
    let header = host_sim::record::recording::Recording::decode(&recording).unwrap().header;
    std::fs::write(&table, header.table).unwrap();
    let table = table.to_str().unwrap();

    let free_run = ["--mode", "free-run", "--link", &link, "--rate", "500"];
    let world = ["--tissue", "homogeneous", "--plant", "condensed", "--insertion-time", "3"];
    let plant = start(&[&["plant"], &free_run[..], &world].concat());
    let controller = start(&[&["controller", "--table", table], &free_run[..]].concat());
    wait_for("the pair has not met", || (traces(&link).len() > 10).then_some(()));
    std::thread::sleep(Duration::from_millis(500));
    let before = traces(&link).len();
    for limit in 4..16 {
        let program = assert_cmd::cargo::cargo_bin!("host-sim");
        let attack = format!("ulimit -n {limit}; exec {} controller --link {link} --table {table}", program.display());
        let _ = Command::new("sh").args(["-c", &attack]).output().unwrap();
        assert!(traces(&link).len() >= before, "with {limit} descriptors");
    }
    let ends = [plant, controller].map(|child| child.wait_with_output().unwrap());
    for end in &ends {
        assert!(end.status.success(), "{}", message(end));
    }
    assert_eq!(traces(&link), Vec::<PathBuf>::new());
}

/// The table of the paper's scene as a file.
fn paper_table_in(folder: &Path) -> PathBuf {
    let path = folder.join("paper.table");
    let table = host_sim::bench::paper_table::paper_table().unwrap();
    std::fs::write(&path, model_offline::table::to_bytes(&table).unwrap()).unwrap();
    path
}

#[test]
fn a_controller_that_stops_before_run_is_given_up() {
    let link = format!("test-patience-{}", std::process::id());
    let folder = tempfile::tempdir().unwrap();
    let table = paper_table_in(folder.path());
    let free_run = ["--mode", "free-run", "--link", &link, "--rate", "100"];
    let controller = start(&[&["controller", "--table", table.to_str().unwrap()], &free_run[..]].concat());
    // It has opened its side and waits; from here on it says nothing.
    wait_for("the controller is not there", || (traces(&link).len() > 3).then_some(()));
    std::thread::sleep(Duration::from_millis(200));
    signal(controller.id(), "STOP");
    let plant =
        start(&[&["plant", "--plant", "condensed", "--paddle", "3", "--patience", "1"], &free_run[..]].concat());
    let output = plant.wait_with_output().unwrap();
    signal(controller.id(), "KILL");
    controller.wait_with_output().unwrap();
    // It could not leave.
    host_sim::exchange::sweep();
    assert_eq!(traces(&link), Vec::<PathBuf>::new());
    assert_eq!(output.status.code(), Some(1), "{}", message(&output));
    assert!(message(&output).contains("no answer from the controller"), "{}", message(&output));
}

#[test]
fn two_sides_by_hand_compare_their_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let table = paper_table_in(folder.path());
    let text = model_offline::scene::BUNDLED[0].1;
    let scene = folder.path().join("softer.toml");
    std::fs::write(&scene, text.replacen("stiffness = 100.0", "stiffness = 50.0", 1)).unwrap();
    assert_ne!(std::fs::read_to_string(&scene).unwrap(), text);
    for (insist, code) in [(false, 2), (true, 0)] {
        let link = format!("test-scenes-{}-{insist}", std::process::id());
        let mut arguments = vec!["plant", "--link", &link, "--scene", scene.to_str().unwrap(), "--paddle", "3"];
        arguments.extend(["--insertion-time", "0.2", "--plant", "condensed"]);
        if insist {
            arguments.push("--allow-other-scene");
        }
        let plant = start(&arguments);
        let controller = start(&["controller", "--link", &link, "--table", table.to_str().unwrap()]);
        let (plant, _) = (plant.wait_with_output().unwrap(), controller.wait_with_output().unwrap());
        assert_eq!(plant.status.code(), Some(code), "{}", message(&plant));
        assert_eq!(message(&plant).contains("another scene"), !insist, "{}", message(&plant));
    }
}
