//! Edges of a mesh joined end to end.

use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Nodes one after the other; of a closed line the first is not repeated.
pub(super) struct Line {
    pub(super) nodes: Vec<u64>,
    pub(super) closed: bool,
}

/// Joins edges: lines from their ends first, then what is left is closed.
pub(super) fn joined(edges: &[[u64; 2]]) -> Vec<Line> {
    let mut at: HashMap<u64, Vec<usize>> = HashMap::new();
    for (i, edge) in edges.iter().enumerate() {
        edge.iter().for_each(|node| at.entry(*node).or_default().push(i));
    }
    let mut used = vec![false; edges.len()];
    let is_end = |node: &u64| at[node].len() % 2 == 1;
    // A line begins where its first edge does: the direction of a needle is that of its elements.
    let first = (0..edges.len()).filter(|i| is_end(&edges[*i][0])).map(|i| (i, 0));
    let last = (0..edges.len()).filter(|i| is_end(&edges[*i][1])).map(|i| (i, 1));
    let rest = (0..edges.len()).map(|i| (i, 0));
    let starts: Vec<(usize, usize)> = first.chain(last).chain(rest).collect();
    let mut lines = Vec::new();
    for (start, end) in starts {
        if used[start] {
            continue;
        }
        used[start] = true;
        let (begin, mut here) = (edges[start][end], edges[start][1 - end]);
        let mut nodes = vec![begin];
        while here != begin {
            nodes.push(here);
            let Some(next) = next_unused(&mut at, here, &used) else { break };
            used[next] = true;
            here = if edges[next][0] == here { edges[next][1] } else { edges[next][0] };
        }
        lines.push(Line { nodes, closed: here == begin });
    }
    lines
}

/// An edge of a node that is not used yet; the others are not looked at again.
fn next_unused(at: &mut HashMap<u64, Vec<usize>>, node: u64, used: &[bool]) -> Option<usize> {
    let edges = at.get_mut(&node)?;
    while let Some(i) = edges.pop() {
        if !used[i] {
            return Some(i);
        }
    }
    None
}

/// Edges that belong to one cell only. A cell that is in several groups may stand in the file as often.
pub(super) fn boundary(cells: &[Vec<u64>]) -> Vec<[u64; 2]> {
    let mut seen = BTreeSet::new();
    let mut count: BTreeMap<[u64; 2], ([u64; 2], u32)> = BTreeMap::new();
    for cell in cells {
        let mut corners = cell.clone();
        corners.sort_unstable();
        if !seen.insert(corners) {
            continue;
        }
        for (i, a) in cell.iter().enumerate() {
            let b = cell[(i + 1) % cell.len()];
            count.entry([*a.min(&b), *a.max(&b)]).or_insert(([*a, b], 0)).1 += 1;
        }
    }
    count.into_values().filter(|(edge, times)| *times == 1 && edge[0] != edge[1]).map(|(edge, _)| edge).collect()
}
