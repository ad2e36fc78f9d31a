//! One run: the needle goes in until something gives.

use super::plan::Experiment;
use crate::discretization::Planar;
use crate::discretization::nodes::lattice::lattice_nodes;
use crate::geometry::{Location, Point2, distance_to_polyline};
use crate::material::{Law, Material, MaterialError, Tensor4};
use crate::model::{ModelError, ModelFailure, TissueModel};
use crate::random::SplitMix64;
use crate::scene::Scene;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::{Matrix2, SMatrix, Vector2};

/// How far beyond the scene's depth the needle is driven.
pub const BEYOND: u32 = 2;

/// Cutbacks where they are allowed: finds the depth to a sixteenth of an increment.
const MAX_CUTBACKS: u32 = 4;

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum StopReason {
    /// It did not: the needle went as far as it was driven.
    #[error("reached")]
    Reached,
    /// The model cannot be made, or has no equilibrium.
    #[error(transparent)]
    Model(ModelFailure),
    /// The law with these numbers is not stable at rest.
    #[error("unstable-law")]
    UnstableLaw,
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentResult {
    /// Nodes of the model; those asked for when there is none.
    pub nodes: usize,
    /// Depth of the last converged state, length units.
    pub depth: f64,
    /// Why it ended there.
    pub reason: StopReason,
    /// Numbers behind the reason.
    pub detail: String,
    /// Smallest principal stretch at the integration points of the last converged state.
    pub min_stretch: f64,
    /// Smallest eigenvalue of the acoustic tensor Q_ik = N_J A_iJkL N_L over all directions N and all integration points of
    /// the last converged state, over that at rest. Not above zero: strong ellipticity is lost.
    pub ellipticity: f64,
    /// Strain energy of the last converged state, in the plane per unit thickness.
    pub energy: f64,
}

impl ExperimentResult {
    /// The law is not stable at rest: nothing was run.
    pub(super) fn unstable_law(error: MaterialError) -> Self {
        Self { reason: StopReason::UnstableLaw, ..stopped(0, &error.into()) }
    }
}

/// What comes of a run that did not begin.
pub(super) fn stopped(nodes: usize, error: &ModelError) -> ExperimentResult {
    ExperimentResult {
        nodes,
        depth: 0.0,
        reason: StopReason::Model(error.kind()),
        detail: error.to_string(),
        min_stretch: 1.0,
        ellipticity: 1.0,
        energy: 0.0,
    }
}

/// Runs an experiment with the paddle at this place of the scene's list static.
pub fn run(scene: &Scene, paddle: usize, experiment: &Experiment) -> ExperimentResult {
    let scene = match varied(scene, experiment) {
        Ok(scene) => scene,
        Err(error) => return ExperimentResult::unstable_law(error),
    };
    let nodes = jittered(&scene, experiment);
    let count = nodes.len();
    let model = match with_nodes(&scene, nodes, experiment) {
        Ok(model) => model,
        Err(error) => return stopped(count, &error),
    };
    let mut body = match model.body(Some(paddle), newton_settings(experiment)) {
        Ok(body) => body,
        Err(failure) => return stopped(model.nodes(), &failure.into()),
    };
    let (reason, detail) = pushed(scene.needle.depth, experiment, |depth| body.drive(depth, Vector2::zeros()));
    let gradients = body.equilibrium().state().displacement_gradients();
    ExperimentResult {
        nodes: model.nodes(),
        depth: body.depth(),
        reason,
        detail,
        min_stretch: gradients.iter().map(smallest_stretch).fold(f64::INFINITY, f64::min),
        // An inclusion of the same law scales both ends of the ratio.
        ellipticity: gradients.iter().map(|h| smallest_acoustic(&scene.material, h)).fold(f64::INFINITY, f64::min)
            / smallest_acoustic(&scene.material, &Matrix2::zeros()),
        energy: body.equilibrium().energy(),
    }
}

/// How the experiment looks for equilibria.
pub(super) fn newton_settings(experiment: &Experiment) -> NewtonSettings {
    NewtonSettings {
        line_search: experiment.line_search,
        max_cutbacks: if experiment.cutback { MAX_CUTBACKS } else { 0 },
        ..NewtonSettings::default()
    }
}

/// Drives a needle on in the experiment's increments until something gives or [`BEYOND`] times `depth` is reached; why it ended,
/// with the numbers behind it.
pub(super) fn pushed(
    depth: f64,
    experiment: &Experiment,
    mut drive: impl FnMut(f64) -> Result<(), Failure>,
) -> (StopReason, String) {
    for increment in 1..=BEYOND * experiment.increments {
        if let Err(failure) = drive(depth * f64::from(increment) / f64::from(experiment.increments)) {
            return (StopReason::Model(ModelFailure::Solve(failure.reason)), failure.detail);
        }
    }
    (StopReason::Reached, String::new())
}

/// Acoustic tensor Q_ik = n_j A_ijkl n_l.
pub(super) fn acoustic<const D: usize>(a: &Tensor4<D>, n: &[f64; D]) -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|i, k| {
        (0..D).flat_map(|j| (0..D).map(move |l| (j, l))).map(|(j, l)| n[j] * a[i][j][k][l] * n[l]).sum()
    })
}

/// Smallest principal stretch √(λmin(FᵀF)).
fn smallest_stretch(h: &Matrix2<f64>) -> f64 {
    (Matrix2::identity() + h).singular_values().min()
}

/// Smallest eigenvalue of the acoustic tensor over directions five degrees apart.
fn smallest_acoustic(law: &Law, h: &Matrix2<f64>) -> f64 {
    let a = law.tangent(h);
    (0..36)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::PI / 36.0).sin_cos();
            let q = acoustic(&a, &[cos, sin]);
            let (mean, half) = (0.5 * q.trace(), 0.5 * (q[(0, 0)] - q[(1, 1)]));
            mean - half.hypot(q[(0, 1)])
        })
        .fold(f64::INFINITY, f64::min)
}

/// The scene with the experiment's material and inclusions.
pub(super) fn varied(scene: &Scene, experiment: &Experiment) -> Result<Scene, MaterialError> {
    let mut scene = scene.clone();
    match experiment.contrast {
        None => scene.inclusions.clear(),
        Some(contrast) => scene.inclusions.iter_mut().for_each(|i| i.stiffness = contrast),
    }
    scene.material = varied_law(&scene.material, experiment)?;
    Ok(scene)
}

/// A law with the experiment's numbers.
pub(super) fn varied_law(law: &Law, experiment: &Experiment) -> Result<Law, MaterialError> {
    let mut law = law.clone();
    if let Some(poisson) = experiment.poisson {
        law = law.with_poisson_ratio(poisson).unwrap_or(Ok(law))?;
    }
    if let Some(c) = experiment.c {
        law = law.with_exponential_factor(c).unwrap_or(Ok(law))?;
    }
    if let Some(share) = experiment.barrier {
        let shear = law.tangent(&Matrix2::zeros())[0][1][0][1];
        law = law.with_barrier(share * shear)?;
    }
    Ok(law)
}

/// Lattice nodes, those inside the body moved at random; nodes on the boundary and on the needle stay.
fn jittered(scene: &Scene, experiment: &Experiment) -> Vec<Point2> {
    let mut nodes = lattice_nodes(&scene.features(), experiment.spacing);
    if experiment.jitter == 0.0 {
        return nodes;
    }
    let tolerance = 1e-9 * scene.outline.size();
    let mut random = SplitMix64(experiment.seed);
    for x in &mut nodes {
        let shift = Point2::new(random.symmetric(), random.symmetric()) * (experiment.jitter * experiment.spacing);
        let is_inside = |x: Point2| scene.outline.locate(x, tolerance) == Location::Inside;
        // Beside an edge that goes across the lattice nodes would be shifted out of the body, where they have no cell.
        if is_inside(*x) && is_inside(*x + shift) && distance_to_polyline(*x, &scene.needle.contact) > tolerance {
            *x += shift;
        }
    }
    nodes
}

fn with_nodes(scene: &Scene, nodes: Vec<Point2>, experiment: &Experiment) -> Result<TissueModel, ModelError> {
    let planar =
        Planar::new(&scene.outline, &scene.inclusion_outlines(), nodes, Some(experiment.spacing), experiment.method)?;
    TissueModel::on(scene, planar, experiment.spacing)
}

/// The homogeneous model of an experiment, for measures other than the insertion, and the lattice it was jittered from.
///
/// # Errors
/// [`ModelError`] when there is none.
pub(super) fn model(scene: &Scene, experiment: &Experiment) -> Result<TissueModel, ModelError> {
    let scene = scene.without_inclusions();
    let nodes = jittered(&scene, experiment);
    with_nodes(&scene, nodes, experiment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::Integration::{self, Dni, FemT3, FemT6, Gauss, Mscni, Nsni, Scni, ScniStabilised};
    use crate::discretization::Method;

    #[test]
    fn jittered_nodes_stay_in_the_body_and_one_outside_ends_no_program() {
        let scene = Scene::bundled("breast").unwrap();
        let experiment = |integration: Integration, seed| Experiment {
            method: Method::new(integration),
            spacing: 5.0,
            jitter: 0.4,
            seed,
            contrast: None,
            poisson: None,
            c: None,
            barrier: None,
            increments: 10,
            line_search: true,
            cutback: true,
        };
        let tolerance = 1e-9 * scene.outline.size();
        let is_outside = |x: &Point2| scene.outline.locate(*x, tolerance) == Location::Outside;
        for seed in 0..20 {
            let experiment = experiment(Scni, seed);
            assert!(!jittered(&scene, &experiment).iter().any(is_outside), "seed {seed}");
        }
        for integration in [Dni, Scni, ScniStabilised, Mscni, Nsni, Gauss, FemT3, FemT6] {
            let experiment = experiment(integration, 0);
            let mut nodes = jittered(&scene, &experiment);
            nodes.push(Point2::new(0.0, 1e3));
            // A model without the node's cell, or an error: which one is the triangulation's.
            let _ = with_nodes(&scene, nodes, &experiment);
        }
    }
}
