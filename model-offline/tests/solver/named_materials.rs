//! Materials that scenes name, held against the numbers of their sources.

use assert_cmd::Command;
use model_offline::material::{Law, Material, MaterialSection, NamedMaterial, Preset};
use model_offline::model::TissueModel;
use model_offline::placement::{Placement, PlacementOptions, place};
use model_offline::scene::Scene;
use std::str::FromStr as _;
use strum::VariantArray as _;

fn model_offline() -> Command {
    Command::new(env!("CARGO_BIN_EXE_model-offline"))
}

fn law(section: &str, unit: &str) -> Law {
    let section: MaterialSection = toml::from_str(section).unwrap();
    section.law(unit).unwrap_or_else(|error| panic!("{section:?}: {error}"))
}

fn shear_modulus(law: &Law) -> f64 {
    Material::<3>::rest_shear_modulus(law)
}

/// λ/(2(λ + μ)) from the tangent in space: A₁₁₂₂ = λ.
fn poisson_ratio(law: &Law) -> f64 {
    let lambda = Material::<3>::tangent(law, &nalgebra::Matrix3::zeros())[0][0][1][1];
    0.5 * lambda / (lambda + shear_modulus(law))
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * b.abs()
}

/// By hand from the sources: E/2.9 for ν = 0.45; the rabbit's 318.5 + 0.779 Pa and 384.1685/(2 · 703.4475).
const AT_REST: [(&str, f64, f64); 6] = [
    ("breast-fat", 1.120_689_655, 0.45),
    ("breast-gland", 1.117_241_379, 0.45),
    ("prostate", 5.862_068_966, 0.45),
    ("liver", 2.0, 0.45),
    ("skin-rabbit", 0.319_279, 0.273_061),
    ("gelatine-5", 4.18, 0.45),
];

#[test]
fn every_preset_has_the_moduli_of_its_source_and_is_stable_at_rest() {
    assert_eq!(AT_REST.len(), Preset::VARIANTS.len());
    for (name, shear, poisson) in AT_REST {
        let law = law(&format!("preset = {name:?}"), "kPa");
        assert!(close(shear_modulus(&law), shear, 1e-9), "{name}: {}", shear_modulus(&law));
        assert!(close(poisson_ratio(&law), poisson, 1e-5), "{name}: {}", poisson_ratio(&law));
        Material::<2>::check_stable_at_rest(&law).unwrap();
        Material::<3>::check_stable_at_rest(&law).unwrap();
        let told = NamedMaterial::of(Preset::from_str(name).unwrap()).unwrap();
        assert!(close(told.shear_modulus_kpa, shear, 1e-9) && close(told.poisson_ratio, poisson, 1e-5), "{told:?}");
        assert!(told.source.contains("20") || told.source.contains("19"), "{name}: a source has a year");
    }
}

/// Creep and relaxation are the same material: s G is zero where s J has a pole, at −1 over each creep time, and J(∞) is twice
/// J(0) where the tissue creeps by as much as it yields at once.
#[test]
fn what_relaxes_creeps_in_the_times_of_its_source() {
    let mut relaxing = Vec::new();
    for (name, creep_times) in [("breast-gland", [3.2, 42.0]), ("liver", [1.86, 51.3])] {
        let material = NamedMaterial::of(Preset::from_str(name).unwrap()).unwrap().material;
        let series = material.relaxation.unwrap();
        let terms = || series.g.iter().zip(&series.tau);
        let rest = 1.0 - series.g.iter().sum::<f64>();
        assert!((rest - 0.5).abs() < 1e-12, "{name}: {rest}");
        let transform = |s: f64| rest + terms().map(|(g, tau)| g * s * tau / (1.0 + s * tau)).sum::<f64>();
        for time in creep_times {
            // A change of sign within half a per cent.
            let beside = [0.995, 1.005].map(|part| transform(-1.0 / (part * time)));
            assert!(beside[0] * beside[1] < 0.0, "{name} at {time} s: {beside:?}");
        }
        relaxing.push(name);
    }
    for preset in Preset::VARIANTS {
        let relaxes = law(&format!("preset = {:?}", preset.name()), "kPa").relaxation().is_some();
        assert_eq!(relaxes, relaxing.contains(&preset.name()), "{preset}");
    }
}

#[test]
fn presets_are_the_same_in_every_unit_of_stress() {
    // 17 kPa / 2.9 = 5.862069 kPa, over 0.133322 and 6.894757 kPa.
    let prostate = [
        ("Pa", 5_862.068_966),
        ("kPa", 5.862_068_966),
        ("MPa", 0.005_862_069),
        ("mmHg", 43.969_125),
        ("psi", 0.850_221),
    ];
    for (unit, shear) in prostate {
        let law = law("preset = \"prostate\"", unit);
        assert!(close(shear_modulus(&law), shear, 1e-6), "{unit}: {}", shear_modulus(&law));
        assert!(close(poisson_ratio(&law), 0.45, 1e-12));
    }
    // All of Fung's law: stresses scale, the exponent does not.
    let stretch = nalgebra::Matrix2::new(0.4, 0.1, 0.0, 0.2);
    let [in_kpa, in_pa] = ["kPa", "Pa"].map(|unit| law("preset = \"skin-rabbit\"", unit).respond(&stretch).energy);
    assert!(close(in_pa, 1e3 * in_kpa, 1e-12));
}

#[test]
fn the_rabbits_skin_is_the_papers_law() {
    let paper = Scene::bundled("paper").unwrap().material;
    let skin = law("preset = \"skin-rabbit\"", "Pa");
    let stretch = nalgebra::Matrix2::new(0.3, 0.2, -0.1, -0.2);
    let [one, other] = [&paper, &skin].map(|law| law.respond(&stretch));
    assert!(close(one.energy, other.energy, 1e-12) && (one.pk1_stress - other.pk1_stress).norm() < 1e-9);
}

/// A block of 100 mm with an inclusion, all of it of presets, in units of so many mm and kPa.
fn block(labels: [&str; 2], [mm, kpa]: [f64; 2]) -> String {
    let point = |x: f64, y: f64| format!("[{}, {}]", x / mm, y / mm);
    let path =
        |points: &[[f64; 2]]| format!("[{}]", points.iter().map(|[x, y]| point(*x, *y)).collect::<Vec<_>>().join(", "));
    let [length, stress] = labels;
    format!(
        "[scene]\nname = \"block\"\ndimension = 2\nunits = {{ length = {length:?}, stress = {stress:?} }}\n\
         [domain]\noutline = {}\n[material]\npreset = \"breast-fat\"\nbarrier = {}\n\
         [[inclusion]]\noutline = {}\nmaterial = {{ preset = \"prostate\" }}\n\
         [immobile]\npaths = [{}]\n[needle]\ncontact = {}\naxis = [0.0, -1.0]\ndepth = {}\nincrements = 4\n\
         [target]\nposition = {}\n[[paddle]]\nindex = 1\nsegment = {}\n[[paddle]]\nindex = 2\nsegment = {}\n\
         [discretization]\nspacing = {}\n",
        path(&[[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]]),
        2.0 / kpa,
        path(&[[50.0, 30.0], [80.0, 30.0], [80.0, 60.0], [50.0, 60.0]]),
        path(&[[100.0, 0.0], [100.0, 100.0]]),
        path(&[[40.0, 100.0], [60.0, 100.0]]),
        8.0 / mm,
        point(45.0, 50.0),
        path(&[[0.0, 20.0], [0.0, 40.0]]),
        path(&[[20.0, 0.0], [40.0, 0.0]]),
        10.0 / mm,
    )
}

fn placed(text: &str) -> (Placement, f64) {
    let scene = Scene::parse(text, "block.toml").unwrap();
    let model = TissueModel::new(&scene).unwrap();
    (place(&model, &PlacementOptions { threads: 1, ..Default::default() }).unwrap(), scene.needle.depth)
}

/// Body, inclusion and barrier each have a stress, and only their ratios count.
#[test]
fn a_scene_of_presets_does_not_depend_on_the_units() {
    let (one, one_depth) = placed(&block(["mm", "kPa"], [1.0, 1.0]));
    for (labels, sizes) in [(["m", "Pa"], [1e3, 1e-3]), (["in", "psi"], [25.4, 6.894_757_293_168_361])] {
        let (other, other_depth) = placed(&block(labels, sizes));
        assert_eq!(one.optimum, other.optimum);
        for (a, b) in one.paddles.iter().zip(&other.paddles) {
            assert!(close(a.controllability_measure, b.controllability_measure, 1e-9), "{labels:?}");
            let [a, b] =
                [(a, one_depth), (b, other_depth)].map(|(paddle, depth)| paddle.static_study.max_orthogonal / depth);
            assert!(close(a, b, 1e-6), "{labels:?}: {a} {b}");
        }
    }
}

#[test]
fn keys_beside_a_preset_replace_its_own() {
    let fat = law("preset = \"breast-fat\"", "Pa");
    // In the scene's unit, and nothing else changes.
    let stiff = law("preset = \"breast-fat\"\nmu = 2000.0\nlambda = 3000.0", "Pa");
    assert!(close(shear_modulus(&stiff), 2000.0, 1e-12) && close(poisson_ratio(&stiff), 0.3, 1e-12));
    let one = law("preset = \"breast-fat\"\nlambda = 3000.0", "Pa");
    assert_eq!(shear_modulus(&one), shear_modulus(&fat));
    assert_eq!(law("preset = \"breast-fat\"\nbarrier = 70.0", "Pa").barrier(), 70.0);
    let slow = law("preset = \"liver\"\nrelaxation = { g = [0.1], tau = [9.0] }", "kPa");
    assert!((slow.relaxation().unwrap().remaining(1e6) - 0.9).abs() < 1e-12);
    assert_eq!(
        law("preset = \"liver\"\nrelaxation = { g = [], tau = [] }", "kPa"),
        law("preset = \"liver\"", "kPa").elastic()
    );
    // Another law takes the moduli at rest.
    let linear = law("preset = \"skin-rabbit\"\nmodel = \"linear\"", "kPa");
    assert!(linear.is_linear() && close(shear_modulus(&linear), 0.319_279, 1e-9), "{linear:?}");
    let doubled = law("preset = \"skin-rabbit\"\nc = 1.558", "Pa");
    assert!(close(shear_modulus(&doubled), 318.5 + 1.558, 1e-12));
}

/// What is refused, where, and what to do.
#[test]
fn what_cannot_be_named_is_refused_with_its_line() {
    let both = block(["mm", "kPa"], [1.0, 1.0]);
    let good = both.replace("material = { preset = \"prostate\" }", "stiffness = 4.0");
    let body_line = 1 + good[..good.find("[material]").unwrap()].matches('\n').count();
    let refused = |from: &str, to: &str| {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good);
        Scene::parse(&text, "mine.toml").unwrap_err()
    };
    let unknown = refused("breast-fat", "brest-fat");
    assert_eq!(unknown.line, body_line + 1);
    for preset in Preset::VARIANTS {
        assert!(unknown.message.contains(&format!("`{preset}`")), "{unknown}");
    }
    for unit in ["stress = \"1\"", "stress = \"bar\"", ""] {
        let comma = if unit.is_empty() { ", " } else { "" };
        let error = refused(&format!("{comma}stress = \"kPa\""), unit);
        assert_eq!(error.line, body_line, "{error}");
        assert!(error.message.contains("breast-fat") && error.message.contains("Pa, kPa, MPa, mmHg, psi"), "{error}");
        assert!(error.help.contains("[scene] units") && error.help.contains("write out the numbers"), "{}", error.help);
    }
    // The inclusion's own place.
    let text =
        both.replace("preset = \"breast-fat\"", "model = \"linear\"\nlambda = 1.0\nmu = 1.0").replace("kPa", "1");
    let error = Scene::parse(&text, "mine.toml").unwrap_err();
    assert_eq!(text.lines().nth(error.line - 1).unwrap(), "material = { preset = \"prostate\" }");
    let error = refused("preset = \"breast-fat\"\n", "");
    assert!(error.message.contains("neither model nor preset") && error.help.contains("model-offline materials"));
    let error = refused("preset = \"breast-fat\"\n", "preset = \"skin-rabbit\"\nA = [[0, 0, 0, 0, 1.0]]\n");
    assert!(error.message.contains("A beside a preset"), "{error}");
    let error = refused("preset = \"breast-fat\"\n", "preset = \"breast-fat\"\nmu = -1.0\n");
    assert!(error.message.contains("stable"), "{error}");
    let error = refused("preset = \"breast-fat\"\n", "preset = \"breast-fat\"\nc = 1.0\n");
    assert!(error.message.contains("c has no meaning"), "{error}");
}

/// The list names them all, and what its JSON writes out is the material itself.
#[test]
fn the_command_lists_them_and_writes_them_out() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("materials.json");
    let said = model_offline().args(["materials", "--json"]).arg(&json).assert().success();
    let said = String::from_utf8(said.get_output().stdout.clone()).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(written.as_array().unwrap().len(), AT_REST.len());
    for ((name, shear, _), row) in AT_REST.iter().zip(written.as_array().unwrap()) {
        let line = said.lines().find(|line| line.starts_with(name)).unwrap();
        assert!(line.contains(&format!("{shear:.3}")), "{line}");
        assert!(said.contains(row["source"].as_str().unwrap()) && said.contains(row["judgement"].as_str().unwrap()));
        assert_eq!(row["preset"], *name);
        let section: MaterialSection = serde_json::from_value(row["material"].clone()).unwrap();
        // No unit: nothing is converted. JSON rounds in the last digit.
        let (own, other) = (section.law("1").unwrap(), law(&format!("preset = {name:?}"), "kPa"));
        let stretch = nalgebra::Matrix2::new(0.3, 0.2, -0.1, 0.1);
        assert!(close(own.respond(&stretch).energy, other.respond(&stretch).energy, 1e-13), "{name}");
        assert_eq!(own.relaxation(), other.relaxation());
    }
    let schema = model_offline().arg("schema").assert().success();
    let schema = String::from_utf8(schema.get_output().stdout.clone()).unwrap();
    assert!(AT_REST.iter().all(|(name, ..)| schema.contains(&format!("{name:?}"))), "{schema}");
    let starter = model_offline().arg("new").assert().success();
    assert!(String::from_utf8_lossy(&starter.get_output().stdout).contains("model-offline materials"));
}
