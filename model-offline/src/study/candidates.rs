//! The discretizations that are worth comparing on a scene, and what one of them costs and misses.

use super::extent::Extent;
use crate::discretization::{Basis, Discretization, Integration, Method, Resolution};
use crate::model::{ModelError, TissueModel};
use crate::placement::reference::Reference;
use crate::placement::rest::{RestResponse, rest_responses};
use crate::scene::Scene;
use std::time::Instant;

/// What a discretization turned out to be worth.
#[derive(Debug, Clone)]
pub struct Assessment {
    /// Number of nodes.
    pub nodes: usize,
    /// Finest node spacing, length units.
    pub spacing: f64,
    /// Time for nodes, shape functions and all paddles' Jacobians and displacements per depth, s: best of several.
    pub wall_s: f64,
    /// The same two errors as [`Reference::distance`].
    pub errors: (f64, f64),
    /// The responses themselves.
    pub responses: Vec<RestResponse>,
}

/// Builds and solves the scene with a discretization, `repeats` times while that is quick.
///
/// # Errors
/// [`ModelError`]: the discretization does not work on this scene.
pub fn assess(
    discretization: Discretization,
    scene: &Scene,
    reference: &Reference,
    repeats: u32,
) -> Result<Assessment, ModelError> {
    let scene = scene.with_discretization(discretization);
    let timed = || -> Result<Assessment, ModelError> {
        let start = Instant::now();
        let model = TissueModel::new(&scene)?;
        let responses = rest_responses(&model)?;
        let wall_s = start.elapsed().as_secs_f64();
        let errors = reference.distance(&responses);
        Ok(Assessment { nodes: model.nodes(), spacing: model.spacing(), wall_s, errors, responses })
    };
    let mut best = timed()?;
    for _ in 1..repeats {
        if best.wall_s > QUICK_S {
            break;
        }
        best.wall_s = best.wall_s.min(timed()?.wall_s);
    }
    Ok(best)
}

/// The same for a model that is there already; nothing is timed.
///
/// # Errors
/// [`ModelError`]: the discretization does not work on this scene.
pub fn assess_model(model: &TissueModel, reference: &Reference) -> Result<Assessment, ModelError> {
    let responses = rest_responses(model)?;
    let errors = reference.distance(&responses);
    Ok(Assessment { nodes: model.nodes(), spacing: model.spacing(), wall_s: f64::NAN, errors, responses })
}

/// Longer than this is not measured again: noise is small beside it.
const QUICK_S: f64 = 0.5;

/// Spacing of uniform nodes to vary around: the scene's own, or as many nodes across as the paper's body has.
pub fn base_spacing(scene: &Scene) -> f64 {
    match scene.discretization.resolution {
        Resolution::Spacing(h) => h,
        Resolution::Tolerance(_) | Resolution::Level(_) => 0.1 * scene.outline.area().sqrt(),
    }
}

/// Families of discretizations that differ in the nodes only, each from coarse to fine.
pub fn families(scene: &Scene, extent: Extent) -> Vec<Vec<Discretization>> {
    let base = base_spacing(scene);
    let uniform: Vec<Resolution> =
        [1.0, 0.5, 0.25, 0.125].iter().take(extent.choose(4, 2)).map(|s| Resolution::Spacing(base * s)).collect();
    let graded: Vec<Resolution> = (-2..=extent.choose(4, 1)).map(Resolution::Level).collect();
    let mut families = Vec::new();
    for &integration in Integration::PLANAR {
        let shapes: &[(Basis, f64)] = match (integration.is_element(), extent) {
            (true, _) => &[(Basis::Linear, 2.0)],
            (false, Extent::Quick) => &[(Basis::Linear, 1.5), (Basis::Linear, 2.0)],
            // Two nodes either way are not enough for a quadratic basis everywhere: shown, not left out.
            (false, Extent::Full) => &[
                (Basis::Linear, 1.2),
                (Basis::Linear, 1.5),
                (Basis::Linear, 2.0),
                (Basis::Linear, 3.0),
                (Basis::Quadratic, 2.0),
                (Basis::Quadratic, 3.0),
            ],
        };
        for &(basis, support) in shapes {
            let method = Method { basis, support, ..Method::new(integration) };
            for nodes in [&uniform, &graded] {
                families.push(nodes.iter().map(|&nodes| scene.discretization.with(nodes, method)).collect());
            }
        }
    }
    families
}
