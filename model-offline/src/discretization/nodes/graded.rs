//! Graded nodes: fitted to the outline and to every feature, and gathered where the solution is singular.
//!
//! Where boundary conditions change type (ends of paddles, of the needle contact and of the immobile part) the strain
//! grows like r^(−1/2) or so, around the target the strain that a force there would cause grows like 1/r; on uniform
//! nodes the error falls only linearly. A spacing that grows in proportion to the distance from such points spends the
//! same number of nodes on every octave of r.

use super::features::Features;
use super::sizing::Sizing;
use crate::geometry::{Location, Point2, Polygon, cross, distance_to_segment};
use rstar::RTree;

/// The coarsest refinement level there is.
pub const MIN_LEVEL: i32 = -2;
/// The finest refinement level there is; nodes grow about 1.7-fold per level.
pub const MAX_LEVEL: i32 = 9;

/// How nodes are graded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grading {
    /// Largest spacing, length units.
    pub coarsest: f64,
    /// Spacing at singular points, length units.
    pub finest: f64,
    /// Growth of the spacing with distance from a singular point.
    pub slope: f64,
    /// Spacing along the edges of inclusions and along a shaft, length units.
    pub interface: f64,
    /// Largest spacing where the body, or a slot in it, is narrow: over the width there.
    pub narrow: f64,
    /// Where nodes lie with respect to those edges.
    pub fit: InterfaceFit,
}

/// How nodes meet the edge of an inclusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InterfaceFit {
    /// In mirrored pairs on either side, so that edges of nodal cells follow it and no cell mixes two stiffnesses.
    Between,
    /// On it, so that edges of triangles follow it.
    On,
}

/// Interior nodes keep this many local spacings from nodes on the boundary and from feature points.
const CLEARANCE: f64 = 0.55;
/// Features closer than this (relative to the body) are one point.
const COINCIDENT: f64 = 1e-9;

impl Grading {
    /// Grading of a refinement level: the finest spacing and the interface spacing halve from level to level, the coarsest
    /// falls by √2 and the slope by 2^¼, so that all sources of error shrink together.
    pub fn level(features: &Features, level: i32, fit: InterfaceFit) -> Self {
        let halved = 0.5_f64.powi(level);
        let paddle = features.paddles.iter().map(|p| (p[1] - p[0]).norm()).fold(f64::INFINITY, f64::min);
        let contact: f64 = features.contact.windows(2).map(|s| (s[1] - s[0]).norm()).sum();
        let edge = features
            .inclusions
            .iter()
            .flat_map(Polygon::edges)
            .map(|(a, b)| (b - a).norm())
            .chain(features.shaft.map(|[entry, tip]| 0.5 * (tip - entry).norm()))
            .fold(f64::INFINITY, f64::min);
        let coarsest = 0.2 * features.outline.area().sqrt() * halved.sqrt();
        Self {
            coarsest,
            finest: (0.2 * paddle.min(contact) * halved).min(coarsest),
            slope: 0.6 * halved.powf(0.25),
            interface: (0.2 * edge * halved).min(coarsest),
            narrow: 0.5 * halved.sqrt(),
            fit,
        }
    }
}

/// What the spacing depends on: singular points with a factor on the finest spacing, edges of inclusions, and what is wanted
/// besides.
struct Field<'a> {
    grading: &'a Grading,
    singular: Vec<(Point2, f64)>,
    wanted: Option<&'a Sizing>,
    interfaces: Vec<(Point2, Point2)>,
    narrows: Vec<[(Point2, Point2); 2]>,
}

impl Field<'_> {
    /// Spacing wanted at `x`.
    fn spacing(&self, x: Point2) -> f64 {
        let Grading { coarsest, finest, slope, interface, narrow, .. } = *self.grading;
        let points = self.singular.iter().map(|(s, weight)| finest * weight + slope * (x - s).norm());
        let edges = self.interfaces.iter().map(|(a, b)| interface + slope * distance_to_segment(x, *a, *b));
        // The distances from two sides add up to the width between them, and grow away from there.
        let to = |(a, b): (Point2, Point2)| distance_to_segment(x, a, b);
        let narrows = self.narrows.iter().map(|[a, b]| narrow * (to(*a) + to(*b)));
        let wanted = self.wanted.map(|sizing| sizing.at(x));
        points.chain(edges).chain(narrows).chain(wanted).fold(coarsest, f64::min)
    }
}

/// Pairs of edges of the outline that face each other, across the body or across a slot, nearer than spacings of `coarsest`
/// can resolve.
fn narrows(outline: &Polygon, coarsest: f64, narrow: f64) -> Vec<[(Point2, Point2); 2]> {
    let edges: Vec<(Point2, Point2)> = outline.edges().collect();
    let direction = |e: (Point2, Point2)| (e.1 - e.0).normalize();
    let facing = |e, f| direction(e).dot(&direction(f)) < -0.5;
    let apart = |e: (Point2, Point2), f: (Point2, Point2)| {
        let to = |p, (a, b)| distance_to_segment(p, a, b);
        to(e.0, f).min(to(e.1, f)).min(to(f.0, e)).min(to(f.1, e))
    };
    let pairs = (0..edges.len()).flat_map(|i| (i + 1..edges.len()).map(move |j| (i, j)));
    pairs
        .map(|(i, j)| [edges[i], edges[j]])
        .filter(|[e, f]| facing(*e, *f) && apart(*e, *f) > 0.0 && narrow * apart(*e, *f) < coarsest)
        .collect()
}

/// Points where the solution, or its adjoint, is singular, each with a factor on the finest spacing: 1 where the type of
/// boundary condition changes, more where the singularity is weaker.
fn singular_points(features: &Features) -> Vec<(Point2, f64)> {
    let mut points: Vec<(Point2, f64)> = features.paddles.iter().flatten().map(|p| (*p, 1.0)).collect();
    points.extend(features.contact.first().map(|p| (*p, 1.0)));
    points.extend(features.contact.last().map(|p| (*p, 1.0)));
    // What is asked for is the displacement of one point: its adjoint is the field of a point load there. Nodal
    // integration answers that load with its modes of little energy, which small cells around it hold back (SCNI at 1 %
    // on `paper-hull` with the inclusion: 3,188 nodes instead of 31,189).
    points.push((features.target, 2.0));
    // The tip of a shaft ends a line that tissue cannot leave.
    points.extend(features.shaft.map(|[_, tip]| (tip, 1.0)));
    for path in &features.immobile {
        points.extend(path.first().map(|p| (*p, 2.0)));
        points.extend(path.last().map(|p| (*p, 2.0)));
    }
    // Corners of the outline that turn inwards are singular too.
    let v = features.outline.vertices();
    for i in 0..v.len() {
        let (a, b, c) = (v[(i + v.len() - 1) % v.len()], v[i], v[(i + 1) % v.len()]);
        if cross(b - a, c - b) < -1e-9 * (b - a).norm() * (c - b).norm() {
            points.push((b, 2.0));
        }
    }
    points
}

/// Generates graded nodes.
pub fn graded_nodes(features: &Features, grading: &Grading) -> Vec<Point2> {
    nodes(features, grading, None)
}

/// The same with nodes no farther apart than is `wanted`.
pub fn sized_nodes(features: &Features, grading: &Grading, wanted: &Sizing) -> Vec<Point2> {
    nodes(features, grading, Some(wanted))
}

fn nodes(features: &Features, grading: &Grading, wanted: Option<&Sizing>) -> Vec<Point2> {
    let outline = &features.outline;
    let tolerance = COINCIDENT * outline.size();
    let interfaces: Vec<(Point2, Point2)> = features.inclusions.iter().flat_map(Polygon::edges).collect();
    let narrows = narrows(outline, grading.coarsest, grading.narrow);
    // Along a shaft forces act as they do along the edge of an inclusion.
    let shaft = features.shaft.map(|[entry, tip]| (entry, tip));
    let interfaces = interfaces.into_iter().chain(shaft).collect();
    let field = Field { grading, singular: singular_points(features), wanted, interfaces, narrows };

    // Features first, then nodes along outline and needle contact between them.
    let mut positions: Vec<Point2> = Vec::new();
    let mut fixed = features.points();
    fixed.extend(features.shaft.into_iter().flatten());
    if grading.fit == InterfaceFit::On {
        let corners = features.inclusions.iter().flat_map(Polygon::vertices).copied();
        fixed.extend(corners.filter(|v| outline.locate(*v, tolerance) != Location::Outside));
    }
    for p in fixed {
        if positions.iter().all(|x| (x - p).norm() > tolerance) {
            positions.push(p);
        }
    }
    let mut lines: Vec<(Point2, Point2)> = outline.edges().collect();
    // A contact on the boundary is part of an outline edge already.
    let contact = features.contact.windows(2).map(|s| (s[0], s[1]));
    lines.extend(contact.filter(|(a, b)| !outline.segment_on_boundary(*a, *b, tolerance)));
    lines.extend(features.shaft.map(|[entry, tip]| (entry, tip)));
    let fixed = positions.clone();
    for (a, b) in lines {
        for (p, q) in pieces(a, b, &fixed, tolerance) {
            positions.extend(graded_line(p, q, &|x| field.spacing(x)));
        }
    }
    // Then the edges of inclusions, which give way to all of these.
    let mut taken = Taken::new(&positions);
    for inclusion in &features.inclusions {
        for (x, size) in interface_nodes(inclusion.vertices(), &field, grading.fit) {
            let inside = outline.contains(x) && outline.distance_to_boundary(x) >= CLEARANCE * size;
            if inside && taken.is_free(x, CLEARANCE * size) {
                taken.insert(x);
                positions.push(x);
            }
        }
    }
    // Then the interior.
    let (low, high) = outline.bounds();
    let mut interior = Vec::new();
    subdivide(low, (high - low).max(), &|x| field.spacing(x), &mut interior);
    positions.extend(interior.into_iter().filter_map(|(x, size)| {
        let inside = outline.contains(x) && outline.distance_to_boundary(x) >= CLEARANCE * size;
        (inside && taken.is_free(x, CLEARANCE * size)).then_some(x)
    }));
    positions
}

/// The nodes that others must keep away from.
struct Taken(RTree<[f64; 2]>);

impl Taken {
    fn new(positions: &[Point2]) -> Self {
        Self(RTree::bulk_load(positions.iter().map(|x| [x.x, x.y]).collect()))
    }

    fn insert(&mut self, x: Point2) {
        self.0.insert([x.x, x.y]);
    }

    fn is_free(&self, x: Point2, clearance: f64) -> bool {
        let free = |n: &[f64; 2]| (Point2::from(*n) - x).norm() >= clearance;
        self.0.nearest_neighbor(&[x.x, x.y]).is_none_or(free)
    }
}

/// The segment from `a` to `b`, cut at the features on it.
fn pieces(a: Point2, b: Point2, features: &[Point2], tolerance: f64) -> Vec<(Point2, Point2)> {
    let direction = (b - a).normalize();
    let mut stations: Vec<f64> = features
        .iter()
        .filter(|x| distance_to_segment(**x, a, b) <= tolerance)
        .map(|x| (x - a).dot(&direction))
        .collect();
    stations.sort_by(f64::total_cmp);
    stations.windows(2).map(|s| (a + direction * s[0], a + direction * s[1])).collect()
}

/// Nodes along the edges of an inclusion (vertices counter-clockwise), with their local spacing.
fn interface_nodes(vertices: &[Point2], field: &Field<'_>, fit: InterfaceFit) -> Vec<(Point2, f64)> {
    let n = vertices.len();
    let mut nodes = Vec::new();
    for i in 0..n {
        let (a, b) = (vertices[i], vertices[(i + 1) % n]);
        let line = graded_line(a, b, &|x| field.spacing(x));
        match fit {
            InterfaceFit::On => nodes.extend(line.into_iter().map(|x| (x, field.spacing(x)))),
            InterfaceFit::Between => {
                // Pairs across the middle of every interval: their bisector is the edge.
                let outward = Point2::new(b.y - a.y, a.x - b.x).normalize();
                let stations: Vec<Point2> = std::iter::once(a).chain(line).chain(std::iter::once(b)).collect();
                for pair in stations.windows(2) {
                    let (middle, gap) = ((pair[0] + pair[1]) * 0.5, (pair[1] - pair[0]).norm());
                    nodes.push((middle + outward * (0.5 * gap), gap));
                    nodes.push((middle - outward * (0.5 * gap), gap));
                }
                // Round a convex corner outside, so that the four cells at the corner meet in it.
                let before = vertices[(i + n - 1) % n];
                let ahead = (b - a).normalize() - (a - before).normalize();
                if cross(a - before, b - a) > 0.0 {
                    let gap = (stations[1] - a).norm();
                    nodes.push((a - ahead * (0.5 * gap), gap));
                }
            }
        }
    }
    nodes
}

/// Nodes strictly between `p` and `q` such that equal numbers of local spacings lie between them.
fn graded_line(p: Point2, q: Point2, spacing: &impl Fn(Point2) -> f64) -> Vec<Point2> {
    let length = (q - p).norm();
    if length == 0.0 {
        return Vec::new();
    }
    // Cumulative ∫ ds/h, stepping by a fraction of the local spacing.
    let mut table = vec![(0.0, 0.0)];
    let (mut s, mut total) = (0.0, 0.0);
    while s < length {
        let here = spacing(p + (q - p) * (s / length));
        let step = (0.1 * here).min(length - s).max(1e-6 * length);
        let middle = spacing(p + (q - p) * ((s + 0.5 * step) / length).min(1.0));
        total += step / middle;
        s += step;
        table.push((total, s.min(length)));
    }
    let pieces = total.round().max(1.0) as usize;
    let mut at = 0;
    (1..pieces)
        .map(|k| {
            let wanted = total * k as f64 / pieces as f64;
            while table[at + 1].0 < wanted {
                at += 1;
            }
            let ((t0, s0), (t1, s1)) = (table[at], table[at + 1]);
            p + (q - p) * ((s0 + (s1 - s0) * (wanted - t0) / (t1 - t0)) / length)
        })
        .collect()
}

/// Splits a square until it is no larger than the spacing wanted at its centre; collects centres and sizes.
fn subdivide(low: Point2, side: f64, spacing: &impl Fn(Point2) -> f64, out: &mut Vec<(Point2, f64)>) {
    let centre = low + Point2::repeat(0.5 * side);
    if side <= spacing(centre) {
        out.push((centre, side));
        return;
    }
    let half = 0.5 * side;
    for (sx, sy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        subdivide(low + Point2::new(sx, sy) * half, half, spacing, out);
    }
}
