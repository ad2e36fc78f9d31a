//! What a mesh is asked for.

use crate::geometry::{Implicit, Point};

/// What to mesh.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The body.
    pub body: &'a dyn Implicit,
    /// Regions whose surfaces faces of tetrahedra follow inside of the body.
    pub interfaces: &'a [&'a dyn Implicit],
    /// Regions of space. What they hold of the body's surface is a patch, whose rim edges follow.
    pub patches: &'a [&'a dyn Implicit],
    /// Length of edges wanted at a point, length units. Distances between nodes lie within a factor of 1.5 or so of
    /// it.
    pub size: &'a dyn Fn(&Point<3>) -> f64,
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
