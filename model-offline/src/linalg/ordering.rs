//! Elimination orders of the node graph by nested dissection (George 1973): by straight cuts, and by multilevel bisection
//! (Karypis & Kumar, SIAM J. Sci. Comput. 20, 1998), as `feral-metis` has it.
//!
//! Minimum degree is fast, and best where a body is flat or small. In space it takes two to three times as many operations as
//! dissection does: straight cuts are best on evenly spaced nodes, bisection of the graph on meshes that are graded to the rims
//! of patches, where every straight cut runs through crowded nodes.

use crate::geometry::Point;
use feral_metis::{CscPattern, MetisOptions, metis_order_full};

/// Parts of at most this many nodes are not cut further: their blocks are dense anyway.
const LEAF: usize = 40;
/// Sizes of the coarsest graph that are tried. Elements have fifteen neighbours or thirty, and the library's own size serves
/// them; kernels have a hundred, of which a bisection of a hundred nodes knows nothing.
const COARSEST: [u32; 2] = [120, 300];
/// Neighbours of a node, on average, up to which only the first is tried.
const FEW_NEIGHBOURS: usize = 50;

/// Undirected graph in compressed rows, neighbours ascending.
#[derive(Debug)]
pub(super) struct Graph {
    pub(super) starts: Vec<i32>,
    pub(super) neighbours: Vec<i32>,
}

impl Graph {
    fn of(&self, node: u32) -> &[i32] {
        &self.neighbours[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }
}

/// Elimination orders to choose from: `order[k]` is the node eliminated k-th. The same graph has the same orders every time.
/// Nodes lie at `positions`.
pub(super) fn nested_dissections<'g, const D: usize>(
    graph: &'g Graph,
    positions: &[Point<D>],
) -> impl Iterator<Item = Vec<u32>> + 'g {
    let pattern = CscPattern::new(graph.starts.len() - 1, &graph.starts, &graph.neighbours);
    let few = graph.neighbours.len() <= FEW_NEIGHBOURS * positions.len();
    let by_graph = COARSEST.into_iter().take(if few { 1 } else { 2 }).filter_map(move |coarsen_floor| {
        let (order, ..) = metis_order_full(&pattern?, &MetisOptions { coarsen_floor, ..Default::default() }).ok()?;
        Some(order.into_iter().map(|node| node as u32).collect())
    });
    std::iter::once(straight_cuts(graph, positions)).chain(by_graph)
}

/// The order of straight cuts through the middle of the longest side.
fn straight_cuts<const D: usize>(graph: &Graph, positions: &[Point<D>]) -> Vec<u32> {
    let n = positions.len();
    let mut far = vec![false; n];
    let mut order = Vec::with_capacity(n);
    // Filled from the back: separators first, so that they are eliminated last.
    let mut stack = vec![(0..n as u32).collect::<Vec<_>>()];
    while let Some(mut nodes) = stack.pop() {
        let axis = longest_axis(&nodes, positions);
        let along = |i: &u32| positions[*i as usize][axis];
        nodes.sort_unstable_by(|i, j| along(i).total_cmp(&along(j)).then(i.cmp(j)));
        if nodes.len() <= LEAF {
            order.extend(nodes.into_iter().rev());
            continue;
        }
        let (below, above) = nodes.split_at(nodes.len() / 2);
        // The separator: those on the lower side that are joined to the upper one.
        above.iter().for_each(|&i| far[i as usize] = true);
        let (separator, rest): (Vec<u32>, Vec<u32>) =
            below.iter().partition(|&&i| graph.of(i).iter().any(|&j| far[j as usize]));
        above.iter().for_each(|&i| far[i as usize] = false);
        if rest.is_empty() {
            order.extend(nodes.into_iter().rev());
            continue;
        }
        let above = above.to_vec();
        order.extend(separator.into_iter().rev());
        stack.push(rest);
        stack.push(above);
    }
    order.reverse();
    order
}

fn longest_axis<const D: usize>(nodes: &[u32], positions: &[Point<D>]) -> usize {
    let mut low = Point::<D>::repeat(f64::INFINITY);
    let mut high = Point::<D>::repeat(f64::NEG_INFINITY);
    for &i in nodes {
        low = low.inf(&positions[i as usize]);
        high = high.sup(&positions[i as usize]);
    }
    (high - low).imax()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_is_ordered_once() {
        // A 30 × 30 grid beside a single node that nothing joins.
        let (side, n) = (30_usize, 901_usize);
        let (mut starts, mut neighbours) = (vec![0_i32], Vec::new());
        for k in 0..n {
            if k < 900 {
                let (i, j) = (k % side, k / side);
                let mut push = |ok: bool, to: usize| {
                    if ok {
                        neighbours.push(to as i32)
                    }
                };
                push(j > 0, k.wrapping_sub(side));
                push(i > 0, k.wrapping_sub(1));
                push(i + 1 < side, k + 1);
                push(j + 1 < side, k + side);
            }
            starts.push(neighbours.len() as i32);
        }
        let positions: Vec<_> = (0..n).map(|k| Point::<2>::new((k % side) as f64, (k / side) as f64)).collect();
        let orders: Vec<Vec<u32>> = nested_dissections(&Graph { starts, neighbours }, &positions).collect();
        assert_eq!(orders.len(), 2);
        for mut order in orders {
            order.sort_unstable();
            assert_eq!(order, (0..n as u32).collect::<Vec<_>>());
        }
    }

    /// As kernels have them: everyone is everyone's neighbour.
    #[test]
    fn where_there_are_many_neighbours_another_size_is_tried() {
        let n = 120_i32;
        let starts = (0..=n).map(|k| k * (n - 1)).collect();
        let neighbours = (0..n).flat_map(|k| (0..n).filter(move |other| *other != k)).collect();
        let positions: Vec<_> = (0..n).map(|k| Point::<2>::new(f64::from(k), 0.0)).collect();
        assert_eq!(nested_dissections(&Graph { starts, neighbours }, &positions).count(), 1 + COARSEST.len());
    }
}
