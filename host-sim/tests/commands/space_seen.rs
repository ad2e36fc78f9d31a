//! A run in space as other tools see it: its files read back, and held against the recording and against bodies that are
//! solved here.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::files::check_schema;
use crate::scenes::with_pairs;
use host_sim::bench::in_space::SpaceRun;
use host_sim::record::recording::Recording;
use host_sim::world::truth::{Truth, from_frame};
use model_offline::geometry::Point;
use model_offline::model::space::SpaceModel;
use model_offline::model::space::surfaces::Surfaces;
use model_offline::output::field_picture::Field;
use model_offline::output::result_file::{AnyBody, Which, read_body};
use model_offline::placement::space::workflow::coarse;
use model_offline::scene::space::{AnyScene, SpaceScene};
use model_offline::solver::equilibrium::NewtonSettings;
use serde_json::Value;

/// The paddles of the runs.
const PAIR: [u32; 2] = [5, 6];

/// A run on `scan` with one pair that writes everything: its scene and its directory.
fn run(directory: &Path, tissue: &str) -> (PathBuf, PathBuf) {
    let scene = with_pairs(directory, "[[5, 6]]");
    let report = directory.join("report");
    let words = "--insertion-time 0.5 --mode lockstep --mcap --vtu --tissue";
    let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    run.args(["run", "--quiet", "--scene"]).arg(&scene).arg("--out").arg(&report);
    let output = run.args(words.split(' ')).arg(tissue).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    (scene, report)
}

fn read(path: &Path) -> SpaceScene {
    let AnyScene::Space(scene) = AnyScene::read(path).unwrap() else { panic!("{} is not in space", path.display()) };
    *scene
}

/// MCAP of a recording with this scene.
fn export(recording: &Path, scene: &Path, to: &Path) -> Output {
    let mut export = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    export.arg("export").arg(recording).arg("--scene").arg(scene).arg("--mcap").arg(to);
    export.arg("--layout").arg(to.with_extension("json")).output().unwrap()
}

fn vector(value: &Value) -> Point<3> {
    Point::from(["x", "y", "z"].map(|name| value[name].as_f64().unwrap()))
}

/// Where the corners of an entity's triangles are, one after the other, after a look at all of its indices and colours.
fn corners(entity: &Value) -> Vec<Point<3>> {
    let mut all = Vec::new();
    for list in entity["triangles"].as_array().unwrap() {
        let points: Vec<Point<3>> = list["points"].as_array().unwrap().iter().map(vector).collect();
        let indices = list["indices"].as_array().unwrap();
        assert!(!indices.is_empty() && indices.len().is_multiple_of(3));
        let colours = list["colors"].as_array().unwrap().len();
        assert!(colours == 0 || colours == points.len(), "{colours} colours of {} points", points.len());
        let by = vector(&list["pose"]["position"]);
        all.extend(indices.iter().map(|i| points[i.as_u64().unwrap() as usize] + by));
    }
    all
}

/// Volume inside of outward triangles, by the divergence theorem; no edge may be run more often one way than the other.
fn enclosed(corners: &[Point<3>]) -> f64 {
    let key = |x: &Point<3>| <[u64; 3]>::from(x.map(f64::to_bits));
    let mut runs: BTreeMap<[[u64; 3]; 2], i32> = BTreeMap::new();
    for triangle in corners.chunks(3) {
        for k in 0..3 {
            let (from, to) = (key(&triangle[k]), key(&triangle[(k + 1) % 3]));
            *runs.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    assert!(runs.values().all(|sum| *sum == 0), "the surface is not closed");
    corners.chunks(3).map(|t| t[0].dot(&t[1].cross(&t[2])) / 6.0).sum()
}

/// Volume of a mesh whose nodes are at these places.
fn volume(model: &SpaceModel, nodes: &[Point<3>]) -> f64 {
    let of = |corners: &[u32; 4]| {
        let [a, b, c, d] = corners.map(|node| nodes[node as usize]);
        (b - a).cross(&(c - a)).dot(&(d - a)).abs() / 6.0
    };
    model.spatial().tetrahedra().iter().map(of).sum()
}

/// The nodes of the body at a moment, solved here.
fn solved(model: &SpaceModel, truth: &Truth) -> Vec<Point<3>> {
    let attached = PAIR.map(|index| model.scene().paddle_position(index).unwrap());
    let mut body = model.body(&attached, NewtonSettings::default()).unwrap();
    // In steps: in one the law may have no answer on the way.
    for part in [0.25, 0.5, 0.75, 1.0] {
        body.drive(part * truth.depth, &truth.paddles.map(|moved| from_frame(moved) * part)).unwrap();
    }
    let moved = model.nodal_displacements(body.equilibrium().coefficients());
    model.spatial().positions().iter().zip(moved).map(|(x, u)| x + u).collect()
}

/// Messages of a topic with their times.
fn messages(bytes: &[u8], topic: &str) -> Vec<(u64, Value)> {
    let all = mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap);
    let of = all.filter(|message| message.channel.topic == topic);
    of.map(|message| (message.log_time, serde_json::from_slice(&message.data).unwrap())).collect()
}

fn entity(update: &Value, id: &str) -> Value {
    let entities = update["entities"].as_array().unwrap();
    entities.iter().find(|entity| entity["id"] == id).unwrap_or_else(|| panic!("no {id}")).clone()
}

fn apart(found: &[Point<3>], expected: impl Iterator<Item = Point<3>>) -> f64 {
    found.iter().zip(expected).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// One run, opened by everything else.
#[test]
fn a_run_in_space_can_be_opened_elsewhere() {
    let directory = tempfile::tempdir().unwrap();
    let (path, report) = run(directory.path(), "inclusion");
    let model = coarse(&read(&path)).unwrap();
    let recording = Recording::read(&report.join("inclusion-dynamic.rec")).unwrap();
    let truths: BTreeMap<u64, Truth> = recording.truths().into_iter().map(|truth| (truth.time_ns, truth)).collect();
    mcap_shows_the_body_where_the_recording_and_the_model_have_it(directory.path(), &path, &model, &truths);
    vtu_has_what_the_displacement_tells(&report, &model, &truths);
    check_schema(&report, "result-in-space");
    bodies_can_be_drawn(&report);
    the_report_is_made_again(directory.path(), &report);
}

/// The surface in MCAP is the model's, closed, where needle and paddles have moved it; tools are where the recording has them.
fn mcap_shows_the_body_where_the_recording_and_the_model_have_it(
    directory: &Path,
    path: &Path,
    model: &SpaceModel,
    truths: &BTreeMap<u64, Truth>,
) {
    let report = directory.join("report");
    let file = report.join("inclusion-dynamic.rec");
    let bytes = std::fs::read(report.join("inclusion-dynamic.mcap")).unwrap();
    let again = directory.join("again.mcap");
    let exported = export(&file, path, &again);
    assert!(exported.status.success(), "{exported:?}");
    assert!(std::fs::read(&again).unwrap() == bytes, "the same recording, exported afterwards");

    let bodies = messages(&bytes, "/scene/body");
    assert_eq!(bodies.len(), 21, "a body at rest and twenty on the way");
    the_body_is_the_models(model, &bodies, truths);
    tools_are_where_the_recording_has_them(model, &messages(&bytes, "/scene"), truths);
    let layout = std::fs::read(report.join("inclusion-dynamic.foxglove.json")).unwrap();
    assert_eq!(layout, std::fs::read(again.with_extension("json")).unwrap(), "the layout, exported with it");
    let layout: Value = serde_json::from_slice(&layout).unwrap();
    for topic in ["/scene", "/scene/rest", "/scene/body"] {
        assert_eq!(layout["configById"]["3D!scene"]["topics"][topic]["visible"], true, "{topic}");
        assert!(!messages(&bytes, topic).is_empty(), "{topic}");
    }

    // Another scene is not its.
    for other in ["block", "paper"] {
        let refused = export(&file, Path::new(other), &directory.join("other.mcap"));
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(2) && said.contains("not the scene that was recorded"), "{said}");
        assert!(!directory.join("other.mcap").exists());
    }
}

/// Corners of triangles, one after the other, moved alike from where these nodes are.
fn corners_at<'a>(
    triangles: &'a [[u32; 3]],
    nodes: &'a [Point<3>],
    by: Point<3>,
) -> impl Iterator<Item = Point<3>> + 'a {
    triangles.iter().flatten().map(move |node| nodes[*node as usize] + by)
}

fn the_body_is_the_models(model: &SpaceModel, bodies: &[(u64, Value)], truths: &BTreeMap<u64, Truth>) {
    let (rest, surfaces) = (model.spatial().positions(), Surfaces::new(model));
    let size = model.scene().size();
    for (i, (time_ns, update)) in bodies.iter().enumerate() {
        let (body, truth) = (entity(update, "body"), truths[time_ns]);
        let surface = corners(&body);
        let nodes = if i == 0 { rest.to_vec() } else { solved(model, &truth) };
        assert_eq!(surface.len(), 3 * surfaces.outside.len());
        let (found, expected) = (enclosed(&surface), volume(model, &nodes));
        assert!(found > 0.0 && (found / expected - 1.0).abs() < 1e-6, "{i}: {found} {expected}");
        let inclusion = corners(&entity(update, "inclusion 1"));
        let lesion = corners_at(&surfaces.inclusions[0], &nodes, Point::zeros());
        assert!(apart(&inclusion, lesion) < 1e-6 * size && enclosed(&inclusion) > 0.0);
        // What is held is where it is held, exactly.
        let only = |place: usize| {
            let mut part = body.clone();
            part["triangles"] = Value::Array(vec![body["triangles"][place].clone()]);
            corners(&part)
        };
        let by = model.scene().needle.axis * truth.depth;
        assert!(apart(&only(1), corners_at(&surfaces.immobile, rest, Point::zeros())) < 1e-9 * size);
        assert!(apart(&only(2), corners_at(&surfaces.needle, rest, by)) < 1e-9 * size);
        for (index, moved) in PAIR.iter().zip(truth.paddles) {
            let place = model.scene().paddle_position(*index).unwrap();
            for node in corners_at(&surfaces.paddles[place], rest, from_frame(moved)) {
                let nearest = surface.iter().map(|x| (x - node).norm()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-9 * size, "{i}: paddle {index} is {nearest} off its patch");
            }
        }
    }
    let (_, end) = truths.last_key_value().unwrap();
    assert_eq!(bodies.last().unwrap().0, end.time_ns);
    assert!(end.paddles.iter().all(|moved| from_frame::<3>(*moved).norm() > 0.01 * end.depth));
}

fn tools_are_where_the_recording_has_them(model: &SpaceModel, updates: &[(u64, Value)], truths: &BTreeMap<u64, Truth>) {
    let (scene, surfaces, rest) = (model.scene(), Surfaces::new(model), model.spatial().positions());
    let size = scene.size();
    assert!(updates.len() > 15, "{} pictures", updates.len());
    for (time_ns, update) in updates {
        let truth = truths[time_ns];
        let ball = vector(&entity(update, "target")["spheres"][0]["pose"]["position"]);
        assert!((ball - scene.target - truth.target::<3>()).norm() < 1e-12 * size);
        for ((id, index), moved) in ["paddle", "second paddle"].iter().zip(PAIR).zip(truth.paddles) {
            let plate = entity(update, id);
            let by = vector(&plate["triangles"][0]["pose"]["position"]);
            assert!((by - from_frame::<3>(moved)).norm() < 1e-12 * size);
            // It is drawn a little off the patch, outwards, and so without flicker.
            let patch = &surfaces.paddles[scene.paddle_position(index).unwrap()];
            let at_rest = patch.iter().flatten().map(|node| rest[*node as usize] + by);
            let off: Vec<Point<3>> = corners(&plate).iter().zip(at_rest).map(|(now, rest)| now - rest).collect();
            assert!(off.iter().all(|way| (way - off[0]).norm() < 1e-9 * size && way.norm() < 0.01 * size));
            let [a, b, c] = patch[0].map(|node| rest[node as usize]);
            assert!(off[0].dot(&(b - a).cross(&(c - a))) > 0.0, "outwards");
        }
        // An arrow along x that is turned: its head ends where the needle is.
        let arrow = entity(update, "needle")["arrows"][0].clone();
        let [x, y, z, w] = ["x", "y", "z", "w"].map(|name| arrow["pose"]["orientation"][name].as_f64().unwrap());
        let along = Point::from([w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]);
        assert!((along - scene.needle.axis).norm() < 1e-12);
        let length = arrow["shaft_length"].as_f64().unwrap() + arrow["head_length"].as_f64().unwrap();
        let tip = vector(&arrow["pose"]["position"]) + along * length;
        let contact: Vec<Point<3>> = surfaces.needle.iter().flatten().map(|node| rest[*node as usize]).collect();
        let (low, high) = contact.iter().fold((contact[0], contact[0]), |(low, high), x| (low.inf(x), high.sup(x)));
        let within = tip - scene.needle.axis * truth.depth;
        assert!((0..3).all(|k| within[k] >= low[k] - 1e-9 * size && within[k] <= high[k] + 1e-9 * size), "{within}");
    }
}

/// An array of a VTU file.
fn numbers(document: &roxmltree::Document<'_>, name: &str) -> Vec<f64> {
    let array = document.descendants().find(|node| node.attribute("Name") == Some(name)).expect(name);
    array.text().unwrap().split_whitespace().map(|word| word.parse().unwrap()).collect()
}

fn points(numbers: &[f64]) -> Vec<Point<3>> {
    numbers.chunks(3).map(Point::from_column_slice).collect()
}

/// Files of a collection, and when.
fn collection(report: &Path, name: &str) -> Vec<(f64, PathBuf)> {
    let text = std::fs::read_to_string(report.join(name)).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    let sets = document.descendants().filter(|node| node.has_tag_name("DataSet"));
    let of = |set: roxmltree::Node<'_, '_>| {
        (set.attribute("timestep").unwrap().parse().unwrap(), report.join(set.attribute("file").unwrap()))
    };
    sets.map(of).collect()
}

/// The body's displacement is the model's own; strain, det F and von Mises stress are what displacement and stress say, cell by cell.
fn vtu_has_what_the_displacement_tells(report: &Path, model: &SpaceModel, truths: &BTreeMap<u64, Truth>) {
    let size = model.scene().size();
    let (_, end) = truths.last_key_value().unwrap();
    for strategy in ["none", "static", "dynamic"] {
        let bodies = collection(report, &format!("inclusion-{strategy}.pvd"));
        let parts = collection(report, &format!("inclusion-{strategy}-parts.pvd"));
        assert!(bodies.len() == 21 && parts.len() == 21 && bodies[0].0 == 0.0, "{strategy}");
        assert!(bodies.windows(2).all(|pair| pair[0].0 < pair[1].0) && parts.iter().all(|(_, file)| file.is_file()));
        assert!(report.join(format!("inclusion-{strategy}.py")).is_file());
    }
    let last = |name: &str| std::fs::read_to_string(collection(report, name).pop().unwrap().1).unwrap();
    let text = last("inclusion-dynamic.pvd");
    let document = roxmltree::Document::parse(&text).unwrap();
    let unit = &model.scene().length_unit;
    let (rest, moved) = (points(&numbers(&document, "Points")), numbers(&document, &format!("displacement [{unit}]")));
    let now: Vec<Point<3>> = rest.iter().zip(points(&moved)).map(|(x, u)| x + u).collect();
    assert!(apart(&now, solved(model, end).into_iter()) < 1e-6 * size);
    let stress = format!("[{}]", model.scene().stress_unit);
    let tensor = |values: &[f64]| nalgebra::Matrix3::from_row_slice(values);
    let strains = numbers(&document, "green_lagrange_strain");
    let stresses = numbers(&document, &format!("cauchy_stress {stress}"));
    let mises = numbers(&document, &format!("von_mises_stress {stress}"));
    let (det_f, regions) = (numbers(&document, "det_f"), numbers(&document, "region"));
    let cells = model.spatial().tetrahedra();
    assert!(numbers(&document, "types").iter().all(|kind| *kind == 10.0) && mises.len() == cells.len());
    let inside = Surfaces::new(model).parts;
    for (cell, corners) in cells.iter().enumerate() {
        let edges = |x: &[Point<3>]| {
            let [a, b, c, d] = corners.map(|node| x[node as usize]);
            nalgebra::Matrix3::from_columns(&[b - a, c - a, d - a])
        };
        let f = edges(&now) * edges(&rest).try_inverse().unwrap();
        let strain = (f.transpose() * f - nalgebra::Matrix3::identity()) * 0.5;
        assert!((tensor(&strains[9 * cell..9 * cell + 9]) - strain).norm() < 1e-5, "{cell}: {strain}");
        assert!((det_f[cell] - f.determinant()).abs() < 1e-5 && det_f[cell] > 0.0);
        let sigma = tensor(&stresses[9 * cell..9 * cell + 9]);
        let [x, y, z, yz, zx, xy] = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].map(|place| sigma[place]);
        let shear = yz * yz + zx * zx + xy * xy;
        let expected = (0.5 * ((x - y).powi(2) + (y - z).powi(2) + (z - x).powi(2)) + 3.0 * shear).sqrt();
        assert!((mises[cell] - expected).abs() < 1e-6 * expected.max(1e-6), "{cell}: {} {expected}", mises[cell]);
        assert_eq!(regions[cell], f64::from(inside[cell]));
    }
    parts_go_where_the_run_took_them(&last("inclusion-dynamic-parts.pvd"), model, end);
}

fn parts_go_where_the_run_took_them(text: &str, model: &SpaceModel, end: &Truth) {
    let (scene, surfaces) = (model.scene(), Surfaces::new(model));
    let document = roxmltree::Document::parse(text).unwrap();
    let moved = points(&numbers(&document, &format!("displacement [{}]", scene.length_unit)));
    let rest = points(&numbers(&document, "Points"));
    let [part, index, ends, nodes] = ["part", "paddle", "offsets", "connectivity"].map(|name| numbers(&document, name));
    let mut triangles = BTreeMap::new();
    for (cell, end_of) in ends.iter().enumerate() {
        let start = if cell == 0 { 0 } else { ends[cell - 1] as usize };
        let of_cell: Vec<usize> = nodes[start..*end_of as usize].iter().map(|node| *node as usize).collect();
        if of_cell.len() == 3 {
            *triangles.entry((part[cell] as u32, index[cell] as u32)).or_insert(0) += 1;
        }
        for node in of_cell {
            let expected = match part[cell] as u32 {
                1 => scene.needle.axis * end.depth,
                2 => {
                    assert!((rest[node] - scene.target).norm() < 1e-8 * scene.size());
                    end.target::<3>()
                }
                3 => Point::zeros(),
                _ => match PAIR.iter().position(|attached| f64::from(*attached) == index[cell]) {
                    Some(place) => from_frame(end.paddles[place]),
                    None => continue,
                },
            };
            assert!((moved[node] - expected).norm() < 1e-8 * scene.size(), "part {}", part[cell]);
        }
    }
    assert_eq!(triangles[&(1, 0)], surfaces.needle.len());
    assert_eq!(triangles[&(3, 0)], surfaces.immobile.len());
    for (paddle, patch) in scene.paddles.iter().zip(&surfaces.paddles) {
        assert_eq!(triangles[&(4, paddle.index)], patch.len());
    }
    assert_eq!(part.iter().filter(|part| **part == 2.0).count(), 1);
}

/// What `model-offline draw` makes pictures of: the body of every strategy, with every field; what is not there is said.
fn bodies_can_be_drawn(report: &Path) {
    let file = report.join("result.json");
    let whole: SpaceRun = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    for (strategy, expected) in ["none", "static", "dynamic"].iter().zip(&whole.bodies.cases[0]) {
        let which = Which { strategy: Some((*strategy).to_owned()), ..Which::default() };
        let AnyBody::Space(body) = read_body(&file, &which).unwrap() else { panic!("in space") };
        assert_eq!((&body.state, body.held_still), (expected.as_ref().unwrap(), *strategy == "static"));
        assert!(body.name.starts_with(&format!("{}, inclusion, {strategy}, ", whole.scene)), "{}", body.name);
        for (name, field) in Field::ALL {
            let values = field.values_in_space(&body.geometry, &body.state).unwrap();
            let largest = values.iter().copied().fold(0.0, f64::max);
            assert!(values.len() == body.geometry.nodes.len() && largest > 0.0 && largest.is_finite(), "{name}");
        }
    }
    let error = |which: &Which| read_body(&file, which).unwrap_err().to_string();
    assert!(error(&Which { case: Some(9), ..Which::default() }).contains("has no case 9"));
    assert!(
        error(&Which { strategy: Some("dynamic-free-run".to_owned()), ..Which::default() })
            .contains("case 1 has no dynamic-free-run")
    );
    assert!(error(&Which { depth: Some(0.0), ..Which::default() }).contains("at the end of the insertion alone"));
}

/// `report` makes the same page again from the result alone, takes in what lies beside it, and writes the pictures; a result
/// that is not whole is refused.
fn the_report_is_made_again(directory: &Path, report: &Path) {
    let (page, pictures) = (report.join("report.html"), directory.join("pictures"));
    let text = std::fs::read_to_string(&page).unwrap();
    std::fs::remove_file(&page).unwrap();
    let again = || {
        let mut again = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        again.arg("report").arg(report).arg("--svg-dir").arg(&pictures).output().unwrap()
    };
    let output = again();
    assert!(output.status.success(), "{output:?}");
    assert!(std::fs::read_to_string(&page).unwrap() == text, "not the same page");
    for name in ["error", "no-paddle", "static", "dynamic"] {
        let svg = std::fs::read_to_string(pictures.join(format!("inclusion-{name}.svg"))).unwrap();
        assert!(roxmltree::Document::parse(&svg).is_ok(), "{name}");
    }
    std::fs::write(report.join("pareto.svg"), "<svg xmlns=\"http://www.w3.org/2000/svg\"/>").unwrap();
    assert!(again().status.success());
    assert!(std::fs::read_to_string(&page).unwrap().contains("id=\"pareto-svg\""));

    let file = report.join("result.json");
    let mut result: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    result["bodies"]["geometry"]["outside"][0][0] = u32::MAX.into();
    std::fs::write(&file, result.to_string()).unwrap();
    let refused = again();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && said.contains("not whole"), "{said}");
}
