//! A stop of a second must be in the figures whole: about a thousand misses at 1 kHz, and about a second late.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use host_sim::bench::rounds::MeasuredLoop;
use host_sim::bench::timing::{BlockResult, TimingResult};
use host_sim::report::directory::read_run;
use host_sim::runtime::time::durations::{Distribution, LoopTiming};

const STOP: Duration = Duration::from_secs(1);

/// Loops at the same time would measure each other.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

fn host_sim() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
}

fn signal(process: u32, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap().success());
}

/// How often the process has waited for something so far.
fn waits(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("voluntary_ctxt_switches"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}

/// Stops a process for a second once it has run a loop at 1 kHz for `windows` times 60 ms: such a loop waits once every
/// period, and whoever waits for a peer does not for so long.
fn stop_in_the_loop(child: &mut Child, windows: u32) {
    let until = Instant::now() + Duration::from_secs(120);
    let mut seen = 0;
    while seen < windows {
        let before = waits(child.id());
        std::thread::sleep(Duration::from_millis(60));
        seen = if waits(child.id()) - before > 30 { seen + 1 } else { 0 };
        assert!(Instant::now() < until && child.try_wait().unwrap().is_none(), "no loop in sight");
    }
    signal(child.id(), "STOP");
    std::thread::sleep(STOP);
    signal(child.id(), "CONT");
}

/// The figures that say most about a stop: misses, and the largest lateness, s.
fn worst<'t>(timings: impl IntoIterator<Item = &'t LoopTiming>) -> (u64, f64) {
    let worst = timings.into_iter().max_by_key(|timing| timing.release_lateness.max_ns).unwrap();
    assert_eq!(worst.release_lateness.count, worst.ticks + worst.skipped, "an entry for every release");
    assert_eq!(worst.response_time.count, worst.release_lateness.count);
    assert!(worst.deadline_misses >= worst.skipped);
    (worst.deadline_misses, worst.release_lateness.max_ns as f64 * 1e-9)
}

/// Time that the host has taken away from this machine since boot, ms: the kernel's own count, not the program's.
fn stolen_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/stat").unwrap();
    10.0 * text.lines().next().unwrap().split_whitespace().nth(8).unwrap().parse::<f64>().unwrap()
}

/// Whatever was measured is written; that every round of a comparison is void is no fault of the program where the host
/// did take the time away.
fn measured_or_stolen(output: &Output, since: Instant, stolen_before_ms: f64) {
    let said = String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ");
    if !output.status.success() {
        assert!(said.contains("rounds of the measurement") && said.contains("void"), "{said}");
        let (stolen_ms, elapsed_ms) = (stolen_ms() - stolen_before_ms, 1e3 * since.elapsed().as_secs_f64());
        assert!(stolen_ms > 0.01 * elapsed_ms, "{stolen_ms} ms of {elapsed_ms} ms were taken away: {said}");
    }
}

fn read_timing(path: &Path) -> TimingResult {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn timing_finds_a_stop_of_a_second() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("timing.json");
    let (start, stolen_before_ms) = (Instant::now(), stolen_ms());
    let mut child = host_sim()
        .args(["timing", "--seconds", "15", "--priority", "0", "--json"])
        .arg(&json)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Twice: between two blocks, where nothing is measured, one of them may be lost.
    for _ in 0..2 {
        stop_in_the_loop(&mut child, 5);
    }
    measured_or_stolen(&child.wait_with_output().unwrap(), start, stolen_before_ms);
    let result = read_timing(&json);
    let outside = result.blocks.iter().flat_map(|block| &block.outside_run);
    let (misses, lateness_s) = worst([&result.empty, &result.controller, &result.exchange].into_iter().chain(outside));
    assert!(misses >= 900, "{misses} misses");
    assert!((0.9..60.0).contains(&lateness_s), "largest lateness {lateness_s} s");
}

#[test]
fn timing_measures_in_run_and_says_where_not() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("timing.json");
    let (start, stolen_before_ms) = (Instant::now(), stolen_ms());
    let output =
        host_sim().args(["timing", "--seconds", "3", "--priority", "0", "--json"]).arg(&json).output().unwrap();
    measured_or_stolen(&output, start, stolen_before_ms);
    let text = String::from_utf8(output.stdout).unwrap();
    let result = read_timing(&json);
    for (ledger, timing) in [(result.ledger, &result.controller), (result.exchange_ledger, &result.exchange)] {
        assert_eq!(ledger.unaccounted, 0, "{ledger:?}");
        assert_eq!(ledger.run, timing.ticks, "the headline is RUN");
        assert_eq!(timing.mode, Some(firmware::Mode::Run));
        assert!(ledger.due >= 1000);
        // A machine that stops the loop for long may end RUN; the rounds in which it did are named.
        let left = ledger.hold + ledger.safe > 0;
        assert!(!left || text.contains("VOID"), "{ledger:?}\n{text}");
        assert!(left || ledger.run + ledger.skipped == ledger.due);
        assert!(ledger.run > 0);
    }
    assert!(text.contains("RUN: wake latency"), "{text}");
    // Fewer than 10,000 values say nothing about one in 10,000.
    assert_eq!(result.controller.release_lateness.p9999_ns, None);
    assert!(
        result.step.p9999_ns.is_some()
            || result.left_run.iter().any(|left| left.measurement == MeasuredLoop::BackToBack)
    );
}

/// As a bench script calls it: cyclictest's options, its histogram with every release, and an exit code.
#[test]
fn timing_fits_into_a_bench_script() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let (json, histogram) = (folder.path().join("timing.json"), folder.path().join("lateness.txt"));
    let timing = |limit: &str| {
        let mut command = host_sim();
        command.args(["timing", "-i", "2000", "-D", "1", "-p", "0", "--max-lateness", limit, "--json"]).arg(&json);
        command.arg("--histogram").arg(&histogram).output().unwrap()
    };
    let output = timing("0");
    let said = String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ");
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("µs late") && said.contains("--max-lateness"), "{said}");
    let result = read_timing(&json);
    assert!((result.empty.rate_hz - 500.0).abs() < 1e-9);
    let text = std::fs::read_to_string(&histogram).unwrap();
    let rows = text.lines().filter(|line| !line.starts_with('#'));
    let rows: Vec<Vec<u64>> = rows.map(|row| row.split('\t').map(|n| n.parse().unwrap()).collect()).collect();
    let counted = |column: usize| rows.iter().map(|row| row[column]).sum::<u64>();
    let due = [result.empty.release_lateness.count, result.ledger.due, result.exchange_ledger.due];
    assert_eq!([1, 2, 3].map(counted), due, "{text}");
    // A third of the time each.
    assert!(due.iter().all(|due| *due >= 150), "{due:?}");

    let (start, stolen_before_ms) = (Instant::now(), stolen_ms());
    measured_or_stolen(&timing("60000000"), start, stolen_before_ms);
}

/// What is late outside of RUN, or in a loop that is not the controller's, is late.
#[test]
fn the_limit_of_lateness_holds_for_every_loop_and_mode() {
    let late = |max_ns| LoopTiming {
        release_lateness: Distribution { max_ns, ..Distribution::default() },
        ..LoopTiming::default()
    };
    let outside = BlockResult { outside_run: vec![late(90_000)], ..BlockResult::default() };
    let result = TimingResult {
        empty: late(10_000),
        controller: late(20_000),
        exchange: late(30_000),
        blocks: vec![BlockResult::default(), outside, BlockResult::default()],
        ..TimingResult::default()
    };
    assert!(result.check_lateness(90.0).is_ok());
    let refused = result.check_lateness(89.9).unwrap_err();
    assert_eq!((refused.measured, refused.latest_ns), (MeasuredLoop::Controller, 90_000));
    let still = TimingResult { blocks: Vec::new(), ..result };
    assert_eq!(still.check_lateness(29.0).unwrap_err().measured, MeasuredLoop::Exchange);
    assert!(still.check_lateness(30.0).is_ok());
}

#[test]
fn a_free_run_shows_the_plants_stop_in_its_report() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let mut child = host_sim()
        .args(["run", "--tissue", "homogeneous", "--mode", "free-run", "--plant", "condensed", "--threads", "1"])
        .args(["--insertion-time", "8", "--duration", "9", "--out"])
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    stop_in_the_loop(&mut child, 12);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let result = read_run(&out).unwrap();
    let free_run = result.cases[0].strategies.dynamic_free_run.as_ref().unwrap();
    let plant = free_run.plant_timing.as_ref().unwrap();
    let (misses, lateness_s) = worst([plant]);
    assert!(misses >= 900, "{misses} misses");
    assert!(lateness_s > 0.9, "largest lateness {lateness_s} s");
    // Nobody at a terminal is told how far it is all the same, and what is left of 9 s and a little.
    let progress = String::from_utf8(output.stderr).unwrap();
    let its = progress.lines().filter(|line| line.ends_with("homogeneous: dynamic, free-run"));
    let left = its.map(|line| {
        let (how_far, rest) = line.split_once(", about ").unwrap_or_else(|| panic!("{line}"));
        assert!(how_far.contains(" % of the steps after "), "{line}");
        rest.split_once(" s left").unwrap().0.parse::<u32>().unwrap()
    });
    let left: Vec<u32> = left.collect();
    assert!(left.len() >= 2 && left.iter().all(|seconds| (1..=11).contains(seconds)), "{progress}");
    assert!(left.windows(2).all(|pair| pair[1] < pair[0]), "{progress}");
    // The first line of the figures has both sides.
    let text = String::from_utf8(output.stdout).unwrap();
    let line = text.lines().find(|line| line.contains("controller ") && line.contains("plant ")).unwrap();
    assert!(line.contains(&format!("{} deadline misses", plant.deadline_misses)), "{line}");
    let ages = [&plant.input_age, &plant.target_age].map(|age| age.as_ref().unwrap());
    // A sample is taken at a release, and acted on at a later one; the target's sensor is 20 ms late besides.
    assert!(ages[0].min_ns > 500_000 && ages[1].min_ns > 20_000_000, "{ages:?}");
}

#[test]
fn a_plant_that_cannot_keep_the_period_is_refused_before_anything_is_written() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let output = host_sim()
        .args(["run", "--tissue", "homogeneous", "--mode", "free-run", "--plant", "full", "--quiet"])
        .args(["--rate", "100000", "--insertion-time", "0.2", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ");
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("µs a step") && message.contains("--plant reduced"), "{message}");
    assert!(!out.exists());
}

#[test]
fn timing_of_nothing_but_void_rounds_fails_and_says_so() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("timing.json");
    // Ordinary threads wake tens of µs late: at 10 µs the controller sees its releases pass, and leaves RUN.
    let output = host_sim()
        .args(["timing", "--seconds", "0.6", "--rate", "100000", "--priority", "0", "--json"])
        .arg(&json)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ");
    let result = read_timing(&json);
    if !result.lateness_ratios.is_empty() && !result.exchange_lateness_ratios.is_empty() {
        assert!(output.status.success(), "{said}");
        return println!("skipped: this machine keeps a period of 10 µs");
    }
    assert_eq!(output.status.code(), Some(1), "{said}");
    for words in ["rounds of the measurement", "void", "RUN", "run it again"] {
        assert!(said.contains(words), "{words}: {said}");
    }
}
