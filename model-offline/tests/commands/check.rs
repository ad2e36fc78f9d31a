//! What a scene says of itself without solving: warnings, parts of the boundary by edge, by fraction or nearly on it, and
//! pictures, as the library and the commands give them.

use assert_cmd::Command;
use model_offline::geometry::Point2;
use model_offline::output::scene_picture;
use model_offline::scene::{BUNDLED, Scene, SceneError, SceneWarning};
use std::path::Path;

fn model_offline() -> Command {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
}

/// A block, 100 by 60 mm, in which nothing is unusual.
const BLOCK: &str = r#"
[scene]
name = "block"
dimension = 2
units = { length = "mm", stress = "kPa" }

[domain]
outline = [[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [0.0, 60.0]]

[material]
model = "neo-hookean"
lambda = 4.0
mu = 1.0

[[inclusion]]
outline = [[60.0, 10.0], [80.0, 10.0], [80.0, 30.0], [60.0, 30.0]]
stiffness = 10.0

[immobile]
paths = [[[0.0, 0.0], [100.0, 0.0]]]

[needle]
contact = [[40.0, 60.0], [60.0, 60.0]]
axis = [0.0, -1.0]
depth = 20.0
increments = 10

[target]
position = [50.0, 30.0]

[[paddle]]
index = 4
segment = [[0.0, 20.0], [0.0, 40.0]]

[[paddle]]
index = 7
segment = [[100.0, 20.0], [100.0, 40.0]]

[discretization]
spacing = 5.0
"#;

/// The block with these parts of its text replaced.
fn text(edits: &[(&str, &str)]) -> String {
    edits.iter().fold(BLOCK.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

fn read(edits: &[(&str, &str)]) -> Result<Scene, SceneError> {
    Scene::parse(&text(edits), "block.toml")
}

fn warnings(edits: &[(&str, &str)]) -> Vec<SceneWarning> {
    read(edits).unwrap().warnings()
}

const DEPTH: &str = "depth = 20.0";
const AXIS: &str = "axis = [0.0, -1.0]";
const CONTACT: &str = "[[40.0, 60.0], [60.0, 60.0]]";
const INCLUSION: &str = "[[60.0, 10.0], [80.0, 10.0], [80.0, 30.0], [60.0, 30.0]]";
const TARGET: &str = "position = [50.0, 30.0]";
const LAST_PADDLE: &str = "segment = [[100.0, 20.0], [100.0, 40.0]]";

const SHAFT: &str =
    "depth = 20.0\nmechanics = \"shaft\"\npuncture_force = 1.0\ncutting_force = 1.0\nstatic_friction = 0.3\n";

#[test]
fn nothing_is_unusual_in_the_bundled_scenes_and_in_the_block() {
    assert_eq!(warnings(&[]), []);
    for (name, _) in BUNDLED {
        assert_eq!(Scene::bundled(name).unwrap().warnings(), [], "{name}");
    }
}

/// One scene for every warning, which has it and no other; lengths are those of the sketch.
#[test]
fn every_warning_is_given_with_its_numbers_where_it_is_due() {
    let tip = |length: f64| format!("{SHAFT}kinetic_friction = 0.2\ntip_length = {length}\n");
    type Case<'a> = (&'a [(&'a str, &'a str)], &'a [&'a str]);
    let tolerance = ("spacing = 5.0", "tolerance = 0.05");
    let moved = |amplitude: f64| {
        format!("[motion]\nbreathing = {{ period = 4.0, amplitude = {amplitude}, direction = [0.0, 1.0] }}\n[immobile]")
    };
    let cases: [Case<'_>; 31] = [
        (&[(AXIS, "axis = [0.0, 1.0]")], &["points out of the body: 180°", "turn the axis round"]),
        (&[(AXIS, "axis = [0.5, 1.0]")], &["points out of the body: 153°"]),
        (&[(AXIS, "axis = [1.0, -0.1]")], &["along the surface: 5.7°", "turn the axis inwards"]),
        (&[(AXIS, "axis = [1.0, 0.05]")], &["along the surface: 2.9°"]),
        (
            &[(AXIS, "axis = [1.0, -0.3]"), (DEPTH, "depth = 10.0")],
            &["does not go towards the target: its line misses it by 28.73 mm"],
        ),
        (
            &[(TARGET, "position = [60.0, 35.0]"), (DEPTH, "depth = 20.0")],
            &["goes beside the target: at depth 25 mm it is nearest, 10 mm off"],
        ),
        (&[(DEPTH, "depth = 31.0")], &["goes deeper than the target: depth 31 mm, the target lies at 30 mm"]),
        (
            &[(CONTACT, "[[40.0, 60.0], [41.0, 60.0]]"), (TARGET, "position = [40.5, 30.0]")],
            &["contact is shorter than the node spacing: 1 mm of 5 mm"],
        ),
        (&[(TARGET, "position = [50.0, 2.0]")], &["the target is nearer to the boundary", "2 mm of 5 mm"]),
        (
            // Nodes are as fine there as the tolerance takes; what is held stays held.
            &[(TARGET, "position = [50.0, 0.5]"), ("spacing = 5.0", "tolerance = 0.05")],
            &["the target is next to the immobile part, 0.5 mm from it", "hardly any paddle"],
        ),
        // Metres, and millimetres: no spacing is needed to see that.
        (
            &[(INCLUSION, "[[60.0, 10.0], [60.01, 10.0], [60.01, 10.02], [60.0, 10.02]]"), tolerance],
            &["inclusion 1 is 0.01 mm wide, in a body of 116.6 mm", "check the numbers and their unit"],
        ),
        (
            &[(CONTACT, "[[50.0, 60.0], [50.1, 60.0]]"), (TARGET, "position = [50.05, 30.0]"), tolerance],
            &["the needle contact is 0.1 mm long, in a body of 116.6 mm"],
        ),
        (
            &[(LAST_PADDLE, "segment = [[100.0, 20.0], [100.0, 20.1]]"), tolerance],
            &["paddle 7 is 0.1 mm long, in a body of 116.6 mm"],
        ),
        (
            &[(TARGET, "position = [50.0, 59.95]"), (DEPTH, "depth = 0.04"), tolerance],
            &["the target is 0.05 mm from the boundary, in a body of 116.6 mm"],
        ),
        (
            &[(LAST_PADDLE, "segment = [[60.1, 60.0], [80.0, 60.0]]")],
            &["paddle 7 is 0.1 mm beside the needle's contact, which is pushed by 20 mm", "may stop at once"],
        ),
        (
            &[(INCLUSION, "[[60.0, -10.0], [80.0, -10.0], [80.0, 30.0], [60.0, 30.0]]")],
            &["inclusion 1 is partly outside the body: 25 % of its area"],
        ),
        (
            &[(INCLUSION, "[[60.0, 10.0], [80.0, 10.0], [80.0, 14.0], [60.0, 14.0]]")],
            &["inclusion 1 is narrower than the node spacing: 4 mm of 5 mm"],
        ),
        (
            &[(LAST_PADDLE, "segment = [[100.0, 20.0], [100.0, 22.5]]")],
            &["paddle 7 is shorter than the node spacing: 2.5 mm of 5 mm"],
        ),
        (
            // Ends that a drawing's digits have pushed past each other.
            &[(
                LAST_PADDLE,
                &format!("{LAST_PADDLE}\n[[paddle]]\nindex = 8\nsegment = [[100.0, 39.9], [100.0, 60.0]]"),
            )],
            &["overlap by 0.1 mm", "let one end where the other begins"],
        ),
        (
            &[(DEPTH, SHAFT)],
            &["the friction of the needle only sticks: static_friction is 0.3", "give kinetic_friction too"],
        ),
        (
            &[
                (DEPTH, &format!("{SHAFT}kinetic_friction = 0.2\n")),
                ("stiffness = 10.0", "stiffness = 10.0\nstatic_friction = 0.7\nkinetic_friction = 0.0"),
            ],
            &["the friction of inclusion 1 only sticks: static_friction is 0.7"],
        ),
        (
            // Twice the shear modulus of 1 on 0.4 is 0.8, in the inclusion 8; nodes that are 5 apart do not see the tip.
            &[(DEPTH, &tip(0.4)), ("spacing = 5.0", "tolerance = 0.05")],
            &["the tip is 0.4 mm long", "the cutting force of the needle from 0.5 mm on", "a longer tip_length"],
        ),
        (
            &[
                (DEPTH, &tip(0.6)),
                ("stiffness = 10.0", "stiffness = 10.0\ncutting_force = 20.0"),
                ("spacing = 5.0", "tolerance = 0.05"),
            ],
            &["the tip is 0.6 mm long", "the cutting force of inclusion 1 from 1 mm on"],
        ),
        (
            &[(
                "[immobile]",
                "[[inclusion]]\noutline = [[70.0, 20.0], [90.0, 20.0], [90.0, 40.0], [70.0, 40.0]]\nstiffness = 2.0\n[immobile]",
            )],
            &["inclusions 1 and 2 overlap: an area of 100 mm², 25 % of the smaller one, is taken to be of inclusion 2"],
        ),
        (
            // The same twice.
            &[("[immobile]", &format!("[[inclusion]]\noutline = {INCLUSION}\nstiffness = 2.0\n[immobile]"))],
            &["inclusion 1 does nothing: inclusion 2 covers it", "write the inner one after the outer one"],
        ),
        (
            // The outer one after the inner one.
            &[(
                "[immobile]",
                "[[inclusion]]\noutline = [[50.0, 10.0], [90.0, 10.0], [90.0, 50.0], [50.0, 50.0]]\nstiffness = 2.0\n[immobile]",
            )],
            &["inclusion 1 does nothing: inclusion 2 covers it"],
        ),
        (
            &[(DEPTH, &tip(20.5))],
            &["the tip is 20.5 mm long, and the needle goes 20 mm deep: its cutting force is never reached"],
        ),
        (
            // On nodes 5 mm apart tissue bears what it does beside a tip as long, and twice that hides it.
            &[(DEPTH, &tip(1.0).replace("cutting_force = 1.0", "cutting_force = 21.0"))],
            &["the tip is 1 mm long, and tissue bears the cutting force of the needle from 10.5 mm on"],
        ),
        (
            &[(DEPTH, "depth = 20.0\nspeed = 2e5")],
            &["the needle goes 200000 mm in a second, through a body of 116.6 mm in less than a millisecond"],
        ),
        (&[("[immobile]", &moved(60.0))], &["[motion] moves the body by up to 60 mm, and it is 116.6 mm across"]),
        (
            // Inside, with the paddle on the skin above.
            &[
                (CONTACT, "[[50.0, 50.0], [50.0, 40.0]]"),
                (DEPTH, "depth = 5.0"),
                (LAST_PADDLE, "segment = [[45.0, 60.0], [55.0, 60.0]]"),
            ],
            &["paddle 7 is in the needle's way, 15 mm before its entry"],
        ),
    ];
    let mut wrong = Vec::new();
    for (edits, expected) in cases {
        let told = read(edits).unwrap().told_warnings();
        let is_told = told.len() == 1 && expected.iter().all(|part| told[0].contains(part));
        wrong.extend((!is_told).then(|| format!("{expected:?}: {told:?}")));
    }
    assert!(wrong.is_empty(), "{} of them:\n{}", wrong.len(), wrong.join("\n"));
}

/// Ten thousand pairs of inclusions on each other: the list of them would say no more, and take all of the memory.
#[test]
fn of_many_overlaps_a_hundred_are_told() {
    let again = format!("[[inclusion]]\noutline = {INCLUSION}\nstiffness = 2.0\n").repeat(140);
    let overlaps = warnings(&[("[immobile]", &format!("{again}[immobile]"))]);
    assert_eq!(overlaps.len(), 100);
}

/// A name is shown as it is, on a terminal as well.
#[test]
fn names_and_units_have_no_characters_that_a_terminal_obeys() {
    for edit in [(r#"name = "block""#, r#"name = "a\u001b[2J""#), (r#"length = "mm""#, r#"length = "m\u009bm""#)] {
        let refused = read(&[edit]).unwrap_err().to_string();
        assert!(refused.contains("control character"), "{edit:?}: {refused}");
    }
}

/// What is not unusual, though near to it.
#[test]
fn what_is_meant_is_not_warned_of() {
    let tip = format!("{SHAFT}kinetic_friction = 0.2\ntip_length = 20.0\n");
    let presses = tip.replace("cutting_force = 1.0", "cutting_force = 19.0").replace("= 20.0\n", "= 1.0\n");
    let moved = "[motion]\nbreathing = { period = 4.0, amplitude = 50.0, direction = [0.0, 1.0] }\n[immobile]";
    let fine: [&[(&str, &str)]; 11] = [
        &[(DEPTH, &tip)],
        &[(DEPTH, &presses)],
        &[(DEPTH, "depth = 20.0\nspeed = 1e5")],
        &[("[immobile]", moved)],
        // Less deep than half the way, past the target on purpose, as in `breast`.
        &[(AXIS, "axis = [0.5, -1.0]"), (DEPTH, "depth = 10.0")],
        // To the target itself.
        &[(DEPTH, "depth = 30.0")],
        // One all inside another.
        &[(
            "[immobile]",
            "[[inclusion]]\noutline = [[65.0, 15.0], [75.0, 15.0], [75.0, 25.0], [65.0, 25.0]]\nstiffness = 2.0\n[immobile]",
        )],
        // Two side by side.
        &[(
            "[immobile]",
            "[[inclusion]]\noutline = [[80.0, 10.0], [90.0, 10.0], [90.0, 30.0], [80.0, 30.0]]\nstiffness = 2.0\n[immobile]",
        )],
        // As wide as the nodes are apart; along the boundary.
        &[(INCLUSION, "[[60.0, 0.0], [80.0, 0.0], [80.0, 5.0], [60.0, 5.0]]")],
        &[(DEPTH, &format!("{SHAFT}viscous_friction = 0.2\n"))],
        // Without a spacing nothing is narrow.
        &[
            ("spacing = 5.0", "tolerance = 0.05"),
            (INCLUSION, "[[60.0, 10.0], [80.0, 10.0], [80.0, 11.0], [60.0, 11.0]]"),
        ],
    ];
    for edits in fine {
        assert_eq!(warnings(edits), [], "{edits:?}");
    }
}

/// Whoever goes so deep goes past any target as well.
#[test]
fn a_needle_that_comes_out_on_the_other_side_is_warned_of() {
    let through = [("[[0.0, 0.0], [100.0, 0.0]]", "[[0.0, 60.0], [30.0, 60.0]]"), (DEPTH, "depth = 70.0")];
    assert_eq!(
        warnings(&through),
        [
            SceneWarning::DeeperThanTarget { depth: 70.0, nearest_at: 30.0 },
            SceneWarning::NeedleLeavesBody { depth: 70.0, at: 60.0 },
        ]
    );
}

#[test]
fn a_needle_that_ends_on_what_is_held_is_warned_of() {
    let edits = [(DEPTH, "depth = 58.0"), (TARGET, "position = [50.0, 1.5]")];
    let found = warnings(&edits);
    assert!(
        found
            .iter()
            .any(|w| matches!(w, SceneWarning::NeedleMeetsImmobile { depth: 58.0, distance } if *distance == 2.0)),
        "{found:?}"
    );
    // It enters beside what is held.
    let beside = [("[[0.0, 0.0], [100.0, 0.0]]", "[[0.0, 60.0], [39.0, 60.0]]")];
    assert_eq!(warnings(&beside), []);
}

/// The points of a scene as its file would have them, in place of its edges.
fn by_points(scene: &Scene, text: &str) -> String {
    let path = |points: &[Point2]| {
        let points: Vec<String> = points.iter().map(|p| format!("[{:?}, {:?}]", p.x, p.y)).collect();
        format!("[{}]", points.join(", "))
    };
    let mut paddles = scene.paddles.iter();
    let lines = text.lines().map(|line| match line.split(" = ").next().unwrap() {
        "paths" => format!("paths = [{}]", scene.immobile.iter().map(|p| path(p)).collect::<Vec<_>>().join(", ")),
        "contact" => format!("contact = {}", path(&scene.needle.contact)),
        "segment" => format!("segment = {}", path(&paddles.next().unwrap().segment)),
        _ => line.to_owned(),
    });
    lines.map(|line| line + "\n").collect()
}

/// Unit, outline, and a point inside.
type Body = (&'static str, Vec<[f64; 2]>, [f64; 2]);

/// Bodies in other units, far from the origin, turned, and given clockwise.
fn bodies() -> Vec<Body> {
    let turned = |x: f64, y: f64| {
        let (sin, cos) = 0.7_f64.sin_cos();
        [x * cos - y * sin + 1e6, x * sin + y * cos - 1e6]
    };
    let l = [[0.0, 0.0], [80.0, 0.0], [80.0, 30.0], [30.0, 30.0], [30.0, 80.0], [0.0, 80.0]];
    vec![
        ("mm", l.to_vec(), [17.0, 19.0]),
        ("mm", l.iter().rev().copied().collect(), [17.0, 19.0]),
        ("in", vec![[0.1, 0.2], [2.61, 1.03], [2.17, 2.04], [-0.33, 1.07]], [1.1, 1.1]),
        ("m", vec![[0.0, 0.0], [0.0123, 0.0007], [0.0131, 0.0098], [0.0003, 0.0101]], [0.006, 0.005]),
        (
            "mm",
            [[0.0, 0.0], [70.0, 0.0], [70.0, 40.0], [0.0, 40.0]].map(|[x, y]| turned(x, y)).to_vec(),
            turned(33.0, 21.0),
        ),
    ]
}

/// A scene in such a body, held at edge 0 as a whole, with a contact and a paddle.
fn in_body((unit, outline, target): &Body, contact: &str, paddle: &str) -> String {
    let size = extent(outline);
    text(&[
        ("length = \"mm\"", &format!("length = {unit:?}")),
        ("outline = [[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [0.0, 60.0]]", &format!("outline = {outline:?}")),
        (&format!("[[inclusion]]\noutline = {INCLUSION}\nstiffness = 10.0\n"), ""),
        ("[[[0.0, 0.0], [100.0, 0.0]]]", "[{ edge = 0 }]"),
        (CONTACT, contact),
        (DEPTH, &format!("depth = {}", 0.05 * size)),
        (TARGET, &format!("position = {target:?}")),
        ("index = 4\nsegment = [[0.0, 20.0], [0.0, 40.0]]\n\n[[paddle]]\n", ""),
        (LAST_PADDLE, &format!("segment = {paddle}")),
        ("spacing = 5.0", &format!("spacing = {}", 0.05 * size)),
    ])
}

fn extent(outline: &[[f64; 2]]) -> f64 {
    let side = |k: usize| {
        let of = outline.iter().map(|p| p[k]);
        of.clone().fold(f64::NEG_INFINITY, f64::max) - of.fold(f64::INFINITY, f64::min)
    };
    side(0).hypot(side(1))
}

#[test]
fn edges_are_the_points_that_they_stand_for_to_the_last_bit() {
    for body in bodies() {
        let (unit, outline, _) = &body;
        for (from, to) in [(0.2, 0.4), (0.1, 1.0 / 3.0), (0.123456789, 0.7)] {
            let part = |edge: usize| format!("{{ edge = {edge}, from = {from}, to = {to} }}");
            let edges = in_body(&body, &part(3), &part(2));
            let by_edges = Scene::parse(&edges, "edges").unwrap_or_else(|error| panic!("{unit}: {error}"));
            let points = by_points(&by_edges, &edges);
            assert!(!points.contains("edge ="), "{points}");
            let by_points = Scene::parse(&points, "points").unwrap_or_else(|error| panic!("{unit}: {error}"));
            assert_eq!(by_edges.hash(), by_points.hash(), "{unit} {from} {to}");
            // Whole edges are the vertices.
            assert_eq!(by_edges.immobile[0], [outline[0], outline[1]].map(Point2::from), "{unit}");
            let [a, b] = [outline[2], outline[3]].map(Point2::from);
            for (end, share) in by_edges.paddles[0].segment.iter().zip([from, to]) {
                assert!((end - (a + (b - a) * share)).norm() <= 1e-15 * (a.norm() + b.norm()));
            }
        }
    }
}

/// The bundled scene by edges gives the results of the bundled scene.
#[test]
fn the_paper_by_edges_is_the_paper() {
    let (_, paper) = BUNDLED[0];
    let edges = paper
        .replace("[[[1.0, 0.0], [1.0, 1.0]]]", "[{ edge = 1 }]")
        .replace("[[0.0, 0.5], [0.0, 0.6]]", "[[0.0003, 0.5002], [0.0004, 0.6]]");
    assert!(edges.contains("edge = 1") && edges.contains("0.5002"));
    assert_eq!(Scene::parse(&edges, "edges").unwrap().immobile, Scene::bundled("paper").unwrap().immobile);
    // 0.0002 from the corner, 0.0004 off the edge: where they are meant to be.
    assert_eq!(Scene::parse(&edges, "edges").unwrap().paddles[4].segment, [[0.0, 0.5], [0.0, 0.6]].map(Point2::from));
}

/// Nothing of a bundled scene is put anywhere else: recordings and tables know it by its hash.
#[test]
fn bundled_scenes_have_the_points_of_their_files() {
    for (name, text) in BUNDLED {
        let scene = Scene::bundled(name).unwrap();
        let file: toml::Table = text.parse().unwrap();
        let path = |value: &toml::Value| -> Vec<Point2> {
            let points: Vec<[f64; 2]> = value.clone().try_into().unwrap();
            points.into_iter().map(Point2::from).collect()
        };
        let immobile: Vec<_> = file["immobile"]["paths"].as_array().unwrap().iter().map(path).collect();
        assert_eq!(scene.immobile, immobile, "{name}");
        assert_eq!(scene.needle.contact, path(&file["needle"]["contact"]), "{name}");
        for (paddle, section) in scene.paddles.iter().zip(file["paddle"].as_array().unwrap()) {
            assert_eq!(paddle.segment.to_vec(), path(&section["segment"]), "{name}");
        }
    }
}

/// A point this far off an edge, outside or inside, at this part of it.
fn beside(outline: &[[f64; 2]], edge: usize, part: f64, off: f64) -> [f64; 2] {
    let [a, b] = [outline[edge], outline[(edge + 1) % outline.len()]];
    let way = [b[0] - a[0], b[1] - a[1]];
    let length = way[0].hypot(way[1]);
    [a[0] + part * way[0] + off * way[1] / length, a[1] + part * way[1] - off * way[0] / length]
}

#[test]
fn points_near_the_boundary_are_put_onto_it_and_others_refused_with_the_way_there() {
    for body in bodies() {
        let (unit, outline, _) = &body;
        let size = extent(outline);
        let contact = "{ edge = 3, from = 0.3, to = 0.6 }";
        let paddle = |off: f64, from: f64, to: f64| {
            let ends = [from, to].map(|part| beside(outline, 2, part, off));
            Scene::parse(&in_body(&body, contact, &format!("{ends:?}")), "beside.toml")
        };
        for off in [-9.9e-4, -1e-6, -2e-9, 2e-9, 3e-7, 9.9e-4] {
            for (from, to) in [(0.2, 0.4), (0.137, 0.619), (1.0 / 3.0, 0.77)] {
                let scene = paddle(off * size, from, to).unwrap_or_else(|error| panic!("{unit} {off}: {error}"));
                // Who has given something else is told, but for a file's rounding.
                let moved: Vec<&str> = scene.snapped.iter().map(|snapped| snapped.what.as_str()).collect();
                assert_eq!(moved, if off.abs() > 5e-7 { vec!["paddle 7"] } else { vec![] }, "{unit} {off}");
                let told = scene.snapped.iter().all(|snapped| (snapped.by - off.abs() * size).abs() < 2e-10 * size);
                assert!(told, "{unit} {off}: {:?}", scene.snapped);
                for (end, part) in scene.paddles[0].segment.iter().zip([from, to]) {
                    assert!(scene.outline.distance_to_boundary(*end) <= 1e-10 * size, "{unit} {off}");
                    let there = Point2::from(beside(outline, 2, part, 0.0));
                    assert!((end - there).norm() <= 1e-9 * size, "{unit} {off}: {end} {there}");
                }
            }
        }
        for off in [-1.1e-3, 1.1e-3, 0.02] {
            let error = paddle(off * size, 0.2, 0.4).unwrap_err();
            let message = &error.message;
            assert!(
                message.contains("paddle 7 is off the boundary") && message.contains("on edge 2 at 0."),
                "{message}"
            );
            assert!(error.help.contains("{ edge = 2, from = 0.2"), "{}", error.help);
        }
    }
}

#[test]
fn what_is_refused_says_how_far_off_it_is_and_where_it_would_be() {
    // The tolerance is 0.1166 mm here.
    for (edits, message, help) in [
        (
            [(LAST_PADDLE, "segment = [[100.25, 20.0], [100.0, 40.0]]")],
            "paddle 7 is off the boundary: (100.25, 20) is 0.25 mm off the outline; the nearest point on it is (100, 20), \
             on edge 1 at 0.3333 of its length",
            "less than 0.1166 mm off",
        ),
        (
            [("[[[0.0, 0.0], [100.0, 0.0]]]", "[[[0.0, 0.0], [50.0, -3.0]]]")],
            "this immobile path leaves the boundary of the outline: (50, -3) is 3 mm off the outline; the nearest point on \
             it is (50, 0), on edge 0 at 0.5 of its length",
            "{ edge = 0, from = 0.2, to = 0.4 }",
        ),
        (
            [(LAST_PADDLE, "segment = [[100.0, 40.0], [80.0, 60.0]]")],
            "paddle 7 is off the boundary: between its points, (90, 50) is 10 mm off the outline",
            "list the outline's vertices along it",
        ),
        (
            [(CONTACT, "[[40.0, 61.0], [60.0, 60.0]]")],
            "the needle contact reaches outside the outline: (40, 61) is 1 mm off the outline; the nearest point on it is (40, 60)",
            "put it on the boundary or inside",
        ),
        (
            [(TARGET, "position = [104.0, 63.0]")],
            "the target is outside the outline: (104, 63) is 5 mm off the outline; the nearest point on it is (100, 60)",
            "move the target into the body",
        ),
        (
            [(LAST_PADDLE, "segment = [[100.05, 20.0], [99.95, 20.0]]")],
            "paddle 7: (100.05, 20) and (99.95, 20) are one and the same point of the outline, (100, 20)",
            "less than 0.1166 mm off",
        ),
        ([(LAST_PADDLE, "segment = { edge = 4 }")], "paddle 7: the outline has no edge 4", "its edges are 0 to 3"),
        (
            [(LAST_PADDLE, "segment = { edge = 1, from = 0.5, to = 0.5 }")],
            "from = 0.5, to = 0.5 is no part",
            "0 ≤ from < to ≤ 1",
        ),
        ([(LAST_PADDLE, "segment = { edge = 1, to = 1.5 }")], "from = 0, to = 1.5 is no part", "0 ≤ from < to ≤ 1"),
        ([(LAST_PADDLE, "segment = { edge = 1, from = nan }")], "from = NaN", "0 ≤ from < to ≤ 1"),
        (
            [(LAST_PADDLE, "segment = { edge = 0, from = 0.5 }")],
            "paddle 7 is on the immobile part",
            "boundary that can move",
        ),
    ] {
        let error = read(&edits).unwrap_err();
        assert!(error.message.contains(message), "{message}\n{}", error.message);
        assert!(error.help.contains(help), "{help}\n{}", error.help);
        // It points at what is wrong.
        let value = edits[0].1.split_once(" = ").map_or(edits[0].1, |(_, value)| value).trim_matches(['[', ']']);
        let line = text(&edits).lines().nth(error.line - 1).unwrap().to_owned();
        assert!(line.contains(value), "{line}: {value}");
    }
}

/// What was valid before points were put onto the boundary keeps its digits.
#[test]
fn valid_points_keep_their_digits() {
    // Within what touches: 1e-9 of the size; and a contact that is inside by less than what is put onto the boundary.
    for (from, to) in [
        (LAST_PADDLE, "segment = [[100.00000005, 20.0], [99.99999995, 40.0]]"),
        (CONTACT, "[[40.0, 59.95], [60.0, 59.99]]"),
        (CONTACT, "[[40.0, 60.00000001], [60.0, 59.95]]"),
    ] {
        let scene = read(&[(from, to)]).unwrap();
        let points = by_points(&scene, &text(&[]));
        assert!(points.contains(to.trim_start_matches("segment = ")), "{to}: {points}");
    }
    // A film of tissue beside the boundary is nothing but a rounding.
    let film = read(&[(CONTACT, "[[40.0, 59.9995], [60.0, 59.99999]]")]).unwrap();
    assert_eq!(film.needle.contact, [[40.0, 60.0], [60.0, 60.0]].map(Point2::from));
    let outside = read(&[(CONTACT, "[[40.0, 60.05], [60.0, 59.95]]")]).unwrap();
    assert_eq!(outside.needle.contact, [[40.0, 60.0], [60.0, 60.0]].map(Point2::from));
    let shaft = |entry: &str| {
        let shaft = format!("{SHAFT}kinetic_friction = 0.2\nentry = {entry}\n");
        read(&[(DEPTH, &shaft)]).map(|scene| scene.needle.shaft.unwrap().entry)
    };
    assert_eq!(shaft("[45.3, 60.05]").unwrap(), Point2::from([45.3, 60.0]));
    assert_eq!(shaft("[45.0, 59.95]").unwrap(), Point2::from([45.0, 59.95]));
    let error = shaft("[45.0, 62.0]").unwrap_err().message;
    assert!(error.contains("(45, 62) is 2 mm off the outline; the nearest point on it is (45, 60)"), "{error}");
}

#[test]
fn the_schema_knows_points_and_edges() {
    let said = model_offline().arg("schema").assert().success();
    let schema: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).unwrap();
    let definitions = schema["$defs"].as_object().unwrap();
    let named = |reference: &serde_json::Value| {
        let name = reference["$ref"].as_str().unwrap().rsplit('/').next().unwrap();
        &definitions[name]
    };
    let choices = |value: &serde_json::Value| {
        let any = named(value)["anyOf"].as_array().unwrap().clone();
        assert_eq!(any.len(), 2);
        let edge = named(&any[1]);
        assert_eq!((&edge["required"], &edge["additionalProperties"]), (&serde_json::json!(["edge"]), &false.into()));
        any[0].clone()
    };
    let path = choices(&definitions["ImmobileSection"]["properties"]["paths"]["items"]);
    assert_eq!((path["type"].as_str(), path["maxItems"].as_u64()), (Some("array"), None));
    assert_eq!(choices(&definitions["NeedleSection"]["properties"]["contact"]), path);
    let segment = choices(&definitions["PaddleSection"]["properties"]["segment"]);
    assert_eq!((segment["minItems"].as_u64(), segment["maxItems"].as_u64()), (Some(2), Some(2)));
}

/// Texts of a picture with their boxes: from left, top, right, bottom; widths are estimates from above.
fn texts(svg: &str) -> Vec<(String, [f64; 4])> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts
        .map(|node| {
            let number = |name: &str| node.attribute(name).unwrap().parse::<f64>().unwrap();
            let shift =
                node.ancestors().filter_map(|above| above.attribute("transform")).fold([0.0; 2], |sum, shift| {
                    let inner = shift.trim_start_matches("translate(").trim_end_matches(')');
                    let (x, y) = inner.split_once(',').unwrap();
                    [sum[0] + x.parse::<f64>().unwrap(), sum[1] + y.parse::<f64>().unwrap()]
                });
            let text = node.text().unwrap().to_owned();
            let size = if node.attribute("class") == Some("heading") { 16.0 } else { 12.0 };
            let width = 0.6 * size * text.chars().count() as f64;
            let left = number("x") + shift[0]
                - width
                    * match node.attribute("text-anchor").unwrap() {
                        "start" => 0.0,
                        "middle" => 0.5,
                        _ => 1.0,
                    };
            let base = number("y") + shift[1];
            (text, [left, base - 0.8 * size, left + width, base + 0.1 * size])
        })
        .collect()
}

#[test]
fn pictures_name_everything_once_and_no_name_covers_another_or_is_cut_off() {
    let mut scenes: Vec<Scene> = BUNDLED.iter().map(|(name, _)| Scene::bundled(name).unwrap()).collect();
    for body in bodies() {
        let part = |edge: usize| format!("{{ edge = {edge}, from = 0.3, to = 0.5 }}");
        scenes.push(Scene::parse(&in_body(&body, &part(3), &part(2)), "body").unwrap());
    }
    // Thin, and with an inclusion that is mostly elsewhere.
    scenes.push(
        read(&[
            ("[100.0, 60.0], [0.0, 60.0]]", "[100.0, 60.0], [0.0, 60.0]]"),
            (INCLUSION, "[[60.0, 10.0], [9e4, 10.0], [9e4, 3e4], [60.0, 30.0]]"),
        ])
        .unwrap(),
    );
    for scene in &scenes {
        let svg = scene_picture::svg(scene);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let size =
            ["width", "height"].map(|name| document.root_element().attribute(name).unwrap().parse::<f64>().unwrap());
        let all = texts(&svg);
        for (i, (text, [left, top, right, bottom])) in all.iter().enumerate() {
            assert!(
                *left >= 0.0 && *top >= 0.0 && *right <= size[0] && *bottom <= size[1],
                "{}: {text} is cut off",
                scene.name
            );
            for (other, [l, t, r, b]) in &all[..i] {
                let apart = left >= r || l >= right || top >= b || t >= bottom;
                assert!(apart, "{}: {text} over {other}", scene.name);
            }
        }
        let count = |wanted: &str| all.iter().filter(|(text, _)| text == wanted).count();
        assert_eq!(count("target"), 2, "{}: beside it and in the legend", scene.name);
        for paddle in &scene.paddles {
            assert!(count(&paddle.index.to_string()) >= 1, "{}: paddle {}", scene.name, paddle.index);
        }
        for (number, inclusion) in scene.inclusions.iter().enumerate() {
            let name = format!("inclusion {}: × {}", number + 1, inclusion.stiffness);
            assert_eq!(count(&name), 1, "{}: {name}", scene.name);
        }
        for entry in ["body", "immobile", "paddle", "needle contact", "needle", "needle's line from there"] {
            assert_eq!(count(entry), 1, "{}: {entry}", scene.name);
        }
        let unit = if scene.length_unit == "1" { String::new() } else { format!("{}]", scene.length_unit) };
        assert!(
            ["x", "y"].iter().all(|axis| all.iter().any(|(text, _)| text.starts_with(axis) && text.ends_with(&unit)))
        );
        let of_class =
            |class: &str| document.descendants().filter(|node| node.attribute("class") == Some(class)).count();
        // The legend has one more of each.
        assert_eq!(of_class("paddle"), scene.paddles.len() + 1, "{}", scene.name);
        assert_eq!(of_class("rim"), scene.inclusions.len(), "{}", scene.name);
        assert_eq!((of_class("immobile"), of_class("contact")), (scene.immobile.len() + 1, 2), "{}", scene.name);
        assert!(of_class("hatch") > 3 && of_class("arrow") >= 2 && !svg.contains("NaN"), "{}", scene.name);
        assert_eq!(svg, scene_picture::svg(scene), "the same scene, the same picture");
    }
}

fn written(folder: &Path, name: &str, text: &str) -> std::path::PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn said(command: &mut Command, code: i32) -> (String, String) {
    let output = command.env("NO_COLOR", "1").output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(code), "{err}");
    // Lines of messages are broken where they are long.
    (out, err.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" "))
}

/// A factor on the energy says nothing of an inclusion that has its own material, unless it has a factor, too.
#[test]
fn a_factor_of_one_is_not_told_of_a_material_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let own = "material = { model = \"neo-hookean\", lambda = 40.0, mu = 7.0 }";
    for (keys, told) in [
        (own.to_owned(), "own material, shear modulus 7 kPa at rest; area 400 mm²"),
        (format!("{own}\nstiffness = 2.0"), "own material, shear modulus 7 kPa at rest, stiffness times 2; area"),
    ] {
        let scene = written(folder.path(), "own.toml", &text(&[("stiffness = 10.0", &keys)]));
        let (out, _) = said(model_offline().arg("check").arg(&scene), 0);
        assert!(out.contains(told), "{told}:\n{out}");
    }
}

#[test]
fn check_tells_numbers_and_warnings_as_text_and_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let scene = written(folder.path(), "deep.toml", &text(&[(DEPTH, "depth = 31.0")]));
    let json = folder.path().join("check.json");
    let (out, _) = said(model_offline().arg("check").arg(&scene).arg("--json").arg(&json), 0);
    for part in [
        "block · inclusion tissue · a valid scene",
        "100 by 60 mm, from (0, 0); area 6000 mm²; 4 corners",
        "shear modulus 1 kPa at rest",
        "100 mm of 320 mm of boundary (31 %)",
        "enters at (50, 60) in direction (0.0000, -1.0000); depth 31 mm, contact 20 mm long",
        "(50, 30), 30 mm from the entry: 30 mm along the needle's line, 0 mm off it; 30 mm from the boundary",
        "stiffness times 10; area 400 mm² around (70, 20), 20 mm wide",
        "paddle 7     20 mm long; 44.72 mm from the needle contact, 20 mm from the immobile part",
        "5 mm apart; scni-stabilised",
        "warning: the needle goes deeper than the target: depth 31 mm",
    ] {
        assert!(out.contains(part), "{part}:\n{out}");
    }
    let document: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    for (place, expected) in [
        ("/scene", serde_json::json!("block")),
        ("/units/length", serde_json::json!("mm")),
        ("/body/area", serde_json::json!(6000.0)),
        ("/body/immobile_length", serde_json::json!(100.0)),
        ("/material/shear_modulus", serde_json::json!(1.0)),
        ("/needle/mechanics", serde_json::json!("patch")),
        ("/needle/entry", serde_json::json!([50.0, 60.0])),
        ("/target/along_needle", serde_json::json!(30.0)),
        ("/inclusions/0/centroid", serde_json::json!([70.0, 20.0])),
        ("/inclusions/0/inside", serde_json::json!(1.0)),
        ("/paddles/1/index", serde_json::json!(7)),
        ("/paddles/0/from_immobile", serde_json::json!(20.0)),
        ("/spacing", serde_json::json!(5.0)),
        ("/integration", serde_json::json!("scni-stabilised")),
        ("/effects", serde_json::json!([])),
    ] {
        assert_eq!(document.pointer(place), Some(&expected), "{place}");
    }
    let warnings = document["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1);
    assert!(out.contains(&format!("warning: {}\n", warnings[0].as_str().unwrap())));
    // The nodes that it counts are those of the model.
    let placed = folder.path().join("place.json");
    let (out, _) = said(model_offline().arg("place").arg(&scene).arg("--json").arg(&placed), 0);
    let placed: serde_json::Value = serde_json::from_slice(&std::fs::read(&placed).unwrap()).unwrap();
    assert_eq!((&placed["nodes"], &placed["warnings"]), (&document["nodes"], &document["warnings"]));
    assert!(out.contains("warning: the needle goes deeper than the target"), "{out}");
    let (out, _) = said(model_offline().args(["check", "paper", "--tolerance", "0.01", "--without-inclusion"]), 0);
    assert!(
        out.contains("homogeneous tissue") && out.contains("no warnings") && out.contains("as many as its tolerance"),
        "{out}"
    );
}

#[test]
fn a_scene_that_is_refused_leaves_no_file_and_one_that_is_nearly_known_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let bad = written(folder.path(), "bad.toml", &text(&[(LAST_PADDLE, "segment = { edge = 9 }")]));
    let (json, svg) = (folder.path().join("a.json"), folder.path().join("a.svg"));
    let calls = |scene: &Path| {
        let [mut check, mut draw] = [model_offline(), model_offline()];
        check.arg("check").arg(scene).arg("--json").arg(&json);
        draw.arg("draw").arg(scene).arg("-o").arg(&svg);
        [check, draw].map(|mut call| said(&mut call, 2).1)
    };
    for err in calls(&bad) {
        assert!(err.contains("the outline has no edge 9"), "{err}");
    }
    for (word, meant) in [
        ("brest", "breast"),
        ("paperhull", "paper-hull"),
        ("Prostate", "prostate"),
        ("elsewhere/tethered.toml", "tethered"),
    ] {
        for err in calls(Path::new(word)) {
            assert!(err.contains(&format!("did you mean `{meant}`?")), "{word}: {err}");
        }
    }
    // A folder is what was meant, and nothing else is near.
    for err in calls(folder.path()) {
        assert!(!err.contains("did you mean"), "{err}");
    }
    written(folder.path(), "liver-3.toml", "");
    for err in calls(&folder.path().join("livr-3.toml")) {
        assert!(err.contains("did you mean") && err.contains("liver-3.toml`?"), "{err}");
    }
    for err in calls(Path::new("mine.toml")) {
        assert!(err.contains("one of the bundled scenes: paper") && !err.contains("did you mean"), "{err}");
    }
    assert!(!json.exists() && !svg.exists());
}

#[test]
fn edges_are_numbered_as_the_file_counts_them() {
    const OUTLINE: &str = "[[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [0.0, 60.0]]";
    for (outline, sides) in [
        (OUTLINE, ["bottom", "right", "top", "left"]),
        ("[[0.0, 0.0], [0.0, 60.0], [100.0, 60.0], [100.0, 0.0]]", ["left", "top", "right", "bottom"]),
        ("[[100.0, 60.0], [100.0, 0.0], [0.0, 0.0], [0.0, 60.0]]", ["right", "bottom", "left", "top"]),
    ] {
        let svg = scene_picture::svg(&read(&[(OUTLINE, outline)]).unwrap());
        let middle = |[left, top, right, bottom]: [f64; 4]| [0.5 * (left + right), 0.5 * (top + bottom)];
        let numbers: Vec<(String, [f64; 2])> = texts(&svg)
            .into_iter()
            .filter(|(text, _)| text.len() == 2 && text.starts_with('e'))
            .map(|(text, place)| (text, middle(place)))
            .collect();
        let outermost = |axis: usize, sign: f64| {
            let first = numbers.iter().max_by(|a, b| (sign * a.1[axis]).total_cmp(&(sign * b.1[axis])));
            first.map(|(text, _)| text.clone())
        };
        for (k, side) in sides.into_iter().enumerate() {
            let found = match side {
                "left" => outermost(0, -1.0),
                "right" => outermost(0, 1.0),
                "top" => outermost(1, -1.0),
                _ => outermost(1, 1.0),
            };
            assert_eq!(found, Some(format!("e{k}")), "{outline}, {side}: {numbers:?}");
        }
    }
}

#[test]
fn draw_writes_a_whole_picture_or_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scene = written(folder.path(), "scene.toml", BLOCK);
    let svg = folder.path().join("a.svg");
    let (out, err) = said(model_offline().arg("draw").arg(&scene).arg("-o").arg(&svg), 0);
    assert_eq!((out.as_str(), err.as_str()), ("", ""));
    let whole = std::fs::read_to_string(&svg).unwrap();
    assert_eq!(whole, scene_picture::svg(&Scene::parse(BLOCK, "block").unwrap()));
    // Other endings, the scene itself, a folder that is not there, a folder: refused, and what is there stays as it is.
    for (output, reason) in [
        (folder.path().join("a.gif"), "pictures are written as .svg, .png or .pdf"),
        (folder.path().join("a.svg.gz"), "pictures are written as .svg, .png or .pdf"),
        (folder.path().join("absent/a.svg"), "nothing can be written in its directory"),
        (folder.path().to_owned(), "a directory is in its place"),
    ] {
        let (_, err) = said(model_offline().arg("draw").arg(&scene).arg("-o").arg(&output), 2);
        assert!(err.contains(reason), "{reason}: {err}");
    }
    let own = written(folder.path(), "own.svg", BLOCK);
    let (_, err) = said(model_offline().arg("draw").arg(&own).arg("-o").arg(&own), 2);
    assert!(err.contains("this is an input of the same command"), "{err}");
    assert_eq!(std::fs::read_to_string(&own).unwrap(), BLOCK);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
    // What is unusual is said here, too.
    let deep = written(folder.path(), "deep.toml", &text(&[(DEPTH, "depth = 31.0")]));
    let (_, err) = said(model_offline().arg("draw").arg(&deep).arg("-o").arg(&svg), 0);
    assert!(err.contains("warning: the needle goes deeper than the target"), "{err}");
}
