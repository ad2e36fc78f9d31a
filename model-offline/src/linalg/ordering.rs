//! Nested dissection of the node graph (George 1973), by coordinates.
//!
//! Kernels couple each node to dozens of others. On such wide stencils, dividing the body by straight cuts gives less
//! fill than minimum degree does.

use crate::geometry::Point;

/// Parts of at most this many nodes are not divided further: their blocks are dense anyway.
const LEAF: usize = 40;

/// Undirected graph in compressed rows.
#[derive(Debug)]
pub(super) struct Graph {
    pub(super) starts: Vec<u32>,
    pub(super) neighbours: Vec<u32>,
}

impl Graph {
    fn of(&self, node: u32) -> &[u32] {
        &self.neighbours[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }
}

/// Elimination order: `order[k]` is the node eliminated k-th. Nodes lie at `positions`.
pub(super) fn nested_dissection<const D: usize>(graph: &Graph, positions: &[Point<D>]) -> Vec<u32> {
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
        let (mut starts, mut neighbours) = (vec![0_u32], Vec::new());
        for k in 0..n {
            if k < 900 {
                let (i, j) = (k % side, k / side);
                let mut push = |ok: bool, to: usize| {
                    if ok {
                        neighbours.push(to as u32)
                    }
                };
                push(i > 0, k.wrapping_sub(1));
                push(i + 1 < side, k + 1);
                push(j > 0, k.wrapping_sub(side));
                push(j + 1 < side, k + side);
            }
            starts.push(neighbours.len() as u32);
        }
        let positions: Vec<_> = (0..n).map(|k| Point::<2>::new((k % side) as f64, (k / side) as f64)).collect();
        let order = nested_dissection(&Graph { starts, neighbours }, &positions);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..n as u32).collect::<Vec<_>>());
    }
}
