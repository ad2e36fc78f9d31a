//! Bodies that are surfaces of triangles: their sharp edges are edges of the mesh.

use super::*;
use crate::geometry::surface::solids::{self, sphere};
use crate::geometry::surface::{CheckedSurface, TriangleSurface};
use nalgebra::Rotation3;

fn mesh_of(body: &CheckedSurface, interfaces: &[&dyn Implicit], size: f64) -> TetMesh {
    let size = |_: &Point<3>| size;
    let request =
        Request { body, interfaces, patches: &[], size: &size, lattice: None, most_nodes: 200_000, pinned: &[] };
    let mesh = stuff(&request).unwrap_or_else(|wrong| panic!("{wrong}"));
    let q = mesh.quality();
    assert!(q.min_dihedral > 3.0, "{q:?}");
    mesh
}

/// Edges of the mesh's surface at which it turns by more than 35°.
fn sharp_edges(mesh: &TetMesh) -> Vec<[Point<3>; 2]> {
    let at = |n: u32| mesh.nodes[n as usize];
    let mut edges: Vec<([u32; 2], Point<3>)> = Vec::new();
    for [a, b, c] in mesh.boundary() {
        let normal = (at(b) - at(a)).cross(&(at(c) - at(a))).normalize();
        edges.extend([[a, b], [b, c], [c, a]].map(|[p, q]| ([p.min(q), p.max(q)], normal)));
    }
    edges.sort_by_key(|(edge, _)| *edge);
    let turns = |pair: &&[([u32; 2], Point<3>)]| pair[0].1.dot(&pair[1].1) < 0.82;
    edges.chunk_by(|a, b| a.0 == b.0).filter(turns).map(|pair| pair[0].0.map(at)).collect()
}

fn length(edges: &[[Point<3>; 2]]) -> f64 {
    edges.iter().map(|[a, b]| (b - a).norm()).sum()
}

/// Every triangle in four, so often.
fn divided(surface: &TriangleSurface, times: usize) -> TriangleSurface {
    let mut all: Vec<[Point<3>; 3]> =
        surface.triangles.iter().map(|t| t.map(|v| surface.vertices[v as usize])).collect();
    for _ in 0..times {
        let four = |[a, b, c]: [Point<3>; 3]| {
            let [ab, bc, ca] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        all = all.into_iter().flat_map(four).collect();
    }
    TriangleSurface::of_soup(&all)
}

fn moved(surface: &TriangleSurface, to: impl Fn(Point<3>) -> Point<3>) -> TriangleSurface {
    // In single precision, as STL has it.
    let rounded = |x: &Point<3>| to(*x).map(|c| f64::from(c as f32));
    TriangleSurface { vertices: surface.vertices.iter().map(rounded).collect(), triangles: surface.triangles.clone() }
}

/// An L of two by two by one, a quarter of it missing.
fn angle() -> TriangleSurface {
    let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    let at = |i: usize, z: f64| p(outline[i % 6][0], outline[i % 6][1], z);
    let mut all = Vec::new();
    for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]] {
        all.extend([[at(a, 1.0), at(b, 1.0), at(c, 1.0)], [at(a, 0.0), at(c, 0.0), at(b, 0.0)]]);
    }
    for i in 0..6 {
        let (a, b, c, d) = (at(i, 0.0), at(i + 1, 0.0), at(i + 1, 1.0), at(i, 1.0));
        all.extend([[a, b, c], [a, c, d]]);
    }
    TriangleSurface::of_soup(&all)
}

#[test]
fn boxes_and_angles_in_any_position_keep_their_edges_and_corners() {
    let turned = Rotation3::from_euler_angles(0.3, 0.7, -0.4);
    let cube = solids::cuboid([0.013, -0.21, 0.0], [1.0, 0.777, 0.618]);
    for (name, solid, volume, edges) in [
        ("box", cube.clone(), 0.987 * 0.987 * 0.618, 4.0 * (0.987 + 0.987 + 0.618)),
        ("box of many", divided(&cube, 3), 0.987 * 0.987 * 0.618, 4.0 * (0.987 + 0.987 + 0.618)),
        ("angle", angle(), 3.0, 22.0),
        ("angle of many", divided(&angle(), 2), 3.0, 22.0),
    ] {
        for turn in [Rotation3::identity(), turned] {
            let body = moved(&solid, |x| turn * x + p(3.0, -1.0, 0.1)).check().unwrap();
            let mesh = mesh_of(&body, &[], 0.13);
            assert_close(name, super::volume(&mesh, None), volume, 2e-6);
            assert_close(name, length(&sharp_edges(&mesh)), edges, 2e-6);
        }
    }
}

/// The upper half of a ball of triangles, closed by its base.
fn dome(divisions: usize) -> TriangleSurface {
    let whole = sphere(1.0, divisions);
    let half = (0..whole.triangles.len()).map(|t| whole.triangles[t].map(|v| whole.vertices[v as usize]));
    let mut all: Vec<[Point<3>; 3]> = half.filter(|t| t.iter().all(|x| x.z >= 0.0)).collect();
    let base: Vec<[Point<3>; 2]> = all
        .iter()
        .flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])
        .filter(|edge| edge.iter().all(|x| x.z == 0.0))
        .collect();
    all.extend(base.into_iter().map(|[a, b]| [b, a, Point::zeros()]));
    TriangleSurface::of_soup(&all)
}

#[test]
fn the_edge_between_a_dome_and_its_base_is_kept() {
    let circle = 2.0 * std::f64::consts::PI;
    for turn in [Rotation3::identity(), Rotation3::from_euler_angles(0.3, 0.7, -0.4)] {
        let body = moved(&dome(4), |x| turn * x).check().unwrap();
        let mesh = mesh_of(&body, &[], 0.2);
        let edges = sharp_edges(&mesh);
        // Chords of the circle, no longer than an edge: 1 − h²/24 of it.
        assert_close("rim", length(&edges), circle, 0.01);
        let on_rim = |x: &Point<3>| {
            let x = turn.inverse() * x;
            x.z.abs() < 1e-5 && (x.norm() - 1.0).abs() < 0.005
        };
        assert!(edges.iter().flatten().all(on_rim));
        assert_close("volume", super::volume(&mesh, None), 0.5 * SPHERE, 0.02);
    }
}

#[test]
fn smooth_surfaces_have_no_edges() {
    for (semi_axes, divisions) in [([1.0, 1.0, 1.0], 2), ([1.0, 0.6, 0.8], 2), ([1.0, 0.5, 0.5], 4)] {
        let body = moved(&sphere(1.0, divisions), |x| x.component_mul(&Point::<3>::from(semi_axes))).check().unwrap();
        assert!(matches!(body.sheets()[..], [crate::geometry::Sheet::Smooth(_)]), "{semi_axes:?}");
        assert!(feature_points(&body, 0.1).is_empty());
    }
}

#[test]
fn a_part_that_ends_at_the_surface_ends_in_an_edge_of_the_mesh() {
    let turn = Rotation3::from_euler_angles(0.1, -0.6, 0.2);
    let body = moved(&solids::cube(0.0, 1.0), |x| turn * x).check().unwrap();
    // It shares a corner with the body.
    let part = moved(&solids::cuboid([0.4, 0.3, 0.7], [1.0, 1.0, 1.0]), |x| turn * x).check_within(&body).unwrap();
    let mesh = mesh_of(&body, &[&part], 0.09);
    assert_close("body", super::volume(&mesh, None), 1.0, 1e-6);
    assert_close("part", super::volume(&mesh, Some(1)), 0.6 * 0.7 * 0.3, 1e-5);
}
