//! From a scene to a placement, the one way that all commands go: discretise, refine if a tolerance is asked for, study every
//! paddle, and judge the answer.

use super::adaptive::{ErrorEstimate, discretise};
use super::cross_check::{CrossCheck, cross_check};
use super::study::{Placement, PlacementOptions, place};
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
/// assert_eq!((study.placement.optimum.static_paddle, study.placement.optimum.dynamic_paddle), (4, 3)); // the paper's optima
/// assert!(study.cross_check().is_some_and(|check| check.controllability < 0.5));
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
}

impl PlacementStudy {
    /// Discretises the scene at its resolution and studies every paddle.
    ///
    /// # Errors
    /// [`ModelError`] when the scene cannot be modelled, its tolerance not be reached, or a Jacobian not be computed.
    pub fn run(scene: &Scene, options: &PlacementOptions<'_>) -> Result<Self, ModelError> {
        let start = Instant::now();
        let (model, error_estimate) = discretise(scene)?;
        let placement = place(&model, options)?;
        Ok(Self { model, placement, error_estimate, wall_s: start.elapsed().as_secs_f64() })
    }

    /// A second opinion by another method; none where the study estimates its own error, or the other method fails.
    pub fn cross_check(&self) -> Option<CrossCheck> {
        if self.error_estimate.is_some() {
            return None;
        }
        cross_check(self.model.scene(), &self.placement.paddles)
    }

    /// Lines for people about paddles that cannot hold the target; empty when all can.
    pub fn verdict(&self) -> Vec<String> {
        verdict(&self.placement, self.model.scene())
    }
}
