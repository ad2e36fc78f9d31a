//! A planar body discretised: nodes, cells and an integration rule, from nodes that are given.

use super::nodal_cells::clipped_voronoi;
use super::{NodalCell, NodeCloud, Point, Quadrature, ShapeError, ShapeFunctions, Stencil, integration};
use crate::scene::schema::{Basis, Integration};
use crate::scene::{Point2, Polygon};
use std::sync::Arc;

/// How the displacement is approximated and the weak form integrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// Integration rule.
    pub integration: Integration,
    /// Basis of the shape functions.
    pub basis: Basis,
    /// Kernel support over local spacing.
    pub support: f64,
}

/// Nodes, cells that tile the body, and an integration rule over them. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Planar {
    cloud: Arc<NodeCloud<2>>,
    cells: Arc<Vec<NodalCell>>,
    rule: Arc<Quadrature<2>>,
    method: Method,
}

impl Planar {
    /// Discretises the body inside `outline` with the given nodes, each with its local spacing.
    ///
    /// # Errors
    /// [`ShapeError`] names the node whose moment matrix fails.
    pub fn new(outline: &Polygon, nodes: Vec<Point2>, spacing: &[f64], method: Method) -> Result<Self, ShapeError> {
        let half_widths = spacing.iter().map(|h| h * method.support).collect();
        let cells = clipped_voronoi(&nodes, outline);
        let cloud = NodeCloud::new(nodes, half_widths);
        let shape = ShapeFunctions::new(&cloud, method.basis);
        let rule = match method.integration {
            Integration::Dni => integration::direct_nodal(&shape, &cells)?,
            _ => integration::stabilised_conforming_nodal(&shape, &cells)?,
        };
        Ok(Self { cloud: Arc::new(cloud), cells: Arc::new(cells), rule: Arc::new(rule), method })
    }

    /// The nodes.
    pub fn cloud(&self) -> &NodeCloud<2> {
        &self.cloud
    }

    /// Node positions.
    pub fn positions(&self) -> &[Point<2>] {
        self.cloud.positions()
    }

    /// Cells that tile the body.
    pub fn cells(&self) -> &[NodalCell] {
        &self.cells
    }

    /// The integration rule.
    pub fn rule(&self) -> &Arc<Quadrature<2>> {
        &self.rule
    }

    /// How the displacement is approximated.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Values of the shape functions at a point: `u(X) = Σ_I Ψ_I(X) d_I`.
    ///
    /// # Errors
    /// [`ShapeError`] where too few kernels cover the point.
    pub fn value_stencil(&self, x: &Point<2>) -> Result<Stencil<2>, ShapeError> {
        ShapeFunctions::new(&self.cloud, self.method.basis).at(x, false)
    }
}
