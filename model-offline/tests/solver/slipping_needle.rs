//! A needle that slips, against independent numbers, closed forms and balances.

use model_offline::geometry::Polygon;
use model_offline::needle::{Inserted, NeedleError, SlippingNeedle, Way, insert};
use model_offline::scene::{BUNDLED, Inclusion, Resistance};
use model_offline::{NewtonSettings, Scene, TissueModel, discretise};
use nalgebra::{Matrix2, Vector2};

/// A bundled scene with these keys of a shaft, this depth and this discretization.
fn scene(name: &str, depth: f64, keys: &str, discretization: &str) -> Scene {
    let (_, text) = BUNDLED.iter().find(|(bundled, _)| *bundled == name).unwrap();
    let (head, _) = text.split_at(text.find("[discretization]").unwrap());
    let mut lines: Vec<String> = head.lines().map(str::to_owned).collect();
    for line in &mut lines {
        if line.starts_with("depth = ") {
            *line = format!("depth = {depth}\nmechanics = \"shaft\"\n{keys}");
        }
    }
    let text = format!("{}\n[discretization]\n{discretization}\n", lines.join("\n"));
    Scene::parse(&text, "shaft.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The paper's homogeneous body with the linear law of its rest moduli.
fn linear_paper(depth: f64, keys: &str, discretization: &str) -> Scene {
    let mut scene = scene("paper", depth, &format!("tip_length = 0.02\n{keys}"), discretization).without_inclusions();
    scene.material = scene.material.linearised();
    scene
}

fn within<'m>(model: &'m TissueModel, paddle: Option<usize>, increments: u32) -> SlippingNeedle<'m> {
    let way = Way { depth: model.scene().needle.depth, paddle: Vector2::zeros(), increments, seconds: 0.0 };
    match insert(model, paddle, way).unwrap() {
        Inserted::Within { needle, .. } => *needle,
        Inserted::Pushing(_) => panic!("the skin holds"),
    }
}

/// The continuum's response to a rigid needle along x = 0.5, 0.7 ≤ y ≤ 1, that slips: friction of 1 per length on all of the
/// shaft, or a force of 1 at the tip, spread over 0.02. Plane strain, graded quadratic triangles with 339,442 unknowns,
/// converged to 0.1 %, made with another program.
struct Continuum {
    paddle: Option<usize>,
    friction: [f64; 2],
    tip: [f64; 2],
    friction_at_entry: f64,
    tip_at_entry: f64,
}

const CONTINUUM: [Continuum; 2] = [
    Continuum {
        paddle: None,
        friction: [7.801e-6, -5.5079e-4],
        tip: [3.3647e-5, -1.93373e-3],
        friction_at_entry: -8.4909e-4,
        tip_at_entry: -2.12347e-3,
    },
    Continuum {
        paddle: Some(2),
        friction: [5.07e-6, -2.504e-4],
        tip: [2.719e-5, -9.3553e-4],
        friction_at_entry: -5.4169e-4,
        tip_at_entry: -1.10332e-3,
    },
];
/// d(target)/d(displacement of paddle 3) with the needle slipping, from the same source.
const JACOBIAN: [[f64; 2]; 2] = [[0.272738, 0.004257], [0.124422, 0.453603]];

#[test]
fn a_sliding_needle_does_to_the_body_what_it_does_to_the_continuum() {
    for (integration, tolerance) in [("fem-t6", 0.01), ("scni-stabilised", 0.02)] {
        let discretization = format!("tolerance = 0.01\nintegration = \"{integration}\"");
        for (keys, of_tip) in [("kinetic_friction = 1.0", false), ("cutting_force = 1.0", true)] {
            let (model, _) = discretise(&linear_paper(0.3, keys, &discretization)).unwrap();
            for continuum in &CONTINUUM {
                let mut needle = within(&model, continuum.paddle, 10);
                let (target, entry) = match of_tip {
                    false => (continuum.friction, continuum.friction_at_entry),
                    true => (continuum.tip, continuum.tip_at_entry),
                };
                let target = Vector2::from(target);
                let off = (needle.target_displacement() - target).norm() / target.norm();
                assert!(off < tolerance, "{integration}, {keys}, {:?}: target {off:.4}", continuum.paddle);
                let at_entry = model.displacement_at(&Vector2::new(0.5, 1.0), needle.equilibrium().coefficients()).y;
                let off = (at_entry / entry - 1.0).abs();
                assert!(off < tolerance, "{integration}, {keys}, {:?}: entry {off:.4}", continuum.paddle);
                if continuum.paddle.is_some() {
                    let expected = Matrix2::from_fn(|row, column| JACOBIAN[row][column]);
                    let off = (needle.actuation_jacobian().unwrap() - expected).norm() / expected.norm();
                    assert!(off < tolerance, "{integration}: Jacobian {off:.4}");
                }
            }
        }
    }
}

/// Forces superpose with a linear law, whatever their size, and friction and cutting force add up at the base.
#[test]
fn with_a_linear_law_forces_superpose() {
    let displacement = |keys: &str| {
        let model = TissueModel::new(&linear_paper(0.3, keys, "spacing = 0.05")).unwrap();
        let needle = within(&model, Some(1), 10);
        (needle.target_displacement(), needle.base_force())
    };
    let (friction, cutting) = (displacement("kinetic_friction = 1.0"), displacement("cutting_force = 1.0"));
    let both = displacement("kinetic_friction = 20.0\ncutting_force = 7.0");
    assert!((both.0 - friction.0 * 20.0 - cutting.0 * 7.0).norm() < 1e-9 * both.0.norm());
    assert!((friction.1 - 0.3).abs() < 1e-9 && (cutting.1 - 1.0).abs() < 1e-9);
    assert!((both.1 - 20.0 * 0.3 - 7.0).abs() < 1e-8);
}

/// Scenes with nonlinear laws, inclusions, units and axes of their own, and a needle for each.
fn nonlinear() -> Vec<Scene> {
    vec![
        scene("paper", 0.4, "cutting_force = 2.0\nkinetic_friction = 3.0\nstatic_friction = 4.0", "spacing = 0.05"),
        scene("breast", 45.0, "cutting_force = 4.0\nkinetic_friction = 0.05\nstatic_friction = 0.08", "spacing = 4.0"),
        scene(
            "prostate",
            30.0,
            "cutting_force = 10.0\nkinetic_friction = 0.2\nviscous_friction = 0.01",
            "spacing = 4.0",
        ),
    ]
}

/// In, dwelling, and out again.
#[test]
fn the_work_at_the_base_is_stored_or_dissipated() {
    for scene in nonlinear() {
        let model = TissueModel::new(&scene).unwrap();
        let mut needle = within(&model, Some(1), 60);
        let depth = scene.needle.depth;
        let mut last = needle.energy();
        let check = |needle: &SlippingNeedle<'_>, of: f64, place: &str| {
            let energy = needle.energy();
            let balance = energy.work - energy.stored - energy.friction - energy.cutting;
            assert!(balance.abs() < 0.01 * of, "{}, {place}: {energy:?} is off by {balance}", scene.name);
        };
        check(&needle, last.work, "in");
        let (pushed, most) = (needle.base_force(), last.work);
        for step in 1..=120 {
            needle.advance(depth * (1.0 - 0.9 * f64::from(step) / 120.0), Vector2::zeros()).unwrap();
            let energy = needle.energy();
            assert!(energy.friction >= last.friction - 1e-9 * most, "{}: friction gives energy", scene.name);
            assert!(energy.cutting >= last.cutting - 1e-6 * most, "{}: cutting gives energy", scene.name);
            last = energy;
        }
        check(&needle, most, "out");
        // Friction has turned, the tip holds nothing, and the base pulls.
        assert!(pushed > 0.0 && needle.base_force() < 0.0 && needle.tip_force() == 0.0);
        let sliding = scene.needle.shaft.unwrap().resistance.sliding(scene.needle.shaft.unwrap().speed);
        assert!((needle.base_force() + sliding * needle.engaged()).abs() < 0.02 * pushed, "{}", scene.name);
        assert!(needle.engaged() < needle.cut_length() && needle.stations().iter().all(|s| s.friction <= 0.0));
    }
}

#[test]
fn tissue_along_the_shaft_stays_on_the_needles_line() {
    for scene in nonlinear() {
        let model = TissueModel::new(&scene).unwrap();
        let needle = within(&model, Some(0), 20);
        let (entry, normal) = (scene.needle.entry(), scene.needle.orthogonal());
        let off = |arc_length: f64| {
            let x = needle.cut_at(arc_length);
            normal.dot(&(x + model.displacement_at(&x, needle.equilibrium().coefficients()) - entry)).abs()
        };
        let target = needle.target_displacement().norm();
        for station in needle.stations() {
            let off = off(station.arc_length);
            assert!(off < 1e-5 * target, "{}: station at {}: {off}", scene.name, station.arc_length);
        }
        let between = (0..=200).map(|k| off(needle.cut_length() * f64::from(k) / 200.0)).fold(0.0, f64::max);
        assert!(between < 0.01 * model.spacing(), "{}: {between}", scene.name);
        let fixed: f64 = needle.stations().iter().map(|s| s.normal.abs()).fold(0.0, f64::max);
        assert!(fixed > 0.0);
    }
}

/// A needle that has arrived and is pulled: it sticks, slides where it must, and all of it slides at `friction × length`.
#[test]
fn a_shaft_that_is_pulled_sticks_then_slides_with_what_friction_gives() {
    let friction = 20.0;
    let keys = format!("kinetic_friction = {friction}\nstatic_friction = {}", 1.5 * friction);
    let model = TissueModel::new(&linear_paper(0.3, &keys, "spacing = 0.05")).unwrap();
    let mut needle = within(&model, None, 20);
    assert!((needle.base_force() - friction * 0.3).abs() < 1e-6);
    let (depth, mut least) = (needle.depth(), f64::INFINITY);
    let mut forces = Vec::new();
    for step in 1..=400 {
        needle.advance(depth - 1e-4 * f64::from(step), Vector2::zeros()).unwrap();
        least = least.min(needle.base_force());
        forces.push(needle.base_force());
    }
    // It sticks at first: no slip, a straight line.
    let slope = forces[1] - forces[0];
    assert!(slope < 0.0 && (forces[3] - forces[2] - slope).abs() < 2e-3 * slope.abs());
    // Breaking loose takes more than sliding and less than what sticks everywhere at once.
    let engaged = needle.engaged();
    assert!(least < -friction * engaged * 1.02 && least > -1.5 * friction * 0.3, "{least}");
    assert!((needle.base_force() + friction * engaged).abs() < 1e-6 * friction, "{}", needle.base_force());
    assert!(needle.stations().iter().all(|station| station.friction <= friction * -0.999));
}

#[test]
fn base_force_and_target_settle_as_the_mesh_is_refined() {
    for (name, depth, keys) in [
        ("breast", 30.0, "cutting_force = 2.0\nkinetic_friction = 0.05\ntip_length = 2.0"),
        ("prostate", 30.0, "cutting_force = 10.0\nkinetic_friction = 0.2\ntip_length = 2.0"),
    ] {
        let found: Vec<(f64, Vector2<f64>)> = [2.0, 1.5]
            .map(|spacing| {
                let model = TissueModel::new(&scene(name, depth, keys, &format!("spacing = {spacing}"))).unwrap();
                let needle = within(&model, Some(1), 6);
                println!("{} nodes", model.nodes());
                (needle.base_force(), needle.target_displacement())
            })
            .to_vec();
        let ((coarse_force, coarse), (force, fine)) = (found[0], found[1]);
        assert!((coarse_force / force - 1.0).abs() < 0.02, "{name}: {coarse_force} {force}");
        assert!((coarse - fine).norm() < 0.02 * fine.norm(), "{name}: {coarse} {fine}");
    }
}

/// Refined nodes are finest beside paddles. Stations that lie as close together along the needle, where nodes do not, have
/// more forces than there are freedoms, and none are found that settle.
#[test]
fn a_needle_goes_through_nodes_that_are_finer_elsewhere() {
    let keys = "cutting_force = 15.0\nstatic_friction = 1.5\nkinetic_friction = 1.0\ntip_length = 1.5";
    let refined = "tolerance = 0.05\nintegration";
    let [even, meshfree, quadratic] =
        ["spacing = 2.0", &format!("{refined} = \"scni-stabilised\""), &format!("{refined} = \"fem-t6\"")].map(
            |nodes| {
                let (model, _) = discretise(&scene("prostate", 10.0, keys, nodes)).unwrap();
                let needle = within(&model, Some(2), 10);
                let places: Vec<f64> = needle.stations().iter().map(|station| station.arc_length).collect();
                // The tip may be anywhere; the skin counts as well.
                let stations = &places[..places.len() - 1];
                let closest = stations.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
                assert!(closest > 0.05, "{nodes}: {places:?}");
                needle.target_displacement()
            },
        );
    for refined in [meshfree, quadratic] {
        assert!((refined - even).norm() < 0.03 * even.norm(), "{even} {refined}");
    }
}

/// An L whose nodes are finest at its inner corner, far from the needle.
#[test]
fn a_needle_goes_into_an_l_on_quadratic_nodes() {
    let found = ["spacing = 0.03", "tolerance = 0.02\nintegration = \"fem-t6\""].map(|discretization| {
        let (model, _) = discretise(&an_l(discretization)).unwrap();
        within(&model, Some(0), 6).target_displacement()
    });
    assert!((found[0] - found[1]).norm() < 0.03 * found[1].norm(), "{found:?}");
}

/// Under the tip's force tissue along the shaft buckles from one side of the needle to the other where forces do not move with
/// it: without springs no forces were found past depth 3.9. Coarse nodes of another rule do not see it.
#[test]
fn tissue_that_would_buckle_is_held_by_the_needle() {
    let (_, text) = BUNDLED.into_iter().find(|(name, _)| *name == "prostate-world").unwrap();
    let elastic = text
        .replacen("g = [0.3, 0.2]", "g = []", 1)
        .replacen("tau = [3.2, 42.0]", "tau = []", 1)
        .replacen("tip_length = 0.2", "tip_length = 2.0", 1)
        .replacen("depth = 10.0", "depth = 5.0", 1)
        .replacen("increments = 10", "increments = 5", 1);
    let found = ["spacing = 5.0", "tolerance = 0.05\nintegration = \"fem-t6\""].map(|discretization| {
        let text = elastic.replacen("spacing = 5.0", discretization, 1);
        let scene = Scene::parse(&text, "elastic.toml").unwrap();
        assert!(!scene.relaxes() && scene.needle.shaft.unwrap().tip_length == 2.0);
        let (model, _) = discretise(&scene).unwrap();
        let needle = within(&model, None, 5);
        let energy = needle.energy();
        assert!(energy.imbalance().abs() < 0.02, "{energy:?}");
        needle.target_displacement()
    });
    assert!((found[0] - found[1]).norm() < 0.05 * found[1].norm(), "{found:?}");
}

fn an_l(discretization: &str) -> Scene {
    let text = format!(
        r#"
[scene]
name = "an L"
dimension = 2
units = {{ length = "1", stress = "1" }}
[domain]
outline = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [2.0, 1.0], [2.0, 2.0], [0.0, 2.0]]
[material]
model = "linear"
lambda = 4.0
mu = 1.0
[immobile]
paths = [[[0.0, 2.0], [0.0, 0.0]]]
[needle]
contact = [[1.2, 0.0], [1.6, 0.0]]
axis = [0.0, 1.0]
depth = 0.2
mechanics = "shaft"
kinetic_friction = 0.2
tip_length = 0.016
[target]
position = [1.3, 1.0]
[[paddle]]
index = 3
segment = [[2.0, 1.2], [2.0, 1.8]]
[discretization]
{discretization}
"#
    );
    Scene::parse(&text, "l.toml").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn skin_that_holds_is_pushed_as_a_patch_and_skin_that_never_gives_way_is_one() {
    let keys = |force: &str| format!("cutting_force = 1.0\npuncture_force = {force}");
    let plain = Scene::bundled("paper").unwrap();
    let text = "spacing = 0.1\nsupport = 2.0\nintegration = \"scni\"";
    let never = scene("paper", 0.1, &keys("inf"), text);
    assert_eq!((never.hash(), never.needle.shaft), (plain.hash(), None));

    let holds = TissueModel::new(&scene("paper", 0.1, &keys("1e6"), text)).unwrap();
    let way = Way { depth: 0.05, paddle: Vector2::new(0.001, 0.0), increments: 5, seconds: 0.0 };
    let Inserted::Pushing(body) = insert(&holds, Some(1), way).unwrap() else { panic!("it gave way") };
    let model = TissueModel::new(&plain).unwrap();
    let mut patch = model.body(Some(1), NewtonSettings::default()).unwrap();
    for step in 1..=5 {
        let share = f64::from(step) / 5.0;
        patch.drive(0.05 * share, Vector2::new(0.001, 0.0) * share).unwrap();
    }
    assert_eq!(body.equilibrium().coefficients(), patch.equilibrium().coefficients());
    // The contact's force is the slope of the energy over depth.
    let (force, energy) = (patch.contact_force(), patch.equilibrium().energy());
    patch.drive(0.0501, Vector2::new(0.001, 0.0)).unwrap();
    let mean = 0.5 * (force + patch.contact_force());
    assert!((patch.equilibrium().energy() - energy - 1e-4 * mean).abs() < 1e-5 * 1e-4 * mean);

    // Where the contact's force reaches what the skin holds, the needle goes in.
    let between = format!("{}", 0.5 * force);
    let gives = TissueModel::new(&scene("paper", 0.1, &keys(&between), text)).unwrap();
    match insert(&gives, Some(1), Way { paddle: Vector2::zeros(), ..way }).unwrap() {
        Inserted::Within { punctured_at, needle } => {
            assert!((0.02..0.04).contains(&punctured_at), "{punctured_at}");
            assert_eq!(needle.depth(), 0.05);
        }
        Inserted::Pushing(_) => panic!("the skin holds"),
    }
}

/// All that the base does: first at the skin, then, from where that gives way, at a needle through open skin. Integrated in
/// small steps over the force, it is the account's work and what the skin took; with a paddle, whose force is not in that
/// integral, the energy of skin that holds stands for it.
#[test]
fn skin_that_gives_way_takes_what_was_stored_in_it() {
    for open in nonlinear() {
        let depth = open.needle.depth;
        let shut = Pressed::new(&open, 0.12 * depth);
        let mut scene = open.clone();
        scene.needle.shaft.as_mut().unwrap().puncture_force = shut.force;
        let model = TissueModel::new(&scene).unwrap();
        for paddle in [Vector2::zeros(), Vector2::new(0.02, -0.03) * depth] {
            let way = Way { depth, paddle, increments: 12, seconds: 0.0 };
            let Inserted::Within { needle, punctured_at } = insert(&model, Some(1), way).unwrap() else {
                panic!("{}: the skin holds", scene.name)
            };
            let energy = needle.energy();
            let told = energy.work + energy.paddle + energy.base + energy.puncture.unwrap();
            let done = done_in_all(&open, paddle, punctured_at);
            assert!(energy.puncture.unwrap() > 0.1 * done, "{}: the skin takes little: {energy:?} {done}", scene.name);
            assert!((told - done).abs() < 0.01 * done, "{}: {energy:?} is {told}, done was {done}", scene.name);
        }
        let within = within(&TissueModel::new(&open).unwrap(), Some(1), 3).energy();
        assert_eq!(within.puncture, None, "nothing was punctured");
    }
}

/// Skin that holds, pushed to a depth.
struct Pressed {
    force: f64,
    /// Work by force over depth.
    work: f64,
    energy: f64,
}

impl Pressed {
    fn new(scene: &Scene, depth: f64) -> Self {
        Self::with_paddle(scene, depth, Vector2::zeros())
    }

    /// The paddle goes along straight, to this place.
    fn with_paddle(scene: &Scene, depth: f64, paddle: Vector2<f64>) -> Self {
        let model = TissueModel::new(scene).unwrap();
        let mut body = model.body(Some(1), NewtonSettings::default()).unwrap();
        let (mut force, mut work) = (0.0, 0.0);
        for step in 1..=100 {
            let share = f64::from(step) / 100.0;
            body.drive(depth * share, paddle * share).unwrap();
            let now = body.contact_force();
            work += 0.5 * (force + now) * depth / 100.0;
            force = now;
        }
        Self { force, work, energy: body.equilibrium().energy() }
    }
}

/// Work of base and paddle to the scene's depth where the skin gives way at this one.
fn done_in_all(scene: &Scene, paddle: Vector2<f64>, punctured_at: f64) -> f64 {
    let depth = scene.needle.depth;
    let pressed = Pressed::with_paddle(scene, punctured_at, paddle * (punctured_at / depth));
    let model = TissueModel::new(scene).unwrap();
    let mut needle = SlippingNeedle::at_rest(&model, Some(1)).unwrap();
    let (mut force, mut work, mut at_puncture) = (0.0, 0.0, 0.0);
    for step in 1..=300 {
        let share = f64::from(step) / 300.0;
        needle.advance(depth * share, paddle * share).unwrap();
        let now = needle.base_force();
        let energy = needle.energy();
        let step = match paddle == Vector2::zeros() {
            true => 0.5 * (force + now) * depth / 300.0,
            false => energy.work + energy.paddle + energy.base - work,
        };
        force = now;
        work += step;
        if needle.depth() <= punctured_at {
            at_puncture = work;
        }
    }
    let before = if paddle == Vector2::zeros() { pressed.work } else { pressed.energy };
    before + work - at_puncture
}

#[test]
fn what_cannot_be_is_refused_and_nothing_is_lost() {
    let patch = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
    assert!(matches!(SlippingNeedle::at_rest(&patch, None), Err(NeedleError::NoShaft)));
    let weak = scene("paper", 0.1, "cutting_force = 1.0", "spacing = 0.1\nessential = \"nitsche\"");
    let weak = TissueModel::new(&weak).unwrap();
    assert!(matches!(SlippingNeedle::at_rest(&weak, None), Err(NeedleError::HeldWeakly)));

    // A force that no tissue bears: typed, and the needle stays where it was.
    let model = TissueModel::new(&scene("paper", 0.3, "cutting_force = 1e5", "spacing = 0.05")).unwrap();
    let mut needle = SlippingNeedle::at_rest(&model, Some(1)).unwrap();
    let mut failed = None;
    for step in 1..=60 {
        let before = (needle.depth(), needle.tip_force(), needle.target_displacement(), needle.energy());
        if let Err(error) = needle.advance(0.005 * f64::from(step), Vector2::zeros()) {
            let now = (needle.depth(), needle.tip_force(), needle.target_displacement(), needle.energy());
            assert_eq!(now, before);
            failed = Some(error);
            break;
        }
    }
    let error = failed.expect("no tissue bears that");
    assert!(matches!(error, NeedleError::Equilibrium { .. } | NeedleError::NoForces { .. }), "{error}");
    // From there it can be drawn back.
    needle.advance(0.5 * needle.depth(), Vector2::zeros()).unwrap();
}

#[test]
fn scenes_say_what_is_wrong_with_a_shaft() {
    let text = |keys: &str| {
        let (_, text) = BUNDLED[0];
        text.replace("increments = 10", &format!("increments = 10\n{keys}"))
    };
    for (keys, message) in [
        ("kinetic_friction = 1.0", "this needle's contact moves with it"),
        ("mechanics = \"shaft\"\nkinetic_friction = 2.0\nstatic_friction = 1.0", "less than kinetic_friction"),
        ("mechanics = \"shaft\"\ncutting_force = -1.0", "cutting_force is -1"),
        ("mechanics = \"shaft\"\nspeed = 0.0", "speed"),
        ("mechanics = \"shaft\"\nentry = [5.0, 5.0]", "outside the outline"),
        ("mechanics = \"shaft\"\nentry = [0.5, 0.05]", "the needle leaves the body"),
        ("mechanics = \"shaft\"\npuncture_force = nan", "puncture_force is NaN"),
        ("mechanics = \"rope\"", "rope"),
    ] {
        let error = Scene::parse(&text(keys), "x.toml").unwrap_err();
        assert!(error.to_string().contains(message), "{keys}: {error}");
        assert!(error.line > 1, "{keys}: line {}", error.line);
    }
    let own = text("mechanics = \"shaft\"\ncutting_force = 1.0")
        .replace("stiffness = 100.0", "stiffness = 100.0\ncutting_force = 9.0");
    let scene = Scene::parse(&own, "x.toml").unwrap();
    let shaft = scene.needle.shaft.unwrap();
    assert_eq!(scene.resistance_at(Vector2::new(0.65, 0.35), &shaft).cutting_force, 9.0);
    assert_eq!(scene.resistance_at(Vector2::new(0.5, 0.9), &shaft).cutting_force, 1.0);
    assert!(Scene::parse(&own.replace("mechanics = \"shaft\"\ncutting_force = 1.0", ""), "x.toml").is_err());
}

/// The same with a thin layer across the needle's way, 0.18 to 0.2 below the skin, that is hard to cut.
fn with_a_layer(scene: Scene) -> Scene {
    let outline = [[0.3, 0.8], [0.7, 0.8], [0.7, 0.82], [0.3, 0.82]].map(Into::into).to_vec();
    let resistance = Some(Resistance { cutting_force: 60.0, ..Resistance::default() });
    let layer = Inclusion { outline: Polygon::new(outline).unwrap(), stiffness: 1.0, material: None, resistance };
    Scene { inclusions: vec![layer], ..scene }
}

/// What holds is held: against finite differences of the needle as it is, tips that cut and that hold.
#[test]
fn the_jacobian_is_that_of_a_small_motion_of_the_paddle() {
    let coarse = "spacing = 0.05";
    let cases = [
        (with_a_layer(scene("paper", 0.24, "tip_length = 0.02\ncutting_force = 2.0", coarse)), true),
        (scene("paper", 0.1, "tip_length = 0.02\ncutting_force = 2.0\nkinetic_friction = 3.0", coarse), false),
        (with_a_layer(linear_paper(0.24, "cutting_force = 2.0", coarse)), true),
        (
            scene("breast", 5.0, "tip_length = 0.2\ncutting_force = 1.0\nkinetic_friction = 0.02", "spacing = 4.0"),
            false,
        ),
    ];
    for (scene, holds) in cases {
        let model = discretise(&scene).unwrap().0;
        let mut needle = within(&model, Some(1), 10);
        let depth = needle.depth();
        let step = 2e-4 * depth;
        let difference = |column: usize| {
            let moved = |by: f64| {
                let mut needle = needle.clone();
                let mut paddle = Vector2::zeros();
                paddle[column] = by;
                // A needle that slides and cuts is one that goes on.
                needle.advance(if holds { depth } else { depth + 20.0 * step }, paddle).unwrap();
                needle.target_displacement()
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        };
        let expected = Matrix2::from_columns(&[difference(0), difference(1)]);
        let (tip, jacobian) = (needle.tip_force(), needle.actuation_jacobian().unwrap());
        let off = (jacobian - expected).norm() / expected.norm();
        assert!(off < 0.02, "{} tip holds: {holds} with {tip}: {jacobian} by linearisation, {expected}", scene.name);
    }
}

/// A thin layer that is hard to cut, met in the middle of an increment or passed within one.
#[test]
fn a_thin_layer_is_met_by_any_increments() {
    let layer = "spacing = 0.05";
    for linear in [false, true] {
        let mut scene = with_a_layer(scene("paper", 0.3, "tip_length = 0.02\ncutting_force = 2.0", layer));
        if linear {
            scene.material = scene.material.linearised();
        }
        let model = discretise(&scene).unwrap().0;
        let forces = [3, 5, 10, 30, 47].map(|increments| within(&model, None, increments).base_force());
        let (least, most) = forces.iter().fold((f64::INFINITY, 0.0), |(a, b), f| (f64::min(a, *f), f64::max(b, *f)));
        assert!(least > 25.0 && most < 1.01 * least, "linear: {linear}: {forces:?}");
    }
}

#[test]
fn the_paddle_s_work_is_in_the_balance() {
    for mut scene in nonlinear() {
        scene.needle.increments = 60;
        let model = discretise(&scene).unwrap().0;
        let mut needle = within(&model, Some(1), 60);
        let step = 0.01 * needle.depth();
        for k in 1..=20 {
            needle.advance(needle.depth(), Vector2::new(step, 0.5 * step) * f64::from(k)).unwrap();
        }
        let energy = needle.energy();
        assert!(energy.paddle.abs() > 1e-3 * energy.stored, "{}: {energy:?}", scene.name);
        let left = energy.work + energy.paddle - energy.stored - energy.friction - energy.cutting;
        assert!(left.abs() < 0.01 * (energy.work + energy.paddle.abs()), "{}: {left} of {energy:?}", scene.name);
    }
}

/// A needle pushed on in its own old cut: the tip is led by it, and nothing jumps.
#[test]
fn an_old_cut_leads_the_tip() {
    let scene = scene("paper", 0.2, "tip_length = 0.02\ncutting_force = 2.0\nkinetic_friction = 3.0", "spacing = 0.05");
    let model = discretise(&scene).unwrap().0;
    let mut needle = within(&model, Some(1), 20);
    for k in 1..=10 {
        needle.advance(0.2, Vector2::new(0.004, 0.0) * f64::from(k)).unwrap();
    }
    needle.advance(0.15, Vector2::new(0.04, 0.0)).unwrap();
    let before = needle.target_displacement();
    for step in [1e-5, 1e-4, 1e-3] {
        let mut on = needle.clone();
        on.advance(0.15 + step, Vector2::new(0.04, 0.0)).unwrap();
        let moved = (on.target_displacement() - before).norm();
        assert!(moved < step, "{step} further: the target moves by {moved}");
    }
}

#[test]
fn forces_as_small_as_you_like_are_forces() {
    let forces = [1e-7, 1e-5, 1e-3].map(|friction| {
        let keys = format!("tip_length = 0.02\nkinetic_friction = {friction}");
        let model = discretise(&scene("paper", 0.3, &keys, "spacing = 0.05")).unwrap().0;
        within(&model, None, 10).base_force() / friction
    });
    assert!(forces.iter().all(|force| (force - 0.3).abs() < 1e-3), "{forces:?}");
}

/// Nodes that happen to lie on the line are not the stations where others lie closer beside it.
#[test]
fn a_line_through_few_nodes_is_held_as_well_as_one_through_none() {
    let displacement = |slope: f64| {
        let mut scene = scene("paper", 0.5, "tip_length = 0.02\ncutting_force = 2.0", "spacing = 0.05");
        scene.needle.axis = Vector2::new(slope, -1.0).normalize();
        scene.needle.shaft.as_mut().unwrap().entry = Vector2::new(0.4, 1.0);
        let model = discretise(&scene).unwrap().0;
        let mut needle = within(&model, Some(1), 10);
        needle.advance(0.5, Vector2::new(0.03, 0.03)).unwrap();
        (needle.target_displacement(), needle.stations().len())
    };
    let ((few, stations), (none, others)) = (displacement(0.2), displacement(0.2001));
    assert!(stations > 8 && others > 8, "{stations} {others}");
    assert!((few - none).norm() < 0.02 * none.norm(), "{few} {none}");
}
