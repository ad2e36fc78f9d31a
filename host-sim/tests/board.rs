//! The controller at the end of a serial line: in a thread of this process always, in QEMU where it is installed.

mod emulator;
mod missing;
mod scenes;

use firmware::contract::frames::to_plane;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use firmware::contract::{PaddleCommand, Table, Validity};
use firmware::scalar::ScalarKind;
use firmware::serial::{Board, Memory, Refusal, Reply, Request, ResetCause, serve};
use firmware::{Faults, Inputs, Mode, Settings};
use host_sim::bench::faults::shuttle::ShuttleDrive;
use host_sim::bench::faults::tissue::LinearTissue;
use host_sim::bench::paper_table::paper_table;
use host_sim::exchange::board::tamper::{Damage, Tamper};
use host_sim::exchange::board::{Device, SerialLine};
use host_sim::runtime::executor::encode_as;
use host_sim::world::actuator::{ActuatorModel, PaddleActuator};
use host_sim::world::sensors::{Encoders, TargetSensor};
use host_sim::world::{Sensors, World};
use nalgebra::Vector2;

use self::emulator::image;

const MS: u64 = 1_000_000;
/// Long against a step, even on a busy machine; short for a test that loses some.
const PATIENCE: Duration = Duration::from_millis(60);

/// A board in a thread: the device's own code over a socket.
struct Socket {
    stream: UnixStream,
    waiting: std::vec::IntoIter<u8>,
    closed: bool,
}

impl Board for Socket {
    const COUNTER_HZ: u32 = 25_000_000;

    fn read(&mut self) -> Option<u8> {
        if let Some(byte) = self.waiting.next() {
            return Some(byte);
        }
        let mut buffer = [0; 1024];
        match self.stream.read(&mut buffer) {
            Ok(0) => self.closed = true,
            Ok(count) => self.waiting = Vec::from(&buffer[..count]).into_iter(),
            Err(error) => self.closed = !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        }
        self.waiting.next()
    }
    fn write(&mut self, byte: u8) {
        let _ = self.stream.write_all(&[byte]);
    }
    fn counter(&mut self) -> u32 {
        0
    }
    fn alive(&mut self) {}
    fn hang(&mut self) {}
    fn stack_bytes(&self) -> u32 {
        0
    }
    fn is_closed(&self) -> bool {
        self.closed
    }
}

/// A device in a thread, with damage on the way from it.
fn thread_device(back: Tamper) -> Device {
    let (host, board) = UnixStream::pair().unwrap();
    board.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
    std::thread::spawn(move || {
        let mut board = Socket { stream: board, waiting: Vec::new().into_iter(), closed: false };
        serve(&mut board, &mut Box::new(Memory::<f64>::new()), ResetCause::PowerOn);
    });
    let line = SerialLine::tampered(host.try_clone().unwrap(), host, Tamper::none(), back);
    Device::connect(line, ScalarKind::F64, None).unwrap()
}

fn table() -> Table<f64, 2> {
    paper_table().unwrap()
}

fn settings() -> Settings {
    Settings::new(MS, 20 * MS, 20 * MS)
}

/// The simulated world on linear tissue, without noise, at the end of the line.
struct BoardPlant<'t> {
    world: World<LinearTissue<'t>, ShuttleDrive>,
    tick: u64,
    /// Orthogonal error that nothing would hold back, length.
    uncontrolled: f64,
}

impl<'t> BoardPlant<'t> {
    fn new(table: &'t Table<f64, 2>) -> Self {
        let Validity { depth_end, needle_speed, .. } = table.validity;
        let drive = ShuttleDrive::new(table, depth_end, 0.5 * needle_speed, 1e-3);
        let actuator = ActuatorModel { max_rate: table.paddles[0].max_rate, lag_s: 0.0, delay_ticks: 0, gain: 1.0 };
        // No sensor reads the same number twice.
        let target = TargetSensor::new(20 * MS, 20 * MS, 1e-9, 1);
        let sensors = Sensors { target, encoders: Encoders::new(table.paddles[0].index) };
        let tissue = LinearTissue::new(table);
        let uncontrolled = tissue.error(&tissue.target(depth_end, &[Vector2::zeros()])).norm();
        Self { world: World::of(tissue, drive, [PaddleActuator::new(actuator)], sensors), tick: 0, uncontrolled }
    }

    /// One period under `command`, if there is one: the error, length, and the inputs of the next step.
    fn advance(&mut self, command: Option<&PaddleCommand>) -> (f64, Inputs) {
        let (truth, inputs) = self.world.tick(self.tick, command, MS).unwrap();
        self.tick += 1;
        (self.world.tissue.error(&truth.target()).norm(), inputs)
    }
}

/// What came of a run.
#[derive(Debug)]
struct BoardRun {
    last: PaddleCommand,
    lost_ticks: u64,
    worst_error: f64,
}

/// Runs the loop for so many ticks; both limits must hold on every command that arrives.
fn drive(device: &mut Device, plant: &mut BoardPlant<'_>, ticks: u64) -> BoardRun {
    let paddle = plant.world.tissue.table().paddles[0].clone();
    let step = paddle.max_rate * 1e-3;
    let mut run = BoardRun { last: PaddleCommand::default(), lost_ticks: 0, worst_error: 0.0 };
    let mut answered = None;
    for _ in 0..ticks {
        let (error, inputs) = plant.advance(answered.as_ref());
        run.worst_error = run.worst_error.max(error);
        answered = device.step(&inputs, PATIENCE).unwrap().map(|answer| answer.command);
        let Some(command) = answered else {
            run.lost_ticks += 1;
            continue;
        };
        let last = run.last;
        let moved = Vector2::from(to_plane(command.displacement[0])) - Vector2::from(to_plane(last.displacement[0]));
        let elapsed = command.sequence.wrapping_sub(last.sequence).max(1);
        assert!(Vector2::from(to_plane(command.displacement[0])).norm() <= paddle.max_displacement * (1.0 + 1e-12));
        if last.is_valid() {
            assert!(moved.norm() <= f64::from(elapsed) * step * (1.0 + 1e-9), "{last:?} → {command:?}");
        }
        run.last = command;
    }
    run
}

#[test]
fn a_damaged_line_costs_ticks_and_nothing_else() {
    let table = table();
    let bytes = encode_as(&table, ScalarKind::F64).unwrap();
    for (i, damage) in Damage::ALL.into_iter().enumerate() {
        let mut device = thread_device(Tamper::none());
        device.begin(&bytes, &settings()).unwrap();
        let mut plant = BoardPlant::new(&table);
        assert_eq!(drive(&mut device, &mut plant, 100).last.state, Mode::Run as u32);
        device.set_tamper(Tamper::new(damage, 40, i as u64));
        let damaged = drive(&mut device, &mut plant, 300);
        device.set_tamper(Tamper::none());
        let healed = drive(&mut device, &mut plant, 200);
        assert_eq!(healed.last.state, Mode::Run as u32, "{damage:?}: {}", Faults::from_bits(healed.last.faults));
        assert!(healed.worst_error < 0.2 * plant.uncontrolled, "{damage:?}: {}", healed.worst_error);

        let account = device.account().unwrap();
        assert_eq!(account.ledger.unaccounted(), 0, "{damage:?}");
        assert_eq!(account.ledger.ticks.due, 600, "{damage:?}");
        // A frame that lost its last delimiter is complete with the first one of the next: its tick comes late.
        let late = damaged.lost_ticks - account.ledger.ticks.skipped;
        assert!(late == 0 || damage == Damage::DropByte, "{damage:?}: {late}");
        let line = &account.line;
        assert_eq!(line.frames.unaccounted(), 0, "{damage:?}: {line:?}");
        let noticed = match damage {
            Damage::DropByte | Damage::CorruptByte | Damage::DoubleByte | Damage::SwapBytes => line.damaged,
            Damage::DropFrame => line.frames.lost,
            Damage::DoubleFrame => line.frames.duplicates,
            Damage::SwapFrames => line.late(),
        };
        assert!(noticed > 0, "{damage:?}: {line:?}");
        if damage == Damage::DoubleFrame {
            assert_eq!(damaged.lost_ticks, 0, "doubled frames are taken once");
        }
    }
}

#[test]
fn lost_commands_leave_the_paddle_where_it_is() {
    let table = table();
    let bytes = encode_as(&table, ScalarKind::F64).unwrap();
    for damage in [Damage::CorruptByte, Damage::DropFrame, Damage::DoubleFrame] {
        // Rare enough, with this seed, that every answer to `begin` comes through.
        let mut device = thread_device(Tamper::new(damage, 60, 5));
        device.begin(&bytes, &settings()).unwrap();
        let mut plant = BoardPlant::new(&table);
        let run = drive(&mut device, &mut plant, 600);
        assert_eq!(run.last.state, Mode::Run as u32, "{damage:?}");
        assert!(run.worst_error < 0.2 * plant.uncontrolled, "{damage:?}: {}", run.worst_error);
        assert_eq!(run.lost_ticks > 0, damage != Damage::DoubleFrame, "{damage:?}");
    }
}

#[test]
fn a_silent_host_leads_to_hold_and_then_to_safe() {
    let table = table();
    let bytes = encode_as(&table, ScalarKind::F64).unwrap();
    let mut device = thread_device(Tamper::none());
    device.begin(&bytes, &settings()).unwrap();
    let mut plant = BoardPlant::new(&table);
    let before = drive(&mut device, &mut plant, 100).last;
    let silent = |device: &mut Device, tick: u64| {
        let inputs = Inputs { tick, time_ns: tick * MS, ..Inputs::default() };
        device.step(&inputs, PATIENCE).unwrap().unwrap().command
    };
    let hold = silent(&mut device, 110);
    assert_eq!((hold.state, hold.displacement), (Mode::Hold as u32, before.displacement));
    let safe = silent(&mut device, 800);
    assert_eq!((safe.state, safe.displacement), (Mode::Safe as u32, before.displacement));
    device.tell(Request::Rearm).unwrap();
    plant.tick = 801;
    let again = drive(&mut device, &mut plant, 100);
    assert_eq!(again.last.state, Mode::Run as u32, "{}", Faults::from_bits(again.last.faults));
}

fn host_sim(arguments: &[&str]) {
    let output =
        std::process::Command::new(assert_cmd::cargo::cargo_bin!("host-sim")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_whole_insertion_on_the_cortex_m7_is_bit_identical() {
    if image(ScalarKind::F64).and(image(ScalarKind::F32)).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for scalar in ["f64", "f32"] {
        let recordings = ["native", "qemu"].map(|hardware| {
            let out = folder.path().join(format!("{scalar}-{hardware}"));
            let out = out.to_str().unwrap();
            let world = ["--tissue", "inclusion", "--insertion-time", "0.6", "--duration", "0.8"];
            let choice = ["--mode", "lockstep", "--controller", hardware, "--scalar", scalar];
            host_sim(&[&["run", "--quiet", "--out", out][..], &world, &choice].concat());
            let recording = format!("{out}/inclusion-dynamic.rec");
            host_sim(&["replay", &recording]);
            std::fs::read(recording).unwrap()
        });
        assert!(recordings[0] == recordings[1], "{scalar}: the recordings differ");
    }
}

/// `run` of a coarse `scan` with these pairs on homogeneous tissue in half a second, with the controller on a board.
fn run_in_space(folder: &Path, pairs: &str, options: &[&str]) -> std::process::Output {
    let scene = scenes::quick_with_pairs(folder, pairs);
    std::process::Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
        .args(["run", "--quiet", "--tissue", "homogeneous", "--insertion-time", "0.5"])
        .args(options)
        .arg("--scene")
        .arg(scene)
        .arg("--out")
        .arg(folder.join("report"))
        .output()
        .unwrap()
}

#[test]
fn a_pair_in_space_is_held_bit_identically_by_the_cortex_m7() {
    if image(ScalarKind::F64).is_none() {
        return;
    }
    let recorded = |hardware: &str| {
        let folder = tempfile::tempdir().unwrap();
        let options = ["--mode", "lockstep", "--controller", hardware];
        let output = run_in_space(folder.path(), "[[5, 6]]", &options);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let recording = folder.path().join("report/homogeneous-dynamic.rec");
        host_sim(&["replay", recording.to_str().unwrap()]);
        std::fs::read(recording).unwrap()
    };
    // Side by side: the emulator leaves a core idle.
    let (native, qemu) = std::thread::scope(|scope| {
        let native = scope.spawn(|| recorded("native"));
        let qemu = recorded("qemu");
        (native.join().unwrap(), qemu)
    });
    assert!(native == qemu, "the recordings differ");
}

#[test]
fn what_no_image_controls_is_refused_before_anything_is_written() {
    for (pairs, options, said) in [
        ("[[5, 6]]", &["--mode", "free-run"][..], "add --mode lockstep"),
        ("[]", &["--mode", "lockstep"], "no image controls 1 paddle(s) in 3 dimensions in f64"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let output = run_in_space(folder.path(), pairs, &[&["--controller", "qemu"], options].concat());
        let error = String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ");
        let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(output.status.code() == Some(2) && error.contains(said), "{error}");
        assert!(!folder.path().join("report").exists());
    }
}

#[test]
fn the_watchdog_says_safe_and_the_board_starts_disarmed() {
    let Some(image) = image(ScalarKind::F64) else { return };
    let table = table();
    let bytes = encode_as(&table, ScalarKind::F64).unwrap();
    let mut device = Device::emulate(&image).unwrap();
    device.begin(&bytes, &settings()).unwrap();
    let mut plant = BoardPlant::new(&table);
    assert_eq!(drive(&mut device, &mut plant, 200).last.state, Mode::Run as u32);

    // In RUN a patient depends on it; in SAFE it may be tested.
    device.tell(Request::TestWatchdog).unwrap();
    let patience = Duration::from_secs(20);
    let refused = device.hear(patience).unwrap();
    assert_eq!(refused, Some(Reply::Refused(Refusal::Order)));
    assert_eq!(drive(&mut device, &mut plant, 100).last.state, Mode::Run as u32);
    let silence = Inputs { tick: plant.tick + 600, time_ns: (plant.tick + 600) * MS, ..Inputs::default() };
    let stopped = device.step(&silence, PATIENCE).unwrap().unwrap().command;
    assert_eq!(stopped.state, Mode::Safe as u32);
    device.tell(Request::TestWatchdog).unwrap();
    let Some(Reply::Command { command, .. }) = device.hear(patience).unwrap() else { panic!("no last word") };
    assert_eq!((command.state, command.is_valid()), (Mode::Safe as u32, false));
    assert_eq!(command.faults, Faults::WATCHDOG.bits());
    let Some(Reply::Hello(identity)) = device.hear(patience).unwrap() else { panic!("no start") };
    assert_eq!(identity.reset, ResetCause::Watchdog);

    // Nothing but a new run makes it move, and the first valid command is the position of a paddle that has rested.
    let (_, inputs) = plant.advance(None);
    assert_eq!(device.step(&inputs, PATIENCE).unwrap(), None, "samples are not answered without a run");
    device.begin(&bytes, &settings()).unwrap();
    let measured = plant.world.paddle(0).unwrap();
    let first = (0..10).map(|_| drive(&mut device, &mut plant, 1).last).find(PaddleCommand::is_valid).unwrap();
    assert_eq!(Vector2::from(to_plane(first.displacement[0])), measured);
    assert_eq!(first.state, Mode::Hold as u32);
    assert_eq!(drive(&mut device, &mut plant, 200).last.state, Mode::Run as u32);
}

#[test]
fn a_stopped_board_skips_ticks_and_comes_back() {
    let Some(image) = image(ScalarKind::F64) else { return };
    let table = table();
    let bytes = encode_as(&table, ScalarKind::F64).unwrap();
    let mut device = Device::emulate(&image).unwrap();
    device.begin(&bytes, &settings()).unwrap();
    let mut plant = BoardPlant::new(&table);
    drive(&mut device, &mut plant, 200);
    let process = rustix::process::Pid::from_raw(device.process().unwrap() as i32).unwrap();
    rustix::process::kill_process(process, rustix::process::Signal::STOP).unwrap();
    let stopped = drive(&mut device, &mut plant, 5);
    assert_eq!(stopped.lost_ticks, 5, "no command while it is stopped: the actuator keeps its position");
    rustix::process::kill_process(process, rustix::process::Signal::CONT).unwrap();
    let after = drive(&mut device, &mut plant, 300);
    assert_eq!(after.last.state, Mode::Run as u32, "{}", Faults::from_bits(after.last.faults));
    let account = device.account().unwrap();
    assert_eq!((account.ledger.unaccounted(), account.ledger.ticks.due), (0, 505));
}
