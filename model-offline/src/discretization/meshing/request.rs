//! What a mesh is asked for.

use crate::geometry::{Implicit, Point};

/// Lengths of edges wanted, by place.
pub trait Sizes {
    /// At a point, length units.
    fn at(&self, x: &Point<3>) -> f64;

    /// Whether less than `size` is wanted anywhere in the cube round `centre` whose faces are `half` away from it; length
    /// units. A cube may hold a place where little is wanted and none of its corners be near it.
    fn want_less(&self, size: f64, centre: &Point<3>, half: f64) -> bool;
}

/// Corners of a cube.
pub(super) fn corners(centre: &Point<3>, half: f64) -> impl Iterator<Item = Point<3>> {
    let step = move |i: usize, k: usize| if i >> k & 1 == 0 { -half } else { half };
    (0..8).map(move |i| centre + Point::from_fn(|k, _| step(i, k)))
}

/// A function of the point; of a cube its corners alone are looked at: less that is wanted between them is not seen.
impl<F: Fn(&Point<3>) -> f64> Sizes for F {
    fn at(&self, x: &Point<3>) -> f64 {
        self(x)
    }

    fn want_less(&self, size: f64, centre: &Point<3>, half: f64) -> bool {
        corners(centre, half).any(|x| self(&x) < size)
    }
}

/// What to mesh.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The body.
    pub body: &'a dyn Implicit,
    /// Regions whose surfaces faces of tetrahedra follow inside of the body.
    pub interfaces: &'a [&'a dyn Implicit],
    /// Regions of space. What they hold of the body's surface is a patch, whose rim edges follow.
    pub patches: &'a [&'a dyn Implicit],
    /// Lengths of edges wanted. Leaves of the lattice are at most 1.5 times the smallest size wanted in them, and √2 times
    /// the largest at their corners; cut and improved, most edges lie within a factor of two of what is wanted.
    pub size: &'a dyn Sizes,
    /// The lattice is laid for leaves about so wide, so that faces across the axes fall on its planes; length units. Where
    /// it is the same for several meshes of a body, leaves of one are leaves of the others or halves of them, over and
    /// over. None: the smallest size wanted at the middle and the corners of the body's bounds.
    pub lattice: Option<f64>,
    /// More nodes than this are refused.
    pub most_nodes: usize,
    /// Points that shall be nodes. Those outside of the body are ignored, and those so close to a face or to the surface
    /// that a tetrahedron would lose its volume.
    pub pinned: &'a [Point<3>],
}

impl std::fmt::Debug for Request<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Request")
            .field("body", &self.body)
            .field("interfaces", &self.interfaces)
            .field("patches", &self.patches)
            .field("most_nodes", &self.most_nodes)
            .field("pinned", &self.pinned)
            .finish_non_exhaustive()
    }
}
