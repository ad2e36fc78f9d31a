//! Loops that half-planes have cut from a body that is not convex, tidied: cutting leaves coincident edges that run both
//! ways, through the void of a notch too, where no shape function exists.

use super::nodal_cells::Across;
use crate::geometry::{Point2, distance_to_segment};

type Corner = (Point2, Across);
/// Start, end, what lies across.
type Edge = (usize, usize, Across);

/// The same region without edges that cancel. Several pieces are joined by [`Across::Bridge`], which bounds nothing.
pub(super) fn tidied(corners: &[Corner], tolerance: f64) -> Vec<Corner> {
    let points = distinct(corners, tolerance);
    let loops = loops(cancelled(split_edges(corners, &points, tolerance)));
    let mut pieces = loops
        .into_iter()
        .map(|edges| -> Vec<Corner> { edges.into_iter().map(|(from, _, across)| (points[from], across)).collect() });
    let Some(mut joined) = pieces.next() else { return corners.to_vec() };
    let start = joined[0].0;
    for piece in pieces {
        let entry = piece[0].0;
        joined.push((start, Across::Bridge));
        joined.extend(piece);
        joined.push((entry, Across::Bridge));
    }
    joined
}

/// The corners, each once.
fn distinct(corners: &[Corner], tolerance: f64) -> Vec<Point2> {
    let mut points: Vec<Point2> = Vec::new();
    for (x, _) in corners {
        if points.iter().all(|p| (p - x).norm() > tolerance) {
            points.push(*x);
        }
    }
    points
}

/// Every edge, cut at the corners that lie on it.
fn split_edges(corners: &[Corner], points: &[Point2], tolerance: f64) -> Vec<Edge> {
    let nearest = |x: Point2| {
        (0..points.len()).min_by(|&i, &j| (points[i] - x).norm().total_cmp(&(points[j] - x).norm())).unwrap_or(0)
    };
    let mut edges = Vec::new();
    for (k, (a, across)) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()].0;
        let (from, to) = (nearest(*a), nearest(b));
        if from == to {
            continue;
        }
        let inside = |i: &usize| *i != from && *i != to && distance_to_segment(points[*i], *a, b) <= tolerance;
        let mut stations: Vec<usize> = (0..points.len()).filter(inside).collect();
        stations.sort_by(|&i, &j| (points[i] - a).norm().total_cmp(&(points[j] - a).norm()));
        let way: Vec<usize> = std::iter::once(from).chain(stations).chain([to]).collect();
        edges.extend(way.windows(2).map(|w| (w[0], w[1], *across)));
    }
    edges
}

/// The edges without pairs that run both ways.
fn cancelled(edges: Vec<Edge>) -> Vec<Edge> {
    let mut kept: Vec<Edge> = Vec::new();
    for (from, to, across) in edges {
        match kept.iter().position(|e| (e.1, e.0) == (from, to)) {
            Some(opposite) => drop(kept.remove(opposite)),
            None => kept.push((from, to, across)),
        }
    }
    kept
}

/// The edges one after another, loop by loop.
fn loops(mut edges: Vec<Edge>) -> Vec<Vec<Edge>> {
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

    fn cut(height: f64) -> Vec<Corner> {
        // A U, of which the part above `height` is two towers.
        let u = [[0., 0.], [5., 0.], [5., 4.], [3., 4.], [3., 1.], [2., 1.], [2., 4.], [0., 4.]];
        let u: Vec<Corner> = u.iter().enumerate().map(|(i, p)| (Point2::from(*p), Across::Outline(i as u32))).collect();
        let mut out = Vec::new();
        clip_half_plane(&u, Point2::new(0.0, height), Point2::new(0.0, -1.0), Across::Cell(7), &mut out);
        out
    }

    fn area(corners: &[Corner]) -> f64 {
        signed_area(&corners.iter().map(|c| c.0).collect::<Vec<_>>())
    }

    #[test]
    fn two_towers_are_two_pieces_and_no_edge_runs_through_the_void_between_them() {
        let towers = tidied(&cut(2.0), 1e-9);
        assert!((area(&towers) - 8.0).abs() < 1e-12);
        let n = towers.len();
        let bridges = towers.iter().filter(|c| c.1 == Across::Bridge).count();
        assert_eq!(bridges, 2, "{towers:?}");
        for k in 0..n {
            let (a, b) = (towers[k].0, towers[(k + 1) % n].0);
            let middle = (a + b) * 0.5;
            let void = middle.x > 2.0 && middle.x < 3.0 && middle.y > 1.0;
            assert!(!void || towers[k].1 == Across::Bridge, "{a} {b}");
        }
    }

    #[test]
    fn a_tower_cut_away_leaves_nothing_behind() {
        let mut left = Vec::new();
        clip_half_plane(&cut(2.0), Point2::new(2.5, 0.0), Point2::new(1.0, 0.0), Across::Cell(8), &mut left);
        let left = tidied(&left, 1e-9);
        assert_eq!(left.len(), 4, "{left:?}");
        assert!((area(&left) - 4.0).abs() < 1e-12 && left.iter().all(|c| c.1 != Across::Bridge));
    }
}
