//! Where the blocks of a rule go in a matrix.

use crate::discretization::Quadrature;
use crate::linalg::Pattern;

/// Where every (point, node, node) block of the tangent goes: computed once per pattern, so that assembly is a plain
/// loop without searches.
#[derive(Debug, Clone)]
pub struct BlockPositions {
    /// For every point and every ordered pair (row ≥ column) of its nodes: first entry of the block's first column.
    pub(super) positions: Vec<u32>,
    /// Per node: entries between the columns of its blocks.
    pub(super) strides: Vec<u32>,
}

impl BlockPositions {
    /// Finds the place of every block of `rule` in `pattern`.
    ///
    /// # Panics
    /// When the pattern misses a block that the rule produces.
    pub fn new<const D: usize>(rule: &Quadrature<D>, pattern: &Pattern) -> Self {
        let mut positions = Vec::with_capacity(rule.pairs() * 13);
        for point in rule.points() {
            for (column, &j) in point.nodes.iter().enumerate() {
                for &i in &point.nodes[column..] {
                    positions.push(pattern.block_position(i, j).expect("the pattern covers the rule") as u32);
                }
            }
        }
        let strides = (0..pattern.blocks() as u32).map(|j| pattern.column_length(j) as u32).collect();
        Self { positions, strides }
    }

    /// First entries of the blocks, point by point, column by column.
    pub(super) fn in_order(&self) -> impl Iterator<Item = usize> + '_ {
        self.positions.iter().map(|&at| at as usize)
    }
}
