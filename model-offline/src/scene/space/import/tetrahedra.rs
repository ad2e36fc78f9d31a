//! What files of tetrahedra hold.

use crate::geometry::Point;

/// Tetrahedra as a file holds them, and the groups that they are in; nothing is checked about how they fit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tetrahedra {
    /// Positions, in the file's unit of length.
    pub nodes: Vec<Point<3>>,
    /// Corners as indices of nodes, all of them there.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Physical groups, or values of a region array; one tetrahedron may be in several.
    pub groups: Vec<Group>,
}

/// Tetrahedra that belong together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Its number.
    pub label: i64,
    /// Its name, where the file has one.
    pub name: Option<String>,
    /// Indices of its tetrahedra.
    pub members: Vec<u32>,
}
