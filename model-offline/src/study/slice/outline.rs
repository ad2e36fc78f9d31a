//! What a plane cuts of the surface of a mesh: closed loops, moved onto the surface that the mesh stands for.

use crate::geometry::{Point, Point2, cross, signed_area};
use crate::output::space_picture::CutPlane;
use std::collections::BTreeMap;

/// Points nearer to each other than this part of the body's size are one.
const SAME: f64 = 1e-9;
/// A chord this far from the surface, as a part of the body's size, is halved; so often at most.
const OFF: f64 = 5e-4;
const HALVINGS: u32 = 5;
/// Steps of Newton's method onto the surface, and the difference that it takes slopes with, over the body's size.
const STEPS: u32 = 8;
const DIFFERENCE: f64 = 1e-6;
/// A point moves by this part of the body's size at most: beyond, it would be another piece of the surface.
const FARTHEST: f64 = 0.05;
/// Surfaces flatter to the plane than this slope of their level are left where they are.
const FLATTEST: f64 = 0.1;

/// A closed loop of points in space, all in the plane.
pub(super) type Loop = Vec<Point<3>>;

/// Cuts a closed surface of triangles, outward by the right-hand rule. What lies in the plane counts as beyond it, so
/// that the loops close whatever nodes the plane hits.
pub(super) fn loops(nodes: &[Point<3>], triangles: &[[u32; 3]], plane: &CutPlane, size: f64) -> Vec<Loop> {
    let distances: Vec<f64> = nodes.iter().map(|x| plane.distance(x)).collect();
    let is_beyond = |node: u32| distances[node as usize] >= 0.0;
    let key = |a: u32, b: u32| (a.min(b), a.max(b));
    // From the edge where a triangle's boundary comes through the plane to the one where it goes back: the neighbour
    // across that one begins there.
    let mut next: BTreeMap<(u32, u32), Vec<(u32, u32)>> = BTreeMap::new();
    for triangle in triangles {
        let edges = [0, 1, 2].map(|k| (triangle[k], triangle[(k + 1) % 3]));
        let comes = edges.iter().find(|(a, b)| !is_beyond(*a) && is_beyond(*b));
        let goes = edges.iter().find(|(a, b)| is_beyond(*a) && !is_beyond(*b));
        if let (Some(comes), Some(goes)) = (comes, goes) {
            next.entry(key(comes.0, comes.1)).or_default().push(key(goes.0, goes.1));
        }
    }
    let crossing = |(a, b): (u32, u32)| {
        let (a, b) = (a as usize, b as usize);
        nodes[a].lerp(&nodes[b], distances[a] / (distances[a] - distances[b]))
    };
    let mut found = Vec::new();
    while let Some((&first, _)) = next.first_key_value() {
        let (mut points, mut at) = (Vec::new(), first);
        while let Some(mut to) = next.remove(&at) {
            points.push(crossing(at));
            let Some(following) = to.pop() else { break };
            if !to.is_empty() {
                next.insert(at, to);
            }
            at = following;
        }
        points.dedup_by(|a, b| (*a - *b).norm() <= SAME * size);
        while points.len() > 1 && (points[0] - points[points.len() - 1]).norm() <= SAME * size {
            points.pop();
        }
        if points.len() > 2 {
            found.push(points);
        }
    }
    found
}

/// Moves a loop's points onto the surface within the plane, and adds points where its chords are off it. `level` is
/// negative inside, about a distance.
pub(super) fn onto_surface(cut: &[Point<3>], level: &dyn Fn(&Point<3>) -> f64, plane: &CutPlane, size: f64) -> Loop {
    let moved: Loop = cut.iter().map(|x| foot(x, level, plane, size)).collect();
    let mut all = Vec::new();
    for (i, x) in moved.iter().enumerate() {
        all.push(*x);
        refine(&mut all, [*x, moved[(i + 1) % moved.len()]], &Refinement { level, plane, size }, HALVINGS);
    }
    all.dedup_by(|a, b| (*a - *b).norm() <= SAME * size);
    all
}

struct Refinement<'a> {
    level: &'a dyn Fn(&Point<3>) -> f64,
    plane: &'a CutPlane,
    size: f64,
}

/// Adds what lies between two points.
fn refine(all: &mut Loop, [a, b]: [Point<3>; 2], on: &Refinement<'_>, left: u32) {
    let middle = a.lerp(&b, 0.5);
    if left == 0 || (on.level)(&middle).abs() <= OFF * on.size {
        return;
    }
    let moved = foot(&middle, on.level, on.plane, on.size);
    // Across a corner that the mesh cuts off there is no point between.
    if (moved - middle).norm() > 0.5 * (b - a).norm() {
        return;
    }
    refine(all, [a, moved], on, left - 1);
    all.push(moved);
    refine(all, [moved, b], on, left - 1);
}

/// The point of the surface that Newton's method within the plane leads to; the point itself where that leads far away.
fn foot(from: &Point<3>, level: &dyn Fn(&Point<3>) -> f64, plane: &CutPlane, size: f64) -> Point<3> {
    let (step, mut x) = (DIFFERENCE * size, *from);
    for _ in 0..STEPS {
        let here = level(&x);
        if here.abs() <= SAME * size {
            break;
        }
        let slope = plane.directions.map(|d| (level(&(x + d * step)) - level(&(x - d * step))) / (2.0 * step));
        let square = slope[0] * slope[0] + slope[1] * slope[1];
        if square < FLATTEST * FLATTEST {
            return *from;
        }
        x -= (plane.directions[0] * slope[0] + plane.directions[1] * slope[1]) * (here / square);
    }
    let is_better = level(&x).abs() < level(from).abs() && (x - from).norm() <= FARTHEST * size;
    if is_better { x } else { *from }
}

/// Loops as they lie in the plane, by what they are.
pub(super) struct Nested {
    /// The boundary of the piece that holds a point.
    pub(super) outline: Loop,
    /// Boundaries of holes in it.
    pub(super) holes: usize,
    /// Other pieces.
    pub(super) others: usize,
}

/// Which loop is the boundary of the piece that holds a point, and what else there is; none where no piece does.
pub(super) fn nested(loops: Vec<Loop>, plane: &CutPlane, point: &Point<3>) -> Option<Nested> {
    let flat: Vec<Vec<Point2>> = loops.iter().map(|cut| in_plane(cut, plane)).collect();
    let areas: Vec<f64> = flat.iter().map(|cut| signed_area(cut)).collect();
    let largest = areas.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let is_outer = |i: &usize| areas[*i] * largest > 0.0;
    let at = Point2::from(plane.coordinates(point));
    let around = (0..loops.len()).filter(|i| is_outer(i) && holds(&flat[*i], at));
    let chosen = around.min_by(|a, b| areas[*a].abs().total_cmp(&areas[*b].abs()))?;
    let holes = (0..loops.len()).filter(|i| !is_outer(i) && holds(&flat[chosen], flat[*i][0])).count();
    let others = (0..loops.len()).filter(|i| is_outer(i) && *i != chosen).count();
    let outline = loops.into_iter().nth(chosen)?;
    Some(Nested { outline, holes, others })
}

/// Coordinates of points in the plane.
pub(super) fn in_plane(points: &[Point<3>], plane: &CutPlane) -> Vec<Point2> {
    points.iter().map(|x| Point2::from(plane.coordinates(x))).collect()
}

/// Whether a closed loop holds a point, by the angle that it goes round it.
pub(super) fn holds(cut: &[Point2], point: Point2) -> bool {
    let ends = |i: usize| [cut[i] - point, cut[(i + 1) % cut.len()] - point];
    let turned: f64 = (0..cut.len()).map(ends).map(|[a, b]| cross(a, b).atan2(a.dot(&b))).sum();
    turned.abs() > std::f64::consts::PI
}
