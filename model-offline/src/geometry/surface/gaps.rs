//! Where a surface is open, and how wide.

use super::error::Gap;
use crate::geometry::point::Point;
use rstar::RTree;
use rstar::primitives::{GeomWithData, Line};
use std::collections::BTreeMap;

/// A rim whose vertices are nearer than this part of their edges to another edge of a rim is a slit, not a hole.
const SLIT: f64 = 0.1;

type Edge = GeomWithData<Line<[f64; 3]>, [u32; 2]>;

/// Rims of the edges that one triangle has, the widest gap first.
pub(super) fn gaps(vertices: &[Point<3>], edges: &[[u32; 2]]) -> Vec<Gap> {
    let at = |v: u32| vertices[v as usize];
    let segment = |e: &[u32; 2]| Edge::new(Line::new(at(e[0]).into(), at(e[1]).into()), *e);
    let tree = RTree::bulk_load(edges.iter().map(segment).collect());
    let mut gaps: Vec<Gap> = rims(edges).iter().map(|rim| gap(vertices, rim, &tree)).collect();
    gaps.sort_by(|a, b| b.width.total_cmp(&a.width));
    gaps
}

/// Edges joined from end to end.
fn rims(edges: &[[u32; 2]]) -> Vec<Vec<[u32; 2]>> {
    let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, edge) in edges.iter().enumerate() {
        edge.iter().for_each(|vertex| at.entry(*vertex).or_default().push(i));
    }
    let mut used = vec![false; edges.len()];
    let mut rims = Vec::new();
    for start in 0..edges.len() {
        let (mut rim, mut here, mut next) = (Vec::new(), edges[start][0], Some(start));
        while let Some(i) = next.filter(|i| !used[*i]) {
            used[i] = true;
            let [a, b] = edges[i];
            let to = if a == here { b } else { a };
            rim.push([here, to]);
            here = to;
            let around = at.get_mut(&here);
            next = around.and_then(|around| {
                around.retain(|i| !used[*i]);
                around.last().copied()
            });
        }
        if !rim.is_empty() {
            rims.push(rim);
        }
    }
    rims
}

fn gap(vertices: &[Point<3>], rim: &[[u32; 2]], tree: &RTree<Edge>) -> Gap {
    let ends = |edge: &[u32; 2]| edge.map(|v| vertices[v as usize]);
    let [first, second] = ends(&rim[0]);
    let lengths: Vec<f64> = rim.iter().map(|edge| (ends(edge)[1] - ends(edge)[0]).norm()).collect();
    let length: f64 = lengths.iter().sum();
    // The way from each vertex across the gap, to a rim's edge that does not begin there.
    let across = |v: u32| {
        let x: [f64; 3] = vertices[v as usize].into();
        let mut near = tree.nearest_neighbor_iter_with_distance_2(&x);
        near.find(|(edge, _)| !edge.data.contains(&v)).map_or(f64::INFINITY, |(_, distance)| distance.sqrt())
    };
    let edge = length / rim.len() as f64;
    let mut slit: Vec<f64> = rim.iter().map(|[v, _]| across(*v)).filter(|way| *way < SLIT * edge).collect();
    slit.sort_by(f64::total_cmp);
    let is_slit = 2 * slit.len() >= rim.len();
    let width = match slit.last() {
        Some(widest) if is_slit => *widest,
        _ => {
            let part = |edge: &[u32; 2]| (ends(edge)[0] - first).cross(&(ends(edge)[1] - first)) * 0.5;
            4.0 * rim.iter().map(part).sum::<Point<3>>().norm() / length
        }
    };
    Gap { at: (first + second) * 0.5, width, rim: length, edges: rim.len() }
}
