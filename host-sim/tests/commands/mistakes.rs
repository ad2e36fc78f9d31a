//! Wrong things that a newcomer does: each ends with the exit code of bad input, says what and where or what to do,
//! and writes nothing.

use std::path::Path;

use assert_cmd::Command;

#[test]
fn mistakes_of_a_first_day() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    std::fs::write(inside("notes.txt"), "not a scene").unwrap();
    std::fs::write(inside("empty.toml"), "").unwrap();
    std::fs::write(inside("random.rec"), [7; 400]).unwrap();
    std::fs::write(inside("random.table"), [7; 400]).unwrap();
    std::fs::create_dir(inside("full")).unwrap();
    std::fs::write(inside("full/thesis.tex"), "years of work").unwrap();
    let before = entries(folder.path());
    // What is typed, and words that the answer must have.
    let mistakes: &[(&[&str], &[&str])] = &[
        (&["timming"], &["timming", "similar", "timing"]),
        (&["rnu"], &["rnu", "did you mean `run`"]),
        (&["place", "paper"], &["place", "model-offline"]),
        (&["--tissue", "inclusion"], &["--tissue", "an option of run: host-sim run --tissue"]),
        (&["--scene=paper"], &["host-sim run --scene"]),
        (&["--nonsense"], &["--nonsense"]),
        (&["run", "--scene", "absent.toml"], &["absent.toml", "bundled"]),
        (&["run", "--scene", "notes.txt"], &["notes.txt:1:"]),
        (&["run", "--scene", "empty.toml"], &["empty", "start from"]),
        (&["run", "--scene", "full"], &["full", "bundled"]),
        (&["run", "--rate", "fast"], &["fast", "--rate"]),
        (&["run", "--rate", "0"], &["--rate must be between 0.02 and 100000 Hz"]),
        (&["run", "--rate", "-5"], &["--rate must be between"]),
        (&["run", "--noise", "-1e-3"], &["--noise must be between"]),
        (&["run", "--seed", "-1"], &["--seed", "-1"]),
        (&["timing", "--priority", "-1"], &["--priority", "-1"]),
        (&["timing", "--max-lateness", "-1"], &["--max-lateness must be between"]),
        (&["run", "--tissue", "bone"], &["bone", "homogeneous"]),
        (&["run", "--tisue", "inclusion"], &["--tissue"]),
        (&["run", "--out", "full"], &["full", "another directory"]),
        (&["run", "--out", "absent/deeper"], &["absent", "does not exist"]),
        (&["run", "--table", "random.table"], &["random.table"]),
        (&["run", "--table", "absent.table"], &["absent.table"]),
        (&["run", "--target-rate", "5000"], &["target sensor is faster than the loop"]),
        (&["run", "--latency", "100000"], &["--latency must be between 0 and 60000 ms"]),
        (&["run", "--rate", "3e9"], &["--rate"]),
        (&["run", "--duration", "1e12"], &["--duration"]),
        (&["run", "--duration", "86400", "--rate", "1000"], &["86400000 ticks", "shorter"]),
        (&["run", "--paddle-delay", "4000000000"], &["--paddle-delay"]),
        (&["run", "--json", "full"], &["--json full", "directory"]),
        (&["run", "--json", "absent/x.json"], &["--json absent/x.json"]),
        (&["run", "--out", "new", "--json", "new/report.html"], &["--json new/report.html"]),
        (&["run", "--allow-other-scene"], &["--table"]),
        (&["plant", "--patience", "1e30"], &["--patience must be between"]),
        (&["timing", "--cpu", "9999"], &["--cpu 9999", "processors 0 to"]),
        (&["timing", "--rate", "1e9"], &["--rate"]),
        (&["timing", "--json", "absent/x.json"], &["--json"]),
        (&["timing", "--interval", "0"], &["--interval must be between", "µs"]),
        (&["timing", "-i", "1000", "--rate", "1000"], &["--interval", "--rate"]),
        (&["timing", "--max-lateness", "1e9"], &["--max-lateness must be between"]),
        (&["timing", "--json", "same", "--histogram", "./same"], &["--histogram", "same file"]),
        (&["faults", "--effort", "1e300"], &["--effort"]),
        (&["export", "random.rec", "--csv", "random.rec"], &["random.rec", "input"]),
        (&["export", "random.rec", "--csv", "same", "--mcap", "./same"], &["same file"]),
        (&["controller", "--table", "random.table", "--record", "random.table"], &["--record", "input"]),
        (&["run", "--view-port", "8080"], &["--view"]),
        (&["replay", "random.rec"], &["random.rec", "not a recording"]),
        (&["replay"], &["RECORDING"]),
        (&["report", "full"], &["result.json"]),
        (&["export", "random.rec"], &["--mcap"]),
        (&["controller"], &["--table"]),
        (&["timing", "--seconds", "0"], &["--seconds must be between"]),
    ];
    for (typed, words) in mistakes {
        let assert =
            Command::new(env!("CARGO_BIN_EXE_host-sim")).args(*typed).current_dir(folder.path()).assert().code(2);
        let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        println!("$ host-sim {}\n{said}", typed.join(" "));
        // Wrapped to the terminal: spaces may be line breaks.
        let flat = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        for word in *words {
            assert!(flat.contains(word), "host-sim {}: {word:?} is not in\n{said}", typed.join(" "));
        }
        assert!(!said.contains("panicked") && !said.contains('\u{1b}'), "no panic, no colours in a pipe: {said}");
    }
    assert_eq!(entries(folder.path()), before, "nothing was written");
}

/// A body whose third paddle all but misses the target, more so without its inclusions: the tolerance is beyond what is tried
/// there, and its condition number so near to the limit of 1e3 that it cannot be left out.
const HARD_WITHOUT_INCLUSIONS: &str = r#"
[scene]
name = "concave"
dimension = 2
units = { length = "m", stress = "kPa" }

[domain]
outline = [[0, 0], [0.12, 0], [0.12, 0.05], [0.1, 0.08], [0.075, 0.08], [0.06, 0.055], [0.045, 0.08], [0.02, 0.08], [0, 0.05]]

[material]
model = "neo-hookean"
lambda = 4.0
mu = 1.0

[[inclusion]]
outline = [[0.03, 0.02], [0.05, 0.02], [0.05, 0.04], [0.03, 0.04]]
stiffness = 8.0

[[inclusion]]
outline = [[0.105, 0.02], [0.13, 0.02], [0.13, 0.04], [0.105, 0.04]]
stiffness = 5.0

[immobile]
paths = [[[0, 0], [0.12, 0]]]

[needle]
contact = [[0.095, 0.08], [0.08, 0.08]]
axis = [0.0, -1.0]
depth = 0.002
increments = 10

[target]
position = [0.08374, 0.03]

[[paddle]]
index = 2
segment = [[0.12, 0.015], [0.12, 0.04]]

[[paddle]]
index = 3
segment = [[0.025, 0.08], [0.04, 0.08]]

[discretization]
spacing = 0.004
integration = "fem-t6"
"#;

/// A run on two tissues says which of them it cannot have, and how it can have the other: the best paddle cannot hold the target
/// in one of them; at a tolerance of 0.05 % the other is not known well enough.
#[test]
fn a_tissue_that_cannot_be_simulated_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("concave.toml"), HARD_WITHOUT_INCLUSIONS).unwrap();
    let harder = HARD_WITHOUT_INCLUSIONS.replace("spacing = 0.004", "tolerance = 0.0005");
    std::fs::write(folder.path().join("harder.toml"), harder).unwrap();
    let run = |scene: &str, more: &[&str]| {
        let words = "run --mode lockstep --insertion-time 0.1 --quiet --out report --scene";
        let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        run.args(words.split(' ')).arg(scene).args(more).current_dir(folder.path()).assert()
    };
    let said = |refused: assert_cmd::assert::Assert| {
        let output = refused.code(1);
        assert!(!folder.path().join("report").exists());
        // Lines are as wide as a terminal.
        let said = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
        said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
    };
    let both = said(run("concave.toml", &[]));
    assert!(both.contains("table of the homogeneous tissue cannot be computed for paddle 2"), "{both}");
    assert!(both.contains("max_displacement") && both.contains("--tissue inclusion does without it"), "{both}");
    let alone = said(run("concave.toml", &["--tissue", "homogeneous"]));
    assert!(alone.contains("homogeneous tissue cannot be computed") && !alone.contains("does without"), "{alone}");
    let harder = said(run("harder.toml", &[]));
    assert!(harder.contains("the inclusion tissue cannot be simulated") && harder.contains("paddle 2"), "{harder}");
    assert!(harder.contains("--tissue homogeneous does without it"), "{harder}");
}

/// And that other tissue can be had. By itself, so that it takes its time beside the refusals.
#[test]
fn without_the_tissue_that_cannot_be_simulated_there_is_a_run() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("concave.toml"), HARD_WITHOUT_INCLUSIONS).unwrap();
    let words = "run --mode lockstep --insertion-time 0.1 --quiet --out report --scene concave.toml --tissue inclusion";
    let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    run.args(words.split(' ')).current_dir(folder.path()).assert().success();
    assert!(folder.path().join("report").exists());
}

fn entries(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let mut found: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
}

#[test]
fn every_command_has_an_example_in_its_help() {
    for command in commands(Path::new(env!("CARGO_BIN_EXE_host-sim"))) {
        let assert = Command::new(env!("CARGO_BIN_EXE_host-sim")).args([command.as_str(), "--help"]).assert().success();
        let said = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
        assert!(said.contains("Example") && said.contains(&format!("host-sim {command}")), "{said}");
    }
}

/// The commands that a program's help names.
fn commands(program: &Path) -> Vec<String> {
    let assert = Command::new(program).arg("--help").assert().success();
    let said = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    let listed = said.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names: Vec<String> = listed.map(|line| line.split_whitespace().next().unwrap().to_owned()).collect();
    names.into_iter().filter(|name| name != "help").collect()
}

#[test]
fn a_command_of_the_other_program_is_told_from_a_wrong_one() {
    let host_sim = Path::new(env!("CARGO_BIN_EXE_host-sim"));
    let model_offline = host_sim.with_file_name("model-offline");
    if !model_offline.is_file() {
        return crate::missing::skip(
            "commands of the other program",
            "model-offline is not built: `cargo test --workspace` does",
        );
    }
    for (program, other) in [(host_sim, model_offline.as_path()), (&model_offline, host_sim)] {
        let own = commands(program);
        let elsewhere: Vec<String> = commands(other).into_iter().filter(|command| !own.contains(command)).collect();
        assert!(elsewhere.len() > 5, "{elsewhere:?}");
        let name = other.file_name().unwrap().to_string_lossy();
        for command in elsewhere {
            let assert = Command::new(program).arg(&command).assert().code(2);
            let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
            assert!(said.contains(&format!("`{command}` is a command of {name}")), "{said}");
        }
    }
}
