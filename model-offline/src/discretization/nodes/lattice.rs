//! Nodes on a lattice, fitted to the outline and to every feature.

use super::features::Features;
use crate::geometry::{Location, Point2, Polygon, distance_to_segment};

/// Lattice nodes nearer to a feature point than this fraction of the spacing give way to it: two kernels almost on
/// top of each other add cost and ill-conditioning, and nothing else.
const CLEARANCE: f64 = 0.25;
/// A straight feature whose nodes are farther apart than this many spacings gets nodes of its own. The diagonal of a
/// lattice square is √2 spacings: lattice diagonals are left as they are.
const MAX_GAP: f64 = 1.5;

/// Nodes of the given spacing: lattice points inside or on the outline (the lattice starts at the lower left corner of
/// the bounding box), feature points that the lattice misses, and nodes along outline edges that it does not follow.
pub fn lattice_nodes(features: &Features, spacing: f64) -> Vec<Point2> {
    fitted(&features.outline, spacing, &features.points(), &features.segments())
}

/// The same with nodes on the outlines of inclusions too, so that edges of triangles can follow them; lattice nodes too
/// near to give triangles of any height give way.
pub fn lattice_nodes_on_interfaces(features: &Features, spacing: f64) -> Vec<Point2> {
    let tolerance = 1e-9 * features.outline.size();
    let inside = |p: &Point2| features.outline.locate(*p, tolerance) != Location::Outside;
    let interfaces: Vec<(Point2, Point2)> =
        features.inclusions.iter().flat_map(Polygon::edges).filter(|(a, b)| inside(a) && inside(b)).collect();
    let mut points = features.points();
    points.extend(interfaces.iter().map(|edge| edge.0));
    let own = features.segments();
    let mut nodes = fitted(&features.outline, spacing, &points, &[own.clone(), interfaces.clone()].concat());
    nodes.retain(|x| {
        let to = |(a, b): &(Point2, Point2)| distance_to_segment(*x, *a, *b);
        let to_interface = interfaces.iter().map(to).fold(f64::INFINITY, f64::min);
        let clear = to_interface <= tolerance || to_interface >= CLEARANCE * spacing;
        clear || points.iter().any(|p| (p - x).norm() <= tolerance) || own.iter().any(|edge| to(edge) <= tolerance)
    });
    nodes
}

/// Lattice nodes that give way to `points`, with nodes along `segments` where the lattice leaves gaps.
fn fitted(outline: &Polygon, spacing: f64, points: &[Point2], segments: &[(Point2, Point2)]) -> Vec<Point2> {
    let tolerance = 1e-9 * outline.size();
    let (low, high) = outline.bounds();
    let count = |extent: f64| (extent / spacing + 1e-9).floor() as usize + 1;
    let (columns, rows) = (count(high.x - low.x), count(high.y - low.y));
    let mut nodes: Vec<Point2> = (0..columns * rows)
        .map(|n| low + Point2::new((n % columns) as f64, (n / columns) as f64) * spacing)
        .filter(|p| outline.locate(*p, tolerance) != Location::Outside)
        .collect();

    let mut fixed: Vec<Point2> = Vec::new();
    for &p in points {
        let snap = |nodes: &mut [Point2]| match nodes.iter_mut().find(|x| (**x - p).norm() <= tolerance) {
            // The feature's own digits, not the lattice's: 3 × 0.1 is not 0.3.
            Some(x) => {
                *x = p;
                true
            }
            None => false,
        };
        if !snap(&mut nodes) && !snap(&mut fixed) {
            fixed.push(p);
        }
    }
    for &segment in segments {
        fill_gaps(segment, spacing, tolerance, &nodes, &mut fixed);
    }
    nodes.retain(|x| {
        let is_feature = points.iter().any(|f| (f - x).norm() <= tolerance);
        is_feature || fixed.iter().all(|f| (f - x).norm() >= CLEARANCE * spacing)
    });
    nodes.extend(fixed);
    nodes
}

/// Adds evenly spaced nodes where those on the segment from `a` to `b` leave a gap.
fn fill_gaps((a, b): (Point2, Point2), spacing: f64, tolerance: f64, nodes: &[Point2], fixed: &mut Vec<Point2>) {
    let length = (b - a).norm();
    let direction = (b - a) / length;
    let mut stations: Vec<f64> = nodes
        .iter()
        .chain(fixed.iter())
        .filter(|x| distance_to_segment(**x, a, b) <= tolerance)
        .map(|x| (x - a).dot(&direction))
        .collect();
    stations.sort_by(f64::total_cmp);
    for pair in stations.windows(2) {
        let gap = pair[1] - pair[0];
        if gap > MAX_GAP * spacing {
            let pieces = (gap / spacing).round().max(2.0);
            fixed.extend((1..pieces as usize).map(|k| a + direction * (pair[0] + gap * k as f64 / pieces)));
        }
    }
}
