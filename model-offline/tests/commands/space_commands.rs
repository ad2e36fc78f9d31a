//! `check`, `solve` and `new` of scenes in space.

use assert_cmd::Command;
use model_offline::discretization::Resolution;
use model_offline::placement::space::workflow::insertion_model;
use model_offline::scene::space::AnyScene;
use roxmltree::Document;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::Path;

fn run(arguments: &[&str], folder: &Path) -> (i32, String, String) {
    let mut command = Command::cargo_bin("model-offline").unwrap();
    let output = command.args(arguments).current_dir(folder).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn read(file: &str, folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join(file)).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn near(found: &Value, expected: f64) -> bool {
    (number(found) - expected).abs() < 1e-9
}

#[test]
fn a_check_has_the_numbers_of_the_scene_and_of_its_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let (code, told, said) = run(&["check", "block", "--json", "check.json"], folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    let check = read("check.json", folder.path());
    assert!(near(&check["volume"], 1.0) && near(&check["surface"], 6.0) && near(&check["immobile"]["area"], 1.0));
    assert!(near(&check["needle"]["contact"]["area"], 0.04) && near(&check["inclusions"][0]["volume"], 0.002));
    for paddle in check["paddles"].as_array().unwrap() {
        assert!(near(&paddle["patch"]["area"], 0.04), "{paddle}");
    }
    assert!(near(&check["target"]["along_needle"], 0.5) && near(&check["target"]["off_needle"], 0.0));
    let mesh = &check["mesh"];
    let worst = mesh["worst"].as_array().unwrap();
    assert!(number(&mesh["dihedral"][0]) > 8.0 && number(&mesh["dihedral"][1]) < 172.0);
    assert_eq!((worst.len(), &worst[0]["dihedral"]), (5, &mesh["dihedral"][0]));
    assert!(worst.iter().all(|element| (0..3).all(|k| (0.0..=1.0).contains(&number(&element["at"][k])))));
    assert_eq!(check["warnings"], json!([]));
    for part in ["dihedral angles", "paddle 8", "volume 1", "no warnings", "refined from here to 5 %"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    // Less than everything, and another mesh.
    let options = ["check", "block", "--spacing", "0.2", "--without-inclusion", "--json", "even.json"];
    assert_eq!(run(&options, folder.path()).0, 0);
    let even = read("even.json", folder.path());
    assert!(even["inclusions"] == json!([]) && number(&even["mesh"]["nodes"]) < number(&mesh["nodes"]));
}

#[test]
fn balls_in_coarse_meshes_have_their_volume_roughly() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(run(&["new", "--dimension", "3", "-o", "new.toml"], folder.path()).0, 0);
    let new = std::fs::read_to_string(folder.path().join("new.toml")).unwrap();
    let mound = include_str!("../../scenes/mound.toml");
    let cases: [(&str, &str, &[f64]); 4] =
        [(&new, "-1", &[8.0]), (&new, "0", &[8.0]), (mound, "0", &[6.0, 4.0]), (mound, "1", &[6.0, 4.0])];
    for (text, level, radii) in cases {
        let text = text.replacen("tolerance = 0.05", &format!("level = {level}"), 1);
        std::fs::write(folder.path().join("a.toml"), text).unwrap();
        let (code, _, said) = run(&["check", "a.toml", "--json", "a.json"], folder.path());
        assert_eq!((code, said.as_str()), (0, ""));
        let check = read("a.json", folder.path());
        for (inclusion, radius) in check["inclusions"].as_array().unwrap().iter().zip(radii) {
            let share = number(&inclusion["volume"]) / (4.0 / 3.0 * PI * radius.powi(3));
            assert!((0.5..1.02).contains(&share), "{level}: {share}");
        }
    }
}

#[test]
fn a_check_says_what_is_seldom_meant() {
    for (from, to, expected) in [
        ("axis = [0.0, 0.0, -1.0]", "axis = [0.0, 0.0, 1.0]", "points out of the body"),
        ("axis = [0.0, 0.0, -1.0]", "axis = [1.0, 0.0, 0.0]", "along the surface"),
        ("axis = [0.0, 0.0, -1.0]", "axis = [1.0, 0.0, -0.25]", "does not go towards the target"),
        ("depth = 0.05", "depth = 0.6", "deeper than the target"),
        ("depth = 0.05", "depth = 1.2", "leaves the body at depth 1"),
        (
            "min = [0.0, 0.6, 0.2], max = [0.0, 0.8, 0.4]",
            "min = [0.0, 0.3, 0.2], max = [0.0, 0.5, 0.4]",
            "1 and 2 overlap",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let text = include_str!("../../scenes/block.toml");
        assert!(text.contains(from));
        std::fs::write(folder.path().join("a.toml"), text.replacen(from, to, 1)).unwrap();
        let (code, told, said) = run(&["check", "a.toml", "--without-inclusion", "--json", "a.json"], folder.path());
        assert!(code == 0 && told.contains("warning: ") && told.contains(expected), "{to}: {code} {told} {said}");
        let warnings = read("a.json", folder.path())["warnings"].to_string();
        assert!(warnings.contains(expected), "{warnings}");
    }
    // Line and column of what comes behind a text that is there once.
    let behind = |text: &str, lead: &str| {
        let at = text.find(lead).unwrap() + lead.len();
        assert_eq!(text.matches(lead).count(), 1, "{lead}");
        let line = text[..at].lines().last().unwrap();
        format!("a.toml:{}:{}: ", text[..at].lines().count(), line.len() + 1)
    };
    // What cannot be is refused, as by `place`: where the scene's file has it.
    for (from, to, expected) in [
        (
            "min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]",
            "min = [1.0, 0.2, 0.2], max = [1.0, 0.4, 0.4]",
            "touches the immobile",
        ),
        (
            "min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]",
            "min = [0.5, 0.4, 1.0], max = [0.8, 0.6, 1.0]",
            "touches the needle",
        ),
        (
            "regions = [{ box = { min = [1.0, 0.0, 0.0]",
            "regions = [{ box = { min = [0.0, 0.0, 0.0]",
            "touches the immobile",
        ),
        (
            "min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]",
            "min = [-0.3, 0.2, 0.2], max = [-0.2, 0.4, 0.4]",
            "about 0.2 from it",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let text = include_str!("../../scenes/block.toml");
        assert!(text.contains(from));
        let text = text.replacen(from, to, 1);
        std::fs::write(folder.path().join("a.toml"), &text).unwrap();
        let (code, _, said) = run(&["check", "a.toml", "--json", "a.json"], folder.path());
        let told = said.replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
        let at = behind(&text, "index = 1\nregion = ");
        assert!(told.contains(&format!("{at}the ")) && told.contains("paddle 1"), "{at} {told}");
        assert!(code == 2 && told.contains(expected) && !folder.path().join("a.json").exists(), "{to}: {said}");
        assert_eq!(run(&["place", "a.toml", "--spacing", "0.2", "--quiet"], folder.path()), (2, String::new(), said));
    }
    // Of several regions the one that is at fault.
    let folder = tempfile::tempdir().unwrap();
    let (held, off) = ("max = [1.0, 1.0, 1.0] } }", "{ box = { min = [1.2, 0.0, 0.0], max = [1.3, 1.0, 1.0] } }");
    let text = include_str!("../../scenes/block.toml").replacen(&format!("{held}]"), &format!("{held}, {off}]"), 1);
    std::fs::write(folder.path().join("a.toml"), &text).unwrap();
    let (code, _, said) = run(&["check", "a.toml"], folder.path());
    assert!(code == 2 && said.contains(&behind(&text, &format!("{held}, "))), "{said}");
    let folder = tempfile::tempdir().unwrap();
    let apart = "solid = { union = [{ box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }, \
                 { box = { min = [2.0, 0.0, 0.0], max = [3.0, 1.0, 1.0] } }] }";
    let text = include_str!("../../scenes/block.toml");
    let text = text.replacen("box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }", apart, 1);
    std::fs::write(folder.path().join("a.toml"), text).unwrap();
    let (code, _, said) = run(&["check", "a.toml", "--json", "a.json"], folder.path());
    let told = said.replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(code == 2 && told.contains("hangs on nothing") && !folder.path().join("a.json").exists(), "{said}");
    assert!(said.contains(&behind(include_str!("../../scenes/block.toml"), "regions = [")), "{said}");
}

/// What a scene of inclusions, supports and parts says of itself; `place` says it too.
#[test]
fn parts_supports_and_inclusions_that_are_hardly_meant_are_said() {
    const BODY: &str = "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }";
    const PART: &str = "box = { min = [0.6, 0.4, 0.3], max = [0.7, 0.6, 0.4] }";
    const HELD: &str = "regions = [{ box = { min = [1.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }]";
    let two = "solid = { union = [{ box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }, \
               { box = { min = [-2.0, 0.0, 0.0], max = [-1.0, 1.0, 1.0] } }] }";
    let both = "regions = [{ box = { min = [1.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }, \
                { box = { min = [-2.0, 0.0, 0.0], max = [-1.0, 1.0, 0.0] } }]";
    let beside = "min = [-1.0, 0.2, 0.2], max = [-1.0, 0.4, 0.4]";
    let cases: [(&[(&str, &str)], &str); 5] = [
        (&[(PART, "box = { min = [-1.0, -1.0, -1.0], max = [2.0, 2.0, 2.0] }")], "inclusion 1 is all of the body"),
        (
            &[(PART, "box = { min = [0.6, 0.4, -0.1], max = [0.7, 0.6, 0.1] }")],
            "inclusion 1 is partly outside the body: 50 % of its volume",
        ),
        (
            &[(HELD, "regions = [{ box = { min = [1.0, 0.5, 0.5], max = [1.0, 0.53, 0.53] } }]")],
            "hardly anything holds the body: 0.0009 of its surface of 6",
        ),
        (
            &[(BODY, two), (HELD, both), ("min = [0.0, 0.2, 0.2], max = [0.0, 0.4, 0.4]", beside)],
            "in 2 parts that no face joins (paddle 1 is on another than the target)",
        ),
        // A layer that reaches beyond the body is meant so, and this body is whole.
        (&[(PART, "box = { min = [-1.0, -1.0, 0.9], max = [2.0, 2.0, 1.1] }")], "no warnings"),
    ];
    for (changes, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let text = include_str!("../../scenes/block.toml").replace("of = \"all\"", "of = []");
        assert!(changes.iter().all(|(from, _)| text.contains(from)));
        let text = changes.iter().fold(text, |text, (from, to)| text.replacen(from, to, 1));
        std::fs::write(folder.path().join("a.toml"), text).unwrap();
        let (code, told, said) = run(&["check", "a.toml"], folder.path());
        assert!(code == 0 && told.contains(expected), "{expected}: {code} {told} {said}");
        let options = ["place", "a.toml", "--integration", "fem-t4", "--spacing", "0.25", "--json", "a.json"];
        let (code, told, said) = run(&options, folder.path());
        let warnings = read("a.json", folder.path())["warnings"].to_string();
        let is_whole = expected == "no warnings";
        assert!(code == 0 && (is_whole || told.contains(expected)), "{expected}: {code} {told} {said}");
        assert!(if is_whole { warnings == "[]" } else { warnings.contains(expected) }, "{warnings}");
    }
}

/// Of a ball elements with straight edges have less than all, and the check says how much.
#[test]
fn a_check_says_how_much_of_an_inclusion_is_in_elements() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../scenes/mound.toml").replacen("tolerance = 0.05", "level = 0", 1);
    std::fs::write(folder.path().join("a.toml"), text).unwrap();
    let (code, told, said) = run(&["check", "a.toml", "--json", "a.json"], folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    let check = read("a.json", folder.path());
    for (inclusion, radius) in check["inclusions"].as_array().unwrap().iter().zip([6.0_f64, 4.0]) {
        let whole = 4.0 / 3.0 * PI * radius.powi(3);
        assert!((number(&inclusion["sampled_volume"]) / whole - 1.0).abs() < 0.02, "{inclusion}");
        let share = (100.0 * number(&inclusion["volume"]) / whole).round();
        let said = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|by| format!("({} % of its own)", share + by));
        assert!(share < 90.0 && said.iter().any(|said| told.contains(said)), "{share}: {told}");
    }
}

/// A linear law's solution is the sum of what needle and paddles do, and those are what `place` finds.
#[test]
fn a_solution_is_made_of_what_place_finds() {
    let folder = tempfile::tempdir().unwrap();
    let method = ["--integration", "fem-t10", "--spacing", "0.25", "--quiet", "--without-inclusion"];
    let law = "model = \"fung\"\nlambda = 383.0\nmu = 318.5\nc = 0.779\nlambda_c = 1.5\nmu_c = 1.0";
    let text = include_str!("../../scenes/block.toml");
    assert!(text.contains(law));
    let text = text.replacen(law, "model = \"linear\"\nlambda = 383.0\nmu = 318.5", 1);
    std::fs::write(folder.path().join("a.toml"), text).unwrap();
    let call = |command: &[&str]| {
        let (code, _, said) = run(&[command, &method[..]].concat(), folder.path());
        assert_eq!((code, said.as_str()), (0, ""), "{command:?}");
    };
    call(&["place", "a.toml", "--json", "place.json"]);
    let place = read("place.json", folder.path());
    let pairs = place["pairs"].as_array().unwrap();
    let pair = pairs.iter().find(|pair| pair["paddles"] == json!([3, 6])).unwrap();
    // The second one is named first.
    call(&[
        "solve",
        "a.toml",
        "--paddle",
        "6",
        "--paddle",
        "3",
        "--depth",
        "0.02",
        "--json",
        "solve.json",
        "--paddle-displacement",
        "-0.001,0.002,0.0005",
        "--paddle-displacement",
        "0.003,0,-0.001",
    ]);
    let solve = read("solve.json", folder.path());
    let moved = [0.003, 0.0, -0.001, -0.001, 0.002, 0.0005];
    for k in 0..3 {
        let by_paddles: f64 = moved.iter().enumerate().map(|(c, u)| number(&pair["jacobian"][k][c]) * u).sum();
        let expected = by_paddles + 0.02 * number(&pair["target_per_depth"][k]);
        assert!((number(&solve["target_displacement"][k]) - expected).abs() < 1e-9, "{k}: {expected} {solve}");
        for c in 0..3 {
            let [of_3, of_6] = [&pair["jacobian"][k][c], &pair["jacobian"][k][3 + c]].map(number);
            assert!((number(&solve["jacobian"][k][3 + c]) - of_3).abs() < 1e-9);
            assert!((number(&solve["jacobian"][k][c]) - of_6).abs() < 1e-9);
        }
    }
    assert_eq!((&solve["paddles"], &solve["dimension"]), (&json!([6, 3]), &json!(3)));
    assert_eq!(solve["node_positions"].as_array().unwrap().len() as f64, number(&solve["nodes"]));
    // Twice the strain energy is the work of all that moves: without paddles, that of the needle.
    call(&["solve", "a.toml", "--depth", "0.02", "--json", "alone.json"]);
    let alone = read("alone.json", folder.path());
    let work = 0.5 * 0.02 * number(&alone["base_force"]);
    assert!((work / number(&alone["strain_energy"]) - 1.0).abs() < 1e-9 && work > 0.0, "{work}");
    assert_eq!(alone["jacobian"], Value::Null);
}

/// What a tolerance alone asks for is kept by quadratic tetrahedra, as in tables; whoever names a method or a resolution has it, and
/// what follows the needle is meshfree.
#[test]
fn placement_takes_quadratic_tetrahedra_where_a_tolerance_is_all_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../scenes/block.toml").replace("increments = 5", "increments = 1");
    let from = |index: u32| text.find(&format!("[[paddle]]\nindex = {index}\n")).unwrap();
    // Paddle 3, which is symmetric about the needle, alone.
    let alone = format!("{}{}{}", &text[..from(1)], &text[from(3)..from(4)], &text[text.find("[pairs]").unwrap()..]);
    for (file, added) in [("plain", ""), ("named", "integration = \"mscni\"\n"), ("supported", "support = 1.3\n")] {
        std::fs::write(folder.path().join(format!("{file}.toml")), format!("{alone}{added}")).unwrap();
    }
    for (file, options, expected) in [
        ("plain.toml", &[][..], "fem-t10"),
        ("plain.toml", &["--tolerance", "0.2"], "fem-t10"),
        ("plain.toml", &["--integration", "scni-stabilised"], "scni-stabilised"),
        ("plain.toml", &["--support", "1.3"], "scni-stabilised"),
        ("plain.toml", &["--spacing", "0.25"], "scni-stabilised"),
        ("named.toml", &[], "mscni"),
        ("supported.toml", &[], "scni-stabilised"),
    ] {
        let (code, told, said) = run(&[&["check", file, "--json", "c.json"], options].concat(), folder.path());
        assert_eq!((code, said.as_str()), (0, ""), "{file} {options:?}");
        assert_eq!(read("c.json", folder.path())["integration"], expected, "{file} {options:?}");
        let both = expected == "fem-t10";
        assert_eq!(told.contains("fem-t10 for placement, scni-stabilised for insertions"), both, "{told}");
    }
    let solve = ["solve", "plain.toml", "--depth", "0.01", "--tolerance", "0.5", "--json", "solve.json", "--quiet"];
    assert_eq!(run(&solve, folder.path()), (0, String::new(), String::new()));
    assert_eq!(read("solve.json", folder.path())["integration"], "scni-stabilised");
    let place = ["place", "plain.toml", "--tolerance", "0.2", "--json", "place.json"];
    let (code, told, said) = run(&place, folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    let place = read("place.json", folder.path());
    assert_eq!(place["integration"], "fem-t10");
    assert!(told.contains(&format!("{} nodes (fem-t10)", place["nodes"])), "{told}");
    // One increment: what is off at rest is so in proportion to the depth, and what is not linear comes on top.
    let by_set = place["error_estimate"]["per_depth_by_set"].as_array().unwrap();
    assert_eq!(by_set.len(), 2);
    for (of, per_depth) in [&place["paddles"][0], &place["no_paddle"]].into_iter().zip(by_set) {
        let nonlinear = number(&of["static"]["nonlinear_error"][0]);
        let expected = 0.05 * number(per_depth) + nonlinear;
        assert!(nonlinear > 0.0 && (number(&of["error"]["max_orthogonal"]) / expected - 1.0).abs() < 1e-12, "{of}");
    }
    // A table of the same scene begins with the same Jacobian.
    let AnyScene::Space(mut scene) = AnyScene::parse(&alone, "plain").unwrap() else { panic!("in space") };
    scene.discretization.resolution = Resolution::Tolerance(0.2);
    let of_tables = insertion_model(&scene).unwrap();
    let jacobian = &of_tables.rest()[0].jacobian;
    for (i, row) in place["paddles"][0]["jacobian"].as_array().unwrap().iter().enumerate() {
        for (j, found) in row.as_array().unwrap().iter().enumerate() {
            assert!((number(found) - jacobian[(i, j)]).abs() <= 1e-14 * jacobian.norm(), "{i} {j}: {found} {jacobian}");
        }
    }
}

fn array(document: &Document<'_>, name: &str) -> Vec<f64> {
    let array = document.descendants().find(|node| node.attribute("Name") == Some(name)).expect(name);
    array.text().unwrap().split_whitespace().map(|word| word.parse().unwrap()).collect()
}

#[test]
fn a_vtu_in_space_has_the_body_and_all_that_is_known_in_it() {
    let folder = tempfile::tempdir().unwrap();
    for (integration, shape, of_points) in
        [("fem-t4", 10.0, false), ("fem-t10", 24.0, false), ("scni-stabilised", 10.0, true)]
    {
        let call = [
            "solve",
            "block",
            "--depth",
            "0.01",
            "--paddle",
            "3",
            "--spacing",
            "0.25",
            "--integration",
            integration,
            "--vtu",
            "a.vtu",
            "--json",
            "a.json",
            "--quiet",
        ];
        let (code, _, said) = run(&call, folder.path());
        assert_eq!((code, said.as_str()), (0, ""));
        let text = std::fs::read_to_string(folder.path().join("a.vtu")).unwrap();
        let (document, solve) = (Document::parse(&text).unwrap(), read("a.json", folder.path()));
        let (points, moved) = (array(&document, "Points"), array(&document, "displacement"));
        let shapes = array(&document, "types");
        assert_eq!((points.len(), moved.len()), (3 * solve["nodes"].as_u64().unwrap() as usize, points.len()));
        assert!(shapes.iter().all(|s| *s == shape) && shapes.len() > 100);
        let known = if of_points { points.len() / 3 } else { shapes.len() };
        assert_eq!(array(&document, "green_lagrange_strain").len(), 9 * known);
        assert_eq!(array(&document, "cauchy_stress").len(), 9 * known);
        assert!(array(&document, "von_mises_stress").iter().all(|v| *v > 0.0));
        assert!(array(&document, "region").contains(&1.0));
        let script = std::fs::read_to_string(folder.path().join("a.py")).unwrap();
        let coloured =
            format!("ColorBy(body, (\"{}\", \"von_mises_stress\"", if of_points { "POINTS" } else { "CELLS" });
        assert!(script.contains(&coloured) && script.contains("\"a.vtu\", \"a-parts.vtu\""), "{script}");
        let parts = std::fs::read_to_string(folder.path().join("a-parts.vtu")).unwrap();
        assert!(array(&Document::parse(&parts).unwrap(), "part").contains(&2.0), "the target");
        // The needle's contact goes down by the depth.
        let deepest = moved.chunks(3).map(|u| u[2]).fold(0.0, f64::min);
        assert!((deepest + 0.01).abs() < 1e-3, "{deepest}");
        // Middle nodes stand between their corners: where the line is straight, at half of it.
        let (cells, width) = (array(&document, "connectivity"), if shape == 24.0 { 10 } else { 4 });
        let at = |node: f64| -> Vec<f64> { points[3 * node as usize..][..3].to_vec() };
        let edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
        for cell in cells.chunks(width).filter(|_| width == 10) {
            for ([a, b], middle) in edges.into_iter().zip(&cell[4..]) {
                let (a, b, m) = (at(cell[a]), at(cell[b]), at(*middle));
                let apart = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
                assert!(apart(&a, &m) + apart(&m, &b) < 1.001 * apart(&a, &b));
            }
        }
    }
}

/// Outside and three sections: in each the cube has its side, and what is attached and cut is there.
#[test]
fn a_picture_in_space_has_the_outside_and_three_sections() {
    let folder = tempfile::tempdir().unwrap();
    let call = ["solve", "block", "--integration", "fem-t4", "--spacing", "0.2", "--depth", "0.02", "--paddle", "3"];
    let call = [&call[..], &["--paddle-displacement", "0.01,0,0", "--svg", "a.svg"]].concat();
    assert_eq!(run(&call, folder.path()).0, 0);
    let text = std::fs::read_to_string(folder.path().join("a.svg")).unwrap();
    let picture = roxmltree::Document::parse(&text).unwrap();
    let all: Vec<String> =
        picture.descendants().filter_map(|node| node.text()).map(|t| t.replace('\u{a0}', " ")).collect();
    for name in ["y = 0.5, along the needle", "x = 0.5, along the needle", "z = 0.5, across the needle"] {
        assert!(all.iter().any(|text| text == name), "{name}: {all:?}");
    }
    let of = |class: &str| picture.descendants().filter(|node| node.attribute("class") == Some(class)).count();
    assert_eq!(of("outside"), 1);
    assert_eq!(of("field"), 3);
    // Paddle 3 is at the middle of x = 0: two sections cut it, from the third it is seen as a rim.
    assert_eq!((of("paddle best"), of("paddle best beside")), (2, 1));
    // The needle in the two sections along it and from outside; what is held at x = 1 in two.
    assert_eq!((of("shaft"), of("immobile")), (3, 2));
    assert!(!text.contains("NaN") && !text.contains("inf"));
}

#[test]
fn options_that_do_not_belong_to_space_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (options, expected) in [
        (vec!["solve", "block", "--depth", "0.01", "--dwell", "1"], "--dwell"),
        (vec!["solve", "block", "--depth", "0.01", "--paddle", "9"], "no paddle 9"),
        (vec!["solve", "block", "--depth", "0.01", "--paddle", "3", "--paddle", "3"], "given twice"),
        (
            vec!["solve", "block", "--depth", "0.01", "--paddle", "3", "--paddle-displacement", "0.1,0.1"],
            "three finite",
        ),
        (
            vec!["solve", "block", "--depth", "0.01", "--paddle", "3", "--paddle-displacement", "0,nan,0"],
            "three finite",
        ),
        (vec!["solve", "paper", "--depth", "0.01", "--paddle", "3", "--paddle", "4"], "names 2 paddles"),
        (vec!["solve", "paper", "--depth", "0.01", "--paddle", "3", "--paddle-displacement", "0,0,0"], "two finite"),
        (vec!["new", "--dimension", "3", "--svg", "a.svg"], "--svg"),
        (vec!["sweep", "block", "--out", "swept"], "all commands but `sweep` and `compare`"),
        (vec!["compare", "block"], "all commands but `sweep` and `compare`"),
    ] {
        let (code, _, said) = run(&options, folder.path());
        let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(code == 2 && said.contains(expected), "{options:?}: {code} {said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_new_scene_in_space_can_be_checked_and_placed() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(run(&["new", "--dimension", "3", "-o", "a.toml", "--length", "cm"], folder.path()).0, 0);
    let (code, told, said) = run(&["check", "a.toml"], folder.path());
    assert!(code == 0 && told.contains("no warnings"), "{told} {said}");
    let call = ["place", "a.toml", "--json", "a.json", "--quiet", "--integration", "fem-t4", "--spacing", "2"];
    let (code, _, said) = run(&call, folder.path());
    assert_eq!((code, said.as_str()), (0, ""));
    assert_eq!(read("a.json", folder.path())["pairs"].as_array().unwrap().len(), 6);
}
