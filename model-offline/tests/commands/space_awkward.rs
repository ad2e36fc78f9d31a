//! Scenes in space that are unusual, or wrong in a way that is easily overlooked: a right result, or an error that says what
//! to do.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

const BOX: &str = "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }";
const TARGET: &str = "position = [0.5, 0.5, 0.5]";
const INCLUSION: &str = "box = { min = [0.6, 0.4, 0.3], max = [0.7, 0.6, 0.4] }";

/// `block` on a coarse mesh, one paddle, with replacements.
fn scene(changes: &[(&str, &str)]) -> String {
    let text = include_str!("../../scenes/block.toml");
    let (before, after) = (text.find("[[paddle]]\nindex = 2").unwrap(), text.find("[pairs]").unwrap());
    let text = format!("{}{}", &text[..before], &text[after..]);
    let text = text.replacen("tolerance = 0.05", "level = 0\nintegration = \"fem-t4\"", 1);
    changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

/// Places on a scene; exit code, what was said in one line, and what was written.
fn place(text: &str, options: &[&str], folder: &Path) -> (i32, String, Option<Value>) {
    let (scene, json) = (folder.join("scene.toml"), folder.join("place.json"));
    let _ = std::fs::remove_file(&json);
    std::fs::write(&scene, text).unwrap();
    let mut command = Command::cargo_bin("model-offline").unwrap();
    command.arg("place").arg(&scene).arg("--json").arg(&json).arg("--quiet").args(options);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    let written = std::fs::read_to_string(&json).ok().map(|text| serde_json::from_str(&text).unwrap());
    (output.status.code().unwrap(), said, written)
}

/// The measure of the only paddle.
fn measure(changes: &[(&str, &str)]) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let (code, said, written) = place(&scene(changes), &[], folder.path());
    assert_eq!((code, said.as_str()), (0, ""), "{changes:?}");
    written.unwrap()["paddles"][0]["controllability_measure"].as_f64().unwrap_or(f64::INFINITY)
}

#[test]
fn a_needle_axis_has_any_length() {
    let expected = measure(&[]);
    for axis in ["axis = [0.0, 0.0, -1e200]", "axis = [0.0, 0.0, -1e-200]", "axis = [0, 0, -3]"] {
        assert_eq!(measure(&[("axis = [0.0, 0.0, -1.0]", axis)]), expected, "{axis}");
    }
}

#[test]
fn a_target_all_but_on_the_surface_moves_like_the_one_beside_it() {
    // Beside the paddle's corner, beside the needle contact, and within it.
    for (near, inside) in [
        ("[0.0000001, 0.7, 0.3]", "[0.0005, 0.7, 0.3]"),
        ("[0.3, 0.7, 0.9999]", "[0.3, 0.7, 0.9995]"),
        ("[0.97, 0.5, 0.9999999]", "[0.97, 0.5, 0.9995]"),
    ] {
        let at = |place: &str| measure(&[(TARGET, &format!("position = {place}"))]);
        let (near, inside) = (at(near), at(inside));
        assert!((near / inside - 1.0).abs() < 0.02, "{near} {inside}");
    }
}

#[test]
fn slabs_and_plates_are_meshed_with_elements_as_thin_as_they_are() {
    // Far sides do not matter: a slab 100 times as wide is the one ten times as wide.
    let wide = |half: &str| {
        let body = format!("box = {{ min = [0.0, -{half}, 0.0], max = [1.0, {half}, 1.0] }}");
        let held = format!("box = {{ min = [1.0, -{half}, 0.0], max = [1.0, {half}, 1.0] }}");
        measure(&[(BOX, &body), ("box = { min = [1.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }", &held)])
    };
    let (ten, hundred) = (wide("5.0"), wide("50.0"));
    assert!((ten / hundred - 1.0).abs() < 0.1, "{ten} {hundred}");
}

#[test]
fn inclusions_of_any_size_are_seen_or_said_to_be_missing() {
    // Stiff, and so small that only what is at the target can feel it.
    let tiny = "sphere = { centre = [0.5, 0.5, 0.5], radius = 1e-4 }";
    assert!(measure(&[(INCLUSION, tiny)]).is_finite());
    // Three of them across each other.
    let three = "sphere = { centre = [0.5, 0.5, 0.25], radius = 0.15 }\nstiffness = 9.0\n[[inclusion]]\n\
                 sphere = { centre = [0.6, 0.5, 0.25], radius = 0.15 }\nstiffness = 0.1\n[[inclusion]]\n\
                 box = { min = [0.45, 0.42, 0.17], max = [0.65, 0.58, 0.38] }";
    assert!(measure(&[(INCLUSION, three)]).is_finite());
    let folder = tempfile::tempdir().unwrap();
    let shell = "solid = { difference = [{ sphere = { centre = [0.5, 0.5, 0.3], radius = 0.2 } }, \
                 { sphere = { centre = [0.5, 0.5, 0.3], radius = 0.1999 } }] }";
    let (code, said, _) = place(&scene(&[(INCLUSION, shell)]), &[], folder.path());
    assert!(code == 2 && said.contains("too thin"), "{code} {said}");
}

/// Volume of a body as it is meshed at level 0, and how far its surface is from the mesh's.
fn meshed(body: &str) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let (scene_file, json) = (folder.path().join("scene.toml"), folder.path().join("check.json"));
    std::fs::write(&scene_file, scene(&[(BOX, body)])).unwrap();
    let mut command = Command::cargo_bin("model-offline").unwrap();
    command.arg("check").arg(&scene_file).arg("--json").arg(&json).assert().success();
    let survey: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    (survey["volume"].as_f64().unwrap(), survey["mesh"]["off_surface"].as_f64().unwrap())
}

#[test]
fn bores_voids_slots_and_rods_are_in_the_mesh_however_coarse_it_is() {
    let with = |operation: &str, part: &str| format!("solid = {{ {operation} = [{{ {BOX} }}, {part}] }}");
    let cylinder = |from: &str, to: &str, radius: f64| {
        format!("{{ cylinder = {{ from = {from}, to = {to}, radius = {radius} }} }}")
    };
    let bore = |radius: f64| cylinder("[0.0, 0.75, 0.7]", "[1.0, 0.75, 0.7]", radius);
    let sphere = |radius: f64| format!("{{ sphere = {{ centre = [0.3, 0.3, 0.75], radius = {radius} }} }}");
    let slot = "{ box = { min = [0.7123, -0.1, 0.6217], max = [0.7523, 0.313, 0.873] } }";
    let disc = |radius: f64| std::f64::consts::PI * radius.powi(2);
    // What is taken away or added, and how much of it at least a coarse mesh is to have: an octagon inscribed in a
    // circle has 90 % of it, a hexagon 83.
    for (body, exact, share) in [
        (with("difference", &bore(0.1)), -disc(0.1), 0.9),
        (with("difference", &bore(0.03)), -disc(0.03), 0.8),
        (with("difference", &bore(0.01)), -disc(0.01), 0.6),
        // Its ends are outside of the body, and it slants.
        (
            with("difference", &cylinder("[-0.5, 0.2, 0.3]", "[1.5, 0.7, 0.9]", 0.05)),
            -disc(0.05) * (1.0_f64 + 0.25 * 0.25 + 0.3 * 0.3).sqrt(),
            0.85,
        ),
        (with("difference", &sphere(0.08)), -disc(0.08) * 4.0 / 3.0 * 0.08, 0.85),
        (with("difference", &sphere(0.01)), -disc(0.01) * 4.0 / 3.0 * 0.01, 0.5),
        // Just under a face, whose points must not take their place.
        (
            with("difference", "{ sphere = { centre = [0.5, 0.5, 0.96], radius = 0.015 } }"),
            -disc(0.015) * 4.0 / 3.0 * 0.015,
            0.5,
        ),
        (with("difference", &cylinder("[0.0, 0.3, 0.97]", "[1.0, 0.3, 0.97]", 0.01)), -disc(0.01), 0.6),
        (with("difference", slot), -0.04 * 0.313 * (0.873 - 0.6217), 1.0 - 1e-9),
        (with("union", &cylinder("[0.8, 0.2, 0.9]", "[0.8, 0.2, 1.3]", 0.03)), disc(0.03) * 0.3, 0.82),
    ] {
        let (volume, off) = meshed(&body);
        let found = (volume - 1.0) / exact;
        assert!((share..1.0 + 1e-6).contains(&found), "{body}: {found} of {exact}");
        assert!(off < 0.03, "{body}: {off}");
    }
}

#[test]
fn what_is_easily_overlooked_is_said() {
    let law = "model = \"fung\"\nlambda = 383.0\nmu = 318.5\nc = 0.779\nlambda_c = 1.5\nmu_c = 1.0";
    let cut = "solid = { difference = [{ box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }, \
               { box = { min = [0.2, -1.0, -1.0], max = [0.25, 2.0, 2.0] } }] }";
    for (from, to, expected) in [
        // The paddle's side of it would float.
        (BOX, cut, "hangs on nothing"),
        (BOX, "box = { min = [0.0, 0.0, 0.0], max = [1e-160, 1e-160, 1e-160] }", "unit of length"),
        (BOX, "box = { min = [0.0, 0.0, 0.0], max = [1e160, 1.0, 1.0] }", "unit of length"),
        (BOX, "box = { min = [1.0, 0.0, 0.0], max = [0.0, 1.0, 1.0] }", "min of a box must not be above its max"),
        (BOX, "surface = \" \"", "has no name"),
        (BOX, "labels = { file = \"a.nrrd\", body = -1 }", "whole numbers from 0"),
        ("of = \"all\"", "of = [[1, 2, 3]]", "list of pairs"),
        // A box that ends before the face.
        (
            "min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]",
            "min = [-1.0, 0.2, 0.2], max = [-0.01, 0.4, 0.4]",
            "reach into",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (code, said, written) = place(&scene(&[(from, to)]), &[], folder.path());
        assert!(code == 2 && on_one_line(&said).contains(expected) && written.is_none(), "{to}: {code} {said}");
    }
    // Patches are closed sets: a box that touches the face from outside holds of it what a flat one does.
    let touching = ("min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]", "min = [-1.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]");
    assert!((measure(&[touching]) / measure(&[]) - 1.0).abs() < 1e-9);
    // A preset that relaxes; what is said to help does.
    let folder = tempfile::tempdir().unwrap();
    let kpa = ("stress = \"1\"", "stress = \"kPa\"");
    let (code, said, _) = place(&scene(&[kpa, (law, "preset = \"liver\"")]), &[], folder.path());
    assert!(code == 2 && said.contains("g = [], tau = []"), "{code} {said}");
    assert!(measure(&[kpa, (law, "preset = \"liver\"\nrelaxation = { g = [], tau = [] }")]).is_finite());
}

#[test]
fn paddles_that_overlap_are_no_pair() {
    // The second is a part of the first and the first is the better one: together they seem to be what both are.
    let second = "[[paddle]]\nindex = 2\nregion = { box = { min = [0.0, 0.3, 0.2], max = [0.0, 0.5, 0.4] } }\n\n\
                  [[paddle]]\nindex = 3\nregion = { box = { min = [0.0, 0.4, 0.4], max = [0.0, 0.6, 0.6] } }\n\n[pairs]";
    let folder = tempfile::tempdir().unwrap();
    let (code, said, written) = place(&scene(&[("[pairs]", second)]), &[], folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    let study = written.unwrap();
    // Those that touch are one.
    assert_eq!(study["overlapping"], serde_json::json!([[1, 2]]));
    for best in ["static", "dynamic"] {
        assert_ne!(study["optimum"][best], serde_json::json!([1, 2]));
    }
}

#[test]
fn an_output_over_the_bodys_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let surface = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    let body = folder.path().join("place.obj");
    std::fs::write(&body, surface).unwrap();
    let path = folder.path().join("scene.toml");
    let text = scene(&[(BOX, "surface = \"place.obj\""), (TARGET, "position = [0.2, 0.2, 0.2]")]);
    std::fs::write(&path, text).unwrap();
    let mut command = Command::cargo_bin("model-offline").unwrap();
    let output = command.arg("place").arg(&path).arg("--json").arg(&body).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::read_to_string(&body).unwrap(), surface);
}

/// What is said, wherever a line of the terminal ends.
fn on_one_line(said: &str) -> String {
    said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

#[test]
fn what_meets_in_a_point_alone_is_not_held() {
    let beside = "{ box = { min = [1.0, 1.0, 1.0], max = [2.0, 2.0, 2.0] } }";
    let body = format!("solid = {{ union = [{{ {BOX} }}, {beside}] }}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, scene(&[(BOX, &body)])).unwrap();
    let output = Command::cargo_bin("model-offline").unwrap().arg("check").arg(&file).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && on_one_line(&said).contains("hangs on nothing"), "{said}");
}
