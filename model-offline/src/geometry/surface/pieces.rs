//! Sharp edges of a closed surface, the pieces between them, and the planes of those that are flat.

use super::TriangleSurface;
use crate::geometry::implicit::Sheet;
use crate::geometry::point::{Point, box_of};
use std::collections::BTreeMap;

/// Neighbours whose normals differ by more than 40° meet in a sharp edge: its cosine.
const SHARP: f64 = 0.766;
/// A surface with more pieces than this is no body of faces but a rough one, and has none.
const MOST_PIECES: usize = 100;
/// Pieces smaller than this part of the body belong to what is around them.
const SMALLEST: f64 = 0.005;
/// Vertices of a flat piece are this close to its plane, part of the body's size: files have six digits or more.
const FLAT: f64 = 2e-6;
/// The same, part of the farthest coordinate: single precision.
const ROUNDING: f64 = 1.2e-7;
/// Normals of triangles thinner than this many times that are made of rounding.
const THIN: f64 = 2.0;
/// Planes of normals this close (1 − cosine) may be one plane.
const PARALLEL: f64 = 1e-6;
/// A plane closer than this sine to a combination of others decides nothing more about a vertex.
const DEPENDENT: f64 = 0.05;

/// The plane normal·x = offset, its unit normal outwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub(super) normal: Point<3>,
    pub(super) offset: f64,
}

impl Plane {
    pub(super) fn sheet(&self) -> Sheet<'static> {
        Sheet::Plane { normal: self.normal, offset: self.offset }
    }

    fn level(&self, x: &Point<3>) -> f64 {
        self.normal.dot(x) - self.offset
    }

    /// The axis that it is across.
    fn axis(&self) -> Option<usize> {
        (0..3).find(|k| self.normal[*k].abs() == 1.0)
    }

    fn turned(&self) -> Self {
        Self { normal: -self.normal, offset: -self.offset }
    }
}

/// The pieces of a surface.
#[derive(Debug)]
pub(super) struct Pieces {
    /// Which piece each triangle is of.
    pub(super) piece_of: Vec<u32>,
    /// The plane of every piece; none of a curved one.
    pub(super) planes: Vec<Option<Plane>>,
    /// How far vertices are from planes that they are on: none, but for rounding, where no more than three planes meet.
    pub(super) precision: f64,
}

impl Pieces {
    /// Divides a surface at its sharp edges, and moves the vertices of flat pieces onto their planes. `across`: the
    /// triangle across the edge from corner k to corner k + 1. Pieces in one of the `known` planes get that very plane.
    pub(super) fn of(surface: &mut TriangleSurface, across: &[[u32; 3]], known: &[Plane]) -> Self {
        let Some((low, high)) = box_of(&surface.vertices) else {
            return Self { piece_of: Vec::new(), planes: Vec::new(), precision: 0.0 };
        };
        let (size, farthest) = ((high - low).norm(), low.amax().max(high.amax()));
        let tolerance = FLAT * size + ROUNDING * farthest;
        let normals = normals(surface, across, THIN * tolerance);
        let (mut piece_of, mut count) = connected(&normals, across);
        let small = without_small(surface, across, &mut piece_of, count, SMALLEST * size);
        count = small;
        if count > MOST_PIECES {
            (piece_of, count) = (vec![0; piece_of.len()], 1);
        }
        let mut planes = planes(surface, &piece_of, count, tolerance, known);
        in_order(&mut piece_of, &mut planes);
        let precision = flatten(surface, &piece_of, &planes);
        Self { piece_of, planes, precision }
    }

    /// How many pieces are flat, and how many are not.
    pub(super) fn counts(&self) -> (usize, usize) {
        let flat = self.planes.iter().flatten().count();
        (flat, self.planes.len() - flat)
    }
}

/// Unit normals of all triangles; those that are thinner than `thin` take that of the neighbour at their longest edge.
fn normals(surface: &TriangleSurface, across: &[[u32; 3]], thin: f64) -> Vec<Point<3>> {
    let all = 0..surface.triangles.len();
    let twice_area = |t: usize| {
        let [a, b, c] = surface.corners(t);
        (b - a).cross(&(c - a))
    };
    let longest = |t: usize| {
        let x = surface.corners(t);
        let edge = |k: usize| (x[(k + 1) % 3] - x[k]).norm();
        (0..3).map(|k| (edge(k), k)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    };
    let mut normals: Vec<Point<3>> = all.clone().map(|t| twice_area(t).normalize()).collect();
    let mut unsure: Vec<(f64, usize, usize)> = all
        .filter_map(|t| {
            let ((length, k), area) = (longest(t), twice_area(t).norm());
            (area < thin * length).then_some((area / length, t, across[t][k] as usize))
        })
        .collect();
    // The thinnest last: what they take has been told by then.
    unsure.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    unsure.iter().for_each(|(_, t, beside)| normals[*t] = normals[*beside]);
    normals
}

/// Numbers of the pieces that hang together across edges that are not sharp, and how many there are.
fn connected(normals: &[Point<3>], across: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let (mut piece_of, mut count) = (vec![u32::MAX; normals.len()], 0);
    for start in 0..normals.len() {
        if piece_of[start] != u32::MAX {
            continue;
        }
        piece_of[start] = count;
        let mut open = vec![start];
        while let Some(t) = open.pop() {
            for beside in across[t].map(|t| t as usize) {
                if piece_of[beside] == u32::MAX && normals[t].dot(&normals[beside]) >= SHARP {
                    piece_of[beside] = count;
                    open.push(beside);
                }
            }
        }
        count += 1;
    }
    (piece_of, count as usize)
}

/// Gives every piece that is smaller than `smallest` to the neighbour that it has most of its edge with; how many are
/// left.
fn without_small(
    surface: &TriangleSurface,
    across: &[[u32; 3]],
    piece_of: &mut [u32],
    count: usize,
    smallest: f64,
) -> usize {
    let mut corners: Vec<Vec<Point<3>>> = vec![Vec::new(); count];
    let mut beside: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for (t, piece) in piece_of.iter().enumerate() {
        let x = surface.corners(t);
        corners[*piece as usize].extend(x);
        for k in 0..3 {
            let other = piece_of[across[t][k] as usize];
            if other != *piece {
                *beside.entry((*piece, other)).or_default() += (x[(k + 1) % 3] - x[k]).norm();
            }
        }
    }
    let size = |piece: u32| box_of(&corners[piece as usize]).map_or(0.0, |(low, high)| (high - low).norm());
    let mut into: Vec<u32> = (0..count as u32).collect();
    for piece in (0..count as u32).filter(|piece| size(*piece) < smallest) {
        let all = beside.range((piece, 0)..=(piece, u32::MAX));
        let longest = all.max_by(|a, b| a.1.total_cmp(b.1)).map(|((_, other), _)| *other);
        let mut end = longest.unwrap_or(piece);
        while into[end as usize] != end {
            end = into[end as usize];
        }
        into[piece as usize] = end;
    }
    let mut number = BTreeMap::new();
    for piece in piece_of.iter_mut() {
        while into[*piece as usize] != *piece {
            *piece = into[*piece as usize];
        }
        let next = number.len() as u32;
        *piece = *number.entry(*piece).or_insert(next);
    }
    number.len()
}

/// The planes of the pieces whose vertices are within the tolerance of one.
fn planes(
    surface: &TriangleSurface,
    piece_of: &[u32],
    count: usize,
    tolerance: f64,
    known: &[Plane],
) -> Vec<Option<Plane>> {
    let mut corners: Vec<Vec<Point<3>>> = vec![Vec::new(); count];
    let mut areas = vec![Point::<3>::zeros(); count];
    for (t, piece) in piece_of.iter().enumerate() {
        let [a, b, c] = surface.corners(t);
        areas[*piece as usize] += (b - a).cross(&(c - a));
        corners[*piece as usize].extend([a, b, c]);
    }
    let mut known = known.to_vec();
    let plane = |(corners, area): (Vec<Point<3>>, Point<3>)| {
        let is_on = |plane: &Plane| corners.iter().all(|x| plane.level(x).abs() <= tolerance);
        let own = fitted(&corners, area, tolerance)?;
        let both = known.iter().flat_map(|plane| [*plane, plane.turned()]);
        let found = both.into_iter().find(|k| k.normal.dot(&own.normal) > 1.0 - PARALLEL && is_on(k));
        let plane = found.or(is_on(&own).then_some(own))?;
        known.push(plane);
        Some(plane)
    };
    corners.into_iter().zip(areas).map(plane).collect()
}

/// The plane across the mean normal, half way between the lowest and the highest corner; across an axis where it is to
/// rounding, at the decimal number that single precision stands for.
fn fitted(corners: &[Point<3>], area: Point<3>, tolerance: f64) -> Option<Plane> {
    let along = |normal: &Point<3>| {
        let levels = corners.iter().map(|x| normal.dot(x));
        levels.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), l| (low.min(l), high.max(l)))
    };
    let normal = area.try_normalize(0.0)?;
    let mut across = Point::<3>::zeros();
    across[normal.iamax()] = normal[normal.iamax()].signum();
    let (low, high) = along(&across);
    if 0.5 * (high - low) <= tolerance {
        let offset = 0.5 * (low + high);
        let single = offset as f32;
        let decimal = single.to_string().parse().ok().filter(|_| f64::from(single) == offset);
        return Some(Plane { normal: across, offset: decimal.unwrap_or(offset) });
    }
    let (low, high) = along(&normal);
    Some(Plane { normal, offset: 0.5 * (low + high) })
}

/// Numbers pieces as boxes have their faces: those across axes first, curved ones last.
fn in_order(piece_of: &mut [u32], planes: &mut Vec<Option<Plane>>) {
    let rank = |plane: &Option<Plane>| match plane {
        None => (2, 0, false),
        Some(plane) => plane.axis().map_or((1, 0, false), |k| (0, k, plane.normal[k] > 0.0)),
    };
    let mut order: Vec<usize> = (0..planes.len()).collect();
    order.sort_by_key(|piece| rank(&planes[*piece]));
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(new, old)| place[*old] = new as u32);
    piece_of.iter_mut().for_each(|piece| *piece = place[*piece as usize]);
    *planes = order.iter().map(|old| planes[*old]).collect();
}

/// Moves every vertex onto the planes of its pieces, as many of them as determine it; how far the worst is from any.
fn flatten(surface: &mut TriangleSurface, piece_of: &[u32], planes: &[Option<Plane>]) -> f64 {
    let mut on: Vec<Vec<u32>> = vec![Vec::new(); surface.vertices.len()];
    for (triangle, piece) in surface.triangles.iter().zip(piece_of) {
        if planes[*piece as usize].is_some() {
            triangle.iter().for_each(|vertex| on[*vertex as usize].push(*piece));
        }
    }
    let mut worst = 0.0_f64;
    for (x, on) in surface.vertices.iter_mut().zip(&mut on) {
        on.sort_unstable();
        on.dedup();
        let planes: Vec<Plane> = on.iter().filter_map(|piece| planes[*piece as usize]).collect();
        // Once more for what rounding left.
        for _ in 0..2 {
            let mut basis: Vec<(Point<3>, f64)> = Vec::with_capacity(3);
            for plane in &planes {
                let rest = basis.iter().fold(plane.normal, |rest, (q, _)| rest - q * q.dot(&plane.normal));
                let done: f64 = basis.iter().map(|(q, step)| q.dot(&plane.normal) * step).sum();
                if rest.norm() > DEPENDENT {
                    basis.push((rest.normalize(), -(plane.level(x) + done) / rest.norm()));
                }
            }
            *x += basis.iter().map(|(q, step)| q * *step).sum::<Point<3>>();
        }
        worst = planes.iter().map(|plane| plane.level(x).abs()).fold(worst, f64::max);
        // Across axes to the last bit.
        for plane in &planes {
            if let Some(k) = plane.axis() {
                x[k] = plane.offset * plane.normal[k];
            }
        }
    }
    worst
}
