//! Conjugate gradients with the last factor against a factor for every tangent: the same states, the same Jacobians, and
//! the same loss of stability.

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::solver::equilibrium::{Effort, LinearSolver, NewtonSettings};
use model_offline::{Scene, TissueModel};
use nalgebra::{Matrix2, Vector2};

fn model(integration: Integration, spacing: f64) -> TissueModel {
    let mut scene = Scene::bundled("paper").unwrap();
    scene.discretization.method = Method::new(integration);
    scene.discretization.resolution = Resolution::Spacing(spacing);
    TissueModel::new(&scene).unwrap()
}

fn settings(linear_solver: LinearSolver) -> NewtonSettings {
    NewtonSettings { linear_solver, ..NewtonSettings::default() }
}

/// Target displacement, energy, reactions and Jacobian after an insertion with a moving paddle, and the work it took.
fn insertion(model: &TissueModel, solver: LinearSolver) -> (Vector2<f64>, f64, Vec<f64>, Matrix2<f64>, Effort) {
    let mut body = model.body(Some(2), settings(solver)).unwrap();
    for k in 1..=4 {
        body.drive(0.02 * f64::from(k), Vector2::new(0.01, -0.02) * f64::from(k)).unwrap();
    }
    let jacobian = body.actuation_jacobian().unwrap();
    let equilibrium = body.equilibrium();
    (
        body.target_displacement(),
        equilibrium.energy(),
        equilibrium.reactions().collect(),
        jacobian,
        equilibrium.effort(),
    )
}

#[test]
fn both_solvers_find_the_same_states_and_jacobians() {
    for integration in [Integration::ScniStabilised, Integration::FemT6, Integration::Scni] {
        let model = model(integration, 0.1);
        let (direct, iterative) = (insertion(&model, LinearSolver::Direct), insertion(&model, LinearSolver::Iterative));
        assert_eq!(direct.4.conjugate_gradients, 0);
        // Every converged state has a factor of its own; nothing else needed one.
        assert_eq!((iterative.4.factorisations, iterative.4.cutbacks), (5, 0), "{integration}: {:?}", iterative.4);
        assert!(iterative.4.iterations <= direct.4.iterations + 4, "{integration}: {:?} {:?}", direct.4, iterative.4);
        assert!((direct.0 - iterative.0).norm() < 1e-9 * direct.0.norm(), "{integration}");
        assert!((direct.1 / iterative.1 - 1.0).abs() < 1e-9, "{integration}");
        assert!(
            (direct.3 - iterative.3).norm() < 1e-9 * direct.3.norm(),
            "{integration}: {} {}",
            direct.3,
            iterative.3
        );
        let largest = direct.2.iter().fold(0.0_f64, |m, r| m.max(r.abs()));
        let apart = direct.2.iter().zip(&iterative.2).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(apart < 1e-7 * largest, "{integration}: reactions {apart:.1e} of {largest:.1e} apart");
    }
}

#[test]
fn both_solvers_stop_at_the_same_depth_for_the_same_reason() {
    for integration in [Integration::ScniStabilised, Integration::FemT6] {
        let model = model(integration, 0.1);
        let reached = |solver| {
            let mut body = model.body(Some(2), settings(solver)).unwrap();
            let failure = (1..=40).find_map(|k| body.drive(0.02 * f64::from(k), Vector2::zeros()).err());
            (body.depth(), failure.map(|failure| failure.reason))
        };
        let (direct, iterative) = (reached(LinearSolver::Direct), reached(LinearSolver::Iterative));
        assert!(direct.0 < 0.5 && direct.1.is_some(), "{integration}: the law softens without end: {direct:?}");
        assert_eq!(direct, iterative, "{integration}");
    }
}
