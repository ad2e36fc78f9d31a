//! Gaussian smoothing on a lattice.

use super::transform::Lattice;

/// The kernel ends so many widths away, where it is 1/3000 of its height.
const ENDS: f64 = 4.0;

/// How many places the kernel of a width reaches to each side.
pub(super) fn reach(width: f64) -> usize {
    (ENDS * width).ceil() as usize
}

/// Smooths along each axis by a Gaussian of a width (standard deviation) in cells. Beyond its sides the lattice goes on
/// with the values there.
pub(super) fn smooth(values: &mut Lattice<f32>, width: f64) {
    if width <= 0.0 {
        return;
    }
    let reach = reach(width);
    let weight = |i: usize| (-0.5 * (i as f64 / width).powi(2)).exp();
    let total: f64 = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
    let kernel: Vec<f64> = (0..=reach).map(|i| weight(i) / total).collect();
    for axis in 0..3 {
        let n = values.size[axis];
        let (firsts, step) = values.lines(axis);
        let mut line = vec![0.0; n + 2 * reach];
        for first in firsts {
            for (i, x) in line.iter_mut().enumerate() {
                let place = i.saturating_sub(reach).min(n - 1);
                *x = f64::from(values.data[first + place * step]);
            }
            for i in 0..n {
                let at = i + reach;
                let pairs = kernel.iter().enumerate().skip(1).map(|(k, w)| w * (line[at - k] + line[at + k]));
                values.data[first + i * step] = (kernel[0] * line[at] + pairs.sum::<f64>()) as f32;
            }
        }
    }
}
