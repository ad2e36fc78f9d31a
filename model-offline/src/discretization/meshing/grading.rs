//! Sizes of elements that grow with the distance from points.

use crate::geometry::Point;
use rstar::RTree;

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

    /// The size wanted at a point: min(coarsest, min over points of their size + growth · distance), length units.
    pub fn size(&self, x: &Point<3>) -> f64 {
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
            assert!((grading.size(&x) - expected).abs() < 1e-14);
        }
    }
}
