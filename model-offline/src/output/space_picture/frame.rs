//! Planes to cut a body with, and where to look at it from.

use super::SpaceGeometry;
use crate::geometry::Point;
use crate::number::short;
use crate::output::chart::number::minus;
use nalgebra::Vector3;

/// A direction is that of a coordinate from here on.
const ALIGNED: f64 = 1.0 - 1e-9;
/// How far the view is turned from the paddles towards the needle's entry, upwards and aside.
const TOWARDS_ENTRY: f64 = 0.55;
const UPWARDS: f64 = 0.6;
const ASIDE: f64 = 0.8;

/// A plane with coordinates in it.
#[derive(Debug, Clone, PartialEq)]
pub struct CutPlane {
    /// Unit normal.
    pub normal: Point<3>,
    /// The plane is normal·x = offset, length.
    pub offset: f64,
    /// Unit directions to the right and upwards.
    pub directions: [Point<3>; 2],
    /// Whether the needle goes through it instead of along it.
    pub across_needle: bool,
}

impl CutPlane {
    /// Coordinates of a point's projection, length.
    pub fn coordinates(&self, x: &Point<3>) -> [f64; 2] {
        self.directions.map(|direction| direction.dot(x))
    }

    /// Signed distance of a point, length.
    pub fn distance(&self, x: &Point<3>) -> f64 {
        self.normal.dot(x) - self.offset
    }

    /// What it is: `x = 0.5 mm, along the needle`.
    pub fn name(&self, unit: &str) -> String {
        let unit = if unit == "1" { String::new() } else { format!("\u{a0}{unit}") };
        let side = if self.across_needle { "across" } else { "along" };
        format!("{}\u{a0}=\u{a0}{}{unit}, {side} the needle", direction_name(&self.normal), minus(short(self.offset)))
    }

    /// Names of its two coordinates.
    pub fn axes(&self) -> [String; 2] {
        [0, 1].map(|k| direction_name(&self.directions[k]))
    }
}

/// `x` for a coordinate; what is multiplied with a point for others.
fn direction_name(direction: &Point<3>) -> String {
    match ["x", "y", "z"].iter().zip(direction.iter()).find(|(_, part)| **part > ALIGNED) {
        Some((name, _)) => (*name).to_owned(),
        None => {
            // A part that rounds to nothing has no sign.
            let parts = direction.map(|part| minus(format!("{:.2}", (part * 100.0).round() / 100.0 + 0.0)));
            format!("({},\u{a0}{},\u{a0}{})·X", parts[0], parts[1], parts[2])
        }
    }
}

/// Three orthogonal planes through the target at rest, the two along the needle first.
pub fn planes(geometry: &SpaceGeometry) -> [CutPlane; 3] {
    // With the largest part positive: coordinates where the needle goes along one.
    let towards = |v: [f64; 3]| {
        let v = Point::from(v);
        if v[v.iamax()] < 0.0 { -v } else { v }
    };
    let [n1, n2] = geometry.orthogonal.map(towards);
    let axis = towards(geometry.axis);
    let target = Point::from(geometry.target);
    let plane = |normal: Point<3>, a: Point<3>, b: Point<3>, across_needle| {
        // Right and up are coordinates wherever they can be.
        let directions = match (0..3).find(|&k| normal[k] > ALIGNED) {
            Some(0) => [Vector3::y(), Vector3::z()],
            Some(1) => [Vector3::x(), Vector3::z()],
            Some(_) => [Vector3::x(), Vector3::y()],
            None if a.iamax() <= b.iamax() => [a, b],
            None => [b, a],
        };
        CutPlane { normal, offset: normal.dot(&target), directions, across_needle }
    };
    [plane(n2, n1, axis, false), plane(n1, n2, axis, false), plane(axis, n1, n2, true)]
}

/// Unit directions from the body to where it is looked at from, and upwards on paper: z is up if it can be, and attached
/// paddles are on this side.
pub fn seen_from(geometry: &SpaceGeometry, paddles: &[u32]) -> [Point<3>; 2] {
    let axis = Point::from(geometry.axis);
    let count = geometry.nodes.len().max(1) as f64;
    let centre = geometry.nodes.iter().map(|x| Point::from(*x)).sum::<Point<3>>() / count;
    let attached = geometry.paddles.iter().filter(|p| paddles.is_empty() || paddles.contains(&p.index));
    let sum: Point<3> = attached.map(|patch| geometry.middle(&patch.triangles) - centre).sum();
    let aside = sum - axis * axis.dot(&sum);
    let side = aside.try_normalize(1e-9 * geometry.extent()).unwrap_or_else(|| geometry.orthogonal[0].into());
    let up = Vector3::z();
    let view = side - axis * TOWARDS_ENTRY + axis.cross(&side) * ASIDE + up * UPWARDS;
    let view = view.normalize();
    let up = (up - view * view.dot(&up)).try_normalize(1e-3).unwrap_or_else(|| geometry.orthogonal[1].into());
    [view, up]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometry(axis: [f64; 3], orthogonal: [[f64; 3]; 2]) -> SpaceGeometry {
        SpaceGeometry {
            name: String::new(),
            units: [String::new(), String::new()],
            nodes: Vec::new(),
            tetrahedra: Vec::new(),
            parts: Vec::new(),
            outside: Vec::new(),
            immobile: Vec::new(),
            needle: Vec::new(),
            paddles: Vec::new(),
            inclusions: Vec::new(),
            axis,
            orthogonal,
            target: [1.0, 2.0, 3.0],
        }
    }

    #[test]
    fn planes_of_a_needle_along_a_coordinate_are_those_of_coordinates() {
        let of = planes(&geometry([0.0, 0.0, -1.0], [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]));
        let names = of.each_ref().map(|plane| plane.name("mm"));
        let expected = ["y = 2 mm, along the needle", "x = 1 mm, along the needle", "z = 3 mm, across the needle"];
        assert_eq!(names.map(|name| name.replace('\u{a0}', " ")), expected);
        assert_eq!(of.each_ref().map(CutPlane::axes), [["x", "z"], ["y", "z"], ["x", "y"]]);
    }

    #[test]
    fn planes_of_any_needle_are_orthogonal_and_hold_the_target() {
        let axis = Vector3::new(1.0, -2.0, 2.0) / 3.0;
        let first = Vector3::new(2.0, 2.0, 1.0) / 3.0;
        let geometry = geometry(axis.into(), [first.into(), axis.cross(&first).into()]);
        let of = planes(&geometry);
        for (i, plane) in of.iter().enumerate() {
            assert!(plane.distance(&geometry.target.into()).abs() < 1e-12);
            let [right, up] = plane.directions;
            assert!([right.dot(&up), right.dot(&plane.normal), up.dot(&plane.normal)].iter().all(|p| p.abs() < 1e-12));
            assert!(plane.normal.dot(&of[(i + 1) % 3].normal).abs() < 1e-12);
            assert_eq!(plane.normal.dot(&axis).abs() < 1e-12, !plane.across_needle);
        }
        let [view, up] = seen_from(&geometry, &[]);
        assert!(view.dot(&up).abs() < 1e-12 && view.dot(&axis) < 0.0 && up.z > 0.0, "{view} {up}");
    }
}
