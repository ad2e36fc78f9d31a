//! Edges of many polygons, of which those between neighbours go: what is left is the edge of them all.

use crate::output::chart::Px;
use std::collections::{BTreeMap, BTreeSet};

/// Parts of a pixel that are told apart, as drawings write them.
const STEPS: f64 = 10.0;

type Place = [i64; 2];

/// A set of edges between points on a fine grid.
#[derive(Debug, Default)]
pub(super) struct Edges(BTreeSet<[Place; 2]>);

fn place(point: Px) -> Option<Place> {
    point.iter().all(|value| value.is_finite()).then(|| point.map(|value| (value * STEPS).round() as i64))
}

impl Edges {
    /// A further polygon: what it has in common with those before is no edge any more.
    pub(super) fn add_polygon(&mut self, points: &[Px]) {
        let Some(places) = points.iter().map(|point| place(*point)).collect::<Option<Vec<Place>>>() else { return };
        for (a, b) in places.iter().zip(places.iter().cycle().skip(1)) {
            let edge = [*a.min(b), *a.max(b)];
            if a != b && !self.0.remove(&edge) {
                self.0.insert(edge);
            }
        }
    }

    /// A further line, however often it is there.
    pub(super) fn add_line(&mut self, ends: [Px; 2]) {
        if let [Some(a), Some(b)] = ends.map(place)
            && a != b
        {
            self.0.insert([a.min(b), a.max(b)]);
        }
    }

    /// Edges put together, point by point: open lines first, then loops, whose first point is the last as well.
    pub(super) fn chains(self) -> Vec<Vec<Px>> {
        let mut beside: BTreeMap<Place, BTreeSet<Place>> = BTreeMap::new();
        for [a, b] in self.0 {
            beside.entry(a).or_default().insert(b);
            beside.entry(b).or_default().insert(a);
        }
        let ends: Vec<Place> = beside.iter().filter(|(_, to)| to.len() % 2 == 1).map(|(place, _)| *place).collect();
        let all: Vec<Place> = beside.keys().copied().collect();
        let mut chains = Vec::new();
        for start in ends.into_iter().chain(all) {
            while let Some(chain) = walk(&mut beside, start) {
                chains.push(chain.into_iter().map(|place| place.map(|value| value as f64 / STEPS)).collect());
            }
        }
        chains
    }
}

/// From a place along edges that are left, until there is none or the place is reached again; takes them out.
fn walk(beside: &mut BTreeMap<Place, BTreeSet<Place>>, start: Place) -> Option<Vec<Place>> {
    let mut chain = vec![start];
    let mut here = start;
    while let Some(next) = beside.get_mut(&here).and_then(BTreeSet::pop_first) {
        if let Some(back) = beside.get_mut(&next) {
            back.remove(&here);
        }
        chain.push(next);
        here = next;
        if here == start {
            break;
        }
    }
    (chain.len() > 1).then_some(chain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> [Px; 4] {
        [[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
    }

    #[test]
    fn what_neighbours_share_is_no_edge_and_holes_have_theirs() {
        let mut edges = Edges::default();
        for i in 0..3 {
            for j in 0..3 {
                if (i, j) != (1, 1) {
                    edges.add_polygon(&square(f64::from(i), f64::from(j), 1.0));
                }
            }
        }
        let chains = edges.chains();
        let length = |chain: &Vec<Px>| -> f64 {
            chain.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).sum()
        };
        let mut lengths: Vec<f64> = chains.iter().map(length).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(lengths, [4.0, 12.0]);
        assert!(chains.iter().all(|chain| chain.first() == chain.last()));
    }

    #[test]
    fn lines_are_put_together_and_what_is_not_finite_is_left_out() {
        let mut edges = Edges::default();
        for line in
            [[[2.0, 0.0], [3.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]]]
        {
            edges.add_line(line);
        }
        edges.add_line([[f64::NAN, 0.0], [1.0, 0.0]]);
        edges.add_polygon(&[[0.0, 5.0], [f64::INFINITY, 5.0], [0.0, 6.0]]);
        let expected: Vec<Vec<Px>> = vec![vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]];
        assert_eq!(edges.chains(), expected);
    }
}
