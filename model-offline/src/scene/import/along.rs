//! The boundary as one line: places on it by their way around the body.

use crate::geometry::{Point2, Polygon, nearest_on_loop};

/// Ends this near to a corner are meant to be the corner, part of the body's size: more than what a scene file puts
/// onto a corner by itself.
pub(super) const CORNER: f64 = 2.5e-3;

/// The boundary by the way along it, counter-clockwise from its first vertex.
pub(super) struct Along<'a> {
    pub(super) outline: &'a Polygon,
    /// Where each vertex is.
    stations: Vec<f64>,
    pub(super) length: f64,
    pub(super) size: f64,
}

impl<'a> Along<'a> {
    pub(super) fn new(outline: &'a Polygon) -> Self {
        let mut length = 0.0;
        let stations = outline.edges().map(|(a, b)| (length, length += (b - a).norm()).0).collect();
        Self { outline, stations, length, size: outline.size() }
    }

    /// Where the boundary is nearest to a point, and how far that is.
    pub(super) fn station(&self, p: Point2) -> (f64, f64) {
        let vertices = self.outline.vertices();
        let Some(near) = nearest_on_loop(vertices, p) else {
            return (0.0, f64::INFINITY);
        };
        let next = vertices[(near.edge + 1) % vertices.len()];
        let on_edge = near.fraction * (next - vertices[near.edge]).norm();
        (self.at_corner(self.stations[near.edge] + on_edge), near.distance)
    }

    /// The place, or the corner that it is meant for.
    pub(super) fn at_corner(&self, station: f64) -> f64 {
        let corners = self.stations.iter().copied().chain([self.length]);
        let near = corners.min_by(|a, b| (a - station).abs().total_cmp(&(b - station).abs()));
        near.filter(|corner| (corner - station).abs() < CORNER * self.size).unwrap_or(station)
    }

    /// The edge of a place, with where it begins and ends.
    pub(super) fn edge(&self, station: f64) -> (usize, f64, f64) {
        let station = station.rem_euclid(self.length);
        let edge = self.stations.iter().rposition(|s| *s <= station).unwrap_or(0);
        (edge, self.stations[edge], self.stations.get(edge + 1).copied().unwrap_or(self.length))
    }

    pub(super) fn point(&self, station: f64) -> Point2 {
        let station = station.rem_euclid(self.length);
        let (edge, from, to) = self.edge(station);
        let vertices = self.outline.vertices();
        let (a, b) = (vertices[edge], vertices[(edge + 1) % vertices.len()]);
        if to > from { a + (b - a) * ((station - from) / (to - from)) } else { a }
    }

    /// The boundary from one place counter-clockwise to another, with the corners between; less than once around.
    pub(super) fn part(&self, from: f64, to: f64) -> Vec<Point2> {
        let tiny = 1e-9 * self.length;
        let (from, way) = (from.rem_euclid(self.length), (to - from).rem_euclid(self.length));
        let to = from + way;
        let corners = |turn: f64| self.stations.iter().map(move |s| s + turn).zip(self.outline.vertices());
        let corners = corners(0.0).chain(corners(self.length));
        let mut path = vec![self.point(from)];
        path.extend(corners.filter(|(s, _)| *s > from + tiny && *s < to - tiny).map(|(_, v)| *v));
        path.push(self.point(to));
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_square_go_around_its_corners() {
        let square = Polygon::new([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(Point2::from).to_vec()).unwrap();
        let along = Along::new(&square);
        assert_eq!(along.length, 8.0);
        assert_eq!(along.station([2.5, 0.5].into()), (2.5, 0.5));
        assert_eq!(along.station([1.999, -0.1].into()).0, 2.0, "the corner is meant");
        assert_eq!(along.part(1.0, 3.0), [[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]].map(Point2::from));
        assert_eq!(along.part(7.0, 1.0), [[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]].map(Point2::from));
        assert_eq!(along.part(8.0, 2.0), [[0.0, 0.0], [2.0, 0.0]].map(Point2::from));
        assert_eq!(along.part(-1.0, 1.0), along.part(7.0, 9.0));
        assert_eq!(along.edge(7.0), (3, 6.0, 8.0));
    }
}
