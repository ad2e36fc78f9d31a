//! Conjugate gradients with the last factor against a factor for every tangent: the same states, the same Jacobians, and
//! the same loss of stability. In space, where factors are large, that is also single precision against double.

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::model::space::SpaceModel;
use model_offline::placement::space::workflow;
use model_offline::scene::space::SpaceScene;
use model_offline::solver::equilibrium::{Effort, FailureReason, LinearSolver, NewtonSettings};
use model_offline::{Scene, TissueModel};
use nalgebra::{Matrix2, Vector2, Vector3};

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

/// The block of so much stiffer an inclusion, large enough for its factor to be one of single precision.
fn block(stiffness: f64) -> SpaceModel {
    let mut scene = SpaceScene::bundled("block").unwrap();
    scene.inclusions[0].stiffness = stiffness;
    scene.discretization.resolution = Resolution::Level(0);
    workflow::model(&scene).unwrap()
}

#[test]
fn in_space_single_precision_finds_the_states_and_jacobians_of_double() {
    for (stiffness, far) in [(100.0, 1.0), (1e6, 1.0), (1e6, 3.0)] {
        let model = block(stiffness);
        let insertion = |solver| {
            let mut body = model.body(&[2], settings(solver)).unwrap();
            for k in 1..=2 {
                let far = far * f64::from(k);
                body.drive(0.01 * far, &[Vector3::new(0.002, -0.004, 0.001) * far]).unwrap();
            }
            let jacobian = body.actuation_jacobian().unwrap();
            let equilibrium = body.equilibrium();
            assert_eq!(equilibrium.has_single_precision(), solver == LinearSolver::BySize);
            let reactions: Vec<f64> = equilibrium.reactions().collect();
            (body.target_displacement(), equilibrium.energy(), reactions, jacobian, equilibrium.effort())
        };
        let (double, single) = (insertion(LinearSolver::Direct), insertion(LinearSolver::BySize));
        assert_eq!(double.4.factorisations, double.4.iterations + 1, "a factor for every tangent");
        // One at rest, one for the Jacobian: in between it is the first that proves each state stable.
        assert_eq!(single.4.factorisations, 2, "{stiffness}: {:?}", single.4);
        assert!((double.0 - single.0).norm() < 1e-9 * double.0.norm(), "{stiffness}");
        assert!((double.1 / single.1 - 1.0).abs() < 1e-9, "{stiffness}");
        assert!(
            (double.3.clone() - &single.3).norm() < 1e-9 * double.3.norm(),
            "{stiffness}: {} {}",
            double.3,
            single.3
        );
        let largest = double.2.iter().fold(0.0_f64, |m, r| m.max(r.abs()));
        let apart = double.2.iter().zip(&single.2).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(apart < 1e-7 * largest, "{stiffness}: reactions {apart:.1e} of {largest:.1e} apart");
    }
}

#[test]
fn in_space_single_precision_gives_way_where_double_does() {
    let model = block(100.0);
    let reached = |solver| {
        let mut body = model.body(&[], NewtonSettings { max_cutbacks: 0, ..settings(solver) }).unwrap();
        let failure = (1..=6).find_map(|k| body.drive(0.08 * f64::from(k), &[]).err());
        (body.depth(), failure.map(|failure| failure.reason))
    };
    let (double, single) = (reached(LinearSolver::Direct), reached(LinearSolver::BySize));
    assert_eq!(double.1, Some(FailureReason::ElementInverted), "{double:?}");
    assert_eq!(double, single);
}
