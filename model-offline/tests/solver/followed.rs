//! Insertions on graded nodes are followed as far as the tissue goes.

use model_offline::placement::{PlacementOptions, discretise, place};
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

/// A stiff strip in a thin slab.
const STRIP: &str = r#"
[scene]
name = "strip"
dimension = 2
units = { length = "mm", stress = "kPa" }
[domain]
outline = [[0.0, 0.0], [90.0, 0.0], [100.0, 14.0], [10.0, 14.0]]
[material]
model = "neo-hookean"
lambda = 20.0
mu = 2.0
[[inclusion]]
outline = [[20.0, 5.0], [80.0, 5.0], [80.0, 6.5], [20.0, 6.5]]
stiffness = 100.0
[immobile]
paths = [{ edge = 0, from = 0.0, to = 0.25 }, { edge = 1 }]
[needle]
contact = [[46.0, 14.0], [54.0, 14.0]]
axis = [0.1, -0.99]
depth = 2.0
increments = 5
[target]
position = [56.0, 9.5]
[[paddle]]
index = 1
segment = [[25.0, 14.0], [33.0, 14.0]]
[[paddle]]
index = 2
segment = [[66.0, 14.0], [76.0, 14.0]]
[[paddle]]
index = 3
segment = [[50.0, 0.0], [60.0, 0.0]]
[[paddle]]
index = 4
segment = { edge = 3, from = 0.2, to = 0.8 }
[discretization]
tolerance = 0.05
"#;

/// The strip, without a paddle: on its nodes an increment does not converge in eight pieces, as many as are
/// tried first where nodes were refined, and does in more. What is not converged is no depth at which the law gives way.
#[test]
fn what_does_not_converge_in_few_pieces_is_asked_again_in_more() {
    let scene = Scene::parse(STRIP, "strip.toml").unwrap();
    let model = discretise(&scene).unwrap().0;
    let found = place(&model, &PlacementOptions::default()).unwrap();
    for study in found.paddles.iter().map(|paddle| &paddle.static_study).chain([&found.no_paddle.static_study]) {
        assert_eq!((study.reached_depth, &study.failure), (scene.needle.depth, &None));
    }
}

/// A strip a hundred million times as stiff is rigid, as one a million times as stiff is. What rounding leaves of its energy, eight
/// digits above that of the slab's, is no reason to take a step for one uphill. By quadratic triangles at the tolerance the target
/// goes 1.713 along the needle.
#[test]
fn a_strip_as_stiff_as_rounding_allows_is_rigid() {
    let along = |stiffness: &str| {
        let text = STRIP.replace("stiffness = 100.0", stiffness).replace("tolerance = 0.05", "spacing = 1.0");
        let scene = Scene::parse(&text, "strip.toml").unwrap();
        let found = place(&TissueModel::new(&scene).unwrap(), &PlacementOptions::default()).unwrap();
        let study = &found.paddles[0].static_study;
        assert_eq!((study.reached_depth, &study.failure), (scene.needle.depth, &None), "{stiffness}");
        let [x, y] = *study.target_displacement.last().unwrap();
        x * scene.needle.axis.x + y * scene.needle.axis.y
    };
    let [stiff, stiffer] = ["stiffness = 1e6", "stiffness = 1e8"].map(along);
    assert!((stiff / stiffer - 1.0).abs() < 0.01 && (stiffer - 1.713).abs() < 0.02, "{stiff} {stiffer}");
}
