//! Fitting a complex to sheets, one after the other: nodes near a sheet are snapped to it, then edges that still cross
//! it are split where they do. After that no tetrahedron near the owner's surface has corners on both sides of a
//! sheet.

use super::complex::{Complex, Ring};
use super::features::{Features, Kind};
use super::quality::worst_sine;
use crate::geometry::Point;

/// A node is snapped to a sheet that cuts an edge closer to it than this part of the edge.
const NEAR: f64 = 0.32;
/// A snapped node moves no farther than this part of the edge that was cut.
const REACH: f64 = 0.55;
/// Sine of the dihedral angle below which snapping is given up in favour of a cut.
const FLATTEST: f64 = 0.12;
/// The same where a cut is not possible.
const BARELY: f64 = 0.01;
/// Sheets count where the owner's surface is within this many lengths of an edge that they cut.
const BAND: f64 = 1.1;

/// Parts of an edge to look from for a point to split it at, if there is none near where it crosses the sheet.
const ELSEWHERE: [f64; 4] = [0.5, 0.3, 0.7, 0.15];

/// A complex with the sheets that its nodes are on.
#[derive(Debug)]
pub(super) struct Fitted<'a> {
    pub(super) complex: Complex,
    /// Per node, numbers of sheets in increasing order.
    pub(super) on: Vec<Vec<u16>>,
    pub(super) features: Features<'a>,
}

/// An edge that crosses a sheet, nearer to its first node.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    near: u32,
    far: u32,
    /// Part of the edge from `near` to the sheet, at most ½.
    part: f64,
    length: f64,
}

impl<'a> Fitted<'a> {
    pub(super) fn new(complex: Complex, features: Features<'a>) -> Self {
        Self { on: vec![Vec::new(); complex.nodes.len()], complex, features }
    }

    /// Fits the complex to all sheets of an owner. Edges that cannot be split without turning a tetrahedron inside out
    /// are left, for the final checks to find.
    pub(super) fn fit(&mut self, owner: usize) {
        for sheet in self.features.owners[owner].sheets.clone() {
            let mut level = self.levels(owner, sheet);
            self.snap(owner, sheet, &mut level);
            self.cut(owner, sheet, &mut level);
        }
        self.forget(owner);
    }

    /// Level of a sheet at every node. Those that happen to lie on it are noted.
    fn levels(&mut self, owner: usize, sheet: u16) -> Vec<f64> {
        let level: Vec<f64> = self.complex.nodes.iter().map(|x| self.features.level(sheet, x)).collect();
        for n in 0..level.len() as u32 {
            if level[n as usize] == 0.0 && !self.complex.star(n).is_empty() && self.may_be_on(owner, n) {
                let x = self.complex.nodes[n as usize];
                let reach = |m: &u32| (self.complex.nodes[*m as usize] - x).norm();
                let longest = self.complex.neighbours(n).iter().map(reach).fold(0.0, f64::max);
                let farthest = self.features.owners[owner].level(&x).abs().max(self.features.away(sheet, &x));
                if farthest <= BAND * longest {
                    self.note(n, sheet);
                }
            }
        }
        level
    }

    /// Whether a node can be on sheets of an owner: for a patch it must be on the surface, and in the plane of a flat
    /// one.
    fn may_be_on(&self, owner: usize, node: u32) -> bool {
        let o = &self.features.owners[owner];
        o.kind != Kind::Patch
            || (self.is_on_surface(node)
                && o.carrier.is_none_or(|c| self.features.level(c, &self.complex.nodes[node as usize]) == 0.0))
    }

    /// Whether a node is on a sheet of the body.
    pub(super) fn is_on_surface(&self, node: u32) -> bool {
        self.on[node as usize].iter().any(|k| self.features.is_of_body(*k))
    }

    fn note(&mut self, node: u32, sheet: u16) {
        let on = &mut self.on[node as usize];
        if let Err(at) = on.binary_search(&sheet) {
            on.insert(at, sheet);
        }
    }

    /// Edges that cross a sheet where it matters to the owner.
    fn crossings(&self, owner: usize, sheet: u16, level: &[f64]) -> Vec<Crossing> {
        let at = |n: u32| level[n as usize];
        let mixed = |t: &[u32; 4]| t.iter().any(|n| at(*n) < 0.0) && t.iter().any(|n| at(*n) > 0.0);
        let mut crossings = Vec::new();
        for [a, b] in self.complex.edges(mixed) {
            if at(a) * at(b) >= 0.0 || !self.may_be_on(owner, a) || !self.may_be_on(owner, b) {
                continue;
            }
            let part = at(a) / (at(a) - at(b));
            let (p, q) = (self.complex.nodes[a as usize], self.complex.nodes[b as usize]);
            let length = (q - p).norm();
            let o = &self.features.owners[owner];
            let x = p + (q - p) * part;
            let band = BAND * length;
            if o.level(&x).abs() > band || self.features.away(sheet, &x) > band || self.is_hidden(owner, &x, band) {
                continue;
            }
            if o.kind == Kind::Patch {
                let ring = self.complex.ring(a, b, &self.complex.edge_star(a, b));
                if ring.is_none_or(|r| r.closed) {
                    continue;
                }
            }
            crossings.push(if part <= 0.5 {
                Crossing { near: a, far: b, part, length }
            } else {
                Crossing { near: b, far: a, part: 1.0 - part, length }
            });
        }
        crossings
    }

    /// Whether a point on the surface of an interface is inside of a later one, at least so deep.
    fn is_hidden(&self, owner: usize, x: &Point<3>, depth: f64) -> bool {
        let later = || self.features.owners[owner + 1..].iter().filter(|o| o.kind == Kind::Interface);
        self.features.owners[owner].kind == Kind::Interface && later().any(|o| o.level(x) < -depth)
    }

    /// Moves nodes onto the sheet that it almost meets, the nearest first.
    fn snap(&mut self, owner: usize, sheet: u16, level: &mut [f64]) {
        let mut near = self.crossings(owner, sheet, level);
        near.retain(|c| c.part < NEAR);
        near.sort_by(|a, b| a.part.total_cmp(&b.part).then(a.near.cmp(&b.near)).then(a.far.cmp(&b.far)));
        for c in near {
            if level[c.near as usize] * level[c.far as usize] < 0.0 && self.snap_node(c, sheet, FLATTEST) {
                level[c.near as usize] = 0.0;
                self.note(c.near, sheet);
            }
        }
    }

    fn snap_node(&mut self, c: Crossing, sheet: u16, flattest: f64) -> bool {
        let mut on = self.on[c.near as usize].clone();
        on.push(sheet);
        let x = self.complex.nodes[c.near as usize];
        let Some(target) = self.features.project(&x, &on) else { return false };
        if (target - x).norm() > REACH * c.length {
            return false;
        }
        self.complex.nodes[c.near as usize] = target;
        if self.complex.star_quality(c.near) < flattest {
            self.complex.nodes[c.near as usize] = x;
            return false;
        }
        true
    }

    /// Splits edges that cross the sheet, the longest first: of two diagonals of a cut quadrilateral that keeps the
    /// shorter.
    fn cut(&mut self, owner: usize, sheet: u16, level: &mut Vec<f64>) {
        let mut crossings = self.crossings(owner, sheet, level);
        crossings.sort_by(|a, b| {
            let rounded = |c: &Crossing| (c.length * (1.0 - 1e-9)) as f32;
            rounded(b).total_cmp(&rounded(a)).then(a.near.cmp(&b.near)).then(a.far.cmp(&b.far))
        });
        for c in crossings {
            // A node that was snapped after all has none any more.
            if level[c.near as usize] * level[c.far as usize] >= 0.0 {
                continue;
            }
            let star = self.complex.edge_star(c.near, c.far);
            let mut on = self.shared(c.near, c.far, &star);
            on.push(sheet);
            on.sort_unstable();
            let Some(x) = self.place(c, &star, &on) else {
                if self.snap_node(c, sheet, BARELY) {
                    level[c.near as usize] = 0.0;
                    self.note(c.near, sheet);
                }
                continue;
            };
            let m = self.complex.add_node(x);
            self.on.push(on);
            level.push(0.0);
            self.complex.split_edge(c.near, c.far, m);
        }
    }

    /// A point on the sheets `on` to split an edge at: near where it crosses them, or else farther along it or beside
    /// it.
    fn place(&self, c: Crossing, star: &[u32], on: &[u16]) -> Option<Point<3>> {
        let (p, q) = (self.complex.nodes[c.near as usize], self.complex.nodes[c.far as usize]);
        let beside = star.iter().map(|t| self.complex.centroid(self.complex.tetrahedron(*t)));
        let along = [c.part].into_iter().chain(ELSEWHERE).map(|part| p + (q - p) * part);
        let guesses = along.chain(beside).filter_map(|x| self.features.project(&x, on));
        // Sheets that are almost parallel meet far away.
        let is_near = |x: &Point<3>| (x - (p + q) * 0.5).norm() <= c.length;
        guesses.into_iter().find(|x| is_near(x) && self.can_split(c, star, x))
    }

    /// Whether all tetrahedra around an edge stay positive when it is split at `x`.
    fn can_split(&self, c: Crossing, star: &[u32], x: &Point<3>) -> bool {
        star.iter().all(|t| {
            let nodes = self.complex.tetrahedron(*t);
            [c.near, c.far].iter().all(|end| {
                let half = nodes.map(|n| if n == *end { *x } else { self.complex.nodes[n as usize] });
                worst_sine(&half) > 0.0
            })
        })
    }

    /// Sheets that the whole of an edge follows.
    pub(super) fn shared(&self, a: u32, b: u32, star: &[u32]) -> Vec<u16> {
        let common: Vec<u16> =
            self.on[a as usize].iter().copied().filter(|k| self.on[b as usize].contains(k)).collect();
        if common.is_empty() {
            return common;
        }
        let Some(ring) = self.complex.ring(a, b, star) else { return Vec::new() };
        common.into_iter().filter(|k| self.follows(*k, a, b, &ring)).collect()
    }

    /// Whether an edge between two nodes on a sheet follows it, and is no chord beside it: then the sheet separates
    /// what is around the edge, or on the boundary of the complex is part of it.
    fn follows(&self, sheet: u16, a: u32, b: u32, ring: &Ring) -> bool {
        let at = |n: u32| &self.complex.nodes[n as usize];
        let separates = |levels: &mut dyn Iterator<Item = f64>| {
            let (low, high) = levels.fold((0.0_f64, 0.0_f64), |(low, high), l| (low.min(l), high.max(l)));
            low < 0.0 && high > 0.0
        };
        if !ring.closed {
            let ends = [ring.nodes[0], ring.nodes[ring.nodes.len() - 1]];
            if self.features.is_of_body(sheet) && ends.iter().any(|e| self.on[*e as usize].contains(&sheet)) {
                return true;
            }
            let middles = ends.map(|e| (at(a) + at(b) + at(e)) / 3.0);
            if separates(&mut middles.iter().map(|x| self.features.level(sheet, x))) {
                return true;
            }
        }
        let on = |n: &u32| self.on[*n as usize].contains(&sheet);
        let off = ring.nodes.iter().filter(|n| !on(n));
        separates(&mut off.map(|n| self.features.level(sheet, at(*n))))
    }

    /// Forgets sheets of an owner at nodes that are off its surface: beyond an edge of the owner they do not count.
    fn forget(&mut self, owner: usize) {
        for n in 0..self.on.len() as u32 {
            let on = std::mem::take(&mut self.on[n as usize]);
            let x = self.complex.nodes[n as usize];
            let surface = on.iter().any(|k| self.features.is_of_body(*k));
            let counts = |k: &u16| {
                self.features.away(*k, &x) <= self.features.tolerance
                    && self.features.owners[..=owner].iter().any(|o| {
                        o.sheets.contains(k)
                            && (o.kind != Kind::Patch || surface)
                            && o.level(&x).abs() <= self.features.tolerance
                    })
            };
            self.on[n as usize] = on.into_iter().filter(counts).collect();
        }
    }
}
