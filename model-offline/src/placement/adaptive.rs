//! Refinement to a tolerance: no node more than the controllability measures need.
//!
//! The error of a model is estimated against an *independent* method: quadratic triangles refined where the answers ask
//! for it, with an error that nested meshes certify (see the module `goal_oriented`). Nodes of other methods are graded
//! towards the singular points; where their distance to that, with what it leaves open, is not within the tolerance, they are
//! set as close as the triangles' solution says that the answers need them (see the module `curvature`), and closer, level by
//! level. Quadratic triangles themselves are judged by the mesh in which each of them is cut into four.

use super::curvature::spacing_for;
use super::goal_oriented::{Asked, Refinement};
use super::reference::Reference;
use super::rest::{RestResponse, rest_responses};
use crate::discretization::nodes::graded::{MAX_LEVEL, MIN_LEVEL};
use crate::discretization::{Integration, Resolution};
use crate::model::{DecidedBy, Faster, ModelError, TissueModel, graded_model, sized_model};
use crate::scene::Scene;
use serde::Serialize;

/// From this tolerance on, refinement starts at the coarsest level; below it, the coarsest levels could only agree by
/// accident.
const LOOSE: f64 = 0.03;
/// What sized nodes aim at when they are set again, over what the estimate says would do; and what is aimed at, at least and
/// at most, over what was before: nodes grow up to fourfold at once.
const SAFETY: f64 = 0.7;
const SMALLEST_STEP: f64 = 0.25;
const LARGEST_STEP: f64 = 0.8;
/// What is aimed at when that takes too many nodes, over what was.
const EASE: f64 = 1.1;
/// Share of the tolerance that the reference may leave open.
const REFERENCE_SHARE: f64 = 0.25;
/// The same where an accepted model's errors drown in it.
const TELLING_SHARE: f64 = 0.12;
/// The same where that decides.
const SHARP_SHARE: f64 = 0.08;

/// What a refinement found out about its own error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorEstimate {
    /// Estimated worst relative error of the controllability measures that [count](Reference::counts).
    pub controllability: f64,
    /// Estimated worst error of the small-depth target displacement, over the largest one.
    pub target_displacement: f64,
    /// The part of both that the reference solution leaves open.
    pub reference: f64,
    /// Nodes of the reference solution.
    pub reference_nodes: usize,
    /// Refinement level that was accepted.
    pub level: i32,
}

impl ErrorEstimate {
    fn of(responses: &[RestResponse], reference: &Reference, level: i32) -> Self {
        let (_, target_displacement) = reference.distance(responses);
        Self {
            controllability: reference.worst_error(responses),
            target_displacement: target_displacement + reference.open_displacement(),
            reference: reference.open,
            reference_nodes: reference.nodes,
            level,
        }
    }

    fn worst(&self) -> f64 {
        self.controllability.max(self.target_displacement)
    }

    /// Whose error is the worst.
    fn decided_by(&self, scene: &Scene, responses: &[RestResponse], reference: &Reference) -> DecidedBy {
        let paddles = scene.paddles.iter().map(|paddle| vec![paddle.index]).zip(reference.errors(responses));
        let known = paddles.zip(reference.counts(responses)).filter(|(_, counts)| *counts).map(|(paddle, _)| paddle);
        DecidedBy::measures(known, Some(self.target_displacement))
    }
}

/// A discretised scene, and what is known of its error already.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The model.
    pub model: TissueModel,
    /// Its estimated error, where the scene asks for a tolerance.
    pub estimate: Option<ErrorEstimate>,
    /// What it was judged by, where the scene asks for a tolerance.
    pub reference: Option<Reference>,
}

/// Discretises a scene at its spacing, or refines it to its tolerance.
///
/// # Errors
/// [`ModelError`], among them [`ModelError::ToleranceNotReached`] with the estimate that was reached.
pub fn discretise(scene: &Scene) -> Result<(TissueModel, Option<ErrorEstimate>), ModelError> {
    discretise_judged(scene).map(|judged| (judged.model, judged.estimate))
}

/// The same with what the model was judged by.
///
/// # Errors
/// As for [`discretise`].
pub fn discretise_judged(scene: &Scene) -> Result<Judged, ModelError> {
    match scene.discretization.resolution {
        Resolution::Tolerance(tolerance) => refine(scene, tolerance),
        Resolution::Spacing(_) | Resolution::Level(_) => {
            Ok(Judged { model: TissueModel::new(scene)?, estimate: None, reference: None })
        }
    }
}

/// The model on which to follow the insertion to depth, for a model refined to a tolerance: itself while it is small,
/// else the coarsest graded one, if that is smaller. With the paper's law the finite-depth profile has no mesh limit (finer nodes resolve
/// the needle's edge better and lose stability earlier), so refining it buys nothing.
///
/// # Errors
/// [`ModelError`] as for any model.
pub fn profile_model(model: &TissueModel) -> Result<TissueModel, ModelError> {
    if model.nodes() <= PROFILE_NODES {
        return Ok(model.clone());
    }
    let graded = graded_model(model.scene(), model.planar().method(), 0)?;
    // Gradings do not know what is asked for: in a body of many details the answers may need fewer nodes.
    Ok(if graded.nodes() < model.nodes() { graded } else { model.clone() })
}

/// Largest model on which the finite-depth profile is followed.
const PROFILE_NODES: usize = 1500;

/// Refines until the measures of all paddles are within the tolerance; where that is not reached, without those that cannot hold
/// the target and stand in the way, then without all that cannot.
fn refine(scene: &Scene, tolerance: f64) -> Result<Judged, ModelError> {
    let is_elements = scene.discretization.method.integration == Integration::FemT6;
    let refine = if is_elements { refine_elements } else { refine_nodes };
    let mut all = Refinement::new(scene, Asked::All)?;
    // What the triangles do not know themselves, no nodes can be held against.
    let is_known = is_elements || Reference::sharpened(&mut all, REFERENCE_SHARE * tolerance)?.open <= tolerance;
    let mut refused = None;
    if is_known || all.without_unable(tolerance).is_none() {
        match refine(&mut all, scene, tolerance) {
            Err(error @ ModelError::ToleranceNotReached { .. }) => refused = Some(error),
            judged => return judged,
        }
    }
    let mut others: Vec<Asked> = [tolerance, 0.0].into_iter().filter_map(|most| all.without_unable(most)).collect();
    others.dedup();
    for asked in others {
        match refine(&mut Refinement::new(scene, asked)?, scene, tolerance) {
            Err(error @ ModelError::ToleranceNotReached { .. }) => refused = Some(error),
            judged => return judged,
        }
    }
    refused.map_or_else(|| refine(&mut all, scene, tolerance), Err)
}

fn refine_nodes(refinement: &mut Refinement, scene: &Scene, tolerance: f64) -> Result<Judged, ModelError> {
    let method = scene.discretization.method;
    let mut reference = Reference::sharpened(refinement, REFERENCE_SHARE * tolerance)?;
    let mut best: Option<ErrorEstimate> = None;
    let (mut decided_by, mut memory) = (DecidedBy::Whole, None);
    let mut level = first_level(tolerance);
    let (mut aim, mut aimed) = (tolerance, f64::INFINITY);
    while level <= MAX_LEVEL {
        // Gradings know no better where nodes are needed; the answers do.
        let present = refinement.present().filter(|_| best.is_some());
        let is_sized = present.is_some();
        let built = match present {
            Some((mesh, certified)) => {
                sized_model(scene, method, level, |slope| spacing_for(aim, mesh, certified, slope))
            }
            None => graded_model(scene, method, level),
        };
        let model = match built {
            Ok(model) => model,
            // The finest that can be afforded is between this and what was tried.
            Err(error) if error.is_too_large() && is_sized && aim * EASE < LARGEST_STEP * aimed => {
                aim *= EASE;
                continue;
            }
            Err(error) if error.is_too_large() && best.is_some() => {
                memory = error.missing_memory();
                break;
            }
            Err(error) => return Err(error),
        };
        let responses = match rest_responses(&model) {
            Err(error) if error.is_too_large() && best.is_some() => {
                memory = error.missing_memory();
                break;
            }
            responses => responses?,
        };
        let mut estimate = ErrorEstimate::of(&responses, &reference, level);
        if estimate.worst() > tolerance
            && estimate.worst() - reference.open <= tolerance
            && reference.open > SHARP_SHARE * tolerance
        {
            // What the reference leaves open decides: sharpening it costs less than another level, and serves all to come.
            reference = Reference::sharpened(refinement, SHARP_SHARE * tolerance)?;
            estimate = ErrorEstimate::of(&responses, &reference, level);
        }
        if estimate.worst() <= tolerance && !reference.tells(&responses, SHARP_SHARE * tolerance) {
            // Enough to accept, but not to say how far off each paddle is.
            reference = Reference::sharpened(refinement, TELLING_SHARE * tolerance)?;
            estimate = ErrorEstimate::of(&responses, &reference, level);
        }
        // What is now known better may be too much.
        if estimate.worst() <= tolerance {
            return Ok(Judged { model, estimate: Some(estimate), reference: Some(reference) });
        }
        level += 1;
        if best.is_some() {
            // The sized nodes fell short.
            aimed = aim;
            aim *= (SAFETY * tolerance / estimate.worst()).clamp(SMALLEST_STEP, LARGEST_STEP);
        }
        if best.is_none_or(|b| estimate.worst() < b.worst()) {
            best = Some(estimate);
            decided_by = estimate.decided_by(scene, &responses, &reference);
        }
    }
    let reached = best.map_or(f64::INFINITY, |b| b.worst());
    let faster = Some(Box::new(Faster { integration: Integration::FemT6, keeps: false }));
    Err(ModelError::ToleranceNotReached { tolerance, reached, decided_by, memory, faster })
}

fn first_level(tolerance: f64) -> i32 {
    if tolerance >= LOOSE { MIN_LEVEL } else { 0 }
}

/// Refines quadratic triangles where the answers ask for it; they need no other reference.
fn refine_elements(refinement: &mut Refinement, scene: &Scene, tolerance: f64) -> Result<Judged, ModelError> {
    let mut level = MIN_LEVEL - 1;
    let mut estimate = None;
    let mut decided_by = DecidedBy::Whole;
    let (certified, reached) = refinement.until(|certified| {
        level += 1;
        let reference = Reference::from_certified(certified);
        let found = ErrorEstimate::of(&certified.responses, &reference, level);
        decided_by = found.decided_by(scene, &certified.responses, &reference);
        estimate = Some(found);
        found.worst() <= tolerance
    })?;
    if !reached {
        let reached = estimate.map_or(f64::INFINITY, |e| e.worst());
        return Err(ModelError::ToleranceNotReached { tolerance, reached, decided_by, memory: None, faster: None });
    }
    let reference = Some(Reference::from_certified(certified));
    let model = TissueModel::on(scene, certified.model.planar().clone(), certified.model.spacing())?;
    Ok(Judged { model, estimate, reference })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Integration, Method};

    /// A smaller tolerance takes more rounds of refinement and more nodes, and the round is what is told.
    #[test]
    fn the_level_counts_rounds_of_refinement() {
        let found = [0.2, 0.01].map(|tolerance| {
            let mut scene = Scene::bundled("paper").unwrap().without_inclusions();
            scene.discretization.method = Method::new(Integration::FemT6);
            scene.discretization.resolution = Resolution::Tolerance(tolerance);
            let judged = discretise_judged(&scene).unwrap();
            let estimate = judged.estimate.unwrap();
            assert!(estimate.worst() <= tolerance && estimate.level >= MIN_LEVEL, "{estimate:?}");
            (estimate.level, judged.model.nodes())
        });
        let [(loose, few), (tight, many)] = found;
        assert!(tight > loose && many > few, "{found:?}");
    }

    /// Two paddles of a body with a notch.
    const PADDLES: [(u32, &str); 2] = [(2, "[[0.12, 0.015], [0.12, 0.04]]"), (3, "[[0.025, 0.08], [0.04, 0.08]]")];

    fn concave(paddles: &[(u32, &str)], [x, y]: [f64; 2], tolerance: f64, integration: Integration) -> Judged {
        let paddles: String =
            paddles.iter().map(|(index, at)| format!("[[paddle]]\nindex = {index}\nsegment = {at}\n")).collect();
        let text = format!(
            r#"
            scene = {{ name = "concave", dimension = 2, units = {{ length = "m", stress = "kPa" }} }}
            domain.outline = [[0, 0], [0.12, 0], [0.12, 0.05], [0.1, 0.08], [0.075, 0.08], [0.06, 0.055], [0.045, 0.08], [0.02, 0.08], [0, 0.05]]
            material = {{ model = "neo-hookean", lambda = 4.0, mu = 1.0 }}
            immobile.paths = [[[0, 0], [0.12, 0]]]
            needle = {{ contact = [[0.095, 0.08], [0.08, 0.08]], axis = [0.0, -1.0], depth = 0.006, increments = 10 }}
            target.position = [{x}, {y}]
            discretization = {{ tolerance = {tolerance}, integration = "{integration}" }}
            {paddles}"#
        );
        discretise_judged(&Scene::parse(&text, "concave.toml").unwrap()).unwrap()
    }

    /// Two meshes of some 900 nodes agree to 1 % on the second paddle here, and are 10 % off: the limit went by 6 % to get there. The
    /// truth is that of the paddle in a scene of its own, whose meshes are others.
    #[test]
    fn what_agrees_by_accident_is_not_believed() {
        let at = [0.08132, 0.03342];
        let alone = concave(&PADDLES[1..], at, 0.002, Integration::FemT6);
        let truth = rest_responses(&alone.model).unwrap()[0].controllability_measure;
        for integration in [Integration::FemT6, Integration::ScniStabilised] {
            let both = concave(&PADDLES, at, 0.05, integration);
            let responses = rest_responses(&both.model).unwrap();
            let told = both.reference.unwrap().errors(&responses)[1];
            let off = (responses[1].controllability_measure / truth - 1.0).abs();
            assert!(told <= 0.05 && off < told, "{integration}: {off} of {told}");
        }
    }

    /// A paddle that moves the target in one direction only, or all but: its measure asks for no nodes. Its own error is told all
    /// the same, beside the estimate of what is accepted.
    #[test]
    fn what_no_table_can_be_made_of_asks_for_no_nodes() {
        let [good, useless] = PADDLES;
        for integration in [Integration::FemT6, Integration::ScniStabilised] {
            let [alone, both] =
                [&[good][..], &[good, useless]].map(|paddles| concave(paddles, [0.088, 0.04], 0.02, integration));
            let responses = rest_responses(&both.model).unwrap();
            let (reference, estimate) = (both.reference.unwrap(), both.estimate.unwrap());
            assert_eq!(reference.counts(&responses), [true, false], "{integration}");
            let errors = reference.errors(&responses);
            assert!(estimate.controllability <= 0.02, "{integration}: {estimate:?}");
            assert!(
                (errors[0] / estimate.controllability - 1.0).abs() < 1e-6,
                "{integration}: {errors:?} {estimate:?}"
            );
            assert!(errors[1] > 0.1, "{integration}: {errors:?}");
            // What it takes to be sure that it is useless is not much beside what it would take to know its measure.
            let (few, many) = (alone.model.nodes(), both.model.nodes());
            assert!(many < 12 * few, "{integration}: {many} nodes, {few} without it");
            // What the judged model takes for usable counts, whatever the limit says.
            let taken = [responses[0], RestResponse { jacobian: responses[0].jacobian, ..responses[1] }];
            assert_eq!(reference.counts(&taken), [true, true], "{integration}");
        }
    }

    /// At 0.01 the measure of the useless paddle is known to a tenth here, and not to the tolerance.
    #[test]
    fn what_is_reached_at_one_tolerance_is_at_every_larger_one() {
        for y in [0.0396, 0.0402] {
            let at = |tolerance| concave(&PADDLES, [0.088, y], tolerance, Integration::FemT6);
            let truth = concave(&PADDLES[..1], [0.088, y], 0.001, Integration::FemT6);
            let truth = rest_responses(&truth.model).unwrap()[0].controllability_measure;
            let whose = [0.05, 0.01, 0.005].map(|tolerance| {
                let judged = at(tolerance);
                let responses = rest_responses(&judged.model).unwrap();
                let told = judged.estimate.unwrap().controllability;
                let off = (responses[0].controllability_measure / truth - 1.0).abs();
                assert!(told <= tolerance && off < told, "{y} {tolerance}: {off} of {told}");
                judged.reference.unwrap().counts(&responses)
            });
            assert_eq!(whose[1..], [vec![true, false], vec![true, false]], "{y}");
        }
    }

    /// The third paddle of a strip moves the target, which is at the other end, along one line and hardly at all: its measure asks
    /// for nodes that nobody has. The truth is that of a paddle in a scene of its own.
    #[test]
    fn what_cannot_hold_the_target_does_not_cost_the_tolerance_of_what_can() {
        let strip = |paddles: &[[f64; 4]]| {
            let body = "[0.0, 0.0], [160.0, 0.0], [160.0, 20.0], [0.0, 20.0]";
            scene_of(body, "[0.0, 0.0], [160.0, 0.0]", [104.0, 56.0, 20.0], [20.0, 4.0], paddles)
        };
        let at = [[0.0, 16.0, 0.0, 4.0], [50.4, 20.0, 22.4, 20.0], [109.6, 20.0, 137.6, 20.0]];
        let judged = discretise_judged(&strip(&at)).unwrap();
        let responses = rest_responses(&judged.model).unwrap();
        let reference = judged.reference.unwrap();
        assert!(judged.estimate.unwrap().worst() <= 0.02);
        assert_eq!(reference.counts(&responses), [true, true, false]);
        for place in [0, 1] {
            let mut alone = strip(&at[place..=place]);
            alone.discretization.resolution = Resolution::Tolerance(0.002);
            let alone = discretise_judged(&alone).unwrap();
            let truth = rest_responses(&alone.model).unwrap()[0].controllability_measure;
            let off = (responses[place].controllability_measure / truth - 1.0).abs();
            assert!(off < reference.errors(&responses)[place] + 0.002, "{place}: {off}");
        }
        // What the judged model takes for able counts, whatever the limit says.
        assert_eq!(reference.counts(&[responses[0], responses[1], responses[1]]), [true; 3]);
    }

    /// A body in mm, held along a line, with a needle from the right to the left of a height, down by 1.4.
    fn scene_of(body: &str, held: &str, needle: [f64; 3], [x, y]: [f64; 2], paddles: &[[f64; 4]]) -> Scene {
        let paddle = |(place, [ax, ay, bx, by]): (usize, &[f64; 4])| {
            format!("[[paddle]]\nindex = {}\nsegment = [[{ax:?}, {ay:?}], [{bx:?}, {by:?}]]\n", place + 1)
        };
        let paddles: String = paddles.iter().enumerate().map(paddle).collect();
        let [right, left, top] = needle;
        let text = format!(
            r#"
            scene = {{ name = "body", dimension = 2, units = {{ length = "mm", stress = "kPa" }} }}
            domain.outline = [{body}]
            material = {{ model = "neo-hookean", lambda = 4.0, mu = 1.0 }}
            immobile.paths = [[{held}]]
            needle = {{ contact = [[{right:?}, {top:?}], [{left:?}, {top:?}]], axis = [0.0, -1.0], depth = 1.4, increments = 5 }}
            target.position = [{x:?}, {y:?}]
            discretization = {{ tolerance = 0.02, integration = "fem-t6" }}
            {paddles}"#
        );
        Scene::parse(&text, "body.toml").unwrap()
    }

    /// A strip so long and thin that even the first nodes are too many: they are made once, and what is too many is said.
    #[test]
    fn what_takes_too_many_nodes_at_once_is_refused_at_once() {
        let (middle, length) = (3000.0, 6000.0);
        let held: Vec<String> = (0..600)
            .map(|k| 10.0 * f64::from(k))
            .filter(|x| (x - middle).abs() > 20.0)
            .map(|x| format!("[[{x:?}, 0.0], [{:?}, 0.0]]", x + 1.0))
            .collect();
        let text = format!(
            r#"
            scene = {{ name = "strip", dimension = 2, units = {{ length = "mm", stress = "kPa" }} }}
            domain.outline = [[0.0, 0.0], [{length:?}, 0.0], [{length:?}, 5.0], [0.0, 5.0]]
            material = {{ model = "neo-hookean", lambda = 8.0, mu = 2.0 }}
            immobile.paths = [{}]
            needle = {{ contact = [[{:?}, 5.0], [{:?}, 5.0]], axis = [0.0, -1.0], depth = 0.5, increments = 5 }}
            target.position = [{:?}, 2.5]
            paddle = [{{ index = 1, segment = [[{:?}, 0.0], [{:?}, 0.0]] }}]
            discretization = {{ tolerance = 0.02 }}
            "#,
            held.join(", "),
            middle - 1.0,
            middle + 1.0,
            middle + 0.3,
            middle + 1.0,
            middle + 3.0,
        );
        let scene = Scene::parse(&text, "strip.toml").unwrap();
        let refused = discretise_judged(&scene).unwrap_err();
        assert!(matches!(refused, ModelError::TooManyNodes { .. }), "{refused}");
        let told = refused.to_string();
        assert!(told.contains("at most 40000") && told.contains("fem-t6"), "{told}");
    }
}
