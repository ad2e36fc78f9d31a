//! Improvement: nodes move, each within what it is fitted to, and edges are replaced, so that the worst dihedral
//! angles get better and none gets worse than what is around it.

use super::cutting::Fitted;
use super::quality::worst_sine;
use super::reconnection::reconnect;
use crate::geometry::Point;

/// Tetrahedra whose worst sine is above this are left as they are (sin 30°).
const GOOD: f64 = 0.5;
/// Tetrahedra worse than this are smoothed between cuts (sin 15°).
const POOR: f64 = 0.26;
/// Rounds of smoothing and reconnection.
const ROUNDS: usize = 5;
/// Tetrahedra worse than this have their neighbours smoothed as well, for some more rounds (sin 24°).
const WEAK: f64 = 0.4;
const LAST_ROUNDS: usize = 10;
/// Tetrahedra worse than this are reconnected (sin 20°).
const RECONNECTED: f64 = 0.34;
/// Steps of a search begin at this part of the distance to the neighbours, and end after so many halvings.
const FIRST_STEP: f64 = 0.25;
const HALVINGS: usize = 5;
/// A tetrahedron is divided by a point that is to be a node only if its parts are better than this (sin 1°).
const FLATTEST: f64 = 0.02;
/// A position must be better by this much in the sine.
const GAIN: f64 = 1e-4;

/// Smooths and reconnects until little changes. `fixed` nodes (increasing) stay where they are.
pub(super) fn improve(fitted: &mut Fitted<'_>, fixed: &[u32]) {
    // Everywhere first, then round the worst, whose neighbours may have to make room.
    for (good, rounds, around) in [(GOOD, ROUNDS, false), (WEAK, LAST_ROUNDS, true)] {
        for _ in 0..rounds {
            let mut nodes = poor_nodes(fitted, good);
            if around {
                nodes = nodes.iter().flat_map(|n| fitted.complex.neighbours(*n).into_iter().chain([*n])).collect();
                nodes.sort_unstable();
                nodes.dedup();
            }
            nodes.retain(|n| fixed.binary_search(n).is_err());
            let moved = nodes.iter().filter(|n| smooth(fitted, **n)).count();
            if reconnect(fitted, good.min(RECONNECTED), fixed) + moved == 0 {
                break;
            }
        }
    }
}

/// Smooths where tetrahedra are poor.
pub(super) fn relax(fitted: &mut Fitted<'_>) {
    for n in poor_nodes(fitted, POOR) {
        smooth(fitted, n);
    }
}

/// Corners of tetrahedra whose worst sine is below `bad`, in increasing order.
fn poor_nodes(fitted: &Fitted<'_>, bad: f64) -> Vec<u32> {
    let poor = |t: &[u32; 4]| worst_sine(&fitted.complex.corners(*t)) < bad;
    let mut nodes: Vec<u32> = fitted.complex.iter().map(|(_, t)| t).filter(poor).flatten().collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// Moves a node to where the worst tetrahedron around it is better; whether it did.
fn smooth(fitted: &mut Fitted<'_>, node: u32) -> bool {
    let begin = fitted.complex.nodes[node as usize];
    let on = &fitted.on[node as usize];
    let tangents = fitted.features.tangents(&begin, on);
    if tangents.is_empty() {
        return false;
    }
    let star = Star::new(fitted, node);
    let mut best = (star.quality(&begin, f64::NEG_INFINITY), begin);
    if best.0 >= GOOD {
        return false;
    }
    let first = best.0;
    // Farther away nothing is the right way round: what is inside out only looks better there, the farther the better.
    let reach = star.reach(&begin);
    let attempt = |x: Point<3>, best: &mut (f64, Point<3>)| {
        let Some(x) = fitted.features.project(&x, on).filter(|x| (x - begin).norm() <= reach) else { return false };
        let quality = star.quality(&x, best.0 + GAIN);
        let better = quality > best.0 + GAIN;
        if better {
            *best = (quality, x);
        }
        better
    };
    attempt(star.middle(), &mut best);
    let mut step = FIRST_STEP * star.radius(&begin);
    for _ in 0..HALVINGS {
        // On a sheet the tangents turn as the node moves; the projection sees to that.
        for t in &tangents {
            for sign in [1.0, -1.0] {
                while attempt(best.1 + t * (sign * step), &mut best) {}
            }
        }
        step *= 0.5;
    }
    let moved = best.0 > first;
    if moved {
        fitted.complex.nodes[node as usize] = best.1;
    }
    moved
}

/// The tetrahedra around a node that moves.
struct Star {
    /// Corners and which of them is the node.
    tetrahedra: Vec<([Point<3>; 4], usize)>,
}

impl Star {
    fn new(fitted: &Fitted<'_>, node: u32) -> Self {
        let corners = |t: &u32| {
            let nodes = fitted.complex.tetrahedron(*t);
            (fitted.complex.corners(nodes), nodes.iter().position(|n| *n == node).unwrap_or_default())
        };
        Self { tetrahedra: fitted.complex.star(node).iter().map(corners).collect() }
    }

    /// Worst sine with the node at `x`; something below `enough` as soon as it is not reached.
    fn quality(&self, x: &Point<3>, enough: f64) -> f64 {
        let mut worst = f64::INFINITY;
        for (corners, at) in &self.tetrahedra {
            let mut corners = *corners;
            corners[*at] = *x;
            worst = worst.min(worst_sine(&corners));
            if worst < enough {
                break;
            }
        }
        worst
    }

    fn others(&self) -> impl Iterator<Item = Point<3>> {
        self.tetrahedra.iter().flat_map(|(corners, at)| (0..4).filter(move |i| i != at).map(move |i| corners[i]))
    }

    /// Mean of the corners opposite to the node.
    fn middle(&self) -> Point<3> {
        self.others().sum::<Point<3>>() / (3 * self.tetrahedra.len()) as f64
    }

    /// Distance of the farthest of these corners.
    fn reach(&self, x: &Point<3>) -> f64 {
        self.others().map(|y| (y - x).norm()).fold(0.0, f64::max)
    }

    /// Mean distance of these corners.
    fn radius(&self, x: &Point<3>) -> f64 {
        self.others().map(|y| (y - x).norm()).sum::<f64>() / (3 * self.tetrahedra.len()) as f64
    }
}

/// Puts nodes on points that lie in the body: of the corners of the tetrahedron around a point the one that suffers
/// least, or a new one; none where either would spoil the mesh. Returns these nodes in increasing order.
pub(super) fn pin(fitted: &mut Fitted<'_>, points: &[Point<3>]) -> Vec<u32> {
    let mut fixed: Vec<u32> = Vec::new();
    for x in points {
        let Some((t, nodes)) = around(fitted, x) else { continue };
        let tolerance = fitted.features.tolerance;
        let mut best: Option<(f64, u32)> = None;
        for n in nodes.into_iter().filter(|n| !fixed.contains(n)) {
            let stays = fitted.on[n as usize].iter().all(|k| fitted.features.level(*k, x) == 0.0);
            let old = std::mem::replace(&mut fitted.complex.nodes[n as usize], *x);
            let quality = fitted.complex.star_quality(n);
            fitted.complex.nodes[n as usize] = old;
            let close = (old - x).norm() <= tolerance;
            if (stays && quality > 0.1 || close) && best.is_none_or(|(q, _)| quality > q) {
                best = Some((quality, n));
            }
        }
        // A point all but on a face or on the surface would leave a tetrahedron without volume: it is no node then.
        let corners = fitted.complex.corners(nodes);
        let part = |end: usize| worst_sine(&std::array::from_fn(|i| if i == end { *x } else { corners[i] }));
        if best.is_none() && (0..4).any(|end| part(end) < FLATTEST) {
            continue;
        }
        let node = best.map(|(_, n)| n).unwrap_or_else(|| {
            let m = fitted.complex.add_node(*x);
            fitted.on.push(Vec::new());
            let part = fitted.complex.part(t);
            fitted.complex.remove(t);
            for end in nodes {
                fitted.complex.insert(nodes.map(|n| if n == end { m } else { n }), part);
            }
            m
        });
        fitted.complex.nodes[node as usize] = *x;
        fixed.push(node);
    }
    fixed.sort_unstable();
    fixed
}

/// The tetrahedron that holds a point, to rounding; of several the one that it is deepest in.
fn around(fitted: &Fitted<'_>, x: &Point<3>) -> Option<(u32, [u32; 4])> {
    let depth = |nodes: [u32; 4]| {
        let corners = fitted.complex.corners(nodes);
        let whole = super::quality::volume6(&corners);
        let part = |i: usize| {
            let mut with = corners;
            with[i] = *x;
            super::quality::volume6(&with) / whole
        };
        (0..4).map(part).fold(f64::INFINITY, f64::min)
    };
    let all = fitted.complex.iter().map(|(t, nodes)| (depth(nodes), t, nodes));
    all.filter(|(d, ..)| *d > -1e-9).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, t, nodes)| (t, nodes))
}
