//! What a placement study says where a paddle cannot control the target, where none can, and where no static paddle helps.

use assert_cmd::Command;
use std::path::Path;

/// A strip on a rigid floor, twelve times as long as high: nothing of what happens at one end arrives at the other.
fn strip(paddles: &[[[f64; 2]; 2]]) -> String {
    let paddles: Vec<String> = paddles
        .iter()
        .enumerate()
        .map(|(i, [a, b])| format!("\n[[paddle]]\nindex = {}\nsegment = [{a:?}, {b:?}]\n", i + 1))
        .collect();
    format!(
        r#"
[scene]
name = "strip"
dimension = 2
units = {{ length = "mm", stress = "kPa" }}

[domain]
outline = [[0.0, 0.0], [120.0, 0.0], [120.0, 10.0], [0.0, 10.0]]

[material]
model = "neo-hookean"
lambda = 4.0
mu = 2.0

[immobile]
paths = [[[0.0, 0.0], [120.0, 0.0]]]

[needle]
contact = [[10.0, 10.0], [14.0, 10.0]]
axis = [0.0, -1.0]
depth = 0.5
increments = 4

[target]
position = [9.0, 5.0]

[discretization]
spacing = 2.0
{}"#,
        paddles.concat()
    )
}

const NEAR: [[f64; 2]; 2] = [[0.0, 3.0], [0.0, 7.0]];
const FAR: [[f64; 2]; 2] = [[120.0, 3.0], [120.0, 7.0]];

struct Ran {
    text: String,
    complaint: String,
    code: i32,
    json: serde_json::Value,
    table: bool,
}

fn place(paddles: &[[[f64; 2]; 2]], folder: &Path) -> Ran {
    let (scene, json, table) = (folder.join("strip.toml"), folder.join("strip.json"), folder.join("strip.table"));
    std::fs::write(&scene, strip(paddles)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_model-offline"));
    let command = command.arg("place").arg(&scene).arg("--json").arg(&json).arg("--table").arg(&table);
    let output = command.output().unwrap();
    Ran {
        text: String::from_utf8(output.stdout).unwrap(),
        complaint: String::from_utf8(output.stderr).unwrap(),
        code: output.status.code().unwrap(),
        json: serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap(),
        table: table.exists(),
    }
}

#[test]
fn a_paddle_that_cannot_control_the_target_is_a_row_and_the_others_get_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let ran = place(&[NEAR, FAR], folder.path());
    assert_eq!(ran.code, 0, "{}", ran.complaint);
    assert!(ran.table);
    let [near, far] = [&ran.json["paddles"][0], &ran.json["paddles"][1]];
    assert!(near["controllability_measure"].as_f64().unwrap() > 1.0 && near["hindrance"].is_null());
    assert!(far["controllability_measure"].is_null() && far["best_direction"].is_null());
    assert_eq!(far["hindrance"]["reason"], "uncontrollable");
    assert_eq!(far["static"]["depth"].as_array().unwrap().len(), 4, "it can be static all the same");
    assert_eq!(ran.json["optimum"]["dynamic"], 1);
    assert!(ran.text.contains("paddle 2 cannot control the target"), "{}", ran.text);
}

#[test]
fn without_any_paddle_that_controls_the_study_stays_and_the_table_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let ran = place(&[FAR], folder.path());
    assert_eq!(ran.code, 1);
    assert!(
        !ran.table && ran.complaint.contains("no paddle of this scene can control the target"),
        "{}",
        ran.complaint
    );
    assert!(ran.json["optimum"]["dynamic"].is_null() && ran.json["optimum"]["static"] == 1);
    assert!(ran.json["table_failure"].as_str().unwrap().contains("no paddle"));
}

#[test]
fn no_paddle_is_a_row_and_every_number_has_an_error_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let ran = place(&[NEAR, FAR], folder.path());
    let none = &ran.json["no_paddle"]["static"];
    let share = |i: usize| ran.json["paddles"][i]["static_over_no_paddle"].as_f64().unwrap();
    // A paddle too far to feel changes nothing.
    assert!((share(1) - 1.0).abs() < 1e-6, "{}", share(1));
    let largest = |study: &serde_json::Value| study["max_orthogonal"].as_f64().unwrap();
    assert!((share(0) - largest(&ran.json["paddles"][0]["static"]) / largest(none)).abs() < 1e-12);
    assert!(ran.text.lines().any(|line| line.trim_start().starts_with("none")), "{}", ran.text);
    let errors = &ran.json["paddles"][0]["error"];
    for key in ["jacobian", "controllability_measure", "best_direction", "target_per_depth"] {
        assert!(errors[key].as_f64().unwrap() > 0.0, "{key}: {errors}");
    }
    for (key, length) in [("target_displacement", 4), ("jacobians", 4)] {
        let list = errors["static"][key].as_array().unwrap();
        assert!(list.len() == length && list.iter().all(|e| e.as_f64().unwrap() > 0.0), "{key}: {errors}");
    }
    assert!(ran.json["no_paddle"]["error"]["static"]["max_orthogonal"].as_f64().unwrap() > 0.0);
}
