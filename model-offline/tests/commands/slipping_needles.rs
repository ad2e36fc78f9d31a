//! What is told of tables and equilibria with a needle that slips in tissue that relaxes, on a wedge that nobody tuned.

use assert_cmd::Command;
use std::path::Path;

fn model_offline() -> Command {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
}

/// The wedge with these parts of its text replaced, as a file.
fn wedge(folder: &Path, edits: &[(&str, &str)]) -> std::path::PathBuf {
    let text = edits.iter().fold(include_str!("wedge.toml").to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    let path = folder.join("wedge.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn output_of(command: &mut Command) -> (String, String) {
    let output = command.output().unwrap();
    let [out, error] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success(), "{out}{error}");
    (out, error)
}

/// It was written without a word: eight knots of 21, on a path that no actuator follows.
#[test]
fn a_table_that_ends_early_or_cannot_be_followed_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let scene = wedge(folder.path(), &[]);
    let table = |paddle: &str| {
        let mut command = model_offline();
        command.arg("table").arg(&scene).args(["--paddle", paddle]).arg("-o").arg(folder.path().join("of.table"));
        output_of(&mut command).0
    };
    let said = table("2");
    assert!(said.contains("8 knots, depth 0.0000 to 5.2500"), "{said}");
    let ends = "warning: the table ends at depth 5.2500, of 15.0000 that the scene's needle goes: not-converged: ";
    assert!(said.contains(ends) && said.contains("choose another paddle"), "{said}");
    assert!(said.contains("asks for 36.0304 per s at the scene's needle speed of 5.0000"), "{said}");
    // From (−3.063561, −5.027583) to (0.160005, −0.689631) while the needle goes 0.75.
    let rate = f64::hypot(0.160005 + 3.063561, 0.689631 - 5.027583) / 0.75 * 5.0;
    assert!((rate - 36.0304).abs() < 1e-3, "{rate}");
    let said = table("3");
    assert!(said.contains("21 knots, depth 0.0000 to 15.0000") && !said.contains("the table ends"), "{said}");
}

/// The increment's potential is no energy of tissue that relaxes: it was told as one, negative at times.
#[test]
fn no_energy_is_told_of_tissue_that_relaxes() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("solved.json");
    let solved = |edits: &[(&str, &str)], depth: &str| -> (String, serde_json::Value) {
        let scene = wedge(folder.path(), edits);
        let mut command = model_offline();
        let (said, _) = output_of(command.arg("solve").arg(scene).args(["--depth", depth]).arg("--json").arg(&json));
        (said, serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap())
    };
    let relaxation = "[material.relaxation]\ng = [0.35, 0.25]\ntau = [1.5, 20.0]\n";
    let (said, within) = solved(&[], "10");
    assert!(said.contains("stored or lost by relaxing"), "{said}");
    assert!(within["strain_energy"].is_null() && within["energy_imbalance"].is_null(), "{within}");
    assert!(within["stored_or_lost"].as_f64().unwrap() > 0.0);
    let (_, pushing) = solved(&[], "1");
    assert!(pushing["strain_energy"].is_null() && pushing.get("stored_or_lost").is_none(), "{pushing}");
    let (said, elastic) = solved(&[(relaxation, "")], "10");
    assert!(said.contains(": stored "), "{said}");
    assert!(elastic["strain_energy"].as_f64().unwrap() > 0.0 && elastic["energy_imbalance"].is_number(), "{elastic}");
}

#[test]
fn a_paddle_beyond_its_actuator_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let scene = wedge(folder.path(), &[]);
    let noted = |displacement: &str| {
        let mut command = model_offline();
        let shifted = format!("--paddle-displacement={displacement}");
        output_of(command.arg("solve").arg(&scene).args(["--depth", "1", "--paddle", "3", "--quiet", &shifted])).1
    };
    let told = "note: the paddle is 15.01 mm from rest, and [actuator] max_displacement is 15 mm";
    assert!(noted("0,-15.01").contains(told), "{}", noted("0,-15.01"));
    assert!(!noted("0,-14.9").contains("from rest"), "{}", noted("0,-14.9"));
}
