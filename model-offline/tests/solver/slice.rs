//! Slices of scenes in space, and `fit` that holds them against the body.

use assert_cmd::Command;
use model_offline::discretization::{Discretization, Integration, Method, Resolution};
use model_offline::geometry::{Point2, signed_area};
use model_offline::placement::discretise;
use model_offline::placement::rest::rest_responses;
use model_offline::scene::Scene;
use model_offline::scene::space::{AnyScene, SpaceScene};
use model_offline::study::fit::space::{SpaceAlternative, SpaceFit, fit_in_space};
use model_offline::study::slice::{LeftOutReason, Slice, SliceError, Through};
use std::f64::consts::PI;
use std::path::Path;

/// Half a ball's worth of awkwardness: millimetres, an oblique needle, curved paddles, an inclusion. The plane through paddle 1
/// holds the ball's centre.
const BALL: &str = r#"
[scene]
name = "ball"
dimension = 3
units = { length = "mm", stress = "kPa" }
[domain]
solid = { sphere = { centre = [5.0, 0.0, -3.0], radius = 20.0 } }
[material]
model = "neo-hookean"
lambda = 30.0
mu = 6.0
[[inclusion]]
sphere = { centre = [7.0, 1.0, -2.0], radius = 5.0 }
stiffness = 4.0
[immobile]
regions = [{ box = { min = [-20.0, -20.0, -24.0], max = [30.0, 20.0, -15.0] } }]
[needle]
region = { sphere = { centre = [16.54700538, 11.54700538, 8.54700538], radius = 4.0 } }
axis = [-1.0, -1.0, -1.0]
depth = 3.0
increments = 3
[target]
position = [6.0, 1.0, -2.0]
[[paddle]]
index = 1
region = { sphere = { centre = [25.0, 0.0, -3.0], radius = 6.0 } }
[[paddle]]
index = 2
region = { sphere = { centre = [5.0, 20.0, -3.0], radius = 6.0 } }
[[paddle]]
index = 3
region = { sphere = { centre = [-15.0, 0.0, -3.0], radius = 5.0 } }
[discretization]
tolerance = 0.1
"#;

/// A target beside an oblique needle's line, over a groove.
const BESIDE: &str = r#"
[scene]
name = "beside"
dimension = 3
units = { length = "mm", stress = "kPa" }
[domain]
solid = { difference = [{ box = { min = [0.0, 0.0, 0.0], max = [80.0, 60.0, 50.0] } }, { cylinder = { from = [40.0, -10.0, 5.0], to = [40.0, 70.0, 5.0], radius = 10.0 } }] }
[material]
model = "neo-hookean"
lambda = 30.0
mu = 6.0
[immobile]
regions = [{ box = { min = [0.0, 0.0, 0.0], max = [80.0, 60.0, 0.0] } }]
[needle]
region = { box = { min = [30.0, 20.0, 50.0], max = [40.0, 30.0, 50.0] } }
axis = [0.2, 0.1, -1.0]
depth = 5.0
increments = 1
[target]
position = [50.0, 26.0, 25.0]
[[paddle]]
index = 1
region = { box = { min = [80.0, 20.0, 20.0], max = [80.0, 40.0, 40.0] } }
[[paddle]]
index = 3
region = { box = { min = [30.0, 0.0, 20.0], max = [50.0, 0.0, 40.0] } }
[actuator]
max_displacement = 1.0
[discretization]
tolerance = 0.15
"#;

/// A bore that a mesh with this few patches is too coarse for.
const BORE: &str = r#"
[scene]
name = "bore"
dimension = 3
[domain]
solid = { difference = [{ box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }, { cylinder = { from = [0.5, -0.5, 0.25], to = [0.5, 1.5, 0.25], radius = 0.1 } }] }
[material]
model = "neo-hookean"
lambda = 30.0
mu = 6.0
[immobile]
regions = [{ box = { min = [1.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] } }]
[needle]
region = { box = { min = [0.4, 0.4, 1.0], max = [0.6, 0.6, 1.0] } }
axis = [0.0, 0.0, -1.0]
depth = 0.05
[target]
position = [0.5, 0.5, 0.5]
[[paddle]]
index = 1
region = { box = { min = [0.0, 0.4, 0.4], max = [0.0, 0.6, 0.6] } }
[[paddle]]
index = 2
region = { box = { min = [0.4, 0.0, 0.4], max = [0.6, 0.0, 0.6] } }
[discretization]
tolerance = 0.1
"#;

/// A body so long that its middle is in plane strain: needle and paddles are strips from end to end.
const PRISM: &str = r#"
[scene]
name = "prism"
dimension = 3
[domain]
box = { min = [0.0, 0.0, 0.0], max = [1.0, 4.0, 1.0] }
[material]
model = "neo-hookean"
lambda = 30.0
mu = 20.0
[immobile]
regions = [{ box = { min = [1.0, 0.0, 0.0], max = [1.0, 4.0, 1.0] } }]
[needle]
region = { box = { min = [0.35, 0.0, 1.0], max = [0.65, 4.0, 1.0] } }
axis = [0.0, 0.0, -1.0]
depth = 0.02
increments = 2
[target]
position = [0.5, 2.0, 0.5]
[[paddle]]
index = 1
region = { box = { min = [0.0, 0.0, 0.4], max = [0.0, 4.0, 0.7] } }
[[paddle]]
index = 2
region = { box = { min = [0.0, 0.0, 0.1], max = [0.0, 4.0, 0.3] } }
[discretization]
tolerance = 0.1
"#;

fn scene(text: &str) -> SpaceScene {
    match AnyScene::parse(text, "scene.toml").unwrap() {
        AnyScene::Space(scene) => *scene,
        AnyScene::Planar(_) => panic!("planar"),
    }
}

fn block() -> String {
    Scene::text(Path::new("block")).unwrap()
}

fn slice(text: &str, paddle: Option<u32>) -> Result<Slice, SliceError> {
    Slice::of(&scene(text), text, paddle)
}

fn fitted(text: &str, tolerance: f64) -> SpaceFit {
    fit_in_space(&scene(text), text, tolerance, 2, (&|_| {}, &|| {})).unwrap()
}

fn indices(slice: &Slice) -> Vec<u32> {
    slice.scene.paddles.iter().map(|paddle| paddle.index).collect()
}

fn length(ends: [Point2; 2]) -> f64 {
    (ends[1] - ends[0]).norm()
}

/// An independent solver's plane strain on the section y = 0.5 of `block`: 3.35 for paddle 3, 5.32 for paddle 4.
#[test]
fn the_slice_of_block_has_the_measures_of_independent_plane_strain() {
    let mut body = SpaceScene::bundled("block").unwrap().without_inclusions();
    body.discretization = Discretization::new(Resolution::Tolerance(0.01), Method::new(Integration::FemT10));
    let slice = Slice::of(&body, &block(), None).unwrap();
    assert_eq!((indices(&slice), slice.through), (vec![3, 4], Through::Paddle(3)));
    assert_eq!(slice.scene.discretization.method.integration, Integration::FemT6);
    let (model, _) = discretise(&slice.scene).unwrap();
    for (found, expected) in rest_responses(&model).unwrap().iter().zip([3.35, 5.32]) {
        let apart = found.controllability_measure / expected - 1.0;
        println!("{} {expected}", found.controllability_measure);
        assert!(apart.abs() < 0.015, "{} {expected}", found.controllability_measure);
    }
}

#[test]
fn sharp_corners_rims_and_inclusions_of_block_are_where_they_are() {
    let slice = slice(&block(), Some(4)).unwrap();
    let scene = &slice.scene;
    assert_eq!(slice.plane.name("1").replace('\u{a0}', " "), "y = 0.5, along the needle");
    let has = |x: f64, z: f64| scene.outline.vertices().iter().any(|v| (v - Point2::new(x, z)).norm() < 1e-9);
    for [x, z] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.4, 1.0], [0.6, 1.0], [0.0, 0.4], [0.0, 0.8]] {
        assert!(has(x, z), "({x}, {z}): {:?}", scene.outline);
    }
    assert!((scene.outline.area() - 1.0).abs() < 1e-9 && (scene.inclusions[0].outline.area() - 0.01).abs() < 1e-9);
    assert_eq!(scene.inclusions[0].stiffness, 100.0);
    assert!((length(scene.paddles[0].segment) - 0.2).abs() < 1e-9);
    assert_eq!(slice.left_out.iter().map(|left| left.index).collect::<Vec<_>>(), [1, 2, 5, 6, 7, 8]);
}

/// A plane through a ball's centre cuts a disc; a patch within r of a point of the surface has the chord 2r √(1 − r²/4R²).
#[test]
fn a_slice_of_a_ball_is_a_disc_with_chords() {
    let slice = slice(BALL, Some(1)).unwrap();
    let (scene, chord) = (&slice.scene, |r: f64| 2.0 * r * (1.0 - r * r / 1600.0).sqrt());
    assert_eq!((indices(&slice), slice.left_out[0].reason), (vec![1, 3], LeftOutReason::Missed));
    let straightened = |r: f64| {
        let angle = 4.0 * (0.5 * r / 20.0).asin();
        0.5 * 400.0 * (angle - angle.sin())
    };
    let disc = PI * 400.0 - straightened(6.0) - straightened(5.0);
    assert!((scene.outline.area() / disc - 1.0).abs() < 5e-3, "{} {disc}", scene.outline.area());
    for (paddle, r) in scene.paddles.iter().zip([6.0, 5.0]) {
        assert!((length(paddle.segment) - chord(r)).abs() < 0.01, "{:?} {}", paddle.segment, chord(r));
    }
    let contact = [scene.needle.contact[0], scene.needle.contact[scene.needle.contact.len() - 1]];
    assert!((length(contact) - chord(4.0)).abs() < 0.01, "{contact:?}");
    let inclusion = &scene.inclusions[0].outline;
    assert!((inclusion.area() / (PI * 25.0) - 1.0).abs() < 0.02, "{}", inclusion.area());
    // Everything lies where the plane's coordinates say.
    let axis = slice.plane.directions.map(|direction| direction.dot(&model_offline::geometry::Point::repeat(-1.0)));
    assert!((scene.needle.axis - Point2::from(axis).normalize()).norm() < 1e-9);
    assert!(signed_area(scene.outline.vertices()) > 0.0 && scene.length_unit == "mm");
}

#[test]
fn what_makes_no_slice_is_refused_with_what_to_do() {
    let beside = slice(BESIDE, None).unwrap();
    assert_eq!((beside.through, indices(&beside)), (Through::NeedleBesideTarget, vec![1]));
    assert!(matches!(slice(BESIDE, Some(1)), Err(SliceError::NotFree { off, .. }) if (off - 9.949).abs() < 0.01));
    assert!(matches!(slice(BALL, Some(9)), Err(SliceError::NoSuchPaddle(_))));
    // A bore across the plane, which the mesh of this scene does not see there.
    assert!(matches!(slice(BORE, Some(1)), Err(SliceError::Holes { .. })));
    // An oblique plane that leaves the body before the chest wall.
    let scan = SpaceScene::bundled("scan").unwrap();
    let missed = Slice::of(&scan, &Scene::text(Path::new("scan")).unwrap(), Some(1)).unwrap_err();
    assert!(matches!(missed, SliceError::Misses { what: "immobile part", .. }), "{missed}");
    // A paddle round an edge is no straight one.
    let bent = block()
        .replace("min = [0.0, 0.4, 0.4], max = [0.0, 0.6, 0.6]", "min = [-0.1, 0.4, 0.85], max = [0.15, 0.6, 1.1]");
    let bent = slice(&bent, Some(4)).unwrap();
    assert!(
        bent.left_out.iter().any(|left| left.index == 3 && left.reason == LeftOutReason::Bent),
        "{:?}",
        bent.left_out
    );
}

#[test]
fn plane_strain_will_do_for_a_long_prism() {
    // 2 % between the models, and 6 % that their estimates leave open.
    let unsure = fitted(PRISM, 0.08).verdict;
    let reason = unsure.rejected.iter().find(|r| r.alternative == SpaceAlternative::PlaneStrain).unwrap();
    assert!(unsure.dimension == 3 && reason.number < Some(0.05), "{unsure:?}");
    assert!(reason.reason.to_string().contains("a smaller tolerance refines both"), "{}", reason.reason);
    let fit = fitted(PRISM, 0.12);
    assert_eq!((fit.verdict.dimension, &fit.verdict.paddles[..]), (2, &[1][..]), "{:?}", fit.verdict);
    for paddle in &fit.paddles {
        let (ratio, feedback) = (paddle.ratio.unwrap(), paddle.feedback.unwrap());
        println!("{} ratio {ratio} gain {} across {}", paddle.index, feedback.gain, feedback.across);
        // What both models leave open: 4 and 6 %.
        assert!((ratio - 1.0).abs() < 0.1 && feedback.gain_mismatch < 0.1 && feedback.across.abs() < 0.04);
    }
    let slice = fit.slice.as_ref().unwrap();
    // The cheaper is chosen; what was not says by how much.
    let dearer = fit.verdict.rejected.iter().find(|r| r.alternative == SpaceAlternative::Body).unwrap();
    assert_eq!(dearer.number, Some(fit.body.cost_s / slice.model.cost_s));
    assert!(dearer.number > Some(10.0));
    // Followed, and estimated by Jacobians at rest: small depths are nearly linear.
    let (followed, estimated) = (slice.closed_loop.as_ref().unwrap(), fit.paddles[0].feedback.unwrap());
    let apart = (followed.table_alone.in_plane - estimated.table_alone.in_plane).abs() / followed.without_help;
    println!("{followed:?} {estimated:?}");
    assert!(apart < 0.05 && followed.converges && followed.with_feedback.in_plane.abs() < 2e-3 * followed.without_help);
    assert!(followed.table_alone.whole() < 0.15 * followed.without_help);
    assert!(followed.with_feedback.across_plane.abs() < 0.01 * slice.without_help.body_axial);
    // What is written is the slice.
    let text = fit.written(&scene(PRISM), PRISM).unwrap();
    assert_eq!(Scene::parse(&text, "written.toml").unwrap().paddles.len(), 2);
}

/// Continuum limits: 5.86 of way in the body and 3.35 in plane strain, for the same direction.
#[test]
fn the_body_is_needed_for_block_and_one_paddle_will_do() {
    let text = block().replace("of = \"all\"", "of = [[3, 6]]").replace("increments = 5", "increments = 1");
    let body = scene(&text).without_inclusions();
    let fit = fit_in_space(&body, &text, 0.15, 2, (&|_| {}, &|| {})).unwrap();
    assert_eq!((fit.verdict.dimension, &fit.verdict.paddles[..]), (3, &[3][..]));
    let paddle = fit.paddles.iter().find(|paddle| paddle.index == 3).unwrap();
    println!("{paddle:?}");
    assert!((paddle.body_in_plane.unwrap() / 5.8587 - 1.0).abs() < 0.05 && (paddle.body / 5.7859 - 1.0).abs() < 0.05);
    assert!((paddle.ratio.unwrap() / (5.8587 / 3.35) - 1.0).abs() < 0.15);
    // The continuum's Jacobian times the direction of converged plane strain, (3.198, 0.901).
    let gain = 0.172435 * 3.198 - 0.01174 * 0.901;
    assert!((paddle.feedback.unwrap().gain / gain - 1.0).abs() < 0.1, "{paddle:?} {gain}");
    // Symmetric about the plane.
    assert_eq!(paddle.feedback.unwrap().across, 0.0);
    let gain = fit.verdict.rejected.iter().find(|r| r.alternative == SpaceAlternative::PlaneStrain).unwrap();
    assert_eq!(gain.number, Some(paddle.feedback.unwrap().gain_mismatch));
    // 5.79 to 5.75: the second paddle saves 0.6 %.
    let second = fit.verdict.rejected.iter().find(|r| r.alternative == SpaceAlternative::TwoPaddles).unwrap();
    assert!((second.number.unwrap() - (1.0 - 5.7488 / 5.7859)).abs() < 0.005, "{second:?}");
    assert!(fit.svg().contains("slice, plane strain"));
    // What is written is the tissue that was fitted.
    assert!(text.contains("[[inclusion]]") && scene(&fit.written(&body, &text).unwrap()).inclusions.is_empty());
}

#[test]
fn a_slice_names_the_inclusions_that_its_plane_misses() {
    let lump = |y: [f64; 2]| {
        let [from, to] = y;
        format!("[[inclusion]]\nbox = {{ min = [0.3, {from}, 0.35], max = [0.6, {to}, 0.75] }}\nstiffness = 9.0\n")
    };
    // The plane is y = 2.
    let lumps = [lump([2.3, 2.9]), lump([1.7, 2.2]), lump([0.5, 1.0])].concat();
    let cut = slice(&PRISM.replace("[target]", &(lumps + "[target]")), None).unwrap();
    assert_eq!((cut.inclusions_left_out.as_slice(), cut.scene.inclusions.len()), ([1, 3].as_slice(), 1));
    assert!(slice(&block(), Some(3)).unwrap().inclusions_left_out.is_empty());
}

/// A stiff lump beside the plane pushes the target across it, which no slice can know: most of the way orthogonal to the
/// needle, and next to nothing of the way along it.
#[test]
fn a_lump_beside_the_plane_needs_the_body() {
    let lump = "[[inclusion]]\nbox = { min = [0.3, 2.3, 0.35], max = [0.6, 2.9, 0.75] }\nstiffness = 100.0\n[target]";
    let fit = fitted(&PRISM.replace("[target]", lump), 0.1);
    assert_eq!(fit.verdict.dimension, 3, "{:?}", fit.verdict);
    let way = fit.slice.as_ref().unwrap().without_help;
    assert!(
        way.body_across_plane.abs() > 0.1 * way.body_in_plane.abs()
            && way.body_across_plane.abs() < 0.05 * way.body_axial.abs()
    );
    let reasons = fit.verdict.rejected.iter().filter(|r| r.alternative == SpaceAlternative::PlaneStrain);
    let numbers: Vec<f64> = reasons.filter_map(|r| r.number).collect();
    assert!(numbers.iter().any(|number| *number > 0.3), "{numbers:?}");
}

/// A paddle at its limit leaves 1 − limit/stroke of the target's displacement: more than the tolerance, and two are needed.
#[test]
fn a_second_paddle_pays_where_one_is_at_its_limit() {
    let free = fitted(BESIDE, 0.15);
    assert_eq!(free.verdict.paddles, free.one.paddles);
    let two = free.two.as_ref().unwrap();
    assert!(two.stroke < 0.8 * free.one.stroke, "{} {}", two.stroke, free.one.stroke);
    let limit = 0.8 * free.one.stroke;
    let text = BESIDE.replace("max_displacement = 1.0", &format!("max_displacement = {limit}"));
    let limited = fitted(&text, 0.15);
    assert!((limited.one.left_at_limit - 0.2).abs() < 1e-9 && limited.two.as_ref().unwrap().left_at_limit == 0.0);
    assert_eq!(limited.verdict.paddles, two.paddles);
    let one = limited.verdict.rejected.iter().find(|r| r.alternative == SpaceAlternative::OnePaddle).unwrap();
    assert_eq!(one.number, Some(limited.one.left_at_limit));
}

fn run(arguments: &[&str], folder: &Path) -> (i32, String) {
    let mut command = Command::cargo_bin("model-offline").unwrap();
    let output = command.args(arguments).current_dir(folder).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    (output.status.code().unwrap(), text)
}

#[test]
fn what_slice_writes_place_takes_and_nothing_is_written_where_there_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let (code, told) = run(&["slice", "block", "-o", "plane.toml", "--json", "plane.json"], path);
    assert!(code == 0 && told.contains("laid through paddle 3") && told.contains("paddle 8 is left out"), "{told}");
    assert_eq!(run(&["place", "plane.toml", "--tolerance", "0.1", "--quiet", "--json", "place.json"], path).0, 0);
    let place: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path.join("place.json")).unwrap()).unwrap();
    assert_eq!(place["optimum"]["dynamic"], 3);
    for (arguments, code, expected) in [
        (&["slice", "paper", "-o", "none.toml"][..], 2, "this scene is planar"),
        (&["slice", "block", "--paddle", "9", "-o", "none.toml"], 2, "no paddle 9"),
        (&["slice", "scan", "--paddle", "1", "-o", "none.toml"], 1, "does not"),
        (&["fit", "paper", "--tolerance", "0.1", "--svg", "none.svg"], 2, "--svg is for scenes in space"),
    ] {
        let (found, told) = run(arguments, path);
        assert!(found == code && told.contains(expected), "{arguments:?}: {found} {told}");
    }
    assert!(!path.join("none.toml").exists() && !path.join("none.svg").exists());
}
