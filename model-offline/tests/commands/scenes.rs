//! The gallery, scenes in other units, and starter scenes, as a user runs them.

use assert_cmd::Command;
use model_offline::model::TissueModel;
use model_offline::placement::{PlacementOptions, place};
use model_offline::scene::space::AnyScene;
use model_offline::scene::{BUNDLED, BUNDLED_IN_SPACE, Effect, Scene};
use std::path::Path;
use strum::VariantArray as _;

fn model_offline() -> Command {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
}

#[test]
fn every_bundled_scene_is_valid_and_carries_its_own_name() {
    for (name, text) in BUNDLED {
        assert_eq!(Scene::parse(text, name).unwrap().name, name);
    }
}

/// The same body measured in other units: 1000 times the length and 7 times the stress change no ranking and no
/// dimensionless number, and scale displacements exactly. A constant that assumes a unit somewhere would show.
#[test]
fn results_do_not_depend_on_the_units() {
    let length = 1000.0;
    let text = BUNDLED[0].1;
    let scaled = measured(text, length, 7.0);
    let solve = |text: &str| {
        let model = TissueModel::new(&Scene::parse(text, "scaled").unwrap()).unwrap();
        place(&model, &PlacementOptions { threads: 1, ..Default::default() }).unwrap()
    };
    let (one, other) = (solve(text), solve(&scaled));
    assert_eq!(one.optimum, other.optimum);
    for (a, b) in one.paddles.iter().zip(&other.paddles) {
        assert!((a.controllability_measure / b.controllability_measure - 1.0).abs() < 1e-9);
        assert!((a.static_study.max_orthogonal * length / b.static_study.max_orthogonal - 1.0).abs() < 1e-6);
    }
}

/// A scene's text with so many times its lengths and moduli.
fn measured(text: &str, length: f64, stress: f64) -> String {
    let line = |line: &str| {
        let code = line.split('#').next().unwrap_or("");
        let factor = match code.split('=').next().unwrap_or("").trim() {
            "outline" | "paths" | "contact" | "depth" | "position" | "segment" | "spacing" => length,
            "lambda" | "mu" | "c" => stress,
            _ => return format!("{code}\n"),
        };
        let (key, values) = code.split_once('=').unwrap();
        format!("{key}={}\n", times(values, factor))
    };
    text.lines().map(line).collect()
}

/// In metres the lengths of a small body are told as well as in millimetres, not as zeros.
#[test]
fn small_lengths_are_told() {
    let directory = tempfile::tempdir().unwrap();
    let [scene, table] = ["small.toml", "small.table"].map(|name| directory.path().join(name));
    // A body of a centimetre, in metres.
    std::fs::write(&scene, measured(BUNDLED[0].1, 0.01, 1.0)).unwrap();
    let said = |arguments: &[&str]| {
        let output = model_offline().args(arguments).arg(&scene).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let told = said(&["table", "--paddle", "4", "--knots", "5", "--output", table.to_str().unwrap()]);
    for part in ["depth 0.0000 to 0.001000\n", "displacement 0.001000,", "\n0.000250  ( 0.00002"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let told = said(&["compare"]);
    let shaft = told.lines().find(|line| line.starts_with("shaft")).unwrap_or_else(|| panic!("{told}"));
    let along: f64 = shaft.split_whitespace().nth(2).unwrap().parse().unwrap();
    assert!((1.9e-4..2.1e-4).contains(&along), "{shaft}");
}

/// Every number in `text` times `factor`.
fn times(text: &str, factor: f64) -> String {
    let mut out = String::new();
    let mut number = String::new();
    for c in text.chars().chain([' ']) {
        if c.is_ascii_digit() || c == '.' || c == '-' {
            number.push(c);
        } else {
            if !number.is_empty() {
                out += &format!("{:?}", number.parse::<f64>().unwrap() * factor);
                number.clear();
            }
            out.push(c);
        }
    }
    out
}

#[test]
fn a_scene_where_no_paddle_helps_is_called_so_and_gives_no_table() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("t.table");
    let said = model_offline().args(["place", "tethered"]).assert().success();
    let said = String::from_utf8(said.get_output().stdout.clone()).unwrap();
    assert!(
        said.contains("ill-conditioned (condition number") && said.contains("no paddle of this scene can"),
        "{said}"
    );
    let refused = model_offline().args(["table", "tethered", "-o"]).arg(&table).assert().code(1);
    let refused = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(refused.contains("condition number"), "{refused}");
    assert!(!table.exists());
}

#[test]
fn new_scenes_can_be_placed_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let drawing = folder.path().join("outline.svg");
    std::fs::write(
        &drawing,
        r#"<svg xmlns="http://www.w3.org/2000/svg"><path d="M 0 90 C 10 0 190 0 200 90 Z"/></svg>"#,
    )
    .unwrap();
    let mesh = folder.path().join("block.msh");
    std::fs::write(
        &mesh,
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 80 0 0\n3 80 50 0\n4 0 50 0\n$EndNodes\n\
         $Elements\n2\n1 2 2 1 1 1 2 3\n2 2 2 1 1 1 3 4\n$EndElements\n",
    )
    .unwrap();
    let from = |arguments: &[&str], input: Option<&Path>| {
        let scene = folder.path().join("new.toml");
        let mut command = model_offline();
        command.arg("new").args(arguments);
        if let Some(input) = input {
            command.arg(input);
        }
        command.args(["--force", "-o"]).arg(&scene).assert().success();
        assert_eq!(Scene::read(&scene).unwrap().told_warnings(), [""; 0], "good as it is");
        model_offline().arg("place").arg(&scene).assert().success();
        model_offline().args(["new", "-o"]).arg(&scene).assert().code(2);
        // What is written flows into another program: nothing is there to be replaced.
        let flows = model_offline().args(["new", "-o", "/dev/stdout"]).args(arguments).args(input).assert().success();
        let flowed = String::from_utf8(flows.get_output().stdout.clone()).unwrap();
        Scene::parse(&flowed, "flowed").unwrap();
        let said = String::from_utf8_lossy(&flows.get_output().stderr).into_owned();
        assert!(!flowed.contains("stdout") && !said.contains("stdout"), "{flowed}\n{said}");
    };
    from(&[], None);
    from(&["--size", "120", "--svg"], Some(&drawing));
    from(&["--msh"], Some(&mesh));
    model_offline().args(["new", "--size", "3"]).assert().code(2);
    model_offline().args(["new", "--msh"]).arg(&drawing).assert().code(2);
    model_offline().args(["new", "--svg", "absent.svg"]).assert().code(2);
}

/// What no drawing gives without names of materials.
const SUGGESTED: &str =
    "suggested, as nothing gives them: material of the body, stiffness of inclusions, depth of the needle";

/// A drawing with every role: its numbers to the drawing's rounding, a summary of everything, and a placement.
#[test]
fn a_drawing_with_all_roles_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let drawing = folder.path().join("all.svg");
    let path = folder.path().join("all.toml");
    // A page to scale, 1 unit is 1 mm, for a scene in cm; y points down on it.
    let text = r##"<svg xmlns="http://www.w3.org/2000/svg" width="200mm" height="100mm" viewBox="0 0 200 100">
<rect id="body" x="20" y="30" width="120" height="60"/>
<circle id="inclusion-1" cx="100" cy="60" r="10"/>
<line id="needle" x1="60" y1="10" x2="60" y2="70"/>
<circle id="target" cx="80" cy="64" r="2"/>
<g id="fixed"><line x1="20" y1="90" x2="140" y2="90"/></g>
<line id="paddle-1" x1="20" y1="40" x2="20" y2="60"/>
<line id="paddle-7" x1="140.5" y1="50" x2="140.5" y2="70"/>
<rect id="page" width="200" height="100"/>
<text id="title">all</text>
</svg>"##;
    std::fs::write(&drawing, text).unwrap();
    let new = |extra: &[&str]| model_offline().args(["new", "--svg"]).arg(&drawing).args(extra).assert();
    let made = new(&["--length", "cm", "-o", path.to_str().unwrap()]).success();
    let said = String::from_utf8(made.get_output().stdout.clone()).unwrap();
    for line in [
        "scale: 0.1 cm per unit of the drawing (200mm × 100mm)",
        "taken: body ← <rect> `body` (line 2)",
        "taken: inclusion ← <circle> `inclusion-1` (line 3)",
        "taken: needle ← <line> `needle` (line 4)",
        "taken: target ← <circle> `target` (line 5)",
        "taken: fixed ← <line> (line 6)",
        "taken: paddle 1 ← <line> `paddle-1` (line 7)",
        "taken: paddle 7 ← <line> `paddle-7` (line 8)",
        "left out: <rect> `page` (line 9): inclusions are those with names",
        "left out: <text> `title` (line 10): text is no shape",
    ] {
        assert!(said.lines().any(|said| said.starts_with(line)), "{line}\n{said}");
    }
    assert!(said.lines().any(|line| line == SUGGESTED), "{said}");
    let scene = Scene::read(&path).unwrap();
    let near = |a: nalgebra::Vector2<f64>, b: [f64; 2]| (a - nalgebra::Vector2::from(b)).norm() < 1e-4;
    let corners = [[0.0, 0.0], [12.0, 0.0], [12.0, 6.0], [0.0, 6.0]];
    assert!(corners.iter().all(|c| scene.outline.vertices().iter().any(|v| near(*v, *c))), "{:?}", scene.outline);
    let circle = std::f64::consts::PI;
    assert!((scene.inclusions[0].outline.area() / circle - 1.0).abs() < 0.02);
    assert!((scene.inclusions[0].outline.centroid() - nalgebra::Vector2::new(8.0, 3.0)).norm() < 0.01);
    assert!(near(scene.needle.entry(), [4.0, 6.0]) && near(scene.needle.axis, [0.0, -1.0]));
    assert!((scene.target - nalgebra::Vector2::new(6.0, 2.6)).norm() < 5e-3, "{:?}", scene.target);
    assert!(near(scene.immobile[0][0], [0.0, 0.0]) && near(scene.immobile[0][1], [12.0, 0.0]), "{:?}", scene.immobile);
    let ends = |i: usize| scene.paddles[i].segment;
    assert_eq!((scene.paddles[0].index, scene.paddles[1].index), (1, 7));
    assert!(near(ends(0)[0], [0.0, 5.0]) && near(ends(0)[1], [0.0, 3.0]), "{:?}", ends(0));
    assert!(near(ends(1)[0], [12.0, 4.0]) && near(ends(1)[1], [12.0, 2.0]), "{:?}", ends(1));
    model_offline().arg("place").arg(&path).args(["--spacing", "1.0"]).assert().success();
    // Where the scene itself goes to standard output, the summary does not.
    let printed = new(&["--length", "cm"]).success();
    assert_eq!(printed.get_output().stdout, std::fs::read(&path).unwrap());
    assert!(String::from_utf8_lossy(&printed.get_output().stderr).contains("taken: paddle 7"));
    // Some programs write two bytes for a letter.
    for (mark, of) in [([0xff, 0xfe], u16::to_le_bytes as fn(u16) -> [u8; 2]), ([0xfe, 0xff], u16::to_be_bytes)] {
        let bytes: Vec<u8> = mark.into_iter().chain(text.encode_utf16().flat_map(of)).collect();
        std::fs::write(&drawing, bytes).unwrap();
        assert_eq!(new(&["--length", "cm"]).success().get_output().stdout, printed.get_output().stdout);
    }
    let half = text.encode_utf16().flat_map(u16::to_le_bytes).chain([0x20]);
    for wrong in [vec![0xff, 0xfe, 0x00, 0xd8, 0x20, 0x00], [0xff, 0xfe].into_iter().chain(half).collect()] {
        std::fs::write(&drawing, wrong).unwrap();
        new(&[]).code(2);
    }
    // Roles that contradict each other: whose, and what to do.
    std::fs::write(&drawing, text.replace(r#"x1="20" y1="40" x2="20" y2="60""#, r#"x1="40" y1="90" x2="60" y2="90""#))
        .unwrap();
    let refused = new(&[]).code(2);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(said.contains("paddle 1 is on the immobile part") && said.contains("paddle-1"), "{said}");
}

/// The drawing of the guide: every role is taken, and nothing is suggested but what no drawing gives.
#[test]
fn the_drawing_of_the_guide_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drawn.toml");
    let drawing = Path::new(env!("CARGO_MANIFEST_DIR")).join("pictures/drawing.svg");
    let made = model_offline().args(["new", "--svg"]).arg(&drawing).arg("-o").arg(&path).assert().success();
    let said = String::from_utf8(made.get_output().stdout.clone()).unwrap();
    assert_eq!(said.lines().filter(|line| line.starts_with("taken: ")).count(), 9, "{said}");
    assert_eq!(said.lines().filter(|line| line.starts_with("left out: ")).count(), 2, "{said}");
    assert!(said.lines().any(|line| line == SUGGESTED), "{said}");
    let scene = Scene::read(&path).unwrap();
    let (low, high) = scene.outline.bounds();
    assert!((high - low - nalgebra::Vector2::new(120.0, 70.0)).norm() < 0.1);
    assert_eq!((scene.paddles.len(), scene.inclusions.len(), scene.immobile.len()), (4, 1, 1));
    // Drawn along curves, and as long as they are drawn: there the body is straight.
    for (paddle, [x, y]) in scene.paddles.iter().zip([[8.0f64, 16.0], [10.0, 10.0], [10.0, 10.0], [8.0, 16.0]]) {
        let [a, b] = paddle.segment;
        assert!(((b - a).norm() / x.hypot(y) - 1.0).abs() < 0.05, "{paddle:?}");
    }
    assert!(said.matches("outline: straight under").count() == 4 && !said.contains("cut off"), "{said}");
    // The ellipse's middle, 72 to the right of the body's left and 38 above its lowest line.
    assert!((scene.target - nalgebra::Vector2::new(72.0, 38.0)).norm() < 0.05, "{:?}", scene.target);
    assert_eq!(scene.warnings().len(), 0);
}

/// A leg as a user draws it, round outside and inside: what ends on its curves is on the outline to the last digit, its elements
/// have a height, and two methods find the same. Once both failed: triangles without a height held the contact's ends, which made
/// the measure of paddle 1 half again as large and its estimated error small.
#[test]
fn a_drawn_leg_is_as_accurate_as_it_is_said_to_be() {
    let folder = tempfile::tempdir().unwrap();
    let (drawing, scene) = (folder.path().join("leg.svg"), folder.path().join("leg.toml"));
    let text = r##"<svg xmlns="http://www.w3.org/2000/svg" width="140mm" height="130mm" viewBox="0 0 140 130">
<path id="body" d="M 70 10 C 110 10 130 40 125 70 C 120 105 95 120 68 118 C 30 116 12 95 14 62 C 16 30 38 10 70 10 Z"/>
<circle id="inclusion-tibia" cx="82" cy="88" r="11"/>
<ellipse id="inclusion-fibula" cx="42" cy="92" rx="6" ry="5"/>
<ellipse id="inclusion-lump" cx="66" cy="48" rx="9" ry="7"/>
<circle id="target" cx="66" cy="48" r="2"/>
<line id="needle" x1="66" y1="0" x2="66" y2="40"/>
<path id="fixed" d="M 30 112 C 45 118 60 118 68 118 C 80 118 92 115 100 110" fill="none"/>
<path id="paddle-1" d="M 17 45 L 24 31"/>
<path id="paddle-3" d="M 100 18 L 113 28"/>
</svg>"##;
    std::fs::write(&drawing, text).unwrap();
    model_offline().args(["new", "--svg"]).arg(&drawing).arg("-o").arg(&scene).assert().success();
    let contact = Scene::read(&scene).unwrap();
    let off = contact.needle.contact.iter().map(|p| contact.outline.distance_to_boundary(*p)).fold(0.0, f64::max);
    assert!(off < 1e-12 * contact.outline.size(), "{off}");
    let study = |method: &str| {
        let json = folder.path().join("study.json");
        let asked = ["--tolerance", "0.05", "--integration", method, "--quiet", "--json"];
        model_offline().arg("place").arg(&scene).args(asked).arg(&json).assert().success();
        serde_json::from_str::<serde_json::Value>(&std::fs::read_to_string(&json).unwrap()).unwrap()
    };
    let (elements, nodes) = (study("fem-t6"), study("scni-stabilised"));
    for study in [&elements, &nodes] {
        assert!(study["error_estimate"]["controllability"].as_f64().unwrap() <= 0.05);
        // As the curves ask for, not the 67 corners that they are given with: those took 19,000.
        assert!(study["nodes"].as_u64().unwrap() < 4_000, "{}", study["nodes"]);
    }
    for place in 0..2 {
        let [one, other] =
            [&elements, &nodes].map(|study| study["paddles"][place]["controllability_measure"].as_f64().unwrap());
        assert!((one / other - 1.0).abs() < 0.05, "{one} {other}");
    }
}

/// What sees the target: presets, numbers of the scene's own, and what is refused.
#[test]
fn scenes_say_what_sees_the_target() {
    use model_offline::scene::SensorPreset;

    let (_, paper) = BUNDLED[0];
    let with = |unit: &str, section: &str| {
        let text = paper.replace("length = \"1\"", &format!("length = {unit:?}"));
        assert!(unit == "1" || text != paper, "the unit stands in the file");
        Scene::parse(&format!("{text}\n[sensor]\n{section}\n"), "sensor.toml")
    };
    let plain = with("1", "").unwrap();
    assert_eq!((plain.sensor.preset, plain.sensor.rate, plain.sensor.noise), (SensorPreset::Ideal, 50.0, 1e-5));
    assert_eq!(with("mm", "").unwrap().sensor.preset, SensorPreset::Ultrasound);
    assert!((with("cm", "preset = \"camera\"").unwrap().sensor.noise - 0.005).abs() < 1e-12);
    let own = with(
        "mm",
        "preset = \"mri\"\nrate = 8.0\nnoise = 0.3\nbias = [0.1, 0.0]\noutages = { every = 20.0, last = 0.3 }",
    );
    let sensor = own.unwrap().sensor;
    assert_eq!((sensor.rate, sensor.noise, sensor.latency, sensor.quantisation), (8.0, 0.3, 0.3, 0.5));
    assert!(sensor.is_changed && sensor.outages.is_some_and(|outages| outages.every == 20.0));
    // Not part of the tissue: tables and recordings stay those of the scene.
    assert_eq!(with("mm", "preset = \"mri\"").unwrap().hash(), with("mm", "").unwrap().hash());
    for (unit, section, said) in [
        ("1", "preset = \"camera\"", "unit of length"),
        ("mm", "preset = \"sonar\"", "sonar"),
        ("mm", "rate = 0.05", "rate"),
        ("mm", "rate = nan", "rate"),
        ("mm", "latency = 61.0", "latency"),
        ("mm", "latency = -1.0", "latency"),
        ("mm", "noise = -0.1", "noise"),
        ("mm", "noise = 1e9", "noise"),
        ("mm", "noise = inf", "noise"),
        ("mm", "quantisation = -1.0", "quantisation"),
        ("mm", "quantisation = 1e300", "quantisation: 1e300 is no sensor"),
        ("mm", "bias = [nan, 0.0]", "bias"),
        ("mm", "outages = { every = 1e12, last = 1.0 }", "every"),
        ("mm", "outages = { every = 1.0, last = 1e-9 }", "last"),
        ("mm", "outages = { every = 1.0 }", "last"),
        ("mm", "colour = \"red\"", "colour"),
    ] {
        let refused = with(unit, section).unwrap_err();
        let text = format!("{refused:?} {refused}");
        assert!(text.contains(said), "{section}: {text}");
    }
}

/// What paddles and needle are capable of has the unit of the depth, in the plane and in space.
#[test]
fn limits_of_another_unit_are_refused_where_they_stand() {
    use model_offline::scene::BUNDLED_IN_SPACE;
    use model_offline::scene::space::AnyScene;

    for (scene, text) in [BUNDLED[0], BUNDLED_IN_SPACE[0]] {
        assert!(!text.contains("[actuator]"), "{scene}");
        let with =
            |key: &str, value: &str| AnyScene::parse(&format!("{text}\n[actuator]\n{key} = {value}\n"), "limits.toml");
        for key in ["max_displacement", "max_rate", "max_needle_speed"] {
            for value in ["1e-300", "1e300", "5e-324"] {
                let refused = with(key, value).unwrap_err();
                let told = format!("{refused:?} {refused}");
                assert!(told.contains(&format!("{key}: ")) && told.contains("has another unit"), "{scene}: {told}");
            }
            with(key, "0.01").unwrap();
            with(key, "-1").unwrap_err();
        }
    }
}

/// All numbers of a value, in its order.
fn numbers(value: &serde_json::Value) -> Vec<f64> {
    match value {
        serde_json::Value::Number(number) => number.as_f64().into_iter().collect(),
        serde_json::Value::Array(values) => values.iter().flat_map(numbers).collect(),
        serde_json::Value::Object(values) => values.values().flat_map(numbers).collect(),
        _ => Vec::new(),
    }
}

/// The scenes that have everything are those without it, with every effect of the order that the literature reports.
#[test]
fn the_worlds_are_the_scenes_with_every_effect() {
    for name in ["breast", "prostate"] {
        let plain = Scene::bundled(name).unwrap();
        let world = Scene::bundled(&format!("{name}-world")).unwrap();
        let expected = Effect::VARIANTS.iter().fold(plain.clone(), |scene, effect| scene.with_effect(*effect));
        // All that is no effect.
        assert_eq!(world.without_a_past().hash(), plain.hash(), "{name}");
        assert_eq!((world.sensor, world.effects()), (plain.sensor, expected.effects()));
        assert_eq!((&world.length_unit, &world.stress_unit), (&plain.length_unit, &plain.stress_unit));
        // All that is one.
        assert_eq!(world.material, expected.material);
        for (own, other) in world.inclusions.iter().zip(&expected.inclusions) {
            assert_eq!((&own.material, own.resistance), (&other.material, other.resistance));
        }
        assert_eq!(world.needle.deflection, expected.needle.deflection);
        for (own, other) in [
            (
                serde_json::json!([world.needle.shaft, world.needle.speed]),
                serde_json::json!([expected.needle.shaft, expected.needle.speed]),
            ),
            (serde_json::json!(world.motion), serde_json::json!(expected.motion)),
        ] {
            let (own, other) = (numbers(&own), numbers(&other));
            assert_eq!(own.len(), other.len(), "{name}");
            // Rounding of the last digit, and of nothing else: directions and the middle of the contact are computed.
            assert!(
                own.iter().zip(&other).all(|(a, b)| (a - b).abs() <= 1e-13 * b.abs().max(1.0)),
                "{name}: {own:?} {other:?}"
            );
        }
    }
}

/// Placement knows a needle whose contact moves with it only: it says so, and leaves nothing behind.
#[test]
fn placement_refuses_the_worlds() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("place.json");
    for name in ["breast-world", "prostate-world"] {
        let refused = model_offline().args(["place", name, "--json"]).arg(&json).assert().code(2);
        let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(said.contains("slip"), "{said}");
        assert!(!json.exists());
    }
}

#[test]
fn scenes_say_what_is_wrong_with_a_motion() {
    let text = model_offline::scene::BUNDLED[0].1;
    let breathing =
        |key: &str| format!("breathing = {{ period = 4.0, amplitude = 1.0, direction = [0.0, 1.0], {key} }}");
    let surge = |key: &str| format!("surge = {{ at = 1.0, last = 0.5, amplitude = 1.0, {key} }}");
    let read = |motion: &str| {
        let text = text.replace("[[inclusion]]", &format!("[motion]\n{motion}\n[[inclusion]]"));
        Scene::parse(&text, "moves.toml")
    };
    for (motion, says) in [
        (breathing("period_variation = 0.7"), "breaths cannot vary by this part"),
        (breathing("amplitude_variation = -0.1"), "breaths cannot vary by this part"),
        (breathing("amplitude_variation = nan"), "breaths cannot vary by this part"),
        (breathing("size_variation = 0.1"), "unknown field `size_variation`"),
        ("breathing = { period = 0.0, amplitude = 1.0, direction = [0.0, 1.0] }".to_owned(), "period is 0"),
        ("breathing = { period = 1.0, amplitude = 1.0, direction = [0.0, 0.0] }".to_owned(), "has no direction"),
        (surge("direction = [inf, 0.0]"), "finite"),
        (surge("amplitude_variation = 0.1"), "unknown field"),
        ("recorded = []".to_owned(), "recorded is no motion"),
        ("recorded = [[1.0, 0.0, 0.0], [1.0, 0.1, 0.0]]".to_owned(), "recorded is no motion"),
    ] {
        let error = read(&motion).expect_err(&motion);
        assert!(error.to_string().contains(says), "{motion}: {error}");
    }
    let varies =
        read(&breathing("period_variation = 0.1, amplitude_variation = 0.5")).unwrap().motion.breathing.unwrap();
    assert_eq!([varies.period_variation, varies.amplitude_variation], [0.1, 0.5]);
    // A scene whose breaths are alike is the same file as ever: tables and snapshots are known by its hash.
    let alike = serde_json::json!(read(&breathing("period_variation = 0.0")).unwrap().motion);
    assert_eq!(alike["breathing"].as_object().unwrap().len(), 3, "{alike}");
}

/// TOML's reader drops what a list has too much: three coordinates in the plane were two.
#[test]
fn coordinates_of_another_dimension_are_refused_wherever_they_stand() {
    let bundled = |name: &str| BUNDLED.iter().chain(&BUNDLED_IN_SPACE).find(|(other, _)| *other == name).unwrap().1;
    for (name, given, wrong) in [
        ("paper", "position = [0.5, 0.5]", "position = [0.5, 0.5, 7.0]"),
        ("paper", "axis = [0.0, -1.0]", "axis = [0.0, -1.0, 0.0]"),
        ("paper", "outline = [[0.5, 0.0],", "outline = [[0.5, 0.0, 7.0],"),
        ("paper", "outline = [[0.55, 0.25],", "outline = [[0.55, 0.25, 7.0],"),
        ("paper", "paths = [[[1.0, 0.0],", "paths = [[[1.0, 0.0, 7.0],"),
        ("paper", "contact = [[0.4, 1.0], [0.6, 1.0]]", "contact = [[0.4, 1.0], [0.6, 1.0, 7.0]]"),
        ("paper", "segment = [[0.4, 0.1], [0.3, 0.2]]", "segment = [[0.4, 0.1], [0.3, 0.2], [0.2, 0.3]]"),
        ("paper", "segment = [[0.4, 0.1], [0.3, 0.2]]", "segment = [[0.4, 0.1]]"),
        ("block", "position = [0.5, 0.5, 0.5]", "position = [0.5, 0.5, 0.5, 7.0]"),
        ("block", "axis = [0.0, 0.0, -1.0]", "axis = [0.0, 0.0, -1.0, 7.0]"),
        ("block", "min = [0.6, 0.4, 0.3]", "min = [0.6, 0.4, 0.3, 7.0]"),
    ] {
        let text = bundled(name);
        assert!(text.contains(given), "{name}: {given}");
        let text = text.replacen(given, wrong, 1);
        let said = AnyScene::parse(&text, "wrong.toml").expect_err(wrong).to_string();
        assert!(said.contains("expected an array of length"), "{wrong}: {said}");
    }
}
