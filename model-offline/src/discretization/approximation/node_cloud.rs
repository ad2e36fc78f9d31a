//! The nodes, with their supports, and the search for those whose kernel covers a region.

use super::sight::Sight;
use crate::geometry::Point;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::sync::Arc;

type Support<const D: usize> = GeomWithData<Rectangle<[f64; D]>, u32>;

/// Nodes X_I with the half-width a_I of their rectangular support.
#[derive(Debug, Clone)]
pub struct NodeCloud<const D: usize> {
    sight: Option<Arc<dyn Sight<D>>>,
    positions: Vec<Point<D>>,
    half_widths: Vec<f64>,
    supports: RTree<Support<D>>,
}

impl<const D: usize> NodeCloud<D>
where
    [f64; D]: rstar::Point<Scalar = f64>,
{
    /// Nodes at `positions` whose kernels reach `half_widths` in every axis, length units.
    ///
    /// # Panics
    /// When the two lists differ in length.
    pub fn new(positions: Vec<Point<D>>, half_widths: Vec<f64>) -> Self {
        assert_eq!(positions.len(), half_widths.len(), "one support per node");
        let supports = RTree::bulk_load(
            positions
                .iter()
                .zip(&half_widths)
                .enumerate()
                .map(|(i, (x, &a))| {
                    let corner = |s: f64| -> [f64; D] { std::array::from_fn(|k| x[k] + s * a) };
                    GeomWithData::new(Rectangle::from_corners(corner(-1.0), corner(1.0)), i as u32)
                })
                .collect(),
        );
        Self { sight: None, positions, half_widths, supports }
    }

    /// The same nodes in a body where not every point sees every other.
    #[must_use]
    pub fn in_sight(self, sight: Option<Arc<dyn Sight<D>>>) -> Self {
        Self { sight, ..self }
    }

    /// Whether a node is in sight of `x`.
    pub(in crate::discretization) fn sees(&self, x: &Point<D>, node: u32) -> bool {
        self.sight.as_ref().is_none_or(|sight| sight.sees(x, &self.positions[node as usize]))
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Node positions X_I.
    pub fn positions(&self) -> &[Point<D>] {
        &self.positions
    }

    /// Half-widths a_I of the supports, length units.
    pub fn half_widths(&self) -> &[f64] {
        &self.half_widths
    }

    /// Collects into `out`, in ascending order, the nodes whose support meets the box from `low` to `high`.
    pub fn covering(&self, low: &Point<D>, high: &Point<D>, out: &mut Vec<u32>) {
        let corner = |p: &Point<D>| -> [f64; D] { std::array::from_fn(|k| p[k]) };
        out.clear();
        let window = AABB::from_corners(corner(low), corner(high));
        out.extend(self.supports.locate_in_envelope_intersecting(&window).map(|s| s.data));
        // The tree's order depends on its build; ascending order makes every sum reproducible.
        out.sort_unstable();
    }
}
