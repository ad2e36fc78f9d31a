//! Nodal cells: the Voronoi cells of the nodes, clipped by the outline. They tile the body exactly.
//!
//! On a lattice they are the lattice squares clipped by the outline.

use super::cell_loops::tidied;
use super::triangulation::TriangulationError;
use crate::geometry::{Point, Point2, Polygon, clip_half_plane, signed_area};

/// What lies on the other side of a cell's edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Across {
    /// Another cell.
    Cell(u32),
    /// Nothing: this edge of the outline (`u32::MAX` where it is not known which).
    Outline(u32),
    /// Nothing, on either side: the edge leads to another piece of the cell, and back.
    Bridge,
}

/// A node's cell.
#[derive(Debug, Clone)]
pub struct NodalCell {
    /// Corners, counter-clockwise, each with what lies across the edge to the next corner.
    pub boundary: Vec<(Point2, Across)>,
    /// Area.
    pub area: f64,
}

impl NodalCell {
    /// Edges as (start, end, across).
    pub fn edges(&self) -> impl Iterator<Item = (Point2, Point2, Across)> + '_ {
        let n = self.boundary.len();
        (0..n).map(move |i| (self.boundary[i].0, self.boundary[(i + 1) % n].0, self.boundary[i].1))
    }

    /// Centroid.
    pub fn centroid(&self) -> Point2 {
        let origin = self.boundary.first().map_or_else(Point2::zeros, |c| c.0);
        let moment = self.edges().fold(Point2::zeros(), |sum, (a, b, _)| {
            sum + (a + b - origin * 2.0) * (crate::geometry::cross(a - origin, b - origin) / 6.0)
        });
        origin + moment / self.area
    }

    /// Corners without labels.
    pub fn corners(&self) -> Vec<Point2> {
        self.boundary.iter().map(|c| c.0).collect()
    }
}

/// Voronoi cells of the nodes, clipped by the outline.
///
/// # Errors
/// Nodes that coincide.
pub fn clipped_voronoi(nodes: &[Point<2>], outline: &Polygon) -> Result<Vec<NodalCell>, TriangulationError> {
    let neighbours = super::triangulation::neighbours(nodes)?;
    let boundary: Vec<(Point2, Across)> =
        outline.vertices().iter().enumerate().map(|(i, &v)| (v, Across::Outline(i as u32))).collect();
    let mut scratch = Vec::new();
    let (convex, tolerance) = (outline.is_convex(), 1e-10 * outline.size());
    Ok(nodes
        .iter()
        .zip(&neighbours)
        .map(|(x, near)| {
            let mut cut = |from: Vec<(Point2, Across)>| cut_by_bisectors(from, x, near, nodes, &mut scratch);
            let cell = cut(square_around(x, outline.size()));
            let radius = cell.iter().map(|c| (c.0 - x).norm()).fold(0.0, f64::max);
            // Near the boundary it is the body that is cut, so that its edges stay exactly what they are.
            let boundary = match radius < outline.distance_to_boundary(*x) {
                true => cell,
                false if convex => cut(boundary.clone()),
                false => tidied(&cut(boundary.clone()), Across::Bridge, tolerance),
            };
            let corners: Vec<Point2> = boundary.iter().map(|c| c.0).collect();
            NodalCell { area: signed_area(&corners).max(0.0), boundary }
        })
        .collect())
}

/// A square around `x` larger than the body.
fn square_around(x: &Point2, size: f64) -> Vec<(Point2, Across)> {
    let corner = |sx: f64, sy: f64| (x + Point2::new(sx, sy) * (2.0 * size), Across::Outline(u32::MAX));
    vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]
}

/// The part of a loop nearer to `x` than to its Delaunay neighbours.
fn cut_by_bisectors(
    mut current: Vec<(Point2, Across)>,
    x: &Point2,
    neighbours: &[u32],
    nodes: &[Point<2>],
    scratch: &mut Vec<(Point2, Across)>,
) -> Vec<(Point2, Across)> {
    for &i in neighbours {
        let other = nodes[i as usize];
        clip_half_plane(&current, (x + other) * 0.5, other - x, Across::Cell(i), scratch);
        std::mem::swap(&mut current, scratch);
    }
    current
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_scattered_nodes_tile_a_non_convex_body() {
        let outline = Polygon::new(
            [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 0.6], [0.0, 1.4]].iter().map(|p| Point2::from(*p)).collect(),
        )
        .unwrap();
        let mut nodes = Vec::new();
        let mut state = 3_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        while nodes.len() < 80 {
            let p = Point2::new(2.0 * random(), 1.4 * random());
            if outline.contains(p) {
                nodes.push(p);
            }
        }
        let cells = clipped_voronoi(&nodes, &outline).unwrap();
        let total: f64 = cells.iter().map(|c| c.area).sum();
        assert!((total - outline.area()).abs() < 1e-13 * outline.area(), "{total}");
        assert!(cells.iter().all(|c| c.area > 0.0));
        // ∮ n dΓ = 0 on every cell: what makes a constant field strain-free under SCNI.
        for cell in &cells {
            let closed: Point2 = cell.edges().map(|(a, b, _)| Point2::new(b.y - a.y, a.x - b.x)).sum();
            assert!(closed.norm() < 1e-14);
        }
    }
}
