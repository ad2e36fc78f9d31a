//! Triangles without area: left out, without opening the surface.

use super::TriangleSurface;
use crate::geometry::point::shown;
use std::collections::HashMap;

/// A triangle with less than this part of its longest edge's square as area has none: rounding made it.
const FLAT: f64 = 1e-14;
/// So many cuts per triangle at most: neighbours that are flat themselves are cut again.
const CUTS: usize = 4;

/// Leaves out triangles without area. One whose three corners differ lies along an edge of its neighbour: there the
/// neighbour gets the middle corner, or the surface would open where it was closed.
pub(super) fn without_flat(surface: &mut TriangleSurface, notes: &mut Vec<String>) {
    let mut open: Vec<usize> = (0..surface.triangles.len()).filter(|t| flat(surface, *t).is_some()).collect();
    let Some(first) = open.first().map(|t| surface.corners(*t)[0]) else { return };
    let (dropped, most) = (open.len(), CUTS * surface.triangles.len());
    let mut gone = vec![false; surface.triangles.len()];
    let mut at: HashMap<[u32; 2], Vec<usize>> = HashMap::new();
    for (t, triangle) in surface.triangles.iter().enumerate() {
        list(&mut at, t, triangle);
    }
    let mut cut = 0;
    while let Some(t) = open.pop() {
        let Some(k) = flat(surface, t).filter(|_| !gone[t]) else { continue };
        gone[t] = true;
        let [a, b, c] = [0, 1, 2].map(|i| surface.triangles[t][(k + i) % 3]);
        if a == b || b == c || c == a || cut == most {
            continue;
        }
        // The neighbour at the longest edge, from b to c, on which a lies.
        let edge_in = |other: usize| {
            let corners = &surface.triangles[other];
            let is = |i: &usize| [[b, c], [c, b]].contains(&[corners[*i], corners[(i + 1) % 3]]);
            (0..3).find(is).filter(|_| !gone[other])
        };
        let around = at.get(&[b.min(c), b.max(c)]).into_iter().flatten();
        let Some((neighbour, i)) = around.copied().find_map(|other| Some((other, edge_in(other)?))) else { continue };
        let [p, q, r] = [0, 1, 2].map(|j| surface.triangles[neighbour][(i + j) % 3]);
        if r == a {
            // Two flat ones on each other: both go.
            gone[neighbour] = true;
            continue;
        }
        surface.triangles[neighbour] = [p, a, r];
        surface.triangles.push([a, q, r]);
        gone.push(false);
        cut += 1;
        for half in [neighbour, surface.triangles.len() - 1] {
            list(&mut at, half, &surface.triangles[half]);
            open.push(half);
        }
    }
    let mut index = 0..;
    surface.triangles.retain(|_| index.next().is_some_and(|t: usize| !gone[t]));
    let halves =
        if cut > 0 { format!(" ({cut} times a neighbour was cut in two at their corner)") } else { String::new() };
    notes.push(format!("{dropped} triangles without area were left out{halves}, the first at {}", shown(&first)));
}

fn list(at: &mut HashMap<[u32; 2], Vec<usize>>, t: usize, [a, b, c]: &[u32; 3]) {
    for (from, to) in [(a, b), (b, c), (c, a)] {
        at.entry([*from.min(to), *from.max(to)]).or_default().push(t);
    }
}

/// Of a triangle without area the corner across its longest edge.
fn flat(surface: &TriangleSurface, t: usize) -> Option<usize> {
    let x = surface.corners(t);
    let across = |k: usize| (x[(k + 2) % 3] - x[(k + 1) % 3]).norm();
    let k = (0..3).max_by(|a, b| across(*a).total_cmp(&across(*b)))?;
    let area = (x[1] - x[0]).cross(&(x[2] - x[0])).norm();
    (area <= FLAT * across(k) * across(k)).then_some(k)
}
