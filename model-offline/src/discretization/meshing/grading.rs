//! Sizes of elements that grow with the distance from points.

use super::request::Sizes;
use crate::geometry::Point;
use rstar::{AABB, RTree};

/// A size function: the finest at given points, growing with the distance from them up to the coarsest.
#[derive(Debug, Clone)]
pub struct Grading {
    coarsest: f64,
    growth: f64,
    /// Points by the size wanted there, the finest first.
    groups: Vec<(f64, RTree<[f64; 3]>)>,
}

impl Grading {
    /// Sizes of at most `coarsest` (length units) that grow by `growth` per length unit.
    pub fn new(coarsest: f64, growth: f64) -> Self {
        Self { coarsest, growth, groups: Vec::new() }
    }

    /// The same with points where `size` (length units) is wanted.
    #[must_use]
    pub fn with(mut self, points: &[Point<3>], size: f64) -> Self {
        if !points.is_empty() {
            let at = self.groups.partition_point(|(h, _)| *h < size);
            self.groups.insert(at, (size, RTree::bulk_load(points.iter().map(|p| [p.x, p.y, p.z]).collect())));
        }
        self
    }

    /// The most that is wanted anywhere, length units.
    pub fn coarsest(&self) -> f64 {
        self.coarsest
    }
}

impl Sizes for Grading {
    /// min(coarsest, min over points of their size + growth · distance).
    fn at(&self, x: &Point<3>) -> f64 {
        let mut smallest = self.coarsest;
        for (size, points) in &self.groups {
            // Those that follow ask for more even at their points.
            if *size >= smallest {
                break;
            }
            if let Some(p) = points.nearest_neighbor(&[x.x, x.y, x.z]) {
                smallest = smallest.min(size + self.growth * (Point::from(*p) - x).norm());
            }
        }
        smallest
    }

    fn want_less(&self, size: f64, centre: &Point<3>, half: f64) -> bool {
        if self.coarsest < size {
            return true;
        }
        let outside = |p: &[f64; 3]| Point::<3>::from_fn(|k, _| ((p[k] - centre[k]).abs() - half).max(0.0)).norm();
        self.groups.iter().take_while(|(own, _)| *own < size).any(|(own, points)| {
            let reach = (size - own) / self.growth;
            let far = Point::<3>::repeat(half + reach);
            let around = AABB::from_corners((centre - far).into(), (centre + far).into());
            points.locate_in_envelope_intersecting(&around).any(|p| outside(p) < reach)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_is_that_of_the_definition() {
        let points = |n: usize, seed: f64| -> Vec<Point<3>> {
            let at = |i: usize| seed + i as f64;
            (0..n).map(|i| Point::<3>::new(at(i).sin(), (1.7 * at(i)).cos(), (2.3 * at(i)).sin())).collect()
        };
        let (a, b) = (points(20, 0.1), points(5, 0.7));
        let grading = Grading::new(0.5, 0.4).with(&a, 0.2).with(&b, 0.05);
        for x in points(100, 0.33) {
            let nearest = |all: &[Point<3>]| all.iter().map(|p| (p - x).norm()).fold(f64::INFINITY, f64::min);
            let expected = (0.2 + 0.4 * nearest(&a)).min(0.05 + 0.4 * nearest(&b)).min(0.5);
            assert!((grading.at(&x) - expected).abs() < 1e-14);
        }
    }

    /// A point between the corners of a cube is seen, and the distance from the cube counted, not from its middle.
    #[test]
    fn what_a_cube_wants_is_the_least_of_its_points() {
        let grading = Grading::new(0.5, 0.4).with(&[Point::<3>::new(0.02, -0.01, 0.99)], 0.05);
        let mut decided = [0; 2];
        for i in 0..400 {
            let at = |k: f64| 1.5 * (k * f64::from(i)).sin();
            let (centre, half) = (Point::<3>::new(at(1.1), at(2.3), at(3.7)), 0.05 + 0.3 * at(0.7).abs());
            // 9³ points of the cube, none farther than this from any of it.
            let (steps, near) = (8_i32, 0.4 * half * 3.0_f64.sqrt() / 8.0);
            let step = |i: i32| half * f64::from(2 * i - steps) / f64::from(steps);
            let all = || (0..=steps).flat_map(|a| (0..=steps).flat_map(move |b| (0..=steps).map(move |c| [a, b, c])));
            let least = all().map(|s| grading.at(&(centre + Point::from(s.map(step))))).fold(f64::INFINITY, f64::min);
            for size in [0.06, 0.1, 0.2, 0.3, 0.45, 0.6] {
                if grading.want_less(size, &centre, half) {
                    assert!(least - near < size, "{centre:?} {half}: {least} is not below {size}");
                    decided[0] += 1;
                } else {
                    assert!(least >= size, "{centre:?} {half}: {least} is below {size}");
                    decided[1] += 1;
                }
            }
        }
        assert!(decided.iter().all(|n| *n > 300), "{decided:?}");
    }
}
