//! Every option of both programs with extreme values: exit code 0, 1 or 2, a word about what is wrong, no panic, no
//! file that is left half made. The options come from clap's own command tree, by way of the completion script, so that
//! new ones are tried without anybody's doing. `STILLPOINT_OPTIONS=all` tries every value on every option.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Nobody means these; some are numbers all the same.
const EXTREMES: [&str; 16] = [
    "-1",
    "0",
    "1e-320",
    "3e9",
    "1e30",
    "1e308",
    "1e999",
    "NaN",
    "-inf",
    "18446744073709551615",
    "18446744073709551616",
    "-9223372036854775808",
    "4294967296",
    "",
    "é\u{202e}\n",
    "/proc/nowhere/file",
];
/// Values per option where not all are tried.
const TRIED: usize = 3;
/// Calls at once.
const AT_ONCE: usize = 3;
/// What is at work for so long has taken its options; it is then told to end.
const AT_WORK: Duration = Duration::from_secs(2);
/// What has been told to end and does not.
const HANGS: Duration = Duration::from_secs(20);

/// What every command is called with to do something short; options that name outputs name them in `OUT`.
const HOST_SIM: [(&str, &str); 18] = [
    ("run", "--tissue homogeneous --mode lockstep --insertion-time 0.05 --quiet --out OUT/report"),
    ("controller", "--table IN/paper.table --link LINK --patience 0.05 --record OUT/a.rec --json OUT/a.json"),
    ("plant", "--link LINK --paddle 3 --patience 0.05 --insertion-time 0.05 --json OUT/a.json"),
    ("timing", "--seconds 0.05 --json OUT/a.json"),
    ("timing-peer", "--exchange link --link LINK --table IN/paper.table --rate 1000 --priority 0"),
    ("faults", "--only 7 --seeds 1 --out OUT/faults"),
    ("stability", "--quick --out OUT/stability"),
    ("tables", "--out OUT/tables"),
    ("worlds", "--scene paper --seeds 1 --json OUT/a.json"),
    ("bridge", "--send-to 127.0.0.1:9 --listen 127.0.0.1:0 --link LINK --patience 0.05 --json OUT/a.json"),
    ("rearm", "1"),
    ("replay", "IN/paper.rec"),
    ("board", "IN/paper.rec"),
    ("export", "IN/paper.rec --mcap OUT/a.mcap --csv OUT/a.csv --scene paper --layout OUT/a.json"),
    ("schema", ""),
    ("completions", "bash"),
    ("man", "OUT/man"),
    ("report", "IN/report"),
];
const MODEL_OFFLINE: [(&str, &str); 17] = [
    ("place", "paper --quiet --json OUT/a.json"),
    ("check", "paper --json OUT/a.json"),
    ("draw", "IN/report/result.json -o OUT/a.svg"),
    ("solve", "paper --paddle 3 --depth 0.01 --json OUT/a.json"),
    ("table", "paper --paddle 3 -o OUT/a.table"),
    ("stability", "paper --quick --out OUT/stability"),
    ("inspect", "IN/paper.table --json OUT/a.json"),
    ("pareto", "paper --quick --out OUT/pareto"),
    ("sweep", "paper --out OUT/sweep"),
    ("fit", "paper --tolerance 0.1 -o OUT/a.toml"),
    ("slice", "block -o OUT/a.toml --json OUT/b.json"),
    ("compare", "paper --json OUT/a.json --csv OUT/a.csv --svg OUT/a.svg"),
    ("new", "-o OUT/a.toml"),
    ("completions", "bash"),
    ("man", "OUT/man"),
    ("materials", "--json OUT/a.json"),
    ("schema", ""),
];

/// A program under test.
struct Program {
    path: PathBuf,
    commands: &'static [(&'static str, &'static str)],
    /// Whether signals are answered with exit code 1.
    answers_signals: bool,
}

fn programs() -> Vec<Program> {
    let path = PathBuf::from(assert_cmd::cargo::cargo_bin!("host-sim"));
    let other = path.with_file_name("model-offline");
    let mut programs = vec![
        Program { path, commands: &HOST_SIM, answers_signals: true },
        Program { path: other, commands: &MODEL_OFFLINE, answers_signals: false },
    ];
    programs.retain(|program| {
        let is_built = program.path.is_file();
        if !is_built {
            let path = program.path.display();
            crate::missing::skip("every option of it", format!("{path} is not built; `cargo test --workspace` does"));
        }
        is_built
    });
    programs
}

/// An option that takes a value, as a completion script knows it.
fn option(line: &str) -> Option<String> {
    // What follows the description: `-r` stands for a value.
    let (names, rest) = line.split_once(" -d '")?;
    let takes_value = rest.contains("' -r");
    let word = |flag: &str| Some(names.split_once(flag)?.1.split_whitespace().next()?.to_owned());
    let name = word(" -l ").map(|long| format!("--{long}")).or_else(|| word(" -s ").map(|short| format!("-{short}")));
    name.filter(|_| takes_value)
}

/// Commands with their options that take a value.
fn tree(program: &Program) -> Vec<(String, Vec<String>)> {
    let output = Command::new(&program.path).args(["completions", "fish"]).output().unwrap();
    let script = String::from_utf8(output.stdout).unwrap();
    let name = program.path.file_name().unwrap().to_str().unwrap();
    let mark = format!("complete -c {name} -n \"__fish_{}_using_subcommand ", name.replace('-', "_"));
    let mut found: Vec<(String, Vec<String>)> = Vec::new();
    for line in script.lines().filter_map(|line| line.strip_prefix(&mark)) {
        let Some((command, rest)) = line.split_once('"') else { continue };
        // Help of help has no options.
        if command.contains(' ') {
            continue;
        }
        if found.last().is_none_or(|(last, _)| last != command) {
            found.push((command.to_owned(), Vec::new()));
        }
        let options = &mut found.last_mut().unwrap().1;
        options.extend(option(rest));
    }
    found
}

/// The words of a base call without one option and its value.
fn without(base: &[String], option: &str) -> Vec<String> {
    let Some(at) = base.iter().position(|word| word == option) else { return base.to_vec() };
    base[..at].iter().chain(&base[at + 2..]).cloned().collect()
}

/// Files below a directory.
fn files(directory: &Path) -> BTreeSet<PathBuf> {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { BTreeSet::from([path]) }).collect()
}

/// Runs to its end, or tells it to end. Whether it was told.
fn finish(mut command: Command) -> (Output, bool) {
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut said = Vec::new();
        let _ = std::io::Read::read_to_end(&mut stderr, &mut said);
        said
    });
    let started = Instant::now();
    let mut told = false;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if !told && started.elapsed() > AT_WORK {
            told = true;
            Command::new("kill").arg(child.id().to_string()).status().unwrap();
        }
        if started.elapsed() > HANGS {
            let _ = child.kill();
            panic!("does not end when it is told: {command:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    (Output { status, stdout: Vec::new(), stderr: reader.join().unwrap() }, told)
}

/// Inputs that commands need.
fn inputs(folder: &Path) {
    let table = model_offline::table::to_bytes(&host_sim::bench::paper_table::paper_table().unwrap()).unwrap();
    std::fs::write(folder.join("paper.table"), table).unwrap();
    let report = folder.join("report");
    let made = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
        .args(["run", "--tissue", "inclusion", "--mode", "lockstep", "--insertion-time", "0.2", "--quiet", "--out"])
        .arg(&report)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    std::fs::copy(report.join("inclusion-dynamic.rec"), folder.join("paper.rec")).unwrap();
}

/// One call; what is wrong with how it went.
fn attempt(program: &Program, command: &str, words: &[String], out: &Path) -> Result<(), String> {
    let mut call = Command::new(&program.path);
    call.arg(command).args(words).current_dir(out);
    let shown = format!("{call:?}");
    let (output, told) = finish(call);
    let said = String::from_utf8_lossy(&output.stderr);
    let wrong = |what: &str| Err(format!("{shown}: {what}, {}: {said}", output.status));
    if said.contains("panicked") {
        return wrong("panicked");
    }
    match output.status.code() {
        Some(0) => return Ok(()),
        Some(1 | 2) if said.trim().is_empty() => return wrong("says nothing"),
        Some(1 | 2) => {}
        // It does not answer signals, and wrote nothing either.
        None if told && !program.answers_signals => {}
        _ => return wrong("neither 0, 1 nor 2"),
    }
    // What a controller records while it runs is whole up to where it ended; a plant says why nothing came about.
    let tells = |path: &PathBuf| std::fs::read_to_string(path).is_ok_and(|text| text.contains("\"ended\""));
    let is_kept = |path: &PathBuf| match command {
        "controller" => path.ends_with("a.rec"),
        "plant" => tells(path),
        _ => false,
    };
    let left: Vec<_> = files(out).into_iter().filter(|path| !is_kept(path)).collect();
    // `solve` reports how far it came, whole, also when that was not far enough; `timing` what it measured, when nothing of it
    // can be compared; controller and bridge have accounts however they end.
    let excused = ["bridge", "controller", "faults", "solve", "timing"].contains(&command);
    if !excused && !left.is_empty() {
        return wrong(&format!("left {left:?}"));
    }
    Ok(())
}

/// The values that are tried on the nth option: all, or some that differ from one option to the next.
fn values(n: usize) -> Vec<&'static str> {
    let tried = if std::env::var("STILLPOINT_OPTIONS").is_ok_and(|all| all == "all") { EXTREMES.len() } else { TRIED };
    (0..tried).map(|i| EXTREMES[(n * 5 + i * 7) % EXTREMES.len()]).collect()
}

#[test]
fn no_option_takes_a_value_that_it_cannot_bear() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    let programs = programs();
    let mut calls: Vec<(&Program, String, &str, String, &str)> = Vec::new();
    for program in &programs {
        let tree = tree(program);
        assert!(tree.len() > 8, "{tree:?}");
        for (command, options) in tree.into_iter().filter(|(command, _)| command != "help") {
            let base = program.commands.iter().find(|(name, _)| *name == command);
            let (_, base) = base.unwrap_or_else(|| panic!("say how to call `{command}` in this test"));
            for (n, option) in options.into_iter().enumerate() {
                calls.extend(
                    values(n).into_iter().map(|value| (program, command.clone(), *base, option.clone(), value)),
                );
            }
        }
    }
    let one = |k: usize| {
        let (program, command, base, option, value) = &calls[k];
        let out = folder.path().join(format!("out-{k}"));
        std::fs::create_dir(&out).unwrap();
        let link = format!("options-{}-{k}", std::process::id());
        let base = base.replace("OUT", out.to_str().unwrap()).replace("IN/", &format!("{}/", folder.path().display()));
        let base: Vec<_> = base.replace("LINK", &link).split_whitespace().map(str::to_owned).collect();
        let mut words = without(&base, option);
        words.push(if option.starts_with("--") { format!("{option}={value}") } else { format!("{option}{value}") });
        let went = attempt(program, command, &words, &out).err();
        let _ = std::fs::remove_dir_all(&out);
        went
    };
    // Most of them wait: for a peer, or to be told to end.
    let wrong: Vec<String> = model_offline::parallel::map(calls.len(), AT_ONCE, one).into_iter().flatten().collect();
    let calls = calls.len();
    assert!(calls > 100, "only {calls} calls: is the completion script read as it is written?");
    assert!(wrong.is_empty(), "{} of {calls} calls:\n{}", wrong.len(), wrong.join("\n"));
    println!("{calls} calls");
}
