//! Estimated beside true errors, on scenes that no method was tuned on.

use model_offline::model::ModelError;
use model_offline::placement::adaptive::{ErrorEstimate, Judged, discretise_judged};
use model_offline::placement::reference::Reference;
use model_offline::placement::rest::rest_responses;
use model_offline::scene::Scene;

/// Tolerance of all of these scenes, of the controllability measure.
pub const TOLERANCE: f64 = 0.01;
/// What the triangles that stand for the truth may leave open, of the tolerance.
const BEYOND_DOUBT: f64 = 0.05;

/// The scenes: what each is, and its text.
pub const SCENES: [(&str, &str); 12] = [
    ("a slab far from the origin", include_str!("../scenes/slab-kpa.toml")),
    ("a notch", include_str!("../scenes/notch.toml")),
    ("a slot", include_str!("../scenes/slot.toml")),
    ("an inner needle", include_str!("../scenes/inner-needle.toml")),
    ("inclusions on the edge", include_str!("../scenes/rib.toml")),
    ("paddles far from the target", include_str!("../scenes/far.toml")),
    ("an L", include_str!("../scenes/ell.toml")),
    ("two blocks joined by a neck", include_str!("../scenes/neck.toml")),
    ("an L bent round its corner", include_str!("../scenes/ell-bent.toml")),
    ("an L whose short arm is held", include_str!("../scenes/ell-short-arm.toml")),
    ("a tall L, an inclusion inside", include_str!("../scenes/ell-tall.toml")),
    ("a disc, hardly controlled", include_str!("../scenes/disc.toml")),
];

/// One paddle's controllability measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaddleOutcome {
    /// The measure, ‖J⁻¹n‖.
    pub measure: f64,
    /// Its estimated error, over itself.
    pub estimated: f64,
    /// Its true error, over itself.
    pub truth: f64,
}

/// A scene, discretised as its tolerance asks for and held against quadratic triangles refined until they leave next to
/// nothing open.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Nodes that the tolerance took.
    pub nodes: usize,
    /// The estimate over all paddles.
    pub estimate: ErrorEstimate,
    /// Paddle by paddle.
    pub paddles: Vec<PaddleOutcome>,
    /// Nodes of what stands for the truth.
    pub reference_nodes: usize,
    /// What the truth itself leaves open, over the measure.
    pub open: f64,
}

/// Tries one scene.
///
/// # Errors
/// As the discretisation's.
///
/// # Panics
/// When `text` is no scene, or has no tolerance.
pub fn outcome(text: &str) -> Result<Outcome, ModelError> {
    let scene = Scene::parse(text, "scene").expect("a scene");
    let Judged { model, estimate, reference } = discretise_judged(&scene)?;
    let found = rest_responses(&model)?;
    let truth = Reference::compute(&scene, BEYOND_DOUBT * TOLERANCE)?;
    let estimated = reference.expect("the scene has a tolerance").errors(&found);
    let paddles = found.iter().zip(truth.responses()).zip(estimated).map(|((found, truth), estimated)| PaddleOutcome {
        measure: found.controllability_measure,
        estimated,
        truth: found.measure_distance(truth),
    });
    Ok(Outcome {
        nodes: model.nodes(),
        estimate: estimate.expect("the scene has a tolerance"),
        paddles: paddles.collect(),
        reference_nodes: truth.nodes,
        open: truth.open,
    })
}
