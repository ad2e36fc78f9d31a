//! Where the middle nodes of quadratic tetrahedra go: on curved surfaces, on rims, and at the quarter points beside rims.

use super::patches::Surface;
use crate::discretization::TetMesh;
use crate::geometry::{Implicit, Point};
use std::collections::{BTreeMap, BTreeSet};

/// Steps of a projection; each squares what is left.
const STEPS: usize = 8;
/// A projection that moves a node farther than this share of its edge has gone astray.
const FARTHEST: f64 = 0.25;

/// A level and its gradient.
type Level<'a> = &'a dyn Fn(&Point<3>) -> (f64, Point<3>);

/// Rules for middle nodes.
pub(super) struct Middles<'a> {
    pub(super) mesh: &'a TetMesh,
    pub(super) body: &'a dyn Implicit,
    pub(super) surface_edges: BTreeSet<(u32, u32)>,
    /// Edges along rims, with the region that each is the rim of.
    pub(super) rims: BTreeMap<(u32, u32), &'a dyn Implicit>,
    /// Nodes of rims, and of the body's re-entrant edges: where the solution is singular.
    pub(super) singular: BTreeSet<u32>,
    /// Edges on the surfaces of inclusions.
    pub(super) interfaces: BTreeMap<(u32, u32), &'a dyn Implicit>,
}

impl<'a> Middles<'a> {
    /// The rules of a mesh with patches (each with its region) and inclusions.
    pub(super) fn new(
        mesh: &'a TetMesh,
        surface: &Surface<'_>,
        body: &'a dyn Implicit,
        patches: &[(Vec<[u32; 3]>, &'a dyn Implicit)],
        inclusions: &[&'a dyn Implicit],
    ) -> Self {
        let rims: BTreeMap<_, _> = patches
            .iter()
            .flat_map(|(patch, region)| surface.rim(patch).into_iter().map(move |edge| (edge, *region)))
            .collect();
        Self {
            mesh,
            body,
            surface_edges: surface.edges(),
            singular: rims.keys().copied().chain(surface.reentrant(body)).flat_map(|(a, b)| [a, b]).collect(),
            rims,
            interfaces: interface_edges(mesh, inclusions),
        }
    }

    /// Where the middle node of an edge goes; none leaves it in the middle.
    pub(super) fn place(&self, a: u32, b: u32) -> Option<Point<3>> {
        let (x, y) = (self.mesh.nodes[a as usize], self.mesh.nodes[b as usize]);
        let (length, edge) = ((y - x).norm(), (a, b));
        let middle = (x + y) * 0.5;
        if let Some(rim) = self.rims.get(&edge) {
            let onto: [Level<'_>; 2] = [&|x| (self.body.level(x), self.body.gradient(x)), &|x| {
                (rim.patch_level(x), patch_gradient(*rim, x, length))
            }];
            return projected(middle, &onto, length);
        }
        let start = match (self.singular.contains(&a), self.singular.contains(&b)) {
            (true, false) => x + (y - x) * 0.25,
            (false, true) => y + (x - y) * 0.25,
            _ => middle,
        };
        let onto =
            if self.surface_edges.contains(&edge) { Some(self.body) } else { self.interfaces.get(&edge).copied() };
        match onto {
            Some(surface) => {
                let onto: [Level<'_>; 1] = [&|x| (surface.level(x), surface.gradient(x))];
                projected(start, &onto, length)
            }
            None => (start != middle).then_some(start),
        }
    }
}

/// Slope of what decides a patch, by differences over a thousandth of an edge, off the plane of a flat region ignored.
fn patch_gradient(region: &dyn Implicit, x: &Point<3>, length: f64) -> Point<3> {
    let step = 1e-4 * length;
    Point::<3>::from_fn(|k, _| {
        let (mut up, mut down) = (*x, *x);
        up[k] += step;
        down[k] -= step;
        let (up, down) = (region.patch_level(&up), region.patch_level(&down));
        // Leaving the plane of a flat region costs on both sides: no slope.
        if up > region.patch_level(x) && down > region.patch_level(x) { 0.0 } else { (up - down) / (2.0 * step) }
    })
}

/// The point near `start` where all levels vanish, by Gauss–Newton steps of least length; none where there is none near.
fn projected(start: Point<3>, onto: &[Level<'_>], length: f64) -> Option<Point<3>> {
    let mut x = start;
    for _ in 0..STEPS {
        for surface in onto {
            let (level, gradient) = surface(&x);
            let square = gradient.norm_squared();
            if square > 0.0 {
                x -= gradient * (level / square);
            }
        }
    }
    let there = onto.iter().all(|surface| surface(&x).0.abs() < 1e-6 * length);
    (there && x != start && (x - start).norm() < FARTHEST * length).then_some(x).or(Some(start))
}

/// Edges of faces between the parts of a mesh, with the inclusion that bends them.
fn interface_edges<'a>(mesh: &TetMesh, inclusions: &[&'a dyn Implicit]) -> BTreeMap<(u32, u32), &'a dyn Implicit> {
    let mut parts: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut edges = BTreeMap::new();
    for (t, &part) in mesh.tetrahedra.iter().zip(&mesh.part) {
        for face in crate::discretization::meshing::quality::FACES {
            let corners = face.map(|k| t[k]);
            let mut key = corners;
            key.sort_unstable();
            let Some(other) = parts.insert(key, part) else { continue };
            let inclusion = part.max(other).checked_sub(1).and_then(|i| inclusions.get(i as usize));
            if let (true, Some(inclusion)) = (other != part, inclusion) {
                edges.extend(super::patches::edges(&corners).map(|edge| (edge, *inclusion)));
            }
        }
    }
    edges
}
