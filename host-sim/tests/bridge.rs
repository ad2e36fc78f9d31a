//! The bridge on loopback: a controller's process, the bridge's process, and a rig in this one that speaks only UDP and has
//! another clock.

use std::io::Read as _;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use firmware::Mode;
use firmware::contract::frames::{COMMAND_VALID, TARGET_VISIBLE};
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use host_sim::exchange::udp::datagram::LONGEST;
use host_sim::exchange::udp::{Datagram, Hello, Message, Refusal};
use host_sim::runtime::bridge::accounts::BridgeResult;
use host_sim::runtime::plant::process::PlantResult;
use host_sim::runtime::time::clock::{now_ns, release_real_time, request_real_time, sleep_until};
use host_sim::world::tissue::WantedPlant;
use host_sim::world::truth::Truth;
use host_sim::{LoopSettings, Simulation, World};
use model_offline::model::TissueModel;
use model_offline::scene::Scene;
use proptest::prelude::*;

/// Rate of the loop: slow, because other tests want this machine, too.
const RATE_HZ: f64 = 200.0;
const PERIOD_NS: u64 = 5_000_000;
const PADDLE: u32 = 3;
/// Duration of an insertion, s.
const INSERTION_S: f64 = 1.5;
/// The rig's clock is so far behind this machine's, ns.
const BEHIND_NS: u64 = 1_234_567_891;

fn host_sim() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
}

fn signal(process: u32, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap().success());
}

/// What was said on stderr, in one line.
fn message(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn paper() -> Scene {
    Scene::bundled("paper").unwrap().without_inclusions()
}

fn simulation(scene: &Scene) -> Simulation {
    let simulation = Simulation::new(scene).with_insertion(INSERTION_S);
    let loop_settings = LoopSettings { rate: RATE_HZ, ..simulation.loop_settings };
    Simulation { loop_settings, plant: Some(WantedPlant::Condensed), ..simulation }
}

/// The table of a scene's third paddle.
fn table_in(folder: &Path, model: &TissueModel) -> PathBuf {
    let path = folder.join("own.table");
    let options = model_offline::table::TableOptions { knots: 9, ..Default::default() };
    let table = model_offline::table::build(model, PADDLE, &options).unwrap();
    std::fs::write(&path, model_offline::table::to_bytes(&table).unwrap()).unwrap();
    path
}

/// The other end of the bridge.
struct Rig {
    socket: UdpSocket,
    bridge: SocketAddr,
    run: u64,
    number: u64,
    hello: Hello,
    /// What was sent, as bytes.
    sent: Vec<Vec<u8>>,
    last_number: Option<u64>,
    last_command: Option<u32>,
}

impl Rig {
    /// A rig that has heard the bridge.
    fn meets(socket: UdpSocket) -> Self {
        socket.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let mut bytes = [0; 4096];
        let (length, bridge) = socket.recv_from(&mut bytes).expect("the bridge says Hello");
        socket.set_nonblocking(true).unwrap();
        let datagram = Datagram::decode(&bytes[..length]).unwrap();
        let Message::Hello(hello) = datagram.message else { panic!("{datagram:?}") };
        Self {
            socket,
            bridge,
            run: datagram.run,
            number: 0,
            hello,
            sent: Vec::new(),
            last_number: None,
            last_command: None,
        }
    }

    /// Time on the rig's own clock, ns.
    fn now_ns() -> u64 {
        now_ns() - BEHIND_NS
    }

    fn send(&mut self, message: Message) {
        let (run, number) = (self.run, self.number);
        let bytes = Datagram { run, number, sent_ns: Self::now_ns(), message }.encode();
        self.number += 1;
        self.send_bytes(&bytes);
        self.sent.push(bytes);
    }

    fn send_bytes(&self, bytes: &[u8]) {
        // A bridge that has ended is seen by its silence.
        let _ = self.socket.send_to(bytes, self.bridge);
    }

    /// The commands that wait.
    fn commands(&mut self) -> Vec<PaddleCommand> {
        let mut commands = Vec::new();
        let mut bytes = [0; 4096];
        while let Ok(length) = self.socket.recv(&mut bytes) {
            let datagram = Datagram::decode(&bytes[..length]).unwrap();
            assert_eq!(datagram.run, self.run);
            assert!(self.last_number.is_none_or(|last| datagram.number > last), "numbers rise");
            self.last_number = Some(datagram.number);
            if let Message::Command(command) = datagram.message {
                let follows = self.last_command.is_none_or(|last| command.sequence <= last + 1);
                assert!(follows, "{} after {:?}: one is left out", command.sequence, self.last_command);
                self.last_command = Some(command.sequence);
                commands.push(command);
            }
        }
        commands
    }

    /// Everything at rest, at this number of a period.
    fn send_rest(&mut self, sequence: u32) {
        let time_ns = Self::now_ns();
        self.send(Message::Needle(NeedleSample { sequence, time_ns, ..NeedleSample::default() }));
        if sequence.is_multiple_of(4) {
            let target =
                TargetSample { sequence: sequence / 4, time_ns, flags: TARGET_VISIBLE, displacement: [0.0; 3] };
            self.send(Message::Target(target));
        }
        for paddle_index in self.hello.paddles.clone() {
            self.send(Message::Paddle(PaddleSample { sequence, paddle_index, time_ns, displacement: [0.0; 3] }));
        }
    }

    /// Rests from this number on until `enough` of the commands; returns the last command and the next number.
    fn rests_until(&mut self, mut sequence: u32, enough: impl Fn(&PaddleCommand) -> bool) -> (PaddleCommand, u32) {
        let until = Instant::now() + Duration::from_secs(30);
        loop {
            self.send_rest(sequence);
            sequence += 1;
            std::thread::sleep(Duration::from_nanos(PERIOD_NS));
            if let Some(command) = self.commands().into_iter().find(&enough) {
                return (command, sequence);
            }
            assert!(Instant::now() < until, "no such command");
        }
    }

    /// Says nothing until `enough` of the commands; returns that and those before it.
    fn hears_until(&mut self, within: Duration, enough: impl Fn(&PaddleCommand) -> bool) -> Vec<PaddleCommand> {
        let until = Instant::now() + within;
        let mut heard = Vec::new();
        loop {
            for command in self.commands() {
                heard.push(command);
                if enough(&command) {
                    return heard;
                }
            }
            assert!(Instant::now() < until, "no such command; the last one is {:?}", heard.last());
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// A controller and a bridge; the rig is met by the test.
struct Stage {
    controller: Child,
    bridge: Child,
    json: PathBuf,
    _folder: tempfile::TempDir,
}

impl Stage {
    /// Starts both with a table; `name` keeps the links apart.
    fn open(name: &str, table: impl FnOnce(&Path) -> PathBuf, extra: &[&str]) -> (Self, UdpSocket) {
        let folder = tempfile::tempdir().unwrap();
        let (table, json) = (table(folder.path()), folder.path().join("bridge.json"));
        let link = format!("bridge-{name}-{}", std::process::id());
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let rate = RATE_HZ.to_string();
        let controller = host_sim()
            .args(["controller", "--link", &link, "--mode", "free-run", "--rate", &rate, "--table"])
            .arg(table)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let bridge = host_sim()
            .args(["bridge", "--link", &link, "--listen", "127.0.0.1:0", "--send-to"])
            .arg(socket.local_addr().unwrap().to_string())
            .arg("--json")
            .arg(&json)
            .args(extra)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        (Self { controller, bridge, json, _folder: folder }, socket)
    }

    /// Waits for the bridge's end, for a bounded time.
    fn end(mut self) -> (Output, BridgeResult) {
        let until = Instant::now() + Duration::from_secs(20);
        let status = loop {
            if let Some(status) = self.bridge.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < until, "the bridge goes on");
            std::thread::sleep(Duration::from_millis(5));
        };
        let mut stderr = Vec::new();
        self.bridge.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
        let result = std::fs::read(&self.json).expect("what went over it is written");
        (Output { status, stdout: Vec::new(), stderr }, serde_json::from_slice(&result).unwrap())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        for child in [&mut self.bridge, &mut self.controller] {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn resting(name: &str, extra: &[&str]) -> (Stage, Rig) {
    let table = |folder: &Path| table_in(folder, &model_offline::placement::discretise(&paper()).unwrap().0);
    let (stage, socket) = Stage::open(name, table, extra);
    (stage, Rig::meets(socket))
}

fn is_running(command: &PaddleCommand) -> bool {
    command.state == Mode::Run as u32
}

/// What is sent between good datagrams.
#[derive(Clone, Copy, PartialEq)]
enum Between {
    Nothing,
    Garbage,
}

/// Garbage of every kind around a good datagram that was sent.
fn garbage(good: &[u8], nth: usize) -> Vec<Vec<u8>> {
    let mut flipped = good.to_vec();
    flipped[nth % good.len()] ^= 1 << (nth % 8);
    let of = |change: &dyn Fn(&mut Datagram)| {
        let mut datagram = Datagram::decode(good).unwrap();
        datagram.number += 1_000_000;
        change(&mut datagram);
        datagram.encode()
    };
    vec![
        good.to_vec(),
        flipped,
        good[..nth % good.len()].to_vec(),
        vec![nth as u8; nth % LONGEST],
        vec![0x55; 4000],
        of(&|datagram| datagram.run ^= 1),
        of(&|datagram| datagram.sent_ns = 0),
        of(&|datagram| datagram.message = Message::Command(PaddleCommand::default())),
        of(&|datagram| {
            let paddle_index = PADDLE + 1;
            datagram.message = Message::Paddle(PaddleSample { paddle_index, ..PaddleSample::default() });
        }),
    ]
}

/// An insertion over the bridge.
struct Inserted {
    /// Largest orthogonal displacement, length.
    largest: f64,
    /// Longest time from one command in RUN to the next, s.
    pause_s: f64,
    result: BridgeResult,
}

/// An insertion with the rig's own tissue.
fn insertion(name: &str, between: Between) -> Inserted {
    let scene = paper();
    let (model, _) = model_offline::placement::discretise(&scene).unwrap();
    let simulation = simulation(&scene);
    let mut world = World::new(&model, Some(PADDLE), &simulation).unwrap();
    let (stage, socket) = Stage::open(name, |folder| table_in(folder, &model), &[]);
    let mut rig = Rig::meets(socket);
    assert_eq!((rig.hello.dimension, &rig.hello.paddles[..]), (2, &[PADDLE][..]));
    let orthogonal = scene.needle.orthogonal();
    let (mut largest, mut tick, mut previous_ns) = (0.0_f64, 0, Rig::now_ns());
    let (mut ran_ns, mut pause_ns) = (None, 0);
    let give_up = Instant::now() + Duration::from_secs(30);
    request_real_time();
    loop {
        let time_ns = Rig::now_ns();
        if world.needle_started_ns().is_some_and(|started_ns| time_ns >= started_ns + simulation.duration_ns()) {
            break;
        }
        assert!(Instant::now() < give_up, "RUN never came");
        let commands = rig.commands();
        if commands.last().is_some_and(is_running) {
            pause_ns = pause_ns.max(time_ns - ran_ns.replace(time_ns).unwrap_or(time_ns));
        }
        world.act(commands.last(), time_ns, time_ns - previous_ns);
        previous_ns = time_ns;
        let truth: Truth = world.advance(tick, time_ns).unwrap();
        largest = largest.max(orthogonal.tr_mul(&truth.target::<2>()).norm());
        let (needle, paddles) = world.encoders(time_ns);
        rig.send(Message::Needle(needle));
        paddles.into_iter().flatten().for_each(|paddle| rig.send(Message::Paddle(paddle)));
        let targets: Vec<_> = world.target_samples(&truth).collect();
        targets.into_iter().for_each(|target| rig.send(Message::Target(target)));
        if between == Between::Garbage {
            let good = rig.sent.last().unwrap().clone();
            garbage(&good, rig.sent.len()).iter().for_each(|bytes| rig.send_bytes(bytes));
        }
        tick += 1;
        sleep_until(now_ns().max(time_ns + BEHIND_NS + PERIOD_NS));
    }
    release_real_time();
    signal(stage.bridge.id(), "INT");
    let stay = rig.hears_until(Duration::from_secs(1), |command| !command.is_valid());
    assert_eq!(stay.last().unwrap().flags & COMMAND_VALID, 0);
    let (output, result) = stage.end();
    assert_eq!(output.status.code(), Some(1), "{}", message(&output));
    assert!(message(&output).contains("keep their positions"), "{}", message(&output));
    assert_eq!(result.taken.values().sum::<u64>() + result.missing, rig.number, "{result:?}");
    Inserted { largest, pause_s: pause_ns as f64 * 1e-9, result }
}

/// The same insertion over shared memory alone, by the program's own plant.
fn over_shared_memory() -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let (model, _) = model_offline::placement::discretise(&paper()).unwrap();
    let (table, json) = (table_in(folder.path(), &model), folder.path().join("plant.json"));
    let (link, rate, insertion) =
        (format!("bridge-none-{}", std::process::id()), RATE_HZ.to_string(), INSERTION_S.to_string());
    let common = ["--mode", "free-run", "--link", &link, "--rate", &rate];
    let mut controller = host_sim();
    let mut controller = controller.arg("controller").args(common).arg("--table").arg(table).spawn().unwrap();
    let mut plant = host_sim();
    plant.arg("plant").args(common).args(["--tissue", "homogeneous", "--paddle", "3", "--plant", "condensed"]);
    assert!(plant.args(["--insertion-time", &insertion, "--json"]).arg(&json).status().unwrap().success());
    assert!(controller.wait().unwrap().success());
    serde_json::from_slice::<PlantResult>(&std::fs::read(json).unwrap()).unwrap().largest_error
}

/// Largest speed of the target orthogonal to the needle without a paddle, length/s.
fn fastest() -> f64 {
    let scene = paper();
    let (model, _) = model_offline::placement::discretise(&scene).unwrap();
    let mut world = World::new(&model, None, &simulation(&scene)).unwrap();
    world.start_needle(0);
    let orthogonal = scene.needle.orthogonal();
    let ticks = (INSERTION_S * RATE_HZ) as u64;
    let aside = |tick| orthogonal.tr_mul(&world.advance(tick, tick * PERIOD_NS).unwrap().target::<2>()).x;
    let way: Vec<f64> = (0..ticks).map(aside).collect();
    way.windows(2).map(|pair| (pair[1] - pair[0]).abs() * RATE_HZ).fold(0.0, f64::max)
}

/// What the bridge adds is delay: at most a period until the rig looks, and what this process has to wait for a processor. In
/// that time the target gets no further than it would without a paddle.
#[test]
fn an_insertion_is_held_as_over_shared_memory_and_garbage_changes_nothing() {
    let (reference, fastest) = (over_shared_memory(), fastest());
    for (name, between) in [("plain", Between::Nothing), ("flood", Between::Garbage)] {
        let Inserted { largest, pause_s, result } = insertion(name, between);
        let bound = reference + fastest * (PERIOD_NS as f64 * 1e-9 + pause_s);
        println!("{name}: {largest:.2e}, shared memory {reference:.2e}, bound {bound:.2e}; {}", result.summary());
        assert!(largest <= bound, "{name}: {largest} > {bound}");
        if between == Between::Nothing {
            assert!(result.refused.is_empty(), "{result:?}");
        } else {
            let reasons = ["replayed", "damaged", "length", "other-run", "time", "meaning", "paddle"];
            let is_common = |reason: &&str| result.refused.get(*reason).is_some_and(|count| *count > 100);
            assert!(reasons.iter().all(is_common), "{result:?}");
        }
    }
}

#[test]
fn two_paddles_in_space_go_over_it_as_well() {
    let table = |folder: &Path| {
        let path = folder.join("brick.table");
        let table = host_sim::bench::paper_table::brick_table().unwrap();
        std::fs::write(&path, model_offline::table::to_bytes(&table).unwrap()).unwrap();
        path
    };
    let (stage, socket) = Stage::open("space", table, &["--seconds", "2"]);
    let mut rig = Rig::meets(socket);
    assert_eq!((rig.hello.dimension, &rig.hello.paddles[..]), (3, &[3, 6][..]));
    let (command, next) = rig.rests_until(0, is_running);
    assert_eq!((command.paddle_index, command.is_valid()), ([3, 6], true));
    // Without the second paddle's samples it does not run on.
    rig.hello.paddles.pop();
    rig.rests_until(next, |command| !is_running(command));
    let (output, result) = stage.end();
    assert!(output.status.success(), "its time is over: {}", message(&output));
    assert!(result.taken["second-paddle"] > 0 && result.taken["second-paddle"] < result.taken["paddle"], "{result:?}");
}

#[test]
fn silent_sensors_end_in_safe_and_nothing_is_invented() {
    let (stage, mut rig) = resting("silent", &[]);
    rig.rests_until(0, is_running);
    let heard = rig.hears_until(Duration::from_secs(5), |command| command.state == Mode::Safe as u32);
    // Whatever is in there after the last sample keeps the paddle where it was.
    let first = heard.first().unwrap();
    assert!(heard.iter().all(|command| command.needle_sequence == first.needle_sequence || is_running(command)));
    let safe = heard.last().unwrap();
    let later = rig.hears_until(Duration::from_secs(1), |command| command.tick > safe.tick + 50);
    let stays = |command: &PaddleCommand| {
        command.state == Mode::Safe as u32 && command.displacement == safe.displacement || !command.is_valid()
    };
    assert!(later.iter().all(stays), "{later:?}");
    signal(stage.bridge.id(), "TERM");
    rig.hears_until(Duration::from_secs(1), |command| !command.is_valid());
    let (_, result) = stage.end();
    assert_eq!(result.taken.values().sum::<u64>() + result.missing, rig.number);
}

#[test]
fn a_controller_that_is_killed_leaves_no_valid_command() {
    let (mut stage, mut rig) = resting("killed", &[]);
    rig.rests_until(0, is_running);
    stage.controller.kill().unwrap();
    let killed = Instant::now();
    rig.hears_until(Duration::from_secs(1), |command| !command.is_valid() && command.state == Mode::Safe as u32);
    let (output, result) = stage.end();
    assert!(killed.elapsed() < Duration::from_secs(5));
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("controller process"), "{}", message(&output));
    assert!(result.own_commands >= 1 && result.ended.is_some(), "{result:?}");
    assert!(rig.commands().iter().all(|command| !command.is_valid()), "nothing is valid after the last word");
}

#[test]
fn what_waited_while_the_bridge_was_stopped_moves_nothing() {
    let (mut stage, mut rig) = resting("waited", &[]);
    rig.rests_until(0, is_running);
    signal(stage.bridge.id(), "STOP");
    // The controller fills the link, and is no more when the bridge goes on.
    std::thread::sleep(Duration::from_millis(100));
    stage.controller.kill().unwrap();
    rig.commands();
    // The link keeps the newest ones.
    rig.last_command = None;
    std::thread::sleep(Duration::from_millis(200));
    signal(stage.bridge.id(), "CONT");
    let (_, result) = stage.end();
    let heard = rig.commands();
    assert!(!heard.is_empty() && heard.iter().all(|command| !command.is_valid()), "{heard:?}");
    assert!(result.expired > 0, "{result:?}");
}

#[test]
fn who_is_told_to_end_before_the_rig_comes_lets_the_controller_go() {
    let (mut stage, mut rig) = resting("early", &[]);
    signal(stage.bridge.id(), "INT");
    rig.hears_until(Duration::from_secs(1), |command| !command.is_valid());
    assert!(stage.controller.wait().unwrap().success());
    let (_, result) = stage.end();
    assert_eq!((result.taken.values().sum::<u64>(), result.commands), (0, 0));
}

#[test]
fn nobody_moves_by_the_last_word_of_a_controller_that_is_stopped() {
    let (stage, mut rig) = resting("stopped", &["--patience", "1"]);
    rig.rests_until(0, is_running);
    signal(stage.controller.id(), "STOP");
    rig.hears_until(Duration::from_millis(500), |command| !command.is_valid());
    let (output, _) = stage.end();
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("no answer from the controller"), "{}", message(&output));
}

#[test]
fn what_an_earlier_run_said_is_refused() {
    let (stage, mut rig) = resting("first", &[]);
    rig.rests_until(0, is_running);
    signal(stage.bridge.id(), "INT");
    stage.end();
    let (stage, again) = resting("again", &["--patience", "2"]);
    // All that the first run took, in its order, with its intervals.
    for bytes in &rig.sent {
        again.send_bytes(bytes);
        std::thread::sleep(Duration::from_micros(500));
    }
    let (output, result) = stage.end();
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("no sample has come"), "{}", message(&output));
    assert_eq!(result.refused.get("other-run"), Some(&(rig.sent.len() as u64)), "{result:?}");
    assert_eq!((result.taken.values().sum::<u64>(), result.commands), (0, 0));
}

#[test]
fn what_another_address_says_is_refused() {
    let (stage, mut rig) = resting("foreign", &["--peer", "127.0.0.2", "--patience", "1"]);
    (0..20).for_each(|sequence| rig.send_rest(sequence));
    let (_, result) = stage.end();
    assert_eq!(result.refused.get("foreign"), Some(&rig.number), "{result:?}");
}

#[test]
fn addresses_that_make_no_sense_are_refused_before_anything_is_opened() {
    let (own, other) = ("127.0.0.1:47361", "192.0.2.7:47361");
    for (arguments, word) in [
        (&["--send-to", other][..], "--network"),
        (&["--send-to", own, "--listen", "0.0.0.0:0"], "--network"),
        (&["--send-to", own, "--peer", "192.0.2.7"], "--network"),
        (&["--send-to", "[::1]:47361"], "one family"),
        (&["--send-to", "127.0.0.1:0"], "port"),
        (&["--send-to", own, "--listen", own], "itself"),
        (&["--send-to", own, "--listen", "0.0.0.0:47361", "--network"], "itself"),
        (&["--send-to", "0.0.0.0:1", "--network"], "nobody's"),
        (&["--send-to", other, "--network"], "--listen 127.0.0.1"),
        (&["--send-to", own, "--peer", "0.0.0.0", "--network"], "nobody's"),
        (&["--send-to", own, "--delay", "1001"], "--delay"),
        (&["--send-to", own, "--seconds", "0"], "--seconds"),
        (&["--send-to", "rig:1"], "--send-to"),
    ] {
        let output = host_sim().arg("bridge").args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", message(&output));
        assert!(message(&output).contains(word), "{arguments:?}: {}", message(&output));
    }
}

fn displacement() -> impl Strategy<Value = [f64; 3]> {
    any::<[u64; 3]>().prop_map(|bits| bits.map(f64::from_bits))
}

fn messages() -> impl Strategy<Value = Message> {
    let hello = (any::<u32>(), proptest::collection::vec(any::<u32>(), 0..=2), "[a-zµ]{0,12}")
        .prop_map(|(dimension, paddles, unit)| Message::Hello(Hello { dimension, paddles, unit }));
    let needle = (any::<u32>(), any::<u64>(), displacement()).prop_map(|(sequence, time_ns, [depth, velocity, _])| {
        Message::Needle(NeedleSample { sequence, reserved: 0, time_ns, depth, velocity })
    });
    let target = (any::<u32>(), any::<bool>(), any::<u64>(), displacement()).prop_map(
        |(sequence, seen, time_ns, displacement)| {
            Message::Target(TargetSample { sequence, flags: u32::from(seen), time_ns, displacement })
        },
    );
    let paddle = (any::<[u32; 2]>(), any::<u64>(), displacement()).prop_map(
        |([sequence, paddle_index], time_ns, displacement)| {
            Message::Paddle(PaddleSample { sequence, paddle_index, time_ns, displacement })
        },
    );
    let command = (any::<[u32; 7]>(), any::<[u64; 3]>(), displacement(), displacement()).prop_map(
        |([sequence, state, needle_sequence, target_sequence, first, second, flags], [tick, time_ns, faults], a, b)| {
            let (displacement, paddle_index, reserved) = ([a, b], [first, second], 0);
            Message::Command(PaddleCommand {
                sequence,
                state,
                tick,
                time_ns,
                faults,
                displacement,
                needle_sequence,
                target_sequence,
                paddle_index,
                flags,
                reserved,
            })
        },
    );
    prop_oneof![hello, needle, target, paddle, command]
}

proptest! {
    #[test]
    fn fuzz_datagrams_come_back_bit_by_bit_and_damaged_ones_do_not(
        message in messages(),
        [run, number, sent_ns] in any::<[u64; 3]>(),
        more in any::<u8>(),
    ) {
        let bytes = Datagram { run, number, sent_ns, message }.encode();
        // By their bytes: some of the numbers are none, and not equal to themselves.
        let read = Datagram::decode(&bytes).unwrap();
        prop_assert_eq!(&read.encode(), &bytes);
        prop_assert_eq!((read.run, read.number, read.sent_ns), (run, number, sent_ns));
        for length in 0..bytes.len() {
            prop_assert!(Datagram::decode(&bytes[..length]).is_err(), "cut to {}", length);
        }
        prop_assert!(Datagram::decode(&[&bytes[..], &[more]].concat()).is_err(), "a byte more");
        let mut flipped = bytes.clone();
        for bit in 0..8 * bytes.len() {
            flipped[bit / 8] ^= 1 << (bit % 8);
            prop_assert_eq!(Datagram::decode(&flipped), Err(Refusal::Damaged), "bit {}", bit);
            flipped[bit / 8] ^= 1 << (bit % 8);
        }
    }

    #[test]
    fn fuzz_datagrams_of_any_bytes_do_no_harm(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Datagram::decode(&bytes).is_err());
    }
}

/// The guide's table, field by field, by a reader of its own.
#[test]
fn a_needle_sample_is_laid_out_as_the_guide_says() {
    let sample = NeedleSample { sequence: 0x0102_0304, reserved: 0, time_ns: 5, depth: 0.5, velocity: -2.0 };
    let datagram = Datagram { run: 6, number: 7, sent_ns: 8, message: Message::Needle(sample) };
    let mut expected = b"SPBR".to_vec();
    expected.extend([1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]);
    for number in [6_u64, 7, 8] {
        expected.extend(number.to_le_bytes());
    }
    expected.extend([4, 3, 2, 1, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0]);
    expected.extend([0, 0, 0, 0, 0, 0, 0xe0, 0x3f, 0, 0, 0, 0, 0, 0, 0, 0xc0]);
    // CRC-32 by its definition: reflected, 0xEDB88320.
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
    let crc = !expected.iter().fold(!0_u32, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step));
    expected.extend(crc.to_le_bytes());
    assert_eq!(datagram.encode(), expected);
    assert_eq!(expected.len(), 76);
}

/// The example of the guide against the programs, where there is a Python.
#[test]
fn the_python_rig_of_the_guide_runs() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/rig.py");
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: there is no python3");
        return;
    }
    let table = |folder: &Path| table_in(folder, &model_offline::placement::discretise(&paper()).unwrap().0);
    let (stage, socket) = Stage::open("python", table, &["--seconds", "1.5"]);
    let port = socket.local_addr().unwrap().port().to_string();
    drop(socket);
    let mut python = Command::new("python3").arg(script).arg(port).stdout(Stdio::piped()).spawn().unwrap();
    let (output, result) = stage.end();
    let mut said = String::new();
    python.wait().unwrap();
    python.stdout.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(output.status.success(), "{}", message(&output));
    assert!(said.contains("RUN") && said.contains("keep"), "{said}");
    assert!(result.taken["needle"] > 100 && result.refused.is_empty(), "{result:?}");
}
