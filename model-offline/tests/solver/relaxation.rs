//! Tissue whose stress relaxes, against closed forms of linear viscoelasticity and against the solver's other ways.

use model_offline::material::Relaxation;
use model_offline::model::{Body, Pose, TissueModel};
use model_offline::needle::{EnergyAccount, Inserted, Way, insert};
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector2;

const G: [f64; 2] = [0.3, 0.2];
const TAU: [f64; 2] = [3.2, 42.0];

fn series() -> Relaxation {
    Relaxation::new(G.into_iter().zip(TAU)).unwrap()
}

/// A scene of mine: `paper`, the body of another law and method, all of it or its inclusion relaxing.
fn scene(law: &str, discretization: &str, relaxing: bool, inclusion: &str) -> Scene {
    let text = model_offline::scene::BUNDLED[0].1;
    let (before, rest) = text.split_once("[material]").unwrap();
    let (_, after) = rest.split_once("[[inclusion]]").unwrap();
    let (_, after) = after.split_once("[immobile]").unwrap();
    let (after, _) = after.split_once("[discretization]").unwrap();
    let relaxation = if relaxing { "[material.relaxation]\ng = [0.3, 0.2]\ntau = [3.2, 42.0]\n" } else { "" };
    let text = format!(
        "{before}[material]\n{law}\n{relaxation}{inclusion}[immobile]{after}[discretization]\n{discretization}\n"
    );
    Scene::parse(&text, "relaxing.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

const LINEAR: &str = "model = \"linear\"\nlambda = 383.0\nmu = 318.5";
const FUNG: &str = "model = \"fung\"\nlambda = 383.0\nmu = 318.5\nc = 0.779\nlambda_c = 1.5\nmu_c = 1.0";
/// The stabilised default, a rule without stabilisation, and quadratic triangles.
const RULES: [&str; 3] =
    ["spacing = 0.1", "spacing = 0.1\nintegration = \"scni\"", "spacing = 0.1\nintegration = \"fem-t6\""];

fn body(model: &TissueModel) -> Body<'_> {
    model.body(Some(2), NewtonSettings { residual_tolerance: 1e-11, ..NewtonSettings::default() }).unwrap()
}

fn pose(depth: f64, paddle: [f64; 2]) -> Pose {
    Pose { depth, paddle: paddle.into(), ..Pose::default() }
}

#[test]
fn driven_by_displacements_linear_tissue_moves_as_elastic_tissue_and_its_reactions_fall_as_the_series() {
    for rule in RULES {
        let (relaxing, elastic) = (scene(LINEAR, rule, true, ""), scene(LINEAR, rule, false, ""));
        let (relaxing, elastic) = (TissueModel::new(&relaxing).unwrap(), TissueModel::new(&elastic).unwrap());
        let (mut relaxing, mut elastic) = (body(&relaxing), body(&elastic));
        let held = pose(0.05, [0.01, -0.02]);
        relaxing.take_in(held, 0.0).unwrap();
        elastic.take_to(held).unwrap();
        let at_once = relaxing.contact_force();
        assert!((at_once - elastic.contact_force()).abs() < 1e-9 * at_once.abs(), "{rule}");
        let mut time = 0.0;
        for step in [0.01, 0.5, 3.0, 20.0, 200.0] {
            time += step;
            relaxing.take_in(held, step).unwrap();
            let moved = (relaxing.target_displacement() - elastic.target_displacement()).norm();
            assert!(moved < 1e-9 * elastic.target_displacement().norm(), "{rule} {time}: {moved}");
            let remains = relaxing.contact_force() / at_once;
            assert!((remains - series().remaining(time)).abs() < 1e-9, "{rule} {time}: {remains}");
        }
        // Moved on at a steady rate from there: elastic displacements at every instant.
        for k in 1..=5 {
            let on = pose(0.05 + 0.01 * f64::from(k), [0.01, -0.02]);
            relaxing.take_in(on, 0.7).unwrap();
            elastic.take_to(on).unwrap();
            let moved = (relaxing.target_displacement() - elastic.target_displacement()).norm();
            assert!(moved < 1e-9 * elastic.target_displacement().norm(), "{rule} {k}: {moved}");
        }
    }
}

/// A dead load through the equilibrium's own door: on the target, with everything else held.
#[test]
fn under_a_constant_force_displacement_grows_as_the_creep_function() {
    let text = LINEAR;
    for rule in RULES {
        let mut one = scene(text, rule, false, "");
        let (g, tau) = (0.5, 3.2);
        one.material = one.material.relaxing(Relaxation::new([(g, tau)]).unwrap());
        let model = TissueModel::new(&one).unwrap();
        let creep = |t: f64| 1.0 / (1.0 - g) - g / (1.0 - g) * (-(1.0 - g) * t / tau).exp();
        let mut worst = [0.0_f64; 2];
        for (which, steps) in [100, 200].into_iter().enumerate() {
            let mut equilibrium = body(&model).equilibrium().clone();
            let mut load = vec![0.0; model.dofs()];
            // A node in the middle of the body.
            let node = model.positions().iter().position(|x| (x - Vector2::new(0.5, 0.5)).norm() < 1e-9).unwrap();
            load[2 * node] = 3.0;
            load[2 * node + 1] = -1.0;
            let held = vec![0.0; equilibrium.reactions().count()];
            equilibrium.begin(0.0);
            equilibrium.drive_loaded(&held, &load).unwrap();
            equilibrium.remember();
            let at_once = equilibrium.coefficients()[2 * node];
            for k in 1..=steps {
                let step = 10.0 / f64::from(steps);
                equilibrium.begin(step);
                equilibrium.drive_loaded(&held, &load).unwrap();
                equilibrium.remember();
                let grown = equilibrium.coefficients()[2 * node] / at_once;
                worst[which] = worst[which].max((grown - creep(step * f64::from(k))).abs());
            }
        }
        // Second order in the step: the scheme takes the stress to change linearly in it.
        assert!(worst[0] < 1e-4 && (3.8..4.2).contains(&(worst[0] / worst[1])), "{rule}: {worst:?}");
        // And with Richardson's extrapolation what is left is nothing.
        assert!((4.0 * worst[1] - worst[0]).abs() / 3.0 < 1e-6, "{rule}: {worst:?}");
    }
}

#[test]
fn a_base_that_shakes_meets_storage_and_loss_moduli() {
    let (relaxing, elastic) = (scene(LINEAR, RULES[0], true, ""), scene(LINEAR, RULES[0], false, ""));
    let (relaxing, elastic) = (TissueModel::new(&relaxing).unwrap(), TissueModel::new(&elastic).unwrap());
    let (mut relaxing, mut elastic) = (body(&relaxing), body(&elastic));
    let (period, steps) = (4.0, 400);
    let omega = std::f64::consts::TAU / period;
    let shaken = |phase: f64| Pose { base: Vector2::new(0.002, 0.003) * phase.sin(), ..Pose::default() };
    elastic.take_to(Pose { base: Vector2::new(0.002, 0.003), ..Pose::default() }).unwrap();
    let stiffness = elastic.contact_force();
    // Long enough for the slower term to forget the beginning: seven of its times.
    let (mut storage, mut loss) = (0.0, 0.0);
    let cycles = 75;
    for k in 1..=cycles * steps {
        let phase = omega * period * f64::from(k) / f64::from(steps);
        relaxing.take_in(shaken(phase), period / f64::from(steps)).unwrap();
        if k > (cycles - 1) * steps {
            let force = relaxing.contact_force() / stiffness;
            storage += 2.0 * force * phase.sin() / f64::from(steps);
            loss += 2.0 * force * phase.cos() / f64::from(steps);
        }
    }
    let terms = || G.into_iter().zip(TAU);
    let expected_storage: f64 = 1.0 - G.iter().sum::<f64>()
        + terms().map(|(g, tau)| g * (omega * tau).powi(2) / (1.0 + (omega * tau).powi(2))).sum::<f64>();
    let expected_loss: f64 = terms().map(|(g, tau)| g * omega * tau / (1.0 + (omega * tau).powi(2))).sum();
    // What is left of the beginning falls as e^(−300/42), of which a part is in phase with nothing.
    assert!((storage - expected_storage).abs() < 1e-4, "{storage} {expected_storage}");
    assert!((loss - expected_loss).abs() < 1e-4 * 1.0, "{loss} {expected_loss}");
}

#[test]
fn a_nonlinear_step_is_a_minimum_and_its_linearisation_is_exact() {
    // Across the law, an inclusion of its own that relaxes faster, and one that does not.
    let other = "[[inclusion]]\noutline = [[0.55, 0.25], [0.75, 0.25], [0.75, 0.45], [0.55, 0.45]]\n\
                 [inclusion.material]\nmodel = \"neo-hookean\"\nlambda = 900.0\nmu = 700.0\n";
    let faster = format!("{other}[inclusion.material.relaxation]\ng = [0.6]\ntau = [0.5]\n");
    for (rule, inclusion) in [(RULES[0], faster.as_str()), (RULES[2], other), (RULES[1], "")] {
        let model = TissueModel::new(&scene(FUNG, rule, true, inclusion)).unwrap();
        let mut at = body(&model);
        for k in 1..=5 {
            at.take_in(pose(0.01 * f64::from(k), [0.0, 0.0]), 0.8).unwrap();
        }
        // Within a step: the Jacobian is the slope of what the step finds.
        let step = 1e-6;
        let found = |paddle: [f64; 2]| {
            let mut moved = at.clone();
            moved.take_in(pose(0.06, paddle), 0.8).unwrap();
            moved
        };
        let jacobian = found([0.0, 0.0]).actuation_jacobian().unwrap();
        for axis in 0..2 {
            let by = |sign: f64| if axis == 0 { [sign * step, 0.0] } else { [0.0, sign * step] };
            let slope = (found(by(1.0)).target_displacement() - found(by(-1.0)).target_displacement()) / (2.0 * step);
            let off = (slope - jacobian.column(axis)).norm();
            assert!(off < 1e-6 * jacobian.norm(), "{rule} {axis}: {off}");
        }
        // Force and target as the steps are halved: second order, to what a hundred steps find.
        let at_depth = |steps: u32| {
            let mut body = body(&model);
            for k in 1..=steps {
                let share = f64::from(k) / f64::from(steps);
                body.take_in(pose(0.06 * share, [0.01 * share, 0.0]), 5.0 / f64::from(steps)).unwrap();
            }
            [body.contact_force(), body.target_displacement().x, body.target_displacement().y]
        };
        let (coarse, fine, finest) = (at_depth(5), at_depth(10), at_depth(80));
        for ((coarse, fine), finest) in coarse.iter().zip(fine).zip(finest) {
            let (first, second) = ((coarse - finest).abs(), (fine - finest).abs());
            assert!(second < 0.35 * first + 1e-7 * finest.abs(), "{rule}: {coarse} {fine} {finest}");
        }
    }
}

/// Fast in, then held: every displacement stays, so that every force along the shaft falls as the series.
#[test]
fn a_needle_that_rests_in_linear_tissue_is_held_by_forces_that_fall_as_the_series() {
    let mut one = scene(LINEAR, RULES[0], true, "");
    let text = "mechanics = \"shaft\"\ncutting_force = 0.5\nkinetic_friction = 0.2\n";
    let with = model_offline::scene::BUNDLED[0].1.replace("increments = 10\n", &format!("increments = 10\n{text}"));
    one.needle = Scene::parse(&with, "shaft.toml").unwrap().needle;
    let model = TissueModel::new(&one).unwrap();
    let way = Way { depth: 0.1, paddle: Vector2::zeros(), increments: 10, seconds: 0.0 };
    let Inserted::Within { mut needle, .. } = insert(&model, Some(2), way).unwrap() else { panic!("it is in") };
    let (force, tip, target) = (needle.base_force(), needle.tip_force(), needle.target_displacement());
    assert!(force > 0.5 && tip > 0.49, "{force} {tip}");
    let moved_in = needle.energy();
    let mut time = 0.0;
    for step in [0.1, 1.0, 10.0] {
        time += step;
        needle.take_in(needle.pose(), step).unwrap();
        let remains = series().remaining(time);
        assert!((needle.base_force() / force - remains).abs() < 1e-6, "{} {remains}", needle.base_force() / force);
        // How much of it is the tip's is not known: at the tip's own station friction holds the same point.
        assert!(needle.tip_force() < tip);
        let moved = (needle.target_displacement() - target).norm();
        assert!(moved < 1e-6 * target.norm(), "{moved}");
    }
    // Nobody works on a needle that rests.
    let EnergyAccount { work, paddle, base, .. } = needle.energy();
    assert_eq!((work, paddle, base), (moved_in.work, moved_in.paddle, moved_in.base));
}

#[test]
fn a_failed_step_is_forgotten() {
    let model = TissueModel::new(&scene(FUNG, RULES[0], true, "")).unwrap();
    let walk = |astray: bool| {
        let mut at = body(&model);
        at.take_in(pose(0.03, [0.0, 0.0]), 1.0).unwrap();
        if astray {
            assert!(at.take_in(pose(0.6, [0.0, 0.0]), 100.0).is_err());
        }
        at.take_in(pose(0.04, [0.0, 0.0]), 1.0).unwrap();
        [at.contact_force(), at.target_displacement().x, at.target_displacement().y]
    };
    for (with, without) in walk(true).into_iter().zip(walk(false)) {
        assert!((with - without).abs() < 1e-8 * without.abs(), "{with} {without}");
    }
}

#[test]
fn without_time_nothing_relaxes_and_without_relaxation_time_is_nothing() {
    let (relaxing, elastic) = (scene(FUNG, RULES[0], true, ""), scene(FUNG, RULES[0], false, ""));
    assert_ne!(relaxing.hash(), elastic.hash());
    let (relaxing, elastic) = (TissueModel::new(&relaxing).unwrap(), TissueModel::new(&elastic).unwrap());
    let state = |model: &TissueModel, seconds: Option<f64>| {
        let mut at = body(model);
        for k in 1..=4 {
            let pose = pose(0.02 * f64::from(k), [0.0, 0.001 * f64::from(k)]);
            match seconds {
                None => at.take_to(pose).unwrap(),
                Some(seconds) => at.take_in(pose, seconds).unwrap(),
            }
        }
        [at.contact_force(), at.target_displacement().x, at.target_displacement().y]
    };
    let bits = |numbers: [f64; 3]| numbers.map(f64::to_bits);
    assert_eq!(bits(state(&elastic, None)), bits(state(&elastic, Some(3.0))));
    assert_eq!(bits(state(&relaxing, None)), bits(state(&elastic, None)));
    for (fast, elastic) in state(&relaxing, Some(1e-9)).into_iter().zip(state(&elastic, None)) {
        assert!((fast - elastic).abs() < 1e-6 * elastic.abs(), "{fast} {elastic}");
    }
}

#[test]
fn scenes_say_what_is_wrong_with_a_relaxation() {
    let text = model_offline::scene::BUNDLED[0].1;
    for (section, says) in [
        ("g = [0.3]\ntau = [1.0, 2.0]", "1 shares g and 2 times tau"),
        ("g = []\ntau = [1.0]", "0 shares g and 1 times tau"),
        ("g = [0.7, 0.4]\ntau = [1.0, 2.0]", "nothing would hold in the end"),
        ("g = [0.7]\ntau = [-1.0]", "must be positive"),
        ("g = [nan]\ntau = [1.0]", "not a finite number"),
        ("g = [0.5]", "missing field `tau`"),
        ("g = [0.5]\ntau = [1.0]\nbeta = 1", "unknown field `beta`"),
    ] {
        let text = text.replace("[[inclusion]]", &format!("[material.relaxation]\n{section}\n[[inclusion]]"));
        let error = Scene::parse(&text, "bad.toml").unwrap_err();
        assert!(error.to_string().contains(says), "{section}: {error}");
    }
    // Without terms: none, as with a preset.
    let none = text.replace("[[inclusion]]", "[material.relaxation]\ng = []\ntau = []\n[[inclusion]]");
    assert_eq!(Scene::parse(&none, "none.toml").unwrap().hash(), Scene::parse(text, "plain.toml").unwrap().hash());

    let text = text.replace("[[inclusion]]", "[material.relaxation]\ng = [0.5]\ntau = [1.0]\n[[inclusion]]");
    let weakly = text.replace("[discretization]", "[discretization]\nessential = \"nitsche\"");
    let error = TissueModel::new(&Scene::parse(&weakly, "weakly.toml").unwrap()).unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("relaxes"), "{error}");
}
