//! Which of its own effects a scene needs, and what else is then fitted.

use model_offline::material::{Material, Relaxation};
use model_offline::model::{ModelError, TissueModel};
use model_offline::needle::Course;
use model_offline::scene::{BUNDLED, Breathing, Effect, Scene};
use model_offline::study::fit::{Alternative, Change, FitError, RejectionReason, fit, judge_world};
use nalgebra::{Matrix2, Vector2};

/// A bundled scene with breath and creep of these sizes: amplitude over the depth, share of the stress.
fn with(name: &str, amplitude: f64, share: f64) -> Scene {
    let mut scene = Scene::bundled(name).unwrap();
    let (amplitude, direction) = (amplitude * scene.needle.depth, scene.needle.orthogonal());
    scene.motion.breathing = Some(Breathing { period: 4.0, amplitude, direction, ..Breathing::default() });
    scene.material = scene.material.clone().relaxing(Relaxation::new([(share, 2.0)]).unwrap());
    for own in scene.inclusions.iter_mut().filter_map(|inclusion| inclusion.material.as_mut()) {
        *own = own.clone().relaxing(Relaxation::new([(share, 2.0)]).unwrap());
    }
    scene
}

fn needed(scene: &Scene, tolerance: f64) -> Vec<Effect> {
    judge_world(scene, tolerance, 2).unwrap().needed
}

/// The paper's scene has no unit of length and a depth of 0.1, the breast is in millimetres with a depth of 12.
#[test]
fn what_hardly_changes_anything_is_left_out_in_any_unit() {
    for name in ["paper", "breast", "prostate"] {
        assert_eq!(needed(&with(name, 1e-5, 1e-4), 0.01), [], "{name}");
        assert_eq!(needed(&with(name, 0.2, 1e-4), 0.01), [Effect::Breathing], "{name}");
        let creeps = needed(&with(name, 1e-5, 0.5), 0.002);
        assert_eq!(creeps, [Effect::Creep], "{name}");
        assert_eq!(needed(&with(name, 0.2, 0.5), 0.002), [Effect::Creep, Effect::Breathing], "{name}");
    }
}

/// A fit adds nothing to a scene: only what it has is tried.
#[test]
fn only_the_scenes_own_effects_are_tried() {
    let plain = Scene::bundled("breast").unwrap();
    assert_eq!(plain.own_effects(), []);
    let whole = Scene::bundled("breast-world").unwrap();
    assert_eq!(whole.own_effects(), [Effect::Shaft, Effect::Creep, Effect::Breathing]);
    assert_eq!(whole.keeping_only(&whole.own_effects()).hash(), whole.hash());
    assert_eq!(whole.keeping_only(&[]).hash(), whole.without_a_past().hash());
    // A cough is a motion, and no breath is added to it.
    let mut coughs = plain.clone();
    coughs.motion.surge =
        Some(model_offline::scene::Surge { at: 1.0, last: 0.5, amplitude: 1.0, direction: Vector2::new(1.0, 0.0) });
    assert_eq!(coughs.own_effects(), [Effect::Breathing]);
    let kept = coughs.keeping_only(&[Effect::Breathing]);
    assert!(kept.motion.breathing.is_none() && kept.motion.surge.is_some());
    assert!(coughs.keeping_only(&[]).motion.is_none() && !kept.relaxes() && kept.needle.shaft.is_none());
}

#[test]
fn a_smaller_tolerance_never_needs_fewer_effects() {
    for name in ["breast-world", "prostate-world"] {
        let scene = Scene::bundled(name).unwrap();
        let counts: Vec<usize> = [10.0, 0.3, 0.1, 0.03, 1e-9].iter().map(|t| needed(&scene, *t).len()).collect();
        assert!(counts.windows(2).all(|pair| pair[0] <= pair[1]), "{name}: {counts:?}");
        assert_eq!((counts[0], counts[4]), (0, 3), "{name}: {counts:?}");
        assert!(counts.iter().any(|count| (1..=2).contains(count)), "{name}: {counts:?}");
    }
}

#[test]
fn threads_and_repetition_change_nothing() {
    let scene = Scene::bundled("prostate-world").unwrap();
    let told = |threads: usize| format!("{:?}", judge_world(&scene, 0.004, threads).unwrap());
    let first = told(1);
    assert_eq!(first, told(1));
    assert_eq!(first, told(2));
    assert_eq!(first, told(5));
}

/// Targets along the insertion, and the controllability measure at its end, by nothing but a course.
fn walked(scene: &Scene, paddle: u32) -> (Vec<Vector2<f64>>, f64) {
    let model = TissueModel::new(scene).unwrap();
    let mut course = Course::at_rest(&model, Some(scene.paddle_position(paddle).unwrap())).unwrap();
    let seconds = scene.needle.depth / scene.needle.speed;
    let targets = (1..=60)
        .map(|step| {
            let share = f64::from(step) / 60.0;
            let pose = model.pose_at(seconds * share, scene.needle.depth * share);
            course.take_in(pose, seconds / 60.0).unwrap();
            course.target_displacement()
        })
        .collect();
    let jacobian: Matrix2<f64> = course.actuation_jacobian().unwrap();
    (targets, jacobian.try_inverse().map_or(f64::NAN, |inverse| (inverse * scene.needle.orthogonal()).norm()))
}

#[test]
fn the_numbers_that_reject_are_those_of_insertions_side_by_side() {
    for name in ["breast-world", "prostate-world"] {
        let scene = Scene::bundled(name).unwrap();
        let found = judge_world(&scene, 1e-6, 2).unwrap();
        let (all, measure) = walked(&scene, found.paddle);
        let largest = all.iter().map(Vector2::norm).fold(0.0, f64::max);
        let mut sizes = Vec::new();
        for rejected in &found.rejected {
            let (Alternative::Effects(effects), RejectionReason::LeavesOut(change)) =
                (rejected.alternative, &rejected.reason)
            else {
                panic!("{name}: {rejected:?}")
            };
            sizes.push(effects.len());
            let (targets, own) = walked(&scene.keeping_only(effects), found.paddle);
            let along = |axis: Vector2<f64>| {
                targets.iter().zip(&all).map(|(one, other)| axis.dot(&(one - other)).abs()).fold(0.0, f64::max)
            };
            let target = along(scene.needle.axis).max(along(scene.needle.orthogonal())) / largest;
            let controllability = (own / measure - 1.0).abs();
            assert!((target - change.target).abs() <= 1e-12 * target, "{name} {effects:?}: {target} {change:?}");
            assert!((controllability - change.controllability).abs() <= 1e-9, "{name} {effects:?}: {change:?}");
            assert_eq!(rejected.reason.number(), Some(target.max(change.controllability)));
        }
        assert_eq!(sizes, [0, 1, 1, 1, 2, 2, 2], "{name}");
        assert_eq!(found.change, Change { target: 0.0, controllability: 0.0 });
    }
}

/// Forces that no tissue of this kind bears.
#[test]
fn a_world_that_cannot_be_followed_is_an_error_with_its_effects() {
    let mut scene = Scene::bundled("breast-world").unwrap();
    scene.material = scene.material.linearised();
    let modulus = Material::<2>::rest_stiffness(&scene.material);
    let depth = scene.needle.depth;
    let shaft = scene.needle.shaft.as_mut().unwrap();
    shaft.puncture_force = 0.0;
    (shaft.resistance.cutting_force, shaft.resistance.kinetic_friction) = (1e3 * modulus * depth, 1e3 * modulus);
    match judge_world(&scene, 0.01, 2) {
        Err(error @ FitError::World { .. }) => {
            assert!(error.to_string().contains("(shaft, creep, breathing)"), "{error}");
        }
        other => panic!("{other:?}"),
    }
    // No paddle: no model to judge with.
    let mut free = Scene::bundled("breast-world").unwrap();
    free.paddles.clear();
    assert_eq!(judge_world(&free, 0.01, 1).err(), Some(FitError::Model(ModelError::NoPaddleControls)));
}

/// `[fit] effects` names effects that the scene has, each once.
#[test]
fn a_scene_file_may_say_which_effects_it_needs() {
    let text = |name: &str, effects: &str| {
        let (_, text) = BUNDLED.iter().find(|(bundled, _)| *bundled == name).unwrap();
        let fit = "plant = \"reduced\"\ntable_knots = 21\ntable_scalar = \"f64\"";
        format!("{text}\n[fit]\n{fit}\neffects = {effects}\n")
    };
    let read = Scene::parse(&text("breast-world", "[\"shaft\", \"breathing\"]"), "fitted.toml").unwrap();
    assert_eq!(read.fit.as_ref().unwrap().effects, Some(vec![Effect::Shaft, Effect::Breathing]));
    // It is a note: the scene keeps all that it has.
    assert_eq!(read.hash(), Scene::bundled("breast-world").unwrap().hash());
    assert!(Scene::parse(&text("breast", "[]"), "fitted.toml").is_ok());
    for (name, effects, word) in [
        ("breast", "[\"shaft\"]", "no such effect"),
        ("breast-world", "[\"creep\", \"creep\"]", "twice"),
        ("breast-world", "[\"gravity\"]", "unknown variant"),
    ] {
        let error = Scene::parse(&text(name, effects), "fitted.toml").unwrap_err();
        assert!(error.to_string().contains(word) && error.line > 40, "{name} {effects}: {error} {}", error.line);
    }
}

/// The rest is fitted too, and the scene that is written says what it needs and keeps what it has.
#[test]
fn a_fitted_world_is_written_with_what_it_needs() {
    let (_, text) = BUNDLED.iter().find(|(name, _)| *name == "breast-world").unwrap();
    let scene = Scene::parse(text, "breast-world").unwrap();
    let found = fit(&scene, 0.4, 2).unwrap();
    let world = found.world.as_ref().unwrap();
    let own = scene.own_effects();
    assert_eq!(own.len(), world.needed.len() + world.left_out.len());
    assert!(world.needed.contains(&Effect::Shaft) && !world.left_out.is_empty(), "{world:?}");
    assert!(world.change.worst() <= 0.15 * 0.4 && world.change.worst() > 0.0, "{world:?}");
    // Everything else that is left out stays within the whole.
    let apart = world.end_to_end.change.unwrap();
    assert!(apart.worst() > 0.0 && world.end_to_end.nodes[0] < world.end_to_end.nodes[1], "{world:?}");
    assert!(!world.is_table_fitted && found.chosen.table_knots == 21 && found.step_us.is_nan());
    let summary = found.summary();
    assert!(summary.contains("world needs: shaft") && summary.contains("creep left out"), "{summary}");
    let written = Scene::parse(&found.written_into(text).unwrap(), "fitted.toml").unwrap();
    assert_eq!(written.fit.as_ref().unwrap().effects.as_ref(), Some(&world.needed));
    assert_eq!(written.own_effects(), own);
}

/// What a fit says of a scene without effects is what it always said.
#[test]
fn a_scene_without_effects_has_no_world() {
    let scene = Scene::bundled("paper").unwrap();
    let found = fit(&scene, 0.2, 2).unwrap();
    assert!(found.world.is_none() && found.section().effects.is_none());
    let text = serde_json::to_string(&found).unwrap();
    assert!(!text.contains("\"world\"") && !found.summary().contains("world"), "{text}");
    // The shares of a scene that has no effect to leave out.
    assert!((found.chosen.plant_tolerance - 0.3 * 0.2).abs() < 1e-15);
    // Hardly an effect: the scene's rest, fitted within shares that leave room for it.
    let found = fit(&with("paper", 1e-6, 1e-6), 0.2, 2).unwrap();
    let world = found.world.as_ref().unwrap();
    assert!(world.needed.is_empty() && world.is_table_fitted && found.step_us > 0.0, "{world:?}");
    assert_eq!(found.section().effects, Some(Vec::new()));
    assert!((found.chosen.plant_tolerance - 0.15 * 0.2).abs() < 1e-15);
}
