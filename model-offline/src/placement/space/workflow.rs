//! From a scene in space to a placement: mesh, refine if a tolerance is asked for, study every paddle and pair.
//!
//! How a tolerance is kept is told in the module `refinement`.

use super::discretised::{Discretised, SpaceErrorEstimate, answering, at_level};
use super::insertion::InsertionModel;
use super::refinement::{LEVELS, refine};
use super::rest::{SpaceResponse, rest_responses};
use super::study::{SpacePlacement, place_in_space, steps};
use super::uncertainty::{SecondPaddle, Uncertain};
use crate::discretization::{Integration, Method, Resolution};
use crate::model::ModelError;
use crate::model::space::SpaceModel;
use crate::model::space::meshing::{MeshSize, even_mesh, mesh};
use crate::parallel;
use crate::scene::space::SpaceScene;
use std::time::Instant;

/// Estimated error of the measures that insertions leave open at rest, at most. On the bundled scenes meshes that claim it are 0.8 % (`block`),
/// 1.5 % (`scan`) and less than 3.8 % (`mound`) off; each further halving costs four times as much, and feedback makes up for it.
const AT_REST: f64 = 0.15;

/// A placement in space with everything that is known about it.
#[derive(Debug)]
pub struct SpaceStudy {
    /// The model that the Jacobians are of.
    pub model: SpaceModel,
    /// What the study found.
    pub placement: SpacePlacement,
    /// Estimated error, where the scene asks for a tolerance.
    pub error_estimate: Option<SpaceErrorEstimate>,
    /// Time that it took, s.
    pub wall_s: f64,
}

impl SpaceStudy {
    /// Discretises the scene at its resolution, by the method [for placement](SpaceScene::for_placement), and studies every paddle and
    /// pair. `progress` is told how many steps there are,
    /// and then called for each.
    ///
    /// # Errors
    /// [`ModelError`] when the scene cannot be modelled, its tolerance not be reached, or a Jacobian not be computed.
    pub fn run(
        scene: &SpaceScene,
        threads: usize,
        begin: &dyn Fn(u64),
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self, ModelError> {
        let start = Instant::now();
        let Discretised { model, rest, estimate: error_estimate } =
            parallel::within(threads, || discretise(&scene.for_placement()))?;
        begin(steps(&model));
        let insertions = InsertionModel::new(scene, coarse(scene)?, model.clone(), rest);
        let placement = place_in_space(&insertions, threads, progress)?;
        Ok(Self { model, placement, error_estimate, wall_s: start.elapsed().as_secs_f64() })
    }

    /// The placement with the estimated errors of it, where the scene asks for a tolerance.
    pub fn uncertain(&self) -> Option<Uncertain<'_>> {
        self.error_estimate.as_ref().map(|estimate| Uncertain { placement: &self.placement, estimate })
    }

    /// What a second paddle does for control at rest; none where the scene has no pairs.
    pub fn second_paddle(&self) -> Option<SecondPaddle> {
        SecondPaddle::of(&self.placement, self.uncertain())
    }

    /// Pairs of paddles that cannot be attached together, by index.
    pub fn overlapping(&self) -> Vec<[u32; 2]> {
        self.model.overlapping().iter().map(|pair| pair.map(|p| self.model.scene().paddles[p].index)).collect()
    }
}

/// Discretises a scene at its spacing or level, or refines it to its tolerance.
///
/// # Errors
/// [`ModelError`], among them [`ModelError::ToleranceNotReached`] with the estimate that was reached.
pub fn discretise(scene: &SpaceScene) -> Result<Discretised, ModelError> {
    let (mesh, tolerance) = match scene.discretization.resolution {
        Resolution::Spacing(spacing) => (even_mesh(scene, spacing)?, None),
        Resolution::Level(level) => (mesh(scene, &MeshSize::level(level))?, None),
        Resolution::Tolerance(tolerance) => (Default::default(), Some(tolerance)),
    };
    if let Some(tolerance) = tolerance {
        return refine(scene, tolerance);
    }
    let model = SpaceModel::on(scene, &mesh)?;
    Ok(Discretised { rest: rest_responses(&model)?, model, estimate: None })
}

/// The model of a scene at its spacing or level, with its responses at rest; not if that is too large to be factorised.
///
/// # Errors
/// [`ModelError`], as of [`discretise`], and [`ModelError::TooManyNodes`].
pub fn at_resolution(scene: &SpaceScene) -> Result<(SpaceModel, Vec<SpaceResponse>), ModelError> {
    match scene.discretization.resolution {
        Resolution::Spacing(spacing) => answering(scene, &even_mesh(scene, spacing)?),
        Resolution::Level(level) => at_level(scene, level),
        Resolution::Tolerance(_) => discretise(scene).map(|found| (found.model, found.rest)),
    }
}

/// Index of the single paddle that controls the target best, at rest, by the scene's own discretization.
///
/// # Errors
/// [`ModelError`], as of [`at_resolution`], and [`ModelError::NoPaddleControls`].
pub fn best_single(scene: &SpaceScene) -> Result<u32, ModelError> {
    let (_, rest) = at_resolution(scene)?;
    let singles =
        scene.paddles.iter().zip(&rest).filter_map(|(paddle, r)| Some((paddle.index, r.controllability?.measure)));
    let best = singles.filter(|(_, measure)| measure.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1));
    best.map(|(index, _)| index).ok_or(ModelError::NoPaddleControls)
}

/// The model of a scene at its spacing or level, or at the tolerance that it was refined to.
///
/// # Errors
/// [`ModelError`], as of [`discretise`].
pub fn model(scene: &SpaceScene) -> Result<SpaceModel, ModelError> {
    match scene.discretization.resolution {
        Resolution::Spacing(spacing) => SpaceModel::on(scene, &even_mesh(scene, spacing)?),
        Resolution::Level(level) => SpaceModel::on(scene, &mesh(scene, &MeshSize::level(level))?),
        Resolution::Tolerance(_) => Ok(discretise(scene)?.model),
    }
}

/// The model of a scene's insertions. At rest it answers as the scene's own discretization does; where that is given by a tolerance
/// alone, as quadratic tetrahedra within it or within an estimated 15 %, which is far above what is left.
///
/// # Errors
/// [`ModelError`], as of [`discretise`].
pub fn insertion_model(scene: &SpaceScene) -> Result<InsertionModel, ModelError> {
    let mut wanted = scene.clone();
    if let Resolution::Tolerance(tolerance) = wanted.discretization.resolution {
        wanted = wanted.with_method(Method::new(Integration::FemT10));
        wanted.discretization.resolution = Resolution::Tolerance(tolerance.max(AT_REST));
    }
    let Discretised { model, rest, .. } = discretise(&wanted)?;
    Ok(InsertionModel::new(scene, coarse(scene)?, model, rest))
}

/// The model that insertions are followed on. Linear tetrahedra on the coarsest mesh that sees every patch: they cost a tenth of any
/// other method, and go as deep as it.
///
/// # Errors
/// [`ModelError`] when no mesh sees every patch.
pub fn coarse(scene: &SpaceScene) -> Result<SpaceModel, ModelError> {
    let scene = scene.with_method(Method::new(Integration::FemT4));
    let mut outcome = Err(ModelError::NoPaddleControls);
    for level in LEVELS {
        outcome = mesh(&scene, &MeshSize::level(level)).and_then(|mesh| SpaceModel::on(&scene, &mesh));
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}
