//! Dense symmetric work on what is left when a body is condensed. All of it is done on as many threads as it is called
//! [within](crate::parallel::within), and with the same result.

use super::packing;
use crate::parallel;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, solve};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::iter::{IndexedParallelIterator as _, ParallelIterator as _};

/// Rows from which on it pays that several threads share a matrix.
const SHARED_ROWS: usize = 200;

/// How dense work on so many rows that is called from here is shared.
fn shared(rows: usize) -> Par {
    shared_by(if rows >= SHARED_ROWS { parallel::here() } else { 1 })
}

/// The same among so many threads.
pub(super) fn shared_by(threads: usize) -> Par {
    if threads > 1 { Par::rayon(threads) } else { Par::Seq }
}

/// The matrix is not positive definite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the matrix is not positive definite")]
pub struct NotPositiveDefinite;

/// Cholesky factor of a dense matrix.
#[derive(Debug, Clone)]
pub struct DenseCholesky {
    /// Lower triangle; what is above it is not read.
    factor: Mat<f64>,
}

impl DenseCholesky {
    /// Factorises a matrix, of which the lower triangle is read.
    ///
    /// # Errors
    /// [`NotPositiveDefinite`].
    pub fn new(mut matrix: Mat<f64>) -> Result<Self, NotPositiveDefinite> {
        let shared = shared(matrix.nrows());
        let scratch = factor::cholesky_in_place_scratch::<f64>(matrix.nrows(), shared, Default::default());
        let (mut memory, none) = (MemBuffer::new(scratch), Default::default());
        factor::cholesky_in_place(matrix.as_mut(), none, shared, MemStack::new(&mut memory), Default::default())
            .map_err(|_| NotPositiveDefinite)?;
        Ok(Self { factor: matrix })
    }

    /// Solves in place, a column per right-hand side.
    ///
    /// # Panics
    /// When `sides` has other rows than the matrix.
    pub fn solve(&self, sides: MatMut<'_, f64>) {
        by_panels(sides, |_, panel| {
            let scratch = solve::solve_in_place_scratch::<f64>(self.factor.nrows(), panel.ncols(), Par::Seq);
            solve::solve_in_place(self.factor.as_ref(), panel, Par::Seq, MemStack::new(&mut MemBuffer::new(scratch)));
        });
    }
}

/// L⁻¹ B in place, for a lower triangle L. Column c of B has zeros above row `first[c]`, and `first` ascends: what is zero stays
/// so, and costs nothing.
pub(super) fn solve_lower(triangle: MatRef<'_, f64>, sides: MatMut<'_, f64>, first: &[usize]) {
    by_panels(sides, |column, panel| {
        let (from, rows) = (first[column], triangle.nrows() - first[column]);
        solve_lower_triangular_in_place(
            triangle.submatrix(from, from, rows, rows),
            panel.subrows_mut(from, rows),
            Par::Seq,
        );
    });
}

/// The lower triangle of Bᵀ B, for a B with zeros above `first` as of [`solve_lower`]; what is above it is not to be read.
pub(super) fn products_of_columns(columns: &Mat<f64>, first: &[usize]) -> Mat<f64> {
    let count = columns.ncols();
    let mut products = Mat::zeros(count, count);
    by_panels(products.as_mut(), |column, mut panel| {
        for other in (column..count).step_by(SPAN) {
            // Above its first row the other column has nothing to multiply.
            let (from, wide) = (first[other], SPAN.min(count - other));
            let rows = columns.subrows(from, columns.nrows() - from);
            let (left, right) = (rows.subcols(other, wide).transpose(), rows.subcols(column, panel.ncols()));
            matmul(panel.as_mut().subrows_mut(other, wide), Accum::Replace, left, right, 1.0, Par::Seq);
        }
    });
    products
}

/// Columns that are multiplied at a time.
const SPAN: usize = 4 * PANEL;
/// Columns that one thread takes at a time.
const PANEL: usize = 96;

/// Works on panels of columns, given the first column of each; threads share them. Panels are the same for any number of threads,
/// and so are the results.
fn by_panels(mut matrix: MatMut<'_, f64>, work: impl Fn(usize, MatMut<'_, f64>) + Sync) {
    let work = |first: usize, panel: MatMut<'_, f64>| {
        packing::multiplied();
        work(first, panel);
    };
    if shared(matrix.nrows()) == Par::Seq {
        for first in (0..matrix.ncols()).step_by(PANEL) {
            let count = PANEL.min(matrix.ncols() - first);
            work(first, matrix.as_mut().subcols_mut(first, count));
        }
    } else {
        matrix.par_col_chunks_mut(PANEL).enumerate().for_each(|(k, panel)| work(PANEL * k, panel));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::within;

    /// A matrix with columns that are far from parallel, and no pattern that a block could repeat.
    fn columns(rows: usize, count: usize) -> Mat<f64> {
        Mat::from_fn(rows, count, entry)
    }

    fn entry(row: usize, column: usize) -> f64 {
        let off_diagonal = ((row * 37 + column * 91 + row * column) % 113) as f64 / 113.0 - 0.5;
        if row == column { 20.0 } else { off_diagonal }
    }

    #[test]
    fn products_and_solutions_are_those_of_the_definition_on_one_thread_and_on_several() {
        let (rows, count) = (700, 640);
        // Zeros above a staircase.
        let first: Vec<usize> = (0..count).map(|c| c / 3 * 2).collect();
        let mut columns = columns(rows, count);
        first.iter().enumerate().for_each(|(c, &from)| columns.col_mut(c).subrows_mut(0, from).fill(0.0));
        let products = || products_of_columns(&columns, &first);
        let alone = products();
        for (r, c) in [(0, 0), (500, 3), (639, 638), (256, 255)] {
            let product: f64 = (0..rows).map(|k| columns[(k, r)] * columns[(k, c)]).sum();
            assert!((alone[(r, c)] - product).abs() < 1e-12 * product.abs().max(1.0), "{r} {c}");
        }
        let side = |r: usize, _: usize| (r % 17) as f64 - 8.0;
        let solve = || {
            let mut x = Mat::from_fn(count, 1, side);
            DenseCholesky::new(products()).unwrap().solve(x.as_mut());
            x
        };
        let x = solve();
        for r in [0, 1, 300, 639] {
            let back: f64 = (0..count).map(|c| alone[(r.max(c), r.min(c))] * x[(c, 0)]).sum();
            assert!((back - side(r, 0)).abs() < 1e-10, "{r}: {back}");
        }
        for threads in [2, 3, 4] {
            assert!(within(threads, products) == alone, "{threads}: not the same bits");
            assert!(within(threads, solve) == x, "{threads}: not the same bits");
        }
    }

    /// More columns than a panel has, each with its own first row: what is above stays zero, and L times the answer is the side.
    #[test]
    fn forward_substitution_begins_where_each_column_does() {
        let (rows, count) = (400, 3 * PANEL + 5);
        let first: Vec<usize> = (0..count).map(|c| c / 4 * 5).collect();
        let triangle = Mat::from_fn(rows, rows, |r, c| if r < c { f64::NAN } else { entry(r, c) });
        let mut sides = Mat::from_fn(rows, count, |r, c| entry(c, r));
        first.iter().enumerate().for_each(|(c, &from)| sides.col_mut(c).subrows_mut(0, from).fill(0.0));
        let solve = || {
            let mut x = sides.clone();
            solve_lower(triangle.as_ref(), x.as_mut(), &first);
            x
        };
        let x = solve();
        for c in [0, 1, PANEL - 1, PANEL, 2 * PANEL + 3, count - 1] {
            assert!((0..first[c]).all(|r| x[(r, c)] == 0.0), "{c}");
            for r in first[c]..rows {
                let back: f64 = (first[c]..=r).map(|k| triangle[(r, k)] * x[(k, c)]).sum();
                assert!((back - sides[(r, c)]).abs() < 1e-12, "{r} {c}: {back}");
            }
        }
        for threads in [2, 3] {
            assert!(within(threads, solve) == x, "{threads}: not the same bits");
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let mut matrix = Mat::<f64>::identity(5, 5);
        matrix[(3, 3)] = -1e-3;
        assert_eq!(DenseCholesky::new(matrix).unwrap_err(), NotPositiveDefinite);
    }
}
