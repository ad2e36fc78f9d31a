//! The mesh of a scene in space: small tetrahedra at the rims of patches, where the solution is singular, large ones elsewhere.

use super::super::error::{BoundaryPart, ModelError};
use super::seen::poorly_seen;
use crate::discretization::TetMesh;
use crate::discretization::meshing::{Grading, Request, StuffingError, rim_points, stuff, surface_points};
use crate::geometry::{Implicit, Point};
use crate::scene::space::{SpaceInclusion, SpaceScene};

/// How long edges are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSize {
    /// At the rims of patches, over the width of the patch.
    pub rim: f64,
    /// On the surface of inclusions, over the width of the inclusion.
    pub inclusion: f64,
    /// At most, over the longest side of the body's bounding box.
    pub coarsest: f64,
    /// At most, over its shortest side: slabs and plates have more than one element across.
    pub thickest: f64,
    /// What they grow by per length of distance.
    pub growth: f64,
}

/// Nodes of a mesh at most.
const MOST_NODES: usize = 400_000;
/// So often elements are made smaller where they turn out too large.
const MOST_TRIES: usize = 24;
/// Points on rims and surfaces are this share of the size there apart.
const SAMPLED: f64 = 0.5;
/// Patches at an even spacing have at least this many edges across.
const ACROSS: f64 = 3.0;

impl MeshSize {
    /// That of a refinement level: each halves the edges at the rims.
    pub fn level(level: i32) -> Self {
        let finer = 2.0_f64.powi(-level);
        Self {
            rim: 0.4 * finer,
            inclusion: 0.8 * finer,
            coarsest: 0.2 * finer.sqrt(),
            thickest: finer.sqrt(),
            growth: 0.5,
        }
    }
}

/// A part of the scene that asks for its own size: points, and their extent.
struct Asking {
    points: Vec<Point<3>>,
    width: f64,
}

impl Asking {
    /// `points` at a spacing; width is the longest side of their bounding box.
    fn new(points: impl Fn(f64) -> Vec<Point<3>>, first: f64, share: f64) -> Option<Self> {
        let rough = points(first);
        let width = width(&rough)?;
        let spacing = SAMPLED * share * width;
        Some(Self { points: if spacing < first { points(spacing) } else { rough }, width })
    }
}

fn width(points: &[Point<3>]) -> Option<f64> {
    let low = points.iter().copied().reduce(|a, b| a.inf(&b))?;
    let high = points.iter().copied().reduce(|a, b| a.sup(&b))?;
    Some((high - low).max()).filter(|width| *width > 0.0)
}

/// Meshes a scene.
///
/// # Errors
/// [`ModelError`] where a patch catches no surface, or details are too small for the mesh.
pub fn mesh(scene: &SpaceScene, size: &MeshSize) -> Result<TetMesh, ModelError> {
    let body: &dyn Implicit = scene.body.as_ref();
    let extent = extent(scene);
    let coarsest = (size.coarsest * extent).min(size.thickest * shortest(scene));
    let mut grading = Grading::new(coarsest, size.growth);
    for region in patches(scene) {
        let rim = |spacing: f64| rim_points(body, region, spacing);
        if let Some(asking) = Asking::new(rim, 0.02 * extent, size.rim) {
            grading = grading.with(&asking.points, size.rim * asking.width);
        }
    }
    for inclusion in &scene.inclusions {
        let surface = |spacing: f64| surface_points(body, inclusion.region.as_ref(), spacing);
        if let Some(asking) = Asking::new(surface, sampling(inclusion, extent), size.inclusion) {
            grading = grading.with(&asking.points, size.inclusion * asking.width);
        }
    }
    stuffed(scene, grading)
}

/// Meshes a scene evenly, but so that every patch and inclusion is seen.
///
/// # Errors
/// [`ModelError`] where a patch catches no surface, or details are too small for the mesh.
pub fn even_mesh(scene: &SpaceScene, spacing: f64) -> Result<TetMesh, ModelError> {
    let (body, extent): (&dyn Implicit, f64) = (scene.body.as_ref(), extent(scene));
    let mut grading = Grading::new(spacing, 1.0);
    let rims = patches(scene).map(|region| Asking::new(|s| rim_points(body, region, s), 0.02 * extent, 0.2));
    let points = |i: &SpaceInclusion, spacing: f64| surface_points(body, i.region.as_ref(), spacing);
    let surfaces = scene.inclusions.iter().map(|i| Asking::new(|s| points(i, s), sampling(i, extent), 0.2));
    for asking in rims.chain(surfaces).flatten() {
        grading = grading.with(&asking.points, (asking.width / ACROSS).min(spacing));
    }
    stuffed(scene, grading)
}

/// How far apart an inclusion's surface is looked for first, in a body of this extent: the smallest is to be found.
fn sampling(inclusion: &SpaceInclusion, extent: f64) -> f64 {
    let width = inclusion.region.bounds().map_or(f64::INFINITY, |(low, high)| (high - low).max());
    0.05 * extent.min(5.0 * width)
}

fn extent(scene: &SpaceScene) -> f64 {
    scene.body.bounds().map_or(1.0, |(low, high)| (high - low).max())
}

fn shortest(scene: &SpaceScene) -> f64 {
    scene.body.bounds().map_or(f64::INFINITY, |(low, high)| (high - low).min())
}

/// Regions of needle, paddles and immobile part.
fn patches(scene: &SpaceScene) -> impl Iterator<Item = &dyn Implicit> {
    let held = [&scene.needle.region].into_iter().chain(scene.paddles.iter().map(|p| &p.region));
    held.chain(&scene.immobile).map(|region| region as &dyn Implicit)
}

/// Meshes at these sizes, and at smaller ones where elements turn out too large for the surface or for an inclusion.
fn stuffed(scene: &SpaceScene, mut grading: Grading) -> Result<TetMesh, ModelError> {
    for left in (0..=MOST_TRIES).rev() {
        match stuffed_once(scene, &|x| grading.size(x)) {
            Err(ModelError::Mesh(StuffingError::Unresolved { at })) if left > 0 => {
                let size = 0.5 * grading.size(&at);
                grading = grading.with(&[at], size);
            }
            Err(error) => return Err(error),
            Ok(mesh) => match poorly_seen(scene, &mesh)[..] {
                [] => return Ok(mesh),
                [first, ..] if left == 0 => return Err(ModelError::UnseenInclusion { number: first + 1 }),
                ref places => {
                    for place in places {
                        grading = finer(scene, grading, *place)?;
                    }
                }
            },
        }
    }
    Err(ModelError::Mesh(StuffingError::Vanishes))
}

/// Half the size on the surface of an inclusion.
fn finer(scene: &SpaceScene, grading: Grading, place: usize) -> Result<Grading, ModelError> {
    let (inclusion, lost) = (&scene.inclusions[place], ModelError::UnseenInclusion { number: place + 1 });
    let points = |spacing: f64| surface_points(scene.body.as_ref(), inclusion.region.as_ref(), spacing);
    let few = points(sampling(inclusion, extent(scene)));
    let size = 0.5 * few.iter().map(|x| grading.size(x)).fold(f64::INFINITY, f64::min);
    let all = if size.is_finite() { points(SAMPLED * size) } else { return Err(lost) };
    // Without a point nothing changes; few are where a cube of the search misses a small surface.
    let all = if all.is_empty() { few } else { all };
    Ok(grading.with(&all, size))
}

fn stuffed_once(scene: &SpaceScene, size: &dyn Fn(&Point<3>) -> f64) -> Result<TetMesh, ModelError> {
    let interfaces: Vec<&dyn Implicit> = scene.inclusions.iter().map(|i| i.region.as_ref()).collect();
    let patches: Vec<&dyn Implicit> = patches(scene).collect();
    let request = Request {
        body: scene.body.as_ref(),
        interfaces: &interfaces,
        patches: &patches,
        size,
        most_nodes: MOST_NODES,
        pinned: &[scene.target],
    };
    stuff(&request).map_err(|error| match error {
        StuffingError::EmptyPatch { patch } => ModelError::NothingCaught(match patch.checked_sub(1) {
            None => BoundaryPart::Needle,
            Some(k) => scene.paddles.get(k).map_or(BoundaryPart::Immobile, |p| BoundaryPart::Paddle(p.index)),
        }),
        other => ModelError::Mesh(other),
    })
}
