//! The example in C, built and run: every command is that of the controller in Rust, bit by bit.

mod toolchain;

use std::path::Path;
use std::process::Command;

use firmware::contract::frames::{TARGET_VISIBLE, from_plane, to_plane};
use firmware::{Controller, Inputs, Mode, NeedleSample, PaddleCommand, PaddleSample, Settings, State, TargetSample};

/// The tissue of `example/loop.c`, operation by operation.
struct Tissue {
    depth: f64,
    speed: f64,
    end: f64,
    paddle: [f64; 2],
    late: Option<TargetSample>,
}

impl Tissue {
    fn target(&self) -> [f64; 2] {
        let [x, y] = self.paddle;
        [0.30 * x + 0.05 * y + 0.025 * self.depth, -0.04 * x + 0.25 * y - 0.1 * self.depth]
    }

    fn sense(&mut self, tick: u32) -> Inputs {
        let time_ns = u64::from(tick) * 1_000_000;
        let needle = NeedleSample { sequence: tick, reserved: 0, time_ns, depth: self.depth, velocity: self.speed };
        let paddle = PaddleSample { sequence: tick, paddle_index: 3, time_ns, displacement: from_plane(self.paddle) };
        let mut target = None;
        if tick.is_multiple_of(20) {
            let flags = if (2000..2100).contains(&tick) { 0 } else { TARGET_VISIBLE };
            let seen = TargetSample { sequence: tick / 20, flags, time_ns, displacement: from_plane(self.target()) };
            target = self.late.replace(seen);
        }
        let needle = (!(3000..3400).contains(&tick)).then_some(needle);
        Inputs { tick: tick.into(), time_ns, needle, target, paddles: [Some(paddle), None] }
    }

    fn act(&mut self, command: &PaddleCommand) {
        if command.is_valid() {
            self.paddle = to_plane(command.displacement[0]);
        }
        self.depth += self.speed * 1e-3;
        if self.depth >= self.end {
            (self.depth, self.speed) = (self.end, 0.0);
        }
    }
}

/// What the example prints with `--bits`, and the modes in it.
fn expected(table: &[u8]) -> (Vec<String>, Vec<Mode>) {
    const MS: u64 = 1_000_000;
    let table = firmware::decode::<f64, 2, 1, 1>(table).unwrap();
    let controller = Controller::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let mut state = State::new();
    let end = table.validity.depth_end;
    let mut tissue = Tissue { depth: 0.0, speed: 0.2 * end, end, paddle: [0.0; 2], late: None };
    let mut modes = Vec::new();
    let step = |tick| {
        let c = controller.step(&mut state, &tissue.sense(tick));
        modes.push(state.mode());
        if tick == 3500 {
            state.rearm();
        }
        tissue.act(&c);
        let [x, y] = to_plane(c.displacement[0]).map(f64::to_bits);
        format!(
            "{} {} {} {} {:x} {x:016x} {y:016x} {} {} {} {}",
            c.sequence,
            c.state,
            c.tick,
            c.time_ns,
            c.faults,
            c.needle_sequence,
            c.target_sequence,
            c.paddle_index[0],
            c.flags
        )
    };
    ((0..6000).map(step).collect(), modes)
}

fn assert_same(program: &Path) {
    let path = toolchain::package().join("../tests/planar.table");
    let output = Command::new(program).arg(&path).arg("--bits").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    let (expected, modes) = expected(&std::fs::read(&path).unwrap());
    let different = printed.lines().zip(&expected).find(|(printed, expected)| printed != expected);
    assert_eq!(different, None, "printed and expected");
    assert_eq!(printed.lines().count(), expected.len());
    // The run is worth comparing: every mode, and RUN again in the end.
    for mode in [Mode::Hold, Mode::Run, Mode::Safe] {
        assert!(modes.iter().filter(|seen| **seen == mode).count() > 50, "{mode}");
    }
    assert_eq!(modes.last(), Some(&Mode::Run));
}

#[test]
fn commands_in_c_are_those_in_rust() {
    let Some(build) = toolchain::Build::new("the example in C") else { return };
    let program = build.compile("gcc", &["-std=c11", "-ffp-contract=off"]);
    assert_same(&program);
    let words = Command::new(&program).arg(toolchain::package().join("../tests/planar.table")).output().unwrap();
    let words = String::from_utf8(words.stdout).unwrap();
    for mode in [" HOLD ", " RUN ", " SAFE ", "NEEDLE_DEAD"] {
        assert!(words.contains(mode), "{words}");
    }
}

#[test]
fn the_example_is_also_cpp() {
    let Some(build) = toolchain::Build::new("the example in C++") else { return };
    assert_same(&build.compile("g++", &["-x", "c++", "-std=c++17", "-ffp-contract=off"]));
}

/// Out of bounds, use of what is uninitialised on the C side of the border, overflow, misaligned access.
#[test]
fn the_example_is_clean_under_sanitizers() {
    let Some(build) = toolchain::Build::new("the example under sanitizers") else { return };
    let sanitize = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    assert_same(&build.compile("gcc", &["-std=c11", "-g", "-ffp-contract=off", sanitize[0], sanitize[1]]));
}

/// Accesses inside of the library, which no sanitizer has instrumented. Without the check for what is uninitialised: the
/// compiler compares the payload of an `Option` before its tag, and then forgets what it found.
#[test]
fn the_example_is_clean_under_valgrind() {
    let Some(build) = toolchain::Build::new("the example under valgrind") else { return };
    if !toolchain::answers("valgrind") {
        eprintln!("skipped: the example was not run under valgrind, which is not installed");
        return;
    }
    let program = build.compile("gcc", &["-std=c11", "-g", "-ffp-contract=off"]);
    let checked = Command::new("valgrind")
        .args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--undef-value-errors=no"])
        .args([&program, &toolchain::package().join("../tests/planar.table")])
        .output()
        .unwrap();
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
}

#[test]
fn the_example_says_what_is_wrong() {
    let Some(build) = toolchain::Build::new("the example in C") else { return };
    let program = build.compile("gcc", &["-std=c11"]);
    let folder = tempfile::tempdir().unwrap();
    let mut table = std::fs::read(toolchain::package().join("../tests/planar.table")).unwrap();
    table[100] ^= 1;
    let (damaged, empty) = (folder.path().join("damaged.table"), folder.path().join("empty.table"));
    std::fs::write(&damaged, &table).unwrap();
    std::fs::write(&empty, b"").unwrap();
    for (path, code, says) in [(&damaged, 1, "write it again with `model-offline table`"), (&empty, 2, "cannot read")] {
        let output = Command::new(&program).arg(path).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(says), "{said}");
    }
}
