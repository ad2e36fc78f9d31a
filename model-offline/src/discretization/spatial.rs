//! A body in space discretised: tetrahedra, nodes, cells and an integration rule.

use super::meshing::TetMesh;
use super::method::{Integration, Method};
use super::tetrahedra::TetElements;
use super::tetrahedra::dual_cells::DualCells;
use super::tetrahedra::elements::InsideOut;
use super::tetrahedra::geometry::neighbour_distance;
use super::{NodeCloud, Quadrature, ShapeError, ShapeFunctions, Stencil, Wanted};
use crate::geometry::Point;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Why a body in space cannot be discretised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpatialError {
    /// Shape functions do not exist somewhere.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// An element is turned inside out.
    #[error(transparent)]
    InsideOut(#[from] InsideOut),
    /// A rule that is not there in space.
    #[error("integration {0} is planar: in space take scni-stabilised, scni, mscni, dni, fem-t4 or fem-t10")]
    Planar(Integration),
}

#[derive(Debug)]
enum Approximation {
    Kernels(NodeCloud<3>),
    Elements(TetElements),
}

/// Nodes, cells that tile the body, and an integration rule over them. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Spatial {
    approximation: Arc<Approximation>,
    /// Shares of every cell in the parts of the mesh.
    shares: Arc<Vec<BTreeMap<u32, f64>>>,
    volumes: Arc<Vec<f64>>,
    tetrahedra: Arc<Vec<[u32; 4]>>,
    rule: Arc<Quadrature<3>>,
    method: Method,
}

impl Spatial {
    /// Discretises a mesh: elements on its tetrahedra, or nodal rules on the cells dual to them, with kernels that reach
    /// `support` times the farthest neighbour in any axis. `place` says where middle nodes of quadratic elements go that are
    /// not in the middle of their edge.
    ///
    /// # Errors
    /// [`SpatialError`] names the node whose moment matrix fails, or the rule that is not there in space.
    pub fn new(
        mesh: &TetMesh,
        method: Method,
        place: impl Fn(u32, u32) -> Option<Point<3>>,
    ) -> Result<Self, SpatialError> {
        let elements = match method.integration {
            Integration::FemT4 => Some(TetElements::linear(mesh)),
            Integration::FemT10 => Some(TetElements::quadratic(mesh, place)),
            _ => None,
        };
        if let Some(elements) = elements {
            let rule = Arc::new(elements.rule()?);
            return Ok(Self {
                approximation: Arc::new(Approximation::Elements(elements)),
                shares: Arc::new(mesh.part.iter().map(|&part| BTreeMap::from([(part, 1.0)])).collect()),
                volumes: Arc::new(mesh.volumes()),
                tetrahedra: Arc::new(mesh.tetrahedra.clone()),
                rule,
                method,
            });
        }
        let half_widths = neighbour_distance(mesh).into_iter().map(|h| h * method.support).collect();
        let cloud = NodeCloud::new(mesh.nodes.clone(), half_widths);
        let shape = ShapeFunctions::new(&cloud, method.basis);
        let cells = DualCells::new(mesh);
        let rule = match method.integration {
            Integration::Dni => cells.direct_nodal(&shape)?,
            Integration::Scni => cells.scni(&shape)?,
            Integration::ScniStabilised => cells.scni_stabilised(&shape)?,
            Integration::Mscni => cells.modified_scni(&shape)?,
            planar => return Err(SpatialError::Planar(planar)),
        };
        Ok(Self {
            shares: Arc::new((0..mesh.nodes.len()).map(|node| cells.shares(node)).collect()),
            volumes: Arc::new(cells.volumes().to_vec()),
            tetrahedra: Arc::new(mesh.tetrahedra.clone()),
            approximation: Arc::new(Approximation::Kernels(cloud)),
            rule: Arc::new(rule),
            method,
        })
    }

    /// Node positions, those that elements add included.
    pub fn positions(&self) -> &[Point<3>] {
        match &*self.approximation {
            Approximation::Kernels(cloud) => cloud.positions(),
            Approximation::Elements(elements) => elements.positions(),
        }
    }

    /// Middle nodes of quadratic elements by the corners of their edges, the lower number first; none of other methods.
    pub fn middles(&self) -> BTreeMap<(u32, u32), u32> {
        match &*self.approximation {
            Approximation::Kernels(_) => BTreeMap::new(),
            Approximation::Elements(elements) => elements.middles(),
        }
    }

    /// Nodes at the corners of the mesh's tetrahedra.
    pub fn tetrahedra(&self) -> &[[u32; 4]] {
        &self.tetrahedra
    }

    /// Volumes of the cells.
    pub fn volumes(&self) -> &[f64] {
        &self.volumes
    }

    /// Shares of every cell in the parts of the mesh.
    pub fn shares(&self) -> &[BTreeMap<u32, f64>] {
        &self.shares
    }

    /// The integration rule.
    pub fn rule(&self) -> &Arc<Quadrature<3>> {
        &self.rule
    }

    /// How the displacement is approximated.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Values of the shape functions at a node: `u(X_i) = Σ_I Ψ_I(X_i) d_I`.
    ///
    /// # Errors
    /// [`ShapeError`] where too few kernels cover the node.
    pub fn nodal_stencil(&self, node: u32) -> Result<Stencil<3>, ShapeError> {
        match &*self.approximation {
            Approximation::Kernels(cloud) => self.value_stencil(&cloud.positions()[node as usize]),
            Approximation::Elements(_) => Ok(Stencil { nodes: vec![node], values: vec![1.0], gradients: Vec::new() }),
        }
    }

    /// Values of the shape functions at a point: `u(X) = Σ_I Ψ_I(X) d_I`.
    ///
    /// # Errors
    /// [`ShapeError`] where too few kernels cover the point.
    pub fn value_stencil(&self, x: &Point<3>) -> Result<Stencil<3>, ShapeError> {
        match &*self.approximation {
            Approximation::Kernels(cloud) => ShapeFunctions::new(cloud, self.method.basis).at(x, Wanted::VALUES),
            Approximation::Elements(elements) => Ok(elements.value_stencil(x)),
        }
    }
}
