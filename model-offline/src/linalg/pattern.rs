//! Sparsity of matrices of node blocks.

use super::ordering::Graph;
use faer::sparse::SymbolicSparseColMatRef;

/// Sparsity of a symmetric matrix of D × D node blocks: the lower triangle of blocks, by block columns. Every scalar
/// column of a block column has the same rows, so a block is found once and its columns lie a fixed stride apart.
#[derive(Debug, Clone)]
pub struct Pattern {
    dimension: usize,
    block_starts: Vec<u32>,
    block_rows: Vec<u32>,
    column_starts: Vec<u32>,
    row_indices: Vec<u32>,
}

impl Pattern {
    /// The pattern of all pairs of nodes that share one of the given node lists (each ascending).
    pub fn new<'a>(dimension: usize, nodes: usize, lists: impl Iterator<Item = &'a [u32]> + Clone) -> Self {
        let mut starts = vec![0_u32; nodes + 1];
        // Lists by their members, to gather the rows of one column after the other.
        for list in lists.clone() {
            for &i in list {
                starts[i as usize + 1] += 1;
            }
        }
        for i in 0..nodes {
            starts[i + 1] += starts[i];
        }
        let mut fill = starts.clone();
        let all: Vec<&[u32]> = lists.collect();
        let mut members = vec![0_u32; *starts.last().unwrap_or(&0) as usize];
        for (l, list) in all.iter().enumerate() {
            for &i in *list {
                members[fill[i as usize] as usize] = l as u32;
                fill[i as usize] += 1;
            }
        }
        let (mut block_starts, mut block_rows) = (vec![0_u32], Vec::new());
        let mut seen = vec![u32::MAX; nodes];
        let mut rows = Vec::new();
        for j in 0..nodes {
            rows.clear();
            // The diagonal block is always there, so that a node without any point shows as a zero pivot.
            rows.push(j as u32);
            seen[j] = j as u32;
            for &l in &members[starts[j] as usize..starts[j + 1] as usize] {
                for &i in all[l as usize].iter().rev().take_while(|&&i| i as usize > j) {
                    if seen[i as usize] != j as u32 {
                        seen[i as usize] = j as u32;
                        rows.push(i);
                    }
                }
            }
            rows.sort_unstable();
            block_rows.extend_from_slice(&rows);
            block_starts.push(block_rows.len() as u32);
        }
        let (mut column_starts, mut row_indices) = (vec![0_u32], Vec::new());
        for j in 0..nodes {
            for _ in 0..dimension {
                for &i in &block_rows[block_starts[j] as usize..block_starts[j + 1] as usize] {
                    row_indices.extend((0..dimension).map(|r| i * dimension as u32 + r as u32));
                }
                column_starts.push(row_indices.len() as u32);
            }
        }
        Self { dimension, block_starts, block_rows, column_starts, row_indices }
    }

    /// Unknowns per node.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.column_starts.len() - 1
    }

    /// Number of stored entries.
    pub fn entries(&self) -> usize {
        self.row_indices.len()
    }

    /// Index of the first entry of block (row node i, column node j), i ≥ j; `None` when it is not in the pattern.
    pub fn block_position(&self, i: u32, j: u32) -> Option<usize> {
        let range = self.block_starts[j as usize] as usize..self.block_starts[j as usize + 1] as usize;
        let rank = self.block_rows[range].binary_search(&i).ok()?;
        Some(self.column_starts[j as usize * self.dimension] as usize + rank * self.dimension)
    }

    /// Number of stored blocks.
    pub fn stored_blocks(&self) -> usize {
        self.block_rows.len()
    }

    /// Which of the stored blocks it is that begins at this entry, in the column of node j.
    pub(crate) fn block_at(&self, j: u32, entry: usize) -> usize {
        let first = self.column_starts[j as usize * self.dimension] as usize;
        self.block_starts[j as usize] as usize + (entry - first) / self.dimension
    }

    /// Number of block columns: nodes.
    pub fn blocks(&self) -> usize {
        self.block_starts.len() - 1
    }

    /// Entries per scalar column of block column j: the stride between a block's columns.
    #[inline]
    pub fn column_length(&self, j: u32) -> usize {
        let at = j as usize * self.dimension;
        (self.column_starts[at + 1] - self.column_starts[at]) as usize
    }

    /// Index of the diagonal entry of scalar unknown `u`.
    pub fn diagonal_position(&self, u: usize) -> usize {
        // The diagonal block is the first of its column.
        self.column_starts[u] as usize + u % self.dimension
    }

    /// The pattern of some of the nodes (ascending), numbered by their places.
    pub(super) fn restricted(&self, nodes: &[u32]) -> Self {
        let mut place = vec![u32::MAX; self.blocks()];
        nodes.iter().enumerate().for_each(|(k, &i)| place[i as usize] = k as u32);
        let lists: Vec<Vec<u32>> = nodes
            .iter()
            .map(|&j| {
                let rows = self.block_starts[j as usize] as usize..self.block_starts[j as usize + 1] as usize;
                self.block_rows[rows].iter().map(|&i| place[i as usize]).filter(|&i| i != u32::MAX).collect()
            })
            .collect();
        let (mut block_starts, mut block_rows) = (vec![0_u32], Vec::new());
        for list in lists {
            block_rows.extend(list);
            block_starts.push(block_rows.len() as u32);
        }
        // Blocks of one unknown: what is looked at is the graph.
        Self {
            dimension: 1,
            column_starts: block_starts.clone(),
            row_indices: block_rows.clone(),
            block_starts,
            block_rows,
        }
    }

    /// The graph of nodes that share a block.
    pub(super) fn graph(&self) -> Graph {
        let nodes = self.block_starts.len() - 1;
        let column = |j: usize| &self.block_rows[self.block_starts[j] as usize + 1..self.block_starts[j + 1] as usize];
        let mut starts = vec![0_i32; nodes + 1];
        for j in 0..nodes {
            starts[j + 1] += column(j).len() as i32;
            for &i in column(j) {
                starts[i as usize + 1] += 1;
            }
        }
        for i in 0..nodes {
            starts[i + 1] += starts[i];
        }
        let mut fill = starts.clone();
        let mut neighbours = vec![0_i32; starts[nodes] as usize];
        let mut join = |a: usize, b: usize| {
            neighbours[fill[a] as usize] = b as i32;
            fill[a] += 1;
        };
        // Column by column, so that the neighbours of every node come in ascending order.
        for j in 0..nodes {
            for &i in column(j) {
                join(i as usize, j);
                join(j, i as usize);
            }
        }
        Graph { starts, neighbours }
    }

    /// `out = A x` for the symmetric matrix with these values (lower triangle of D × D blocks, laid out by this pattern).
    ///
    /// # Panics
    /// When D is not the pattern's dimension.
    pub fn multiply<const D: usize>(&self, values: &[f64], x: &[f64], out: &mut [f64]) {
        assert_eq!(D, self.dimension, "blocks of the pattern's own size");
        out.fill(0.0);
        for j in 0..self.blocks() {
            let rows = &self.block_rows[self.block_starts[j] as usize + 1..self.block_starts[j + 1] as usize];
            for k in 0..D {
                let u = j * D + k;
                let column = &values[self.column_starts[u] as usize..self.column_starts[u + 1] as usize];
                let (diagonal, below) = column.split_at(D);
                let mut sum = diagonal[k] * x[u];
                for (r, a) in diagonal.iter().enumerate().skip(k + 1) {
                    out[j * D + r] += a * x[u];
                    sum += a * x[j * D + r];
                }
                for (&i, block) in rows.iter().zip(below.chunks_exact(D)) {
                    let at = i as usize * D;
                    for ((a, x_i), out) in block.iter().zip(&x[at..at + D]).zip(&mut out[at..at + D]) {
                        *out += a * x[u];
                        sum += a * x_i;
                    }
                }
                out[u] += sum;
            }
        }
    }

    /// Adds `S x` to `out` for the symmetric matrix whose blocks are these multiples of the identity, one for each stored
    /// block; returns `xᵀ S x`.
    ///
    /// # Panics
    /// When D is not the pattern's dimension.
    pub(crate) fn add_scalar_product<const D: usize>(&self, weights: &[f64], x: &[f64], out: &mut [f64]) -> f64 {
        assert_eq!(D, self.dimension, "blocks of the pattern's own size");
        let mut product = 0.0;
        for j in 0..self.blocks() {
            let range = self.block_starts[j] as usize..self.block_starts[j + 1] as usize;
            let column: [f64; D] = std::array::from_fn(|k| x[j * D + k]);
            // The diagonal block is the first of its column.
            let mut sum = [0.0; D];
            for (&i, &weight) in self.block_rows[range.clone()].iter().zip(&weights[range.clone()]).skip(1) {
                let at = i as usize * D;
                for (k, (out, x_i)) in out[at..at + D].iter_mut().zip(&x[at..at + D]).enumerate() {
                    *out += weight * column[k];
                    sum[k] += weight * x_i;
                }
            }
            let diagonal = weights[range.start];
            for k in 0..D {
                product += column[k] * (2.0 * sum[k] + diagonal * column[k]);
                out[j * D + k] += sum[k] + diagonal * column[k];
            }
        }
        product
    }

    /// Adds these multiples of the identity, one for each stored block, to a matrix.
    pub(crate) fn add_scalar_blocks(&self, weights: &[f64], values: &mut [f64]) {
        for j in 0..self.blocks() {
            let stride = self.column_length(j as u32);
            let first = self.column_starts[j * self.dimension] as usize;
            let weights = &weights[self.block_starts[j] as usize..self.block_starts[j + 1] as usize];
            for (rank, weight) in weights.iter().enumerate() {
                for k in 0..self.dimension {
                    values[first + rank * self.dimension + k * stride + k] += weight;
                }
            }
        }
    }

    /// The lower triangle of the graph of nodes.
    pub(super) fn symbolic_of_nodes(&self) -> SymbolicSparseColMatRef<'_, u32> {
        SymbolicSparseColMatRef::new_checked(self.blocks(), self.blocks(), &self.block_starts, None, &self.block_rows)
    }

    pub(super) fn symbolic(&self) -> SymbolicSparseColMatRef<'_, u32> {
        let n = self.unknowns();
        SymbolicSparseColMatRef::new_checked(n, n, &self.column_starts, None, &self.row_indices)
    }
}
