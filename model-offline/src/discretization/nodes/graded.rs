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
    /// Spacing along an inclusion over the shortest of its sides, from corner to corner; and along a shaft over half of its
    /// length.
    pub interface: f64,
    /// Largest spacing where the body, a slot in it, or an inclusion is narrow: over the width there.
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
/// Where a line turns by less, radians, it is a curve: with 210° inside strain grows like r^(−1/4) at most (sin λω = −λ sin ω has λ =
/// 0.75; Williams, J. Appl. Mech. 19, 1952), and over no more than the length of an edge.
const CORNER: f64 = std::f64::consts::PI / 6.0;
/// Features closer than this (relative to the body) are one point.
const COINCIDENT: f64 = 1e-9;

impl Grading {
    /// Grading of a refinement level: the finest spacing and the interface spacing halve from level to level, the coarsest
    /// falls by √2 and the slope by 2^¼, so that all sources of error shrink together.
    pub fn level(features: &Features, level: i32, fit: InterfaceFit) -> Self {
        let halved = 0.5_f64.powi(level);
        let paddle = features.paddles.iter().map(|p| (p[1] - p[0]).norm()).fold(f64::INFINITY, f64::min);
        let contact: f64 = features.contact.windows(2).map(|s| (s[1] - s[0]).norm()).sum();
        let coarsest = 0.2 * features.outline.area().sqrt() * halved.sqrt();
        Self {
            coarsest,
            finest: (0.2 * paddle.min(contact) * halved).min(coarsest),
            slope: 0.6 * halved.powf(0.25),
            interface: 0.2 * halved,
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
    /// Each with the spacing there.
    interfaces: Vec<(Point2, Point2, f64)>,
    narrows: Vec<[Edge; 2]>,
}

impl Field<'_> {
    /// Spacing wanted at `x`.
    fn spacing(&self, x: Point2) -> f64 {
        let Grading { coarsest, finest, slope, narrow, .. } = *self.grading;
        let points = self.singular.iter().map(|(s, weight)| finest * weight + slope * (x - s).norm());
        let edges = self.interfaces.iter().map(|(a, b, spacing)| spacing + slope * distance_to_segment(x, *a, *b));
        // The distances from two sides add up to the width between them, and grow away from there.
        let to = |(a, b): Edge| distance_to_segment(x, a, b);
        let narrows = self.narrows.iter().map(|[a, b]| narrow * (to(*a) + to(*b)));
        let wanted = self.wanted.map(|sizing| sizing.at(x));
        points.chain(edges).chain(narrows).chain(wanted).fold(coarsest, f64::min)
    }
}

type Edge = (Point2, Point2);

/// Whether two edges of a loop run against each other.
fn facing(e: Edge, f: Edge) -> bool {
    let direction = |e: Edge| (e.1 - e.0).normalize();
    direction(e).dot(&direction(f)) < -0.5
}

/// Whether the room between two edges asks for nodes nearer than `spacing`.
fn resolves_not(narrow: f64, e: Edge, f: Edge, spacing: f64) -> bool {
    let to = |p, (a, b)| distance_to_segment(p, a, b);
    let apart = to(e.0, f).min(to(e.1, f)).min(to(f.0, e)).min(to(f.1, e));
    apart > 0.0 && narrow * apart < spacing
}

/// Pairs of edges of the outline that face each other, across the body or across a slot, nearer than spacings of `coarsest`
/// can resolve.
fn narrows(outline: &Polygon, grading: &Grading) -> Vec<[Edge; 2]> {
    let edges: Vec<Edge> = outline.edges().collect();
    let pairs = (0..edges.len()).flat_map(|i| (i + 1..edges.len()).map(move |j| (i, j)));
    pairs
        .map(|(i, j)| [edges[i], edges[j]])
        .filter(|[e, f]| facing(*e, *f) && resolves_not(grading.narrow, *e, *f, grading.coarsest))
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
    // Corners of the outline that turn inwards are singular too; the vertices of a curve hardly are.
    let turns = features.outline.vertices().iter().zip(turns(features.outline.vertices()));
    points.extend(turns.filter(|(_, turn)| *turn < -CORNER).map(|(corner, _)| (*corner, 2.0)));
    points
}

/// By how much a loop turns at every vertex, radians: positive where it is convex and goes counter-clockwise.
fn turns(vertices: &[Point2]) -> impl Iterator<Item = f64> {
    let count = vertices.len();
    (0..count).map(move |i| {
        let [before, here, after] = [i + count - 1, i, i + 1].map(|k| vertices[k % count]);
        let (to, from) = (here - before, after - here);
        cross(to, from).atan2(to.dot(&from))
    })
}

/// A side of a region that an edge is part of: from one corner that turns by more than [`CORNER`] to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Side {
    /// Length, of a curve no more than a square with the region's perimeter would have: a curve of many edges is one side.
    length: f64,
    /// Width of a strip with the region's area and perimeter, if it is a curve.
    width: Option<f64>,
}

/// The sides of a region, edge by edge.
fn sides(region: &Polygon) -> Vec<Side> {
    let is_corner: Vec<bool> = turns(region.vertices()).map(|turn| turn.abs() > CORNER).collect();
    let lengths: Vec<f64> = region.edges().map(|(a, b)| (b - a).norm()).collect();
    let perimeter: f64 = lengths.iter().sum();
    let width = Some(2.0 * region.area() / perimeter);
    let count = lengths.len();
    let Some(first) = is_corner.iter().position(|corner| *corner) else {
        return vec![Side { length: 0.25 * perimeter, width }; count];
    };
    let mut sides = vec![Side { length: 0.0, width: None }; count];
    let mut from = 0;
    while from < count {
        let edges = (1..).take_while(|k| !is_corner[(first + from + k) % count]).count() + 1;
        let these: Vec<usize> = (from..from + edges).map(|k| (first + k) % count).collect();
        let length: f64 = these.iter().map(|&k| lengths[k]).sum();
        let side = match edges {
            1 => Side { length, width: None },
            _ => Side { length: length.min(0.25 * perimeter), width },
        };
        these.into_iter().for_each(|k| sides[k] = side);
        from += edges;
    }
    sides
}

/// A side that is longer than this many times the shortest of its region asks for spacings that follow its own length: nodes as
/// near as a thin layer's end asks for would be all that there are.
const LONG: f64 = 15.0;

/// The spacing along every edge of an inclusion, without what its width asks for where its sides are straight.
fn along_sides(region: &Polygon, grading: &Grading) -> Vec<(Edge, Side, f64)> {
    let sides = sides(region);
    let extent = |side: &Side| side.width.map_or(side.length, |width| side.length.min(2.0 * width));
    let shortest = sides.iter().map(extent).fold(f64::INFINITY, f64::min);
    let spacing = |side: &Side| {
        let over_width = side.width.map_or(f64::INFINITY, |width| grading.narrow * width);
        (grading.interface * shortest.max(side.length / LONG)).min(over_width).min(grading.coarsest)
    };
    region.edges().zip(&sides).map(|(edge, side)| (edge, *side, spacing(side))).collect()
}

/// The edges of an inclusion, each with the spacing there. Those of a curve may be shorter than what it asks for: nodes that
/// follow them are as near as that.
fn interfaces(region: &Polygon, grading: &Grading) -> Vec<(Point2, Point2, f64)> {
    let along = along_sides(region, grading).into_iter();
    along.map(|((a, b), _, spacing)| (a, b, spacing.min((b - a).norm()))).collect()
}

/// Pairs of straight sides of an inclusion that face each other nearer than their own spacings can resolve.
fn narrows_within(region: &Polygon, grading: &Grading) -> Vec<[Edge; 2]> {
    let mut straight = along_sides(region, grading);
    straight.retain(|(_, side, _)| side.width.is_none());
    let pairs = (0..straight.len()).flat_map(|i| (i + 1..straight.len()).map(move |j| (i, j)));
    pairs
        .map(|(i, j)| [straight[i], straight[j]])
        .filter(|[e, f]| facing(e.0, f.0) && resolves_not(grading.narrow, e.0, f.0, e.2.min(f.2)))
        .map(|[e, f]| [e.0, f.0])
        .collect()
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
    let mut narrow = narrows(outline, grading);
    narrow.extend(features.inclusions.iter().flat_map(|region| narrows_within(region, grading)));
    let mut along: Vec<(Point2, Point2, f64)> =
        features.inclusions.iter().flat_map(|region| interfaces(region, grading)).collect();
    // Along a shaft forces act as they do along the edge of an inclusion.
    along.extend(features.shaft.map(|[entry, tip]| {
        let length = (tip - entry).norm();
        (entry, tip, (0.5 * grading.interface * length).min(grading.coarsest))
    }));
    let field = Field { grading, singular: singular_points(features), wanted, interfaces: along, narrows: narrow };

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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Of a circle of radius 2, so many corners of a whole one, from the right on.
    fn arc(corners: u32, of: u32) -> Vec<Point2> {
        (0..corners)
            .map(|i| 2.0 * PI * f64::from(i) / f64::from(of))
            .map(|a| Point2::new(a.cos(), a.sin()) * 2.0)
            .collect()
    }

    /// Edges of a curve are no sides of it, however many there are; those between corners are.
    #[test]
    fn a_curve_is_one_side() {
        let of = |corners: Vec<Point2>| sides(&Polygon::new(corners).unwrap());
        let rectangle = [[0.0, 0.0], [5.0, 0.0], [5.0, 3.0], [0.0, 3.0]].map(Point2::from).to_vec();
        assert_eq!(of(rectangle), [5.0, 3.0, 5.0, 3.0].map(|length| Side { length, width: None }));
        assert!(of(arc(6, 6)).iter().all(|side| (side.length - 2.0).abs() < 1e-12), "a hexagon has corners");
        // A quarter of the circumference.
        for n in [16, 60, 400] {
            assert!(of(arc(n, n)).iter().all(|side| (side.length / PI - 1.0).abs() < 0.01 && side.width.is_some()));
        }
        // Half a disc has two corners: its diameter is a side, its arc another, no longer than that of the square.
        let half = of(arc(101, 200));
        assert_eq!(half[100], Side { length: 4.0, width: None });
        assert!((half[0].length / (1.0 + 0.5 * PI) - 1.0).abs() < 0.01, "{:?}", half[0]);
        assert!(half[..100].iter().all(|side| *side == half[0]));
        // A strip that is round is about as wide as it looks.
        let strip: Vec<Point2> = arc(200, 200).into_iter().map(|p| Point2::new(p.x, 0.1 * p.y)).collect();
        assert!(of(strip).iter().all(|side| (0.3..0.35).contains(&side.width.unwrap())));
    }

    /// A thin layer takes nodes for its width, and no more along its sides than that; what is thin asks nothing of others.
    #[test]
    fn a_thin_layer_takes_few_nodes_and_asks_nothing_of_others() {
        let square = |low: [f64; 2], size: [f64; 2]| {
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            let corners = corners.map(|c| Point2::new(low[0] + c[0] * size[0], low[1] + c[1] * size[1]));
            Polygon::new(corners.to_vec()).unwrap()
        };
        let count = |inclusions: &[Polygon], level| {
            let mut features = crate::scene::Scene::bundled("paper").unwrap().without_inclusions().features();
            features.inclusions = inclusions.to_vec();
            graded_nodes(&features, &Grading::level(&features, level, InterfaceFit::On)).len()
        };
        let (block, layer) = (square([0.1, 0.3], [0.2, 0.2]), square([0.05, 0.1], [0.9, 0.01]));
        for level in [0, 2] {
            let (none, with_block) = (count(&[], level), count(std::slice::from_ref(&block), level));
            let (with_layer, with_both) =
                (count(std::slice::from_ref(&layer), level), count(&[block.clone(), layer.clone()], level));
            assert!(with_both < with_block + with_layer - none / 2, "{none} {with_block} {with_layer} {with_both}");
            // Squares of what its width or its length asks for and less, which grow beside it: thirty rows or so. A fifth of
            // the width all along would be three times as many.
            let halved = 0.5_f64.powi(level);
            let spacing = (0.5 * 0.01 * halved.sqrt()).min(0.2 * 0.9 / LONG * halved);
            let rows = (with_layer - none) as f64 * spacing / 0.9;
            assert!(rows < 33.0, "{none} {with_layer}: {rows}");
        }
    }

    /// Nodes at the rim of a disc are as many as the disc asks for, not as its corners are.
    #[test]
    fn many_corners_of_a_curve_take_no_more_nodes() {
        let features = |corners: u32| {
            let mut scene = crate::scene::Scene::bundled("paper").unwrap();
            let disc = arc(corners, corners).into_iter().map(|p| p * 0.05 + Point2::new(0.5, 0.5)).collect();
            scene.inclusions[0].outline = Polygon::new(disc).unwrap();
            scene.features()
        };
        let count = |corners: u32, fit| {
            let features = features(corners);
            graded_nodes(&features, &Grading::level(&features, 2, fit)).len() as f64
        };
        for fit in [InterfaceFit::On, InterfaceFit::Between] {
            let (few, many) = (count(16, fit), count(48, fit));
            assert!((many / few - 1.0).abs() < 0.2, "{few} {many}");
        }
    }
}
