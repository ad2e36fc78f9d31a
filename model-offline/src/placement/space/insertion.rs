//! The model of insertions in space: what is followed to depth, tabulated and simulated.
//!
//! No single discretization both answers accurately at rest and goes deep. Elements that know of the singular strain at the rims of
//! patches are squeezed to nothing there long before the depth; linear tetrahedra on a coarse mesh go as deep as the law does, and are
//! 14 to 27 % too stiff. So the body is followed on the coarse mesh, and its target displacement is corrected by what an accurate
//! model says at rest, for small depths and small displacements of the paddles:
//!
//! ```text
//! u(z) = u_c(z) + (A_a − A_c) z,   z = (depth, paddle displacements),   A = ∂u/∂z at rest
//! ```
//!
//! so that Jacobians at rest are those of the accurate model, and the coarse mesh says only what the law's nonlinearity adds.

use super::rest::{CondensedRest, SpaceResponse, all_sets, rest_responses};
use crate::model::ModelError;
use crate::model::space::{SpaceBody, SpaceModel};
use crate::scene::space::SpaceScene;
use crate::solver::equilibrium::NewtonSettings;
use nalgebra::DMatrix;

/// A coarse model that goes deep, with what an accurate one answers at rest.
#[derive(Debug, Clone)]
pub struct InsertionModel {
    scene: SpaceScene,
    coarse: SpaceModel,
    accurate: SpaceModel,
    rest: Vec<SpaceResponse>,
}

impl InsertionModel {
    /// Follows insertions of a scene on `coarse`; at rest it answers as `accurate`, whose responses are `rest` ([`rest_responses`]).
    pub fn new(scene: &SpaceScene, coarse: SpaceModel, accurate: SpaceModel, rest: Vec<SpaceResponse>) -> Self {
        Self { scene: scene.clone(), coarse, accurate, rest }
    }

    /// The same without the scene's inclusions.
    ///
    /// # Errors
    /// [`ModelError`] when the body at rest cannot be solved.
    pub fn without_inclusions(&self) -> Result<Self, ModelError> {
        let accurate = self.accurate.without_inclusions();
        Ok(Self {
            scene: self.scene.without_inclusions(),
            coarse: self.coarse.without_inclusions(),
            rest: rest_responses(&accurate)?,
            accurate,
        })
    }

    /// The scene, discretised as it says itself.
    pub fn scene(&self) -> &SpaceScene {
        &self.scene
    }

    /// Nodes of the mesh that insertions are followed on.
    pub fn nodes(&self) -> usize {
        self.coarse.nodes()
    }

    /// The model that is followed.
    pub fn coarse(&self) -> &SpaceModel {
        &self.coarse
    }

    /// The model that answers at rest.
    pub fn accurate(&self) -> &SpaceModel {
        &self.accurate
    }

    /// What it answers: of every paddle, then every pair, then without any.
    pub fn rest(&self) -> &[SpaceResponse] {
        &self.rest
    }

    /// Analyses what all bodies share, before threads ask for it at once.
    pub(super) fn prepare(&self) {
        self.coarse.analysis();
    }

    /// A body at rest with some paddles attached, by their places in the scene's list.
    ///
    /// # Errors
    /// [`ModelError`] when the tangent at rest is singular, or a paddle attached twice.
    pub fn body(&self, attached: &[usize], settings: NewtonSettings) -> Result<SpaceBody<'_>, ModelError> {
        if let [one, other] = *attached
            && one == other
        {
            return Err(ModelError::SamePaddle { index: self.scene.paddles[one].index });
        }
        let body = self.coarse.body(attached, settings)?;
        Ok(body.answering_at_rest(&self.rest_of(attached)?)?)
    }

    /// What the target does at rest per depth, then per displacement of the paddles: 3 rows.
    pub(super) fn rest_of(&self, attached: &[usize]) -> Result<DMatrix<f64>, ModelError> {
        let known = all_sets(&self.accurate).iter().position(|set| set == attached);
        match known.and_then(|set| self.rest.get(set)) {
            Some(response) => Ok(response.per_control()),
            // In another order, or a pair that the scene does not study.
            None => Ok(CondensedRest::new(&self.accurate)?.response(attached)?.per_control()),
        }
    }

    /// The pair that controls the target best at rest, or the paddle where there are no pairs, by index.
    ///
    /// # Errors
    /// [`ModelError::NoPaddleControls`].
    pub fn best_to_control(&self) -> Result<Vec<u32>, ModelError> {
        let (scene, sets) = (self.scene(), all_sets(&self.accurate));
        let wanted = if scene.pairs.is_empty() { 1 } else { 2 };
        let measures =
            sets.iter().zip(&self.rest).filter(|(set, _)| set.len() == wanted).filter_map(|(set, response)| {
                let measure = response.controllability?.measure;
                measure.is_finite().then_some((set, measure))
            });
        let best = measures.min_by(|a, b| a.1.total_cmp(&b.1)).ok_or(ModelError::NoPaddleControls)?;
        Ok(best.0.iter().map(|&p| scene.paddles[p].index).collect())
    }
}
