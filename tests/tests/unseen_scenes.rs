//! Scenes of many kinds, none of which the methods were tuned on: slabs, notches, slots, inner needles, thin parts,
//! inclusions on the edge, inner corners, other units, origins far away, paddles that hardly control the target. The default rule reaches 1 % on all of them, and its
//! estimated errors hold against quadratic triangles refined until they leave next to nothing open.

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::placement::adaptive::discretise;
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
    check(include_str!("../scenes/layer.toml"));
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
