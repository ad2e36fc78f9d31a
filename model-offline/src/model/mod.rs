//! A scene turned into a discrete model, and bodies that can be driven through an insertion.

mod condensing;
mod derivatives;
pub mod driven;
mod error;
mod graded;
pub mod jumps;
pub mod space;
mod tissue;

pub(crate) use condensing::Condensing;
pub use derivatives::{ControlDerivatives, Derivatives, control_derivatives};
pub use driven::DrivenBody;
pub use error::{BoundaryPart, DecidedBy, Faster, ModelError, ModelFailure};
pub use graded::{graded_model, sized_model};

use self::tissue::{Mixing, tissue_of};
use crate::discretization::boundary::BoundaryPoint;
use crate::discretization::nodes::lattice::{lattice_nodes, lattice_nodes_on_interfaces};
use crate::discretization::{Essential, Integration, NodalCell, Planar, Quadrature, Resolution, ShapeError, Stencil};
use crate::geometry::{Point2, distance_to_polyline};
use crate::mechanics::nitsche::Nitsche;
use crate::mechanics::{ConstrainedRows, Constraints, Tissue, WeaklyImposed};
use crate::scene::{Needle, Scene};
use crate::solver::analysis::Analysis;
use crate::solver::equilibrium::{DiscreteBody, Equilibrium, Failure, NewtonSettings};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

/// The discrete model of a scene: everything that all paddles share.
///
/// # Example
/// ```
/// use model_offline::{NewtonSettings, Scene, TissueModel};
///
/// let model = TissueModel::new(&Scene::bundled("paper").expect("bundled"))?;
/// let mut body = model.body(model.paddle_position(3), NewtonSettings::default())?;
/// body.drive(0.1, [0.0, 0.0].into())?; // needle to depth 0.1, paddle still
/// assert!(body.target_displacement().norm() > 0.0);
/// # Ok::<(), model_offline::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct TissueModel {
    scene: Scene,
    planar: Planar,
    tissue: Tissue,
    spacing: f64,
    essential: EssentialBoundary,
    target: Stencil<2>,
    /// Made when the first body needs it, and shared with all models on the same nodes.
    analysis: Arc<OnceLock<Analysis>>,
    /// The same with the nodes eliminated last that paddles and target take.
    condensing: Arc<OnceLock<Condensing>>,
}

/// Where essential boundary conditions are imposed: on nodes, or at boundary points by Nitsche's method.
#[derive(Debug, Clone)]
enum EssentialBoundary {
    Nodes(Groups<Stencil<2>>),
    Points(Groups<BoundaryPoint>),
}

/// The same kind of thing for the immobile part, the needle contact and every paddle.
#[derive(Debug, Clone)]
struct Groups<T> {
    immobile: Vec<T>,
    needle: Vec<T>,
    paddles: Vec<Vec<T>>,
}

impl<T> Groups<T> {
    /// Collects each group by the polylines it lies on.
    fn collect(scene: &Scene, on: impl Fn(&[&[Point2]]) -> Result<Vec<T>, ShapeError>) -> Result<Self, ModelError> {
        let some = |paths: &[&[Point2]], part: BoundaryPart| -> Result<Vec<T>, ModelError> {
            let found = on(paths)?;
            if found.is_empty() { Err(ModelError::NothingConstrained(part)) } else { Ok(found) }
        };
        let immobile: Vec<&[Point2]> = scene.immobile.iter().map(Vec::as_slice).collect();
        Ok(Self {
            immobile: some(&immobile, BoundaryPart::Immobile)?,
            needle: some(&[&scene.needle.contact], BoundaryPart::Needle)?,
            paddles: scene
                .paddles
                .iter()
                .map(|p| some(&[&p.segment], BoundaryPart::Paddle(p.index)))
                .collect::<Result<_, _>>()?,
        })
    }

    /// Immobile part, needle, and the paddle that is attached, in this order.
    fn with_paddle(&self, paddle: Option<usize>) -> impl Iterator<Item = &T> {
        let paddle = paddle.map_or(&[][..], |p| &self.paddles[p]);
        self.immobile.iter().chain(&self.needle).chain(paddle)
    }

    /// Everything that may be constrained.
    fn all(&self) -> impl Iterator<Item = &T> + Clone {
        self.immobile.iter().chain(&self.needle).chain(self.paddles.iter().flatten())
    }

    /// The same of a body whose contact is free.
    fn without_needle(&self, paddle: Option<usize>) -> impl Iterator<Item = &T> {
        self.immobile.iter().chain(paddle.map_or(&[][..], |p| &self.paddles[p]))
    }

    /// Two prescribed numbers per member, in the same order.
    fn values(&self, attached: Option<usize>, needle: Vector2<f64>, pose: &Pose) -> Vec<f64> {
        let repeat = |value: Vector2<f64>, count: usize| std::iter::repeat_n([value.x, value.y], count).flatten();
        repeat(pose.base, self.immobile.len())
            .chain(repeat(needle, self.needle.len()))
            .chain(repeat(pose.paddle, attached.map_or(0, |p| self.paddles[p].len())))
            .collect()
    }
}

/// Where everything is that moves a body, as displacements from rest.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pose {
    /// Depth of the needle, length.
    pub depth: f64,
    /// How far the needle is off its line, orthogonally to its axis, length: what bends it or its holder.
    pub lateral: f64,
    /// Displacement of the paddle, length.
    pub paddle: Vector2<f64>,
    /// Displacement of the part that is immobile in a scene, as breathing moves it, length.
    pub base: Vector2<f64>,
}

impl Pose {
    /// The pose that is a share of the way from here to another; at 1 the other, not the other up to rounding.
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        if share >= 1.0 {
            return *other;
        }
        Self {
            depth: self.depth + (other.depth - self.depth) * share,
            lateral: self.lateral + (other.lateral - self.lateral) * share,
            paddle: self.paddle + (other.paddle - self.paddle) * share,
            base: self.base + (other.base - self.base) * share,
        }
    }
}

impl TissueModel {
    /// Discretises a scene whose resolution is given: a spacing, or a level of refinement.
    ///
    /// # Errors
    /// [`ModelError`]: shape functions that do not exist, features without nodes, methods that do not combine;
    /// [`ModelError::ToleranceIsNoResolution`] for a tolerance, which [`discretise`](crate::placement::discretise) refines to.
    pub fn new(scene: &Scene) -> Result<Self, ModelError> {
        let spacing = match scene.discretization.resolution {
            Resolution::Spacing(spacing) => spacing,
            Resolution::Level(level) => return graded_model(scene, scene.discretization.method, level),
            Resolution::Tolerance(_) => {
                return Err(ModelError::ToleranceIsNoResolution);
            }
        };
        let method = scene.discretization.method;
        let features = scene.features();
        let nodes = match method.integration.is_element() {
            true => lattice_nodes_on_interfaces(&features, spacing),
            false => lattice_nodes(&features, spacing),
        };
        let planar = Planar::new(&scene.outline, &scene.inclusion_outlines(), nodes, Some(spacing), method)?;
        Self::on(scene, planar, spacing)
    }

    /// The model of a scene on a body discretised already, whose nodes are `spacing` apart.
    ///
    /// # Errors
    /// [`ModelError::NothingConstrained`] when no node lies on a feature.
    pub fn on(scene: &Scene, planar: Planar, spacing: f64) -> Result<Self, ModelError> {
        let tolerance = 1e-9 * scene.outline.size();
        let essential = match scene.discretization.essential {
            Essential::Transformation => EssentialBoundary::Nodes(Groups::collect(scene, |paths| {
                let near = |x: &&Point2| paths.iter().any(|path| distance_to_polyline(**x, path) <= tolerance);
                planar.positions().iter().filter(near).map(|x| planar.value_stencil(x)).collect()
            })?),
            Essential::Nitsche => {
                let contact = &scene.needle.contact;
                if !contact.windows(2).all(|s| scene.outline.segment_on_boundary(s[0], s[1], tolerance)) {
                    return Err(ModelError::NitscheInside);
                }
                EssentialBoundary::Points(Groups::collect(scene, |paths| {
                    paths
                        .iter()
                        .map(|path| planar.boundary_points_on(path))
                        .collect::<Result<Vec<_>, _>>()
                        .map(|v| v.concat())
                })?)
            }
        };
        if matches!(essential, EssentialBoundary::Points(_)) && scene.relaxes() {
            return Err(ModelError::RelaxesHeldWeakly);
        }
        Ok(Self {
            tissue: tissue_of(scene, planar.cells(), Mixing::of(planar.method().integration)),
            scene: scene.clone(),
            spacing,
            essential,
            target: planar.value_stencil(&scene.target)?,
            planar,
            analysis: Arc::default(),
            condensing: Arc::default(),
        })
    }

    /// The same nodes and shape functions with the tissue of another scene that differs in its materials only.
    #[must_use]
    pub fn with_tissue_of(&self, scene: &Scene) -> Self {
        let mixing = Mixing::of(self.planar.method().integration);
        Self { tissue: tissue_of(scene, self.planar.cells(), mixing), scene: scene.clone(), ..self.clone() }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.planar.positions().len()
    }

    /// Number of unknowns.
    pub fn dofs(&self) -> usize {
        2 * self.planar.positions().len()
    }

    /// Node positions at rest.
    pub fn positions(&self) -> &[Point2] {
        self.planar.positions()
    }

    /// The body's discretization.
    pub fn planar(&self) -> &Planar {
        &self.planar
    }

    /// Nodal cells.
    pub fn cells(&self) -> &[NodalCell] {
        self.planar.cells()
    }

    /// The integration rule.
    pub fn rule(&self) -> &Arc<Quadrature<2>> {
        self.planar.rule()
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
        self.positions().iter().map(|x| Ok(self.planar.value_stencil(x)?.interpolate(coefficients))).collect()
    }

    /// Displacement of any point of the body for given coefficients.
    pub fn displacement_at(&self, x: &Point2, coefficients: &[f64]) -> Point2 {
        // Building the model evaluated shape functions all over the body; only far outside it can this fail.
        self.planar.value_stencil(x).map_or_else(|_| Point2::zeros(), |stencil| stencil.interpolate(coefficients))
    }

    /// Position of a paddle in the scene's list, by its index.
    pub fn paddle_position(&self, index: u32) -> Option<usize> {
        self.scene.paddles.iter().position(|p| p.index == index)
    }

    /// Where patient and needle are so many seconds after the needle started, with its tip at a depth; the paddle at rest.
    pub fn pose_at(&self, since_start: f64, depth: f64) -> Pose {
        let Needle { depth: whole, deflection, .. } = self.scene.needle;
        let share = depth / whole;
        let base = self.scene.motion.displacement(since_start);
        Pose { depth, lateral: deflection * share * share, base, paddle: Vector2::zeros() }
    }

    /// Refuses a needle that slips, for what is of a contact that moves with the needle.
    ///
    /// # Errors
    /// [`ModelError::NeedleSlips`].
    pub fn needs_a_patch(&self) -> Result<(), ModelError> {
        if self.scene.needle.shaft.is_some() { Err(ModelError::NeedleSlips) } else { Ok(()) }
    }

    /// Whether Nitsche's method imposes the prescribed values: with a penalty that only grows, so that a state depends on
    /// those before.
    pub fn is_held_weakly(&self) -> bool {
        matches!(self.essential, EssentialBoundary::Points(_))
    }

    /// Rows of the constrained nodes when a paddle is attached; none where Nitsche's method imposes the values.
    pub(crate) fn constrained_rows(&self, paddle: Option<usize>) -> Option<ConstrainedRows> {
        match &self.essential {
            EssentialBoundary::Nodes(groups) => Some(ConstrainedRows::new(groups.with_paddle(paddle))),
            EssentialBoundary::Points(_) => None,
        }
    }

    /// What is constrained where the contact is free, and the number of rows of the immobile part, which come first; none
    /// where Nitsche's method imposes the values.
    pub(crate) fn rows_without_needle(&self, paddle: Option<usize>) -> Option<(ConstrainedRows, usize)> {
        match &self.essential {
            EssentialBoundary::Nodes(groups) => {
                Some((ConstrainedRows::new(groups.without_needle(paddle)), groups.immobile.len()))
            }
            EssentialBoundary::Points(_) => None,
        }
    }

    /// The same with the target's displacement constrained as well.
    pub(crate) fn constrained_rows_with_target(&self, paddle: Option<usize>) -> Option<ConstrainedRows> {
        match &self.essential {
            EssentialBoundary::Nodes(groups) => {
                Some(ConstrainedRows::new(groups.with_paddle(paddle).chain([&self.target])))
            }
            EssentialBoundary::Points(_) => None,
        }
    }

    /// Spacing of the nodes, the finest where it varies, length units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    fn weakly_imposed(&self, paddle: Option<usize>) -> Option<Arc<dyn WeaklyImposed>> {
        match &self.essential {
            EssentialBoundary::Nodes(_) => None,
            EssentialBoundary::Points(groups) => {
                Some(Arc::new(Nitsche::new(&self.planar, &self.tissue, groups.with_paddle(paddle).cloned())))
            }
        }
    }

    /// All prescribed values: needle at `depth`, paddle displaced.
    pub(crate) fn prescribed_values(&self, paddle: Option<usize>, depth: f64, displacement: Vector2<f64>) -> Vec<f64> {
        self.prescribed_in(paddle, &Pose { depth, paddle: displacement, ..Pose::default() })
    }

    /// All prescribed values of a pose.
    pub(crate) fn prescribed_in(&self, attached: Option<usize>, pose: &Pose) -> Vec<f64> {
        let needle = self.scene.needle.axis * pose.depth + self.scene.needle.orthogonal() * pose.lateral;
        match &self.essential {
            EssentialBoundary::Nodes(groups) => groups.values(attached, needle, pose),
            EssentialBoundary::Points(groups) => groups.values(attached, needle, pose),
        }
    }

    /// The target's row: `u(X_t) = Σ_I Ψ_I(X_t) d_I`.
    pub(crate) fn target_row(&self) -> &Stencil<2> {
        &self.target
    }

    /// Sparsity and elimination order that serve every body of this model, whatever is constrained.
    pub(crate) fn analysis(&self) -> &Analysis {
        self.analysis.get_or_init(|| {
            let (rule, positions) = (self.rule(), self.positions());
            match (&self.essential, self.condensing.get()) {
                (_, Some(Condensing { analysis, ports: None, .. })) => analysis.retaining_none(positions),
                (EssentialBoundary::Nodes(groups), _) => Analysis::new(rule, positions, self.constrained_lists(groups)),
                (EssentialBoundary::Points(groups), _) => {
                    let constrained = Nitsche::new(&self.planar, &self.tissue, groups.all().cloned());
                    Analysis::new(rule, positions, constrained.node_lists().into_iter())
                }
            }
        })
    }

    /// Node lists of everything that may be constrained on nodes.
    fn constrained_lists<'s>(&'s self, groups: &'s Groups<Stencil<2>>) -> impl Iterator<Item = &'s [u32]> + Clone {
        groups.all().chain([&self.target]).map(|stencil| stencil.nodes.as_slice())
    }

    /// Whether one factor answers for every paddle.
    pub(crate) fn attaches_to_one_factor(&self) -> bool {
        self.attachable_rows().is_some()
    }

    /// The rows of every paddle's nodes, where each paddle can be attached to a body that holds without it. None where
    /// Nitsche's method imposes the values; where what is held are no single unknowns and the rule loses digits to the springs of
    /// ports (of the coefficients 4 in 10⁷ by `scni` on `paper-hull`, 3 by `gauss` on `breast`, less than 1 by those that are
    /// taken); or where a node of a paddle is one of the immobile part or of the needle too.
    pub(crate) fn attachable_rows(&self) -> Option<&[Vec<Stencil<2>>]> {
        let EssentialBoundary::Nodes(groups) = &self.essential else { return None };
        let has_ports = matches!(self.planar.method().integration, Integration::ScniStabilised | Integration::Mscni);
        if !has_ports && !ConstrainedRows::new(groups.with_paddle(None)).are_unknowns() {
            return None;
        }
        let same = |a: &Stencil<2>, b: &Stencil<2>| a.nodes == b.nodes && a.values == b.values;
        let apart = |row: &Stencil<2>| !groups.with_paddle(None).any(|held| same(held, row));
        groups.paddles.iter().flatten().all(apart).then_some(&groups.paddles)
    }

    /// The same condensed to the displacements of the [paddles' rows](Self::attachable_rows) and of the target: where what is held
    /// are single unknowns, as with elements, their nodes are eliminated last, else ports of theirs. None where Nitsche's method
    /// imposes the values.
    pub(crate) fn condensing_analysis(&self) -> Option<&Condensing> {
        let EssentialBoundary::Nodes(groups) = &self.essential else { return None };
        Some(self.condensing.get_or_init(|| {
            let rows: Vec<&Stencil<2>> = groups.paddles.iter().flatten().chain([&self.target]).collect();
            let (rule, positions) = (self.rule(), self.positions());
            if !ConstrainedRows::new(groups.all()).are_unknowns() {
                return Condensing::to_ports(rule, positions, self.constrained_lists(groups), &rows);
            }
            let retained: BTreeSet<u32> = rows.iter().flat_map(|row| row.nodes.iter().copied()).collect();
            let retained: Vec<u32> = retained.into_iter().collect();
            let analysis = match self.analysis.get() {
                Some(analysis) => analysis.retaining_also(positions, &retained),
                None => Analysis::retaining(rule, positions, self.constrained_lists(groups), &retained),
            };
            Condensing { analysis, retained: retained.len(), ports: None }
        }))
    }

    /// Rule, tissue and nodes, for a solver.
    pub(crate) fn discrete_body(&self) -> DiscreteBody<'_, 2> {
        DiscreteBody {
            rule: Arc::clone(self.planar.rule()),
            tissue: self.tissue.clone(),
            positions: self.positions(),
            spacing: self.spacing,
        }
    }

    /// A body at rest with the paddle at this place of the scene's list attached, or none.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at rest is singular.
    pub fn body(&self, paddle: Option<usize>, settings: NewtonSettings) -> Result<Body<'_>, Failure> {
        let constraints =
            Constraints { rows: self.constrained_rows(paddle).unwrap_or_default(), weak: self.weakly_imposed(paddle) };
        let equilibrium = Equilibrium::analysed(self.discrete_body(), self.analysis(), constraints, settings)?;
        Ok(Body { model: self, equilibrium, attached: paddle, pose: Pose::default() })
    }
}

/// A body in equilibrium with the needle at some depth and the paddle somewhere.
#[derive(Debug, Clone)]
pub struct Body<'m> {
    model: &'m TissueModel,
    equilibrium: Equilibrium<2>,
    attached: Option<usize>,
    pose: Pose,
}

impl Body<'_> {
    /// Needle depth.
    pub fn depth(&self) -> f64 {
        self.pose.depth
    }

    /// Where everything is that moves the body.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Size of the body: the length that tolerances are relative to.
    pub fn scale(&self) -> f64 {
        self.model.scene.outline.size()
    }

    /// Paddle displacement.
    pub fn paddle(&self) -> Vector2<f64> {
        self.pose.paddle
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
        self.take_to(Pose { depth, paddle, ..self.pose })
    }

    /// Takes everything that moves the body to a pose along a straight path, at once.
    ///
    /// # Errors
    /// [`Failure`]; the pose is then that of the last converged state.
    pub fn take_to(&mut self, pose: Pose) -> Result<(), Failure> {
        let prescribed = self.model.prescribed_in(self.attached, &pose);
        let outcome = self.equilibrium.drive(&prescribed);
        let reached = outcome.as_ref().map_or_else(|failure| failure.reached, |()| 1.0);
        self.pose = self.pose.towards(&pose, reached);
        outcome
    }

    /// The same in so many seconds, in which tissue that relaxes does: the elastic stress is taken to change linearly in
    /// them, so that the error falls with the square of their number.
    ///
    /// # Errors
    /// [`Failure`]; the pose is then that of the last converged state, and tissue remembers what it did before.
    pub fn take_in(&mut self, pose: Pose, seconds: f64) -> Result<(), Failure> {
        self.equilibrium.begin(seconds);
        self.take_to(pose)?;
        self.equilibrium.remember();
        Ok(())
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        self.model.target.interpolate(self.equilibrium.coefficients())
    }

    /// Force that pushes the contact along the needle's axis, where its values are imposed exactly.
    pub fn contact_force(&self) -> f64 {
        let EssentialBoundary::Nodes(groups) = &self.model.essential else { return f64::NAN };
        let axis = self.model.scene.needle.axis;
        let forces: Vec<f64> = self.equilibrium.reactions().collect();
        let contact = forces.chunks_exact(2).skip(groups.immobile.len()).take(groups.needle.len());
        contact.map(|force| force[0] * axis.x + force[1] * axis.y).sum()
    }

    /// Actuation Jacobian d(target displacement)/d(paddle displacement) with the needle still, by exact linearisation.
    /// Rows target x, y; columns paddle x, y.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn actuation_jacobian(&mut self) -> Result<Matrix2<f64>, Failure> {
        let rates: Vec<f64> =
            (0..2).flat_map(|axis| self.model.prescribed_values(self.attached, 0.0, Vector2::ith(axis, 1.0))).collect();
        let responses = self.equilibrium.sensitivities(&rates)?;
        let columns = responses.chunks_exact(self.model.dofs()).map(|response| self.model.target.interpolate(response));
        Ok(Matrix2::from_columns(&columns.collect::<Vec<_>>()))
    }

    /// Across the needle, and along it.
    fn directions(&self) -> [Vector2<f64>; 2] {
        let needle = &self.model.scene.needle;
        [needle.orthogonal(), needle.axis]
    }

    /// d(target displacement)/d(depth) with the paddle held, by exact linearisation.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn depth_sensitivity(&mut self) -> Result<Vector2<f64>, Failure> {
        let rates = self.model.prescribed_values(self.attached, 1.0, Vector2::zeros());
        let response = self.equilibrium.sensitivities(&rates)?;
        Ok(self.model.target.interpolate(&response))
    }
}
