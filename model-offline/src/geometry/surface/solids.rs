//! Small solids for tests, and files of them.

use crate::geometry::Point;
use crate::geometry::surface::TriangleSurface;
use std::fmt::Write as _;

/// A box, its triangles in a fixed order.
pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3]) -> TriangleSurface {
    let corner = |i: usize| Point::<3>::from_fn(|axis, _| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    TriangleSurface { vertices: (0..8).map(corner).collect(), triangles }
}

pub(crate) fn cube(low: f64, high: f64) -> TriangleSurface {
    cuboid([low; 3], [high; 3])
}

pub(crate) fn tetrahedron() -> TriangleSurface {
    let vertices = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]].map(Point::<3>::from).to_vec();
    TriangleSurface { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
}

/// An octahedron whose triangles are divided so often, on a sphere.
pub(crate) fn sphere(radius: f64, divisions: usize) -> TriangleSurface {
    let [x, y, z] = [0, 1, 2].map(|axis| Point::<3>::from_fn(|i, _| f64::from(u8::from(i == axis))));
    let mut corners = Vec::new();
    for sign in 0..8 {
        let s = |bit: usize| if sign >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let [a, b, c] = [x * s(0), y * s(1), z * s(2)];
        corners.push(if s(0) * s(1) * s(2) > 0.0 { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..divisions {
        let divided = corners.iter().flat_map(|[a, b, c]| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
        });
        corners = divided.collect();
    }
    // In single precision, as STL has them.
    let rounded = |x: Point<3>| (x * radius).map(|c| f64::from(c as f32));
    let corners: Vec<[Point<3>; 3]> = corners.iter().map(|t| t.map(rounded)).collect();
    TriangleSurface::of_soup(&corners)
}

/// Both surfaces as one.
pub(crate) fn together(a: &TriangleSurface, b: &TriangleSurface) -> TriangleSurface {
    let first = a.vertices.len() as u32;
    let moved = b.triangles.iter().map(|t| t.map(|v| v + first));
    TriangleSurface {
        vertices: [a.vertices.clone(), b.vertices.clone()].concat(),
        triangles: a.triangles.iter().copied().chain(moved).collect(),
    }
}

pub(crate) fn flipped(mut surface: TriangleSurface) -> TriangleSurface {
    surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    surface
}

/// A surface in every format of surfaces.
pub(crate) fn files(surface: &TriangleSurface) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("ascii.stl", stl_text(surface)),
        ("binary.stl", stl(surface, b"exported")),
        ("binary with solid.stl", stl(surface, b"solid exported")),
        (".obj", obj(surface)),
        ("ascii.ply", ply(surface, None)),
        ("little.ply", ply(surface, Some(false))),
        ("big.ply", ply(surface, Some(true))),
    ]
}

fn stl_text(surface: &TriangleSurface) -> Vec<u8> {
    let mut text = "solid a facet of tests\n".to_owned();
    for t in 0..surface.triangles.len() {
        text.push_str(" facet normal 0 0 0\n  outer loop\n");
        surface.corners(t).iter().for_each(|x| writeln!(text, "   vertex {:e} {} {}", x.x, x.y, x.z).unwrap());
        text.push_str("  endloop\n endfacet\n");
    }
    (text + "endsolid a facet of tests\n").into_bytes()
}

fn stl(surface: &TriangleSurface, title: &[u8]) -> Vec<u8> {
    let mut bytes = title.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((surface.triangles.len() as u32).to_le_bytes());
    for t in 0..surface.triangles.len() {
        bytes.extend([0; 12]);
        surface.corners(t).iter().flatten().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn obj(surface: &TriangleSurface) -> Vec<u8> {
    let mut text = "# of tests\nmtllib none.mtl\no body\n".to_owned();
    surface.vertices.iter().for_each(|x| writeln!(text, "v {} {} {}", x.x, x.y, x.z).unwrap());
    text.push_str("vn 0 0 1\ng side\ns off\n");
    let n = surface.vertices.len() as i64;
    for (i, [a, b, c]) in surface.triangles.iter().enumerate() {
        // Every way to name a vertex.
        let [a, b, c] = [a, b, c].map(|v| i64::from(*v) + 1);
        match i % 4 {
            0 => writeln!(text, "f {a} {b} {c}").unwrap(),
            1 => writeln!(text, "f {a}//1 {b}//1 {c}//1 # said").unwrap(),
            2 => writeln!(text, "f {}/1/1 \\\n {}/2/1 {}/3/1", a - n - 1, b - n - 1, c - n - 1).unwrap(),
            _ => writeln!(text, "f {a}/1 {b}/1 {c}/1\r").unwrap(),
        }
    }
    text.into_bytes()
}

fn ply(surface: &TriangleSurface, big: Option<bool>) -> Vec<u8> {
    let format = match big {
        None => "ascii",
        Some(false) => "binary_little_endian",
        Some(true) => "binary_big_endian",
    };
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment of tests\nelement vertex {}\nproperty double z\nproperty uchar red\n\
         property double x\nproperty double y\nelement face {}\nproperty list uchar int vertex_indices\n\
         property list uchar float texcoord\nend_header\n",
        surface.vertices.len(),
        surface.triangles.len()
    )
    .into_bytes();
    let put = |bytes: &mut Vec<u8>, number: &[u8]| match big {
        Some(true) => bytes.extend(number.iter().rev()),
        _ => bytes.extend(number),
    };
    if big.is_none() {
        let mut text = String::new();
        surface.vertices.iter().for_each(|x| writeln!(text, "{} 200 {} {}", x.z, x.x, x.y).unwrap());
        surface.triangles.iter().for_each(|[a, b, c]| writeln!(text, "3 {a} {b} {c} 2 0.5 0.25").unwrap());
        bytes.extend(text.bytes());
        return bytes;
    }
    for x in &surface.vertices {
        put(&mut bytes, &x.z.to_le_bytes());
        bytes.push(200);
        put(&mut bytes, &x.x.to_le_bytes());
        put(&mut bytes, &x.y.to_le_bytes());
    }
    for t in &surface.triangles {
        bytes.push(3);
        t.iter().for_each(|v| put(&mut bytes, &(*v as i32).to_le_bytes()));
        bytes.push(1);
        put(&mut bytes, &0.5_f32.to_le_bytes());
    }
    bytes
}
