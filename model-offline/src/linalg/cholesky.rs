//! Sparse Cholesky factorisation by faer: symbolic analysis once per pattern, numbers per iteration.

use super::dense::{NotPositiveDefinite, shared_by};
use super::ordering::nested_dissection;
use super::pattern::Pattern;
use crate::geometry::Point;
use crate::parallel;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, MatMut, Par, Side};
use std::sync::Arc;

/// From this many nodes on, nodes are ordered and not unknowns: the same fill for a quarter of the time.
const NODES_ORDERED: usize = 500;
/// From this many nodes on, nested dissection is tried beside minimum degree, and the ordering with less fill is kept.
/// Straight cuts win on evenly spaced nodes (SCNI, support 2, 5,741 nodes: 6.3 against 6.5 million entries; a tenth less
/// time at 25,000 nodes), minimum degree wins by far on graded ones, where every straight cut runs through crowded nodes.
const DISSECTION_TRIED: usize = 3000;
/// Operations of a factorisation from which on several threads share it: below, they wait for each other longer than they work.
const SHARED_FLOPS: f64 = 1e9;

/// Elimination order and sparsity of the Cholesky factors of a pattern: made once, shared by all matrices that have the
/// pattern. Cheap to clone.
#[derive(Debug, Clone)]
pub struct SymbolicFactor {
    symbolic: Arc<SymbolicCholesky<u32>>,
}

impl SymbolicFactor {
    /// Orders and analyses a pattern of nodes at `positions`.
    ///
    /// # Panics
    /// When memory for the analysis cannot be had.
    pub fn new<const D: usize>(pattern: &Pattern, positions: &[Point<D>]) -> Self {
        let symbolic = if pattern.blocks() < NODES_ORDERED {
            analyse(pattern.symbolic(), SymmetricOrdering::Amd)
        } else {
            let d = pattern.dimension() as u32;
            let forward: Vec<u32> =
                order_nodes(pattern, positions).iter().flat_map(|i| (0..d).map(move |k| i * d + k)).collect();
            analyse_ordered(pattern.symbolic(), &forward)
        };
        Self { symbolic: Arc::new(symbolic) }
    }

    /// The same with the nodes `retained` (ascending) eliminated last, in their order, so that the factor's last columns are
    /// the factor of what is left when all others are condensed.
    ///
    /// # Panics
    /// When memory for the analysis cannot be had.
    pub fn retaining<const D: usize>(pattern: &Pattern, positions: &[Point<D>], retained: &[u32]) -> Self {
        let nodes = order_retaining(pattern, positions, retained);
        let forward: Vec<u32> = nodes.iter().flat_map(|i| (0..D as u32).map(move |k| i * D as u32 + k)).collect();
        Self { symbolic: Arc::new(analyse_with(pattern.symbolic(), &forward, supernodal())) }
    }

    /// Entries of a factor.
    pub fn entries(&self) -> usize {
        self.symbolic.len_val()
    }

    /// Floating-point operations that a factorisation takes.
    pub fn flops(&self) -> f64 {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(columns) => {
                columns.col_ptr().windows(2).map(|column| f64::from(column[1] - column[0]).powi(2)).sum()
            }
            SymbolicCholeskyRaw::Supernodal(nodes) => (0..nodes.n_supernodes())
                .map(|s| {
                    let own = f64::from(nodes.supernode_end()[s] - nodes.supernode_begin()[s]);
                    let below = nodes.supernode(s).pattern().len() as f64;
                    own * (own * own / 3.0 + own * below + below * below)
                })
                .sum(),
        }
    }
}

fn analyse(matrix: SymbolicSparseColMatRef<'_, u32>, ordering: SymmetricOrdering<'_, u32>) -> SymbolicCholesky<u32> {
    factorize_symbolic_cholesky(matrix, Side::Lower, ordering, CholeskySymbolicParams::default())
        .expect("memory for the symbolic factorisation")
}

/// Columns of equal sparsity are always factorised together. faer's own choice, column by column where there are few
/// operations per entry, takes a third to two thirds more time on quadratic triangles of 1,000 to 6,000 nodes.
fn supernodal() -> CholeskySymbolicParams<'static> {
    CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    }
}

/// `forward[k]` is eliminated k-th.
fn analyse_ordered(matrix: SymbolicSparseColMatRef<'_, u32>, forward: &[u32]) -> SymbolicCholesky<u32> {
    analyse_with(matrix, forward, supernodal())
}

fn analyse_with(
    matrix: SymbolicSparseColMatRef<'_, u32>,
    forward: &[u32],
    params: CholeskySymbolicParams<'_>,
) -> SymbolicCholesky<u32> {
    let mut inverse = vec![0_u32; forward.len()];
    for (place, &u) in forward.iter().enumerate() {
        inverse[u as usize] = place as u32;
    }
    let order = SymmetricOrdering::Custom(PermRef::new_checked(forward, &inverse, forward.len()));
    factorize_symbolic_cholesky(matrix, Side::Lower, order, params).expect("memory for the symbolic factorisation")
}

/// An elimination order with the `retained` nodes last: the others by whichever order of theirs alone fills less.
fn order_retaining<const D: usize>(pattern: &Pattern, positions: &[Point<D>], retained: &[u32]) -> Vec<u32> {
    let condensed: Vec<u32> = (0..pattern.blocks() as u32).filter(|i| retained.binary_search(i).is_err()).collect();
    let inner = pattern.restricted(&condensed);
    let places: Vec<Point<D>> = condensed.iter().map(|&i| positions[i as usize]).collect();
    let order = order_nodes(&inner, &places);
    order.into_iter().map(|i| condensed[i as usize]).chain(retained.iter().copied()).collect()
}

/// The elimination order of the nodes that fills less.
fn order_nodes<const D: usize>(pattern: &Pattern, positions: &[Point<D>]) -> Vec<u32> {
    let by_degree = analyse(pattern.symbolic_of_nodes(), SymmetricOrdering::Amd);
    if pattern.blocks() >= DISSECTION_TRIED {
        let cuts = nested_dissection(&pattern.graph(), positions);
        if analyse_ordered(pattern.symbolic_of_nodes(), &cuts).len_val() < by_degree.len_val() {
            return cuts;
        }
    }
    by_degree.perm().map_or_else(|| (0..pattern.blocks() as u32).collect(), |order| order.arrays().0.to_vec())
}

/// Cholesky factor of a matrix with a fixed pattern, with all workspace it needs.
pub struct SparseCholesky {
    symbolic: Arc<SymbolicCholesky<u32>>,
    factor: Vec<f64>,
    workspace: MemBuffer,
    /// Threads that the workspace has room for.
    workspace_threads: usize,
    solve_workspace: MemBuffer,
    solve_columns: usize,
    /// Whether it pays that several threads share a factorisation.
    shareable: bool,
}

impl std::fmt::Debug for SparseCholesky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseCholesky").field("factor_entries", &self.factor.len()).finish_non_exhaustive()
    }
}

impl Clone for SparseCholesky {
    /// The same factor; workspace of its own.
    fn clone(&self) -> Self {
        let mut copy = Self::empty(&self.symbolic);
        copy.factor.clone_from(&self.factor);
        copy.shareable = self.shareable;
        copy
    }
}

impl SparseCholesky {
    /// Room for a factor of a pattern that was analysed.
    pub fn new(analysed: &SymbolicFactor) -> Self {
        let mut room = Self::empty(&analysed.symbolic);
        room.factor = vec![0.0; analysed.entries()];
        room.shareable = analysed.flops() >= SHARED_FLOPS;
        room
    }

    fn empty(symbolic: &Arc<SymbolicCholesky<u32>>) -> Self {
        let mut empty = Self {
            symbolic: Arc::clone(symbolic),
            factor: Vec::new(),
            workspace: MemBuffer::new(StackReq::EMPTY),
            workspace_threads: 0,
            solve_workspace: MemBuffer::new(StackReq::EMPTY),
            solve_columns: 0,
            shareable: false,
        };
        empty.reserve_threads(1);
        empty.reserve_columns(1);
        empty
    }

    fn reserve_threads(&mut self, threads: usize) {
        if threads > self.workspace_threads {
            let scratch = self.symbolic.factorize_numeric_llt_scratch::<f64>(shared_by(threads), Default::default());
            self.workspace = MemBuffer::new(scratch);
            self.workspace_threads = threads;
        }
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

    /// Factorises the matrix with these values (lower triangle, laid out by the analysed pattern); a large one on as many
    /// threads as it is called [within](crate::parallel::within).
    ///
    /// # Errors
    /// [`NotPositiveDefinite`]; the factor is then not usable.
    pub fn factorise(&mut self, pattern: &Pattern, values: &[f64]) -> Result<(), NotPositiveDefinite> {
        let matrix = SparseColMatRef::new(pattern.symbolic(), values);
        let threads = if self.shareable { parallel::here() } else { 1 };
        self.reserve_threads(threads);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                shared_by(threads),
                MemStack::new(&mut self.workspace),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| NotPositiveDefinite)
    }

    /// The last `count` rows and columns of the factor, dense and lower triangular, and the unknowns that they belong to: of
    /// an analysis that [retains](SymbolicFactor::retaining) nodes, the factor of what is left when all others are condensed.
    pub(super) fn last(&self, count: usize) -> (Mat<f64>, Vec<u32>) {
        let first = self.symbolic.nrows() - count;
        let order = self.symbolic.perm();
        let unknown = |place: usize| order.map_or(place as u32, |order| order.arrays().0[place]);
        let mut dense = Mat::zeros(count, count);
        if let SymbolicCholeskyRaw::Supernodal(symbolic) = self.symbolic.raw() {
            let factor = SupernodalLltRef::new(symbolic, &self.factor);
            for s in 0..symbolic.n_supernodes() {
                let node = factor.supernode(s);
                let (start, values) = (node.start(), node.val());
                if start + values.ncols() <= first {
                    continue;
                }
                let own = start..start + values.ncols();
                let rows: Vec<usize> = own.clone().chain(node.pattern().iter().map(|&r| r as usize)).collect();
                for column in own.filter(|column| *column >= first) {
                    for (k, &row) in rows.iter().enumerate().filter(|(_, row)| **row >= column) {
                        dense[(row - first, column - first)] = values[(k, column - start)];
                    }
                }
            }
        }
        (dense, (first..first + count).map(unknown).collect())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::within;

    /// A cube of springs between neighbours along the axes and the diagonals of faces, three unknowns a node: enough work to
    /// be shared.
    fn cube(side: u32) -> (Pattern, Vec<Point<3>>, Vec<f64>) {
        let place = |i: u32| [i % side, i / side % side, i / side / side];
        let count = side.pow(3);
        let mut springs: Vec<Vec<u32>> = (0..count).map(|i| vec![i]).collect();
        for i in 0..count {
            for step in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]] {
                let [x, y, z]: [u32; 3] = std::array::from_fn(|k| place(i)[k] + step[k]);
                if x.max(y).max(z) < side {
                    springs.push(vec![i, x + side * (y + side * z)]);
                }
            }
        }
        let pattern = Pattern::new(3, count as usize, springs.iter().map(Vec::as_slice));
        let mut values = vec![0.0; pattern.entries()];
        for spring in springs.iter().filter(|spring| spring.len() == 2) {
            for (row, column, sign) in [(0, 0, 1.0), (1, 1, 1.0), (1, 0, -1.0)] {
                let (i, j) = (spring[row], spring[column]);
                let (at, stride) = (pattern.block_position(i, j).unwrap(), pattern.column_length(j));
                (0..3).for_each(|k| values[at + k * stride + k] += sign * (1.0 + f64::from(spring[0] % 7)));
            }
        }
        (0..pattern.unknowns()).for_each(|u| values[pattern.diagonal_position(u)] += 0.1);
        let positions = (0..count).map(|i| Point::<3>::from(place(i).map(f64::from))).collect();
        (pattern, positions, values)
    }

    #[test]
    fn a_factor_shared_by_threads_has_the_same_bits() {
        let (pattern, positions, values) = cube(14);
        let analysed = SymbolicFactor::new(&pattern, &positions);
        assert!(analysed.flops() > SHARED_FLOPS, "{:e}", analysed.flops());
        let factor = || {
            let mut cholesky = SparseCholesky::new(&analysed);
            cholesky.factorise(&pattern, &values).unwrap();
            cholesky
        };
        let mut alone = factor();
        let mut x: Vec<f64> = (0..pattern.unknowns()).map(|u| (u % 11) as f64 - 5.0).collect();
        let right = x.clone();
        alone.solve(&mut x, 1);
        let mut back = vec![0.0; x.len()];
        pattern.multiply::<3>(&values, &x, &mut back);
        assert!(back.iter().zip(&right).all(|(b, r)| (b - r).abs() < 1e-9), "does not solve");
        for threads in [2, 3] {
            assert!(within(threads, factor).factor == alone.factor, "{threads} threads");
        }
    }
}
