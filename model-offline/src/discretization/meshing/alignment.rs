//! Where the lattice lies, so that planes across the axes fall on its planes.

use super::features::Features;
use super::lattice::Placement;
use crate::geometry::{Point, Sheet};

/// Spacings below this part of the wanted size would have all of the lattice fine: such planes are left to snapping.
const TOO_FINE: f64 = 0.35;
/// Odd numbers of lattice spacings that a common divisor of the coordinates may be cut into.
const DIVISIONS: [u32; 5] = [1, 3, 5, 7, 9];

/// A plane across an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisPlane {
    /// The axis.
    pub(super) axis: usize,
    /// Its coordinate there, length units.
    pub(super) at: f64,
    /// Whose sheet it is.
    pub(super) owner: usize,
}

/// Planes across the axes among all sheets and carriers.
pub(super) fn axis_planes(features: &Features<'_>) -> Vec<AxisPlane> {
    let mut planes = Vec::new();
    for (owner, o) in features.owners.iter().enumerate() {
        for k in o.sheets.iter().chain(&o.carrier) {
            let Sheet::Plane { normal, offset } = &features.sheets[usize::from(*k)] else { continue };
            let axis = normal.iamax();
            if normal[axis].abs() == 1.0 {
                planes.push(AxisPlane { axis, at: offset * normal[axis], owner });
            }
        }
    }
    planes
}

/// Places a root cube round `bounds` so that `planes` fall on lattice planes if they are commensurate, or else those
/// of the body. Leaves are the root halved over and over; some halving is about `size` (length units) wide.
pub(super) fn place(bounds: (Point<3>, Point<3>), planes: &[AxisPlane], size: f64) -> Placement {
    let (low, high) = bounds;
    let extent = (high - low).max();
    let tolerance = 1e-9 * extent;
    let inside = |p: &&AxisPlane| p.at >= low[p.axis] - tolerance && p.at <= high[p.axis] + tolerance;
    let planes: Vec<AxisPlane> = planes.iter().filter(inside).copied().collect();
    let of_body: Vec<AxisPlane> = planes.iter().filter(|p| p.owner == 0).copied().collect();
    let usable = |planes: &[AxisPlane]| common_spacing(planes, tolerance).filter(|g| *g >= TOO_FINE * size);
    let (spacing, anchors) = match (usable(&planes), usable(&of_body)) {
        (Some(g), _) => (divide(g, size), &planes),
        (None, Some(g)) => (divide(g, size), &of_body),
        (None, None) => (size, if of_body.is_empty() { &planes } else { &of_body }),
    };
    // Twice the extent leaves margins of more than an eighth of the root on all sides.
    let side = spacing * 2.0_f64.powi((2.0 * extent / spacing).log2().ceil().max(2.0) as i32);
    let origin = Point::from_fn(|k, _| {
        let start = 0.5 * (low[k] + high[k] - side);
        // Moved by whole eighths from an anchor: leaves up to that size have it on their planes.
        let anchor = anchors.iter().filter(|p| p.axis == k).map(|p| p.at).reduce(f64::min);
        anchor.map_or(start, |a| a - ((a - start) / (side / 8.0)).round() * (side / 8.0))
    });
    Placement { origin, side }
}

/// The largest spacing of which all distances between planes of one axis are multiples; none if there are no
/// distances.
fn common_spacing(planes: &[AxisPlane], tolerance: f64) -> Option<f64> {
    let mut spacing = 0.0_f64;
    for axis in 0..3 {
        let mut along: Vec<f64> = planes.iter().filter(|p| p.axis == axis).map(|p| p.at).collect();
        along.sort_by(f64::total_cmp);
        for pair in along.windows(2) {
            spacing = divisor(spacing, pair[1] - pair[0], tolerance);
        }
    }
    (spacing > 0.0).then_some(spacing)
}

/// Euclid's greatest common divisor of lengths, blind to `tolerance`.
fn divisor(a: f64, b: f64, tolerance: f64) -> f64 {
    let (mut a, mut b) = (a.max(b), a.min(b));
    while b > tolerance {
        let rest = a - (a / b).round() * b;
        (a, b) = (b, rest.abs());
    }
    a
}

/// An odd part of `spacing` that comes closest to `size` when halved or doubled.
fn divide(spacing: f64, size: f64) -> f64 {
    let miss = |m: u32| {
        let octaves = (spacing / f64::from(m) / size).log2();
        // Rather a few divisions: that leaves more planes to coarse leaves.
        (octaves - octaves.round()).abs() + 0.01 * f64::from(m)
    };
    let best = DIVISIONS.into_iter().filter(|m| spacing / f64::from(*m) > 0.7 * size || *m == 1);
    let m = best.min_by(|a, b| miss(*a).total_cmp(&miss(*b))).unwrap_or(1);
    spacing / f64::from(m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commensurate_planes_fall_on_lattice_planes() {
        let at = [0.0, 0.2, 0.30000000000000004, 0.7, 1.0];
        let planes: Vec<AxisPlane> = (0..3).flat_map(|axis| at.map(|at| AxisPlane { axis, at, owner: 0 })).collect();
        let placement = place((Point::zeros(), Point::repeat(1.0)), &planes, 0.1);
        for p in &planes {
            let steps = (p.at - placement.origin[p.axis]) / 0.1;
            assert!((steps - steps.round()).abs() < 1e-9, "{p:?} {placement:?}");
        }
        let leaf = (placement.side / 0.1).log2();
        assert!((leaf - leaf.round()).abs() < 1e-9);
    }
}
