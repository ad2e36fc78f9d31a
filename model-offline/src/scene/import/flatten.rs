//! A paddle is stiff and straight, and a scene has it on one edge: where one is drawn along a curve, the body is made
//! straight under it.

use super::along::Along;
use super::parts::OFF;
use super::role::Role;
use super::shape::Shape;
use crate::geometry::{Point2, Polygon, distance_to_polyline};

/// The outline between a paddle's ends is a curve while it is no farther off the straight line than this part of it; beyond
/// that it is a corner, and the paddle lies on one side of it.
const BULGE: f64 = 0.1;

/// A body that is straight under its paddles.
pub(super) struct Flattened<'a> {
    pub(super) outline: Polygon,
    /// Under which shapes it was not, and how far it was off, length.
    pub(super) under: Vec<(&'a Shape, f64)>,
}

/// Makes the outline straight under every paddle that is drawn along a curve of it. `rounded` rounds new corners.
pub(super) fn under_paddles(outline: Polygon, shapes: &[Shape], rounded: impl Fn(Point2) -> Point2) -> Flattened<'_> {
    let mut flattened = Flattened { outline, under: Vec::new() };
    let mut ends: Vec<Point2> = Vec::new();
    for shape in shapes.iter().filter(|shape| matches!(shape.role, Some(Role::Paddle(_)))) {
        let straight = shape.ends().and_then(|drawn| straight_under(&flattened.outline, drawn, &ends, &rounded));
        let Some(Straight { outline, chord, by }) = straight else { continue };
        ends.extend(chord);
        flattened.outline = outline;
        flattened.under.push((shape, by));
    }
    flattened
}

/// An outline with one edge under a paddle.
pub(in crate::scene) struct Straight {
    pub(in crate::scene) outline: Polygon,
    /// The new edge.
    pub(in crate::scene) chord: [Point2; 2],
    /// How far the outline was off it, length.
    pub(in crate::scene) by: f64,
}

/// The outline with one edge under a line along it, by its ends; none where it has one, where the line is elsewhere or goes
/// around a corner, and where ends of other paddles are under it.
pub(in crate::scene) fn straight_under(
    outline: &Polygon,
    drawn: [Point2; 2],
    taken: &[Point2],
    rounded: impl Fn(Point2) -> Point2,
) -> Option<Straight> {
    let along = Along::new(outline);
    let [(from, off_from), (to, off_to)] = drawn.map(|end| along.station(end));
    if off_from.max(off_to) > OFF * along.size {
        return None;
    }
    let way = |from: f64, to: f64| (to - from).rem_euclid(along.length);
    let (from, to) = if way(from, to) <= way(to, from) { (from, to) } else { (to, from) };
    let part = along.part(from, to);
    let [first, between @ .., last] = &part[..] else { return None };
    let is = |a: &Point2, b: &Point2| (a - b).norm() <= 1e-9 * along.size;
    let chord = [first, last].map(|end| match outline.vertices().iter().find(|corner| is(corner, end)) {
        Some(corner) => *corner,
        None => rounded(*end),
    });
    let by = between.iter().map(|corner| distance_to_polyline(*corner, &chord)).fold(0.0, f64::max);
    let is_curve = !between.is_empty() && by <= BULGE * (chord[1] - chord[0]).norm();
    if !is_curve || between.iter().any(|corner| taken.iter().any(|end| is(corner, end))) {
        return None;
    }
    // Once around: from the chord's end to its beginning.
    let rest = along.part(to, from);
    let [_, others @ .., _] = &rest[..] else { return None };
    let corners = chord.iter().rev().take(1).chain(others).chain(&chord[..1]).copied().collect();
    Some(Straight { outline: Polygon::new(corners).ok()?, chord, by })
}

#[cfg(test)]
mod tests {
    use super::super::role::Meaning;
    use super::*;

    /// A circle of radius 50 about the origin, to a third of a unit.
    fn circle() -> Polygon {
        let corner = |i: u32| f64::from(i) * std::f64::consts::TAU / 60.0;
        Polygon::new((0..60).map(corner).map(|a| Point2::new(a.cos(), a.sin()) * 50.0).collect()).unwrap()
    }

    fn paddle(index: u32, points: &[[f64; 2]]) -> Shape {
        let role = Some(Role::Paddle(Some(index)));
        let points = points.iter().map(|p| Point2::from(*p)).collect();
        Shape::new(String::new(), Meaning { role, ..Meaning::default() }, points, false)
    }

    /// Ends at an angle, degrees, to both sides of a direction.
    fn across(index: u32, middle: f64, half: f64) -> Shape {
        let end = |degrees: f64| [50.0 * degrees.to_radians().cos(), 50.0 * degrees.to_radians().sin()];
        paddle(index, &[end(middle - half), end(middle + half)])
    }

    fn has_edge(outline: &Polygon, length: f64) -> bool {
        outline.edges().any(|(a, b)| ((b - a).norm() - length).abs() < 0.2)
    }

    /// The chord of a circle and its sagitta; less area, and nothing else changes.
    #[test]
    fn under_a_paddle_on_a_curve_the_body_is_straight() {
        // The second one lies over the place where the corners begin to be counted.
        let shapes = [across(1, 90.0, 13.0), across(2, 0.0, 10.0)];
        let Flattened { outline, under } = under_paddles(circle(), &shapes, |p| p);
        let chords = [13.0f64, 10.0].map(|half| 100.0 * half.to_radians().sin());
        assert!(chords.iter().all(|chord| has_edge(&outline, *chord)), "{chords:?}");
        for ((_, by), half) in under.iter().zip([13.0f64, 10.0]) {
            let sagitta = 50.0 * (1.0 - half.to_radians().cos());
            assert!((by - sagitta).abs() < 0.07, "{by} {sagitta}");
        }
        let segment = |half: f64| 1250.0 * (2.0 * half.to_radians() - (2.0 * half.to_radians()).sin());
        let less = circle().area() - outline.area();
        assert!((less / (segment(13.0) + segment(10.0)) - 1.0).abs() < 0.1, "{less}");
        assert!(outline.vertices().iter().all(|v| v.norm() <= 50.0 + 1e-9 && v.norm() > 49.9));
    }

    #[test]
    fn corners_edges_and_ends_of_other_paddles_stay() {
        let square =
            Polygon::new([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [0.0, 50.0]].map(Point2::from).to_vec()).unwrap();
        let on_one = paddle(1, &[[10.0, 0.0], [30.0, 0.0]]);
        let round_the_corner = paddle(2, &[[40.0, 0.0], [50.0, 10.0]]);
        let far_off = paddle(3, &[[10.0, 20.0], [30.0, 20.0]]);
        let shapes = [on_one, round_the_corner, far_off];
        let same = under_paddles(square.clone(), &shapes, |p| p);
        assert!(same.under.is_empty() && same.outline == square);
        // Half a circle is no paddle; one over the end of another one does not bend it.
        let shapes = [across(1, 180.0, 80.0), across(2, 90.0, 12.0), across(3, 78.0, 12.0)];
        let Flattened { outline, under } = under_paddles(circle(), &shapes, |p| p);
        assert!(matches!(under[..], [(shape, _)] if shape.role == Some(Role::Paddle(Some(2)))));
        assert!(has_edge(&outline, 100.0 * 12f64.to_radians().sin()));
    }
}
