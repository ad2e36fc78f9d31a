//! Insertions on graded nodes are followed as far as the tissue goes.

use model_offline::placement::{PlacementOptions, place};
use model_offline::scene::Scene;
use model_offline::{Resolution, TissueModel};

/// Late in this insertion an increment takes a dozen iterations. With eight at most (and pieces of increments instead) the
/// runs ended at depth 10 to 10.9, and the ranking of static paddles was of what had got farthest.
#[test]
fn held_paddles_of_breast_reach_the_depth_on_graded_nodes() {
    let mut scene = Scene::bundled("breast").unwrap();
    scene.discretization.resolution = Resolution::Level(-1);
    let model = TissueModel::new(&scene).unwrap();
    let found = place(&model, &PlacementOptions::default()).unwrap();
    for study in found.paddles.iter().map(|paddle| &paddle.static_study).chain([&found.no_paddle.static_study]) {
        assert_eq!((study.reached_depth, &study.failure), (scene.needle.depth, &None));
    }
}
