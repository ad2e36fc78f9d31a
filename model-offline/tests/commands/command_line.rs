//! The binary as a user runs it: results, bad scenes, exit codes, files whole or absent.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

fn model_offline() -> Command {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
}

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Table III and the static optima of the paper, and the controllability measures of an independent implementation
/// on the inferred geometry (SCNI and DNI, spacing 0.1, support 2), which must be met within 0.5 %.
#[test]
fn place_reproduces_the_papers_optima_and_the_reference_measures() {
    let reference: [(&str, &str, bool, [f64; 5]); 6] = [
        ("paper.toml", "scni", false, [5.0875, 3.9765, 3.1535, 3.4679, 4.2817]),
        ("paper.toml", "scni", true, [5.3496, 4.3531, 3.4680, 3.8749, 4.5870]),
        ("paper.toml", "dni", false, [4.7005, 3.4937, 2.9602, 3.1399, 4.0325]),
        ("paper.toml", "dni", true, [4.9280, 3.7897, 3.2687, 3.5115, 4.3500]),
        ("paper-hull.toml", "scni", false, [5.1334, 3.9734, 3.1749, 3.5673, 4.3606]),
        ("paper-hull.toml", "scni", true, [6.2333, 5.2037, 4.0257, 4.4317, 4.9358]),
    ];
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("place.json");
    for (file, integration, inclusion, measures) in reference {
        let mut command = model_offline();
        command.arg("place").arg(scene(file)).args(["--integration", integration, "--quiet", "--json"]).arg(&out);
        if !inclusion {
            command.arg("--without-inclusion");
        }
        command.assert().success();
        let result = json(&out);
        let expected = serde_json::json!({"static": if inclusion { 2 } else { 4 }, "dynamic": 3});
        assert_eq!(result["optimum"], expected, "{file} {integration} {inclusion}");
        for (paddle, measure) in result["paddles"].as_array().unwrap().iter().zip(measures) {
            let ours = paddle["controllability_measure"].as_f64().unwrap();
            assert!((ours / measure - 1.0).abs() < 0.005, "{file} {integration}: {ours} against {measure}");
            assert!(paddle["static"]["failure"].is_null());
        }
    }
}

/// An L of 80 mm with two stiff inclusions, whose surface folds beside the second paddle between 5.4 and 6 mm: every increment
/// converges, and the state at 6 mm is far from the one before.
const FOLDING: &str = r#"
[scene]
name = "folding"
dimension = 2
units = { length = "mm", stress = "kPa" }
[domain]
outline = [[0, 0], [80, 0], [80, 30], [30, 30], [30, 80], [0, 80]]
[material]
model = "neo-hookean"
lambda = 9.0
mu = 1.0
[[inclusion]]
outline = [[5, 40], [20, 38], [24, 55], [8, 58]]
material = { model = "neo-hookean", lambda = 32.0, mu = 8.0 }
[[inclusion]]
outline = [[12, 70], [24, 70], [24, 80], [12, 80]]
material = { model = "neo-hookean", lambda = 16.0, mu = 4.0 }
[immobile]
paths = [[[0, 0], [80, 0]]]
[needle]
contact = [[10, 80], [20, 80]]
axis = [-0.2, -1]
depth = 6.0
increments = 6
[target]
position = [14, 45]
[[paddle]]
index = 2
segment = [[0, 50], [0, 60]]
[discretization]
spacing = 1.75
integration = "fem-t6"
"#;

#[test]
fn a_table_ends_before_tissue_goes_over_to_another_equilibrium() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("folding.table");
    std::fs::write(folder.path().join("folding.toml"), FOLDING).unwrap();
    let mut command = model_offline();
    command.args(["table", "folding.toml", "--knots", "8", "--paddle", "2", "-o"]).arg(&table);
    let output = command.current_dir(folder.path()).assert().success();
    let said = String::from_utf8_lossy(&output.get_output().stdout).into_owned();
    let told = "the table ends at depth 5.1429, of 6.0000 that the scene's needle goes: between depth 5.1429 and 6.0000 the tissue \
                goes over to another equilibrium";
    assert!(said.contains(told), "{said}");
    let bytes = std::fs::read(&table).unwrap();
    let table = firmware::decode::<f64, 2, 1, 1>(&bytes).unwrap();
    assert_eq!(table.knots.len(), 7);
    let steps: Vec<f64> = table.knots.windows(2).map(|k| (k[1].paddle_path - k[0].paddle_path).norm()).collect();
    assert!(steps.windows(2).all(|s| s[1] < 2.0 * s[0]), "{steps:?}");
}

/// `solve`, whose paddle may move, and `place`, of every insertion by itself. The paper's tissue has no jump at any increments; where a
/// limit is near, slopes grow beyond bounds and the path is smooth all the same. Nothing is said where nobody looks.
#[test]
fn a_target_that_jumps_is_told_and_one_that_does_not_is_not() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("folding.toml"), FOLDING).unwrap();
    for increments in [1, 2, 40] {
        let smooth =
            include_str!("../../scenes/paper.toml").replace("increments = 10", &format!("increments = {increments}"));
        assert!(smooth.contains(&format!("increments = {increments}\n")), "{smooth}");
        std::fs::write(folder.path().join(format!("smooth-{increments}.toml")), smooth).unwrap();
    }
    let run = |words: &str| {
        let json = folder.path().join("result.json");
        let mut command = model_offline();
        command.args(words.split(' ')).arg("--json").arg(&json).current_dir(folder.path());
        let output = command.assert().success().get_output().clone();
        let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        let result: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
        (said, result)
    };
    for paddle in ["", " --paddle-displacement 0.2,-0.2"] {
        let (said, result) = run(&format!("solve folding.toml --depth 6 --paddle 2{paddle}"));
        assert!(
            said.contains("between depth 5 mm and 6 mm the tissue seems to go over to another equilibrium"),
            "{said}"
        );
        assert!(result["jump"]["from"] == 5.0 && result["jump"]["off"].as_f64().unwrap() > 0.1, "{}", result["jump"]);
    }
    let breast = include_str!("../../scenes/breast.toml").replace("increments = 12", "increments = 100");
    std::fs::write(folder.path().join("limit.toml"), breast).unwrap();
    let near_the_limit = "solve limit.toml --depth 11.4 --paddle 4 --paddle-displacement 7.615865,-15.600425";
    for words in ["solve folding.toml --depth 5 --paddle 2", near_the_limit] {
        let (said, result) = run(words);
        assert!(!said.contains("equilibrium") && result["jump"].is_null() && result.get("jump").is_some(), "{said}");
    }
    let (_, result) = run("solve folding.toml --depth 0 --paddle 2 --paddle-displacement 0.2,-0.2");
    assert!(result.get("jump").is_none(), "{}", result["jump"]);
    // The tissue fails later, and the jump is told.
    let mut command = model_offline();
    let output =
        command.args("solve folding.toml --depth 20 --paddle 2".split(' ')).current_dir(folder.path()).assert().code(1);
    let said = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
    assert!(said.contains("between depth 5 mm and 6 mm"), "{said}");
    let (said, result) = run("place folding.toml");
    assert!(said.contains("  jumps from depth 5.0000 to 6.0000\n") && said.contains("depend on the nodes"), "{said}");
    assert_eq!(result["paddles"][0]["static"]["jump"]["to"], 6.0);
    assert!(result["no_paddle"]["static"]["jump"].is_null(), "{}", result["no_paddle"]["static"]["jump"]);
    for increments in [1, 2, 40] {
        let (said, _) = run(&format!("place smooth-{increments}.toml"));
        assert!(!said.contains("jump"), "{said}");
    }
}

/// `| head` and a full disk. Nobody reads the first, and the files are wanted all the same; the second loses what was said.
#[test]
fn standard_output_may_be_closed_but_not_be_full() {
    use std::process::{Command, Stdio};
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result.json");
    let (reader, closed) = std::io::pipe().unwrap();
    drop(reader);
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for (stdout, code, said) in
        [(Stdio::from(closed), 0, ""), (Stdio::from(full), 1, "cannot write to standard output")]
    {
        let mut command = Command::new(env!("CARGO_BIN_EXE_model-offline"));
        command.arg("check").arg(scene("paper.toml")).arg("--json").arg(&out);
        let ended = command.stdout(stdout).stderr(Stdio::piped()).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(code), "{stderr}");
        assert!(stderr.contains(said) && !stderr.contains("panicked"), "{stderr}");
        std::fs::remove_file(&out).unwrap();
    }
}

#[test]
fn bad_scenes_give_one_error_with_file_line_and_column_and_write_nothing() {
    let good = std::fs::read_to_string(scene("paper.toml")).unwrap();
    let replaced = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1).into_bytes()
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("unknown key", replaced("stiffness = 100.0", "stifness = 100.0"), "stifness"),
        ("wrong type", replaced("spacing = 0.1", "spacing = \"fine\""), "invalid type"),
        (
            "crossing outline",
            replaced("outline = [[0.5, 0.0], [1.0, 0.0], [1.0, 1.0]", "outline = [[0.5, 0.0], [1.0, 1.0], [1.0, 0.0]"),
            "cross",
        ),
        ("target outside", replaced("position = [0.5, 0.5]", "position = [0.1, 0.1]"), "outside"),
        ("paddle on the immobile part", replaced("[[0.0, 0.5], [0.0, 0.6]]", "[[1.0, 0.5], [1.0, 0.6]]"), "immobile"),
        (
            "paddle off the boundary",
            replaced("[[0.0, 0.5], [0.0, 0.6]]", "[[0.1, 0.5], [0.1, 0.6]]"),
            "off the boundary",
        ),
        ("both spacing and tolerance", replaced("spacing = 0.1", "spacing = 0.1\ntolerance = 0.01"), "both"),
        ("neither", replaced("spacing = 0.1\n", ""), "neither"),
        ("empty", Vec::new(), "empty"),
        ("binary", vec![0x7f, b'E', b'L', b'F', 0xff, 0xfe, 0x00], "UTF-8"),
        ("nan", replaced("depth = 0.1", "depth = nan"), "depth"),
        ("nan in a point", replaced("[1.0, 0.0], [1.0, 1.0], [0.0", "[1.0, nan], [1.0, 1.0], [0.0"), "finite"),
        (
            "inclusion covers nothing",
            replaced("[[0.55, 0.25]", "[[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]\n#"),
            "covers nothing",
        ),
        ("unstable material", replaced("mu = 318.5", "mu = -318.5"), "stable"),
        ("three dimensions", replaced("dimension = 2", "dimension = 3"), "dimension 3"),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, text, expected) in cases {
        let path = folder.path().join("bad.toml");
        std::fs::write(&path, text).unwrap();
        let (out, table) = (folder.path().join("out.json"), folder.path().join("out.table"));
        let output = model_offline()
            .env("NO_COLOR", "1")
            .arg("place")
            .arg(&path)
            .arg("--json")
            .arg(&out)
            .arg("--table")
            .arg(&table)
            .output()
            .unwrap();
        let stderr: String = String::from_utf8(output.stderr).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(2), "{name}: {stderr}");
        assert!(stderr.contains(expected), "{name}: {stderr}");
        let at = stderr.find("bad.toml:").unwrap_or_else(|| panic!("{name}: no position in {stderr}"));
        let position: Vec<&str> = stderr[at + 9..].splitn(3, ':').collect();
        assert!(position[0].parse::<u32>().is_ok() && position[1].parse::<u32>().is_ok(), "{name}: {stderr}");
        assert!(!out.exists() && !table.exists(), "{name} wrote a file");
    }
}

#[test]
fn solve_writes_json_vtu_and_svg() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    model_offline()
        .args([
            "solve",
            "paper",
            "--paddle",
            "3",
            "--depth",
            "0.05",
            "--paddle-displacement",
            "-0.001,0.002",
            "--quiet",
        ])
        .arg("--json")
        .arg(file("b.json"))
        .arg("--vtu")
        .arg(file("b.vtu"))
        .arg("--svg")
        .arg(file("b.svg"))
        .assert()
        .success();
    let result = json(&file("b.json"));
    assert_eq!(result["nodes"], 106);
    assert!(result["target_displacement"][1].as_f64().unwrap() < -0.01);
    let vtu = std::fs::read_to_string(file("b.vtu")).unwrap();
    for name in ["displacement", "strain", "stress", "det_f"] {
        assert!(vtu.contains(name), "{name}");
    }
    assert!(std::fs::read_to_string(file("b.svg")).unwrap().ends_with("</svg>\n"));
    assert!(file("b-parts.vtu").is_file() && file("b.py").is_file());
}

/// A pipe takes the body, and nothing can be put beside it.
#[cfg(unix)]
#[test]
fn a_vtu_that_goes_into_a_pipe_has_nothing_beside_it() {
    let call = ["solve", "paper", "--depth", "0.01", "--quiet", "--vtu", "/dev/stdout"];
    let piped = model_offline().args(call).assert().success();
    let text = String::from_utf8_lossy(&piped.get_output().stdout).into_owned();
    assert!(text.starts_with("<?xml") && text.trim_end().ends_with("</VTKFile>"), "{}", text.len());
    assert!(!Path::new("/dev/stdout.py").exists() && !Path::new("/dev/stdout-parts.vtu").exists());
}

/// Standard output is the result and nothing else; what would be said there is on standard error.
#[cfg(unix)]
#[test]
fn a_result_on_standard_output_is_not_mixed_with_words() {
    for call in [&["place", "paper"][..], &["check", "paper"], &["solve", "paper", "--depth", "0.01"], &["materials"]] {
        let piped = model_offline().args(call).args(["--json", "/dev/stdout"]).assert().success();
        let output = piped.get_output();
        let _: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(!output.stderr.is_empty(), "{call:?}");
    }
}

/// What cannot be written is told once, with its reason.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_once() {
    let refused = model_offline().args(["place", "paper", "--quiet", "--json", "/dev/full"]).assert().code(1);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert_eq!(said.matches("No space left").count(), 1, "{said}");
    // Where words cannot be said either, there is no panic.
    let displaced = ["solve", "paper", "--paddle", "3", "--paddle-displacement=-0.12,0", "--depth", "0.001"];
    for (call, code) in [
        (&["check", "paper", "--json", "/dev/stdout"][..], 1),
        (&["check", "none.toml"], 2),
        // A note, which is all that is lost, and a tip.
        (&displaced, 0),
        (&["plaec", "paper"], 2),
    ] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let program = assert_cmd::cargo::cargo_bin!("model-offline");
        let output = std::process::Command::new(program).args(call).stderr(full).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{call:?}");
    }
}

/// The JSON goes into a pipe that is slow to be read, a signal comes meanwhile, and the picture is still to be written.
#[cfg(unix)]
#[test]
fn a_signal_does_not_part_files_that_belong_together() {
    use std::io::Read as _;
    use std::process::{Command, Stdio};
    let folder = tempfile::tempdir().unwrap();
    let [pipe, picture] = ["a.json", "a.svg"].map(|name| folder.path().join(name));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut command = Command::new(env!("CARGO_BIN_EXE_model-offline"));
    command.args(["solve", "paper", "--spacing", "0.05", "--depth", "0.01", "--quiet", "--json"]).arg(&pipe);
    let mut solve = command.arg("--svg").arg(&picture).stdin(Stdio::null()).spawn().unwrap();
    let mut json = std::fs::File::open(&pipe).unwrap();
    let mut text = vec![0];
    json.read_exact(&mut text).unwrap();
    assert!(Command::new("kill").arg(solve.id().to_string()).status().unwrap().success());
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(solve.try_wait().unwrap().is_none(), "it ended with the picture not written");
    json.read_to_end(&mut text).unwrap();
    assert!(solve.wait().unwrap().success());
    // More than a pipe holds, or it was all written before the signal came.
    assert!(text.len() > 70_000, "{}", text.len());
    serde_json::from_slice::<serde_json::Value>(&text).unwrap();
    assert!(std::fs::read_to_string(&picture).unwrap().ends_with("</svg>\n"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_computation_that_fails_exits_1_with_the_reason_in_the_json() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("b.json");
    model_offline().args(["solve", "paper", "--paddle", "3", "--depth", "0.6", "--json"]).arg(&out).assert().code(1);
    let reason = json(&out)["failure"]["reason"].as_str().unwrap().to_owned();
    assert!(["lost-stability", "element-inverted", "not-converged"].contains(&reason.as_str()), "{reason}");
    assert!(json(&out)["failure"]["detail"].as_str().unwrap().contains("last converged state at depth"));
}

#[test]
fn tables_are_written_inspected_and_refused_when_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.table");
    model_offline().args(["table", "paper", "--quiet", "-o"]).arg(&path).assert().success();
    let contents = folder.path().join("p.json");
    model_offline().arg("inspect").arg(&path).arg("--json").arg(&contents).assert().success();
    assert_eq!(json(&contents)["paddle"]["index"], 3);
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&path, &bytes).unwrap();
    model_offline().arg("inspect").arg(&path).assert().code(2);
    model_offline().arg("inspect").arg(folder.path().join("absent")).assert().code(2);
    model_offline().args(["table", "paper", "--paddle", "9", "-o"]).arg(&path).assert().code(2);
}

/// A table without a second knot is none: whose, where and what may help.
#[test]
fn a_table_that_stops_before_its_second_knot_says_where_and_what_may_help() {
    let folder = tempfile::tempdir().unwrap();
    let [deep, table] = ["deep.toml", "deep.table"].map(|name| folder.path().join(name));
    let text = std::fs::read_to_string(scene("paper.toml")).unwrap();
    assert!(text.contains("\ndepth = 0.1\n"));
    std::fs::write(&deep, text.replace("\ndepth = 0.1\n", "\ndepth = 1.0\n")).unwrap();
    let call = model_offline().arg("table").arg(&deep).args(["--knots", "2", "-o"]).arg(&table).assert().code(1);
    let said = String::from_utf8_lossy(&call.get_output().stderr).into_owned();
    let flat = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    for word in ["no table of paddle 3", "to depth 1.0000, where its second knot is", "--tolerance or --spacing"] {
        assert!(flat.contains(word), "{word}: {said}");
    }
    assert!(!table.exists());
}

#[test]
fn usage_errors_exit_2() {
    model_offline().args(["place"]).assert().code(2);
    model_offline().args(["place", "paper", "--spacing", "-1"]).assert().code(2);
    model_offline().args(["place", "paper", "--spacing", "nan"]).assert().code(2);
    model_offline().args(["place", "paper", "--spacing", "1e-9"]).assert().code(2);
    model_offline().args(["place", "paper", "--support", "0.2"]).assert().code(2);
    model_offline().args(["place", "paper", "--spacing", "0.1", "--tolerance", "0.1"]).assert().code(2);
    model_offline().args(["place", "no-such-scene.toml"]).assert().code(2);
    model_offline().args(["solve", "paper", "--paddle", "3", "--depth", "nan"]).assert().code(2);
    model_offline().args(["schema"]).assert().success();
}

/// Questions need somebody who answers.
#[test]
fn paddles_are_lists_and_displacements_are_of_the_bodys_size() {
    // (arguments, exit code, what is said). Errors are wrapped: what is looked for stands in one line.
    let two = ["solve", "block", "--tolerance", "0.5", "--paddle", "3, 6", "--depth", "0.001"];
    model_offline().args(two).assert().success();
    let cases: [(&[&str], &str); 3] = [
        (&["solve", "paper", "--depth", "0.01", "--paddle", "3,4"], "--paddle names 2 paddles"),
        (
            &["solve", "paper", "--depth", "0.01", "--paddle", "3", "--paddle-displacement", "1e300,0"],
            "--paddle-displacement has 1e300,",
        ),
        (
            &["solve", "block", "--depth", "0.01", "--paddle", "3", "--paddle-displacement", "0,0,-1e9"],
            "--paddle-displacement has -1000000000,",
        ),
    ];
    for (args, said) in cases {
        let refused = model_offline().args(args).assert().code(2);
        let text = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(text.contains(said), "{args:?}: {text}");
    }
}

#[test]
fn without_a_terminal_nothing_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let asked = model_offline().args(["new", "--interactive", "-o"]).arg(&output).write_stdin("100\n").assert();
    let said = String::from_utf8(asked.code(2).get_output().stderr.clone()).unwrap();
    assert!(said.contains("--interactive asks on a terminal") && !output.exists(), "{said}");
    model_offline().args(["new", "--interactive", "--svg", "drawing.svg"]).assert().code(2);
}

#[test]
fn what_a_study_varies_itself_is_refused_with_the_reason() {
    for (command, option) in
        [("sweep", "--tolerance=0.1"), ("pareto", "--support=2"), ("stability", "--integration=scni")]
    {
        let assert = model_offline().args([command, "paper", "--out", "unused", option]).assert().code(2);
        let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(said.contains("studies vary this themselves"), "{said}");
    }
    assert!(!Path::new("unused").exists());
}

/// A depth that was computed from the scene's, and is one rounding deeper, is that depth; what is deeper is refused.
#[test]
fn a_shaft_goes_as_deep_as_the_scene_says_and_no_deeper() {
    let folder = tempfile::tempdir().unwrap();
    let solve = |depth: &str| {
        let out = folder.path().join(format!("{depth}.json"));
        let mut command = model_offline();
        command.args(["solve", "breast-world", "--depth", depth, "--json"]).arg(&out);
        (command.assert(), out)
    };
    let [(exact, whole), (rounded, deeper)] = ["12", "12.000000000000002"].map(solve);
    exact.success();
    rounded.success();
    assert_eq!(json(&whole)["target_displacement"], json(&deeper)["target_displacement"]);
    let (refused, none) = solve("12.001");
    let stderr = String::from_utf8(refused.failure().code(2).get_output().stderr.clone()).unwrap();
    assert!(stderr.contains("the needle of this scene goes to 12") && !none.exists(), "{stderr}");
}
