//! The cheapest discretization that keeps its share of the tolerance.

use super::cost::cost;
use super::rejection::{Alternative, Rejected, RejectionReason};
use super::search::{Search, Trials, Unfit, cheapest};
use crate::discretization::Discretization;
use crate::model::{DecidedBy, ModelError, TissueModel};
use crate::placement::reference::{Reference, distance};
use crate::placement::rest::rest_responses;
use crate::scene::Scene;
use crate::study::candidates::{Assessment, assess, assess_model, families};
use crate::study::extent::Extent;

/// The chosen discretization.
#[derive(Debug, Clone)]
pub struct ChosenDiscretization {
    /// Which.
    pub discretization: Discretization,
    /// What was found out about it.
    pub assessment: Assessment,
    /// Its estimated error: distance from the reference, and what that leaves open.
    pub error_estimate: f64,
    /// Distance from the next finer model.
    pub verified_error: f64,
    /// What was not chosen.
    pub rejected: Vec<Rejected>,
}

/// The cheapest candidate within the tolerance that the next finer one confirms.
///
/// # Errors
/// [`ModelError::ToleranceNotReached`] when no candidate keeps it.
pub fn discretization(
    scene: &Scene,
    tolerance: f64,
    reference: &Reference,
) -> Result<ChosenDiscretization, ModelError> {
    // Elements first: they are cheapest, so that dearer families are given up early.
    let mut families = families(scene, Extent::Full);
    families.sort_by_key(|family| !family.first().is_some_and(|d| d.method.integration.is_element()));
    let mut trials = SceneTrials { scene, reference, built: None };
    let Search { best, refused } = cheapest(&families, tolerance, &mut trials);
    let chosen_cost = best.as_ref().map_or(f64::NAN, |best| best.cost);
    let reasons = refused.into_iter().map(|(candidate, refusal)| {
        let reason = match refusal {
            Unfit::TooWrong(error) => RejectionReason::EstimatedError(error),
            Unfit::Unconfirmed(apart) => RejectionReason::NotConfirmed(apart),
            Unfit::Dearer(cost) => RejectionReason::Dearer(cost / chosen_cost),
            Unfit::Unusable(error) => RejectionReason::DoesNotWork(error),
            Unfit::Unconfirmable(error) => RejectionReason::NoFinerModel(error),
        };
        Rejected::new(Alternative::Discretization(candidate), reason)
    });
    let rejected: Vec<Rejected> = reasons.collect();
    let Some(best) = best else {
        let reached = rejected.iter().filter_map(|r| r.reason.error()).fold(f64::INFINITY, f64::min);
        return Err(ModelError::ToleranceNotReached {
            tolerance,
            reached,
            decided_by: DecidedBy::Whole,
            memory: None,
            faster: None,
        });
    };
    Ok(ChosenDiscretization {
        discretization: best.candidate,
        error_estimate: worst(&best.solution, reference),
        assessment: best.solution,
        verified_error: best.apart,
        rejected,
    })
}

fn worst(assessment: &Assessment, reference: &Reference) -> f64 {
    assessment.errors.0.max(assessment.errors.1) + reference.open
}

/// The model of a scene with another discretization.
pub(super) fn build(scene: &Scene, discretization: &Discretization) -> Result<TissueModel, ModelError> {
    TissueModel::new(&scene.with_discretization(*discretization))
}

/// The candidates of a scene, asked one after the other.
struct SceneTrials<'a> {
    scene: &'a Scene,
    reference: &'a Reference,
    /// The model whose cost was asked for last.
    built: Option<TissueModel>,
}

impl Trials<Discretization> for SceneTrials<'_> {
    type Solution = Assessment;
    type Error = ModelError;

    fn cost(&mut self, candidate: &Discretization) -> Result<f64, ModelError> {
        let model = build(self.scene, candidate)?;
        Ok(cost(self.built.insert(model)))
    }

    fn solve(&mut self, candidate: &Discretization) -> Result<Assessment, ModelError> {
        match &self.built {
            Some(model) => assess_model(model, self.reference),
            None => assess(*candidate, self.scene, self.reference, 1),
        }
    }

    fn error(&self, solution: &Assessment) -> f64 {
        worst(solution, self.reference)
    }

    fn confirm(&mut self, candidate: &Discretization, solution: &Assessment) -> Result<f64, ModelError> {
        let finer = Discretization { resolution: candidate.resolution.finer(), ..*candidate };
        let finer = rest_responses(&build(self.scene, &finer)?)?;
        let counts = self.reference.counts(&solution.responses);
        let (measure, displacement) = distance(&solution.responses, &finer, &counts);
        Ok(measure.max(displacement))
    }
}
