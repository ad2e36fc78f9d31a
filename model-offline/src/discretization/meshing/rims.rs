//! Curves on the surface of a body: rims of patches and sharp edges, where solutions are singular and sizes small.

use super::features::{Features, Kind, Owner};
use super::mesh::TetMesh;
use super::request::Request;
use crate::geometry::{Implicit, Point};
use rstar::RTree;
use std::collections::BTreeMap;

/// Points kept are at least this part of the spacing apart.
const APART: f64 = 0.7;

/// Points of the rim of a patch, that is of the boundary of what `region` holds of the surface of `body`, roughly
/// `spacing` (length units) apart; corners are among them. Empty if there is no rim or the body has no bounds.
pub fn rim_points(body: &dyn Implicit, region: &dyn Implicit, spacing: f64) -> Vec<Point<3>> {
    let (patches, everywhere) = ([region], |_: &Point<3>| spacing);
    let Some(curves) = Curves::new(body, &[], &patches, &everywhere) else { return Vec::new() };
    let [of_body, of_region] = [0, 1].map(|o| curves.features.owners[o].sheets.clone());
    let carrier = curves.features.owners[1].carrier;
    let tolerance = curves.features.tolerance;
    let mut sets: Vec<Vec<u16>> = Vec::new();
    for a in &of_body {
        sets.extend(of_region.iter().chain(&carrier).filter(|b| *b != a).map(|b| vec![*a, *b]));
    }
    // A flat patch ends where its plane leaves the surface, whatever its level there; elsewhere where its level
    // vanishes.
    let on_carrier = |x: &Point<3>| {
        let edge = |k: &u16| Some(*k) != carrier && curves.features.level(*k, x) == 0.0;
        carrier.is_some_and(|c| curves.features.level(c, x) == 0.0) && of_body.iter().any(edge)
    };
    curves.points(&sets, |x| {
        let level = region.patch_level(x);
        body.level(x).abs() <= tolerance && (level.abs() <= tolerance || (level < 0.0 && on_carrier(x)))
    })
}

/// Points of the sharp edges of a body, roughly `spacing` (length units) apart; corners are among them. Empty if it
/// has none or no bounds.
pub fn feature_points(body: &dyn Implicit, spacing: f64) -> Vec<Point<3>> {
    let everywhere = |_: &Point<3>| spacing;
    let Some(curves) = Curves::new(body, &[], &[], &everywhere) else { return Vec::new() };
    let sheets = curves.features.owners[0].sheets.clone();
    let tolerance = curves.features.tolerance;
    let pairs = |i: usize| sheets[i + 1..].iter().map(move |b| (i, *b));
    let sets: Vec<Vec<u16>> = (0..sheets.len()).flat_map(pairs).map(|(i, b)| vec![sheets[i], b]).collect();
    curves.points(&sets, |x| body.level(x).abs() <= tolerance)
}

/// Points of the surface of `region` inside of `body`, roughly `spacing` (at a point; length units) apart: where an
/// interface is to be resolved. However small a part of the surface is, there is a point of it. Empty if the body has no
/// bounds.
pub fn surface_points(body: &dyn Implicit, region: &dyn Implicit, spacing: &dyn Fn(&Point<3>) -> f64) -> Vec<Point<3>> {
    let interfaces = [region];
    let Some(curves) = Curves::new(body, &interfaces, &[], spacing) else { return Vec::new() };
    let sets: Vec<Vec<u16>> = curves.features.owners[1].sheets.iter().map(|k| vec![*k]).collect();
    let tolerance = curves.features.tolerance;
    curves.points(&sets, |x| region.level(x).abs() <= tolerance && body.level(x) <= tolerance)
}

/// A search for points on curves and surfaces.
struct Curves<'a> {
    features: Features<'a>,
    bounds: (Point<3>, Point<3>),
    spacing: &'a dyn Fn(&Point<3>) -> f64,
    /// Whether points inside of the body count.
    within: bool,
}

impl<'a> Curves<'a> {
    fn new(
        body: &'a dyn Implicit,
        interfaces: &'a [&'a dyn Implicit],
        patches: &'a [&'a dyn Implicit],
        spacing: &'a dyn Fn(&Point<3>) -> f64,
    ) -> Option<Self> {
        let bounds = body.bounds()?;
        let request =
            Request { body, interfaces, patches, size: &|_: &Point<3>| 1.0, lattice: None, most_nodes: 0, pinned: &[] };
        let features = Features::new(&request, (bounds.1 - bounds.0).max());
        Some(Self { features, bounds, spacing, within: !interfaces.is_empty() })
    }

    /// Points on all sheets of one of the `sets` that `belongs` accepts, thinned out; corners first.
    fn points(&self, sets: &[Vec<u16>], belongs: impl Fn(&Point<3>) -> bool) -> Vec<Point<3>> {
        let mut cubes = Vec::new();
        let (low, high) = self.bounds;
        let middle = 0.5 * (low + high);
        let half = 0.5 * (high - low).max() + (self.spacing)(&middle);
        self.search(middle, half, &mut cubes);
        let mut corners: Vec<Point<3>> = Vec::new();
        let mut along: Vec<(usize, Point<3>)> = Vec::new();
        for (centre, half) in cubes {
            // Sheets that may meet the ball round this cube.
            let close = |k: &u16| self.features.level(*k, &centre).abs() < 2.0 * half;
            let near: Vec<(usize, &Vec<u16>)> = sets.iter().enumerate().filter(|(_, s)| s.iter().all(close)).collect();
            let found = |on: &[u16]| {
                let x = self.features.project(&centre, on)?;
                let free = self.features.tangents(&x, on).len();
                (free == 3 - on.len() && (x - centre).norm() < 4.0 * half && belongs(&x)).then_some(x)
            };
            for (i, (number, set)) in near.iter().enumerate() {
                // Curves of one rim are one; surfaces beside each other may be those of different things.
                let one = if set.len() == 1 { *number } else { 0 };
                along.extend(found(set).map(|x| (one, x)));
                let more = near[i + 1..].iter().flat_map(|(_, s)| s.iter().copied()).filter(|k| !set.contains(k));
                let mut more: Vec<u16> = more.collect();
                more.sort_unstable();
                more.dedup();
                let with = |k: u16| set.iter().copied().chain([k]).collect::<Vec<u16>>();
                if set.len() == 2 {
                    corners.extend(more.into_iter().filter_map(|k| found(&with(k))));
                }
            }
        }
        self.thin(corners, along)
    }

    /// Cubes half as wide as the spacing that every owner's surface may meet.
    fn search(&self, centre: Point<3>, half: f64, out: &mut Vec<(Point<3>, f64)>) {
        // Levels grow about as fast as distances; a margin makes up for those that grow faster.
        let reach = 2.0 * half;
        let meets = |o: &Owner<'_>| {
            let level = o.level(&centre);
            match o.kind {
                // Curves lie on the surface of the body, surfaces of interfaces inside of it.
                Kind::Body => level < reach && (self.within || level > -reach),
                Kind::Interface => level.abs() < reach,
                // A flat patch may end where its level is negative.
                Kind::Patch => level < reach && (o.carrier.is_some() || level > -reach),
            }
        };
        if !self.features.owners.iter().all(meets) {
            return;
        }
        if half <= 0.26 * (self.spacing)(&centre) {
            out.push((centre, half));
            return;
        }
        for i in 0..8 {
            let step = |k: usize| if i >> k & 1 == 0 { -0.5 * half } else { 0.5 * half };
            self.search(centre + Point::from_fn(|k, _| step(k)), 0.5 * half, out);
        }
    }

    /// Corners once each, then points that keep away from them and from others of the same number: a void beside a face is no
    /// part of that face.
    fn thin(&self, corners: Vec<Point<3>>, along: Vec<(usize, Point<3>)>) -> Vec<Point<3>> {
        let mut points = Vec::new();
        let mut corners_kept: RTree<[f64; 3]> = RTree::new();
        let mut kept: BTreeMap<usize, RTree<[f64; 3]>> = BTreeMap::new();
        let distance = |kept: &RTree<[f64; 3]>, x: &Point<3>| {
            kept.nearest_neighbor(&[x.x, x.y, x.z]).map_or(f64::INFINITY, |p| (Point::from(*p) - x).norm())
        };
        for x in corners {
            if distance(&corners_kept, &x) >= 1e-3 * (self.spacing)(&x) {
                corners_kept.insert([x.x, x.y, x.z]);
                points.push(x);
            }
        }
        for (number, x) in along {
            let own = kept.entry(number).or_default();
            if distance(&corners_kept, &x).min(distance(own, &x)) >= APART * (self.spacing)(&x) {
                own.insert([x.x, x.y, x.z]);
                points.push(x);
            }
        }
        points
    }
}

/// Triangles of the boundary that a patch holds, out of those given: those in its region, whose own surface belongs to it, to
/// `tolerance`, length units.
pub fn patch_triangles(mesh: &TetMesh, boundary: &[[u32; 3]], region: &dyn Implicit, tolerance: f64) -> Vec<[u32; 3]> {
    let at = |n: u32| mesh.nodes[n as usize];
    let held = |t: &&[u32; 3]| {
        let middle = t.iter().map(|n| at(*n)).sum::<Point<3>>() / 3.0;
        t.iter().all(|n| region.holds(&at(*n), tolerance)) && region.holds(&middle, tolerance)
    };
    boundary.iter().filter(held).copied().collect()
}

/// Whether a triangle of the boundary has a node in the patch, off its rim, and another off the patch. Where the plane
/// of a flat patch leaves the surface, there is its rim.
pub fn straddles(mesh: &TetMesh, triangle: &[u32; 3], region: &dyn Implicit, tolerance: f64) -> bool {
    let at = |n: &u32| mesh.nodes[*n as usize];
    let in_plane = |c: crate::geometry::Sheet<'_>| triangle.iter().all(|n| c.level(&at(n)).abs() <= tolerance);
    let levels = triangle.map(|n| region.patch_level(&at(&n)));
    region.carrier().is_none_or(in_plane)
        && levels.iter().any(|l| *l < -tolerance)
        && levels.iter().any(|l| *l > tolerance)
}
