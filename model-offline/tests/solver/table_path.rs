//! What a controller table promises: at every knot its paddle path holds the target on the needle's line.

use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use model_offline::table::{TableOptions, build};
use model_offline::{Resolution, TissueModel};
use nalgebra::Vector2;

/// Orthogonal error that is left at a knot, over the body's size: solved again from rest by other steps.
const LEFT: f64 = 2e-9;

#[test]
fn the_path_holds_the_target_at_every_knot_of_scenes_in_other_units() {
    for (name, spacing, knots) in
        [("paper", 0.1, 21), ("paper-hull", 0.1, 11), ("breast", 8.0, 6), ("prostate", 6.0, 9)]
    {
        let mut scene = Scene::bundled(name).unwrap();
        scene.discretization.resolution = Resolution::Spacing(spacing);
        let model = TissueModel::new(&scene).unwrap();
        let size = scene.outline.size();
        let normal = scene.needle.orthogonal();
        let paddle = scene.paddles[2].index;
        let table = build(&model, paddle, &TableOptions { knots, ..TableOptions::default() }).unwrap();
        assert!(table.knots.len() > 3, "{name}: {} knots", table.knots.len());
        let mut still = model.body(Some(2), NewtonSettings::default()).unwrap();
        let mut body = model.body(Some(2), NewtonSettings::default()).unwrap();
        let mut unheld: f64 = 0.0;
        for knot in &table.knots {
            body.drive(knot.depth, Vector2::from(knot.paddle_path)).unwrap();
            let left = normal.dot(&body.target_displacement()).abs();
            assert!(left <= LEFT * size, "{name} at depth {}: {left:e} of {size}", knot.depth);
            still.drive(knot.depth, Vector2::zeros()).unwrap();
            unheld = unheld.max(normal.dot(&still.target_displacement()).abs());
        }
        // Not because there was nothing to hold.
        assert!(unheld > 1e5 * LEFT * size, "{name}: {unheld:e}");
    }
}

/// Critical damping of an integrator that is d samples late takes dᵈ / (d + 1)ᵈ⁺¹, over the model error that is allowed for.
#[test]
fn the_gain_is_for_the_delay_of_the_scenes_own_sensor() {
    for (name, delay, damped) in [("paper", 1, 1.0 / 4.0), ("breast", 2, 4.0 / 27.0)] {
        let mut scene = Scene::bundled(name).unwrap();
        scene.discretization.resolution = Resolution::Spacing(0.1 * scene.outline.size());
        let model = TissueModel::new(&scene).unwrap();
        let paddle = scene.paddles[2].index;
        let gains = |options| build(&model, paddle, &options).unwrap().gains;
        let few = TableOptions { knots: 2, ..TableOptions::default() };
        let own = gains(few);
        assert_eq!(own.delay_samples, delay, "{name}");
        assert!((own.loop_gain * own.lambda_max - damped).abs() < 1e-12, "{name}: {own:?}");
        assert_eq!(gains(TableOptions { delay_samples: Some(0), ..few }).loop_gain * own.lambda_max, 1.0, "{name}");
    }
}
