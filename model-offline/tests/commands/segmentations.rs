//! Segmentations as people have them: with cavities and specks, in another unit than the scene, beside the target.

use assert_cmd::Command;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

/// A block of 12 × 10 × 8 voxels of 5 mm in an image of 16 × 14 × 12, so that its faces are at 0 and at 60, 50 and 40 mm.
const VOXEL: f64 = 5.0;
const SIZE: [usize; 3] = [16, 14, 12];
const BLOCK: [usize; 3] = [12, 10, 8];

/// An NRRD file of text: label 2 is in the middle of label 1, and some voxels have other labels.
fn image(others: &[([usize; 3], u16)]) -> String {
    let mut text = format!(
        "NRRD0004\ntype: uchar\ndimension: 3\nspace: right-anterior-superior\nsizes: {} {} {}\nspace directions: ({VOXEL},0,0) \
         (0,{VOXEL},0) (0,0,{VOXEL})\nspace origin: ({origin},{origin},{origin})\nencoding: ascii\n\n",
        SIZE[0],
        SIZE[1],
        SIZE[2],
        // The block begins with the third voxel.
        origin = -1.5 * VOXEL
    );
    let within = |at: [usize; 3], from: usize| (0..3).all(|k| at[k] >= 2 + from && at[k] < 2 + BLOCK[k] - from);
    for at in (0..SIZE[2]).flat_map(|k| (0..SIZE[1]).flat_map(move |j| (0..SIZE[0]).map(move |i| [i, j, k]))) {
        let other = others.iter().find(|(place, _)| *place == at).map(|(_, label)| *label);
        let label = other.unwrap_or(u16::from(within(at, 0)) + u16::from(within(at, 3)));
        write!(text, "{label} ").unwrap();
    }
    text
}

fn scene(unit: &str, target: [f64; 3]) -> String {
    format!(
        r#"
scene = {{ name = "segmented", dimension = 3, units = {{ length = "{unit}", stress = "kPa" }} }}
domain.labels = {{ file = "a.nrrd", body = [1, 2] }}
material = {{ model = "neo-hookean", lambda = 4.0, mu = 1.0 }}
inclusion = [{{ label = 2, stiffness = 10.0 }}]
immobile.regions = [{{ box = {{ min = [-3.0, -3.0, -3.0], max = [63.0, 53.0, 2.0] }} }}]
needle = {{ region = {{ box = {{ min = [20.0, 20.0, 38.0], max = [30.0, 30.0, 43.0] }} }}, axis = [0.0, 0.0, -1.0], depth = 3.0, increments = 2 }}
target.position = {target:?}
paddle = [{{ index = 1, region = {{ box = {{ min = [-3.0, 15.0, 15.0], max = [2.0, 35.0, 30.0] }} }} }}]
discretization.tolerance = 0.1
"#
    )
}

/// `check` of a scene beside an image: exit code, what was told and said in one line, and its numbers.
fn check(scene: &str, image: &str, folder: &Path) -> (i32, String, Value) {
    std::fs::write(folder.join("a.nrrd"), image).unwrap();
    std::fs::write(folder.join("a.toml"), scene).unwrap();
    let _ = std::fs::remove_file(folder.join("a.json"));
    let mut command = Command::cargo_bin("model-offline").unwrap();
    let output = command.current_dir(folder).args(["check", "a.toml", "--json", "a.json"]).output().unwrap();
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    let json = std::fs::read(folder.join("a.json")).ok();
    (output.status.code().unwrap(), said, json.map_or(Value::Null, |text| serde_json::from_slice(&text).unwrap()))
}

const INSIDE: [f64; 3] = [35.0, 27.0, 20.0];

/// Smoothing takes edges and corners away; faces move outwards by a small part of a voxel, so that the volume stays.
#[test]
fn a_segmented_block_is_as_large_as_its_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let (code, said, found) = check(&scene("mm", INSIDE), &image(&[]), folder.path());
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("no warnings") && !said.contains("separate part") && !said.contains("cavity"), "{said}");
    for (key, expected) in [("low", [0.0; 3]), ("high", [60.0, 50.0, 40.0])] {
        for (k, expected) in expected.into_iter().enumerate() {
            let corner = found[key][k].as_f64().unwrap();
            assert!((corner - expected).abs() < 0.15 * VOXEL, "{key} {k}: {corner}");
        }
    }
}

#[test]
fn cavities_and_specks_of_labels_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let cavity: Vec<([usize; 3], u16)> = (3..5).map(|i| ([i, 4, 4], 0)).collect();
    let pit = [([5, 5, 2], 0)];
    let specks = [([3, 3, 3], 2), ([12, 10, 8], 2), ([14, 3, 3], 1)];
    for (others, told, not) in [
        (&cavity[..], vec!["the body has 1 cavity of 2 voxels"], "separate part"),
        // What is open to the outside is none.
        (&pit, vec![], "cavity"),
        (
            &specks[..2],
            vec!["label 2 has 2 separate parts beside the largest of 48 voxels, 2 voxels together"],
            "the body has",
        ),
        (&specks[2..], vec![], "separate part"),
        (
            &[([0, 0, 0], 1)],
            vec!["the body has 1 separate part beside the largest of 960 voxels, 1 voxel together"],
            "label 2 has",
        ),
    ] {
        let (code, said, _) = check(&scene("mm", INSIDE), &image(others), folder.path());
        assert_eq!(code, 0, "{others:?}: {said}");
        for told in told {
            assert!(said.contains(told), "{others:?}: {said}");
        }
        assert!(!said.contains(not), "{others:?}: {said}");
    }
}

/// Numbers are taken as they are: a body of 60 mm is one of 60 cm in a scene that says so, which is seldom meant.
#[test]
fn a_scene_in_another_unit_than_its_segmentation_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    for (unit, warns) in [("mm", false), ("cm", true), ("m", true), ("in", true), ("1", false), ("voxel", false)] {
        let (code, said, found) = check(&scene(unit, INSIDE), &image(&[]), folder.path());
        assert_eq!(code, 0, "{said}");
        let warned = found["warnings"].to_string().contains("the body's file is in mm and taken as it is");
        assert_eq!((warned, said.contains(&format!("lengths are in {unit}"))), (warns, warns), "{unit}: {said}");
        assert_eq!(said.contains("note: a.nrrd: coordinates are in mm"), unit != "mm", "{unit}: {said}");
    }
}

/// What explains it is said: where the body is, and what its file holds.
#[test]
fn a_target_beside_the_body_is_told_with_what_is_known_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (code, said, _) = check(&scene("mm", [0.035, 0.027, -20.0]), &image(&[]), folder.path());
    assert!(code == 2 && said.contains("the target is outside the body"), "{code}: {said}");
    assert!(said.contains("which reaches from (") && said.contains("a.nrrd: label 1: 912 voxels"), "{said}");
}

/// The distance of the target from the surface, by Lagrange's condition x = t / (1 + λ / a²), the root by bisection.
#[test]
fn the_target_of_an_ellipsoid_is_as_far_from_its_surface_as_lagrange_says() {
    let distance = |axes: [f64; 3], target: [f64; 3]| {
        let at = |lambda: f64| std::array::from_fn::<f64, 3, _>(|k| target[k] / (1.0 + lambda / (axes[k] * axes[k])));
        let beyond = |lambda: f64| at(lambda).iter().zip(axes).map(|(x, a)| (x / a).powi(2)).sum::<f64>() > 1.0;
        // Towards −a² of the shortest axis the point goes to infinity along it.
        let least = axes.iter().fold(f64::INFINITY, |least, a| least.min(a * a));
        let (mut low, mut high) = (-least * (1.0 - 1e-12), 0.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if beyond(middle) { low = middle } else { high = middle }
        }
        at(high).iter().zip(target).map(|(x, t)| (x - t) * (x - t)).sum::<f64>().sqrt()
    };
    let folder = tempfile::tempdir().unwrap();
    for (axes, target) in [
        ([40.0, 30.0, 25.0], [6.0, 3.0, 4.0]),
        ([60.0, 60.0, 25.0], [6.0, 3.0, 4.0]),
        ([40.0, 30.0, 25.0], [30.0, 2.0, 1.0]),
    ] {
        let [x, y, z] = axes;
        let text = format!(
            r#"
scene = {{ name = "egg", dimension = 3, units = {{ length = "mm", stress = "kPa" }} }}
domain.solid = {{ ellipsoid = {{ centre = [0.0, 0.0, 0.0], semi_axes = [{x:?}, {y:?}, {z:?}] }} }}
material = {{ model = "neo-hookean", lambda = 4.0, mu = 1.0 }}
immobile.regions = [{{ box = {{ min = [-90.0, -90.0, -90.0], max = [90.0, 90.0, -15.0] }} }}]
needle = {{ region = {{ sphere = {{ centre = [0.0, 0.0, {z:?}], radius = 6.0 }} }}, axis = [0.0, 0.0, -1.0], depth = 2.0 }}
target.position = {target:?}
paddle = [{{ index = 1, region = {{ sphere = {{ centre = [{x:?}, 0.0, 0.0], radius = 8.0 }} }} }}]
discretization.level = 0
"#
        );
        let (code, said, found) = check(&text, &image(&[]), folder.path());
        assert_eq!(code, 0, "{said}");
        let (found, expected) = (found["target"]["from_boundary"].as_f64().unwrap(), distance(axes, target));
        assert!((found / expected - 1.0).abs() < 1e-3, "{axes:?} {target:?}: {found}, not {expected}");
    }
}

#[test]
fn an_inclusion_of_a_material_of_its_own_says_which() {
    let folder = tempfile::tempdir().unwrap();
    let own = "material = { model = \"neo-hookean\", lambda = 40.0, mu = 7.0 }";
    for (keys, told) in [
        (own.to_owned(), "inclusion 1 own material, shear modulus 7 kPa at rest; volume"),
        (
            format!("{own}, stiffness = 2.0"),
            "inclusion 1 own material, shear modulus 7 kPa at rest, stiffness times 2; volume",
        ),
        ("stiffness = 10.0".to_owned(), "inclusion 1 stiffness times 10; volume"),
    ] {
        let scene = scene("mm", [25.0, 25.0, 17.5]).replacen("stiffness = 10.0", &keys, 1);
        let (code, said, _) = check(&scene, &image(&[]), folder.path());
        assert!(code == 0 && said.contains(told), "{told}:\n{said}");
    }
}
