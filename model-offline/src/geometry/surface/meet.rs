//! Whether two triangles cut or touch each other beside what they share.

use crate::geometry::point::Point;

/// Rounding of a determinant of differences, part of its permanent (Shewchuk 1997, bound A of orient3d).
const ROUNDING: f64 = 7.8e-16;
/// Overlaps in a plane narrower than this part of the triangles' size are rounding.
const NARROW: f64 = 1e-12;

/// A point that both triangles have, beside corners and edges that they share; none where they do not meet.
///
/// `shared` says which corners of the first are corners of the second.
pub(super) fn meeting_point(a: &[Point<3>; 3], b: &[Point<3>; 3], shared: &[(usize, usize)]) -> Option<Point<3>> {
    match shared {
        [] => {
            let first = edges(a).iter().find_map(|[p, q]| crossing(p, q, b));
            first.or_else(|| edges(b).iter().find_map(|[p, q]| crossing(p, q, a))).or_else(|| overlap(a, b))
        }
        [(i, j)] => {
            let [p, q] = opposite(a, *i);
            let [r, s] = opposite(b, *j);
            crossing(&p, &q, b).or_else(|| crossing(&r, &s, a)).or_else(|| overlap(a, b))
        }
        // Two triangles at an edge meet elsewhere only where one is folded onto the other.
        [_, _] => overlap(a, b),
        _ => Some((a[0] + a[1] + a[2]) / 3.0),
    }
}

fn edges(t: &[Point<3>; 3]) -> [[Point<3>; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
}

fn opposite(t: &[Point<3>; 3], corner: usize) -> [Point<3>; 2] {
    [t[(corner + 1) % 3], t[(corner + 2) % 3]]
}

/// On which side of the plane of three points a fourth lies, times six times the volume between them; zero where
/// rounding could have made it.
fn side(a: &Point<3>, b: &Point<3>, c: &Point<3>, d: &Point<3>) -> f64 {
    let (u, v, w) = (a - d, b - d, c - d);
    let determinant = u.dot(&v.cross(&w));
    let (u, v, w) = (u.abs(), v.abs(), w.abs());
    let permanent = u.x * (v.y * w.z + v.z * w.y) + u.y * (v.z * w.x + v.x * w.z) + u.z * (v.x * w.y + v.y * w.x);
    if determinant.abs() <= ROUNDING * permanent { 0.0 } else { determinant }
}

/// Where the segment from p to q goes through the triangle or ends within it.
fn crossing(p: &Point<3>, q: &Point<3>, t: &[Point<3>; 3]) -> Option<Point<3>> {
    let [a, b, c] = t;
    let (above, below) = (side(a, b, c, p), side(a, b, c, q));
    if above * below > 0.0 || (above == 0.0 && below == 0.0) {
        return None;
    }
    let around = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
    let within = if above == 0.0 || below == 0.0 {
        // An end that only touches an edge or a corner from outside is no cut.
        around.iter().all(|s| *s > 0.0) || around.iter().all(|s| *s < 0.0)
    } else {
        around.iter().all(|s| *s >= 0.0) || around.iter().all(|s| *s <= 0.0)
    };
    within.then(|| p + (q - p) * (above / (above - below)))
}

/// A point inside the overlap of two triangles of one plane.
fn overlap(a: &[Point<3>; 3], b: &[Point<3>; 3]) -> Option<Point<3>> {
    if b.iter().any(|x| side(&a[0], &a[1], &a[2], x) != 0.0) {
        return None;
    }
    let normal = (a[1] - a[0]).cross(&(a[2] - a[0])).normalize();
    let size = edges(a).iter().chain(&edges(b)).map(|[p, q]| (q - p).norm()).fold(0.0, f64::max);
    // What of the first is within every edge of the second.
    let turned = (b[1] - b[0]).cross(&(b[2] - b[0])).dot(&normal).signum();
    let mut kept = a.to_vec();
    for [p, q] in edges(b) {
        let inwards = normal.cross(&(q - p)).normalize() * turned;
        let depth = |x: &Point<3>| (x - p).dot(&inwards);
        if kept.iter().all(|x| depth(x) <= NARROW * size) {
            return None;
        }
        let next = kept.iter().cycle().skip(1);
        let pairs: Vec<(Point<3>, Point<3>)> = kept.iter().copied().zip(next.copied()).take(kept.len()).collect();
        kept.clear();
        for (x, y) in pairs {
            let (from, to) = (depth(&x), depth(&y));
            if from >= 0.0 {
                kept.push(x);
            }
            if from * to < 0.0 {
                kept.push(x + (y - x) * (from / (from - to)));
            }
        }
    }
    // Width of what is left, across its longest way.
    let (first, area) = (kept[0], |p: &Point<3>, q: &Point<3>, r: &Point<3>| (q - p).cross(&(r - p)).norm() * 0.5);
    let total: f64 = kept.windows(2).map(|pair| area(&first, &pair[0], &pair[1])).sum();
    (total > NARROW * size * size).then(|| kept.iter().sum::<Point<3>>() / kept.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn turned(t: [[f64; 3]; 3], shift: f64) -> [Point<3>; 3] {
        let turn = Rotation3::from_euler_angles(0.4, -1.2, 2.2);
        t.map(|x| turn * Point::<3>::from(x) + Point::<3>::repeat(shift))
    }

    /// A star of two triangles in a plane: no corner is inside of the other, and no edge goes through it.
    #[test]
    fn triangles_of_one_plane_overlap_in_a_point_of_both() {
        let up = [[0.0, 2.0, 1.0], [-2.0, -1.0, 1.0], [2.0, -1.0, 1.0]];
        let down = up.map(|[x, y, z]| [x, -y, z]);
        for shift in [0.0, 3.0] {
            let (a, b) = (turned(up, shift), turned(down, shift));
            let at = meeting_point(&a, &b, &[]).unwrap() - turned([[0.0, 0.0, 1.0]; 3], shift)[0];
            assert!(at.norm() < 1.0, "{at}");
            let apart = turned(down.map(|[x, y, z]| [x + 5.0, y, z]), shift);
            assert_eq!(meeting_point(&a, &apart, &[]), None);
            let above = turned(down.map(|[x, y, z]| [x, y, z + 1e-9]), shift);
            assert_eq!(meeting_point(&a, &above, &[]), None);
        }
    }

    #[test]
    fn neighbours_meet_only_where_one_is_folded_onto_the_other() {
        let [a, b] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let to = |x: [f64; 3]| {
            meeting_point(&turned([a, b, [0.3, 1.0, 0.0]], 0.0), &turned([b, a, x], 0.0), &[(0, 1), (1, 0)])
        };
        assert_eq!(to([0.6, -1.0, 0.0]), None, "side by side");
        assert_eq!(to([0.6, 1.0, 1e-6]), None, "nearly folded");
        assert!(to([0.6, 1.0, 0.0]).is_some(), "folded");
        // With one corner in common: beside each other, on each other, through each other.
        let at = |x: [f64; 3], y: [f64; 3]| {
            meeting_point(&turned([a, b, [0.0, 1.0, 0.0]], 0.0), &turned([a, x, y], 0.0), &[(0, 0)])
        };
        assert_eq!(at([-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]), None);
        assert_eq!(at([0.3, 0.3, 1.0], [0.3, 0.2, 2.0]), None);
        assert!(at([2.0, 1.0, 0.0], [1.0, 2.0, 0.0]).is_some());
        assert!(at([0.3, 0.3, 1.0], [0.3, 0.3, -1.0]).is_some());
    }
}
