//! A part of the plane on paper: equal scales on both axes, y upwards.

use super::drawing::Px;

/// Maps lengths of a scene to pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    scale: f64,
    low: [f64; 2],
    /// Width and height of the whole, px.
    pub size: Px,
}

impl Plane {
    /// The rectangle from `low` to `high`, this wide on paper, but at most half as high again as it is wide.
    pub fn new(low: [f64; 2], high: [f64; 2], width: f64) -> Self {
        let size = [high[0] - low[0], high[1] - low[1]];
        let scale = (width / size[0]).min(1.5 * width / size[1]);
        let scale = if scale.is_finite() { scale } else { 1.0 };
        Self { scale, low, size: size.map(|side| side * scale) }
    }

    /// The same of a rectangle that has so much room around these points, length; what is not finite is left out.
    pub fn around(points: impl IntoIterator<Item = [f64; 2]>, room: f64, width: f64) -> Self {
        let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let finite = points.into_iter().filter(|point| point.iter().all(|value| value.is_finite()));
        let (low, high) = finite.fold(none, |(low, high), point| {
            ([0, 1].map(|k| low[k].min(point[k])), [0, 1].map(|k| high[k].max(point[k])))
        });
        Self::new(low.map(|low| low - room), high.map(|high| high + room), width)
    }

    /// Lower left and upper right corner of the rectangle.
    pub fn corners(&self) -> [[f64; 2]; 2] {
        [self.low, [0, 1].map(|k| self.low[k] + self.size[k] / self.scale)]
    }

    /// A length, px.
    pub fn length(&self, length: f64) -> f64 {
        length * self.scale
    }

    /// A point, px.
    pub fn at(&self, [x, y]: [f64; 2]) -> Px {
        [(x - self.low[0]) * self.scale, self.size[1] - (y - self.low[1]) * self.scale]
    }

    /// Points, px.
    pub fn path(&self, points: &[[f64; 2]]) -> Vec<Px> {
        points.iter().map(|point| self.at(*point)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_equal_and_y_points_up() {
        let plane = Plane::new([1.0, 2.0], [3.0, 3.0], 100.0);
        assert_eq!(plane.size, [100.0, 50.0]);
        assert_eq!(plane.path(&[[1.0, 2.0], [3.0, 3.0]]), [[0.0, 50.0], [100.0, 0.0]]);
        let high = Plane::new([0.0, 0.0], [1.0, 10.0], 100.0);
        assert_eq!((high.size, high.length(1.0)), ([15.0, 150.0], 15.0));
        let around = Plane::around([[1.0, 2.0], [f64::NAN, 9.0], [3.0, 3.0]], 1.0, 100.0);
        assert_eq!(around.corners(), [[0.0, 1.0], [4.0, 4.0]]);
    }
}
