//! Worlds that are not the controller's model: what their effects do, and what is reduced of them.

use model_offline::material::Relaxation;
use model_offline::model::{Pose, TissueModel};
use model_offline::needle::{Course, SlippingNeedle};
use model_offline::reduction::along_path::{AlongPath, PathOptions, along};
use model_offline::scene::{Breathing, Effect, Scene, Surge};
use model_offline::study::effects::{Variation, compare};
use model_offline::table::{TableOptions, build};
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
        let path = Arc::new(AlongPath::learn(&model, Some(paddle), &way(&model), &options).unwrap());
        let (mut covered, mut trials, mut worst, mut largest, mut tightest) = (0, 0, 0.0_f64, 0.0_f64, f64::INFINITY);
        for trial in 0..6 {
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
                let error = (body.target_displacement() - truth.target).norm();
                worst = worst.max(error / depth);
                largest = largest.max(truth.target.norm() / depth);
                trials += 1;
                covered += i32::from(error <= body.error_estimate());
                tightest = tightest.min(body.error_estimate() / error.max(1e-12));
            }
        }
        let share = f64::from(covered) / f64::from(trials);
        println!(
            "{name}: {share:.3} covered, worst error {worst:.1e} of the depth, target moved {largest:.2}, estimate at least {tightest:.2} times the error"
        );
        assert!(share >= 0.95, "{name}: {share}");
        // Ways as far as a tenth of the depth beside it: where friction turns, the path does not know it.
        assert!(worst < 0.06, "{name}: {worst}");
    }
}

/// Everything that touches the body goes the same way: nothing is strained, whatever the tissue is made of.
#[test]
fn a_body_that_is_carried_along_feels_nothing() {
    for (name, effects) in [("breast", &[][..]), ("prostate", &[Effect::Creep][..]), ("paper", &[Effect::Creep][..])] {
        let model = TissueModel::new(&scene(name, effects)).unwrap();
        let scene = model.scene();
        let by = 0.1 * scene.needle.depth;
        let way = scene.needle.axis * by + scene.needle.orthogonal() * (2.0 * by);
        let mut course = Course::at_rest(&model, Some(0)).unwrap();
        course.take_in(Pose { depth: by, lateral: 2.0 * by, base: way, paddle: way }, 3.0).unwrap();
        let off = (course.target_displacement() - way).norm();
        assert!(off < 1e-8 * way.norm(), "{name}: {off}");
        // The force that the same way of the needle alone takes.
        let mut alone = Course::at_rest(&model, Some(0)).unwrap();
        alone.take_in(Pose { depth: by, ..Pose::default() }, 3.0).unwrap();
        assert!(course.base_force().abs() < 1e-6 * alone.base_force(), "{name}: {}", course.base_force());
    }
    // A needle that is in, and slips, is no different.
    let model = TissueModel::new(&scene("breast", &EVERYTHING)).unwrap();
    let depth = model.scene().needle.depth;
    let mut course = Course::at_rest(&model, Some(0)).unwrap();
    for k in 1..=40 {
        course.take_in(Pose { depth: depth * f64::from(k) / 40.0, ..Pose::default() }, 0.1).unwrap();
    }
    let (before, force) = (course.target_displacement(), course.base_force());
    let aside = model.scene().needle.orthogonal() * (0.05 * depth);
    course.take_in(Pose { depth, lateral: 0.05 * depth, base: aside, paddle: aside }, 0.0).unwrap();
    let off = (course.target_displacement() - before - aside).norm();
    assert!(off < 1e-3 * aside.norm(), "{off}");
    assert!((course.base_force() - force).abs() < 1e-3 * force, "{} {force}", course.base_force());
}

/// Whether a factor is kept from step to step changes nothing but the time that it takes, the Jacobian included.
#[test]
fn small_steps_lead_to_the_same_states() {
    for (name, effects) in [("breast", &[Effect::Creep][..]), ("prostate", &EVERYTHING[1..]), ("paper", &[][..])] {
        let model = TissueModel::new(&scene(name, effects)).unwrap();
        let depth = model.scene().needle.depth;
        let mut exact = Course::at_rest(&model, Some(1)).unwrap();
        let mut small = Course::in_small_steps(&model, Some(1)).unwrap();
        for k in 1..=60 {
            let time = f64::from(k) / 12.0;
            let paddle = Vector2::new((2.0 * time).sin(), time.sin()) * (0.1 * depth);
            let pose = Pose { paddle, ..way(&model)(time) };
            exact.take_in(pose, 1.0 / 12.0).unwrap();
            small.take_in(pose, 1.0 / 12.0).unwrap();
            let off = (exact.target_displacement() - small.target_displacement()).norm();
            assert!(off < 1e-6 * depth, "{name}, step {k}: {off}");
        }
        let (exact, small) = (exact.actuation_jacobian().unwrap(), small.actuation_jacobian().unwrap());
        assert!((exact - small).norm() < 1e-5 * exact.norm(), "{name}: {exact} {small}");
    }
}

/// The paddle's path of a table, walked in steps of another size.
#[test]
fn tables_along_an_insertion_hold_the_target() {
    for (name, effects, paddle) in [("breast", &EVERYTHING[..2], 3), ("prostate", &[Effect::Shaft][..], 3)] {
        let mut scene = scene(name, effects);
        scene.set_speed(scene.needle.depth / 5.0);
        let model = TissueModel::new(&scene).unwrap();
        let table = build(&model, paddle, &TableOptions::default()).unwrap();
        let position = Some(scene.paddle_position(paddle).unwrap());
        let (normal, depth) = (scene.needle.orthogonal(), scene.needle.depth);
        assert_eq!((table.scene_hash, table.knots[table.knots.len() - 1].depth), (scene.hash(), depth));
        let errors = |steered: bool| {
            let mut course = Course::at_rest(&model, position).unwrap();
            let (mut largest, mut squares) = (0.0_f64, 0.0);
            let steps = 130;
            for step in 1..=steps {
                let at = depth * f64::from(step) / f64::from(steps);
                let k = table.knots.partition_point(|knot| knot.depth < at).clamp(1, table.knots.len() - 1);
                let [a, b] = [&table.knots[k - 1], &table.knots[k]];
                let share = (at - a.depth) / (b.depth - a.depth);
                let paddle = if steered { a.paddle_path.lerp(&b.paddle_path, share) } else { Vector2::zeros() };
                course.take_in(Pose { depth: at, paddle, ..Pose::default() }, 5.0 / f64::from(steps)).unwrap();
                let error = normal.dot(&course.target_displacement());
                (largest, squares) = (largest.max(error.abs()), squares + error * error);
            }
            [largest, f64::sqrt(squares / f64::from(steps))]
        };
        let (still, held) = (errors(false), errors(true));
        println!("{name}: {still:.4?} still, {held:.5?} held");
        // The tissue jumps back where the skin gives way, between two knots.
        assert!(held[0] < 0.25 * still[0] && held[1] < 0.05 * still[1], "{name}: {held:?} {still:?}");
    }
}

#[test]
fn a_scene_says_what_its_simplest_model_leaves_out() {
    for name in ["paper", "breast", "prostate"] {
        let plain = Scene::bundled(name).unwrap();
        assert!(!plain.has_a_past());
        let full = scene(name, &EVERYTHING);
        assert!(full.has_a_past() && full.relaxes() && full.needle.shaft.is_some() && !full.motion.is_none());
        assert_eq!(full.without_a_past().hash(), plain.hash());
        assert_eq!(full.with_only(&[]).hash(), plain.hash());
        assert_eq!(full.with_only(&EVERYTHING).hash(), full.hash());
        // The tissue is another one, and who breathes is no tissue.
        assert_ne!(full.hash(), plain.hash());
        assert_eq!(plain.with_effect(Effect::Breathing).hash(), plain.hash());
    }
}

/// Bundled scenes where another model is enough, and one where all of it counts.
#[test]
fn a_scene_needs_what_changes_its_answers() {
    let needs = |name: &str, tolerance: f64| -> Vec<&'static str> {
        let found = compare(&Scene::bundled(name).unwrap(), tolerance, 2).unwrap();
        println!("{}", found.table());
        assert!(found.svg().contains("</svg>") && found.csv().starts_with(b"effect,"));
        found.effects.iter().filter(|tried| tried.is_needed).map(|tried| tried.variation.name()).collect()
    };
    assert_eq!(needs("breast", 0.01), ["linear-law", "shaft", "creep", "breathing"]);
    assert_eq!(needs("prostate", 0.01), ["linear-law", "shaft", "breathing"]);
    assert_eq!(needs("prostate", 0.9), [""; 0]);
    // Linear tissue of one relaxation that displacements drive moves as elastic tissue: creep is nothing but force.
    let mut linear = Scene::bundled("breast").unwrap();
    linear.material = linear.material.linearised();
    let found = compare(&linear, 0.01, 2).unwrap();
    let creep = found.effects.iter().find(|tried| tried.variation == Variation::Effect(Effect::Creep)).unwrap();
    let added = creep.added.unwrap();
    assert!(!creep.is_needed && added.orthogonal < 1e-6 && added.axial < 1e-6, "{creep:?}");
    assert!(added.base_force < -0.05, "{creep:?}");
}

/// Skin that is open from the first touch on: at depth 0 the needle holds the point that it touches.
#[test]
fn a_needle_through_open_skin_has_a_jacobian_from_the_start_and_a_table() {
    for name in ["paper", "breast"] {
        let mut scene = scene(name, &[Effect::Shaft]);
        scene.needle.shaft.as_mut().unwrap().puncture_force = 0.0;
        let model = TissueModel::new(&scene).unwrap();
        let mut course = Course::at_rest(&model, Some(0)).unwrap();
        let free = course.actuation_jacobian().unwrap();
        let step = 1e-4 * scene.needle.depth;
        for axis in 0..2 {
            let off = |step: f64| {
                let mut moved = course.clone();
                moved.take_in(Pose { paddle: Vector2::ith(axis, step), ..Pose::default() }, 0.0).unwrap();
                (moved.target_displacement() / step - free.column(axis)).norm()
            };
            for step in [step, -step] {
                assert!(off(step) < 3e-4 * free.norm(), "{name} {axis} {step}: {}", off(step));
            }
        }
        let table =
            build(&model, scene.paddles[2].index, &TableOptions { knots: 5, ..TableOptions::default() }).unwrap();
        assert_eq!(table.knots.len(), 5);
    }
}

/// With hardly any relaxation the table along the insertion is that of the states.
#[test]
fn tissue_that_hardly_relaxes_has_the_table_of_elastic_tissue() {
    for (name, paddle) in [("breast", 3), ("prostate", 3)] {
        let elastic = Scene::bundled(name).unwrap();
        let mut hardly = elastic.clone();
        hardly.material = elastic.material.clone().relaxing(Relaxation::new([(1e-9, 1.0)]).unwrap());
        let of = |scene: &Scene| {
            build(&TissueModel::new(scene).unwrap(), paddle, &TableOptions { knots: 11, ..TableOptions::default() })
                .unwrap()
        };
        let (states, along) = (of(&elastic), of(&hardly));
        let largest = states.knots.iter().map(|knot| knot.paddle_path.norm()).fold(0.0, f64::max);
        for (one, other) in states.knots.iter().zip(&along.knots) {
            // The way of the paddle along which the target stays is walked in other steps.
            let off = (one.paddle_path - other.paddle_path).norm();
            assert!(off < 0.03 * largest, "{name} at {}: {off} of {largest}", one.depth);
            let off = (one.jacobian[0] - other.jacobian[0]).norm();
            assert!(off < 0.02 * one.jacobian[0].norm(), "{name} at {}: {off}", one.depth);
            let off = (one.static_target_displacement - other.static_target_displacement).norm();
            assert!(off < 1e-6 * (1.0 + one.static_target_displacement.norm()), "{name} at {}: {off}", one.depth);
        }
    }
}

/// The balance of a needle in elastic tissue whose base moves.
#[test]
fn the_work_of_a_moving_base_is_in_the_balance() {
    for name in ["breast", "prostate"] {
        let mut scene = scene(name, &[Effect::Shaft]);
        scene.needle.shaft.as_mut().unwrap().puncture_force = 0.0;
        let model = TissueModel::new(&scene).unwrap();
        let (depth, normal) = (scene.needle.depth, scene.needle.orthogonal());
        let mut needle = SlippingNeedle::at_rest(&model, Some(0)).unwrap();
        for k in 1..=60 {
            needle.advance(depth * f64::from(k) / 60.0, Vector2::zeros()).unwrap();
        }
        let before = needle.energy();
        for k in 1..=40 {
            let base = normal * (0.05 * depth * f64::from(k) / 40.0);
            needle.take_in(Pose { depth, base, ..Pose::default() }, 0.0).unwrap();
        }
        let now = needle.energy();
        let work = now.work + now.base + now.paddle - before.work - before.base - before.paddle;
        let spent = now.stored + now.friction + now.cutting - before.stored - before.friction - before.cutting;
        println!("{name}: {work} {spent}");
        assert!(
            (now.base - before.base).abs() > 0.0 && (work - spent).abs() < 0.02 * work.abs(),
            "{name}: {work} {spent}"
        );
    }
}

/// Steps follow what moves the patient, or there is no path.
#[test]
fn a_cough_between_two_steps_is_no_less_a_cough() {
    let mut scene = Scene::bundled("paper").unwrap();
    let surge = Surge { at: 2.51, last: 0.03, amplitude: 0.02, direction: Vector2::new(1.0, 0.0) };
    scene.motion.surge = Some(surge);
    let model = TissueModel::new(&scene).unwrap();
    let options = PathOptions { steered: false, ..PathOptions::new(5.5) };
    let path =
        Arc::new(AlongPath::learn(&model, None, &way(&model), &options.following(&scene.motion).unwrap()).unwrap());
    let mut body = path.body();
    let at = |body: &mut model_offline::reduction::PathBody, time: f64| {
        body.go_to(time, Vector2::zeros());
        body.target_displacement()
    };
    let (still, coughs) = (at(&mut body, 2.5), at(&mut body, 2.525));
    assert!((coughs - still).x > 0.2 * surge.amplitude, "{still} {coughs}");
    scene.motion.surge = Some(Surge { last: 1e-4, ..surge });
    assert!(options.following(&scene.motion).is_err());
}

/// A needle that waits at breathing skin leads it, comes back to rest with it, and goes in after that.
#[test]
fn a_needle_waits_at_breathing_skin() {
    for (name, creeps) in [("paper", false), ("breast", false), ("prostate", true)] {
        let mut effects = vec![Effect::Shaft, Effect::Breathing];
        effects.extend(creeps.then_some(Effect::Creep));
        let mut scene = Scene::bundled(name).unwrap().with_only(&effects);
        scene.needle.shaft.as_mut().unwrap().puncture_force = 0.0;
        let Breathing { period, amplitude, .. } = scene.motion.breathing.unwrap();
        let model = TissueModel::new(&scene).unwrap();
        let mut course = Course::at_rest(&model, Some(2)).unwrap();
        let interval = period / 20.0;
        let mut walk = |from: u32, to: u32, speed: f64| {
            let mut largest = 0.0_f64;
            for k in from..to {
                let time = interval * f64::from(k + 1);
                let depth = speed * f64::from(k + 1 - from);
                course.take_in(model.pose_at(time, depth), interval).unwrap();
                largest = largest.max(course.target_displacement().norm());
            }
            (largest, course.target_displacement().norm())
        };
        let (largest, left) = walk(0, 20, 0.0);
        assert!(largest > 0.3 * amplitude, "{name}: {largest} of {amplitude}");
        // What has been held meanwhile has relaxed around it.
        assert!(left < if creeps { 0.2 } else { 1e-6 } * largest, "{name}: {left} of {largest}");
        let (_, inside) = walk(20, 25, 0.05 * scene.needle.depth);
        assert!(inside > 0.0, "{name}");
    }
}

/// Through a patient who breathes by a tenth of the depth: waits at the skin, goes in, and comes back out.
fn in_and_out_of_a_breath(name: &str, direction: impl Fn(&Scene) -> Vector2<f64>, open: bool, wait: f64) {
    let mut scene = Scene::bundled(name).unwrap().with_only(&[Effect::Shaft, Effect::Breathing]);
    let depth = scene.needle.depth;
    let direction = direction(&scene);
    let breathing = scene.motion.breathing.as_mut().unwrap();
    (breathing.direction, breathing.amplitude) = (direction, 0.1 * depth);
    if open {
        scene.needle.shaft.as_mut().unwrap().puncture_force = 0.0;
    }
    let model = TissueModel::new(&scene).unwrap();
    let mut course = Course::at_rest(&model, None).unwrap();
    let (interval, mut cut) = (0.05, 0.0_f64);
    // To the end of a breath, when the skin is where it was.
    let steps = (((wait + 8.0) / 4.0).ceil() * 4.0 / interval).round() as u32;
    let mut deepest = (0.0, 0.0, 0.0);
    for k in 1..=steps {
        let time = interval * f64::from(k);
        // In within five seconds, out within three.
        let at = if time <= wait + 5.0 { (time - wait).max(0.0) / 5.0 } else { 1.0 - (time - wait - 5.0) / 3.0 };
        let taken = course.take_in(model.pose_at(time, depth * at.max(0.0)), interval);
        taken.unwrap_or_else(|error| panic!("{name} {direction} open: {open} wait: {wait}, {time} s: {error}"));
        let reading = course.reading();
        let now = reading.cut_length.unwrap_or(0.0);
        assert!(now >= cut - 1e-9 * depth, "{name}: what has been passed stays passed: {now} after {cut}");
        cut = now;
        if reading.depth > deepest.0 {
            deepest = (reading.depth, reading.base_force, cut);
        }
    }
    assert!(deepest.1 > 0.0 && deepest.2 > 0.2 * depth && deepest.2 < 1.2 * depth, "{name} {deepest:?}");
    // A needle that is out holds nothing.
    let left = course.reading();
    assert!(left.base_force.abs() < 0.05 * deepest.1, "{name}: {} of {}", left.base_force, deepest.1);
}

#[test]
fn a_breath_along_the_needle_is_followed_in_and_out() {
    for name in ["paper", "breast", "prostate"] {
        for sign in [1.0, -1.0] {
            for open in [true, false] {
                in_and_out_of_a_breath(name, |scene| scene.needle.axis * sign, open, 0.0);
            }
        }
    }
}

#[test]
fn a_needle_that_waited_at_the_skin_is_drawn_back_to_it() {
    for name in ["paper", "breast", "prostate"] {
        for wait in [0.0, 1.0] {
            in_and_out_of_a_breath(name, |scene| scene.needle.orthogonal(), false, wait);
        }
        for (sign, open) in [(1.0, true), (-1.0, true), (1.0, false), (-1.0, false)] {
            in_and_out_of_a_breath(name, |scene| scene.needle.axis * sign, open, 1.0);
        }
    }
}

/// The skin gives way between two steps of the path: when, and how far the target jumps, is what the full model finds in steps
/// a hundredth as long.
#[test]
fn the_moment_when_the_skin_gives_way_is_found_within_a_step() {
    for name in ["breast", "prostate", "paper"] {
        let model = TissueModel::new(&scene(name, &[Effect::Shaft])).unwrap();
        let path = Arc::new(AlongPath::learn(&model, None, &way(&model), &PathOptions::new(5.5)).unwrap());
        let interval = path.interval();
        let mut course = Course::at_rest(&model, None).unwrap();
        let mut k = 0_u32;
        while course.pushes_the_skin() {
            k += 1;
            course.take_in(way(&model)(interval * f64::from(k)), interval).unwrap();
        }
        // The same way up to the step before, and then in small steps.
        let mut course = Course::at_rest(&model, None).unwrap();
        (1..k).for_each(|k| course.take_in(way(&model)(interval * f64::from(k)), interval).unwrap());
        let begin = interval * f64::from(k - 1);
        let mut body = path.body();
        let (mut jump, mut before) = (0.0, course.target_displacement());
        let (mut given_way, mut late) = (false, 0);
        for part in 1..=100 {
            let time = begin + interval * f64::from(part) / 100.0;
            course.take_in(way(&model)(time), interval / 100.0).unwrap();
            if !course.pushes_the_skin() && !given_way {
                given_way = true;
                jump = (course.target_displacement() - before).norm();
            }
            before = course.target_displacement();
            body.go_to(time, Vector2::zeros());
            let off = (body.target_displacement() - before).norm();
            late += u32::from(off > 0.01 * before.norm());
        }
        // Between a hundredth and the next nobody knows.
        assert!(given_way && jump > 0.1 * before.norm() && late <= 2, "{name}: off in {late} hundredths of a step");
        // And outside of that step a cubic does not swing.
        let mut swing = 0.0_f64;
        for part in 0..40 {
            let time = begin - interval * (0.05 + 0.05 * f64::from(part));
            body.go_to(time.max(0.0), Vector2::zeros());
            let here = body.target_displacement();
            body.go_to(begin, Vector2::zeros());
            swing = swing.max(here.norm() - body.target_displacement().norm());
        }
        assert!(swing < 0.02 * jump, "{name}: {swing} of a jump by {jump}");
    }
}
