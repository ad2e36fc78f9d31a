//! Scenes that nobody would write, and some that somebody will: solved, or refused with a typed error. Never a panic, a
//! hang or unbounded memory.

use model_offline::discretization::nodes::graded::{Grading, InterfaceFit, graded_nodes};
use model_offline::discretization::{Integration, Resolution};
use model_offline::model::{ModelError, TissueModel};
use model_offline::placement::rest::rest_responses;
use model_offline::scene::{BUNDLED, Scene};
use proptest::prelude::*;

fn paper() -> &'static str {
    BUNDLED[0].1
}

/// The paper's scene with one piece of its text replaced.
fn with(from: &str, to: &str) -> String {
    assert!(paper().contains(from), "{from}");
    paper().replacen(from, to, 1)
}

/// Parses and, when the scene is accepted, models it; both may refuse, neither may panic.
fn attempt(text: &str) -> Result<Result<Vec<f64>, ModelError>, String> {
    let scene = Scene::parse(text, "fuzz.toml").map_err(|e| e.to_string())?;
    Ok(TissueModel::new(&scene)
        .and_then(|m| rest_responses(&m))
        .map(|r| r.iter().map(|r| r.controllability_measure).collect()))
}

const OUTLINE: &str = "[[0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.5]]";

#[test]
fn degenerate_polygons_are_refused() {
    for outline in [
        "[]",
        "[[0.0, 0.0]]",
        "[[0.0, 0.0], [1.0, 1.0]]",
        "[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]",
        "[[0.5, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.5]]",
        "[[0.5, 0.0], [1.0, 0.0], [1.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.5]]",
    ] {
        let error = attempt(&with(OUTLINE, outline)).unwrap_err();
        assert!(error.contains("fuzz.toml:"), "{error}");
    }
}

#[test]
fn ten_thousand_vertices_are_read_and_modelled() {
    // A circle: every vertex is a node, and the paddles' polyline is on its lower left.
    let n = 10_000;
    let at = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / n as f64;
        [0.5 + 0.5 * angle.cos(), 0.5 + 0.5 * angle.sin()]
    };
    let outline: Vec<[f64; 2]> = (0..n).map(at).collect();
    let path = |from: usize, to: usize| (from..=to).map(at).collect::<Vec<_>>();
    let text = format!(
        "[scene]\nname = \"circle\"\ndimension = 2\n[domain]\noutline = {outline:?}\n[material]\nmodel = \"linear\"\nlambda = 383.0\nmu = 318.5\n\
         [immobile]\npaths = [{:?}]\n[needle]\ncontact = {:?}\naxis = [0.0, -1.0]\ndepth = 0.05\n[target]\nposition = [0.5, 0.5]\n\
         [[paddle]]\nindex = 1\nsegment = {:?}\n[discretization]\nspacing = 0.1\n",
        path(0, 400),
        path(2490, 2510),
        [at(6000), at(6001)]
    );
    let parsed = Scene::parse(&text, "circle.toml").unwrap();
    assert_eq!(parsed.outline.vertices().len(), n);
    let mut scene = parsed;
    scene.discretization.method.integration = Integration::FemT3;
    let model = TissueModel::new(&scene).unwrap();
    assert!(model.nodes() > n, "every vertex is a node");
    let area: f64 = model.cells().iter().map(|cell| cell.area).sum();
    assert!((area - std::f64::consts::PI / 4.0).abs() < 1e-6, "{area}");
    assert!(rest_responses(&model).unwrap()[0].controllability_measure.is_finite());
}

#[test]
fn inclusions_may_touch_and_cross_the_outline() {
    for inclusion in [
        "[[0.9, 0.2], [1.0, 0.2], [1.0, 0.5], [0.9, 0.5]]",
        "[[0.8, 0.2], [1.4, 0.2], [1.4, 0.5], [0.8, 0.5]]",
        "[[-1.0, -1.0], [2.0, -1.0], [2.0, 2.0], [-1.0, 2.0]]",
        "[[0.45, 0.45], [0.55, 0.45], [0.55, 0.55], [0.45, 0.55]]",
    ] {
        let text = with("[[0.55, 0.25], [0.75, 0.25], [0.75, 0.45], [0.55, 0.45]]", inclusion);
        let measures = attempt(&text).unwrap().unwrap();
        assert!(measures.iter().all(|m| m.is_finite() && *m > 0.5), "{inclusion}: {measures:?}");
    }
    // Everything covered a hundredfold is the homogeneous body again: displacements do not feel a common factor.
    let all = attempt(&with(
        "[[0.55, 0.25], [0.75, 0.25], [0.75, 0.45], [0.55, 0.45]]",
        "[[-1.0, -1.0], [2.0, -1.0], [2.0, 2.0], [-1.0, 2.0]]",
    ))
    .unwrap()
    .unwrap();
    let none =
        rest_responses(&TissueModel::new(&Scene::bundled("paper").unwrap().without_inclusions()).unwrap()).unwrap();
    for (a, b) in all.iter().zip(&none) {
        assert!((a / b.controllability_measure - 1.0).abs() < 1e-9);
    }
}

#[test]
fn stiffness_from_a_millionth_to_a_million_is_solved() {
    for stiffness in ["1e-6", "1e-3", "1.0", "1e3", "1e6"] {
        let measures = attempt(&with("stiffness = 100.0", &format!("stiffness = {stiffness}"))).unwrap().unwrap();
        assert!(measures.iter().all(|m| (1.0..20.0).contains(m)), "{stiffness}: {measures:?}");
    }
    for stiffness in ["0.0", "-1.0", "inf", "nan"] {
        assert!(attempt(&with("stiffness = 100.0", &format!("stiffness = {stiffness}"))).is_err());
    }
}

#[test]
fn a_target_on_the_free_boundary_is_fine_and_on_an_immobile_one_is_refused() {
    assert!(attempt(&with("position = [0.5, 0.5]", "position = [0.0, 0.8]")).unwrap().is_ok());
    assert!(attempt(&with("position = [0.5, 0.5]", "position = [1.0, 0.5]")).unwrap_err().contains("immobile"));
    assert!(attempt(&with("position = [0.5, 0.5]", "position = [0.5, 1.0]")).unwrap_err().contains("needle"));
}

#[test]
fn a_target_on_a_paddle_is_moved_by_it_alone() {
    // Rigidly attached: J is the identity, and its measure is 1.
    let measures = attempt(&with("position = [0.5, 0.5]", "position = [0.25, 0.25]")).unwrap().unwrap();
    assert!((measures[1] - 1.0).abs() < 1e-6, "{measures:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_refused_with_a_position(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let error = Scene::parse(&String::from_utf8_lossy(&bytes), "fuzz.toml").unwrap_err();
        prop_assert!(error.line >= 1 && error.column >= 1);
    }

    #[test]
    fn mutilated_scenes_never_panic(cut in 0..2200_usize, length in 0..60_usize, filler in "[0-9.,\\[\\]a-z= \n-]{0,12}") {
        let text = paper();
        let (a, b) = (cut.min(text.len()), (cut + length).min(text.len()));
        if text.is_char_boundary(a) && text.is_char_boundary(b) {
            let _ = attempt(&format!("{}{filler}{}", &text[..a], &text[b..]));
        }
    }

    #[test]
    fn random_outlines_are_solved_or_refused(points in proptest::collection::vec((0.0..1.0_f64, 0.0..1.0_f64), 3..9)) {
        let outline = format!("{:?}", points.iter().map(|p| [p.0, p.1]).collect::<Vec<_>>());
        let _ = attempt(&with(OUTLINE, &outline));
    }

    #[test]
    fn random_targets_are_solved_or_refused(x in -0.2..1.2_f64, y in -0.2..1.2_f64) {
        match attempt(&with("position = [0.5, 0.5]", &format!("position = [{x}, {y}]"))) {
            // Infinite where a paddle cannot control the target, as some cannot that is next to what is held.
            Ok(Ok(measures)) => prop_assert!(measures.iter().all(|m| *m > 0.0)),
            Ok(Err(error)) => prop_assert!(!error.to_string().is_empty()),
            Err(error) => prop_assert!(error.contains("fuzz.toml:")),
        }
    }

    #[test]
    fn the_node_generator_never_makes_two_nodes_of_one(
        coarsest in 0.03..0.3_f64, ratio in 0.01..1.0_f64, slope in 0.2..1.0_f64, interface in 0.01..0.3_f64, on in any::<bool>(),
    ) {
        let scene = Scene::bundled("paper").unwrap();
        let fit = if on { InterfaceFit::On } else { InterfaceFit::Between };
        let grading = Grading { coarsest, finest: coarsest * ratio, slope, interface: interface.min(coarsest), narrow: 0.5, fit };
        let nodes = graded_nodes(&scene.features(), &grading);
        prop_assert!(nodes.len() < 200_000);
        let cells = model_offline::discretization::cells::nodal_cells::clipped_voronoi(&nodes, &scene.outline).unwrap();
        let area: f64 = cells.iter().map(|c| c.area).sum();
        prop_assert!((area - scene.outline.area()).abs() < 1e-9);
        prop_assert!(cells.iter().all(|c| c.area > 0.0));
    }

    #[test]
    fn any_spacing_and_support_is_solved_or_refused(spacing in 0.02..0.4_f64, support in 1.0..4.0_f64) {
        let mut scene = Scene::bundled("paper").unwrap();
        scene.discretization.resolution = Resolution::Spacing(spacing);
        scene.discretization.method.support = support;
        match TissueModel::new(&scene).and_then(|m| rest_responses(&m)) {
            Ok(r) => prop_assert!(r.iter().all(|r| r.controllability_measure.is_finite())),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
