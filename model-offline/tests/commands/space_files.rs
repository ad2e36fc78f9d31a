//! Bodies in space from files: the same results as the solids that the files hold.

use assert_cmd::Command;
use model_offline::discretization::TetMesh;
use model_offline::model::space::meshing::{MeshSize, mesh};
use model_offline::scene::space::{AnyScene, SpaceScene};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

const BOX: &str = "box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 1.0] }";
const INCLUSION: &str = "box = { min = [0.6, 0.4, 0.3], max = [0.7, 0.6, 0.4] }";

const HELD: &str = "min = [1.0, 0.0, 0.0], max = [1.0, 1.0, 1.0]";

/// `block` on a coarse mesh, with replacements.
fn block(changes: &[(&str, &str)]) -> String {
    let text =
        include_str!("../../scenes/block.toml").replacen("tolerance = 0.05", "level = 0\nintegration = \"fem-t4\"", 1);
    let text = text.replacen("of = \"all\"", "of = [[1, 2], [3, 6]]", 1);
    changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

/// Places on a scene of this text in a folder: exit code, what was said in one line, and what was written.
fn place(text: &str, folder: &Path) -> (i32, String, Option<Value>) {
    let (scene, json) = (folder.join("scene.toml"), folder.join("place.json"));
    let _ = std::fs::remove_file(&json);
    std::fs::write(&scene, text).unwrap();
    let mut command = Command::cargo_bin("model-offline").unwrap();
    let output = command.arg("place").arg(&scene).arg("--json").arg(&json).arg("--quiet").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    let written = std::fs::read_to_string(&json).ok().map(|text| serde_json::from_str(&text).unwrap());
    (output.status.code().unwrap(), said, written)
}

/// Measures of all paddles and pairs, and the largest orthogonal displacement with each held still.
fn study(text: &str, folder: &Path) -> (Vec<f64>, Vec<f64>) {
    let (code, said, written) = place(text, folder);
    assert_eq!(code, 0, "{said}");
    let written = written.unwrap();
    let all = || written["paddles"].as_array().unwrap().iter().chain(written["pairs"].as_array().unwrap());
    let measures = all().map(|result| result["controllability_measure"].as_f64().unwrap());
    let fixtures = all().map(|result| result["static"]["max_orthogonal"].as_f64().unwrap());
    (measures.collect(), fixtures.collect())
}

/// The largest relative distance of numbers from what they should be.
fn worst(found: &[f64], expected: &[f64]) -> f64 {
    found.iter().zip(expected).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
}

fn assert_same(what: &str, found: &(Vec<f64>, Vec<f64>), expected: &(Vec<f64>, Vec<f64>)) {
    let (measures, fixtures) = (worst(&found.0, &expected.0), worst(&found.1, &expected.1));
    println!("{what}: measures within {:.3} %, fixtures within {:.3} %", 100.0 * measures, 100.0 * fixtures);
    assert!(measures < 0.01 && fixtures < 0.05, "{what}: {measures} {fixtures}\n{found:?}\n{expected:?}");
}

/// The box between two corners as text STL, its faces in so many rectangles along each side.
fn cuboid(n: usize, low: [f64; 3], high: [f64; 3]) -> String {
    let mut text = "solid cuboid\n".to_owned();
    let at = |axis: usize, i: usize| low[axis] + (high[axis] - low[axis]) * i as f64 / n as f64;
    for axis in 0..3 {
        for (i, j, top) in (0..n).flat_map(|i| (0..n).flat_map(move |j| [(i, j, false), (i, j, true)])) {
            let corner = |u: usize, v: usize| {
                let mut x = [0.0; 3];
                x[axis] = if top { high[axis] } else { low[axis] };
                x[(axis + 1) % 3] = at((axis + 1) % 3, i + u);
                x[(axis + 2) % 3] = at((axis + 2) % 3, j + v);
                format!("vertex {} {} {}\n", x[0] as f32, x[1] as f32, x[2] as f32)
            };
            for t in [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]] {
                let mut t = t.map(|(u, v)| corner(u, v));
                if !top {
                    t.swap(1, 2);
                }
                let _ = write!(text, "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", t.concat());
            }
        }
    }
    text + "endsolid cuboid\n"
}

#[test]
fn block_from_a_surface_is_block() {
    let folder = tempfile::tempdir().unwrap();
    // Its base is where no lattice that has the paddles has a plane.
    let held = |body: &str| block(&[(BOX, body), (HELD, "min = [1.0, 0.0, -0.0213], max = [1.0, 1.0, 1.0]")]);
    let expected = study(&held("box = { min = [0.0, 0.0, -0.0213], max = [1.0, 1.0, 1.0] }"), folder.path());
    for n in [1, 9] {
        std::fs::write(folder.path().join("cube.stl"), cuboid(n, [0.0, 0.0, -0.0213], [1.0; 3])).unwrap();
        let found = study(&held("surface = \"cube.stl\""), folder.path());
        assert_same(&format!("{} triangles", 12 * n * n), &found, &expected);
        // The same planes make the same mesh. Taken as smooth, the body is nearly one per cent off.
        assert!(worst(&found.0, &expected.0) < 1e-4);
    }
}

/// A mesh as Gmsh's version 2.2, its parts as physical groups 1 and 2.
fn gmsh(mesh: &TetMesh) -> String {
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 1 \"tissue\"\n3 2 \"stiff part\"\n\
                    $EndPhysicalNames\n$Nodes\n"
        .to_owned();
    let _ = writeln!(text, "{}", mesh.nodes.len());
    for (i, x) in (1..).zip(&mesh.nodes) {
        let _ = writeln!(text, "{i} {} {} {}", x.x, x.y, x.z);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tetrahedra.len());
    for (i, (t, part)) in (1..).zip(mesh.tetrahedra.iter().zip(&mesh.part)) {
        let [a, b, c, d] = t.map(|n| n + 1);
        let _ = writeln!(text, "{i} 4 2 {} {} {a} {b} {c} {d}", part + 1, part + 1);
    }
    text + "$EndElements\n"
}

fn bundled(name: &str) -> SpaceScene {
    SpaceScene::bundled(name).unwrap()
}

#[test]
fn block_from_a_mesh_with_its_inclusion_as_a_group_is_block() {
    let folder = tempfile::tempdir().unwrap();
    let expected = study(&block(&[]), folder.path());
    let mesh = mesh(&bundled("block"), &MeshSize::level(0)).unwrap();
    std::fs::write(folder.path().join("block.msh"), gmsh(&mesh)).unwrap();
    let body = (BOX, "mesh = \"block.msh\"");
    for part in ["name = \"stiff part\"", "label = 2"] {
        assert_same(part, &study(&block(&[body, (INCLUSION, part)]), folder.path()), &expected);
    }
    for (change, expected) in [
        ((INCLUSION, "name = \"bone\""), "it has 1 (\"tissue\"), 2 (\"stiff part\")"),
        ((INCLUSION, "label = 3"), "no group 3"),
    ] {
        let (code, said, written) = place(&block(&[body, change]), folder.path());
        assert!(code == 2 && said.contains(expected) && written.is_none(), "{code} {said}");
    }
    // The file is a part of what the scene says.
    let hash = || match AnyScene::read(&folder.path().join("scene.toml")).unwrap() {
        AnyScene::Space(scene) => scene.hash(),
        AnyScene::Planar(_) => panic!(),
    };
    std::fs::write(folder.path().join("scene.toml"), block(&[body])).unwrap();
    let before = hash();
    std::fs::write(folder.path().join("block.msh"), gmsh(&mesh) + "\n").unwrap();
    assert_ne!(before, hash());
}

#[test]
fn an_angle_from_a_surface_is_the_solid() {
    // The far quarter of the block's lower side is missing.
    let solid = "solid = { union = [{ box = { min = [0.0, 0.0, 0.35], max = [1.0, 1.0, 1.0] } }, \
                 { box = { min = [0.0, 0.0, 0.0], max = [0.55, 1.0, 1.0] } }] }";
    let folder = tempfile::tempdir().unwrap();
    let held = (HELD, "min = [1.0, 0.0, 0.35], max = [1.0, 1.0, 1.0]");
    let inclusion = (INCLUSION, "box = { min = [0.6, 0.4, 0.6], max = [0.7, 0.6, 0.7] }");
    // What fixtures leave is a small rest, of which level 0 is a fifth off: two meshes of it differ by more than bodies do.
    let text = |body: &str| block(&[(BOX, body), held, inclusion, ("level = 0", "level = 1")]);
    let expected = study(&text(solid), folder.path());
    // Corners in the plane of x and z, all along y.
    let outline = [[0.0, 0.0], [0.55, 0.0], [0.55, 0.35], [1.0, 0.35], [1.0, 1.0], [0.0, 1.0]];
    let mut obj = String::new();
    for y in [0, 1] {
        outline.iter().for_each(|[x, z]| writeln!(obj, "v {x} {y} {z}").unwrap());
    }
    for [a, b, c] in [[1, 2, 3], [1, 3, 6], [6, 3, 5], [3, 4, 5]] {
        let _ = writeln!(obj, "f {a} {b} {c}\nf {} {} {}", a + 6, c + 6, b + 6);
    }
    for i in 1..=6 {
        let next = i % 6 + 1;
        let _ = writeln!(obj, "f {next} {i} {} {}", i + 6, next + 6);
    }
    std::fs::write(folder.path().join("angle.obj"), obj).unwrap();
    assert_same("angle", &study(&text("surface = \"angle.obj\""), folder.path()), &expected);
}

/// A label that the body is to have and no voxel has is no reason to refuse, and is said.
#[test]
fn a_label_that_no_voxel_has_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    std::fs::copy(scenes.join("scan.nii.gz"), folder.path().join("scan.nii.gz")).unwrap();
    let text = std::fs::read_to_string(scenes.join("scan.toml")).unwrap();
    let check = |text: &str| {
        std::fs::write(folder.path().join("scan.toml"), text).unwrap();
        let output = Command::cargo_bin("model-offline").unwrap();
        let output = { output }.current_dir(folder.path()).args(["check", "scan.toml"]).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let note = "no voxel has the label 9 that the body is to have";
    let (code, told) = check(&text);
    assert!(code == Some(0) && !told.contains("no voxel has") && !told.contains("cut off flat"), "{told}");
    let more = text.replacen("body = [", "body = [9, ", 1);
    assert_ne!(more, text);
    let (code, told) = check(&more);
    assert!(code == Some(0) && told.contains(note), "{told}");
}
