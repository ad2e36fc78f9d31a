//! Strain measures and the small algebra of 1 to 3 dimensions that laws are written in.

use nalgebra::SMatrix;
use std::array::from_fn;

/// A D × D matrix.
pub type Matrix<const D: usize> = SMatrix<f64, D, D>;

/// A fourth-order tensor, indexed `[i][j][k][l]`.
pub type Tensor4<const D: usize> = [[[[f64; D]; D]; D]; D];

/// E = ½ (H + Hᵀ + HᵀH).
#[inline]
pub fn green_lagrange<const D: usize>(h: &Matrix<D>) -> Matrix<D> {
    (h + h.transpose() + h.transpose() * h) * 0.5
}

/// det F for one to three dimensions.
#[inline]
pub fn determinant<const D: usize>(f: &Matrix<D>) -> f64 {
    f.row(0).dot(&cofactors(f).row(0))
}

/// J − 1 = det(I + ∇u) − 1 from ∇u itself, exact also where J is 1 to within rounding.
pub(super) fn dilation<const D: usize>(h: &Matrix<D>) -> f64 {
    let trace = h.trace();
    let minors = 0.5 * (trace * trace - (h * h).trace());
    match D {
        1 => trace,
        2 => trace + determinant(h),
        _ => trace + minors + determinant(h),
    }
}

/// Cofactors of F: J F⁻ᵀ, defined for every F.
fn cofactors<const D: usize>(f: &Matrix<D>) -> Matrix<D> {
    match D {
        1 => Matrix::identity(),
        2 => Matrix::from_fn(|r, c| if r == c { f[(1 - r, 1 - c)] } else { -f[(1 - r, 1 - c)] }),
        3 => Matrix::from_fn(|r, c| {
            let next = |x: usize, by: usize| (x + by) % 3;
            f[(next(r, 1), next(c, 1))] * f[(next(r, 2), next(c, 2))]
                - f[(next(r, 1), next(c, 2))] * f[(next(r, 2), next(c, 1))]
        }),
        _ => unreachable!("space has at most three dimensions"),
    }
}

/// F⁻ᵀ; not finite when J is 0.
pub(super) fn inverse_transpose<const D: usize>(f: &Matrix<D>, j: f64) -> Matrix<D> {
    cofactors(f) / j
}

/// The tensor of these entries, in loops of constant length: assembly spends much of its time here.
#[inline(always)]
pub(super) fn tensor4<const D: usize>(entry: impl Fn(usize, usize, usize, usize) -> f64) -> Tensor4<D> {
    from_fn(|i| from_fn(|j| from_fn(|k| from_fn(|l| entry(i, j, k, l)))))
}

/// A_iJkL = δ_ik S_JL + F_iM C_MJNL F_kN.
pub(super) fn push_forward<const D: usize>(f: &Matrix<D>, pk2: &Matrix<D>, c: &Tensor4<D>) -> Tensor4<D> {
    tensor4(|i, j, k, l| {
        let mut sum = if i == k { pk2[(j, l)] } else { 0.0 };
        for m in 0..D {
            for n in 0..D {
                sum += f[(i, m)] * c[m][j][n][l] * f[(k, n)];
            }
        }
        sum
    })
}
