//! The stability study: depths of an independent implementation, typed reasons, and the files as a user gets them.

use assert_cmd::Command;
use model_offline::discretization::{Integration, Method};
use model_offline::model::ModelFailure;
use model_offline::model::TissueModel;
use model_offline::scene::Scene;
use model_offline::scene::space::{AnyScene, SpaceScene};
use model_offline::solver::equilibrium::{FailureReason, NewtonSettings};
use model_offline::study::stability::plan::{Experiment, base};
use model_offline::study::stability::probe::{ExperimentResult, StopReason, run};
use model_offline::study::stability::probe_space::run_in_space;
use model_offline::study::stability::setting::Setting;
use model_offline::study::stability::zero_energy;
use nalgebra::Vector2;
use std::path::Path;

fn paper() -> Scene {
    Scene::bundled("paper").unwrap()
}

/// Plain Newton, ten increments over the scene's depth of 0.1.
fn plain(integration: Integration, spacing: f64, paddle: u32) -> ExperimentResult {
    let scene = paper();
    let place = scene.paddles.iter().position(|p| p.index == paddle).unwrap();
    let experiment =
        Experiment { line_search: false, cutback: false, ..base(&Setting::from(&scene), integration, spacing) };
    run(&scene, place, &experiment)
}

/// Needle depths that an independent implementation reached on this scene (homogeneous, increments of 0.01, plain
/// Newton, c = 0.779), with paddle 2 and paddle 4 static; they must be met within one increment.
#[test]
fn depths_agree_with_an_independent_implementation() {
    use Integration::{Dni, FemT3, Scni};
    for (integration, spacing, nodes, depths) in [
        (Dni, 0.1, 106, [0.13, 0.13]),
        (Scni, 0.1, 106, [0.13, 0.14]),
        (FemT3, 0.1, 106, [0.13, 0.13]),
        (Dni, 0.05, 386, [0.09, 0.09]),
        (Scni, 0.05, 386, [0.09, 0.09]),
        (FemT3, 0.05, 386, [0.09, 0.09]),
        (FemT3, 0.025, 1471, [0.06, 0.06]),
    ] {
        for (paddle, depth) in [2, 4].into_iter().zip(depths) {
            let outcome = plain(integration, spacing, paddle);
            assert_eq!(outcome.nodes, nodes);
            assert!((outcome.depth - depth).abs() < 0.0101, "{integration:?} {spacing} paddle {paddle}: {outcome:?}");
            assert!(matches!(outcome.reason, StopReason::Model(ModelFailure::Solve(_))), "{outcome:?}");
        }
    }
}

/// How deep quadratic triangles get depends on which diagonal cuts each lattice square: with other diagonals (nodes moved
/// by one per cent of the spacing) the depth changes by up to two increments. The reference, whose diagonals are not
/// known, must be within one increment of the depths that eight choices reach.
#[test]
fn quadratic_triangles_agree_up_to_the_choice_of_diagonals() {
    let scene = paper();
    for (spacing, nodes, depths) in [(0.1, 386, [0.11, 0.12]), (0.05, 1471, [0.07, 0.08])] {
        for (place, depth) in [1, 3].into_iter().zip(depths) {
            let reached = (0..8).map(|seed| {
                let regular = base(&Setting::from(&scene), Integration::FemT6, spacing);
                let experiment = Experiment { line_search: false, cutback: false, jitter: 0.01, seed, ..regular };
                let outcome = run(&scene, place, &experiment);
                assert_eq!(outcome.nodes, nodes);
                outcome.depth
            });
            let (low, high) = reached.fold((f64::MAX, 0.0_f64), |(low, high), d| (low.min(d), high.max(d)));
            assert!(low - 0.0101 <= depth && depth <= high + 0.0101, "{spacing}: {depth} outside {low}..{high}");
        }
    }
}

#[test]
fn every_way_to_fail_has_its_type_and_names_its_place() {
    let scene = paper();
    let regular = base(&Setting::from(&scene), Integration::Scni, 0.1);
    let small = run(&scene, 2, &Experiment { method: Method { support: 0.8, ..regular.method }, ..regular });
    assert_eq!((small.reason, small.depth), (StopReason::Model(ModelFailure::SingularMomentMatrix), 0.0));
    assert!(small.detail.contains("node"), "{}", small.detail);
    let incompressible = run(&scene, 2, &Experiment { poisson: Some(0.5), ..regular });
    assert_eq!(incompressible.reason, StopReason::UnstableLaw);
    let leap = Experiment {
        increments: 1,
        line_search: false,
        cutback: false,
        method: Method::new(Integration::FemT6),
        ..regular
    };
    let leap = run(&scene, 2, &leap);
    assert_eq!(
        (leap.reason, leap.depth),
        (StopReason::Model(ModelFailure::Solve(FailureReason::ElementInverted)), 0.0)
    );
    assert!(leap.detail.contains("integration point"), "{}", leap.detail);
    let guarded = run(&scene, 2, &Experiment { barrier: Some(1.0), ..regular });
    assert_eq!((guarded.reason, guarded.depth), (StopReason::Reached, 0.2));
}

#[test]
fn a_last_state_shows_how_far_the_law_was_taken() {
    let scene = paper();
    let outcome = run(&scene, 2, &base(&Setting::from(&scene), Integration::Scni, 0.1));
    // Driven to where it fails: well past the stretch of 0.5768 at which the law's nominal stress peaks.
    assert!(outcome.min_stretch < 0.5768 && outcome.ellipticity < 0.0, "{outcome:?}");
    assert!(outcome.energy > 0.0);
}

/// On a regular lattice the checkerboard is symmetric about every interior node, so that neither the gradient at the node
/// (DNI) nor its mean over the nodal cell (SCNI) sees it; the rules that sample the gradient's variation do.
#[test]
fn the_checkerboard_is_felt_by_rules_that_see_the_gradient_vary() {
    let (measured, not) = zero_energy::measure(&paper(), 0.1);
    assert_eq!(not, [], "every rule has a model on the nodes of the paper");
    assert!(measured.iter().all(|z| z.zero_modes == 3), "{measured:?}");
    let of =
        |integration, jitter| *measured.iter().find(|z| (z.integration, z.jitter) == (integration, jitter)).unwrap();
    for blind in [Integration::Dni, Integration::Scni] {
        let z = of(blind, 0.0);
        assert!(z.interior_energy_ratio.abs() < 1e-12 && z.least_energy_ratio < 0.2, "{z:?}");
        assert!(z.bloch_share.abs() < 1e-12, "{z:?}");
    }
    assert!(of(Integration::ScniStabilised, 0.0).bloch_share > 0.36);
    for seeing in [Integration::Nsni, Integration::Gauss] {
        let z = of(seeing, 0.0);
        assert!(z.interior_energy_ratio > 0.9 && z.least_energy_ratio > 0.8, "{z:?}");
        assert!(of(seeing, 0.4).least_energy_ratio > 5.0 * of(Integration::Dni, 0.4).least_energy_ratio);
    }
}

fn study(out: &Path, threads: &str) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
        .args(["stability", "paper", "--quick", "--spacing", "0.2", "--paddle", "4", "--threads", threads, "--out"])
        .arg(out)
        .assert()
}

#[test]
fn the_files_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("new/one"), folder.path().join("two"));
    let output = study(&one, "1").success().get_output().stdout.clone();
    study(&two, "2").success();
    for file in ["stability.csv", "stability.svg", "zero_energy.csv"] {
        assert_eq!(std::fs::read(one.join(file)).unwrap(), std::fs::read(two.join(file)).unwrap(), "{file}");
    }
    let csv = std::fs::read_to_string(one.join("stability.csv")).unwrap();
    let header = "method,integration,parameter,value,spacing,nodes,depth_reached,reason,";
    assert!(csv.starts_with(header), "{}", csv.lines().next().unwrap());
    for parameter in ["spacing", "support", "jitter_percent", "contrast", "poisson", "c", "increments", "solver"] {
        assert!(csv.contains(&format!("rkpm,scni,{parameter},")), "{parameter}");
        assert_eq!(csv.contains(&format!("fem,fem-t6,{parameter},")), parameter != "support", "{parameter}");
    }
    let summary = String::from_utf8(output).unwrap();
    assert!(summary.contains("Meshfree is more stable") && summary.contains("median ratio"), "{summary}");
    assert!(summary.lines().count() <= 45, "one screen: {}", summary.lines().count());
}

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for arguments in [["--paddle", "9"], ["--tolerance", "0.01"]] {
        Command::new(env!("CARGO_BIN_EXE_model-offline"))
            .args(["stability", "paper", "--quick", "--out"])
            .arg(&out)
            .args(arguments)
            .assert()
            .code(2);
        assert!(!out.exists());
    }
}

/// A slender column between clamps: compressed by more than Euler's ε = 4π²/12 (h/L)², it buckles.
const COLUMN: &str = r#"
[scene]
name = "column"
dimension = 2
units = { length = "mm", stress = "kPa" }
[domain]
outline = [[0.0, 0.0], [5.0, 0.0], [5.0, 50.0], [0.0, 50.0]]
[material]
model = "neo-hookean"
lambda = 0.0
mu = 5.0
[immobile]
paths = [[[0.0, 0.0], [5.0, 0.0]]]
[needle]
contact = [[0.0, 50.0], [5.0, 50.0]]
axis = [0.0, -1.0]
depth = 5.0
increments = 10
[target]
position = [2.5, 25.0]
[[paddle]]
index = 1
segment = [[0.0, 20.0], [0.0, 30.0]]
[discretization]
spacing = 1.25
integration = "fem-t6"
"#;

/// A simulator's small steps look for stability as large ones do: beyond the load at which a column buckles there is a
/// typed failure and no answer, although Newton's method goes on to find the straight column.
#[test]
fn small_steps_stop_where_a_column_buckles() {
    let model = TissueModel::new(&Scene::parse(COLUMN, "column").unwrap()).unwrap();
    let reached = |settings: NewtonSettings| {
        let mut body = model.body(None, settings).unwrap();
        let failure = (1..=400).find_map(|step| body.drive(0.01 * f64::from(step), Vector2::zeros()).err());
        (body.depth() / 50.0, failure.map(|failure| failure.reason))
    };
    let euler = 4.0 * std::f64::consts::PI.powi(2) / 12.0 * 0.1_f64.powi(2);
    for settings in [NewtonSettings::SMALL_STEPS, NewtonSettings::default()] {
        let (strain, reason) = reached(settings);
        assert!((strain / euler - 1.0).abs() < 0.03, "{strain}, Euler {euler}");
        assert_eq!(reason, Some(FailureReason::LostStability));
        // The straight column is there all the same, for those who do not ask.
        let (careless, _) = reached(NewtonSettings { require_stability: false, ..settings });
        assert!(careless > 1.2 * euler, "{careless}, Euler {euler}");
    }
}

/// The column in space, square: it buckles to any side. The paddle holds two sides just above its foot: on
/// one side alone it would bend the column, which then gives way evenly.
const COLUMN_IN_SPACE: &str = r#"
[scene]
name = "column"
dimension = 3
units = { length = "mm", stress = "kPa" }
[domain]
box = { min = [100.0, 0.0, 0.0], max = [105.0, 5.0, 50.0] }
[material]
model = "neo-hookean"
lambda = 0.0
mu = 5.0
[immobile]
regions = [{ box = { min = [100.0, 0.0, 0.0], max = [105.0, 5.0, 0.0] } }]
[needle]
region = { box = { min = [100.0, 0.0, 50.0], max = [105.0, 5.0, 50.0] } }
axis = [0.0, 0.0, -1.0]
depth = 1.0
increments = 10
[target]
position = [102.5, 2.5, 25.0]
[[paddle]]
index = 7
region = { box = { min = [99.0, 1.0, 0.5], max = [106.0, 4.0, 1.0] } }
[discretization]
spacing = 2.5
"#;

fn in_space(text: &str) -> SpaceScene {
    match AnyScene::parse(text, "scene").unwrap() {
        AnyScene::Space(scene) => *scene,
        AnyScene::Planar(_) => panic!("a scene in the plane"),
    }
}

#[test]
fn a_column_in_space_buckles_where_euler_says() {
    let scene = in_space(COLUMN_IN_SPACE);
    let setting = Setting::in_space(&scene, None);
    let found = run_in_space(&scene, 0, &base(&setting, Integration::FemT10, 2.5));
    let euler = 4.0 * std::f64::consts::PI.powi(2) / 12.0 * 0.1_f64.powi(2);
    // The paddle may shorten the column by its millimetre.
    let over = found.depth / 50.0 / euler;
    assert!((0.98..1.06).contains(&over), "{over}: {found:?}");
    // Beyond it, or at it, where Newton's method does not come to rest.
    let reasons = [FailureReason::LostStability, FailureReason::NotConverged];
    assert!(reasons.map(|r| StopReason::Model(ModelFailure::Solve(r))).contains(&found.reason), "{found:?}");
    // It is the column, not the law, that gives way: tissue is far from any limit even at the rims.
    assert!(found.min_stretch < 1.0 - euler && found.ellipticity > 0.8, "{found:?}");
    // Strain energy of a bar: ½ E A L ε², E = 2μ.
    let bar = 0.5 * 10.0 * 25.0 * 50.0 * (found.depth / 50.0).powi(2);
    assert!((found.energy / bar - 1.0).abs() < 0.1, "{} {bar}", found.energy);
    // Not so slender, it does not.
    let stout =
        in_space(&COLUMN_IN_SPACE.replace("50.0]", "12.5]").replace("25.0]", "6.25]").replace("50.0,", "12.5,"));
    let setting = Setting::in_space(&stout, None);
    let found = run_in_space(&stout, 0, &base(&setting, Integration::FemT10, 2.5));
    assert_eq!((found.reason, found.depth), (StopReason::Reached, 2.0), "{found:?}");
}

#[test]
fn what_cannot_be_made_in_space_is_a_row_of_its_own() {
    let scene = in_space(COLUMN_IN_SPACE);
    let own = base(&Setting::in_space(&scene, None), Integration::ScniStabilised, 2.5);
    let unstable = run_in_space(&scene, 0, &Experiment { poisson: Some(0.7), ..own });
    assert_eq!((unstable.reason, unstable.depth), (StopReason::UnstableLaw, 0.0), "{unstable:?}");
    let fine = run_in_space(&scene, 0, &Experiment { spacing: 0.1, ..own });
    assert!(matches!(fine.reason, StopReason::Model(_)) && !fine.detail.is_empty(), "{fine:?}");
}

#[test]
fn the_study_of_a_body_in_space_is_written_like_that_of_the_plane() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("stout.toml"), folder.path().join("out"));
    // A block with an inclusion, in millimetres.
    let text = COLUMN_IN_SPACE.replace("50.0]", "12.5]").replace("25.0]", "6.25]").replace("50.0,", "12.5,");
    let text = text.replace("increments = 10", "increments = 3");
    let inclusion = "[[inclusion]]\nsphere = { centre = [103.0, 2.0, 8.0], radius = 1.5 }\nstiffness = 10.0\n";
    std::fs::write(&scene, text.replace("[immobile]", &format!("{inclusion}[immobile]"))).unwrap();
    let study = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_model-offline"));
        command.arg("stability").arg(&scene).args(["--quick", "--spacing", "5", "--out"]).arg(&out).args(arguments);
        command.assert()
    };
    for (arguments, said) in
        [(&["--paddle", "9"][..], "9"), (&["--essential", "nitsche"], "planar"), (&["--support", "0.1"], "support")]
    {
        let refused = study(arguments).code(2);
        let error = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(error.contains(said) && !out.exists(), "{error}");
    }
    let output = study(&[]).success().get_output().stdout.clone();
    let csv = std::fs::read_to_string(out.join("stability.csv")).unwrap();
    for rule in ["rkpm,dni", "rkpm,scni", "rkpm,scni-stabilised", "rkpm,mscni", "fem,fem-t4", "fem,fem-t10"] {
        for parameter in ["spacing", "contrast", "poisson", "increments", "solver", "barrier_over_mu"] {
            assert!(csv.contains(&format!("{rule},{parameter},")), "{rule} {parameter}");
        }
    }
    assert!(!csv.contains("jitter") && !out.join("zero_energy.csv").exists());
    let summary = String::from_utf8(output).unwrap();
    assert!(summary.contains("paddle 7 static") && summary.contains("median ratio"), "{summary}");
    let svg = std::fs::read_to_string(out.join("stability.svg")).unwrap();
    assert!(svg.contains("linear tetrahedra") && svg.contains("Stiffness contrast") && !svg.contains("ghost"));
}

#[test]
fn no_study_writes_over_the_scene_that_it_is_of() {
    let folder = tempfile::tempdir().unwrap();
    let bundled = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/paper.toml");
    for (command, file) in [
        ("stability", "stability.svg"),
        ("stability", "zero_energy.csv"),
        ("pareto", "pareto.csv"),
        ("sweep", "sweep.svg"),
    ] {
        let scene = folder.path().join(file);
        std::fs::copy(&bundled, &scene).unwrap();
        let mut call = Command::new(env!("CARGO_BIN_EXE_model-offline"));
        call.arg(command).arg(&scene).args(["--spacing", "0.2", "--out"]).arg(folder.path());
        if command == "stability" {
            call.args(["--paddle", "4"]);
        }
        let refused = call.assert().code(2);
        let error = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(error.contains("this is an input of the same"), "{command}: {error}");
        assert_eq!(std::fs::read(&scene).unwrap(), std::fs::read(&bundled).unwrap());
        // A file is no folder.
        let mut call = Command::new(env!("CARGO_BIN_EXE_model-offline"));
        call.args([command, "paper", "--spacing", "0.2", "--out"]).arg(&scene).assert().code(2);
        std::fs::remove_file(&scene).unwrap();
    }
}
