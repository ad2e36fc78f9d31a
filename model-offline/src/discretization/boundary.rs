//! Integration points on the boundary of the body: for tractions, and for Nitsche's method.

use super::cells::nodal_cells::Across;
use super::{Planar, ShapeError, Stencil};
use crate::geometry::{Point, Point2};

/// An integration point on the boundary.
#[derive(Debug, Clone)]
pub struct BoundaryPoint {
    /// Where it is.
    pub position: Point2,
    /// Outward unit normal.
    pub normal: Point2,
    /// Weight: reference length.
    pub weight: f64,
    /// The cell it bounds.
    pub cell: u32,
    /// Shape functions there.
    pub stencil: Stencil<2>,
}

impl Planar {
    /// Integration points on the whole boundary: those of the cells' own edges, with the rule that the cells' gradients
    /// were averaged with, so that boundary and domain terms are consistent to rounding.
    ///
    /// # Errors
    /// [`ShapeError`], which building the body has ruled out already.
    pub fn boundary_points(&self) -> Result<Vec<BoundaryPoint>, ShapeError> {
        self.points_on_edges(|a, b| vec![(a, b)])
    }

    /// Integration points on the part of the boundary that lies on a polyline; edges of cells are cut where it ends.
    ///
    /// # Errors
    /// [`ShapeError`], which building the body has ruled out already.
    pub fn boundary_points_on(&self, path: &[Point2]) -> Result<Vec<BoundaryPoint>, ShapeError> {
        self.points_on_edges(|a, b| path.windows(2).filter_map(|s| overlap(a, b, s[0], s[1])).collect())
    }

    fn points_on_edges(
        &self,
        pieces: impl Fn(Point2, Point2) -> Vec<(Point2, Point2)>,
    ) -> Result<Vec<BoundaryPoint>, ShapeError> {
        let rule = self.edge_rule();
        let mut points = Vec::new();
        for (cell, (a, b)) in self.outer_edges() {
            for (a, b) in pieces(a, b) {
                let along = b - a;
                let length = along.norm();
                if length == 0.0 {
                    continue;
                }
                for &(s, weight) in rule {
                    let position = a + along * s;
                    points.push(BoundaryPoint {
                        position,
                        normal: Point2::new(along.y, -along.x) / length,
                        weight: weight * length,
                        cell,
                        stencil: self.value_stencil(&position)?,
                    });
                }
            }
        }
        Ok(points)
    }

    fn outer_edges(&self) -> impl Iterator<Item = (u32, (Point2, Point2))> + '_ {
        self.cells().iter().enumerate().flat_map(|(cell, c)| {
            c.edges()
                .filter(|(_, _, across)| matches!(across, Across::Outline(_)))
                .map(move |(a, b, _)| (cell as u32, (a, b)))
        })
    }

    /// Nodal forces of a traction on the boundary, `f_I = ∮ Ψ_I t dΓ`, D numbers per node. `traction` gets position and
    /// outward normal and gives force per reference area.
    ///
    /// # Errors
    /// [`ShapeError`], which building the body has ruled out already.
    pub fn boundary_force(&self, traction: impl Fn(Point2, Point2) -> Point2) -> Result<Vec<f64>, ShapeError> {
        let mut force = vec![0.0; 2 * self.positions().len()];
        for point in self.boundary_points()? {
            add_force(&mut force, &point.stencil, traction(point.position, point.normal) * point.weight);
        }
        Ok(force)
    }

    /// Nodal forces of a body force, `f_I = ∫ Ψ_I b dΩ`, integrated to degree 4 over a fan of triangles per cell.
    ///
    /// # Errors
    /// [`ShapeError`], which building the body has ruled out already.
    pub fn body_force(&self, force_density: impl Fn(Point2) -> Point2) -> Result<Vec<f64>, ShapeError> {
        let mut force = vec![0.0; 2 * self.positions().len()];
        self.integrate(|x, weight, planar| {
            add_force(&mut force, &planar.value_stencil(&x)?, force_density(x) * weight);
            Ok(())
        })?;
        Ok(force)
    }

    /// Calls `visit(position, weight, self)` at integration points of degree 4 that tile the body.
    ///
    /// # Errors
    /// Those of `visit`.
    pub fn integrate(
        &self,
        mut visit: impl FnMut(Point2, f64, &Self) -> Result<(), ShapeError>,
    ) -> Result<(), ShapeError> {
        for cell in self.cells() {
            let centre = cell.centroid();
            for (a, b, _) in cell.edges() {
                let area = 0.5 * crate::geometry::cross(a - centre, b - centre);
                for (l, weight) in super::quadrature::integration::TRIANGLE_6 {
                    visit(centre * l[0] + a * l[1] + b * l[2], weight * area, self)?;
                }
            }
        }
        Ok(())
    }
}

fn add_force(force: &mut [f64], stencil: &Stencil<2>, value: Point<2>) {
    for (&i, psi) in stencil.nodes.iter().zip(&stencil.values) {
        force[2 * i as usize] += psi * value.x;
        force[2 * i as usize + 1] += psi * value.y;
    }
}

/// The common part of two collinear segments, in the direction of the first.
fn overlap(a: Point2, b: Point2, c: Point2, d: Point2) -> Option<(Point2, Point2)> {
    let along = b - a;
    let length = along.norm();
    if length == 0.0 {
        return None;
    }
    let off = |p: Point2| (crate::geometry::cross(along, p - a) / length).abs();
    if off(c) > 1e-9 * length.max((d - c).norm()) || off(d) > 1e-9 * length.max((d - c).norm()) {
        return None;
    }
    let station = |p: Point2| (p - a).dot(&along) / (length * length);
    let (s, t) = (station(c).min(station(d)).max(0.0), station(c).max(station(d)).min(1.0));
    (t - s > 1e-12).then(|| (a + along * s, a + along * t))
}
