//! Singular values of small dense matrices, by faer.
//!
//! Those of nalgebra 0.35 are wrong where what is off the diagonal is next to nothing, as in bodies that a plane of symmetry
//! halves (its issue 1172): by 0.07 % in a Jacobian of `block`, by 17 % where all entries are one. Its closed forms for
//! matrices of fixed size, 2 × 2 and 3 × 3, are others, and right.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{Mat, Par};
use nalgebra::storage::Storage;
use nalgebra::{DMatrix, DVector, Dim, Matrix};

/// `A = U diag(σ) Vᵀ`, with as many singular values as the shorter side has numbers.
#[derive(Debug, Clone)]
pub struct SingularValues {
    /// σ, descending.
    pub values: DVector<f64>,
    /// U, a column for each.
    pub left: DMatrix<f64>,
    /// V, a column for each.
    pub right: DMatrix<f64>,
}

impl SingularValues {
    /// Those of a matrix; none of one that has entries that are no numbers.
    pub fn of<R: Dim, C: Dim, S: Storage<f64, R, C>>(matrix: &Matrix<f64, R, C, S>) -> Option<Self> {
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return None;
        }
        let (rows, columns) = matrix.shape();
        let count = rows.min(columns);
        let entries = Mat::from_fn(rows, columns, |r, c| matrix[(r, c)]);
        let (mut left, mut values, mut right) =
            (Mat::zeros(rows, count), Diag::zeros(count), Mat::zeros(columns, count));
        let (thin, alone) = (ComputeSvdVectors::Thin, Par::Seq);
        let mut workspace = MemBuffer::new(svd_scratch::<f64>(rows, columns, thin, thin, alone, Default::default()));
        svd(
            entries.as_ref(),
            values.as_mut(),
            Some(left.as_mut()),
            Some(right.as_mut()),
            alone,
            MemStack::new(&mut workspace),
            Default::default(),
        )
        .ok()?;
        let values = values.column_vector();
        Some(Self {
            values: DVector::from_fn(count, |k, _| values[k]),
            left: DMatrix::from_fn(rows, count, |r, c| left[(r, c)]),
            right: DMatrix::from_fn(columns, count, |r, c| right[(r, c)]),
        })
    }

    /// The largest.
    pub fn most(&self) -> f64 {
        self.values.max()
    }

    /// The least.
    pub fn least(&self) -> f64 {
        self.values.min()
    }

    /// A⁺, with singular values up to this share of the largest taken for none.
    pub fn pseudo_inverse(&self, share: f64) -> DMatrix<f64> {
        let cut = share * self.most();
        let mut scaled = self.right.clone();
        for (mut column, &value) in scaled.column_iter_mut().zip(&self.values) {
            column *= if value > cut { 1.0 / value } else { 0.0 };
        }
        scaled * self.left.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2x6;
    use proptest::prelude::*;

    /// All ones, 3 × 5: √15, where nalgebra's own says 4.54 with vectors and 3.87 without.
    #[test]
    fn a_matrix_of_ones_has_one_singular_value() {
        let found = SingularValues::of(&DMatrix::from_element(3, 5, 1.0)).unwrap();
        assert!((found.most() - 15.0_f64.sqrt()).abs() < 1e-14, "{}", found.values);
        assert!(found.least().abs() < 1e-15);
    }

    /// NᵀJ of two paddles of `block` that mirror each other (`fem-t4`, spacing 0.06, paddles 1 and 2): its rows are orthogonal but
    /// for rounding, and singular values are their lengths. nalgebra's own say 0.20221 for 0.20207.
    #[test]
    fn what_rounding_leaves_off_the_diagonal_changes_nothing() {
        let [across, along] = [
            [0.11557049974648105, 0.02319566397666293, 0.014217848995896964],
            [0.030568751066288806, 0.13957045368577975, 0.0016439670892852522],
        ];
        let mirrored = [
            [0.11557049974648165, -0.023195663976663543, 0.0142178489958969],
            [-0.03056875106628948, 0.13957045368578008, -0.0016439670892832235],
        ];
        let rows = [[across, mirrored[0]].concat(), [along, mirrored[1]].concat()];
        let jacobian = Matrix2x6::from_fn(|r, c| rows[r][c]);
        let found = SingularValues::of(&jacobian).unwrap();
        for (value, row) in found.values.iter().zip([1, 0]) {
            let exact = jacobian.row(row).norm();
            assert!((value / exact - 1.0).abs() < 1e-12, "{value} for {exact}");
        }
        assert!(found.left[(0, 1)].abs() > 1.0 - 1e-12, "the worst direction: {}", found.left);
        assert!((found.pseudo_inverse(1e-9).norm_squared() - found.values.map(|v| v.powi(-2)).sum()).abs() < 1e-9);
    }

    #[test]
    fn nothing_is_said_of_what_are_no_numbers() {
        assert!(SingularValues::of(&DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, 0.0, 1.0])).is_none());
    }

    const CUT: f64 = 1e-12;

    proptest! {
        /// Entries that are large, small or next to nothing: A = U Σ Vᵀ, ‖A‖² = Σ σ², and A A⁺ A = A.
        #[test]
        fn the_parts_make_up_the_matrix(
            (rows, columns) in (1_usize..4, 1_usize..7),
            entries in prop::collection::vec((-1.0..1.0_f64, prop::sample::select(vec![0.0, 1.0, 1e-3, 1e-9, 1e-17])), 18),
        ) {
            let matrix = DMatrix::from_fn(rows, columns, |r, c| entries[r * 6 + c].0 * entries[r * 6 + c].1);
            let found = SingularValues::of(&matrix).unwrap();
            let whole = &found.left * DMatrix::from_diagonal(&found.values) * found.right.transpose();
            let size = matrix.norm().max(f64::MIN_POSITIVE);
            prop_assert!((whole - &matrix).norm() <= 1e-13 * size);
            prop_assert!((found.values.norm() - matrix.norm()).abs() <= 1e-13 * size);
            prop_assert!(found.values.as_slice().windows(2).all(|pair| pair[0] >= pair[1]));
            // What is cut is missing, and rounding comes back times the condition number of what is kept.
            let least_kept = found.values.iter().copied().filter(|value| *value > CUT * found.most()).fold(found.most(), f64::min);
            let condition = if least_kept > 0.0 { found.most() / least_kept } else { 1.0 };
            let back = &matrix * found.pseudo_inverse(CUT) * &matrix;
            prop_assert!((back - &matrix).norm() <= (10.0 * CUT + 1e-14 * condition) * size, "{condition:e}");
        }
    }
}
