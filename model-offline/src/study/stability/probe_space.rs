//! One run in space: the needle goes in until something gives.

use super::plan::Experiment;
use super::probe::{ExperimentResult, acoustic, newton_settings, pushed, stopped, varied_law};
use crate::discretization::{Method, Resolution};
use crate::material::{Law, Material as _, MaterialError};
use crate::model::ModelError;
use crate::model::space::SpaceModel;
use crate::model::space::meshing::even_mesh;
use crate::placement::space::discretised::affordable;
use crate::scene::space::SpaceScene;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Directions over half a sphere in which strong ellipticity is looked for.
const DIRECTIONS: u32 = 120;

/// Runs an experiment with the paddle at this place of the scene's list static. Nodes are those of a mesh of even edges, which is
/// finer where a patch or an inclusion would not be seen; there is no jitter.
///
/// # Panics
/// When the scene has no paddle at this place.
pub fn run_in_space(scene: &SpaceScene, paddle: usize, experiment: &Experiment) -> ExperimentResult {
    let scene = match varied(scene, paddle, experiment) {
        Ok(scene) => scene,
        Err(error) => return ExperimentResult::unstable_law(error),
    };
    let model = match model(&scene, experiment.spacing, experiment.method) {
        Ok(model) => model,
        Err(error) => return stopped(0, &error),
    };
    let mut body = match model.body(&[0], newton_settings(experiment)) {
        Ok(body) => body,
        Err(failure) => return stopped(model.nodes(), &failure.into()),
    };
    let (reason, detail) = pushed(scene.needle.depth, experiment, |depth| body.drive(depth, &[Vector3::zeros()]));
    let gradients = body.equilibrium().state().displacement_gradients();
    let stretch = |h: &Matrix3<f64>| (Matrix3::identity() + h).singular_values().min();
    let directions = directions();
    let ellipticity = |h: &Matrix3<f64>| smallest_acoustic(&scene.material, h, &directions);
    ExperimentResult {
        nodes: model.nodes(),
        depth: body.depth(),
        reason,
        detail,
        min_stretch: gradients.iter().map(stretch).fold(f64::INFINITY, f64::min),
        ellipticity: gradients.iter().map(ellipticity).fold(f64::INFINITY, f64::min) / ellipticity(&Matrix3::zeros()),
        energy: body.equilibrium().energy(),
    }
}

fn model(scene: &SpaceScene, spacing: f64, method: Method) -> Result<SpaceModel, ModelError> {
    let mut scene = scene.with_method(method);
    scene.discretization.resolution = Resolution::Spacing(spacing);
    let mesh = even_mesh(&scene, spacing)?;
    affordable(method.integration, &mesh)?;
    SpaceModel::on(&scene, &mesh)
}

/// The scene with the experiment's material and inclusions, and one paddle alone: the mesh need not be fine at others.
fn varied(scene: &SpaceScene, paddle: usize, experiment: &Experiment) -> Result<SpaceScene, MaterialError> {
    let mut scene = scene.clone();
    scene.paddles = vec![scene.paddles[paddle].clone()];
    scene.pairs.clear();
    match experiment.contrast {
        None => scene.inclusions.clear(),
        Some(contrast) => scene.inclusions.iter_mut().for_each(|i| i.stiffness = contrast),
    }
    scene.material = varied_law(&scene.material, experiment)?;
    Ok(scene)
}

/// Unit vectors spread over half a sphere (a Fibonacci lattice): the acoustic tensor is the same the other way.
fn directions() -> Vec<[f64; 3]> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let one = |i: u32| {
        let z = (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
        let (radius, (sin, cos)) = ((1.0 - z * z).sqrt(), (golden * f64::from(i)).sin_cos());
        [radius * cos, radius * sin, z]
    };
    (0..DIRECTIONS).map(one).chain([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).collect()
}

/// Smallest eigenvalue of the acoustic tensor over these directions.
fn smallest_acoustic(law: &Law, h: &Matrix3<f64>, directions: &[[f64; 3]]) -> f64 {
    let a = law.tangent(h);
    let least = |n: &[f64; 3]| acoustic(&a, n).symmetric_eigenvalues().min();
    directions.iter().map(least).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At rest the acoustic tensor of an isotropic law has the eigenvalues λ + 2μ, μ, μ in every direction; in uniaxial stretch of
    /// St. Venant–Kirchhoff tissue along n it is ½λ(3s² − 1) + μ(3s² − 1) along n.
    #[test]
    fn acoustic_tensors_have_their_closed_forms() {
        let law = Law::saint_venant_kirchhoff(2.0, 1.0).unwrap();
        let directions = directions();
        assert!((smallest_acoustic(&law, &Matrix3::zeros(), &directions) - 1.0).abs() < 1e-12);
        for n in &directions {
            let eigenvalues = acoustic(&law.tangent(&Matrix3::zeros()), n).symmetric_eigenvalues();
            assert!((eigenvalues.max() - 4.0).abs() < 1e-12 && (eigenvalues.min() - 1.0).abs() < 1e-12);
        }
        for s in [0.9_f64, 0.7, 0.6, 0.5] {
            let along =
                acoustic(&law.tangent(&Matrix3::from_diagonal(&Vector3::new(s - 1.0, 0.0, 0.0))), &[1.0, 0.0, 0.0]);
            let expected = (0.5 * 2.0 + 1.0) * (3.0 * s * s - 1.0);
            assert!((along[(0, 0)] - expected).abs() < 1e-12, "{s}: {along}");
            // Compressed past 1/√3 it is lost.
            let lost =
                smallest_acoustic(&law, &Matrix3::from_diagonal(&Vector3::new(s - 1.0, 0.0, 0.0)), &directions) <= 0.0;
            assert!(!lost || s < 0.75, "{s}");
            assert!(lost || s > 1.0 / 3.0_f64.sqrt(), "{s}");
        }
    }

    #[test]
    fn directions_are_unit_vectors_all_round() {
        let all = directions();
        let norm = |n: &[f64; 3]| n.iter().map(|c| c * c).sum::<f64>();
        assert!(all.iter().all(|n| (norm(n) - 1.0).abs() < 1e-12));
        // Nowhere is the nearest farther than 12°.
        for i in 0..1000 {
            let x = [f64::from(i).sin(), (1.7 * f64::from(i)).cos(), (0.3 * f64::from(i)).sin()];
            let length = norm(&x).sqrt();
            let nearest =
                all.iter().map(|n| (0..3).map(|k| n[k] * x[k]).sum::<f64>().abs() / length).fold(0.0, f64::max);
            assert!(nearest > 12.0_f64.to_radians().cos(), "{x:?}: {nearest}");
        }
    }
}
