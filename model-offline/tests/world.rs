//! Worlds that are not the controller's model: what their effects do, and what is reduced of them.

use model_offline::model::{Pose, TissueModel};
use model_offline::reduction::along_path::{AlongPath, PathOptions, along};
use model_offline::scene::{Effect, Scene};
use nalgebra::Vector2;
use std::sync::Arc;

fn scene(name: &str, effects: &[Effect]) -> Scene {
    effects.iter().fold(Scene::bundled(name).unwrap(), |scene, effect| scene.with_effect(*effect))
}

const EVERYTHING: [Effect; 3] = [Effect::Shaft, Effect::Creep, Effect::Breathing];

/// The needle goes steadily to the scene's depth in five seconds.
fn way(model: &TissueModel) -> impl Fn(f64) -> Pose + Sync + '_ {
    |time: f64| model.pose_at(time, model.scene().needle.depth * (time / 5.0).min(1.0))
}

/// The goal of an estimate: at least the error in 95 % of fresh trials.
#[test]
fn beside_the_path_the_estimate_is_at_least_the_error() {
    for (name, effects, paddle) in [
        ("breast", &EVERYTHING[..], 2),
        ("prostate", &[Effect::Creep, Effect::Breathing][..], 1),
        ("paper", &[Effect::Shaft][..], 2),
    ] {
        let model = TissueModel::new(&scene(name, effects)).unwrap();
        let options = PathOptions { threads: 2, ..PathOptions::new(5.5) };
        let start = std::time::Instant::now();
        let path = Arc::new(AlongPath::learn(&model, Some(paddle), &way(&model), &options).unwrap());
        println!("{name}: {} nodes, learnt in {:.1} s", model.nodes(), start.elapsed().as_secs_f64());
        let (mut covered, mut trials, mut worst, mut largest) = (0, 0, 0.0_f64, 0.0_f64);
        for trial in 0..10 {
            let depth = model.scene().needle.depth;
            let beside = |time: f64| {
                let (f, a) = (f64::from(trial), 0.02 * depth * f64::from(1 + trial % 5));
                Vector2::new((0.7 * time + f).sin() - f.sin(), ((0.4 + 0.1 * f) * time).sin()) * a
            };
            let mut body = path.body();
            let times: Vec<f64> = (0..path.knots()).map(|k| path.interval() * k as f64).collect();
            let ways: Vec<Vector2<f64>> = times.iter().map(|time| path.paddle(*time) + beside(*time)).collect();
            let truth = along(&model, Some(paddle), &way(&model), path.interval(), &ways).unwrap();
            for ((time, paddle), truth) in times.iter().zip(&ways).zip(&truth) {
                body.go_to(*time, *paddle);
                let error = (body.target_displacement() - truth).norm();
                worst = worst.max(error / depth);
                largest = largest.max(truth.norm() / depth);
                trials += 1;
                covered += i32::from(error <= body.error_estimate());
            }
        }
        let share = f64::from(covered) / f64::from(trials);
        println!("{name}: {share:.3} covered, worst error {worst:.1e} of the depth, target moved {largest:.2}");
        assert!(share >= 0.95, "{name}: {share}");
        assert!(worst < 0.02, "{name}: {worst}");
    }
}
