//! How good a tetrahedron is.

use crate::geometry::Point;

/// Pairs of corners of a tetrahedron: its edges.
pub(in crate::discretization) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Faces of a tetrahedron of positive volume, outward by the right-hand rule; face i is opposite to corner i.
pub(crate) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Six times the signed volume, length units cubed.
pub(super) fn volume6([a, b, c, d]: &[Point<3>; 4]) -> f64 {
    (b - a).cross(&(c - a)).dot(&(d - a))
}

/// Sine of the worst dihedral angle: small where one is near 0° or near 180°; negative for an inverted tetrahedron.
///
/// With volume V, an edge of length l between faces of areas A and B: sin θ = 3 V l / (2 A B).
pub(super) fn worst_sine(x: &[Point<3>; 4]) -> f64 {
    let v6 = volume6(x);
    let (a, b, c) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    // Squares of twice the areas of the faces opposite to each corner.
    let n = [
        (b - a).cross(&(c - a)).norm_squared(),
        b.cross(&c).norm_squared(),
        a.cross(&c).norm_squared(),
        a.cross(&b).norm_squared(),
    ];
    let squared = EDGES
        .iter()
        .map(|&[i, j]| {
            // The faces that share edge ij are opposite to the other two corners.
            let across: f64 = (0..4).filter(|k| *k != i && *k != j).map(|k| n[k]).product();
            (x[j] - x[i]).norm_squared() / across
        })
        .fold(f64::INFINITY, f64::min);
    if squared.is_finite() { v6 * squared.sqrt() } else { f64::NEG_INFINITY }
}

/// The six dihedral angles, radians, in the order of [`EDGES`].
pub(super) fn dihedral_angles(x: &[Point<3>; 4]) -> [f64; 6] {
    let normal = |f: [usize; 3]| (x[f[1]] - x[f[0]]).cross(&(x[f[2]] - x[f[0]])).normalize();
    let normals = FACES.map(normal);
    EDGES.map(|[i, j]| {
        let mut across = (0..4).filter(|k| *k != i && *k != j);
        let (k, l) = (across.next().unwrap_or(0), across.next().unwrap_or(0));
        std::f64::consts::PI - normals[k].angle(&normals[l])
    })
}
