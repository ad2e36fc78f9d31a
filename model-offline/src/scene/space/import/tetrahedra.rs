//! What files of tetrahedra hold.

use super::error::{Place, ReadError};
use crate::geometry::Point;
use std::collections::HashMap;

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

impl Tetrahedra {
    /// These, if every one has four nodes of its own and stands there once.
    ///
    /// # Errors
    /// [`ReadError::Broken`] names the first that does not.
    pub(super) fn distinct(self, format: &'static str) -> Result<Self, ReadError> {
        let mut seen = HashMap::new();
        for (k, tetrahedron) in self.tetrahedra.iter().enumerate() {
            let mut corners = *tetrahedron;
            corners.sort_unstable();
            let [x, y, z] = self.nodes[tetrahedron[0] as usize].into();
            let at = format!("at ({x}, {y}, {z})");
            if corners.windows(2).any(|pair| pair[0] == pair[1]) {
                let what =
                    format!("tetrahedron {k}, {at}, has a node twice: the file is damaged, or mesh the body again");
                return Err(ReadError::broken(format, Place::Whole, what));
            }
            if let Some(first) = seen.insert(corners, k) {
                let what = format!("tetrahedra {first} and {k}, {at}, are the same: save every one once");
                return Err(ReadError::broken(format, Place::Whole, what));
            }
        }
        Ok(self)
    }
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
