//! The command line on scenes in three dimensions: what is written, and what is refused.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

fn program() -> Command {
    Command::cargo_bin("model-offline").unwrap()
}

fn text() -> &'static str {
    include_str!("../../scenes/block.toml")
}

/// Places on a scene of this text; exit code, standard error, and what was written.
fn place(text: &str, options: &[&str], folder: &Path) -> (i32, String, Option<Value>) {
    let (scene, json) = (folder.join("scene.toml"), folder.join("place.json"));
    std::fs::write(&scene, text).unwrap();
    let mut command = program();
    command.arg("place").arg(&scene).arg("--json").arg(&json).args(options);
    let output = command.output().unwrap();
    let written = std::fs::read_to_string(&json).ok().map(|text| serde_json::from_str(&text).unwrap());
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned(), written)
}

#[test]
fn a_study_in_space_is_written_as_the_contract_says() {
    let folder = tempfile::tempdir().unwrap();
    let text = text().replace("of = \"all\"", "of = [[1, 4], [6, 3]]");
    let (code, said, written) =
        place(&text, &["--integration", "fem-t4", "--spacing", "0.2", "--quiet"], folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    let study = written.unwrap();
    let paddles = study["paddles"].as_array().unwrap();
    assert_eq!((study["dimension"].as_u64(), paddles.len()), (Some(3), 8));
    for result in paddles.iter().chain(study["pairs"].as_array().unwrap()) {
        let columns = if result["paddles"].is_array() { 6 } else { 3 };
        let rows = result["jacobian"].as_array().unwrap();
        assert!(rows.len() == 3 && rows.iter().all(|row| row.as_array().unwrap().len() == columns));
        let [free, full] = ["controllability_measure", "controllability_full"].map(|k| result[k].as_f64().unwrap());
        assert!(free > 1.0 && full >= free * (1.0 - 1e-9));
        let fixture = &result["static"];
        assert_eq!(fixture["depth"].as_array().unwrap().len(), fixture["orthogonal"].as_array().unwrap().len());
    }
    assert_eq!(study["pairs"][1]["paddles"], serde_json::json!([3, 6]));
    assert_eq!(study["optimum"]["dynamic"].as_array().unwrap().len(), 2);
    // Of numbers without errors nobody knows who is as good.
    assert!(study["as_good"].is_null() && study["as_good_single"].is_null());
    let second = &study["second_paddle"];
    let measure = |of: &str, k: usize| study[of][k]["controllability_measure"].as_f64().unwrap();
    let best = |of: &str| {
        let all = 0..study[of].as_array().unwrap().len();
        all.map(|k| measure(of, k)).fold(f64::INFINITY, f64::min)
    };
    let [single, pair] = ["single", "pair"].map(|key| second[key].as_f64().unwrap());
    assert!(single == best("paddles") && pair == best("pairs") && second["left_open"].is_null(), "{second}");
    assert!((second["gain"].as_f64().unwrap() - (1.0 - pair / single)).abs() < 1e-12);
    // The paddle on the needle's side of the target, as in the continuum.
    assert_eq!(study["optimum_single"]["dynamic"], serde_json::json!([3]));
}

/// Both measures have an error of their own.
#[test]
fn a_tolerance_comes_with_the_errors_of_both_measures() {
    let folder = tempfile::tempdir().unwrap();
    let text = text().replace("of = \"all\"", "of = [[3, 6]]").replacen("tolerance = 0.05", "tolerance = 0.2", 1);
    let options = ["--integration", "fem-t10", "--without-inclusion", "--quiet"];
    let (code, said, written) = place(&text, &options, folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    let study = written.unwrap();
    let estimate = &study["error_estimate"];
    let results = [study["paddles"].as_array().unwrap(), study["pairs"].as_array().unwrap()];
    for (i, result) in results.into_iter().flatten().enumerate() {
        for (key, of_all) in [("controllability_measure", "by_set"), ("controllability_full", "full_by_set")] {
            let error = &result["error"][key];
            assert!(error.as_f64().unwrap() > 0.0 && *error == estimate[of_all][i], "{i} {key}: {error}");
        }
    }
    assert!(estimate["by_set"] != estimate["full_by_set"]);
    // Who is as good as the best, of whom is known what its errors leave open: 3 alone controls best by far.
    assert_eq!(study["as_good_single"]["dynamic"], serde_json::json!([]));
    let [one, two] = ["as_good_single", "as_good"].map(|key| study[key]["static"].as_array().unwrap().len());
    assert!(one > 0 && two == 0, "{one} {two}");
    // What the second paddle saves on this body is less than such errors.
    assert_eq!(study["second_paddle"]["left_open"], serde_json::json!(true));
}

#[test]
fn what_cannot_be_is_refused_with_the_place_and_nothing_is_written() {
    for (from, to, expected) in [
        ("position = [0.5, 0.5, 0.5]", "position = [0.5, 0.5, 1.5]", "outside the body"),
        ("position = [0.5, 0.5, 0.5]", "position = [0.5, 0.5, 1.0]", "on the surface of the body"),
        (
            "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }",
            "solid = { difference = [{ box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }, \
             { box = { min = [-1.0, -1.0, -1.0], max = [2.0, 2.0, 2.0] } }] }",
            "nothing is left of the body",
        ),
        ("position = [0.5, 0.5, 0.5]", "position = [0.5, nan, 0.5]", "finite"),
        ("axis = [0.0, 0.0, -1.0]", "axis = [0.0, 0.0, 0.0]", "no direction"),
        ("of = \"all\"", "of = [[1, 9]]", "no paddle 9"),
        ("of = \"all\"", "of = [[1, 1]]", "one paddle"),
        ("of = \"all\"", "of = \"some\"", "not known"),
        ("tolerance = 0.05", "tolerance = 0.05\nspacing = 0.1", "one of spacing"),
        ("tolerance = 0.05", "tolerance = -1.0", "tolerance is -1"),
        ("tolerance = 0.05", "spacing = 1e-9", "nodes"),
        ("tolerance = 0.05", "tolerance = 0.05\nintegration = \"fem-t6\"", "planar"),
        ("tolerance = 0.05", "tolerance = 0.05\nsupport = 99.0", "support is 99"),
        ("stiffness = 100.0", "stiffness = -1.0", "stiffness is -1"),
        (
            "min = [0.6, 0.4, 0.3], max = [0.7, 0.6, 0.4]",
            "min = [5.0, 5.0, 5.0], max = [6.0, 6.0, 6.0]",
            "covers nothing",
        ),
        (
            "min = [0.6, 0.4, 0.3], max = [0.7, 0.6, 0.4]",
            "min = [0.6, 0.4, 0.3], max = [0.60001, 0.40001, 0.30001]",
            "this inclusion is 0.00001732 across, in a body of 1.732",
        ),
        ("index = 2", "index = 1", "given twice"),
        (
            "min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]",
            "min = [0.3, 0.2, 0.2], max = [0.3, 0.4, 0.4]",
            "paddle 1 catches no surface",
        ),
        (
            "min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]",
            "min = [1.0, 0.2, 0.2], max = [1.0, 0.4, 0.4]",
            "touches the immobile part",
        ),
        ("[target]", "[sensor]\npreset = \"mri\"\n\n[target]", "[sensor]"),
        ("axis = [0.0, 0.0, -1.0]", "axis = [0.0, 0.0, -1.0]\nmechanics = \"shaft\"", "planar"),
        (
            "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }",
            "box = { min = [0.0, 0.0, 0.0], max = [1.0, 0.0, 1.0] }",
            "flat",
        ),
        (
            "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }",
            "solid = { half_space = { point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0] } }",
            "no end",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let changed = text().replacen(from, to, 1);
        assert_ne!(changed, text(), "{from}");
        let (code, said, written) = place(&changed, &[], folder.path());
        let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(code == 2 && said.contains(expected), "{to}: {code} {said}");
        assert!(written.is_none(), "{to}");
    }
}

#[test]
fn options_and_commands_of_the_plane_say_so() {
    let folder = tempfile::tempdir().unwrap();
    for (options, expected) in [
        (vec!["--integration", "fem-t6"], "planar"),
        (vec!["--essential", "nitsche"], "planar"),
        (vec!["--table", "/dev/null"], "model-offline table"),
    ] {
        let (code, said, written) = place(text(), &options, folder.path());
        assert!(code == 2 && said.contains(expected) && written.is_none(), "{options:?}: {code} {said}");
    }
    let output = program().args(["compare", "block"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("dimension = 3"), "{said}");
    let output = program().args(["place", "paper", "--integration", "fem-t10", "--quiet"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn paddles_and_depths_that_are_none_are_no_failed_computation() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("none.table");
    for (words, expected) in [
        ("table paper --paddle 1,2", "2 paddles asked for"),
        ("table block --spacing 0.4 --integration fem-t4 --paddle 1,3,8", "3 paddles asked for"),
        ("table block --spacing 0.4 --integration fem-t4 --paddle 1,1", "paddle 1 is named twice"),
    ] {
        let output = program().args(words.split(' ')).arg("-o").arg(&table).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(expected) && !table.exists(), "{words}: {said}");
    }
    // Beyond the body, whose scene may not go there either.
    for (words, size) in [("solve paper --depth 2", "1.414"), ("solve block --depth 2", "1.732")] {
        let output = program().args(words.split(' ')).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let expected = format!("--depth is 2, larger than the whole body ({size})");
        assert!(output.status.code() == Some(2) && said.contains(&expected), "{words}: {said}");
    }
}

/// The unit cube as text STL, with as many of its twelve triangles as asked for.
fn cube(triangles: usize) -> String {
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let corner = |i: usize| format!("      vertex {} {} {}\n", i & 1, i >> 1 & 1, i >> 2);
    let all = faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let facet = |t: [usize; 3]| {
        format!("  facet normal 0 0 0\n    outer loop\n{}    endloop\n  endfacet\n", t.map(corner).concat())
    };
    format!("solid cube\n{}endsolid cube\n", all.take(triangles).map(facet).collect::<String>())
}

#[test]
fn a_body_from_a_file_is_the_body_and_a_bad_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let boxed = "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }";
    let options = ["--integration", "fem-t4", "--spacing", "0.2", "--quiet"];
    let measures = |study: &Value| -> Vec<f64> {
        let of = |paddle: &Value| paddle["controllability_measure"].as_f64().unwrap();
        study["paddles"].as_array().unwrap().iter().map(of).collect()
    };
    let text = text().replace("of = \"all\"", "of = \"none\"");
    let expected = measures(&place(&text, &options, folder.path()).2.unwrap());
    std::fs::write(folder.path().join("cube.stl"), cube(12)).unwrap();
    let from_file = text.replacen(boxed, "surface = \"cube.stl\"", 1);
    let found = measures(&place(&from_file, &options, folder.path()).2.unwrap());
    assert!(expected.iter().zip(&found).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{expected:?} {found:?}");

    std::fs::remove_file(folder.path().join("place.json")).unwrap();
    std::fs::write(folder.path().join("open.stl"), cube(11)).unwrap();
    for (body, expected) in [
        ("surface = \"open.stl\"".to_owned(), "open.stl"),
        ("surface = \"nowhere.stl\"".to_owned(), "nowhere.stl"),
        ("surface = \"scene.toml\"".to_owned(), "scene.toml"),
        (format!("{boxed}\nsurface = \"cube.stl\""), "one"),
        ("labels = { file = \"cube.stl\", body = 1 }".to_owned(), "cube.stl"),
    ] {
        let (code, said, written) = place(&text.replacen(boxed, &body, 1), &options, folder.path());
        assert!(code == 2 && said.contains(expected) && written.is_none(), "{body}: {code} {said}");
    }
}
