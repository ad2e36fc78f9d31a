//! Scenes of many kinds, none of which the methods were tuned on: slabs, notches, slots, inner needles, thin parts,
//! inclusions on the edge, inner corners, other units, origins far away, paddles that hardly control the target. The default rule reaches 1 % on all of them, and its
//! estimated errors hold against quadratic triangles refined until they leave next to nothing open.

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::placement::adaptive::discretise;
use model_offline::placement::{PlacementOptions, place};
use model_offline::scene::Scene;
use tests::estimates::{Outcome, PaddleOutcome, SCENES, TOLERANCE, outcome};

/// Errors smaller than this share of the tolerance come about by accident: no estimate is three times them at most.
const ACCIDENT: f64 = 0.1;

fn check(text: &str) {
    let Outcome { nodes, estimate, paddles, reference_nodes, open } = outcome(text).unwrap();
    println!("truth: {reference_nodes} nodes leave {:.3} % open", 100.0 * open);
    println!("{nodes} nodes, level {}, estimated {:.3} %", estimate.level, 100.0 * estimate.controllability);
    for PaddleOutcome { measure, estimated, truth } in &paddles {
        let effectivity = estimated / truth;
        println!(
            "  ‖J⁻¹n‖ {measure:8.3}: estimated {:.3} %, true {:.3} %, effectivity {effectivity:.2}",
            100.0 * estimated,
            100.0 * truth
        );
    }
    for PaddleOutcome { measure, estimated, truth } in paddles {
        assert!(truth <= TOLERANCE, "‖J⁻¹n‖ = {measure}: wrong by {truth}");
        assert!(
            estimated <= TOLERANCE && truth - open <= estimated,
            "‖J⁻¹n‖ = {measure}: {truth} true, {estimated} estimated"
        );
        if truth > ACCIDENT * TOLERANCE {
            assert!(estimated <= 3.0 * (truth + open), "‖J⁻¹n‖ = {measure}: {truth} true, {estimated} estimated");
        }
    }
}

/// A lopsided body whose corner lies there.
fn lopsided(at: [f64; 2], integration: Integration) -> Scene {
    let point = |x: f64, y: f64| format!("[{:?}, {:?}]", at[0] + x, at[1] + y);
    let points = |points: &[[f64; 2]]| {
        let points: Vec<String> = points.iter().map(|[x, y]| point(*x, *y)).collect();
        format!("[{}]", points.join(", "))
    };
    let text = format!(
        r#"
        scene = {{ name = "lopsided", dimension = 2, units = {{ length = "1", stress = "1" }} }}
        domain.outline = {outline}
        material = {{ model = "neo-hookean", lambda = 4.0, mu = 1.0 }}
        inclusion = [{{ outline = {inclusion}, stiffness = 5.0 }}]
        immobile.paths = [{immobile}]
        needle = {{ contact = {contact}, axis = [1.0, 0.0], depth = 0.1, increments = 2 }}
        target.position = {target}
        paddle = [{{ index = 1, segment = {first} }}, {{ index = 3, segment = {second} }}]
        discretization = {{ spacing = 0.12 }}
        "#,
        outline = points(&[[0.0, 0.0], [2.1, -0.2], [2.4, 0.9], [1.5, 1.6], [0.0, 1.4]]),
        inclusion = points(&[[0.9, 0.5], [1.3, 0.45], [1.35, 0.85], [0.95, 0.9]]),
        immobile = points(&[[0.0, 0.0], [2.1, -0.2]]),
        contact = points(&[[0.0, 0.6], [0.0, 0.9]]),
        target = point(1.0, 0.62),
        first = points(&[[2.16, 0.02], [2.28, 0.46]]),
        second = points(&[[1.2, 1.56], [0.6, 1.48]]),
    );
    let mut scene = Scene::parse(&text, "lopsided").unwrap();
    scene.discretization.method = Method::new(integration);
    scene
}

/// Where the body lies is no part of the answer. On even nodes four cells meet in one corner, which far from the origin is four
/// that lie apart by rounding.
#[test]
fn a_body_far_from_the_origin_is_the_same_body() {
    for integration in [Integration::ScniStabilised, Integration::Mscni, Integration::Scni, Integration::FemT6] {
        let found = |at: [f64; 2]| {
            let (model, _) = discretise(&lopsided(at, integration)).unwrap();
            let study = place(&model, &PlacementOptions::default()).unwrap();
            let held = study.no_paddle.static_study.orthogonal;
            let moved = study.paddles.iter().map(|paddle| paddle.controllability_measure);
            moved.chain(held).collect::<Vec<f64>>()
        };
        let here = found([0.0, 0.0]);
        assert_eq!(here.len(), 4, "{integration:?}: {here:?}");
        for at in [[200.0, 0.0], [800.0, -560.0], [1e4, -7e3]] {
            let there = found(at);
            for (here, there) in here.iter().zip(&there) {
                assert!((there / here - 1.0).abs() < 1e-5, "{integration:?} {at:?}: {here} {there}");
            }
        }
    }
}

/// The scene of this description.
fn scene(named: &str) -> &'static str {
    SCENES.iter().find(|(name, _)| *name == named).expect("one of the scenes").1
}

macro_rules! scenes {
    ($($name:ident: $scene:literal),+ $(,)?) => {$(
        #[test]
        fn $name() {
            check(scene($scene));
        }
    )+};
}

scenes! {
    a_slab_far_from_the_origin: "a slab far from the origin",
    a_notch: "a notch",
    a_slot: "a slot",
    an_inner_needle: "an inner needle",
    inclusions_on_the_edge: "inclusions on the edge",
    paddles_far_from_the_target: "paddles far from the target",
    an_ell: "an L",
    two_blocks_joined_by_a_neck: "two blocks joined by a neck",
    an_ell_bent_round_its_corner: "an L bent round its corner",
    an_ell_whose_short_arm_is_held: "an L whose short arm is held",
    a_tall_ell_with_an_inclusion_deep_inside: "a tall L, an inclusion inside",
    a_disc_whose_paddles_hardly_control_the_target: "a disc, hardly controlled",
}

/// Nodes along a thin layer follow its width and its length: as near as its ends ask for, all along, none of these would end.
#[test]
fn a_thin_layer() {
    check(include_str!("../../scenes/layer.toml"));
}

/// A band that is 9 times as long as wide and 10,000 times as stiff as what is around it asks for near nodes all along.
#[test]
fn a_stiff_band() {
    let mut scene = Scene::bundled("tethered").unwrap();
    scene.discretization.method = Method::new(Integration::ScniStabilised);
    scene.discretization.resolution = Resolution::Tolerance(TOLERANCE);
    let (_, estimate) = discretise(&scene).unwrap();
    assert!(estimate.unwrap().controllability <= TOLERANCE);
}

/// Where a Jacobian is all but singular, two meshes agree on ‖J⁻¹n‖ by accident.
#[test]
fn quadratic_triangles_on_that_disc() {
    let text = scene("a disc, hardly controlled");
    check(&text.replace("[discretization]", "[discretization]\nintegration = \"fem-t6\""));
}
