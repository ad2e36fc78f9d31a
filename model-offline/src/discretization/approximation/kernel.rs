//! The kernel: a product of cubic B-splines, one per axis (rectangular support).

use crate::geometry::Point;

/// Cubic B-spline of z = |x − x_I| / a: value and derivative with respect to z; zero for z ≥ 1, C² everywhere.
///
/// φ(z) = 2/3 − 4z² + 4z³ for z ≤ ½, 4/3 − 4z + 4z² − 4z³/3 for ½ < z ≤ 1 (Liu, Jun & Zhang 1995).
#[inline]
pub fn cubic_b_spline(z: f64) -> (f64, f64) {
    if z <= 0.5 {
        (2.0 / 3.0 + z * z * (4.0 * z - 4.0), z * (12.0 * z - 8.0))
    } else if z < 1.0 {
        let r = 1.0 - z;
        (4.0 / 3.0 * r * r * r, -4.0 * r * r)
    } else {
        (0.0, 0.0)
    }
}

/// Kernel values below this are zero: at the very end of a support, rounding of the distance leaves (1e-16)³.
pub const NEGLIGIBLE: f64 = 1e-30;

/// Value alone of [`product_kernel`], the same to the last bit.
#[inline]
pub fn product_kernel_value<const D: usize>(offset: &Point<D>, a: f64) -> f64 {
    offset.iter().map(|d| cubic_b_spline(d.abs() / a).0).product()
}

/// Value and gradient with respect to x of φ_a(x − x_I), for `offset` = x − x_I and half-width `a` of the support.
#[inline]
pub fn product_kernel<const D: usize>(offset: &Point<D>, a: f64) -> (f64, Point<D>) {
    let mut value = [0.0; D];
    let mut slope = [0.0; D];
    for k in 0..D {
        let (phi, derivative) = cubic_b_spline(offset[k].abs() / a);
        value[k] = phi;
        slope[k] = derivative * offset[k].signum() / a;
    }
    let product = value.iter().product();
    let gradient = Point::from_fn(|k, _| (0..D).map(|m| if m == k { slope[m] } else { value[m] }).product());
    (product, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spline_is_continuous_with_its_derivative_and_vanishes_at_the_end() {
        for (left, right) in [(0.5 - 1e-9, 0.5 + 1e-9), (1.0 - 1e-9, 1.0 + 1e-9)] {
            let (a, b) = (cubic_b_spline(left), cubic_b_spline(right));
            assert!((a.0 - b.0).abs() < 1e-8 && (a.1 - b.1).abs() < 1e-7);
        }
        assert_eq!(cubic_b_spline(0.0).0, 2.0 / 3.0);
        // ∫ over the support of a one-dimensional spline of half-width 1 is 1/2 · (area of the classic spline 1) .
        let n = 10_000;
        let sum: f64 =
            (0..n).map(|i| cubic_b_spline((f64::from(i) + 0.5) / f64::from(n)).0).sum::<f64>() / f64::from(n);
        assert!((sum - 0.25).abs() < 1e-8);
    }

    #[test]
    fn the_value_alone_has_the_same_bits() {
        for k in 0..200 {
            let t = f64::from(k);
            let x = Point::<3>::new((t * 0.7).sin(), (t * 1.3).cos(), 0.9 * (t * 0.1).sin());
            for a in [0.3, 0.8, 1.1] {
                assert_eq!(product_kernel_value(&x, a).to_bits(), product_kernel(&x, a).0.to_bits(), "{x} {a}");
            }
        }
    }

    #[test]
    fn gradient_matches_finite_differences_in_three_dimensions() {
        let x = Point::<3>::new(0.13, -0.4, 0.62);
        let (_, gradient) = product_kernel(&x, 0.9);
        for k in 0..3 {
            let mut step = Point::<3>::zeros();
            step[k] = 1e-6;
            let difference = (product_kernel(&(x + step), 0.9).0 - product_kernel(&(x - step), 0.9).0) / 2e-6;
            assert!((difference - gradient[k]).abs() < 1e-9);
        }
    }
}
