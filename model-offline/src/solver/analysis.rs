//! What all bodies of one discretization share: sparsity of the tangent, where its blocks go, and the elimination order.

use crate::discretization::Quadrature;
use crate::geometry::Point;
use crate::linalg::{Pattern, SymbolicFactor};
use crate::mechanics::Tissue;
use crate::mechanics::blocks::BlockPositions;
use crate::mechanics::stabilisation::Stabilisation;
use std::sync::Arc;

/// Made once for the nodes and the rule of a body, with whatever may be constrained on it. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Analysis {
    pub(super) pattern: Arc<Pattern>,
    pub(super) blocks: Arc<BlockPositions>,
    pub(super) symbolic: SymbolicFactor,
}

impl Analysis {
    /// Analyses the tangent of a rule on nodes at `positions`, of which the node lists `constrained` (each ascending) are
    /// coupled as well.
    pub fn new<'a, const D: usize>(
        rule: &'a Quadrature<D>,
        positions: &[Point<D>],
        constrained: impl Iterator<Item = &'a [u32]> + Clone,
    ) -> Self {
        let lists = (0..rule.len()).map(|q| rule.point(q).nodes).chain(constrained);
        let pattern = Pattern::new(D, positions.len(), lists);
        Self {
            blocks: Arc::new(BlockPositions::new(rule, &pattern)),
            symbolic: SymbolicFactor::new(&pattern, positions),
            pattern: Arc::new(pattern),
        }
    }

    /// The same with some nodes (ascending) eliminated last; see [`SymbolicFactor::retaining`].
    pub fn retaining<'a, const D: usize>(
        rule: &'a Quadrature<D>,
        positions: &[Point<D>],
        constrained: impl Iterator<Item = &'a [u32]> + Clone,
        retained: &[u32],
    ) -> Self {
        let lists = (0..rule.len()).map(|q| rule.point(q).nodes).chain(constrained);
        let pattern = Pattern::new(D, positions.len(), lists);
        Self {
            blocks: Arc::new(BlockPositions::new(rule, &pattern)),
            symbolic: SymbolicFactor::retaining(&pattern, positions, retained),
            pattern: Arc::new(pattern),
        }
    }

    /// The same sparsity, eliminated in whichever order fills least.
    #[must_use]
    pub fn retaining_none<const D: usize>(&self, positions: &[Point<D>]) -> Self {
        Self { symbolic: SymbolicFactor::new(&self.pattern, positions), ..self.clone() }
    }

    /// The same sparsity with some nodes (ascending) eliminated last.
    #[must_use]
    pub fn retaining_also<const D: usize>(&self, positions: &[Point<D>], retained: &[u32]) -> Self {
        Self { symbolic: SymbolicFactor::retaining(&self.pattern, positions, retained), ..self.clone() }
    }

    /// The sparsity of the tangent.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Elimination order and size of the factor.
    pub fn symbolic(&self) -> &SymbolicFactor {
        &self.symbolic
    }

    /// The stabilisation of the analysed rule on a tissue.
    pub fn stabilisation<const D: usize>(&self, rule: &Quadrature<D>, tissue: &Tissue) -> Stabilisation {
        Stabilisation::new(rule, tissue, &self.blocks, &self.pattern)
    }

    /// Where the rule's blocks go.
    pub fn blocks(&self) -> &BlockPositions {
        &self.blocks
    }
}
