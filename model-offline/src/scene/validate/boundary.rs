//! What must lie on the boundary: points put onto it where they nearly are, edges and fractions, and how far off what is off.

use super::{Checked, Validator};
use crate::geometry::{Location, Nearest, Point2, Polygon, nearest_on_loop};
use crate::number::{coordinate, in_unit, short};
use crate::scene::Snapped;
use crate::scene::boundary::{EdgePart, OnBoundary};
use crate::scene::exactly::Coordinates;
use crate::scene::schema::Located;
use std::cell::RefCell;
use std::ops::Range;

/// Points that touch are at most this far apart, part of the body's size.
const TOUCHING: f64 = 1e-9;
/// Points this near to the boundary are meant to lie on it, part of the body's size: three digits by hand.
const SNAP: f64 = 1e-3;

/// What is put onto it from nearer than this is a file's rounding, and not told, part of the body's size.
const DIGITS: f64 = 5e-7;

/// A contact inside that is this near to the boundary is on it, part of the body's size.
const FILM: f64 = 1e-5;

/// The body's boundary, and how exactly its parts must lie on it.
pub(super) struct Boundary<'a> {
    pub(super) outline: &'a Polygon,
    /// Vertices in the file's order, which edges are counted in.
    vertices: Vec<Point2>,
    /// Distance within which points touch, length units.
    pub(super) tolerance: f64,
    /// Distance within which points are put onto the boundary, length units.
    snap: f64,
    /// Label of the length unit.
    unit: &'a str,
    /// What was put onto it.
    moved: RefCell<Vec<Snapped>>,
}

impl<'a> Boundary<'a> {
    pub(super) fn new(outline: &'a Polygon, vertices: &[Coordinates<2>], unit: &'a str) -> Self {
        let size = outline.size();
        let vertices = vertices.iter().map(|v| Point2::from(v.0)).collect();
        Self { outline, vertices, tolerance: TOUCHING * size, snap: SNAP * size, unit, moved: RefCell::default() }
    }

    /// What was put onto the boundary so far, and how far it was off.
    pub(super) fn moved(&self) -> Vec<Snapped> {
        self.moved.borrow().clone()
    }

    /// Notes that points were put elsewhere.
    fn note(&self, what: &str, given: &[Point2], put: &[Point2]) {
        let by = given.iter().zip(put).map(|(given, put)| (put - given).norm()).fold(0.0, f64::max);
        if by > DIGITS / SNAP * self.snap {
            self.moved.borrow_mut().push(Snapped { what: what.to_owned(), by });
        }
    }

    /// The point, or where it is on the boundary if it is meant to lie there: at a corner that is near enough, else at the
    /// nearest point. What touches the boundary already keeps its digits.
    pub(super) fn snapped(&self, p: Point2, what: &str) -> Point2 {
        let put = self.on_boundary(p);
        self.note(what, &[p], &[put]);
        put
    }

    fn on_boundary(&self, p: Point2) -> Point2 {
        self.snapped_within(p, self.snap)
    }

    /// The point, or where it is on the boundary if nothing but a film of tissue is between: the rounding of a file's digits,
    /// which elements would follow with triangles of no height.
    fn without_film(&self, p: Point2) -> Point2 {
        self.snapped_within(p, FILM / SNAP * self.snap)
    }

    fn snapped_within(&self, p: Point2, most: f64) -> Point2 {
        match nearest_on_loop(&self.vertices, p) {
            Some(nearest) if nearest.distance > self.tolerance && nearest.distance <= most => {
                let from = |v: &&Point2| (*v - p).norm();
                let corner = self.vertices.iter().min_by(|a, b| from(a).total_cmp(&from(b)));
                corner.filter(|v| from(v) <= most).copied().unwrap_or(nearest.point)
            }
            _ => p,
        }
    }

    /// Where a polyline is farthest off the boundary, if it is.
    fn farthest_off(&self, path: &[Point2]) -> Option<(Point2, Nearest)> {
        let pieces = path.windows(2).flat_map(|s| self.outline.boundary_stations(s[0], s[1]));
        let off = pieces.filter_map(|p| Some((p, nearest_on_loop(&self.vertices, p)?)));
        off.filter(|(_, nearest)| nearest.distance > self.tolerance)
            .max_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
    }

    /// Whether a point is in the body or on its boundary.
    pub(super) fn holds(&self, p: Point2) -> bool {
        self.outline.locate(p, self.tolerance) != Location::Outside
    }

    /// How far off the boundary a point is, and where it would be on it.
    pub(super) fn off(&self, p: Point2) -> String {
        nearest_on_loop(&self.vertices, p).map_or_else(String::new, |nearest| self.told(p, nearest))
    }

    fn long(&self, length: f64) -> String {
        in_unit(length, self.unit)
    }

    fn point(&self, p: Point2) -> String {
        let size = self.outline.size();
        format!("({}, {})", coordinate(p.x, size), coordinate(p.y, size))
    }

    /// How far off something is, and where it would be on the boundary.
    fn told(&self, p: Point2, nearest: Nearest) -> String {
        format!(
            "{} is {} off the outline; the nearest point on it is {}, on edge {} at {} of its length",
            self.point(p),
            self.long(nearest.distance),
            self.point(nearest.point),
            nearest.edge,
            short(nearest.fraction),
        )
    }
}

impl Validator<'_> {
    /// The contact, which may also be inside: its points are put onto the boundary where one of them is outside, which nobody
    /// means. Those of a contact that is inside stay where they are but for a film beside the boundary.
    pub(super) fn contact(&self, boundary: &Boundary<'_>) -> Checked<Vec<Point2>> {
        let located = &self.file.needle.contact;
        let what = "needle contact";
        if let OnBoundary::Points(points) = located.get() {
            let path = self.polyline(points, located.span(), what)?;
            if path.iter().all(|p| boundary.holds(*p)) {
                let put: Vec<Point2> = path.iter().map(|p| boundary.without_film(*p)).collect();
                boundary.note(what, &path, &put);
                return Ok(put);
            }
        }
        let path = self.points_on(located, boundary, what)?;
        match path.iter().find(|p| !boundary.holds(**p)) {
            None => Ok(path),
            Some(p) => Err(self.error(
                located.span(),
                format!("the needle contact reaches outside the outline: {}", boundary.off(*p)),
                "the contact is tissue that moves with the needle: put it on the boundary or inside",
            )),
        }
    }

    /// The points of something on the boundary, by points or by an edge; points near the boundary are put onto it.
    pub(super) fn points_on<T: serde::de::DeserializeOwned + AsRef<[Coordinates<2>]>>(
        &self,
        located: &Located<OnBoundary<T>>,
        boundary: &Boundary<'_>,
        what: &str,
    ) -> Checked<Vec<Point2>> {
        match located.get() {
            OnBoundary::Edge(part) => self.edge_part(part, located.span(), boundary, what),
            OnBoundary::Points(points) => {
                let path = self.polyline(points.as_ref(), located.span(), what)?;
                let snapped: Vec<Point2> = path.iter().map(|p| boundary.on_boundary(*p)).collect();
                match snapped.windows(2).position(|s| s[0] == s[1]) {
                    None => {
                        boundary.note(what, &path, &snapped);
                        Ok(snapped)
                    }
                    Some(i) => Err(self.error(
                        located.span(),
                        format!(
                            "{what}: {} and {} are one and the same point of the outline, {}",
                            boundary.point(path[i]),
                            boundary.point(path[i + 1]),
                            boundary.point(snapped[i])
                        ),
                        format!(
                            "points less than {} off a corner or an edge are put onto it",
                            boundary.long(boundary.snap)
                        ),
                    )),
                }
            }
        }
    }

    fn edge_part(
        &self,
        part: &EdgePart,
        span: Range<usize>,
        boundary: &Boundary<'_>,
        what: &str,
    ) -> Checked<Vec<Point2>> {
        let count = boundary.vertices.len();
        let EdgePart { edge, from, to } = *part;
        let edge = edge as usize;
        if edge >= count {
            return Err(self.error(
                span,
                format!("{what}: the outline has no edge {edge}"),
                format!("its edges are 0 to {}: edge k runs from vertex k to vertex k + 1", count - 1),
            ));
        }
        if !(0.0 <= from && from < to && to <= 1.0) {
            return Err(self.error(
                span,
                format!("{what}: from = {from}, to = {to} is no part of an edge"),
                "give fractions of the edge with 0 ≤ from < to ≤ 1",
            ));
        }
        let (a, b) = (boundary.vertices[edge], boundary.vertices[(edge + 1) % count]);
        // The ends are the vertices to the last digit.
        Ok([from, to].map(|f| if f == 1.0 { b } else { a + (b - a) * f }).to_vec())
    }

    /// Refuses a polyline that leaves the boundary: by how much, and where it would be on it.
    pub(super) fn stays_on(
        &self,
        path: &[Point2],
        span: Range<usize>,
        boundary: &Boundary<'_>,
        what: &str,
    ) -> Checked<()> {
        match boundary.farthest_off(path) {
            None => Ok(()),
            Some((p, nearest)) => {
                let given = path.iter().any(|own| (own - p).norm() <= boundary.tolerance);
                let place = if given { "" } else { "between its points, " };
                Err(self.error(
                    span,
                    format!("{what}: {place}{}", boundary.told(p, nearest)),
                    if given {
                        format!(
                            "move the point there (less than {} off, it would have been put there), or give an edge of the \
                             outline and fractions of it: {{ edge = {}, from = 0.2, to = 0.4 }}",
                            boundary.long(boundary.snap),
                            nearest.edge
                        )
                    } else {
                        "every piece must lie on an edge of the outline: list the outline's vertices along it".to_owned()
                    },
                ))
            }
        }
    }
}
