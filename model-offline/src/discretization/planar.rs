//! A planar body discretised: nodes, cells and an integration rule, from nodes that are given.

use super::approximation::sight::{OutlineSight, Sight};
use super::cells::nodal_cells::{Across, clipped_voronoi};
use super::cells::triangulation::{TriangulationError, triangulate};
use super::method::{Integration, Method};
use super::quadrature::finite_element::Elements;
use super::quadrature::{integration, subcells};
use super::{NodalCell, NodeCloud, Quadrature, ShapeError, ShapeFunctions, Stencil, Wanted};
use crate::geometry::{Point, Point2, Polygon};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Why a body cannot be discretised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DiscretizationError {
    /// Shape functions do not exist somewhere.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The nodes cannot be triangulated.
    #[error(transparent)]
    Triangulation(#[from] TriangulationError),
    /// A rule that is not there in the plane.
    #[error("integration {0} is one of space: in the plane take fem-t3 or fem-t6")]
    Spatial(Integration),
}

#[derive(Debug)]
enum Approximation {
    Kernels(NodeCloud<2>),
    Elements(Elements),
}

/// Nodes, cells that tile the body, and an integration rule over them. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Planar {
    approximation: Arc<Approximation>,
    cells: Arc<Vec<NodalCell>>,
    rule: Arc<Quadrature<2>>,
    method: Method,
}

impl Planar {
    /// Discretises the body inside `outline` with the given nodes; triangles follow the edges of `inclusions`. Their local spacing, which supports are relative to,
    /// is either given or taken from the nodal cells. Quadratic triangles add nodes of their own.
    ///
    /// # Errors
    /// [`DiscretizationError`] names the node whose moment matrix fails, or says why there is no triangulation.
    pub fn new(
        outline: &Polygon,
        inclusions: &[Polygon],
        nodes: Vec<Point2>,
        spacing: Option<f64>,
        method: Method,
    ) -> Result<Self, DiscretizationError> {
        if !Integration::PLANAR.contains(&method.integration) {
            return Err(DiscretizationError::Spatial(method.integration));
        }
        if method.integration.is_element() {
            let triangles = triangulate(&nodes, outline, inclusions)?;
            return Ok(Self::on_triangles(nodes, triangles, method));
        }
        let mut cells = Vec::new();
        if spacing.is_none() || method.integration != Integration::Gauss {
            cells = clipped_voronoi(&nodes, outline)?;
        }
        let half_widths = match spacing {
            Some(h) => vec![h * method.support; nodes.len()],
            None if by_natural_neighbours(method.integration) => {
                natural_neighbour_distance(&nodes, &cells).into_iter().map(|h| h * method.support).collect()
            }
            None => local_spacing(&nodes, &cells).into_iter().map(|h| h * method.support).collect(),
        };
        let mut triangles = Vec::new();
        if method.integration == Integration::Gauss {
            triangles = triangulate(&nodes, outline, inclusions)?;
            cells = Elements::linear(nodes.clone(), triangles.clone()).cells();
        }
        let sight = OutlineSight::of(outline).map(|sight| Arc::new(sight) as Arc<dyn Sight<2>>);
        let cloud = NodeCloud::new(nodes, half_widths).in_sight(sight);
        let shape = ShapeFunctions::new(&cloud, method.basis);
        let rule = match method.integration {
            Integration::Dni => integration::direct_nodal(&shape, &cells)?,
            Integration::Nsni => integration::naturally_stabilised_nodal(&shape, &cells, method.consistency)?,
            Integration::Gauss => integration::gauss(&shape, &triangles, &cells, method.basis, method.consistency)?,
            Integration::ScniStabilised => subcells::scni_stabilised(&shape, &cells, subcells::STABILISATION)?,
            Integration::Mscni => subcells::modified_scni(&shape, &cells)?,
            Integration::Scni | Integration::FemT3 | Integration::FemT6 | Integration::FemT4 | Integration::FemT10 => {
                integration::stabilised_conforming_nodal(&shape, &cells)?
            }
        };
        Ok(Self {
            approximation: Arc::new(Approximation::Kernels(cloud)),
            cells: Arc::new(cells),
            rule: Arc::new(rule),
            method,
        })
    }

    /// Finite elements on triangles that are given: linear ones for `fem-t3`, else quadratic ones.
    pub fn on_triangles(nodes: Vec<Point2>, triangles: Vec<[u32; 3]>, method: Method) -> Self {
        let elements = match method.integration {
            Integration::FemT3 => Elements::linear(nodes, triangles),
            _ => Elements::quadratic(nodes, triangles),
        };
        let (cells, rule) = (elements.cells(), elements.rule());
        Self {
            approximation: Arc::new(Approximation::Elements(elements)),
            cells: Arc::new(cells),
            rule: Arc::new(rule),
            method,
        }
    }

    /// Node positions, those that elements add included.
    pub fn positions(&self) -> &[Point<2>] {
        match &*self.approximation {
            Approximation::Kernels(cloud) => cloud.positions(),
            Approximation::Elements(elements) => elements.positions(),
        }
    }

    /// Cells that tile the body: nodal cells or triangles.
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

    /// Gauss points per boundary edge: those that cell gradients are averaged with.
    pub(super) fn edge_rule(&self) -> &'static [(f64, f64)] {
        match self.method.integration {
            Integration::Dni
            | Integration::Scni
            | Integration::ScniStabilised
            | Integration::Mscni
            | Integration::Nsni => &integration::GAUSS_2,
            Integration::Gauss | Integration::FemT3 | Integration::FemT6 | Integration::FemT4 | Integration::FemT10 => {
                &integration::GAUSS_3
            }
        }
    }

    /// Mean gradients of the shape functions over every cell: nodes (ascending) and gradients.
    pub fn cell_gradients(&self) -> Vec<(Vec<u32>, Vec<Point<2>>)> {
        let mut rows: Vec<BTreeMap<u32, Point<2>>> = vec![BTreeMap::new(); self.cells.len()];
        for point in self.rule.points() {
            let share = point.weight / self.cells[point.cell as usize].area;
            for (&i, gradient) in point.nodes.iter().zip(point.gradients) {
                *rows[point.cell as usize].entry(i).or_insert_with(Point::zeros) += gradient * share;
            }
        }
        rows.into_iter().map(|row| row.into_iter().unzip()).collect()
    }

    /// Values of the shape functions at a point: `u(X) = Σ_I Ψ_I(X) d_I`.
    ///
    /// # Errors
    /// [`ShapeError`] where too few kernels cover the point.
    pub fn value_stencil(&self, x: &Point<2>) -> Result<Stencil<2>, ShapeError> {
        match &*self.approximation {
            Approximation::Kernels(cloud) => ShapeFunctions::new(cloud, self.method.basis).at(x, Wanted::VALUES),
            Approximation::Elements(elements) => Ok(elements.value_stencil(x)),
        }
    }
}

/// Rules whose supports are relative to the distance of the farthest natural neighbour.
fn by_natural_neighbours(integration: Integration) -> bool {
    matches!(integration, Integration::ScniStabilised | Integration::Mscni)
}

/// Distance of every node to the farthest of its natural neighbours, those that its cell shares an edge with; on a square
/// lattice the spacing.
fn natural_neighbour_distance(nodes: &[Point2], cells: &[NodalCell]) -> Vec<f64> {
    /// Cells that share less than this, over their own size, share a corner and no edge.
    const CORNER: f64 = 1e-6;
    let farthest = |(x, cell): (&Point2, &NodalCell)| {
        let shortest = CORNER * cell.area.sqrt();
        cell.edges()
            .filter_map(|(a, b, across)| match across {
                Across::Cell(j) if (b - a).norm() > shortest => Some((nodes[j as usize] - x).norm()),
                _ => None,
            })
            .fold(0.0, f64::max)
    };
    nodes.iter().zip(cells).map(farthest).collect()
}

/// Local spacing of scattered nodes: √2 times the distance to the farthest corner of the nodal cell, which on a square
/// lattice is the spacing. Every point of the cell is then well inside the node's support, however nodes are graded.
fn local_spacing(nodes: &[Point2], cells: &[NodalCell]) -> Vec<f64> {
    nodes
        .iter()
        .zip(cells)
        .map(|(x, cell)| {
            let radius = cell.boundary.iter().map(|c| (c.0 - x).norm()).fold(0.0, f64::max);
            std::f64::consts::SQRT_2 * radius
        })
        .collect()
}
