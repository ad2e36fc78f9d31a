//! Collapse: a node is merged into a neighbour, where it is what keeps the tetrahedra around it flat.

use super::cutting::Fitted;
use super::features::Kind;
use super::quality::{FACES, worst_sine};
use crate::geometry::Point;

/// What is left must be better by this much in the sine.
const GAIN: f64 = 1e-3;
/// Cosine of the angle by which a triangle of the surface may turn.
const TURN: f64 = 0.85;

/// Merges `node` into `target` if all that the node is fitted to stays where it is, and the worst tetrahedron around
/// it gets better; whether it did.
pub(super) fn collapse(fitted: &mut Fitted<'_>, node: u32, target: u32) -> bool {
    let on = &fitted.on[node as usize];
    if !on.iter().all(|k| fitted.on[target as usize].contains(k)) {
        return false;
    }
    let complex = &fitted.complex;
    let edge = complex.edge_star(node, target);
    let kept: Vec<u32> = complex.star(node).iter().copied().filter(|t| !edge.contains(t)).collect();
    let moved = |nodes: [u32; 4]| nodes.map(|n| if n == node { target } else { n });
    let quality = |nodes: [u32; 4]| worst_sine(&complex.corners(nodes));
    let enough = complex.star_quality(node) + GAIN;
    let fits = |t: &u32| {
        let nodes = moved(complex.tetrahedron(*t));
        quality(nodes) > enough && !crosses_interface(fitted, nodes, complex.part(*t))
    };
    if kept.is_empty() || !kept.iter().all(fits) || reach(fitted, target, node) > reach(fitted, node, node) {
        return false;
    }
    // Whatever else joins the two, apart from what is round their edge, would be pinched.
    let Some(ring) = complex.ring(node, target, &edge) else { return false };
    let beside = complex.neighbours(target);
    let common = complex.neighbours(node).into_iter().filter(|n| beside.binary_search(n).is_ok()).count();
    if common != ring.nodes.len() {
        return false;
    }
    if !on.is_empty() {
        // Along what it is fitted to, and not across.
        let shared = fitted.shared(node, target, &edge);
        let surface = fitted.is_on_surface(node);
        if !on.iter().all(|k| shared.contains(k)) || (surface && (ring.closed || turns(fitted, node, target))) {
            return false;
        }
    }
    let nodes: Vec<(u32, [u32; 4])> = kept.iter().map(|t| (*t, fitted.complex.tetrahedron(*t))).collect();
    edge.into_iter().for_each(|t| fitted.complex.remove(t));
    for (t, nodes) in nodes {
        let part = fitted.complex.part(t);
        fitted.complex.remove(t);
        fitted.complex.insert(moved(nodes), part);
    }
    true
}

/// The longest distance from a node to the neighbours of another.
fn reach(fitted: &Fitted<'_>, from: u32, centre: u32) -> f64 {
    let at = |n: u32| fitted.complex.nodes[n as usize];
    fitted.complex.neighbours(centre).iter().map(|n| (at(*n) - at(from)).norm()).fold(0.0, f64::max)
}

/// Whether a tetrahedron of a part would lie on both sides of an interface that matters to it.
fn crosses_interface(fitted: &Fitted<'_>, nodes: [u32; 4], part: u32) -> bool {
    let interfaces = fitted.features.owners.iter().filter(|o| o.kind == Kind::Interface);
    interfaces.skip((part as usize).saturating_sub(1)).any(|o| {
        let levels = fitted.complex.corners(nodes).map(|x| o.level(&x));
        let tolerance = fitted.features.tolerance;
        levels.iter().any(|l| *l < -tolerance) && levels.iter().any(|l| *l > tolerance)
    })
}

/// Whether a triangle of the surface would turn by too much.
fn turns(fitted: &Fitted<'_>, node: u32, target: u32) -> bool {
    let complex = &fitted.complex;
    let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
    for t in complex.star(node).iter().map(|t| complex.tetrahedron(*t)) {
        for face in FACES.map(|f| f.map(|c| t[c])).into_iter().filter(|f| f.contains(&node)) {
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face));
        }
    }
    faces.sort_unstable();
    let at = |n: u32| complex.nodes[n as usize];
    let normal = |[a, b, c]: [Point<3>; 3]| (b - a).cross(&(c - a)).normalize();
    let of_surface = faces.chunk_by(|a, b| a.0 == b.0).filter(|f| f.len() == 1).map(|f| f[0].1);
    of_surface.filter(|f| !f.contains(&target)).any(|f| {
        let before = normal(f.map(at));
        let after = normal(f.map(|n| at(if n == node { target } else { n })));
        before.dot(&after) < TURN
    })
}
