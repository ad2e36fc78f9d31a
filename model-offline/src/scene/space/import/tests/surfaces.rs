use super::super::*;
use super::made;
use crate::geometry::surface::TriangleSurface;
use crate::geometry::surface::solids::{cube, cuboid, files, sphere, tetrahedron};
use crate::geometry::{Implicit as _, Point};
use crate::random::SplitMix64;

fn read(name: &str, bytes: &[u8]) -> Result<Noted<TriangleSurface>, ReadError> {
    match name.rsplit('.').next() {
        Some("stl") => stl::read(bytes),
        Some("obj") => obj::read(bytes),
        _ => ply::read(bytes),
    }
}

/// The same triangles, whatever the format: the same vertices in the same order.
#[test]
fn every_format_gives_the_same_checked_surface() {
    for solid in [cube(-2.0, 3.5), tetrahedron(), sphere(7.0, 2)] {
        let expected = solid.check().unwrap();
        for (name, bytes) in files(&solid) {
            let found = read(name, &bytes).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
            assert_eq!(found.value.check().unwrap().surface(), expected.surface(), "{name}");
            assert_eq!(found.notes, Vec::<String>::new(), "{name}");
        }
    }
}

#[test]
fn files_of_other_programs_hold_the_box_that_they_say() {
    let expected = cuboid([-9.0, -13.0, -17.0], [11.0, 17.0, 23.0]).check().unwrap();
    let names = [
        "trimesh.stl",
        "trimesh_ascii.stl",
        "trimesh.obj",
        "trimesh.ply",
        "trimesh_ascii.ply",
        "vtk_ascii.stl",
        "vtk_binary.stl",
        "vtk_big.ply",
        "vtk_little.ply",
        "vtk.obj",
    ];
    let mut random = SplitMix64(1);
    let points: Vec<Point<3>> = (0..500).map(|_| Point::<3>::from_fn(|_, _| 1.0 + 30.0 * random.symmetric())).collect();
    for name in names {
        let found = read(name, &made(&format!("box_{name}"))).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        let found = found.value.check().unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        assert_eq!((found.volume(), found.surface().vertices.len()), (24_000.0, 8), "{name}");
        assert!(points.iter().all(|x| (found.level(x) - expected.level(x)).abs() < 1e-12), "{name}");
    }
}

#[test]
fn polygons_become_fans_and_are_noted() {
    let text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 .5 0\nf 1 2 3 4 5\nf -5 -4 -3\nlod 1\ncurv 0 1 1 2\n";
    let found = obj::read(text).unwrap();
    assert_eq!(found.value.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2]]);
    assert_eq!(found.notes.len(), 2, "{:?}", found.notes);
    assert!(found.notes[1].contains("`curv`") && found.notes[1].contains("line 9"), "{:?}", found.notes);
}

#[test]
fn what_is_wrong_is_said_with_its_line() {
    let told = |name: &str, text: &str| read(name, text.as_bytes()).unwrap_err().to_string();
    let has = |told: String, parts: &[&str]| {
        assert!(parts.iter().all(|part| told.contains(part)), "{told:?} has not all of {parts:?}");
    };
    has(told(".obj", "v 0 0 0\nv 1 0\nf 1 2 3\n"), &["OBJ, line 2", "the line ends"]);
    has(told(".obj", "v 0 0 0\nv 1,5 0 0\n"), &["line 2", "1,5", "with a point"]);
    has(told(".obj", "v 0 0 0\nv 1 nan 0\n"), &["line 2", "NaN"]);
    has(told(".obj", "v 0 0 0\nv 1 0 0\n\nf 1 2 3\n"), &["line 4", "vertex 3", "there are 2"]);
    has(told(".obj", "v 0 0 0\nf 1 1 0\n"), &["line 2", "counted from 1"]);
    has(told(".obj", "v 0 0 0\nf 1 -2 1\n"), &["line 2", "-2"]);
    has(told(".obj", "v 0 0 0\nf 1 1\n"), &["line 2", "at least 3"]);
    has(told(".obj", "v 0 0 0\n"), &["no faces"]);
    has(told(".stl", "solid x\nfacet normal 0 0 0\nouter loop\nvertex 0 0 inf\n"), &["STL, line 4", "inf"]);
    has(told(".stl", "solid x\nfacet normal 0 0 0\nouter loop\nvertex 0 0 1\nendloop\n"), &["line 5", "vertex"]);
    has(told(".stl", "solid x\nendsolid x\n"), &["no triangles"]);
    has(told(".stl", "solid x\nfacet normal 0 0 0\n"), &["outer", "cut off"]);
    has(told(".ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"), &["x, y and z"]);
    has(told(".ply", "ply\nelement vertex 1\nproperty half x\n"), &["line 3", "half"]);
    has(told(".ply", "ply\nformat text 1.0\n"), &["line 2", "text"]);
    let ply = |face: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n{face}\n"
        )
    };
    assert!(ply::read(ply("3 0 1 2").as_bytes()).is_ok());
    has(told(".ply", &ply("3 0 1 3")), &["vertex 3", "there are 3"]);
    has(told(".ply", &ply("3 0 1 -1")), &["line 13", "-1"]);
    has(told(".ply", &ply("2 0 1")), &["2 corners"]);
    let mut nan = files(&tetrahedron())[1].1.clone();
    nan[84 + 50 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    has(stl::read(&nan).unwrap_err().to_string(), &["byte 150", "NaN"]);
}

#[test]
fn files_are_read_by_their_endings() {
    let path = |name: &str| std::path::PathBuf::from(format!("{}/tests/data3d/{name}", env!("CARGO_MANIFEST_DIR")));
    assert!(surface(&path("box_vtk.obj")).is_ok());
    assert!(labels(&path("labels_u8.nii.gz")).is_ok());
    let told = surface(&path("labels_u8.nii.gz")).unwrap_err().to_string();
    assert!(told.contains("labels_u8.nii.gz") && told.contains(".stl, .obj or .ply"), "{told}");
    let told = labels(&path("missing.nrrd")).unwrap_err().to_string();
    assert!(told.contains("missing.nrrd"), "{told}");
}
