//! From a scene to a placement, the one way that all commands go: discretise, refine if a tolerance is asked for, study every
//! paddle, and judge the answer. Who needs less stops earlier: [`model_with_paddle`] gives the model that the study would be
//! of, and the paddle that it would advise.

use super::accuracy::{Accuracy, accuracy};
use super::adaptive::{ErrorEstimate, Judged, discretise_judged};
use super::cross_check::{CrossCheck, cross_check};
use super::reference::Reference;
use super::rest::RestResponse;
use super::study::{PaddleResult, Placement, PlacementOptions, best_dynamic, place};
use super::verdict::verdict;
use crate::model::{ModelError, TissueModel};
use crate::scene::Scene;
use std::time::Instant;

/// A placement with everything that is known about it.
///
/// # Example
/// ```
/// use model_offline::placement::{PlacementOptions, PlacementStudy};
/// use model_offline::scene::Scene;
///
/// let scene = Scene::bundled("paper").expect("bundled").without_inclusions();
/// let study = PlacementStudy::run(&scene, &PlacementOptions::default())?;
/// assert_eq!((study.placement.optimum.static_paddle, study.placement.optimum.dynamic_paddle), (4, Some(3))); // the paper's optima
/// let accuracy = study.accuracy(1)?;
/// assert!(accuracy.errors.paddles.iter().all(|p| p.controllability_measure.is_some_and(|error| error < 0.5)));
/// # Ok::<(), model_offline::model::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PlacementStudy {
    /// The model that the Jacobians are of; tables are built on it too.
    pub model: TissueModel,
    /// What the study found.
    pub placement: Placement,
    /// Estimated error, where the scene asks for a tolerance.
    pub error_estimate: Option<ErrorEstimate>,
    /// Time that it took, s.
    pub wall_s: f64,
    reference: Option<Reference>,
}

/// What is known of a study's errors.
#[derive(Debug, Clone)]
pub struct StudyAccuracy {
    /// The errors, number by number.
    pub errors: Accuracy,
    /// The worst of them in a line for people; none where the study has estimated its own error.
    pub cross_check: Option<CrossCheck>,
    /// Indices of the paddles whose measures error estimate and cross-check leave out; see [`Reference::counts`].
    pub left_out: Vec<u32>,
    /// Nodes of the triangles that the numbers at rest are judged by.
    pub reference_nodes: usize,
}

/// What a reference may leave open, where the study asks for no tolerance.
const REFERENCE_OPEN: f64 = 0.01;

/// A scene's model and a paddle: the one that is asked for, else the best dynamic one.
///
/// # Errors
/// [`ModelError::NoSuchPaddle`], and [`ModelError`] when the scene cannot be modelled, its tolerance not be reached, or no paddle
/// controls the target.
pub fn model_with_paddle(scene: &Scene, asked: Option<u32>) -> Result<(TissueModel, u32), ModelError> {
    if let Some(index) = asked {
        scene.paddle_position(index)?;
    }
    let model = discretise_judged(scene)?.model;
    let paddle = asked.map_or_else(|| best_dynamic(&model), Ok)?;
    Ok((model, paddle))
}

impl PlacementStudy {
    /// Discretises the scene at its resolution and studies every paddle.
    ///
    /// # Errors
    /// [`ModelError`] when the scene cannot be modelled, its tolerance not be reached, or a Jacobian not be computed.
    pub fn run(scene: &Scene, options: &PlacementOptions<'_>) -> Result<Self, ModelError> {
        let start = Instant::now();
        let Judged { model, estimate: error_estimate, reference } = discretise_judged(scene)?;
        let placement = place(&model, options)?;
        Ok(Self { model, placement, error_estimate, wall_s: start.elapsed().as_secs_f64(), reference })
    }

    /// Estimates the error of every number, by other methods; not part of the study's time.
    ///
    /// # Errors
    /// [`ModelError`] when the body cannot be cut into triangles that follow its outline.
    pub fn accuracy(&self, threads: usize) -> Result<StudyAccuracy, ModelError> {
        let scene = self.model.scene();
        let reference = match &self.reference {
            Some(reference) => reference.clone(),
            None => Reference::compute(scene, REFERENCE_OPEN)?,
        };
        let check = if self.error_estimate.is_some() { None } else { cross_check(&self.placement, &reference) };
        let errors = accuracy(scene, &self.placement, &reference, threads)?;
        let rest: Vec<RestResponse> = self.placement.paddles.iter().map(PaddleResult::rest).collect();
        let judged = self.placement.paddles.iter().zip(reference.counts(&rest));
        let left_out = judged.filter(|(_, counts)| !counts).map(|(paddle, _)| paddle.index).collect();
        Ok(StudyAccuracy { errors, cross_check: check, left_out, reference_nodes: reference.nodes })
    }

    /// Lines for people about paddles that cannot hold the target; empty when all can.
    pub fn verdict(&self) -> Vec<String> {
        verdict(&self.placement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is at rest is as far off as another model of it, and what that leaves open.
    #[test]
    fn errors_are_distances_to_the_reference_and_what_it_leaves_open() {
        let scene = Scene::bundled("paper").unwrap();
        let study = PlacementStudy::run(&scene, &PlacementOptions::default()).unwrap();
        let reference = Reference::compute(&scene, 0.02).unwrap();
        let responses = crate::placement::rest::rest_responses(&study.model).unwrap();
        let errors = accuracy(&scene, &study.placement, &reference, 2).unwrap();
        assert_eq!(errors.paddles.len(), 5);
        for (i, (errors, expected)) in errors.paddles.iter().zip(reference.errors(&responses)).enumerate() {
            let (limit, open) = (&reference.responses()[i], reference.open_by_paddle()[i]);
            assert!(open > 0.0);
            let measure = errors.controllability_measure.unwrap();
            assert!((measure / expected - 1.0).abs() < 1e-9, "{measure} {expected}");
            let jacobian = (responses[i].jacobian - limit.jacobian).norm() / limit.jacobian.norm();
            let open_jacobian = reference.open_jacobian()[i];
            assert!(open_jacobian > 0.0 && (errors.jacobian - jacobian - open_jacobian).abs() < 1e-12);
            let found = responses[i].best_direction.unwrap() - limit.best_direction.unwrap();
            let direction = found.norm() + open * limit.controllability_measure;
            assert!((errors.best_direction.unwrap() - direction).abs() < 1e-9 * direction);
            let apart = (responses[i].target_per_depth - limit.target_per_depth).norm();
            assert!(errors.target_per_depth > apart && errors.target_per_depth < apart + 0.02);
        }
    }

    #[test]
    fn a_study_says_what_its_numbers_mean() {
        let study = PlacementStudy::run(&Scene::bundled("tethered").unwrap(), &PlacementOptions::default()).unwrap();
        assert!(
            study.verdict().iter().any(|line| line.starts_with("no paddle of this scene can")),
            "{:?}",
            study.verdict()
        );
    }
}
