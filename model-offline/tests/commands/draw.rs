//! Results as pictures: every field in every format, and what is refused.

use assert_cmd::Command;
use nalgebra::{Matrix3, Vector3};
use std::path::{Path, PathBuf};

fn model_offline() -> Command {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
}

/// A result of `solve` on the paper's scene.
fn solved(folder: &Path, arguments: &[&str]) -> PathBuf {
    let result = folder.join("solved.json");
    model_offline()
        .args(["solve", "paper", "--depth", "0.05", "--spacing", "0.1", "--quiet", "--json"])
        .arg(&result)
        .args(arguments)
        .assert()
        .success();
    result
}

fn refused(result: &Path, arguments: &[&str]) -> String {
    let out = result.with_file_name("refused.svg");
    let assert = model_offline().arg("draw").arg(result).arg("-o").arg(&out).args(arguments).assert().code(2);
    assert!(!out.exists());
    String::from_utf8_lossy(&assert.get_output().stderr)
        .replace(['\n', '│'], " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn every_field_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let result = solved(folder.path(), &["--paddle", "2", "--paddle-displacement", "0.0,-0.02"]);
    for field in ["size", "orthogonal", "strain", "von-mises"] {
        let out = folder.path().join(format!("{field}.svg"));
        model_offline().arg("draw").arg(&result).args(["--field", field, "-o"]).arg(&out).assert().success();
        let svg = std::fs::read_to_string(&out).unwrap();
        let document = roxmltree::Document::parse(&svg).unwrap();
        let of = |class: &str| document.descendants().filter(|node| node.attribute("class") == Some(class)).count();
        assert!((0..10).all(|band| of(&format!("f{band}")) > 0), "{field}: a colour is missing");
        assert!(svg.contains("paper, inclusion, paddle 2: depth\u{a0}0.05") && of("paddle best") == 1);
    }
    for (name, begins) in [("a.png", b"\x89PNG\r\n\x1a\n".as_slice()), ("a.pdf", b"%PDF-".as_slice())] {
        let out = folder.path().join(name);
        let drawn = model_offline().arg("draw").arg(&result).arg("-o").arg(&out).output().unwrap();
        if String::from_utf8_lossy(&drawn.stderr).contains("no font was found") {
            assert!(!out.exists() && drawn.status.code() == Some(1));
            eprintln!("skipped: no font on this machine");
            return;
        }
        assert!(drawn.status.success());
        let bytes = std::fs::read(&out).unwrap();
        assert!(bytes.starts_with(begins) && bytes.len() > 10_000, "{name}: {} bytes", bytes.len());
        // A scene becomes the same formats.
        model_offline().args(["draw", "paper", "-o"]).arg(&out).assert().success();
        assert!(std::fs::read(&out).unwrap().starts_with(begins));
    }
    // Words are in the page as text.
    let page = std::fs::read(folder.path().join("a.pdf")).unwrap();
    assert!(page.windows(5).any(|bytes| bytes == b"/Font"));
}

#[test]
fn what_is_no_result_or_not_in_it_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let result = solved(folder.path(), &[]);
    assert!(refused(&result, &["--case", "2"]).contains("has one state"));
    assert!(
        refused(&result, &["--field", "temperature"]).contains("possible values: size, orthogonal, strain, von-mises")
    );
    assert!(refused(Path::new(&folder.path().join("absent.json")), &[]).contains("cannot read"));
    let value: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&result).unwrap()).unwrap();
    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = value.clone();
        change(&mut value);
        let file = folder.path().join("changed.json");
        std::fs::write(&file, value.to_string()).unwrap();
        file
    };
    assert!(refused(&with(&|v| v["geometry"] = serde_json::Value::Null), &[]).contains("no result of"));
    assert!(refused(&with(&|v| *v = 3.into()), &[]).contains("no result of"));
    // It says that it is of a body in space, and has nothing of what one has.
    let in_space = refused(&with(&|v| *v = serde_json::json!({"dimension": 3, "cases": []})), &[]);
    assert!(in_space.contains("no result of") && in_space.contains("missing field `bodies`"), "{in_space}");
    let short = with(&|v| v["node_displacements"].as_array_mut().unwrap().truncate(5));
    assert!(refused(&short, &[]).contains("nodes has a place"));
    let short = with(&|v| v["strain"].as_array_mut().unwrap().truncate(5));
    assert!(refused(&short, &["--field", "strain"]).contains("nodes has a place"));
    let without = with(&|v| v["von_mises"] = serde_json::Value::Null);
    assert!(refused(&without, &["--field", "von-mises"]).contains("--field size or orthogonal or strain"));
    assert!(refused(&with(&|v| v["cases"] = serde_json::json!([])), &[]).contains("has no case 1"));
    assert!(refused(&with(&|v| v["geometry"]["outline"] = serde_json::json!([])), &[]).contains("outline is no area"));
    let flat = with(&|v| v["geometry"]["outline"] = serde_json::json!([[0, 0], [1, 0], [2, 0]]));
    assert!(refused(&flat, &[]).contains("outline is no area"));
    let still = with(&|v| v["geometry"]["needle_axis"] = serde_json::json!([0, 0]));
    assert!(refused(&still, &[]).contains("no unit vector"));
    let alike = with(&|v| {
        let nodes = v["geometry"]["nodes"].as_array_mut().unwrap();
        nodes.iter_mut().for_each(|node| *node = serde_json::json!([0.5, 0.5]));
    });
    assert!(refused(&alike, &[]).contains("no triangles"));
    assert!(refused(&with(&|v| v["paddle"] = 99.into()), &[]).contains("paddle is none"));
    let long = with(&|v| v["geometry"]["immobile"] = serde_json::json!([vec![[0.0, 0.0]; 20_001]]));
    assert!(refused(&long, &[]).contains("more than 20,000 points"));
    assert!(refused(&result, &["--depth", "nan"]).contains("--depth is NaN"));
    assert!(refused(&result, &["--without-inclusion"]).contains("is for scenes"));
    for name in ["noext", ".png", "a.PNG.gz"] {
        let out = folder.path().join(name);
        model_offline().arg("draw").arg(&result).arg("-o").arg(&out).assert().code(2);
        assert!(!out.exists(), "{name}");
    }
    // Nothing that a file says is drawn out of it.
    let far = with(&|v| v["node_displacements"][0] = serde_json::json!([1e308, -1e308]));
    let out = folder.path().join("far.svg");
    model_offline().arg("draw").arg(&far).arg("-o").arg(&out).assert().success();
    let svg = std::fs::read_to_string(&out).unwrap();
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    // A scene at rest has no fields.
    assert!(refused(Path::new("paper"), &["--field", "strain"]).contains("a scene at rest has none"));
}

/// Areas of the paths of a class in the order of the drawing, px².
fn areas(svg: &str, class: &str) -> Vec<f64> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let paths = document.descendants().filter(|node| node.attribute("class") == Some(class) && node.has_attribute("d"));
    let area = |path: roxmltree::Node<'_, '_>| -> f64 {
        let one = |text: &str| -> f64 {
            let points: Vec<(f64, f64)> = text
                .trim_end_matches('Z')
                .split_whitespace()
                .map(|point| point.split_once(',').unwrap())
                .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
                .collect();
            let pairs = points.iter().zip(points.iter().cycle().skip(1));
            (0.5 * pairs.map(|(a, b)| a.0 * b.1 - a.1 * b.0).sum::<f64>()).abs()
        };
        path.attribute("d").unwrap().split('M').skip(1).map(one).sum()
    };
    paths.map(area).collect()
}

fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let all = document.descendants().filter(|node| node.has_tag_name("text"));
    all.filter_map(|node| node.text()).map(|text| text.replace('\u{a0}', " ")).collect()
}

#[test]
fn a_scene_in_space_is_drawn_before_it_is_solved() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("scene.svg");
    let draw = |scene: &Path, options: &[&str]| {
        model_offline().arg("draw").arg(scene).arg("-o").arg(&out).args(options).assert().success();
        std::fs::read_to_string(&out).unwrap()
    };
    let svg = draw(Path::new("block"), &[]);
    let texts_of_block = texts(&svg);
    for expected in
        ["Scene block", "y = 0.5, along the needle", "x = 0.5, along the needle", "z = 0.5, across the needle"]
    {
        assert!(texts_of_block.iter().any(|text| text == expected), "{expected}: {texts_of_block:?}");
    }
    let paddles = texts_of_block.iter().flat_map(|text| text.split(", ")).filter_map(|text| text.parse::<u32>().ok());
    let mut paddles: Vec<u32> = paddles.filter(|index| *index > 0).collect();
    paddles.sort_unstable();
    paddles.dedup();
    assert_eq!(paddles, [1, 2, 3, 4, 5, 6, 7, 8]);
    // A cube of side 1 whose inclusion is a cube of side 0.1: the plane y = 0.5 goes through both, the two others do not.
    let (bodies, inclusions) = (areas(&svg, "body"), areas(&svg, "inclusion"));
    assert!(bodies.len() == 3 && inclusions.len() == 1, "{bodies:?} {inclusions:?}");
    assert!((inclusions[0] / bodies[0] - 0.01).abs() < 1e-4, "{inclusions:?} {bodies:?}");
    let homogeneous = draw(Path::new("block"), &["--without-inclusion"]);
    assert!(areas(&homogeneous, "inclusion").is_empty() && !texts(&homogeneous).contains(&"inclusion".to_owned()));

    // A ball of 40 mm: its three sections through the target, which is beside its centre.
    let ball = folder.path().join("ball.toml");
    std::fs::write(
        &ball,
        r#"
[scene]
name = "ball"
dimension = 3
units = { length = "mm", stress = "kPa" }
[domain]
solid = { sphere = { centre = [105.0, 0.0, -3.0], radius = 20.0 } }
[material]
model = "neo-hookean"
lambda = 30.0
mu = 6.0
[immobile]
regions = [{ box = { min = [80.0, -20.0, -24.0], max = [130.0, 20.0, -15.0] } }]
[needle]
region = { sphere = { centre = [105.0, 0.0, 17.0], radius = 4.0 } }
axis = [0.0, 0.0, -1.0]
depth = 3.0
[target]
position = [109.0, 3.0, -5.0]
[[paddle]]
index = 12
region = { sphere = { centre = [85.0, 0.0, -3.0], radius = 6.0 } }
[discretization]
tolerance = 0.1
"#,
    )
    .unwrap();
    let svg = draw(&ball, &[]);
    let bodies = areas(&svg, "body");
    let disc = |offset: f64| 20.0_f64.powi(2) - offset * offset;
    // Through the target: y = 3, x = 109, z = −5. All three sections have one width on paper but not one scale: areas over
    // squared widths are those of discs, seen with the needle in two of them.
    assert_eq!(bodies.len(), 3);
    let expected = [disc(3.0), disc(4.0), disc(2.0)];
    let [first, second] = [0, 1].map(|k| bodies[k] / expected[k]);
    assert!((first / second - 1.0).abs() < 0.03, "{bodies:?}");
    assert!(texts(&svg).iter().any(|text| text == "12") && texts(&svg).iter().any(|text| text == "needle's way, 3 mm"));

    // Its own file is not written over; --field is for results.
    model_offline().arg("draw").arg(&ball).arg("-o").arg(&ball).assert().code(2);
    let words = refused(&ball, &["--field", "strain"]);
    assert!(words.contains("a scene at rest has none"), "{words}");
}

/// A study of `place`, changed and written again.
fn studied(folder: &Path, name: &str, scene: &str, change: impl FnOnce(&mut serde_json::Value)) -> PathBuf {
    let result = folder.join(name);
    let mut place = model_offline();
    place.args(["place", scene, "--spacing", "0.2", "--quiet", "--json"]).arg(&result).assert().success();
    let mut value: serde_json::Value = serde_json::from_slice(&std::fs::read(&result).unwrap()).unwrap();
    change(&mut value);
    std::fs::write(&result, value.to_string()).unwrap();
    result
}

#[test]
fn a_placement_study_is_drawn_alone_and_beside_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let study = studied(folder.path(), "study.json", "paper", |_| ());
    let value: serde_json::Value = serde_json::from_slice(&std::fs::read(&study).unwrap()).unwrap();
    let out = folder.path().join("study.svg");
    let draw = |arguments: &[&std::ffi::OsStr]| {
        model_offline().arg("draw").arg(&study).args(arguments).arg("-o").arg(&out).assert().success();
        std::fs::read_to_string(&out).unwrap()
    };
    let alone = draw(&[]);
    let [moved, held] = ["dynamic", "static"].map(|how| value["optimum"][how].as_u64().unwrap());
    assert!(alone.contains(&format!("Moved: paddle {moved} needs the least travel")), "{:?}", texts(&alone));
    assert!(alone.contains(&format!("Held: paddle {held} moves the target least")), "{:?}", texts(&alone));
    // The bars stand in the relation of the numbers.
    let paddles = value["paddles"].as_array().unwrap();
    let heights = |svg: &str| -> Vec<f64> {
        let document = roxmltree::Document::parse(svg).unwrap();
        let bars = document.descendants().filter(|node| node.has_tag_name("rect"));
        let bars = bars.filter(|node| node.attribute("class").is_some_and(|class| class.contains("c-blue")));
        bars.filter_map(|node| node.attribute("height")?.parse().ok()).filter(|height| *height > 20.0).collect()
    };
    let found = heights(&alone);
    assert_eq!(found.len(), paddles.len());
    let measure = |paddle: &serde_json::Value| paddle["controllability_measure"].as_f64().unwrap();
    for (height, paddle) in found.iter().zip(paddles) {
        let ratio = [height / found[0], measure(paddle) / measure(&paddles[0])];
        assert!((ratio[0] - ratio[1]).abs() < 0.02 * ratio[1], "{ratio:?}");
    }
    // An earlier study in which another paddle was the best, and one could not control the target.
    let earlier = studied(folder.path(), "before.json", "paper", |value| {
        value["optimum"]["dynamic"] = 1.into();
        value["paddles"][4]["controllability_measure"] = serde_json::Value::Null;
    });
    let beside = draw(&["--beside".as_ref(), earlier.as_os_str()]);
    let told = format!("paddle {moved} is the best to move, in place of paddle 1");
    assert!(texts(&beside).join(" ").contains(&told), "{:?}", texts(&beside));
    assert!(texts(&beside).join(" ").contains("Open markers: before (paper, inclusion)"), "{:?}", texts(&beside));
    // One that cannot control the target has a place where failures stand, not none.
    let cannot = studied(folder.path(), "cannot.json", "paper", |value| {
        value["paddles"][4]["controllability_measure"] = serde_json::Value::Null;
    });
    model_offline().arg("draw").arg(&cannot).arg("-o").arg(&out).assert().success();
    let failed = |svg: &str| texts(svg).iter().any(|text| text == "failed");
    assert!(failed(&std::fs::read_to_string(&out).unwrap()) && !failed(&alone));
    // Of an insertion that stopped at once nothing is known: no bar of no height, and no line at none.
    let at_once = studied(folder.path(), "at-once.json", "paper", |value| {
        let stopped = serde_json::json!({"reason": "element-inverted", "depth": 0.0, "detail": ""});
        for study in ["/paddles/4/static", "/no_paddle/static"] {
            let study = value.pointer_mut(study).unwrap();
            (study["depth"], study["max_orthogonal"], study["failure"]) =
                (serde_json::json!([]), 0.0.into(), stopped.clone());
        }
    });
    model_offline().arg("draw").arg(&at_once).arg("-o").arg(&out).assert().success();
    let at_once = std::fs::read_to_string(&out).unwrap();
    let has_line = |svg: &str| texts(svg).iter().any(|text| text == "no paddle");
    assert!(failed(&at_once) && !has_line(&at_once) && has_line(&alone), "{:?}", texts(&at_once));
    // What is no study, or no use for one.
    assert!(refused(&study, &["--field", "strain"]).contains("leave them out"));
    let solution = solved(folder.path(), &[]);
    assert!(refused(&solution, &["--beside", study.to_str().unwrap()]).contains("is no result of `place`"));
    assert!(refused(&study, &["--beside", solution.to_str().unwrap()]).contains("is no result of `place`"));
    let none = studied(folder.path(), "none.json", "paper", |value| value["paddles"] = serde_json::json!([]));
    assert!(refused(&none, &[]).contains("0 paddles"));
    let negative = studied(folder.path(), "negative.json", "paper", |value| {
        value["paddles"][0]["static"]["max_orthogonal"] = (-1.0).into();
    });
    assert!(refused(&negative, &[]).contains("a size in it is -1"));
}

/// A result of `solve` in space: every field is drawn, and its strain is the Green–Lagrange strain of the tetrahedra as they are moved,
/// worked out here from nothing but their corners.
#[test]
fn a_result_in_space_is_drawn_with_every_field() {
    let folder = tempfile::tempdir().unwrap();
    let result = folder.path().join("solved.json");
    let solve = [
        "solve",
        "block",
        "--depth",
        "0.05",
        "--integration",
        "fem-t4",
        "--spacing",
        "0.2",
        "--paddle",
        "3",
        "--quiet",
        "--json",
    ];
    model_offline().args(solve).arg(&result).assert().success();
    let value: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&result).unwrap()).unwrap();
    for (field, largest) in [
        ("size", largest(&lengths(&value))),
        ("strain", largest(&numbers(&value["strain"]))),
        ("von-mises", largest(&numbers(&value["von_mises"]))),
    ] {
        let out = folder.path().join(format!("{field}.svg"));
        model_offline().arg("draw").arg(&result).args(["--field", field, "-o"]).arg(&out).assert().success();
        let svg = std::fs::read_to_string(&out).unwrap();
        let document = roxmltree::Document::parse(&svg).unwrap();
        let of = |class: &str| document.descendants().filter(|node| node.attribute("class") == Some(class)).count();
        assert!((0..10).all(|band| of(&format!("f{band}")) > 0), "{field}: a colour is missing");
        assert!(svg.contains("block, inclusion, paddle 3: depth\u{a0}0.05"));
        let said = svg.split("Largest value at a node:\u{a0}").nth(1).unwrap();
        let said: String = said.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
        let said: f64 = said.trim_end_matches('.').parse().unwrap();
        assert!((said - largest).abs() < 0.01 * largest, "{field}: {said} {largest}");
    }
    let expected = strains(&value);
    let found = numbers(&value["strain"]);
    assert_eq!(found.len(), expected.len());
    let most = largest(&expected);
    assert!(most > 0.1 && found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9 * most), "not the strain");

    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = value.clone();
        change(&mut value);
        let file = folder.path().join("changed.json");
        std::fs::write(&file, value.to_string()).unwrap();
        file
    };
    assert!(refused(&result, &["--case", "2"]).contains("has one state"));
    assert!(refused(&with(&|v| v["geometry"] = serde_json::Value::Null), &[]).contains("no result of"));
    assert!(refused(&with(&|v| drop(v.as_object_mut().unwrap().remove("geometry"))), &[]).contains("solve again"));
    let short = with(&|v| v["node_displacements"].as_array_mut().unwrap().truncate(5));
    assert!(refused(&short, &[]).contains("nodes has a place"));
    let short = with(&|v| v["strain"].as_array_mut().unwrap().truncate(5));
    assert!(refused(&short, &["--field", "strain"]).contains("nodes has a place"));
    let without = with(&|v| v["von_mises"] = serde_json::Value::Null);
    assert!(refused(&without, &["--field", "von-mises"]).contains("--field size or orthogonal or strain"));
    let beyond = with(&|v| v["geometry"]["outside"][0][0] = u32::MAX.into());
    assert!(refused(&beyond, &[]).contains("nodes that it does not have"));
    let nowhere = with(&|v| v["geometry"]["axis"] = serde_json::json!([0, 0, 0]));
    assert!(refused(&nowhere, &[]).contains("no unit vectors"));
    let along = with(&|v| v["geometry"]["orthogonal"][1] = v["geometry"]["orthogonal"][0].clone());
    assert!(refused(&along, &[]).contains("orthogonal to each other"));
    let part = with(&|v| v["geometry"]["parts"][0] = 7.into());
    assert!(refused(&part, &[]).contains("inclusions that it does not have"));
    let twice = with(&|v| v["geometry"]["paddles"][0]["index"] = v["geometry"]["paddles"][1]["index"].clone());
    assert!(refused(&twice, &[]).contains("one index"));
    let long = with(&|v| v["geometry"]["units"][0] = "m".repeat(5_000).into());
    assert!(refused(&long, &[]).contains("is no name"));
    let huge = with(&|v| v["geometry"]["nodes"][0] = serde_json::json!([1e150, 0, 0]));
    assert!(refused(&huge, &[]).contains("span no body"));
    let below = with(&|v| v["strain"][0] = serde_json::json!(-1.0));
    assert!(refused(&below, &[]).contains("no numbers from 0 on"));
    let far = with(&|v| v["node_displacements"][0] = serde_json::json!([1e308, -1e308, 0.0]));
    assert!(refused(&far, &[]).contains("farther than any body does"));
    assert!(refused(&with(&|v| v["paddles"] = serde_json::json!([3, 3])), &[]).contains("there twice"));
    let flat = with(&|v| {
        let nodes = v["geometry"]["nodes"].as_array_mut().unwrap();
        nodes.iter_mut().for_each(|node| *node = serde_json::json!([0.5, 0.5, 0.5]));
    });
    assert!(refused(&flat, &[]).contains("span no body"));
    assert!(refused(&with(&|v| v["paddles"] = serde_json::json!([99])), &[]).contains("none of its scene"));
    assert!(
        refused(&with(&|v| v["paddles"] = serde_json::json!([3, 6])), &[]).contains("not every paddle has a place")
    );
}

fn numbers(list: &serde_json::Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn lengths(value: &serde_json::Value) -> Vec<f64> {
    let all = value["node_displacements"].as_array().unwrap();
    all.iter().map(|u| numbers(u).iter().map(|part| part * part).sum::<f64>().sqrt()).collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// ½ ‖FᵀF − 1‖ at the corners of tetrahedra: the mean of those around by their volume.
fn strains(value: &serde_json::Value) -> Vec<f64> {
    let points = |list: &serde_json::Value| -> Vec<Vector3<f64>> {
        list.as_array().unwrap().iter().map(|x| Vector3::from_vec(numbers(x))).collect()
    };
    let (rest, moved) = (points(&value["geometry"]["nodes"]), points(&value["node_displacements"]));
    let mut sums = vec![(0.0, 0.0); rest.len()];
    for corners in value["geometry"]["tetrahedra"].as_array().unwrap() {
        let corners: Vec<usize> = numbers(corners).into_iter().map(|node| node as usize).collect();
        let sides = |at: &dyn Fn(usize) -> Vector3<f64>| {
            Matrix3::from_columns(&[1, 2, 3].map(|k| at(corners[k]) - at(corners[0])))
        };
        let before = sides(&|node| rest[node]);
        let f = sides(&|node| rest[node] + moved[node]) * before.try_inverse().unwrap();
        let strain = (0.5 * (f.transpose() * f - Matrix3::identity())).norm();
        for node in corners {
            sums[node].0 += strain * before.determinant().abs();
            sums[node].1 += before.determinant().abs();
        }
    }
    sums.into_iter().map(|(sum, weight)| sum / weight).collect()
}
