//! Sparse Cholesky factorisation by faer: symbolic analysis once per pattern, numbers per iteration.

use super::ordering::nested_dissection;
use super::pattern::Pattern;
use crate::geometry::Point;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};

/// From this many nodes on, nested dissection is tried beside minimum degree, and the ordering with less fill is kept.
/// Straight cuts win on evenly spaced nodes (SCNI, support 2, 5,741 nodes: 6.3 against 6.5 million entries; a tenth less
/// time at 25,000 nodes), minimum degree wins by far on graded ones, where every straight cut runs through crowded nodes.
const DISSECTION_TRIED: usize = 3000;

/// The matrix is not positive definite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the matrix is not positive definite")]
pub struct NotPositiveDefinite;

/// Cholesky factor of a matrix with a fixed pattern, with all workspace it needs.
pub struct SparseCholesky {
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    workspace: MemBuffer,
    solve_workspace: MemBuffer,
    solve_columns: usize,
}

impl std::fmt::Debug for SparseCholesky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseCholesky").field("factor_entries", &self.factor.len()).finish_non_exhaustive()
    }
}

impl SparseCholesky {
    /// Orders and analyses a pattern of nodes at `positions`.
    ///
    /// # Panics
    /// When memory for the analysis cannot be had.
    pub fn analyse<const D: usize>(pattern: &Pattern, positions: &[Point<D>]) -> Self {
        let analyse = |ordering: SymmetricOrdering<'_, u32>| {
            factorize_symbolic_cholesky(pattern.symbolic(), Side::Lower, ordering, CholeskySymbolicParams::default())
                .expect("memory for the symbolic factorisation")
        };
        let mut symbolic = analyse(SymmetricOrdering::Amd);
        if pattern.unknowns() / pattern.dimension() >= DISSECTION_TRIED {
            let d = pattern.dimension() as u32;
            let order = nested_dissection(&pattern.graph(), positions);
            let forward = order.iter().flat_map(|i| (0..d).map(move |k| i * d + k)).collect::<Vec<u32>>();
            let mut inverse = vec![0_u32; forward.len()];
            for (place, &u) in forward.iter().enumerate() {
                inverse[u as usize] = place as u32;
            }
            let cuts = SymmetricOrdering::Custom(PermRef::new_checked(&forward, &inverse, forward.len()));
            let dissected = analyse(cuts);
            if dissected.len_val() < symbolic.len_val() {
                symbolic = dissected;
            }
        }
        let factor = vec![0.0; symbolic.len_val()];
        let workspace = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
        let solve_workspace = MemBuffer::new(StackReq::EMPTY);
        let mut analysed = Self { symbolic, factor, workspace, solve_workspace, solve_columns: 0 };
        analysed.reserve_columns(1);
        analysed
    }

    fn reserve_columns(&mut self, columns: usize) {
        if columns > self.solve_columns {
            self.solve_workspace = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
            self.solve_columns = columns;
        }
    }

    /// Entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.factor.len()
    }

    /// Factorises the matrix with these values (lower triangle, laid out by the analysed pattern).
    ///
    /// # Errors
    /// [`NotPositiveDefinite`]; the factor is then not usable.
    pub fn factorise(&mut self, pattern: &Pattern, values: &[f64]) -> Result<(), NotPositiveDefinite> {
        let matrix = SparseColMatRef::new(pattern.symbolic(), values);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.workspace),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| NotPositiveDefinite)
    }

    /// Solves in place for `columns` right-hand sides stored one after the other.
    ///
    /// # Panics
    /// When the length of `rhs` is not `columns` times the number of unknowns.
    pub fn solve(&mut self, rhs: &mut [f64], columns: usize) {
        let n = self.symbolic.nrows();
        assert_eq!(rhs.len(), n * columns, "one column per right-hand side");
        self.reserve_columns(columns);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(rhs, n, columns),
            Par::Seq,
            MemStack::new(&mut self.solve_workspace),
        );
    }
}
