//! Which side of a closed surface is outside: neighbours agree first, then every part by what encloses it.

use super::error::SurfaceError;
use super::{TriangleSurface, gaps::gaps};
use crate::geometry::point::{Point, box_of};

/// Triangles at an edge: which, and whether the edge runs from its lower vertex to its higher there.
type Sides = [(u32, bool); 2];

/// Parts of a surface, and what was turned.
pub(super) struct Parts {
    /// Which part each triangle belongs to.
    pub(super) part_of: Vec<u32>,
    /// Number of parts.
    pub(super) count: usize,
    /// Triangle across the edge from corner k to corner k + 1, for every triangle.
    pub(super) across: Vec<[u32; 3]>,
    /// How many triangles were turned to agree with their neighbours.
    pub(super) turned: usize,
    /// The first of them: middle of its corners.
    pub(super) first_turned: Option<Point<3>>,
}

/// Triangles at every edge: exactly two.
fn pairs(surface: &TriangleSurface) -> Result<Vec<([u32; 2], Sides)>, SurfaceError> {
    let mut edges: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * surface.triangles.len());
    for (t, triangle) in surface.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], t as u32, a < b));
        }
    }
    edges.sort_unstable();
    let (mut pairs, mut open) = (Vec::with_capacity(edges.len() / 2), Vec::new());
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [only] => open.push(only.0),
            [one, other] => pairs.push((one.0, [(one.1, one.2), (other.1, other.2)])),
            more => {
                let edge = more[0].0.map(|v| surface.vertices[v as usize]);
                return Err(SurfaceError::Branching { edge, triangles: more.len() });
            }
        }
    }
    if open.is_empty() { Ok(pairs) } else { Err(SurfaceError::Open { gaps: gaps(&surface.vertices, &open) }) }
}

/// Turns triangles until neighbours agree; the fewer of each part are turned.
pub(super) fn agree(surface: &mut TriangleSurface) -> Result<Parts, SurfaceError> {
    let pairs = pairs(surface)?;
    let n = surface.triangles.len();
    let mut across = vec![[u32::MAX; 3]; n];
    let mut differs = vec![[false; 3]; n];
    for (edge, [(one, forward), (other, also)]) in &pairs {
        for (t, to) in [(*one, *other), (*other, *one)] {
            let k = edge_of(&surface.triangles[t as usize], *edge);
            across[t as usize][k] = to;
            differs[t as usize][k] = forward == also;
        }
    }
    let (mut part_of, mut turn) = (vec![u32::MAX; n], vec![false; n]);
    let mut parts = Parts { part_of: Vec::new(), count: 0, across, turned: 0, first_turned: None };
    for start in 0..n {
        if part_of[start] != u32::MAX {
            continue;
        }
        part_of[start] = parts.count as u32;
        let mut members = vec![start];
        let mut next = 0;
        while let Some(&t) = members.get(next) {
            next += 1;
            for (k, differs) in differs[t].into_iter().enumerate() {
                let to = parts.across[t][k] as usize;
                let turned = turn[t] != differs;
                if part_of[to] == u32::MAX {
                    (part_of[to], turn[to]) = (parts.count as u32, turned);
                    members.push(to);
                } else if turn[to] != turned {
                    let (a, b) = (surface.corners(t)[k], surface.corners(t)[(k + 1) % 3]);
                    return Err(SurfaceError::OneSided { at: (a + b) * 0.5 });
                }
            }
        }
        // Which of two ways to turn is right is for the majority: one flipped face is one flipped face.
        if 2 * members.iter().filter(|t| turn[**t]).count() > members.len() {
            members.iter().for_each(|t| turn[*t] = !turn[*t]);
        }
        parts.count += 1;
    }
    for t in (0..n).filter(|t| turn[*t]) {
        let [a, b, c] = surface.corners(t);
        parts.first_turned = parts.first_turned.or(Some((a + b + c) / 3.0));
        parts.turned += 1;
        flip(&mut surface.triangles[t], &mut parts.across[t]);
    }
    parts.part_of = part_of;
    Ok(parts)
}

fn edge_of(triangle: &[u32; 3], edge: [u32; 2]) -> usize {
    let is = |k: &usize| edge.contains(&triangle[*k]) && edge.contains(&triangle[(*k + 1) % 3]);
    (0..3).find(is).unwrap_or(0)
}

fn flip(triangle: &mut [u32; 3], across: &mut [u32; 3]) {
    // Corners a, b, c with edges ab, bc, ca become a, c, b with edges ac, cb, ba.
    triangle.swap(1, 2);
    across.swap(0, 2);
}

/// Turns whole parts so that outermost ones face outwards, cavities in them inwards, and so on. Says which were turned:
/// a vertex of each. Volumes of the parts, negative for cavities.
pub(super) fn face_outwards(
    surface: &mut TriangleSurface,
    parts: &mut Parts,
) -> Result<(Vec<Point<3>>, Vec<f64>), SurfaceError> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); parts.count];
    for (t, part) in parts.part_of.iter().enumerate() {
        members[*part as usize].push(t);
    }
    let corner = |surface: &TriangleSurface, part: usize| surface.corners(members[part][0])[0];
    let bounds: Vec<_> =
        members.iter().map(|m| box_of(m.iter().flat_map(|t| surface.corners(*t)).collect::<Vec<_>>().iter())).collect();
    let mut volumes: Vec<f64> = members.iter().map(|m| volume(surface, m)).collect();
    // Every part that encloses another, and of those the outermost.
    let encloses = |outer: usize, inner: usize| {
        let x = corner(surface, inner);
        let near = bounds[outer].is_some_and(|(low, high)| x >= low && x <= high);
        outer != inner && near && winding(surface, &members[outer], &x).abs() > 0.5
    };
    let around: Vec<Vec<usize>> =
        (0..parts.count).map(|inner| (0..parts.count).filter(|outer| encloses(*outer, inner)).collect()).collect();
    let outermost = |part: usize| around[part].iter().copied().find(|p| around[*p].is_empty()).unwrap_or(part);
    let inwards: Vec<bool> = (0..parts.count).map(|part| volumes[outermost(part)] < 0.0).collect();
    let mut turned = Vec::new();
    for part in (0..parts.count).filter(|part| inwards[*part]) {
        turned.push(corner(surface, part));
        volumes[part] = -volumes[part];
        for t in &members[part] {
            flip(&mut surface.triangles[*t], &mut parts.across[*t]);
        }
    }
    for part in 0..parts.count {
        let is_cavity = around[part].len() % 2 == 1;
        if is_cavity != (volumes[part] < 0.0) {
            return Err(SurfaceError::Nested { at: corner(surface, part) });
        }
    }
    Ok((turned, volumes))
}

/// Enclosed volume, negative where the triangles face inwards (divergence theorem).
fn volume(surface: &TriangleSurface, members: &[usize]) -> f64 {
    // Relative to a corner: far from the origin the digits are kept.
    let origin = surface.corners(members[0])[0];
    let part = |t: &usize| {
        let [a, b, c] = surface.corners(*t).map(|x| x - origin);
        a.dot(&b.cross(&c)) / 6.0
    };
    members.iter().map(part).sum()
}

/// How often triangles wind around a point: the sum of their solid angles (van Oosterom & Strackee 1983).
fn winding(surface: &TriangleSurface, members: &[usize], x: &Point<3>) -> f64 {
    let angle = |t: &usize| {
        let [a, b, c] = surface.corners(*t).map(|corner| corner - x);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        2.0 * a.dot(&b.cross(&c)).atan2(below)
    };
    members.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
