//! Loops that half-planes have cut from a body that is not convex, tidied: cutting leaves coincident edges that run both
//! ways, through the void of a notch too, where no shape function exists.

use crate::geometry::{Point2, distance_to_segment};

/// A corner with the label of the edge to the next one.
type Corner<L> = (Point2, L);
/// Start, end, label.
type Edge<L> = (usize, usize, L);

/// The same region without edges that cancel. Several pieces are joined by edges labelled `bridge`, which bound nothing.
pub(super) fn tidied<L: Copy>(corners: &[Corner<L>], bridge: L, tolerance: f64) -> Vec<Corner<L>> {
    let points = distinct(corners, tolerance);
    let loops = loops(cancelled(split_edges(corners, &points, tolerance)));
    let mut pieces = loops
        .into_iter()
        .map(|edges| -> Vec<Corner<L>> { edges.into_iter().map(|(from, _, label)| (points[from], label)).collect() });
    let Some(mut joined) = pieces.next() else { return corners.to_vec() };
    let start = joined[0].0;
    for piece in pieces {
        let entry = piece[0].0;
        joined.push((start, bridge));
        joined.extend(piece);
        joined.push((entry, bridge));
    }
    joined
}

/// The corners, each once.
fn distinct<L>(corners: &[Corner<L>], tolerance: f64) -> Vec<Point2> {
    let mut points: Vec<Point2> = Vec::new();
    for (x, _) in corners {
        if points.iter().all(|p| (p - x).norm() > tolerance) {
            points.push(*x);
        }
    }
    points
}

/// Every edge, cut at the corners that lie on it.
fn split_edges<L: Copy>(corners: &[Corner<L>], points: &[Point2], tolerance: f64) -> Vec<Edge<L>> {
    let nearest = |x: Point2| {
        (0..points.len()).min_by(|&i, &j| (points[i] - x).norm().total_cmp(&(points[j] - x).norm())).unwrap_or(0)
    };
    let mut edges = Vec::new();
    for (k, (a, label)) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()].0;
        let (from, to) = (nearest(*a), nearest(b));
        if from == to {
            continue;
        }
        let inside = |i: &usize| *i != from && *i != to && distance_to_segment(points[*i], *a, b) <= tolerance;
        let mut stations: Vec<usize> = (0..points.len()).filter(inside).collect();
        stations.sort_by(|&i, &j| (points[i] - a).norm().total_cmp(&(points[j] - a).norm()));
        let way: Vec<usize> = std::iter::once(from).chain(stations).chain([to]).collect();
        edges.extend(way.windows(2).map(|w| (w[0], w[1], *label)));
    }
    edges
}

/// The edges without pairs that run both ways.
fn cancelled<L>(edges: Vec<Edge<L>>) -> Vec<Edge<L>> {
    let mut kept: Vec<Edge<L>> = Vec::new();
    for (from, to, label) in edges {
        match kept.iter().position(|e| (e.1, e.0) == (from, to)) {
            Some(opposite) => drop(kept.remove(opposite)),
            None => kept.push((from, to, label)),
        }
    }
    kept
}

/// The edges one after another, loop by loop.
fn loops<L>(mut edges: Vec<Edge<L>>) -> Vec<Vec<Edge<L>>> {
    let mut loops = Vec::new();
    while !edges.is_empty() {
        let mut walked = vec![edges.remove(0)];
        while let Some(next) = edges.iter().position(|e| e.0 == walked[walked.len() - 1].1) {
            walked.push(edges.remove(next));
            if walked[walked.len() - 1].1 == walked[0].0 {
                break;
            }
        }
        loops.push(walked);
    }
    loops
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{clip_half_plane, signed_area};

    const BRIDGE: i32 = -1;
    const CUT: i32 = 100;

    fn cut(height: f64) -> Vec<Corner<i32>> {
        // A U, of which the part above `height` is two towers.
        let u = [[0., 0.], [5., 0.], [5., 4.], [3., 4.], [3., 1.], [2., 1.], [2., 4.], [0., 4.]];
        let u: Vec<Corner<i32>> = u.iter().enumerate().map(|(i, p)| (Point2::from(*p), i as i32)).collect();
        let mut out = Vec::new();
        clip_half_plane(&u, Point2::new(0.0, height), Point2::new(0.0, -1.0), 7 + CUT, &mut out);
        out
    }

    fn area(corners: &[Corner<i32>]) -> f64 {
        signed_area(&corners.iter().map(|c| c.0).collect::<Vec<_>>())
    }

    #[test]
    fn two_towers_are_two_pieces_and_no_edge_runs_through_the_void_between_them() {
        let towers = tidied(&cut(2.0), BRIDGE, 1e-9);
        assert!((area(&towers) - 8.0).abs() < 1e-12);
        let n = towers.len();
        let bridges = towers.iter().filter(|c| c.1 == BRIDGE).count();
        assert_eq!(bridges, 2, "{towers:?}");
        for k in 0..n {
            let (a, b) = (towers[k].0, towers[(k + 1) % n].0);
            let middle = (a + b) * 0.5;
            let void = middle.x > 2.0 && middle.x < 3.0 && middle.y > 1.0;
            assert!(!void || towers[k].1 == BRIDGE, "{a} {b}");
        }
    }

    #[test]
    fn a_tower_cut_away_leaves_nothing_behind() {
        let mut left = Vec::new();
        clip_half_plane(&cut(2.0), Point2::new(2.5, 0.0), Point2::new(1.0, 0.0), 8 + CUT, &mut left);
        let left = tidied(&left, BRIDGE, 1e-9);
        assert_eq!(left.len(), 4, "{left:?}");
        assert!((area(&left) - 4.0).abs() < 1e-12 && left.iter().all(|c| c.1 != BRIDGE));
    }
}
