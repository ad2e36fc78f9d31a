//! Sparse Cholesky factorisation by faer: symbolic analysis once per pattern, numbers per iteration.

use super::dense::{NotPositiveDefinite, shared_by};
use super::memory::{self, NotEnoughMemory};
use super::ordering::nested_dissections;
use super::packing;
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
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMatRef};
use faer::traits::RealField;
use faer::traits::math_utils::nan;
use faer::{Conj, Mat, MatMut, Par, Side};
use std::mem::MaybeUninit;
use std::sync::Arc;

/// From this many nodes on, nodes are ordered and not unknowns: the same fill for a quarter of the time.
const NODES_ORDERED: usize = 500;
/// Operations of a factorisation from which on nested dissection is tried beside minimum degree, and the order with the fewest
/// is kept. In the plane it seldom wins, so that a factorisation itself must take a tenth of a second, of which trying takes a
/// part. In space it wins by the more the larger a body is, and one analysis serves hundreds of factorisations where an
/// insertion is followed.
const fn dissection_tried(unknowns: usize) -> f64 {
    if unknowns == 3 { 1e7 } else { 2e9 }
}
/// Operations of a factorisation from which on several threads share it: below, they wait for each other longer than they work.
const SHARED_FLOPS: f64 = 1e9;

/// Elimination order and sparsity of the Cholesky factors of a pattern: made once, shared by all matrices that have the
/// pattern. Cheap to clone.
#[derive(Debug, Clone)]
pub struct SymbolicFactor {
    /// An error where a factor has more entries than can be numbered.
    symbolic: Result<Arc<SymbolicCholesky<u32>>, NotEnoughMemory>,
    /// Entries that are taken beside the factor and its workspace: of the matrix, and of dense matrices on what is retained.
    beside: usize,
    /// Whether nodes are retained, to which others are condensed with the factor's own digits.
    retains: bool,
}

/// Dense matrices of the size of what is retained: its factor, right-hand sides, and their products.
const CONDENSED: usize = 3;

impl SymbolicFactor {
    /// Orders and analyses a pattern of nodes at `positions`.
    pub fn new<const D: usize>(pattern: &Pattern, positions: &[Point<D>]) -> Self {
        let symbolic = if pattern.blocks() < NODES_ORDERED {
            analyse(pattern.symbolic(), SymmetricOrdering::Amd, CholeskySymbolicParams::default())
        } else {
            order_nodes(pattern, positions, pattern.dimension())
                .and_then(|nodes| analyse_ordered(pattern.symbolic(), &unknowns_of(pattern, &nodes)))
        };
        Self::of(pattern, symbolic, None)
    }

    /// The same with the nodes `retained` (ascending) eliminated last, in their order, so that the factor's last columns are
    /// the factor of what is left when all others are condensed.
    pub fn retaining<const D: usize>(pattern: &Pattern, positions: &[Point<D>], retained: &[u32]) -> Self {
        let symbolic = order_retaining(pattern, positions, retained)
            .and_then(|nodes| analyse_ordered(pattern.symbolic(), &unknowns_of(pattern, &nodes)));
        Self::of(pattern, symbolic, Some(retained.len() * pattern.dimension()))
    }

    fn of(pattern: &Pattern, symbolic: Result<SymbolicCholesky<u32>, FaerError>, retained: Option<usize>) -> Self {
        let too_many = |_| NotEnoughMemory { unknowns: pattern.unknowns(), needed: None, fixed: 0 };
        Self {
            symbolic: symbolic.map(Arc::new).map_err(too_many),
            beside: pattern.entries() + CONDENSED * retained.unwrap_or(0).pow(2),
            retains: retained.is_some(),
        }
    }

    /// Entries of a factor; infinitely many where they cannot be numbered.
    pub fn entries(&self) -> f64 {
        self.symbolic.as_ref().map_or(f64::INFINITY, |symbolic| symbolic.len_val() as f64)
    }

    /// Whether nodes are [retained](Self::retaining), to which others are condensed with the digits of the factor itself.
    pub(super) fn retains(&self) -> bool {
        self.retains
    }

    /// Floating-point operations that a factorisation takes; the same.
    pub fn flops(&self) -> f64 {
        self.symbolic.as_ref().map_or(f64::INFINITY, |symbolic| flops(symbolic))
    }
}

fn flops(symbolic: &SymbolicCholesky<u32>) -> f64 {
    match symbolic.raw() {
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

/// Columns of equal sparsity are always factorised together. faer's own choice, column by column where there are few
/// operations per entry, takes a third to two thirds more time on quadratic triangles of 1,000 to 6,000 nodes.
fn supernodal() -> CholeskySymbolicParams<'static> {
    CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    }
}

fn analyse(
    matrix: SymbolicSparseColMatRef<'_, u32>,
    ordering: SymmetricOrdering<'_, u32>,
    params: CholeskySymbolicParams<'_>,
) -> Result<SymbolicCholesky<u32>, FaerError> {
    factorize_symbolic_cholesky(matrix, Side::Lower, ordering, params)
}

/// `forward[k]` is eliminated k-th.
fn analyse_ordered(
    matrix: SymbolicSparseColMatRef<'_, u32>,
    forward: &[u32],
) -> Result<SymbolicCholesky<u32>, FaerError> {
    let mut inverse = vec![0_u32; forward.len()];
    for (place, &u) in forward.iter().enumerate() {
        inverse[u as usize] = place as u32;
    }
    let order = SymmetricOrdering::Custom(PermRef::new_checked(forward, &inverse, forward.len()));
    analyse(matrix, order, supernodal())
}

/// The unknowns of nodes, in their order.
fn unknowns_of(pattern: &Pattern, nodes: &[u32]) -> Vec<u32> {
    let d = pattern.dimension() as u32;
    nodes.iter().flat_map(|i| (0..d).map(move |k| i * d + k)).collect()
}

/// An elimination order with the `retained` nodes last: the others by the best order of theirs alone.
fn order_retaining<const D: usize>(
    pattern: &Pattern,
    positions: &[Point<D>],
    retained: &[u32],
) -> Result<Vec<u32>, FaerError> {
    let condensed: Vec<u32> = (0..pattern.blocks() as u32).filter(|i| retained.binary_search(i).is_err()).collect();
    let places: Vec<Point<D>> = condensed.iter().map(|&i| positions[i as usize]).collect();
    let order = order_nodes(&pattern.restricted(&condensed), &places, pattern.dimension())?;
    Ok(order.into_iter().map(|i| condensed[i as usize]).chain(retained.iter().copied()).collect())
}

/// The elimination order of the nodes that takes the fewest operations. Each has so many unknowns.
fn order_nodes<const D: usize>(
    pattern: &Pattern,
    positions: &[Point<D>],
    unknowns: usize,
) -> Result<Vec<u32>, FaerError> {
    let nodes = pattern.symbolic_of_nodes();
    let by_degree = analyse(nodes, SymmetricOrdering::Amd, CholeskySymbolicParams::default())?;
    let (mut fewest, mut best) = (flops(&by_degree), None);
    if fewest * (unknowns as f64).powi(3) >= dissection_tried(unknowns) {
        for order in nested_dissections(&pattern.graph(), positions) {
            // An order whose factor cannot be numbered is none of the best.
            let operations = analyse_ordered(nodes, &order).map_or(f64::INFINITY, |analysed| flops(&analysed));
            if operations < fewest {
                (fewest, best) = (operations, Some(order));
            }
        }
    }
    let natural = || (0..pattern.blocks() as u32).collect();
    Ok(best.unwrap_or_else(|| by_degree.perm().map_or_else(natural, |order| order.arrays().0.to_vec())))
}

/// Workspace of a factorisation.
fn scratch<T: RealField>(symbolic: &SymbolicCholesky<u32>, threads: usize) -> StackReq {
    symbolic.factorize_numeric_llt_scratch::<T>(shared_by(threads), Default::default())
}

/// Cholesky factor of a matrix with a fixed pattern, with all workspace it needs, in numbers of double or of single precision.
pub struct SparseCholesky<T = f64> {
    symbolic: Arc<SymbolicCholesky<u32>>,
    factor: Vec<T>,
    workspace: MemBuffer,
    /// Threads that the workspace has room for.
    workspace_threads: usize,
    solve_workspace: MemBuffer,
    solve_columns: usize,
    /// Whether it pays that several threads share a factorisation.
    shareable: bool,
}

impl<T> std::fmt::Debug for SparseCholesky<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseCholesky").field("factor_entries", &self.factor.len()).finish_non_exhaustive()
    }
}

impl<T: RealField + Copy> Clone for SparseCholesky<T> {
    /// The same factor; workspace of its own.
    fn clone(&self) -> Self {
        let mut copy = Self::empty(&self.symbolic);
        copy.factor.clone_from(&self.factor);
        copy.shareable = self.shareable;
        copy
    }
}

impl<T: RealField + Copy> SparseCholesky<T> {
    /// Room for a factor of a pattern that was analysed.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] when there is none for it and what is computed with it, before any is taken.
    pub fn new(analysed: &SymbolicFactor) -> Result<Self, NotEnoughMemory> {
        let symbolic = analysed.symbolic.as_ref().map_err(Clone::clone)?;
        let shareable = analysed.flops() >= SHARED_FLOPS;
        let threads = if shareable { parallel::here() } else { 1 };
        let entries = |count: usize, size: usize| (count as u64).saturating_mul(size as u64);
        // In other numbers the matrix is there twice.
        let copied = if size_of::<T>() == size_of::<f64>() { 0 } else { size_of::<T>() };
        let bytes = entries(symbolic.len_val(), size_of::<T>())
            .saturating_add(entries(analysed.beside, size_of::<f64>() + copied))
            .saturating_add(scratch::<T>(symbolic, threads).size_bytes() as u64);
        memory::take(symbolic.nrows(), bytes, || {
            let mut room = Self::empty(symbolic);
            // Written to, here and in the workspace, and no zeros: those take no memory until something else is in their place.
            room.factor.resize(symbolic.len_val(), nan());
            room.shareable = shareable;
            room.reserve_threads(threads);
            room.workspace.fill(MaybeUninit::new(1));
            room
        })
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
            self.workspace = MemBuffer::new(scratch::<T>(&self.symbolic, threads));
            self.workspace_threads = threads;
        }
    }

    fn reserve_columns(&mut self, columns: usize) {
        if columns > self.solve_columns {
            self.solve_workspace = MemBuffer::new(self.symbolic.solve_in_place_scratch::<T>(columns, Par::Seq));
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
    pub fn factorise(&mut self, pattern: &Pattern, values: &[T]) -> Result<(), NotPositiveDefinite> {
        let matrix = SparseColMatRef::new(pattern.symbolic(), values);
        let threads = if self.shareable { parallel::here() } else { 1 };
        self.reserve_threads(threads);
        packing::multiplied();
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

    /// Solves in place for `columns` right-hand sides stored one after the other.
    ///
    /// # Panics
    /// When the length of `rhs` is not `columns` times the number of unknowns.
    pub fn solve(&mut self, rhs: &mut [T], columns: usize) {
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

impl SparseCholesky {
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
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::parallel::within;

    /// A cube of springs between neighbours along the axes and the diagonals of faces, three unknowns a node: enough work to
    /// be shared. Every node is tied to the ground by a spring of so much, which is the smallest eigenvalue.
    pub(in crate::linalg) fn cube(side: u32, ground: f64) -> (Pattern, Vec<Point<3>>, Vec<f64>) {
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
        (0..pattern.unknowns()).for_each(|u| values[pattern.diagonal_position(u)] += ground);
        let positions = (0..count).map(|i| Point::<3>::from(place(i).map(f64::from))).collect();
        (pattern, positions, values)
    }

    #[test]
    fn the_order_with_the_fewest_operations_is_taken_however_many_nodes_are_kept_for_last() {
        let (pattern, positions, values) = cube(16, 0.1);
        let by_degree = analyse(pattern.symbolic_of_nodes(), SymmetricOrdering::Amd, supernodal()).unwrap();
        let [alone, cut] = [flops(&by_degree), SymbolicFactor::new(&pattern, &positions).flops() / 27.0];
        assert!(alone * 27.0 > dissection_tried(3) && cut < 0.9 * alone, "{cut:e} for {alone:e}");
        let retained = [7, 100, 2000];
        let analysed = SymbolicFactor::retaining(&pattern, &positions, &retained);
        assert!(analysed.flops() < 0.9 * 27.0 * alone, "{:e} for {alone:e}", analysed.flops());
        // Eliminated last are the nodes that were to be, and the factor is one of the matrix.
        let mut cholesky = SparseCholesky::new(&analysed).unwrap();
        cholesky.factorise(&pattern, &values).unwrap();
        let kept: Vec<u32> = retained.iter().flat_map(|i| (0..3).map(move |k| 3 * i + k)).collect();
        assert_eq!(cholesky.last(9).1, kept);
        let mut x = vec![1.0; pattern.unknowns()];
        cholesky.solve(&mut x, 1);
        let mut back = vec![0.0; x.len()];
        pattern.multiply::<3>(&values, &x, &mut back);
        assert!(back.iter().all(|b| (b - 1.0).abs() < 1e-9), "does not solve");
    }

    #[test]
    fn a_factor_shared_by_threads_has_the_same_bits() {
        let (pattern, positions, values) = cube(14, 0.1);
        let analysed = SymbolicFactor::new(&pattern, &positions);
        assert!(analysed.flops() > SHARED_FLOPS, "{:e}", analysed.flops());
        let factor = || {
            let mut cholesky = SparseCholesky::new(&analysed).unwrap();
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
