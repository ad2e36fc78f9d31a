//! Where values lie on the paper, and what of a line lies within the axes.

use super::axis::Settled;
use super::drawing::Px;

/// Two settled axes and the rectangle between them.
#[derive(Clone, Debug)]
pub(super) struct PlotArea {
    pub(super) x: Settled,
    pub(super) y: Settled,
    /// Upper left corner, px.
    pub(super) corner: Px,
    /// Width and height, px.
    pub(super) size: Px,
    /// Height of the band above the rectangle that holds failures without a value; 0 where there are none, px.
    pub(super) band: f64,
}

impl PlotArea {
    pub(super) fn right(&self) -> f64 {
        self.corner[0] + self.size[0]
    }

    pub(super) fn bottom(&self) -> f64 {
        self.corner[1] + self.size[1]
    }

    /// Upper edge of the whole, with the band.
    pub(super) fn top(&self) -> f64 {
        self.corner[1] - self.band
    }

    /// Fractions along both axes, y up.
    fn fractions(&self, (x, y): (f64, f64)) -> Px {
        [self.x.fraction(x), self.y.fraction(y)]
    }

    fn paper(&self, [u, v]: Px) -> Px {
        [self.corner[0] + self.size[0] * u, self.corner[1] + self.size[1] * (1.0 - v)]
    }

    /// A point on the paper, if it lies within the axes.
    pub(super) fn place(&self, point: (f64, f64)) -> Option<Px> {
        let f = self.fractions(point);
        f.iter().all(|t| (-1e-9..=1.0 + 1e-9).contains(t)).then(|| self.paper(f))
    }

    /// Places along the axes, the nearest end for what is beyond; not finite where there is none.
    pub(super) fn clamped(&self, point: (f64, f64)) -> Px {
        self.paper(self.fractions(point).map(|t| t.clamp(0.0, 1.0)))
    }

    /// A failure's place: without a height in the band, without an abscissa at the right end.
    pub(super) fn failure(&self, point: (f64, f64)) -> Px {
        let f = self.fractions(point);
        let [x, y] = self.paper(f.map(|t| if t.is_finite() { t.clamp(0.0, 1.0) } else { 1.0 }));
        [x, if f[1].is_finite() { y } else { self.corner[1] - 0.5 * self.band }]
    }

    /// The pieces of a line through points that lie within the axes.
    pub(super) fn pieces(&self, points: &[(f64, f64)]) -> Vec<Vec<Px>> {
        let mut pieces: Vec<Vec<Px>> = Vec::new();
        let mut joined = false;
        for pair in points.windows(2) {
            let (a, b) = (self.fractions(pair[0]), self.fractions(pair[1]));
            let finite = a.iter().chain(&b).all(|t| t.is_finite());
            let Some((start, end)) = (if finite { clip(a, b) } else { None }) else {
                joined = false;
                continue;
            };
            match pieces.last_mut().filter(|_| joined && start == a) {
                Some(piece) => piece.push(self.paper(end)),
                None => pieces.push(vec![self.paper(start), self.paper(end)]),
            }
            joined = end == b;
        }
        pieces
    }
}

/// The part of a straight piece within the unit square (Liang & Barsky 1984).
fn clip(a: Px, b: Px) -> Option<(Px, Px)> {
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        for (p, q) in [(a[k] - b[k], a[k]), (b[k] - a[k], 1.0 - a[k])] {
            if p == 0.0 && q < 0.0 {
                return None;
            }
            if p < 0.0 {
                low = low.max(q / p);
            } else if p > 0.0 {
                high = high.min(q / p);
            }
        }
    }
    let at = |t: f64| {
        if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
        }
    };
    (low <= high).then(|| (at(low), at(high)))
}

#[cfg(test)]
mod tests {
    use super::super::axis::Axis;
    use super::*;

    fn frame() -> PlotArea {
        let unit = || Axis::linear("", "").range(0.0, 1.0).settle(std::iter::empty());
        PlotArea { x: unit(), y: unit(), corner: [10.0, 20.0], size: [100.0, 50.0], band: 16.0 }
    }

    #[test]
    fn lines_end_at_the_axes() {
        assert_eq!(frame().pieces(&[(-10.0, 0.5), (10.0, 0.5)]), [vec![[10.0, 45.0], [110.0, 45.0]]]);
        let twice = frame().pieces(&[(0.0, 0.5), (0.5, 0.5), (0.5, 2.0), (1.0, 0.5), (f64::NAN, 0.5), (1.0, 0.0)]);
        assert_eq!(twice.len(), 2, "{twice:?}");
        assert_eq!(twice[0], [[10.0, 45.0], [60.0, 45.0], [60.0, 20.0]]);
        assert!(frame().pieces(&[(2.0, 0.0), (2.0, 1.0)]).is_empty());
    }

    #[test]
    fn failures_have_a_place_whatever_they_lack() {
        assert_eq!(frame().failure((0.5, f64::NAN)), [60.0, 12.0]);
        assert_eq!(frame().failure((f64::INFINITY, 0.5)), [110.0, 45.0]);
        assert_eq!(frame().failure((-3.0, 7.0)), [10.0, 20.0]);
    }
}
