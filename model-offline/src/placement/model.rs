//! A scene turned into a discrete model, and bodies that can be driven through an insertion.

use crate::discretization::lattice::lattice_nodes;
use crate::discretization::nodal_cells::clipped_voronoi;
use crate::discretization::{
    NodalCell, NodeCloud, Quadrature, ShapeError, ShapeFunctions, Stencil, integration,
};
use crate::mechanics::{Material, Tissue};
use crate::scene::geometry::{Point2, distance_to_polyline, overlap_area};
use crate::scene::schema::{Basis, Essential, Integration};
use crate::scene::{Resolution, Scene};
use crate::solver::constrained::HeldRows;
use crate::solver::equilibrium::{Equilibrium, Failure, NewtonSettings};
use nalgebra::{Matrix2, Vector2};
use std::sync::Arc;

/// Why a scene cannot be modelled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// Shape functions do not exist somewhere.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The tangent at rest cannot be solved with, or a Jacobian cannot be computed.
    #[error("{0}")]
    Solve(#[from] Failure),
    /// A held feature has no node on it.
    #[error("no node lies on the {0}; refine the discretization")]
    NothingHeld(String),
    /// The paddle cannot move the target orthogonally to the needle.
    #[error(
        "paddle {paddle}: the actuation Jacobian is singular (condition {condition:.1e}): this paddle cannot control the target"
    )]
    Uncontrollable {
        /// Paddle index.
        paddle: u32,
        /// Condition number of the Jacobian.
        condition: f64,
    },
    /// A choice of methods that does not exist yet.
    #[error("{0}")]
    Unsupported(String),
}

/// The discrete model of a scene: everything that all paddles share.
#[derive(Debug, Clone)]
pub struct TissueModel {
    scene: Scene,
    cloud: Arc<NodeCloud<2>>,
    cells: Arc<Vec<NodalCell>>,
    rule: Arc<Quadrature<2>>,
    tissue: Tissue,
    spacing: f64,
    immobile: Vec<Stencil<2>>,
    needle: Vec<Stencil<2>>,
    paddles: Vec<Vec<Stencil<2>>>,
    target: Stencil<2>,
}

impl TissueModel {
    /// Discretises a scene.
    ///
    /// # Errors
    /// [`ModelError`]: shape functions that do not exist, features without nodes, methods that do not combine.
    pub fn new(scene: &Scene) -> Result<Self, ModelError> {
        let spec = scene.discretization;
        let Resolution::Spacing(spacing) = spec.resolution else {
            return Err(ModelError::Unsupported(
                "tolerance is not available yet: give a spacing in [discretization] or with --spacing".into(),
            ));
        };
        if spec.basis != Basis::Linear || spec.essential != Essential::Transformation {
            return Err(ModelError::Unsupported(
                "only the linear basis with the transformation method is available yet".into(),
            ));
        }
        let nodes = lattice_nodes(scene, spacing);
        let half_widths = vec![spec.support * spacing; nodes.len()];
        let cells = clipped_voronoi(&nodes, &scene.outline);
        let cloud = NodeCloud::new(nodes, half_widths);
        let shape = ShapeFunctions::new(&cloud, spec.basis);
        let rule = match spec.integration {
            Integration::Dni => integration::direct_nodal(&shape, &cells)?,
            Integration::Scni => integration::stabilised_conforming_nodal(&shape, &cells)?,
            other => {
                return Err(ModelError::Unsupported(format!(
                    "integration {other:?} is not available yet: use dni or scni"
                )));
            }
        };
        let tolerance = 1e-9 * scene.outline.size();
        let on = |path: &[Point2], name: &str| -> Result<Vec<Stencil<2>>, ModelError> {
            let held: Result<Vec<_>, ShapeError> = cloud
                .positions()
                .iter()
                .filter(|x| distance_to_polyline(**x, path) <= tolerance)
                .map(|x| shape.at(x, false))
                .collect();
            let held = held?;
            if held.is_empty() {
                Err(ModelError::NothingHeld(name.to_owned()))
            } else {
                Ok(held)
            }
        };
        let mut immobile = Vec::new();
        for x in cloud.positions() {
            if scene
                .immobile
                .iter()
                .any(|path| distance_to_polyline(*x, path) <= tolerance)
            {
                immobile.push(shape.at(x, false)?);
            }
        }
        if immobile.is_empty() {
            return Err(ModelError::NothingHeld("immobile part".to_owned()));
        }
        let needle = on(&scene.needle.contact, "needle contact")?;
        let paddles = scene
            .paddles
            .iter()
            .map(|p| on(&p.segment, &format!("paddle {}", p.index)))
            .collect::<Result<_, _>>()?;
        let target = shape.at(&scene.target, false)?;
        Ok(Self {
            tissue: tissue_of(scene, &cells),
            scene: scene.clone(),
            cells: Arc::new(cells),
            rule: Arc::new(rule),
            spacing,
            immobile,
            needle,
            paddles,
            target,
            cloud: Arc::new(cloud),
        })
    }

    /// The same nodes and shape functions with the tissue of another scene that differs in its materials only.
    #[must_use]
    pub fn with_tissue_of(&self, scene: &Scene) -> Self {
        Self {
            tissue: tissue_of(scene, &self.cells),
            scene: scene.clone(),
            ..self.clone()
        }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.cloud.len()
    }

    /// Number of unknowns.
    pub fn dofs(&self) -> usize {
        2 * self.cloud.len()
    }

    /// Node positions at rest.
    pub fn positions(&self) -> &[Point2] {
        self.cloud.positions()
    }

    /// The node cloud.
    pub fn cloud(&self) -> &NodeCloud<2> {
        &self.cloud
    }

    /// Nodal cells.
    pub fn cells(&self) -> &[NodalCell] {
        &self.cells
    }

    /// The integration rule.
    pub fn rule(&self) -> &Arc<Quadrature<2>> {
        &self.rule
    }

    /// Materials by cell.
    pub fn tissue(&self) -> &Tissue {
        &self.tissue
    }

    /// Displacements of all nodes for given coefficients.
    ///
    /// # Errors
    /// [`ShapeError`], which building the model has ruled out already.
    pub fn nodal_displacements(&self, coefficients: &[f64]) -> Result<Vec<Point2>, ShapeError> {
        let shape = ShapeFunctions::new(&self.cloud, self.scene.discretization.basis);
        self.positions()
            .iter()
            .map(|x| Ok(shape.at(x, false)?.interpolate(coefficients)))
            .collect()
    }

    /// Displacement of any point of the body for given coefficients.
    pub fn displacement_at(&self, x: &Point2, coefficients: &[f64]) -> Point2 {
        let shape = ShapeFunctions::new(&self.cloud, self.scene.discretization.basis);
        // Building the model evaluated shape functions all over the body; only far outside it can this fail.
        shape.at(x, false).map_or_else(
            |_| Point2::zeros(),
            |stencil| stencil.interpolate(coefficients),
        )
    }

    /// Position of a paddle in the scene's list, by its index.
    pub fn paddle_position(&self, index: u32) -> Option<usize> {
        self.scene.paddles.iter().position(|p| p.index == index)
    }

    /// A body at rest with the paddle at this place of the scene's list attached, or none.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at rest is singular.
    pub fn body(
        &self,
        paddle: Option<usize>,
        settings: NewtonSettings,
    ) -> Result<Body<'_>, Failure> {
        let none = Vec::new();
        let paddle = paddle.map_or(&none, |p| &self.paddles[p]);
        let held = HeldRows::new(self.immobile.iter().chain(&self.needle).chain(paddle));
        let equilibrium = Equilibrium::at_rest(
            Arc::clone(&self.rule),
            self.tissue.clone(),
            held,
            self.nodes(),
            self.spacing,
            settings,
        )?;
        Ok(Body {
            model: self,
            equilibrium,
            paddle_rows: paddle.len(),
            depth: 0.0,
            paddle: Vector2::zeros(),
        })
    }
}

/// Materials of the cells: an inclusion that covers part of a cell counts with the area it covers.
fn tissue_of(scene: &Scene, cells: &[NodalCell]) -> Tissue {
    let mut materials: Vec<Material> = vec![scene.material.clone()];
    let of_inclusion: Vec<u32> = scene
        .inclusions
        .iter()
        .map(|inclusion| match &inclusion.material {
            Some(material) => {
                materials.push(material.clone());
                materials.len() as u32 - 1
            }
            None => 0,
        })
        .collect();
    let parts = cells.iter().map(|cell| {
        let corners = cell.corners();
        let mut parts = vec![(0, 1.0)];
        for (inclusion, &material) in scene.inclusions.iter().zip(&of_inclusion) {
            let fraction = covered_fraction(&inclusion.outline, &corners, cell.area);
            if fraction > 0.0 {
                parts[0].1 -= fraction;
                parts.push((material, fraction * inclusion.stiffness));
            }
        }
        // One evaluation per law: shares of the same material add up. Where inclusions overlap, the body's share
        // cannot fall below nothing.
        parts[0].1 = f64::max(parts[0].1, 0.0);
        let mut merged: Vec<(u32, f64)> = Vec::with_capacity(parts.len());
        for (material, factor) in parts {
            match merged.iter_mut().find(|m| m.0 == material) {
                Some(m) => m.1 += factor,
                None => merged.push((material, factor)),
            }
        }
        merged.retain(|m| m.1 > 0.0);
        merged
    });
    Tissue::new(materials, parts)
}

/// Share of a cell that a region covers. Within rounding of nothing or all it is exactly that, so that a lattice cell
/// inside an inclusion has the inclusion's stiffness and no other.
fn covered_fraction(region: &crate::scene::Polygon, corners: &[Point2], area: f64) -> f64 {
    let fraction = overlap_area(region, corners) / area;
    if fraction < 1e-9 {
        0.0
    } else if fraction > 1.0 - 1e-9 {
        1.0
    } else {
        fraction
    }
}

/// A body in equilibrium with the needle at some depth and the paddle somewhere.
#[derive(Debug)]
pub struct Body<'m> {
    model: &'m TissueModel,
    equilibrium: Equilibrium<2>,
    paddle_rows: usize,
    depth: f64,
    paddle: Vector2<f64>,
}

impl Body<'_> {
    /// Needle depth.
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// Size of the body: the length that tolerances are relative to.
    pub fn scale(&self) -> f64 {
        self.model.scene.outline.size()
    }

    /// Paddle displacement.
    pub fn paddle(&self) -> Vector2<f64> {
        self.paddle
    }

    /// The equilibrium behind it.
    pub fn equilibrium(&self) -> &Equilibrium<2> {
        &self.equilibrium
    }

    /// The equilibrium behind it, to change settings.
    pub fn equilibrium_mut(&mut self) -> &mut Equilibrium<2> {
        &mut self.equilibrium
    }

    /// Takes needle and paddle to the given depth and displacement along a straight path.
    ///
    /// # Errors
    /// [`Failure`]; depth and paddle are then where the last converged state has them.
    pub fn drive(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), Failure> {
        let prescribed = self.held_values(depth, paddle);
        let outcome = self.equilibrium.drive(&prescribed);
        let reached = outcome
            .as_ref()
            .map_or_else(|failure| failure.reached, |()| 1.0);
        self.depth += (depth - self.depth) * reached;
        self.paddle += (paddle - self.paddle) * reached;
        if outcome.is_ok() {
            // Not the sum of the increments, the value asked for.
            (self.depth, self.paddle) = (depth, paddle);
        }
        outcome
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        self.model
            .target
            .interpolate(self.equilibrium.coefficients())
    }

    /// Actuation Jacobian d(target displacement)/d(paddle displacement) with the needle held, by exact linearisation.
    /// Rows target x, y; columns paddle x, y.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn actuation_jacobian(&mut self) -> Result<Matrix2<f64>, Failure> {
        let mut jacobian = Matrix2::zeros();
        for axis in 0..2 {
            let rates = self.held_values(0.0, Vector2::ith(axis, 1.0));
            let response = self.equilibrium.sensitivity(&rates)?;
            jacobian.set_column(axis, &self.model.target.interpolate(&response));
        }
        Ok(jacobian)
    }

    /// d(target displacement)/d(depth) with the paddle held, by exact linearisation.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn depth_sensitivity(&mut self) -> Result<Vector2<f64>, Failure> {
        let rates = self.held_values(1.0, Vector2::zeros());
        let response = self.equilibrium.sensitivity(&rates)?;
        Ok(self.model.target.interpolate(&response))
    }

    /// Values of all held rows, in the order immobile, needle, paddle.
    fn held_values(&self, depth: f64, paddle: Vector2<f64>) -> Vec<f64> {
        let model = self.model;
        let mut values =
            vec![0.0; 2 * (model.immobile.len() + model.needle.len() + self.paddle_rows)];
        let (_, rest) = values.split_at_mut(2 * model.immobile.len());
        let (needle_values, paddle_values) = rest.split_at_mut(2 * model.needle.len());
        for pair in needle_values.chunks_exact_mut(2) {
            pair.copy_from_slice((model.scene.needle.axis * depth).as_slice());
        }
        for pair in paddle_values.chunks_exact_mut(2) {
            pair.copy_from_slice(paddle.as_slice());
        }
        values
    }
}
