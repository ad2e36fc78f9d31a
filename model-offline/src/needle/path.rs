//! The cut: the material points that the tip has passed.

use crate::geometry::Point2;

/// A polyline through the undeformed body, from the entry on.
#[derive(Debug, Clone)]
pub(super) struct CutPath {
    corners: Vec<(f64, Point2)>,
}

impl CutPath {
    /// No cut yet.
    pub(super) fn from(entry: Point2) -> Self {
        Self { corners: vec![(0.0, entry)] }
    }

    /// Its length.
    pub(super) fn length(&self) -> f64 {
        self.corners[self.corners.len() - 1].0
    }

    /// The material point at an arc length; behind the end straight on along `ahead`.
    pub(super) fn at(&self, arc_length: f64, ahead: Point2) -> Point2 {
        let next = self.corners.partition_point(|corner| corner.0 < arc_length);
        let (s1, x1) = match self.corners.get(next) {
            Some(corner) => *corner,
            None => {
                let (length, end) = self.corners[self.corners.len() - 1];
                return end + ahead * (arc_length - length);
            }
        };
        let Some(&(s0, x0)) = next.checked_sub(1).and_then(|k| self.corners.get(k)) else { return x1 };
        x0 + (x1 - x0) * ((arc_length - s0) / (s1 - s0))
    }

    /// Cuts on to the material point at an arc length, where that is ahead.
    pub(super) fn cut_to(&mut self, arc_length: f64, point: Point2) {
        if arc_length > self.length() {
            self.corners.push((arc_length, point));
        }
    }
}

/// ∫ of every hat function of the `stations` (ascending) over [from, to], which they end with; before the first one its
/// own value counts on.
pub(super) fn hat_integrals(stations: &[f64], from: f64, to: f64) -> Vec<f64> {
    let mut sums = vec![0.0; stations.len()];
    if let Some(&first) = stations.first() {
        sums[0] += (first.min(to) - from).max(0.0);
    }
    for (k, pair) in stations.windows(2).enumerate() {
        let (low, high) = (pair[0].max(from), pair[1].min(to));
        if high > low {
            // The hats are linear: their middle value counts.
            let share = (0.5 * (low + high) - pair[0]) / (pair[1] - pair[0]);
            sums[k] += (1.0 - share) * (high - low);
            sums[k + 1] += share * (high - low);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_share_every_length_and_keep_its_centre() {
        let stations = [0.0, 0.1, 0.25, 0.3, 0.7];
        for (from, to) in [(0.0, 0.7), (0.05, 0.7), (0.26, 0.29), (0.28, 0.7)] {
            let sums = hat_integrals(&stations, from, to);
            let total: f64 = sums.iter().sum();
            let moment: f64 = sums.iter().zip(stations).map(|(sum, s)| sum * s).sum();
            assert!((total - (to - from)).abs() < 1e-14);
            assert!((moment - 0.5 * (to * to - from * from)).abs() < 1e-14);
        }
        let sums = hat_integrals(&[0.25, 0.5], 0.0, 0.5);
        assert_eq!(sums, [0.375, 0.125]);
    }

    #[test]
    fn a_cut_remembers_where_it_went() {
        let mut path = CutPath::from(Point2::new(1.0, 1.0));
        let (down, right) = (Point2::new(0.0, -1.0), Point2::new(1.0, 0.0));
        path.cut_to(0.5, Point2::new(1.0, 0.5));
        path.cut_to(0.3, Point2::new(7.0, 7.0));
        path.cut_to(0.75, Point2::new(1.25, 0.5));
        assert_eq!(path.length(), 0.75);
        assert_eq!(path.at(0.25, right), Point2::new(1.0, 0.75));
        assert_eq!(path.at(0.625, down), Point2::new(1.125, 0.5));
        assert_eq!(path.at(1.0, right), Point2::new(1.5, 0.5));
        assert_eq!(path.at(0.0, right), Point2::new(1.0, 1.0));
    }
}
