//! What of a slice's boundary lies in regions, and the polygon that keeps their ends.

use crate::geometry::{Implicit, Point, Point2, distance_to_segment, simplified_line};
use crate::output::space_picture::CutPlane;

/// The boundary is looked at in steps of this part of the body's size.
const STEP: f64 = 2.5e-3;
/// What is this far outside of a region, over the body's size, is in it but for rounding.
const ROUNDING: f64 = 1e-8;
/// Ends this near to a vertex, over the body's size, are at it.
const AT_VERTEX: f64 = 1e-5;
/// Vertices nearer than this to the line between others, over the body's size, are left out.
const DETAIL: f64 = 1e-3;
/// A piece of boundary whose middle is farther from its chord than this part of it turns a corner.
const BENT: f64 = 0.15;

/// A piece of the boundary between two arc lengths; `to` is above `from`, and beyond the whole length where the piece
/// goes over the boundary's first point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Run {
    pub(super) fn length(&self) -> f64 {
        self.to - self.from
    }
}

/// A closed boundary in a plane, by arc length.
pub(super) struct Boundary<'a> {
    points: Vec<Point<3>>,
    /// Arc length at every point, and at the end the whole.
    at: Vec<f64>,
    plane: &'a CutPlane,
    size: f64,
}

/// A vertex of the polygon.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    at: f64,
    point: Point2,
    /// Whether a piece ends here.
    is_end: bool,
}

impl<'a> Boundary<'a> {
    /// `size` is the body's.
    pub(super) fn new(points: Vec<Point<3>>, plane: &'a CutPlane, size: f64) -> Self {
        let mut at = vec![0.0];
        for i in 0..points.len() {
            at.push(at[i] + (points[(i + 1) % points.len()] - points[i]).norm());
        }
        Self { points, at, plane, size }
    }

    fn length(&self) -> f64 {
        self.at[self.points.len()]
    }

    fn point(&self, s: f64) -> Point<3> {
        let s = s.rem_euclid(self.length());
        let edge = self.at.partition_point(|at| *at <= s).clamp(1, self.points.len()) - 1;
        let part = (s - self.at[edge]) / (self.at[edge + 1] - self.at[edge]);
        self.points[edge].lerp(&self.points[(edge + 1) % self.points.len()], part)
    }

    /// Pieces that lie in any of these regions.
    pub(super) fn runs(&self, regions: &[&dyn Implicit]) -> Vec<Run> {
        let holds = |s: f64| regions.iter().any(|region| region.holds(&self.point(s), ROUNDING * self.size));
        let looked: Vec<(f64, bool)> = self.stations().into_iter().map(|s| (s, holds(s))).collect();
        let length = self.length();
        // Where it goes in, and where out again.
        let mut changes = Vec::new();
        for (i, (s, is_in)) in looked.iter().enumerate() {
            let (next, then) = looked[(i + 1) % looked.len()];
            if *is_in != then {
                let next = if next > *s { next } else { next + length };
                changes.push((self.change(*s, next, &holds), then));
            }
        }
        let Some(first) = changes.iter().position(|(_, goes_in)| *goes_in) else {
            let whole = looked.first().is_some_and(|(_, is_in)| *is_in);
            return if whole { vec![Run { from: 0.0, to: length }] } else { Vec::new() };
        };
        changes.rotate_left(first);
        let run = |pair: &[(f64, bool)]| {
            let from = pair[0].0.rem_euclid(length);
            let to = pair[1].0.rem_euclid(length);
            Run { from, to: if to > from { to } else { to + length } }
        };
        changes.chunks_exact(2).map(run).collect()
    }

    /// Arc lengths that are looked at: within every edge, evenly.
    fn stations(&self) -> Vec<f64> {
        let edge = |ends: &[f64]| {
            let (from, to) = (ends[0], ends[1]);
            let count = ((to - from) / (STEP * self.size)).ceil().max(1.0);
            (0..count as usize).map(move |i| from + (to - from) * (i as f64 + 0.5) / count)
        };
        self.at.windows(2).flat_map(edge).collect()
    }

    /// Where membership changes between two arc lengths: at a vertex if one is there.
    fn change(&self, mut low: f64, mut high: f64, holds: &dyn Fn(f64) -> bool) -> f64 {
        let before = holds(low);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if holds(middle) == before { low = middle } else { high = middle }
        }
        let found = 0.5 * (low + high);
        let length = self.length();
        let away = |vertex: &f64| (vertex - found.rem_euclid(length)).abs();
        let nearest = self.at.iter().copied().min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(found);
        if away(&nearest) <= AT_VERTEX * self.size { nearest } else { found }
    }

    /// Whether two pieces have more than a point in common, or a point.
    pub(super) fn meet(&self, a: &Run, b: &Run) -> Meeting {
        let length = self.length();
        let overlap = [-length, 0.0, length].map(|by| a.to.min(b.to + by) - a.from.max(b.from + by));
        let most = overlap.into_iter().fold(f64::NEG_INFINITY, f64::max);
        match most {
            m if m > AT_VERTEX * self.size => Meeting::Overlap,
            m if m >= -AT_VERTEX * self.size => Meeting::Touch,
            _ => Meeting::Apart,
        }
    }

    /// How far the boundary leaves the chord of a piece, length.
    fn sagitta(&self, run: &Run) -> f64 {
        let ends = [run.from, run.to].map(|s| self.flat(s));
        let between = self.at.iter().flat_map(|at| [*at, at + self.length()]).filter(|s| *s > run.from && *s < run.to);
        between.map(|s| distance_to_segment(self.flat(s), ends[0], ends[1])).fold(0.0, f64::max)
    }

    /// Whether a piece is nearly its chord.
    pub(super) fn is_nearly_straight(&self, run: &Run) -> bool {
        self.sagitta(run) <= BENT * (self.flat(run.to) - self.flat(run.from)).norm()
    }

    /// Whether a piece is its chord.
    pub(super) fn is_straight(&self, run: &Run) -> bool {
        self.sagitta(run) <= AT_VERTEX * self.size
    }

    fn flat(&self, s: f64) -> Point2 {
        Point2::from(self.plane.coordinates(&self.point(s)))
    }

    /// The boundary as a polygon with vertices at the ends of all pieces, those of the pieces to be straightened
    /// straight.
    pub(super) fn polygon(&self, kept: &[Run], straightened: &[Run]) -> Outline {
        let length = self.length();
        let is_within = |s: f64, run: &Run| {
            let gap = AT_VERTEX * self.size;
            [s, s + length].iter().any(|s| *s > run.from + gap && *s < run.to - gap)
        };
        let ends = kept.iter().chain(straightened).flat_map(|run| [run.from, run.to]).map(|s| s.rem_euclid(length));
        let mut all: Vec<Vertex> = ends.map(|at| Vertex { at, point: self.flat(at), is_end: true }).collect();
        let corners =
            self.at[..self.points.len()].iter().filter(|at| !straightened.iter().any(|run| is_within(**at, run)));
        all.extend(corners.map(|at| Vertex { at: *at, point: self.flat(*at), is_end: false }));
        // An end before the corner that it is at.
        all.sort_by(|a, b| a.at.total_cmp(&b.at).then(b.is_end.cmp(&a.is_end)));
        let is_near = |a: &Vertex, b: &Vertex| (a.point - b.point).norm() <= AT_VERTEX * self.size;
        all.dedup_by(|a, b| {
            let near = is_near(a, b);
            // The corner's place, which is exact; the end's meaning.
            b.is_end |= near && a.is_end;
            near
        });
        if all.len() > 1 && is_near(&all[0], &all[all.len() - 1]) {
            all[0].is_end |= all.pop().is_some_and(|last| last.is_end);
        }
        let first = all.iter().position(|vertex| vertex.is_end).unwrap_or(0);
        all.rotate_left(first);
        all.extend(all.first().copied());
        let mut vertices = Vec::new();
        let sections = all.iter().enumerate().filter(|(_, vertex)| vertex.is_end).map(|(i, _)| i).collect::<Vec<_>>();
        for ends in sections.windows(2) {
            let section: Vec<Point2> = all[ends[0]..=ends[1]].iter().map(|vertex| vertex.point).collect();
            let simple = simplified_line(&section, DETAIL * self.size);
            vertices.extend_from_slice(&simple[..simple.len() - 1]);
        }
        Outline { vertices }
    }

    /// The end points of a piece in the plane.
    pub(super) fn ends(&self, run: &Run) -> [Point2; 2] {
        [self.flat(run.from), self.flat(run.to)]
    }
}

/// What two pieces of a boundary have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meeting {
    /// Nothing.
    Apart,
    /// An end.
    Touch,
    /// More than that.
    Overlap,
}

/// The polygon of a slice.
pub(super) struct Outline {
    pub(super) vertices: Vec<Point2>,
}

impl Outline {
    /// The vertices from one end of a piece to the other, in the polygon's order.
    pub(super) fn path(&self, ends: [Point2; 2]) -> Vec<Point2> {
        let nearest = |p: Point2| {
            let away = |i: &usize| (self.vertices[*i] - p).norm();
            (0..self.vertices.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0)
        };
        let (from, to) = (nearest(ends[0]), nearest(ends[1]));
        let count = (to + self.vertices.len() - from) % self.vertices.len();
        // A piece that begins where it ends goes all the way round.
        let count = if count == 0 { self.vertices.len() } else { count };
        (0..=count).map(|i| self.vertices[(from + i) % self.vertices.len()]).collect()
    }
}
