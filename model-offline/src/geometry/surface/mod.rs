//! Surfaces of triangles: what a file holds, and what is known of one that encloses a volume.

mod check;
mod curved;
mod distance;
mod error;
mod facets;
mod flat;
mod foot;
mod gaps;
mod meet;
mod orient;
mod pieces;
#[cfg(test)]
pub(crate) mod solids;
#[cfg(test)]
mod tests;

pub use distance::CheckedSurface;
pub use error::{Gap, SurfaceError};
pub(crate) use facets::Facets;

use super::point::Point;
use std::collections::HashMap;

/// Triangles in space as a file holds them, nothing checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleSurface {
    /// Corners, in the file's unit of length.
    pub vertices: Vec<Point<3>>,
    /// Corners of each triangle as indices of vertices; seen from outside they run counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleSurface {
    /// A surface of separate triangles, as STL has them: equal corners become one.
    pub fn of_soup(corners: &[[Point<3>; 3]]) -> Self {
        let mut welder = Welder::default();
        let triangles = corners.iter().map(|corners| corners.map(|x| welder.vertex(x))).collect();
        Self { vertices: welder.vertices, triangles }
    }

    /// The same surface with equal vertices made one and those left out that no triangle has. Vertices stand in the
    /// order in which triangles use them first, so that the same triangles give the same surface from every format.
    ///
    /// Only vertices that are equal to the last bit become one: nearly equal ones are a gap, and whether it may be
    /// closed is for whoever made the file to say.
    ///
    /// # Errors
    /// [`SurfaceError::Index`] where a triangle has a vertex that is not there.
    pub fn welded(&self) -> Result<Self, SurfaceError> {
        let mut welder = Welder::default();
        let mut triangles = Vec::with_capacity(self.triangles.len());
        for (number, triangle) in self.triangles.iter().enumerate() {
            let mut welded = [0; 3];
            for (to, from) in welded.iter_mut().zip(triangle) {
                let missing = || SurfaceError::Index { triangle: number, vertex: *from, vertices: self.vertices.len() };
                *to = welder.vertex(*self.vertices.get(*from as usize).ok_or_else(missing)?);
            }
            triangles.push(welded);
        }
        Ok(Self { vertices: welder.vertices, triangles })
    }

    /// Corners of a triangle.
    pub(crate) fn corners(&self, triangle: usize) -> [Point<3>; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex as usize])
    }
}

/// Points, equal ones made one, and where each is among them.
pub(crate) fn welded_points(points: &[Point<3>]) -> (Vec<Point<3>>, Vec<u32>) {
    let mut welder = Welder::default();
    let places = points.iter().map(|x| welder.vertex(*x)).collect();
    (welder.vertices, places)
}

/// Vertices so far, found by their coordinates.
#[derive(Default)]
struct Welder {
    vertices: Vec<Point<3>>,
    found: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn vertex(&mut self, x: Point<3>) -> u32 {
        let next = self.vertices.len() as u32;
        // Zero is equal to minus zero and differs from it in a bit.
        let key = [x.x, x.y, x.z].map(|c| (c + 0.0).to_bits());
        let place = *self.found.entry(key).or_insert(next);
        if place == next {
            self.vertices.push(x);
        }
        place
    }
}
