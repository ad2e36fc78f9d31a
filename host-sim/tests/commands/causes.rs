//! What is left without a cause is what a run without it leaves: each held against a run of its own.

use assert_cmd::Command;

/// The one case of a run of a second of simulated insertion.
fn case(more: &str) -> serde_json::Value {
    lockstep(&format!("--insertion-time 1 --feedback observer --rate 200 {more}"))
}

/// The one case of a run.
fn lockstep(more: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let words = "run --quiet --tissue inclusion --mode lockstep";
    let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    run.args(words.split(' ')).args(more.split_whitespace()).arg("--out").arg(folder.path().join("report"));
    run.assert().success();
    let result = std::fs::read(folder.path().join("report/result.json")).unwrap();
    let result: serde_json::Value = serde_json::from_slice(&result).unwrap();
    result["cases"][0].clone()
}

fn peak(case: &serde_json::Value) -> f64 {
    case["strategies"]["dynamic"]["max_orthogonal_error"].as_f64().unwrap()
}

fn rms(case: &serde_json::Value) -> f64 {
    case["strategies"]["dynamic"]["rms_orthogonal_error"].as_f64().unwrap()
}

/// Largest error without a cause.
fn without(case: &serde_json::Value, cause: &str) -> f64 {
    let causes = case["causes"]["without"].as_array().unwrap();
    let found = causes.iter().find(|without| without["cause"] == cause);
    found.unwrap_or_else(|| panic!("no {cause} in {causes:?}"))["left"]["peak"].as_f64().unwrap()
}

fn names(case: &serde_json::Value) -> Vec<&str> {
    case["causes"]["without"].as_array().unwrap().iter().map(|without| without["cause"].as_str().unwrap()).collect()
}

#[track_caller]
fn same(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-9 * b.abs(), "{a} {b}");
}

#[test]
fn what_is_left_without_a_cause_is_what_a_run_without_it_leaves() {
    let case = |more: &str| case(&format!("--scene breast --plant reduced {more}"));
    let lag = "--paddle-lag 40";
    let whole = case(&format!("--table-tissue homogeneous {lag} --causes"));
    assert_eq!(names(&whole), ["sensor-noise", "sensor-delay", "table", "paddle"]);
    same(whole["causes"]["whole"]["peak"].as_f64().unwrap(), peak(&whole));
    same(whole["causes"]["whole"]["rms"].as_f64().unwrap(), rms(&whole));
    same(without(&whole, "table"), peak(&case(lag)));
    same(without(&whole, "paddle"), peak(&case("--table-tissue homogeneous")));
    same(without(&whole, "sensor-delay"), peak(&case(&format!("--table-tissue homogeneous {lag} --latency 0"))));
    // A controller that goes on expecting noise is no run of another command; but noise is the most of this error.
    assert!(without(&whole, "sensor-noise") < peak(&whole));
    let none = whole["causes"]["without_all"]["peak"].as_f64().unwrap();
    assert!(none < 0.5 * peak(&whole), "{none} of {}", peak(&whole));
}

fn bound(case: &serde_json::Value, of: &str) -> f64 {
    case["causes"]["bound"][of]["rms"].as_f64().unwrap()
}

/// A sensor that is noisier tells less, one that is later as well; without noise only the delay is left, and where the
/// table knows everything nothing is.
#[test]
fn no_controller_could_know_more_than_the_sensor_tells() {
    let case = |more: &str| case(&format!("--scene breast --plant reduced --causes {more}"));
    let whole = case("--table-tissue homogeneous");
    let rms = whole["causes"]["whole"]["rms"].as_f64().unwrap();
    assert!(bound(&whole, "sensor") < rms && bound(&whole, "delay") < 0.2 * bound(&whole, "sensor"));
    assert!(bound(&case("--table-tissue homogeneous --noise 2"), "sensor") > 1.2 * bound(&whole, "sensor"));
    assert!(bound(&case("--table-tissue homogeneous --latency 200"), "delay") > 2.0 * bound(&whole, "delay"));
    let slow = whole["causes"]["bound"]["paddle"].as_f64().unwrap();
    assert_eq!(slow, 0.0, "a paddle at its own rate is fast enough");
    assert_eq!(bound(&case(""), "sensor"), 0.0);
}

/// A paddle that cannot follow leaves at least what the fastest one leaves that knows its way beforehand, at the place of
/// the table's paddle.
#[test]
fn a_paddle_that_is_too_slow_leaves_no_less_than_its_bound() {
    let sensor = "--noise 0 --latency 0 --target-rate 1000";
    for (time, is_slow) in [(0.1, true), (0.2, true), (3.0, false)] {
        let slow = lockstep(&format!("--scene breast --insertion-time {time} {sensor} --causes"));
        let bound = slow["causes"]["bound"]["paddle"].as_f64().unwrap();
        assert_eq!(bound > 0.0, is_slow, "{time} s: {bound}");
        assert!(bound <= peak(&slow), "{time} s: {bound} of {}", peak(&slow));
    }
}

#[test]
fn a_patient_who_does_not_move_and_a_table_that_knows_are_no_causes() {
    let whole = case("--world creep,breathing --causes");
    assert_eq!(names(&whole), ["sensor-noise", "sensor-delay", "motion"]);
    same(whole["causes"]["whole"]["peak"].as_f64().unwrap(), peak(&whole));
    same(without(&whole, "motion"), peak(&case("--world creep")));
    let simple = case("--world creep --table-world simple --causes");
    assert_eq!(names(&simple), ["sensor-noise", "sensor-delay", "table"]);
    same(without(&simple, "table"), peak(&case("--world creep")));
    assert!(case("--world creep")["causes"].is_null());
}
