//! Polygons of surfaces, cut into triangles.

use crate::geometry::Point;
use nalgebra::{Vector2, Vector3};
use std::ops::Range;

/// Polygons of more corners stay fans: looking for ears takes the square of their number and more.
const MOST_CORNERS: usize = 1000;
/// Sine of an angle that is none but for rounding.
const STRAIGHT: f64 = 1e-9;
/// Of so many ears the best is cut.
const COMPARED: usize = 8;

/// Cuts polygons that stand among `triangles` as fans around their first corners (`fans`, where each is) anew where that would
/// leave them, because they are not convex: ear by ear (Meisters 1975), on the plane that they are nearest to. Says in a
/// sentence what became of all; none where there are no polygons.
pub(super) fn cut(vertices: &[Point<3>], triangles: &mut [[u32; 3]], fans: &[Range<usize>]) -> Option<String> {
    let mut by_ears = 0;
    for fan in fans {
        let fan = &mut triangles[fan.clone()];
        let corners: Vec<u32> = [fan[0][0], fan[0][1]].into_iter().chain(fan.iter().map(|t| t[2])).collect();
        if let Some(cut) = ears(vertices, &corners) {
            fan.copy_from_slice(&cut);
            by_ears += 1;
        }
    }
    let others = if by_ears > 0 { format!(", {by_ears} that are not convex ear by ear") } else { String::new() };
    (!fans.is_empty())
        .then(|| format!("{} polygons were cut into triangles around their first corners{others}", fans.len()))
}

/// The triangles of a polygon whose fan does not cover it alone; none where the fan does, or where there are no ears either,
/// because it meets itself.
fn ears(vertices: &[Point<3>], corners: &[u32]) -> Option<Vec<[u32; 3]>> {
    let places: Vec<Vector3<f64>> =
        corners.iter().map(|&c| vertices[c as usize] - vertices[corners[0] as usize]).collect();
    // Newell's normal: twice the area, whatever the shape.
    let normal: Vector3<f64> = places.windows(2).map(|pair| pair[0].cross(&pair[1])).sum();
    let is_fan = places[1..].windows(2).all(|pair| {
        let least = STRAIGHT * pair[0].norm() * pair[1].norm() * normal.norm();
        pair[0].cross(&pair[1]).dot(&normal) > least
    });
    if is_fan || corners.len() > MOST_CORNERS {
        return None;
    }
    let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).try_normalize(0.0)?;
    let up = normal.cross(&across).try_normalize(0.0)?;
    let flat: Vec<Vector2<f64>> = places.iter().map(|x| Vector2::new(x.dot(&across), x.dot(&up))).collect();
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    while left.len() > 3 {
        let count = left.len();
        let of = |k: usize| [left[(k + count - 1) % count], left[k], left[(k + 1) % count]];
        // One beside a corner on a line, which would be left to a triangle without area, and then a fat one.
        let straight = |k: usize| is_straight(&of(k % count).map(|i| flat[i]));
        let key = |k: usize| {
            let beside = [k + count - 1, k + 1].into_iter().filter(|k| straight(*k)).count();
            (beside, turn(&of(k).map(|i| flat[i])))
        };
        let ears = (0..count).filter(|&k| is_ear(&flat, &left, of(k))).take(COMPARED);
        let ear = ears.max_by(|&a, &b| {
            let [(beside_a, area_a), (beside_b, area_b)] = [key(a), key(b)];
            beside_a.cmp(&beside_b).then(area_a.total_cmp(&area_b))
        })?;
        triangles.push(of(ear).map(|i| corners[i]));
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]].map(|i| corners[i]));
    Some(triangles)
}

/// Twice the area of a triangle, positive where it turns to the left.
fn turn([a, b, c]: &[Vector2<f64>; 3]) -> f64 {
    (b - a).perp(&(c - a))
}

/// Whether three corners are on a line, but for rounding.
fn is_straight(corners: &[Vector2<f64>; 3]) -> bool {
    let [a, b, c] = corners;
    turn(corners).abs() <= STRAIGHT * (b - a).norm() * (c - b).norm()
}

/// Whether a triangle of three corners that follow each other lies in the polygon, and no other corner in it.
fn is_ear(flat: &[Vector2<f64>], left: &[usize], ear: [usize; 3]) -> bool {
    let corners = ear.map(|i| flat[i]);
    let [a, b, c] = corners;
    // A corner on an edge would leave a triangle without area.
    let is_left =
        |p: Vector2<f64>, [a, b]: [Vector2<f64>; 2]| turn(&[a, b, p]) >= -STRAIGHT * (b - a).norm() * (p - a).norm();
    let inside = |p: Vector2<f64>| [[a, b], [b, c], [c, a]].into_iter().all(|edge| is_left(p, edge));
    turn(&corners) > 0.0 && !is_straight(&corners) && !left.iter().any(|i| !ear.contains(i) && inside(flat[*i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of a polygon in a tilted plane, cut from whichever corner it begins with.
    fn areas(outline: &[[f64; 2]], first: usize) -> Vec<f64> {
        let (e, f) = (Vector3::new(1.0, 2.0, 2.0) / 3.0, Vector3::new(2.0, 1.0, -2.0) / 3.0);
        let vertices: Vec<Point<3>> =
            outline.iter().map(|[x, y]| e * *x + f * *y + Vector3::new(5.0, -7.0, 3.0)).collect();
        let corner = |k: usize| ((first + k) % outline.len()) as u32;
        let mut triangles: Vec<[u32; 3]> =
            (1..outline.len() - 1).map(|k| [corner(0), corner(k), corner(k + 1)]).collect();
        let fan = 0..triangles.len();
        assert!(cut(&vertices, &mut triangles, std::slice::from_ref(&fan)).is_some());
        let signed = |[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|i| vertices[*i as usize]);
            (b - a).cross(&(c - a)).dot(&e.cross(&f)) / 2.0
        };
        triangles.iter().map(signed).collect()
    }

    #[test]
    fn a_polygon_that_is_not_convex_is_covered_once() {
        let l = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        // Corners on a line, and a comb, whose teeth only ears reach.
        let lined = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let comb = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        for (outline, area) in [(&l[..], 4.0), (&lined[..], 4.0), (&comb[..], 11.0)] {
            for first in 0..outline.len() {
                let areas = areas(outline, first);
                assert!(areas.iter().all(|part| *part > 0.0), "{area}, from {first}: {areas:?}");
                assert!((areas.iter().sum::<f64>() - area).abs() < 1e-12, "{area}, from {first}: {areas:?}");
            }
        }
    }

    #[test]
    fn what_is_convex_or_meets_itself_stays_a_fan() {
        let of = |outline: &[[f64; 2]]| {
            let vertices: Vec<Point<3>> = outline.iter().map(|[x, y]| Point::<3>::new(*x, *y, 0.0)).collect();
            ears(&vertices, &(0..outline.len() as u32).collect::<Vec<_>>())
        };
        assert_eq!(of(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]), None);
        // A bow tie, whose halves cancel.
        assert_eq!(of(&[[0.0, 0.0], [2.0, 1.0], [2.0, 0.0], [0.0, 1.0]]), None);
    }
}
