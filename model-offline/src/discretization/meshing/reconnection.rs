//! Reconnection: an edge is taken out and the hole around it filled with the best tetrahedra there are without it; or
//! a face is taken out in favour of an edge across it. On the surface, that flips edges or peels flat tetrahedra off.

use super::collapse::collapse;
use super::complex::Ring;
use super::cutting::Fitted;
use super::quality::{EDGES, FACES, worst_sine};
use crate::geometry::Point;

/// Rings with more nodes are left: they hardly ever get better.
const LONGEST_RING: usize = 8;
/// New tetrahedra must be better by this much in the sine.
const GAIN: f64 = 1e-3;
/// A tetrahedron with two faces on the surface is peeled off if its worst sine is below this.
const PEELED: f64 = 0.2;
/// Cosine of the angle that triangles of the surface may lean from it, or no more than they did.
const LEAN: f64 = 0.9;

/// Tries to replace every tetrahedron with a worst sine below `bad`, the worst first, and as a last resort merges one
/// of its nodes, none of the `fixed` ones (increasing), into another; returns how many changes were made.
pub(super) fn reconnect(fitted: &mut Fitted<'_>, bad: f64, fixed: &[u32]) -> usize {
    let mut queue: Vec<(f64, u32)> = fitted
        .complex
        .iter()
        .map(|(t, nodes)| (worst_sine(&fitted.complex.corners(nodes)), t))
        .filter(|(q, _)| *q < bad)
        .collect();
    queue.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut changes = 0;
    for (quality, t) in queue {
        // Numbers are used again: what is there now may be another one.
        if fitted.complex.is_gone(t) || worst_sine(&fitted.complex.corners(fitted.complex.tetrahedron(t))) != quality {
            continue;
        }
        let nodes = fitted.complex.tetrahedron(t);
        let done = EDGES.iter().any(|[i, j]| replace_edge(fitted, nodes[*i], nodes[*j]))
            || (0..4).any(|f| replace_face(fitted, t, f))
            || EDGES
                .iter()
                .flat_map(|[i, j]| [[*i, *j], [*j, *i]])
                .any(|[i, j]| fixed.binary_search(&nodes[i]).is_err() && collapse(fitted, nodes[i], nodes[j]));
        changes += usize::from(done);
    }
    changes
}

/// Takes an edge out if that makes the worst tetrahedron around it better.
fn replace_edge(fitted: &mut Fitted<'_>, a: u32, b: u32) -> bool {
    let star = fitted.complex.edge_star(a, b);
    if star.len() > LONGEST_RING {
        return false;
    }
    let part = fitted.complex.part(star[0]);
    if star.iter().any(|t| fitted.complex.part(*t) != part) {
        return false;
    }
    let Some(ring) = fitted.complex.ring(a, b, &star) else { return false };
    if !ring.closed && !may_flip(fitted, a, b, &ring) {
        return false;
    }
    let quality = |t: &u32| worst_sine(&fitted.complex.corners(fitted.complex.tetrahedron(*t)));
    let before = star.iter().map(quality).fold(f64::INFINITY, f64::min);
    let Some((after, triangles)) = fill(fitted, a, b, &ring.nodes) else { return false };
    if after <= before + GAIN || (star.len() == 1 && before > PEELED) {
        return false;
    }
    star.into_iter().for_each(|t| fitted.complex.remove(t));
    for [i, j, k] in triangles {
        fitted.complex.insert([i, j, k, b], part);
        fitted.complex.insert([i, k, j, a], part);
    }
    true
}

/// The triangles of the ring that make the best tetrahedra with both ends of the edge, and the worst sine of these.
fn fill(fitted: &Fitted<'_>, a: u32, b: u32, ring: &[u32]) -> Option<(f64, Vec<[u32; 3]>)> {
    let n = ring.len();
    if n < 2 {
        return None;
    }
    let corners = |t: [u32; 4]| fitted.complex.corners(t);
    let quality = |[i, j, k]: [u32; 3]| worst_sine(&corners([i, j, k, b])).min(worst_sine(&corners([i, k, j, a])));
    // best[i][j]: of the polygon from i to j, with the node that its edge ij makes a triangle with.
    let mut best = vec![vec![(f64::INFINITY, 0); n]; n];
    for span in 2..n {
        for i in 0..n - span {
            let j = i + span;
            let through = |k: usize| {
                let rest = best[i][k].0.min(best[k][j].0);
                (rest.min(quality([ring[i], ring[k], ring[j]])), k)
            };
            let all: Vec<(f64, usize)> = (i + 1..j).map(through).collect();
            best[i][j] = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        }
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i >= 2 {
            let k = best[i][j].1;
            triangles.push([ring[i], ring[k], ring[j]]);
            open.extend([(i, k), (k, j)]);
        }
    }
    Some((best[0][n - 1].0, triangles))
}

/// Whether the surface may have the edge between the ends of the ring instead of the edge from `a` to `b`: not across
/// a sharp edge or a rim, not out of the surface, and not where that edge is there already.
fn may_flip(fitted: &Fitted<'_>, a: u32, b: u32, ring: &Ring) -> bool {
    let (c, d) = (ring.nodes[0], ring.nodes[ring.nodes.len() - 1]);
    let on = |n: u32, k: &u16| fitted.on[n as usize].contains(k);
    let common = |k: &&u16| fitted.features.is_of_body(**k) && [b, c, d].iter().all(|n| on(*n, k));
    let Some(sheet) = fitted.on[a as usize].iter().find(common).copied() else { return false };
    let joined = fitted.complex.edge_star(c, d);
    let taken = if ring.nodes.len() == 2 {
        fitted.complex.ring(c, d, &joined).is_none_or(|r| !r.closed)
    } else {
        !joined.is_empty()
    };
    if taken {
        return false;
    }
    // One sheet for all four nodes is not enough: two of them may lie on a sharp edge that ends the sheet.
    let star = fitted.complex.edge_star(a, b);
    let rims = fitted.shared(a, b, &star);
    if rims.iter().any(|k| *k != sheet) {
        return false;
    }
    let at = |n: u32| fitted.complex.nodes[n as usize];
    let face = |t: [u32; 3]| {
        let normal = (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0])));
        let middle: Point<3> = t.iter().map(|n| at(*n)).sum::<Point<3>>() / 3.0;
        let gradient = fitted.features.sheets[usize::from(sheet)].gradient(&middle);
        (normal.normalize(), gradient.normalize())
    };
    // The new triangles take the place of the old ones, turned the same way as these.
    let old = [[a, b, c], [b, a, d]].map(face);
    let new = [[c, d, b], [d, c, a]].map(face);
    let sign = old[0].0.dot(&old[0].1).signum();
    let leans =
        |faces: &[(Point<3>, Point<3>); 2]| faces.iter().map(|(n, g)| sign * n.dot(g)).fold(f64::INFINITY, f64::min);
    leans(&new) >= LEAN.min(leans(&old)) && same_sides(fitted, [[a, b, c], [b, a, d]], [[c, d, b], [d, c, a]])
}

/// Whether all of these triangles lie on one side of every patch.
fn same_sides(fitted: &Fitted<'_>, old: [[u32; 3]; 2], new: [[u32; 3]; 2]) -> bool {
    let patches = fitted.features.owners.iter().filter(|o| o.kind == super::features::Kind::Patch);
    patches.into_iter().all(|o| {
        let at = |n: u32| fitted.complex.nodes[n as usize];
        let inside = |t: &[u32; 3]| o.level(&(t.iter().map(|n| at(*n)).sum::<Point<3>>() / 3.0)) < 0.0;
        let first = inside(&old[0]);
        [old[1], new[0], new[1]].iter().all(|t| inside(t) == first)
    })
}

/// Takes a face out in favour of the edge across it, if that makes the worse of its two tetrahedra better.
fn replace_face(fitted: &mut Fitted<'_>, t: u32, face: usize) -> bool {
    let nodes = fitted.complex.tetrahedron(t);
    let [i, j, k] = FACES[face].map(|c| nodes[c]);
    let apex = nodes[face];
    let holds = |u: &u32| *u != t && [j, k].iter().all(|n| fitted.complex.tetrahedron(*u).contains(n));
    let Some(u) = fitted.complex.star(i).iter().copied().find(holds) else { return false };
    let part = fitted.complex.part(t);
    if fitted.complex.part(u) != part {
        return false;
    }
    let Some(other) = fitted.complex.tetrahedron(u).into_iter().find(|n| ![i, j, k].contains(n)) else { return false };
    let quality = |t: [u32; 4]| worst_sine(&fitted.complex.corners(t));
    let before = quality(nodes).min(quality(fitted.complex.tetrahedron(u)));
    // The face runs i → j → k as seen from the other apex.
    let new = [[apex, i, j, other], [apex, j, k, other], [apex, k, i, other]];
    if new.iter().map(|t| quality(*t)).fold(f64::INFINITY, f64::min) <= before + GAIN {
        return false;
    }
    // Across a sharp edge of the surface two nodes may be joined already.
    if fitted.complex.has_edge(apex, other) {
        return false;
    }
    fitted.complex.remove(t);
    fitted.complex.remove(u);
    for t in new {
        fitted.complex.insert(t, part);
    }
    true
}
