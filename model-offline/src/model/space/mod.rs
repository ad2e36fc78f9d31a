//! A scene in space turned into a discrete model, and bodies that can be driven through an insertion.

pub mod meshing;
mod middles;
mod patches;
mod seen;
pub mod surfaces;
pub mod survey;

use self::middles::Middles;
use self::patches::{Surface, loose, nodes_of, overlap};
use super::condensing::Condensing;
use super::error::{BoundaryPart, ModelError};
use super::tissue::{Mixing, Phase, mixture};
use crate::discretization::{Integration, Spatial, Stencil, TetMesh};
use crate::geometry::{Implicit, Point};
use crate::linalg::room;
use crate::material::{Law, Material};
use crate::mechanics::{ConstrainedRows, Constraints, Tissue};
use crate::scene::space::SpaceScene;
use crate::solver::analysis::Analysis;
use crate::solver::equilibrium::{DiscreteBody, Equilibrium, Failure, NewtonSettings};
use nalgebra::{DMatrix, Matrix3xX, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

/// The discrete model of a scene in space: everything that all paddles share. Cheap to clone.
#[derive(Debug, Clone)]
pub struct SpaceModel {
    scene: Arc<SpaceScene>,
    spatial: Spatial,
    tissue: Tissue,
    spacing: f64,
    held: Arc<HeldNodes>,
    target: Stencil<3>,
    overlapping: Vec<[usize; 2]>,
    analysis: Arc<OnceLock<Analysis>>,
}

/// Which nodes are held, and the rows `u(X_i) = Σ_I Ψ_I(X_i) d_I` that hold them.
#[derive(Debug)]
struct HeldNodes {
    immobile: Vec<u32>,
    needle: Vec<u32>,
    paddles: Vec<Vec<u32>>,
    rows: BTreeMap<u32, Stencil<3>>,
}

/// What holds a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Holder {
    /// Nothing moves it.
    Immobile,
    /// The needle.
    Needle,
    /// Paddles, by their places among those attached: one, or several where patches touch, whose mean it follows.
    Paddles(Vec<usize>),
}

/// The rows that are held with some paddles attached, and what holds each.
#[derive(Debug, Clone)]
pub struct HeldRows {
    /// The rows.
    pub rows: ConstrainedRows,
    /// What holds them, in the same order.
    pub holders: Vec<Holder>,
}

impl HeldRows {
    /// Three prescribed numbers per row.
    pub fn values(&self, needle: Vector3<f64>, paddles: &[Vector3<f64>]) -> Vec<f64> {
        let of = |holder: &Holder| match holder {
            Holder::Immobile => Vector3::zeros(),
            Holder::Needle => needle,
            Holder::Paddles(on) => on.iter().map(|&p| paddles[p]).sum::<Vector3<f64>>() / on.len() as f64,
        };
        self.holders.iter().flat_map(|holder| <[f64; 3]>::from(of(holder))).collect()
    }
}

/// Bytes of a rule in space for each tetrahedron of its mesh, as seen on `block`: stencils of nodal rules reach a hundred nodes.
fn bytes_of(integration: Integration) -> u64 {
    match integration {
        Integration::FemT4 => 500,
        Integration::FemT10 => 2_500,
        _ => 24_000,
    }
}

impl SpaceModel {
    /// The model of a scene on a mesh whose surface follows the rims of the scene's patches, and whose faces follow its
    /// inclusions.
    ///
    /// # Errors
    /// [`ModelError`] for patches without nodes or that claim the same ones, and methods that do not combine.
    pub fn on(scene: &SpaceScene, mesh: &TetMesh) -> Result<Self, ModelError> {
        let surface = Surface::new(mesh, scene.size());
        let patches = patches_of(scene, &surface)?;
        loose_part(scene, mesh, &patches)?;
        let patch_of = |region: &'_ _| surface.patch(&[region]);
        let regions = scene.immobile.iter().map(|r| r as &dyn Implicit).chain([&scene.needle.region as &dyn Implicit]);
        let regions = regions.chain(scene.paddles.iter().map(|p| &p.region as &dyn Implicit));
        let rimmed: Vec<(Vec<[u32; 3]>, &dyn Implicit)> = regions.map(|region| (patch_of(region), region)).collect();
        let inclusions: Vec<&dyn Implicit> = scene.inclusions.iter().map(|i| i.region.as_ref()).collect();
        let middles = Middles::new(mesh, &surface, scene.body.as_ref(), &rimmed, &inclusions);
        room(3 * mesh.nodes.len(), bytes_of(scene.discretization.method.integration) * mesh.tetrahedra.len() as u64)
            .map_err(Failure::from)?;
        let spatial = Spatial::new(mesh, scene.discretization.method, |a, b| middles.place(a, b))?;
        let held = HeldNodes::new(&spatial, scene, &patches)?;
        let typical = spatial.volumes().iter().copied().fold(f64::INFINITY, f64::min).cbrt();
        Ok(Self {
            tissue: tissue_of(scene, &spatial),
            target: spatial.value_stencil(&scene.target)?,
            overlapping: overlapping(scene, &patches),
            scene: Arc::new(scene.clone()),
            spacing: typical,
            held: Arc::new(held),
            spatial,
            analysis: Arc::default(),
        })
    }

    /// The scene.
    pub fn scene(&self) -> &SpaceScene {
        &self.scene
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.spatial.positions().len()
    }

    /// Side of the smallest nodal volume, length.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Number of unknowns.
    pub fn dofs(&self) -> usize {
        3 * self.nodes()
    }

    /// The body's discretization.
    pub fn spatial(&self) -> &Spatial {
        &self.spatial
    }

    /// Materials by cell.
    pub fn tissue(&self) -> &Tissue {
        &self.tissue
    }

    /// The same nodes and shape functions without the scene's inclusions.
    #[must_use]
    pub fn without_inclusions(&self) -> Self {
        let scene = self.scene.without_inclusions();
        Self { tissue: tissue_of(&scene, &self.spatial), scene: Arc::new(scene), ..self.clone() }
    }

    /// The target's row: `u(X_t) = Σ_I Ψ_I(X_t) d_I`.
    pub fn target_row(&self) -> &Stencil<3> {
        &self.target
    }

    /// Everything that is held with some paddles attached, by their places in the scene's list: immobile part, needle,
    /// paddles.
    pub fn held_rows(&self, attached: &[usize]) -> HeldRows {
        let held = &self.held;
        let mut on: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (slot, &paddle) in attached.iter().enumerate() {
            for &node in &held.paddles[paddle] {
                on.entry(node).or_default().push(slot);
            }
        }
        let fixed = held.immobile.iter().map(|&node| (node, Holder::Immobile));
        let all: Vec<(u32, Holder)> = fixed
            .chain(held.needle.iter().map(|&node| (node, Holder::Needle)))
            .chain(on.into_iter().map(|(node, slots)| (node, Holder::Paddles(slots))))
            .collect();
        HeldRows {
            rows: ConstrainedRows::new(all.iter().map(|(node, _)| &held.rows[node])),
            holders: all.into_iter().map(|(_, holder)| holder).collect(),
        }
    }

    /// Nodes on which a paddle is attached, by its place in the scene's list, ascending.
    pub fn paddle_nodes(&self, paddle: usize) -> &[u32] {
        &self.held.paddles[paddle]
    }

    /// Nodes on the needle's patch and on that of each paddle: how many.
    pub(crate) fn nodes_on_patches(&self) -> Vec<usize> {
        [&self.held.needle].into_iter().chain(&self.held.paddles).map(Vec::len).collect()
    }

    /// The largest part by which elements have more or less of an inclusion than there is of it, beyond what is not known of that: on a
    /// coarse mesh faces cut its edges and corners off.
    pub(crate) fn misses_of_inclusions(&self) -> f64 {
        let mut found = vec![0.0; self.scene.inclusions.len() + 1];
        let (rule, shares) = (self.spatial.rule(), self.spatial.shares());
        for point in (0..rule.len()).map(|q| rule.point(q)) {
            for (part, share) in &shares[point.cell as usize] {
                found[*part as usize] += share * point.weight;
            }
        }
        let misses = found[1..].iter().enumerate().filter_map(|(place, found)| {
            let volume = seen::sampled_volume(&self.scene, place)?;
            Some((found / volume - 1.0).abs() - seen::SAMPLING_ERROR)
        });
        misses.fold(0.0, f64::max)
    }

    /// Those of the scene's pairs whose patches have a piece of the surface in common, where two paddles cannot both be.
    pub fn overlapping(&self) -> &[[usize; 2]] {
        &self.overlapping
    }

    /// The row of a held node.
    pub(crate) fn row(&self, node: u32) -> &Stencil<3> {
        &self.held.rows[&node]
    }

    /// Rule, tissue and nodes, for a solver.
    pub(crate) fn discrete_body(&self) -> DiscreteBody<'_, 3> {
        DiscreteBody {
            rule: Arc::clone(self.spatial.rule()),
            tissue: self.tissue.clone(),
            positions: self.spatial.positions(),
            spacing: self.spacing,
        }
    }

    /// Node lists of everything that may be constrained.
    fn constrained_lists(&self) -> impl Iterator<Item = &[u32]> + Clone {
        self.held.rows.values().chain([&self.target]).map(|stencil| stencil.nodes.as_slice())
    }

    /// Sparsity and elimination order that serve every body of this model, whatever is attached.
    pub(crate) fn analysis(&self) -> &Analysis {
        self.analysis
            .get_or_init(|| Analysis::new(self.spatial.rule(), self.spatial.positions(), self.constrained_lists()))
    }

    /// The nodes of all paddles, each once, in the order of paddles.
    pub(crate) fn paddles_nodes(&self) -> Vec<u32> {
        let mut seen = BTreeSet::new();
        self.held.paddles.iter().flatten().copied().filter(|node| seen.insert(*node)).collect()
    }

    /// The same condensed to the displacements of the [paddles' nodes](Self::paddles_nodes) and of the target: where those are
    /// single unknowns, as with elements, their nodes are eliminated last, else ports of theirs.
    pub(crate) fn condensing_analysis(&self) -> Condensing {
        let (rule, positions) = (self.spatial.rule(), self.spatial.positions());
        let rows: Vec<&Stencil<3>> =
            self.paddles_nodes().iter().map(|node| &self.held.rows[node]).chain([&self.target]).collect();
        if self.spatial.method().integration.is_element() {
            let retained: BTreeSet<u32> = rows.iter().flat_map(|row| row.nodes.iter().copied()).collect();
            let retained: Vec<u32> = retained.into_iter().collect();
            let analysis = Analysis::retaining(rule, positions, self.constrained_lists(), &retained);
            return Condensing { analysis, retained: retained.len(), ports: None };
        }
        Condensing::to_ports(rule, positions, self.constrained_lists(), &rows)
    }

    /// A body at rest with some paddles attached, by their places in the scene's list.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at rest is singular.
    pub fn body(&self, attached: &[usize], settings: NewtonSettings) -> Result<SpaceBody<'_>, Failure> {
        let held = self.held_rows(attached);
        let constraints = Constraints::from(held.rows.clone());
        let equilibrium = Equilibrium::analysed(self.discrete_body(), self.analysis(), constraints, settings)?;
        let paddles = vec![Vector3::zeros(); attached.len()];
        Ok(SpaceBody { model: self, equilibrium, held, depth: 0.0, paddles, beside: None })
    }

    /// Displacement of any point of the body for given coefficients.
    pub fn displacement_at(&self, x: &Point<3>, coefficients: &[f64]) -> Point<3> {
        self.spatial.value_stencil(x).map_or_else(|_| Point::zeros(), |stencil| stencil.interpolate(coefficients))
    }

    /// Displacements of all nodes for given coefficients.
    pub fn nodal_displacements(&self, coefficients: &[f64]) -> Vec<Point<3>> {
        let nodes = 0..self.nodes() as u32;
        let of =
            |node| self.spatial.nodal_stencil(node).map_or_else(|_| Point::zeros(), |s| s.interpolate(coefficients));
        nodes.map(of).collect()
    }
}

impl HeldNodes {
    /// The nodes of patches: immobile part, needle, paddles.
    fn new(spatial: &Spatial, scene: &SpaceScene, patches: &[Vec<[u32; 3]>]) -> Result<Self, ModelError> {
        let middles = spatial.middles();
        let mut nodes = patches.iter().map(|patch| nodes_of(patch, &middles));
        let (immobile, needle) = (nodes.next().unwrap_or_default(), nodes.next().unwrap_or_default());
        let paddles: Vec<Vec<u32>> = nodes.collect();
        if let Some((part, other, node)) = touching(scene, [&immobile, &needle], &paddles) {
            let touch = ModelError::PatchesTouch { part, other, at: spatial.positions()[node as usize].into() };
            return Err(touch.in_file(scene));
        }
        let all = immobile.iter().chain(&needle).chain(paddles.iter().flatten());
        let rows = all.map(|&node| Ok((node, spatial.nodal_stencil(node)?))).collect::<Result<_, ModelError>>()?;
        Ok(Self { immobile, needle, paddles, rows })
    }
}

/// A node that two patches claim, of which one cannot follow the other: what is immobile and the needle, or either and a paddle.
/// Nodes of each in ascending order.
fn touching(
    scene: &SpaceScene,
    [immobile, needle]: [&Vec<u32>; 2],
    paddles: &[Vec<u32>],
) -> Option<(BoundaryPart, BoundaryPart, u32)> {
    let named = scene.paddles.iter().map(|p| BoundaryPart::Paddle(p.index)).zip(paddles);
    named.chain([(BoundaryPart::Needle, needle)]).find_map(|(part, nodes)| {
        let others = [(BoundaryPart::Immobile, immobile), (BoundaryPart::Needle, needle)];
        others.into_iter().filter(|(other, _)| *other != part).find_map(|(other, theirs)| {
            let common = nodes.iter().find(|node| theirs.binary_search(node).is_ok())?;
            Some((part, other, *common))
        })
    })
}

/// Triangles of the immobile part, of the needle's contact and of every paddle.
fn patches_of(scene: &SpaceScene, surface: &Surface<'_>) -> Result<Vec<Vec<[u32; 3]>>, ModelError> {
    let immobile = scene.immobile.iter().map(|region| region as &dyn Implicit).collect();
    let held = [(immobile, BoundaryPart::Immobile), (vec![&scene.needle.region as _], BoundaryPart::Needle)];
    let paddles = scene.paddles.iter().map(|p| (vec![&p.region as &dyn Implicit], BoundaryPart::Paddle(p.index)));
    let all = held.into_iter().chain(paddles);
    all.map(|(regions, part): (Vec<&dyn Implicit>, _)| match surface.patch(&regions) {
        patch if patch.is_empty() => Err(ModelError::NothingConstrained(part).in_file(scene)),
        patch => Ok(patch),
    })
    .collect()
}

/// Refuses a part of the body that neither of the first two patches holds, immobile part and needle.
fn loose_part(scene: &SpaceScene, mesh: &TetMesh, patches: &[Vec<[u32; 3]>]) -> Result<(), ModelError> {
    let at = loose(mesh, patches[..2].iter().flatten().flatten());
    at.map_or(Ok(()), |at| Err(ModelError::LoosePart { at: at.into() }.in_file(scene)))
}

/// Those of the scene's pairs whose patches overlap.
fn overlapping(scene: &SpaceScene, patches: &[Vec<[u32; 3]>]) -> Vec<[usize; 2]> {
    scene.pairs.iter().copied().filter(|&[a, b]| overlap(&patches[2 + a], &patches[2 + b])).collect()
}

/// The materials of a scene's cells, by the parts of the mesh that they lie in.
fn tissue_of(scene: &SpaceScene, spatial: &Spatial) -> Tissue {
    let mut materials: Vec<Law> = vec![scene.material.clone()];
    let mut parts = vec![(0, 1.0)];
    for inclusion in &scene.inclusions {
        parts.push(match &inclusion.material {
            None => (0, inclusion.stiffness),
            Some(material) => {
                materials.push(material.clone());
                (materials.len() as u32 - 1, inclusion.stiffness)
            }
        });
    }
    let shear: Vec<f64> = materials.iter().map(<Law as Material<3>>::rest_shear_modulus).collect();
    let mixing = Mixing::of(spatial.method().integration);
    let of_cell = |shares: &BTreeMap<u32, f64>| {
        // Parts that the scene has no inclusion for are the body's: the same mesh serves homogeneous tissue.
        let phase = |(&part, &share): (&u32, &f64)| Phase {
            share,
            parts: vec![parts.get(part as usize).copied().unwrap_or((0, 1.0))],
        };
        mixture(&shares.iter().map(phase).collect::<Vec<_>>(), &shear, mixing)
    };
    Tissue::new(materials, spatial.shares().iter().map(of_cell).collect::<Vec<_>>())
}

/// A body in equilibrium with the needle at some depth and the paddles somewhere.
#[derive(Debug, Clone)]
pub struct SpaceBody<'m> {
    model: &'m SpaceModel,
    equilibrium: Equilibrium<3>,
    held: HeldRows,
    depth: f64,
    paddles: Vec<Vector3<f64>>,
    /// What the target is displaced by per control beside what the nodes say, where a better model has been heard.
    beside: Option<Matrix3xX<f64>>,
}

impl SpaceBody<'_> {
    /// Corrects the target's displacement by a term linear in the controls, so that at rest it answers as another model of the
    /// body: `per_control` has 3 rows, a column for the depth and three per paddle.
    ///
    /// # Errors
    /// [`Failure`] when the body, which is to be at rest, is not stable.
    pub(crate) fn answering_at_rest(mut self, per_control: &DMatrix<f64>) -> Result<Self, Failure> {
        self.beside = None;
        let own = self.actuation_jacobian()?.insert_column(0, 0.0);
        let mut beside = Matrix3xX::from_column_slice(per_control.as_slice()) - own;
        let per_depth = self.depth_sensitivity()?;
        beside.column_mut(0).axpy(-1.0, &per_depth, 1.0);
        self.beside = Some(beside);
        Ok(self)
    }

    /// What the target is displaced by per control beside what the nodes say.
    pub(crate) fn beside(&self) -> Option<&Matrix3xX<f64>> {
        self.beside.as_ref()
    }

    /// Needle depth.
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// Displacements of the attached paddles.
    pub fn paddles(&self) -> &[Vector3<f64>] {
        &self.paddles
    }

    /// The model that it is a body of.
    pub(crate) fn model(&self) -> &SpaceModel {
        self.model
    }

    /// Prescribed values with the needle at `depth` and the paddles displaced.
    pub(crate) fn prescribed_values(&self, depth: f64, paddles: &[Vector3<f64>]) -> Vec<f64> {
        self.held.values(self.model.scene.needle.axis * depth, paddles)
    }

    /// The equilibrium behind it.
    pub fn equilibrium(&self) -> &Equilibrium<3> {
        &self.equilibrium
    }

    /// The equilibrium behind it, to change settings.
    pub fn equilibrium_mut(&mut self) -> &mut Equilibrium<3> {
        &mut self.equilibrium
    }

    /// Takes needle and paddles to the given depth and displacements along a straight path.
    ///
    /// # Errors
    /// [`Failure`]; depth and paddles are then where the last converged state has them.
    pub fn drive(&mut self, depth: f64, paddles: &[Vector3<f64>]) -> Result<(), Failure> {
        let prescribed = self.prescribed_values(depth, paddles);
        let outcome = self.equilibrium.drive(&prescribed);
        let reached = outcome.as_ref().map_or_else(|failure| failure.reached, |()| 1.0);
        self.depth += (depth - self.depth) * reached;
        for (at, to) in self.paddles.iter_mut().zip(paddles) {
            *at += (to - *at) * reached;
        }
        outcome
    }

    /// Force that pushes the contact along the needle's axis.
    pub fn contact_force(&self) -> f64 {
        let forces: Vec<f64> = self.equilibrium.reactions().collect();
        let on_needle = forces.chunks_exact(3).zip(&self.held.holders).filter(|(_, holder)| **holder == Holder::Needle);
        on_needle.map(|(force, _)| Vector3::from_column_slice(force).dot(&self.model.scene.needle.axis)).sum()
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector3<f64> {
        let nodal = self.model.target.interpolate(self.equilibrium.coefficients());
        let Some(beside) = &self.beside else { return nodal };
        let by_paddles = self.paddles.iter().enumerate().map(|(p, moved)| beside.fixed_columns::<3>(1 + 3 * p) * moved);
        nodal + beside.column(0) * self.depth + by_paddles.sum::<Vector3<f64>>()
    }

    /// Actuation Jacobian d(target displacement)/d(paddle displacements) with the needle still, by exact linearisation: 3
    /// rows, three columns per paddle.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn actuation_jacobian(&mut self) -> Result<Matrix3xX<f64>, Failure> {
        let count = self.paddles.len();
        if count == 0 {
            return Ok(Matrix3xX::zeros(0));
        }
        let rates: Vec<f64> = (0..3 * count)
            .flat_map(|column| {
                let mut paddles = vec![Vector3::zeros(); count];
                paddles[column / 3][column % 3] = 1.0;
                self.held.values(Vector3::zeros(), &paddles)
            })
            .collect();
        let responses = self.equilibrium.sensitivities(&rates)?;
        let columns = responses.chunks_exact(self.model.dofs()).map(|r| self.model.target.interpolate(r));
        let nodal = Matrix3xX::from_columns(&columns.collect::<Vec<_>>());
        Ok(self.beside.as_ref().map_or_else(|| nodal.clone(), |beside| &nodal + beside.columns(1, 3 * count)))
    }

    /// d(target displacement)/d(depth) with the paddles held, by exact linearisation.
    ///
    /// # Errors
    /// [`Failure`] when the current state is not stable.
    pub fn depth_sensitivity(&mut self) -> Result<Vector3<f64>, Failure> {
        let still = vec![Vector3::zeros(); self.paddles.len()];
        let response = self.equilibrium.sensitivities(&self.held.values(self.model.scene.needle.axis, &still))?;
        let nodal = self.model.target.interpolate(&response);
        Ok(self.beside.as_ref().map_or(nodal, |beside| nodal + beside.column(0)))
    }
}
