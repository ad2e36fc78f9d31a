//! What the verification suites share: reproducible scatter, bodies to test on, and golden data.

pub mod continuum;
pub mod estimates;

use model_offline::geometry::{Point, Point2, Polygon};

/// A small reproducible generator (PCG-XSH-RR 64/32, O'Neill 2014): tests must not change with a library's version.
#[derive(Debug, Clone)]
pub struct Pcg32(u64);

impl Pcg32 {
    /// A generator with its seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1))
    }

    /// The next number, uniform in [-1, 1).
    pub fn sample(&mut self) -> f64 {
        let state = self.0;
        self.0 = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let bits = ((((state >> 18) ^ state) >> 27) as u32).rotate_right((state >> 59) as u32);
        f64::from(bits) / f64::from(1_u32 << 31) - 1.0
    }
}

/// The rectangle [0, width] × [0, height].
///
/// # Panics
/// When a side is not positive.
pub fn rectangle(width: f64, height: f64) -> Polygon {
    Polygon::new(vec![
        Point2::new(0.0, 0.0),
        Point2::new(width, 0.0),
        Point2::new(width, height),
        Point2::new(0.0, height),
    ])
    .expect("a rectangle with positive sides")
}

/// Lattice nodes of a rectangle of this size, `columns` × `rows` intervals; interior nodes are moved by up to `jitter`
/// (fraction of the spacing) in each direction.
pub fn jittered_rectangle(
    [width, height]: [f64; 2],
    [columns, rows]: [usize; 2],
    jitter: f64,
    seed: u64,
) -> Vec<Point<2>> {
    let mut scatter = Pcg32::new(seed);
    let (dx, dy) = (width / columns as f64, height / rows as f64);
    (0..=rows)
        .flat_map(|j| (0..=columns).map(move |i| (i, j)))
        .map(|(i, j)| {
            let interior = i > 0 && i < columns && j > 0 && j < rows;
            let (sx, sy) = (scatter.sample(), scatter.sample());
            let shift = if interior { Point::<2>::new(sx * dx, sy * dy) * jitter } else { Point::<2>::zeros() };
            Point::<2>::new(i as f64 * dx, j as f64 * dy) + shift
        })
        .collect()
}
