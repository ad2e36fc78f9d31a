//! Scenes of many kinds, none of which the methods were tuned on: slabs, notches, slots, inner needles, thin parts,
//! inclusions on the edge, inner corners, other units, origins far away, paddles that hardly control the target. The default rule reaches 1 % on all of them, and its
//! estimated errors hold against quadratic triangles refined until they leave next to nothing open.

use model_offline::model::ModelError;
use model_offline::placement::adaptive::{ErrorEstimate, Judged, discretise_judged};
use model_offline::placement::reference::Reference;
use model_offline::placement::rest::{RestResponse, rest_responses};
use model_offline::scene::Scene;

const TOLERANCE: f64 = 0.01;
/// What the triangles may leave open, of the tolerance.
const BEYOND_DOUBT: f64 = 0.05;
/// Errors smaller than this share of the tolerance come about by accident: no estimate is three times them at most.
const ACCIDENT: f64 = 0.1;

struct Outcome {
    nodes: usize,
    estimate: ErrorEstimate,
    /// Estimated and true error, paddle by paddle, with the measure.
    paddles: Vec<(f64, f64, f64)>,
    /// What the truth itself leaves open.
    open: f64,
}

fn outcome(text: &str) -> Result<Outcome, ModelError> {
    let scene = Scene::parse(text, "scene").unwrap();
    let start = std::time::Instant::now();
    let Judged { model, estimate, reference } = discretise_judged(&scene)?;
    println!("{:.2} s", start.elapsed().as_secs_f64());
    let found = rest_responses(&model).unwrap();
    let truth = Reference::compute(&scene, BEYOND_DOUBT * TOLERANCE).unwrap();
    println!("truth: {} nodes leave {:.3} % open", truth.nodes, 100.0 * truth.open);
    let estimated = reference.unwrap().errors(&found);
    let off = found.iter().zip(truth.responses()).map(|(found, truth)| found.measure_distance(truth));
    let measures = found.iter().map(|r: &RestResponse| r.controllability_measure);
    let paddles = estimated.into_iter().zip(off).zip(measures).map(|((e, t), m)| (e, t, m)).collect();
    Ok(Outcome { nodes: model.nodes(), estimate: estimate.unwrap(), paddles, open: truth.open })
}

fn check(text: &str) {
    let Outcome { nodes, estimate, paddles, open } = outcome(text).unwrap();
    println!("{nodes} nodes, level {}, estimated {:.3} %", estimate.level, 100.0 * estimate.controllability);
    for (estimated, truth, measure) in &paddles {
        let effectivity = estimated / truth;
        println!(
            "  ‖J⁻¹n‖ {measure:8.3}: estimated {:.3} %, true {:.3} %, effectivity {effectivity:.2}",
            100.0 * estimated,
            100.0 * truth
        );
    }
    for (estimated, truth, measure) in paddles {
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

macro_rules! scenes {
    ($($name:ident: $file:literal),+ $(,)?) => {$(
        #[test]
        fn $name() {
            check(include_str!(concat!("../scenes/", $file, ".toml")));
        }
    )+};
}

scenes! {
    a_slab_far_from_the_origin: "slab-kpa",
    a_notch: "notch",
    a_slot: "slot",
    an_inner_needle: "inner-needle",
    inclusions_on_the_edge: "rib",
    paddles_far_from_the_target: "far",
    an_ell: "ell",
    two_blocks_joined_by_a_neck: "neck",
    an_ell_bent_round_its_corner: "ell-bent",
    an_ell_whose_short_arm_is_held: "ell-short-arm",
    a_tall_ell_with_an_inclusion_deep_inside: "ell-tall",
    a_disc_whose_paddles_hardly_control_the_target: "disc",
}

/// Where a Jacobian is all but singular, two meshes agree on ‖J⁻¹n‖ by accident.
#[test]
fn quadratic_triangles_on_that_disc() {
    let text = include_str!("../scenes/disc.toml");
    check(&text.replace("[discretization]", "[discretization]\nintegration = \"fem-t6\""));
}
