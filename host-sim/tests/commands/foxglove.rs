//! The live view as Foxglove and Lichtblick see it, through a client that is not ours.

mod watcher;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use firmware::contract::frames::COMMAND_VALID;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::{Inputs, Mode};
use host_sim::RunMode;
use host_sim::record::export::messages::schemas;
use host_sim::runtime::accounting::tick::ControllerTick;
use host_sim::runtime::plant::observer::{Moment, ObservedInsertion, Observer, PlanarBody, Spectator as _};
use host_sim::view::{Knobs, View};
use host_sim::world::space::PreparedBody;
use host_sim::world::tissue::{TissuePlant, WantedPlant};
use host_sim::world::truth::Truth;
use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::model::TissueModel;
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::placement::space::insertion::InsertionModel;
use model_offline::placement::space::workflow::insertion_model;
use model_offline::scene::Scene;
use model_offline::scene::space::SpaceScene;
use serde_json::{Value, json};
use watcher::{LONG, Told, Watcher, answer, satisfies, topics};

const KNOBS: Knobs = Knobs { needle_speed: 1.0, target_rate: 50.0, latency: 20.0, noise: 1.0, stiffness: 1.0 };

/// A tick of a made-up insertion: depth 0.01 per tick, everything else by the tick, too; HOLD before the third, then RUN.
fn moment(tick: u64) -> Moment {
    let time_ns = tick * 1_000_000;
    let by = tick as f64 * 1e-3;
    let truth =
        Truth { tick, time_ns, depth: 0.01 * tick as f64, target: [by, 2.0 * by, 0.0], paddles: [[by, 0.0, 0.0]; 2] };
    let sequence = tick as u32;
    let sample = |paddle_index| PaddleSample { sequence, paddle_index, time_ns, displacement: [by, 0.0, 0.0] };
    let inputs = Inputs {
        tick,
        time_ns,
        needle: Some(NeedleSample { sequence, time_ns, depth: by, ..NeedleSample::default() }),
        target: Some(TargetSample { sequence, time_ns, displacement: [by; 3], ..TargetSample::default() }),
        paddles: [Some(sample(3)), Some(sample(6))],
    };
    let mode = if tick < 3 { Mode::Hold } else { Mode::Run };
    let command = PaddleCommand { state: mode as u32, tick, time_ns, flags: COMMAND_VALID, ..PaddleCommand::default() };
    let exchanged = Some(ControllerTick { inputs, command });
    Moment { truth, time_s: by, began_ns: 0, is_counted: true, answer: None, exchanged }
}

fn model() -> TissueModel {
    TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap()
}

/// Looks on at an insertion in the plane.
fn observer<'m>(view: &View, model: &'m TissueModel) -> Box<dyn Observer<TissuePlant<'m>>> {
    view.observe(ObservedInsertion {
        body: PlanarBody { model, paddle: 3 },
        mode: RunMode::FreeRun,
        period_ns: 1_000_000,
        title: "a test".to_owned(),
    })
}

/// The smallest body in space.
fn block() -> InsertionModel {
    let mut scene = SpaceScene::bundled("block").unwrap().with_method(Method::new(Integration::FemT4));
    scene.discretization.resolution = Resolution::Level(0);
    insertion_model(&scene).unwrap()
}

#[test]
fn both_subprotocols_are_spoken_and_only_to_who_knows_the_token() {
    let view = View::start(0, KNOBS).unwrap();
    let address = view.foxglove_address();
    let (host, token) = address.strip_prefix("ws://").unwrap().split_once('/').unwrap();
    let token = token.strip_suffix("/foxglove").unwrap();
    let path = format!("/{token}/foxglove");
    let status = |path: &str, lines: &[(&str, &str)]| answer(host, path, lines).0;
    let with = |protocol: &'static str| [("Host", host), ("Sec-WebSocket-Protocol", protocol)];
    for (offered, chosen) in [
        ("foxglove.websocket.v1", "foxglove.websocket.v1"),
        ("foxglove.sdk.v1", "foxglove.sdk.v1"),
        ("foxglove.sdk.v1.1, foxglove.sdk.v1, foxglove.websocket.v1", "foxglove.sdk.v1"),
    ] {
        let (status, head, _) = answer(host, &path, &with(offered));
        assert_eq!(status, 101, "{head}");
        let head = head.to_ascii_lowercase();
        // The example of RFC 6455, section 1.3.
        assert!(head.contains("sec-websocket-accept: s3pplmbitxaq9kygzzhzrbk+xoo="), "{head}");
        assert!(head.contains(&format!("sec-websocket-protocol: {chosen}\r\n")), "{head}");
        assert!(head.contains("connection: upgrade\r\n") && head.contains("upgrade: websocket\r\n"), "{head}");
    }
    assert_eq!(status(&path, &with("foxglove.sdk.v2")), 400);
    assert_eq!(status(&path, &[("Host", host)]), 400, "no subprotocol");
    assert_eq!(status(&path, &[("Host", host), ("Sec-WebSocket-Version", "8")]), 400);
    let known = with("foxglove.sdk.v1");
    assert_eq!(status(&format!("/{}/foxglove", "0".repeat(32)), &known), 403);
    assert_eq!(status("/foxglove", &known), 403);
    assert_eq!(status(&path, &[("Host", "stillpoint.example"), known[1]]), 403, "a name that was rebound to loopback");
    // The web application of Foxglove has an origin of its own, and does not get anywhere else with it.
    let foreign = ("Origin", "https://app.foxglove.dev");
    assert_eq!(status(&path, &[known[0], known[1], foreign]), 101);
    assert_eq!(status(&format!("/{token}/"), &[known[0], foreign]), 403);
    assert_eq!(status(&format!("/{token}/events"), &[known[0], known[1], foreign]), 403);
}

#[test]
fn every_topic_is_advertised_with_the_schema_that_files_have() {
    let view = View::start(0, KNOBS).unwrap();
    let mut watcher = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    let info = watcher.info.clone();
    assert_eq!((&info["op"], &info["capabilities"]), (&json!("serverInfo"), &json!(["time"])));
    assert!(info["sessionId"].as_str().is_some_and(|session| !session.is_empty()), "{info}");
    let advertised = watcher.channels.clone();
    let known = schemas();
    assert_eq!(advertised.len(), known.len());
    for (channel, (topic, name, schema)) in advertised.iter().zip(&known) {
        assert_eq!((&channel["topic"], &channel["schemaName"]), (&json!(topic), &json!(name)));
        assert_eq!((&channel["encoding"], &channel["schemaEncoding"]), (&json!("json"), &json!("jsonschema")));
        let text: Value = serde_json::from_str(channel["schema"].as_str().unwrap()).unwrap();
        assert_eq!(&text, schema.as_value(), "{topic}");
    }
    // The same program is known again, another one is not taken for it.
    let again = Watcher::connect(&view.foxglove_address(), "foxglove.websocket.v1");
    assert_eq!(again.info, info);
    let other = View::start(0, KNOBS).unwrap();
    assert_ne!(Watcher::connect(&other.foxglove_address(), "foxglove.sdk.v1").info["sessionId"], info["sessionId"]);
    watcher.subscribe(&["/truth"]);
    drop(view);
    assert_eq!(watcher.rest(), Some(1001), "there is nothing to be told, but the end");
}

/// What comes is what was offered; who comes late, and who subscribes late, has the newest of everything at once.
#[test]
fn the_plane_is_told_as_it_is_and_to_late_comers_at_once() {
    let model = model();
    let tissue = TissuePlant::new(&model, None, WantedPlant::Full).unwrap();
    let view = View::start(0, KNOBS).unwrap();
    let mut observer = observer(&view, &model);
    for tick in 1..5 {
        // Not offered again before a picture is due, but for the log.
        observer.offer(&tissue, &moment(tick));
    }
    std::thread::sleep(Duration::from_millis(50));
    observer.offer(&tissue, &moment(5));
    let expected = [
        "/needle",
        "/target",
        "/paddle",
        "/second_paddle",
        "/command",
        "/truth",
        "/scene/rest",
        "/scene",
        "/pose/needle",
        "/pose/target",
        "/tf",
    ];
    for subprotocol in ["foxglove.sdk.v1", "foxglove.websocket.v1"] {
        let mut late = Watcher::connect(&view.foxglove_address(), subprotocol);
        late.subscribe(&topics());
        let told = late.until(|told| told.iter().any(|told| told.topic == "/truth" && told.message["tick"] == 5));
        for topic in expected {
            let of: Vec<&Told> = told.iter().filter(|told| told.topic == topic).collect();
            assert_eq!(of.len(), 1, "{topic}");
            assert_eq!(of[0].time_ns, 5_000_000, "{topic}");
        }
        let truth = told.iter().find(|told| told.topic == "/truth").unwrap();
        assert_eq!(truth.message["target_y"], 0.01);
        let scene = told.iter().find(|told| told.topic == "/scene").unwrap();
        let of_scene: Vec<&Value> =
            scene.message["entities"].as_array().unwrap().iter().map(|entity| &entity["id"]).collect();
        assert_eq!(of_scene, ["needle", "paddle", "target"]);
        // Straight down from the middle of the block's upper side, and the target from its own middle; x along the insertion.
        for (topic, at, along) in
            [("/pose/needle", [0.5, 0.95], [0.0, -1.0]), ("/pose/target", [0.505, 0.51], [1.0, 0.0])]
        {
            let told = told.iter().find(|told| told.topic == topic).unwrap();
            let pose = |part: &str, k: &str| told.message["pose"][part][k].as_f64().unwrap();
            let [z, w] = ["z", "w"].map(|k| pose("orientation", k));
            let turned = [1.0 - 2.0 * z * z, 2.0 * z * w];
            for (k, name) in ["x", "y"].into_iter().enumerate() {
                assert!((pose("position", name) - at[k]).abs() < 1e-12, "{}", told.message);
                assert!((turned[k] - along[k]).abs() < 1e-12, "{}", told.message);
            }
        }
        let log = late.until(|told| told.iter().filter(|told| told.topic == "/log").count() == 2);
        let said: Vec<(u64, &str)> = log
            .iter()
            .filter(|t| t.topic == "/log")
            .map(|t| (t.time_ns, t.message["message"].as_str().unwrap()))
            .collect();
        assert!(said[0].0 == 1_000_000 && said[0].1.starts_with("HOLD"), "{said:?}");
        assert!(said[1].0 == 3_000_000 && said[1].1.starts_with("RUN"), "{said:?}");
        // Unsubscribed: no more of it; subscribed again: the newest at once.
        late.unsubscribe("/needle");
        late.subscribe(&["/needle"]);
        late.until(|told| told.iter().filter(|told| told.topic == "/needle").count() == 2);
    }
    // The next insertion begins anew, at a time of its own.
    let mut watcher = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    watcher.subscribe(&["/tf", "/scene/rest", "/truth"]);
    watcher.until(|told| told.len() == 3);
    let mut next = self::observer(&view, &model);
    next.offer(&tissue, &moment(2));
    let told = watcher.until(|told| told.len() == 6);
    assert!(told[3..].iter().all(|told| told.time_ns == 2_000_000), "{told:?}");
    assert_eq!(watcher.clock_ns, 2_000_000);
    drop(view);
    assert_eq!(watcher.rest(), Some(1001));
}

/// A client may look, and that is all; whoever goes on is shown out, and so is whoever says too much at once.
#[test]
fn nothing_that_a_client_says_changes_anything() {
    let view = View::start(0, KNOBS).unwrap();
    let mut watcher = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    let refusals = [
        json!({"op": "advertise", "channels": [{"id": 1, "topic": "/x", "encoding": "json", "schemaName": ""}]}),
        json!({"op": "setParameters", "parameters": [{"name": "x", "value": 1}]}),
        json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}),
        json!({"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}),
        json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 1}, {"id": 7, "channelId": 2}]}),
        json!({"op": "subscribe", "subscriptions": [{"id": 8, "channelId": 1}]}),
        json!({"op": "unsubscribe", "subscriptionIds": [5]}),
        json!([]),
    ];
    for refused in &refusals {
        let status = watcher.ask(refused);
        assert_eq!((&status["op"], &status["level"]), (&json!("status"), &json!(1)), "{refused}: {status}");
    }
    watcher.publish(&[1, 1, 0, 0, 0, b'{', b'}']);
    assert_eq!(watcher.status()["op"], json!("status"));
    for _ in refusals.len() + 1..16 {
        watcher.ask(&json!({"op": "fetchAsset"}));
    }
    watcher.say("{}");
    assert_eq!(watcher.rest(), Some(1008));

    let mut long = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    long.say(&format!("{{\"op\":\"subscribe\",\"subscriptions\":[],\"x\":\"{}\"}}", "x".repeat(100_000)));
    assert_eq!(long.rest(), Some(1009));
    let mut short = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    assert_eq!(short.ask(&json!({"op": "x".repeat(10_000)}))["op"], "status", "is read");
}

/// Answers that nobody reads do not pile up: the server stops to listen, and drops who goes on.
#[test]
fn a_client_that_pings_and_does_not_read_is_dropped() {
    let view = View::start(0, KNOBS).unwrap();
    let mut watcher = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    let many = (0..500_000).take_while(|_| watcher.ping(&[7; 120])).count();
    assert!(many < 500_000, "60 MB of answers wait somewhere");
}

#[test]
fn clients_have_places_and_give_them_back() {
    let view = View::start(0, KNOBS).unwrap();
    let address = view.foxglove_address();
    let (host, path) = address.strip_prefix("ws://").unwrap().split_once('/').unwrap();
    let path = format!("/{path}");
    let inside: Vec<Watcher> = (0..4).map(|_| Watcher::connect(&address, "foxglove.sdk.v1")).collect();
    let known = [("Host", host), ("Sec-WebSocket-Protocol", "foxglove.sdk.v1")];
    assert_eq!(answer(host, &path, &known).0, 503);
    drop(inside);
    let until = Instant::now() + LONG;
    while answer(host, &path, &known).0 != 101 {
        assert!(Instant::now() < until, "a client that is gone keeps its place");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// In space the body is seen, too. A client that does not read is left behind, and dropped in the end: nobody else notices.
#[test]
fn space_is_told_and_nobody_waits_for_a_client_that_does_not_read() {
    let model = block();
    let body = PreparedBody::new(&model, &[3, 6], true, 2).unwrap();
    let units = ["m".to_owned(), "Pa".to_owned()];
    let view = View::start_in_space(0, KNOBS, &SpaceGeometry::new(model.coarse()), &units, &[3, 6]).unwrap();
    let tissue = body.tissue();
    let mut observer = view.observe_in_space(ObservedInsertion {
        body: &body,
        mode: RunMode::FreeRun,
        period_ns: 1_000_000,
        title: "a test".to_owned(),
    });
    let depth = model.scene().needle.depth;
    let mut tick = 0_u64;
    let mut offer = || {
        tick += 1;
        let mut now = moment(tick);
        now.truth.depth = 0.3 * depth;
        let way = body.table().way(now.truth.depth);
        now.truth.paddles = [way[0].into(), way[1].into()];
        observer.offer(&tissue, &now);
        std::thread::sleep(Duration::from_millis(10));
        tick
    };
    offer();
    let mut slow = Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1");
    let mut quick = Watcher::connect(&view.foxglove_address(), "foxglove.websocket.v1");
    quick.subscribe(&topics());
    let told = quick.until(|told| told.iter().any(|told| told.topic == "/truth"));
    let entities = |topic: &str| -> Vec<String> {
        let told = told.iter().find(|told| told.topic == topic).unwrap_or_else(|| panic!("{topic}: {told:?}"));
        let all = told.message["entities"].as_array().unwrap();
        all.iter().map(|entity| entity["id"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(entities("/scene"), ["needle", "target", "paddle", "second paddle"]);
    assert_eq!(entities("/scene/body")[0], "body");
    assert!(told.iter().any(|told| told.topic == "/truth" && told.message["second_paddle_z"].is_number()));

    slow.subscribe(&topics());
    let until = Instant::now() + 6 * LONG;
    let mut last = 0;
    // As many places as there are: once the slow one is dropped there is one for somebody else.
    let _others: Vec<Watcher> = (0..2).map(|_| Watcher::connect(&view.foxglove_address(), "foxglove.sdk.v1")).collect();
    let address = view.foxglove_address();
    let (host, path) = address.strip_prefix("ws://").unwrap().split_once('/').unwrap();
    let path = format!("/{path}");
    let known = [("Host", host), ("Sec-WebSocket-Protocol", "foxglove.sdk.v1")];
    while answer(host, &path, &known).0 != 101 {
        let at = offer();
        if at % 50 == 0 {
            let mut newest = 0;
            quick.until(|told| {
                newest = told.iter().filter_map(|told| told.message["tick"].as_u64()).max().unwrap_or(0);
                newest > last
            });
            last = newest;
            quick.told.clear();
        }
        assert!(Instant::now() < until, "a client that does not read keeps its place");
    }
    assert!(last > 1, "others are told meanwhile");
    assert_eq!(slow.rest(), None, "no goodbye to who does not listen");
}

/// Ends the program, whatever the test does.
struct RunningProgram(Child);

impl Drop for RunningProgram {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The program itself: addresses, an insertion, and the end.
#[test]
fn a_run_tells_both_addresses_and_closes_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args([
            "run",
            "--view",
            "--quiet",
            "--tissue",
            "inclusion",
            "--mode",
            "lockstep",
            "--insertion-time",
            "1",
            "--out",
        ])
        .arg(folder.path().join("report"))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap());
    let mut program = RunningProgram(child);
    let mut address = |prefix: &str| {
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        line.trim().strip_prefix(prefix).unwrap_or_else(|| panic!("{line}")).to_owned()
    };
    let (page, address) = (address("Live view: http://"), address("Foxglove: ws://"));
    assert_eq!(format!("{page}foxglove"), address);
    let mut watcher = Watcher::connect(&format!("ws://{address}"), "foxglove.sdk.v1");
    watcher.subscribe(&topics());
    let told = watcher.until(|told| {
        ["/needle", "/target", "/paddle", "/command", "/truth", "/scene", "/scene/rest", "/tf", "/log"]
            .iter()
            .all(|topic| told.iter().any(|told| told.topic == *topic))
            && told.iter().any(|told| told.topic == "/truth" && told.message["depth"].as_f64() > Some(0.01))
    });
    // Of one tick of lockstep the truth is known a tick before what was answered to it.
    let commands: Vec<&Told> = told.iter().filter(|told| told.topic == "/command").collect();
    assert!(
        commands.iter().any(|told| told.message["state"] == "RUN" && told.message["x"].is_number()),
        "{commands:?}"
    );
    assert!(commands.iter().all(|told| told.message["tick"].as_u64().unwrap() * 1_000_000 == told.time_ns));
    let (host, path) = page.split_once('/').unwrap();
    let body = "\"finish\"";
    let mut page = std::net::TcpStream::connect(host).unwrap();
    write!(page, "POST /{path}request HTTP/1.1\r\nHost: {host}\r\nContent-Length: {}\r\n\r\n{body}", body.len())
        .unwrap();
    let mut granted = String::new();
    page.read_to_string(&mut granted).unwrap();
    assert!(granted.starts_with("HTTP/1.1 204"), "{granted}");
    assert_eq!(watcher.rest(), Some(1001));
    assert!(program.0.wait().unwrap().success());
}

/// The check of schemas itself.
#[test]
fn messages_that_are_none_are_noticed() {
    let (_, _, schema) = schemas().into_iter().find(|(topic, ..)| *topic == "/needle").unwrap();
    let good = json!({"sequence": 1, "measured_s": 0.5, "depth": 1.0, "velocity": 2.0});
    assert_eq!(satisfies(schema.as_value(), &good), Ok(()));
    for (name, bad) in [("sequence", json!(0.5)), ("depth", json!("1")), ("depth", json!(null)), ("more", json!(1))] {
        let mut message = good.clone();
        message[name] = bad;
        assert!(satisfies(schema.as_value(), &message).is_err(), "{message}");
    }
    assert!(satisfies(schema.as_value(), &json!({"sequence": 1})).is_err());
}
