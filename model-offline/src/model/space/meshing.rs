//! The mesh of a scene in space: small tetrahedra at the rims of patches, where the solution is singular, large ones elsewhere.

use super::super::error::{BoundaryPart, ModelError};
use super::patches::Surface;
use super::seen::{BodySurface, poorly_seen};
use crate::discretization::TetMesh;
use crate::discretization::meshing::{Grading, Request, Sizes, StuffingError, rim_points, stuff, surface_points};
use crate::geometry::{Implicit, Point};
use crate::linalg::room;
use crate::scene::space::{SpaceInclusion, SpaceScene};
use crate::solver::equilibrium::Failure;
use std::collections::BTreeMap;

/// How long edges are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSize {
    /// At the rims of patches, over the width of the patch: that of a strip is twice the narrow one.
    pub rim: f64,
    /// On the surface of inclusions, over the width of the inclusion.
    pub inclusion: f64,
    /// At the target, over its distance from the body's surface: what is read there is a field that varies over that distance.
    /// None: whatever is around it.
    pub target: Option<f64>,
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
/// Points of the body's surface at which a mesh is looked at are this share of the longest edges apart.
const LOOKED_AT: f64 = 0.5;
/// A target nearer to the surface than this share of the body's longest side counts as this far from it.
const DEEP: f64 = 0.1;
/// Points of the body's surface are this share of its longest side apart where a region's distance from it is looked for, which so
/// many steps make better.
const NEARBY: f64 = 0.03;
const APPROACHES: usize = 30;
/// Nearer than this share of the longest side they meet, but for rounding and what files leave open.
const MEETS: f64 = 1e-4;
/// Lattices are laid for leaves of this share of the body's longest side, the same at every level.
const LATTICE: f64 = 0.2;
/// Patches at an even spacing have at least this many edges across.
const ACROSS: f64 = 3.0;

impl MeshSize {
    /// That of a refinement level: each halves the edges at the rims. Half a level is a size between two; where cells are halved alike
    /// it is the mesh of one of them.
    pub fn level(level: impl Into<f64>) -> Self {
        let level = level.into();
        let finer = (-level).exp2();
        Self {
            rim: 0.4 * finer,
            inclusion: 0.8 * finer,
            // Coarser meshes are those that insertions are followed on: there nothing is gained by it.
            target: (level > 0.0).then(|| 0.2 * finer.sqrt()),
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
    /// `points` at a spacing; width is the longest side of their bounding box, or `at_most`.
    fn new(points: impl Fn(f64) -> Vec<Point<3>>, first: f64, share: f64, at_most: f64) -> Option<Self> {
        let rough = points(first);
        let width = width(&rough)?.min(at_most);
        let spacing = SAMPLED * share * width;
        Some(Self { points: if spacing < first { points(spacing) } else { rough }, width })
    }
}

fn width(points: &[Point<3>]) -> Option<f64> {
    let low = points.iter().copied().reduce(|a, b| a.inf(&b))?;
    let high = points.iter().copied().reduce(|a, b| a.sup(&b))?;
    Some((high - low).max()).filter(|width| *width > 0.0)
}

/// Bytes that a small mesh and what it is made from take.
const OF_A_MESH: u64 = 1 << 26;

/// Meshes a scene.
///
/// # Errors
/// [`ModelError`] where a patch catches no surface, details are too small for the mesh, or there is no memory for it.
pub fn mesh(scene: &SpaceScene, size: &MeshSize) -> Result<TetMesh, ModelError> {
    // How many unknowns it will have is not known before.
    room(0, OF_A_MESH).map_err(Failure::from)?;
    let mesh = graded(scene, size, &[])?;
    let surface = Surface::new(&mesh, scene.size());
    let narrow: Vec<f64> = patches(scene).map(|region| surface.narrow_width(&surface.patch(&[region]))).collect();
    // The length of a strip says nothing of how its rims act on each other.
    if narrow.iter().all(|width| width.is_infinite()) { Ok(mesh) } else { graded(scene, size, &narrow) }
}

/// Meshes a scene whose patches are at most so wide, as far as that is known; length units.
fn graded(scene: &SpaceScene, size: &MeshSize, at_most: &[f64]) -> Result<TetMesh, ModelError> {
    let body: &dyn Implicit = scene.body.as_ref();
    let extent = extent(scene);
    let coarsest = (size.coarsest * extent).min(size.thickest * shortest(scene));
    let mut grading = Grading::new(coarsest, size.growth);
    if let Some(share) = size.target {
        let depth = scene.body.level(&scene.target).abs().max(DEEP * extent);
        grading = grading.with(&[scene.target], share * depth);
    }
    for (k, region) in patches(scene).enumerate() {
        let rim = |spacing: f64| rim_points(body, region, spacing);
        let at_most = at_most.get(k).copied().unwrap_or(f64::INFINITY);
        if let Some(asking) = Asking::new(rim, 0.02 * extent, size.rim, at_most) {
            grading = grading.with(&asking.points, size.rim * asking.width);
        }
    }
    for inclusion in &scene.inclusions {
        let surface = |spacing: f64| surface_points(body, inclusion.region.as_ref(), &|_| spacing);
        if let Some(asking) = Asking::new(surface, sampling(inclusion, extent), size.inclusion, f64::INFINITY) {
            grading = grading.with(&asking.points, size.inclusion * asking.width);
        }
    }
    let lattice = (LATTICE * extent).min(shortest(scene));
    stuffed(scene, grading, &Grading::new(coarsest, size.growth), lattice)
}

/// Meshes a scene evenly, but so that every patch and inclusion is seen.
///
/// # Errors
/// [`ModelError`] where a patch catches no surface, or details are too small for the mesh.
pub fn even_mesh(scene: &SpaceScene, spacing: f64) -> Result<TetMesh, ModelError> {
    let (body, extent): (&dyn Implicit, f64) = (scene.body.as_ref(), extent(scene));
    let coarsest = Grading::new(spacing, 1.0);
    let mut grading = coarsest.clone();
    let rims =
        patches(scene).map(|region| Asking::new(|s| rim_points(body, region, s), 0.02 * extent, 0.2, f64::INFINITY));
    let points = |i: &SpaceInclusion, spacing: f64| surface_points(body, i.region.as_ref(), &|_| spacing);
    let surfaces =
        scene.inclusions.iter().map(|i| Asking::new(|s| points(i, s), sampling(i, extent), 0.2, f64::INFINITY));
    for asking in rims.chain(surfaces).flatten() {
        grading = grading.with(&asking.points, (asking.width / ACROSS).min(spacing));
    }
    stuffed(scene, grading, &coarsest, spacing)
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
/// Nowhere are they larger than `coarsest`, which asks nothing of any place; the lattice is laid for leaves as wide as `lattice`.
fn stuffed(scene: &SpaceScene, mut grading: Grading, coarsest: &Grading, lattice: f64) -> Result<TetMesh, ModelError> {
    let most = coarsest.coarsest();
    let (mut closely, mut surface) = (coarsest.clone(), BodySurface::new(scene, &|_| LOOKED_AT * most));
    for left in (0..=MOST_TRIES).rev() {
        let mesh = match stuffed_once(scene, &grading, lattice) {
            Ok(mesh) => mesh,
            Err(ModelError::Mesh(StuffingError::Unresolved { at })) if left > 0 => {
                let size = 0.5 * grading.at(&at);
                grading = grading.with(&[at], size);
                continue;
            }
            Err(error) => return Err(error),
        };
        let unseen = poorly_seen(scene, &mesh);
        let missed = surface.missed(&mesh, &|x| grading.at(x), most);
        match (unseen.first(), missed.all.first()) {
            (None, None) => return Ok(mesh),
            (Some(first), _) if left == 0 => return Err(lost(scene, *first)),
            (None, Some(at)) if left == 0 => return Err(ModelError::Mesh(StuffingError::Unresolved { at: *at })),
            _ => {}
        }
        for place in unseen {
            grading = finer(scene, grading, place)?;
        }
        if !missed.lost.is_empty() {
            // There it is looked at more closely, lest the rest of a thin bore be lost between two points.
            closely = halved(&grading, closely, missed.lost);
            surface = BodySurface::new(scene, &|x| LOOKED_AT * closely.at(x));
        }
        grading = halved(&grading, grading.clone(), missed.all);
    }
    Err(ModelError::Mesh(StuffingError::Vanishes))
}

/// A grading with half of the `present` size at each of some points.
fn halved(present: &Grading, grading: Grading, points: Vec<Point<3>>) -> Grading {
    // Powers of two, so that few sizes are told apart.
    let mut by_power: BTreeMap<i32, Vec<Point<3>>> = BTreeMap::new();
    for x in points {
        by_power.entry((0.5 * present.at(&x)).log2().round() as i32).or_default().push(x);
    }
    by_power.into_iter().fold(grading, |grading, (power, points)| grading.with(&points, 2.0_f64.powi(power)))
}

/// An inclusion of which the elements see nothing.
fn lost(scene: &SpaceScene, place: usize) -> ModelError {
    ModelError::UnseenInclusion { number: place + 1 }.in_file(scene)
}

/// Half the size on the surface of an inclusion.
fn finer(scene: &SpaceScene, grading: Grading, place: usize) -> Result<Grading, ModelError> {
    let inclusion = &scene.inclusions[place];
    let points = |spacing: f64| surface_points(scene.body.as_ref(), inclusion.region.as_ref(), &|_| spacing);
    let few = points(sampling(inclusion, extent(scene)));
    let size = 0.5 * few.iter().map(|x| grading.at(x)).fold(f64::INFINITY, f64::min);
    let all = if size.is_finite() { points(SAMPLED * size) } else { return Err(lost(scene, place)) };
    // Without a point nothing changes; few are where a cube of the search misses a small surface.
    let all = if all.is_empty() { few } else { all };
    Ok(grading.with(&all, size))
}

fn stuffed_once(scene: &SpaceScene, size: &Grading, lattice: f64) -> Result<TetMesh, ModelError> {
    let interfaces: Vec<&dyn Implicit> = scene.inclusions.iter().map(|i| i.region.as_ref()).collect();
    let patches: Vec<&dyn Implicit> = patches(scene).collect();
    let request = Request {
        body: scene.body.as_ref(),
        interfaces: &interfaces,
        patches: &patches,
        size,
        lattice: Some(lattice),
        most_nodes: MOST_NODES,
        pinned: &[scene.target],
    };
    stuff(&request).map_err(|error| match error {
        StuffingError::EmptyPatch { patch } => {
            let distance = patches.get(patch).and_then(|region| from_surface(scene, *region));
            let nothing = |part| ModelError::NothingCaught { part, distance };
            // In the order of `patches`.
            match patch.checked_sub(1).map(|k| scene.paddles.get(k).ok_or_else(|| k - scene.paddles.len())) {
                None => nothing(BoundaryPart::Needle).in_file(scene),
                Some(Ok(paddle)) => nothing(BoundaryPart::Paddle(paddle.index)).in_file(scene),
                Some(Err(region)) => nothing(BoundaryPart::Immobile).at(scene.in_file.immobile.get(region).cloned()),
            }
        }
        other => ModelError::Mesh(other),
    })
}

/// How far a region is from the body's surface, about; length units. None where they meet.
fn from_surface(scene: &SpaceScene, region: &dyn Implicit) -> Option<f64> {
    let body = scene.body.as_ref();
    let points = surface_points(body, body, &|_| NEARBY * extent(scene));
    let mut x = points.into_iter().min_by(|a, b| region.level(a).total_cmp(&region.level(b)))?;
    let (near, mut least) = (MEETS * extent(scene), region.level(&x));
    // Towards the region, and back onto the surface.
    for _ in 0..APPROACHES {
        x -= region.gradient(&x) * region.level(&x).max(0.0);
        x -= body.gradient(&x) * body.level(&x);
        if body.level(&x).abs() <= near {
            least = least.min(region.level(&x));
        }
    }
    Some(least).filter(|distance| *distance > near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::space::AnyScene;

    /// A block with a square contact and paddles that are ten times as long as wide, square, and a band round a bore.
    const STRIPS: &str = r#"
[scene]
name = "strips"
dimension = 3
[domain]
solid = { difference = [{ box = { min = [0.0, 0.0, 0.0], max = [100.0, 100.0, 60.0] } },
                        { cylinder = { from = [75.0, -1.0, 30.0], to = [75.0, 101.0, 30.0], radius = 10.0 } }] }
[material]
model = "neo-hookean"
lambda = 4.0
mu = 1.0
[immobile]
regions = [{ box = { min = [0.0, 0.0, 0.0], max = [100.0, 100.0, 0.0] } }]
[needle]
region = { box = { min = [45.0, 45.0, 60.0], max = [55.0, 55.0, 60.0] } }
axis = [0.0, 0.0, -1.0]
depth = 2.0
[target]
position = [50.0, 50.0, 30.0]
[[paddle]]
index = 1
region = { box = { min = [0.0, 10.0, 28.0], max = [0.0, 90.0, 36.0] } }
[[paddle]]
index = 2
region = { box = { min = [40.0, 0.0, 20.0], max = [60.0, 0.0, 40.0] } }
[[paddle]]
index = 3
region = { box = { min = [60.0, 48.0, 10.0], max = [90.0, 52.0, 50.0] } }
[discretization]
level = 0
"#;

    /// A block of 40 mm, needle and paddles round: their rims lie anyhow to the lattice.
    const ROUND: &str = r#"
[scene]
name = "round"
dimension = 3
[domain]
solid = { box = { min = [-20.0, -20.0, 0.0], max = [20.0, 20.0, 40.0] } }
[material]
model = "neo-hookean"
lambda = 30.0
mu = 6.0
[immobile]
regions = [{ box = { min = [-20.0, -20.0, 0.0], max = [20.0, 20.0, 0.0] } }]
[needle]
region = { sphere = { centre = [0.0, 0.0, 40.0], radius = 4.0 } }
axis = [0.0, 0.0, -1.0]
depth = 4.0
[target]
position = [0.0, 0.0, 22.0]
[[paddle]]
index = 1
region = { sphere = { centre = [20.0, 0.0, 22.0], radius = 5.0 } }
[[paddle]]
index = 2
region = { sphere = { centre = [0.0, 20.0, 22.0], radius = 5.0 } }
[discretization]
level = 0
"#;

    /// Two meshes tell of an error where both keep what is asked of them: a rim that stays behind has both wrong alike. By chance, or as
    /// a plane asked for smaller leaves on one level and not on the next, the needle's rim was that of level 0 on level 1.
    #[test]
    fn edges_of_every_rim_halve_with_the_level() {
        for (text, patches_with_rims) in [(STRIPS, 4), (ROUND, 3)] {
            let AnyScene::Space(scene) = AnyScene::parse(text, "rims.toml").unwrap() else { panic!("planar") };
            let levels: Vec<Vec<f64>> = (0..3)
                .map(|level| {
                    let mesh = mesh(&scene, &MeshSize::level(level)).unwrap();
                    let surface = Surface::new(&mesh, scene.size());
                    let mean = |region: &dyn Implicit| {
                        let rim = surface.rim(&surface.patch(&[region]));
                        let length = |(a, b): &(u32, u32)| (mesh.nodes[*a as usize] - mesh.nodes[*b as usize]).norm();
                        rim.iter().map(length).sum::<f64>() / rim.len() as f64
                    };
                    patches(&scene).take(patches_with_rims).map(mean).collect()
                })
                .collect();
            for pair in levels.windows(2) {
                let ratios: Vec<f64> = pair[1].iter().zip(&pair[0]).map(|(fine, coarse)| fine / coarse).collect();
                assert!(ratios.iter().all(|ratio| (0.3..0.7).contains(ratio)), "{ratios:?}");
            }
        }
    }

    #[test]
    fn strips_are_meshed_by_their_width_and_every_level_refines_every_patch() {
        let AnyScene::Space(scene) = AnyScene::parse(STRIPS, "strips.toml").unwrap() else { panic!("planar") };
        let triangles = |mesh: &TetMesh| -> Vec<usize> {
            let surface = Surface::new(mesh, scene.size());
            patches(&scene).map(|region| surface.patch(&[region]).len()).collect()
        };
        let levels: Vec<TetMesh> = (0..3).map(|level| mesh(&scene, &MeshSize::level(level)).unwrap()).collect();
        // Needle, paddles, immobile part: 80 by 8, 20 by 20, and 4 along a bore of 62.8 round. That band has no ends: the
        // rectangle of its area and rim is 4.3 wide.
        let surface = Surface::new(&levels[1], scene.size());
        let widths: Vec<f64> = patches(&scene).map(|region| surface.narrow_width(&surface.patch(&[region]))).collect();
        let expected = [f64::INFINITY, 16.0, f64::INFINITY, 8.6, f64::INFINITY];
        for (width, expected) in widths.iter().zip(expected) {
            assert!(*width == expected || (width / expected - 1.0).abs() < 0.05, "{widths:?}");
        }
        let counts: Vec<Vec<usize>> = levels.iter().map(triangles).collect();
        for pair in counts.windows(2) {
            // Needle and paddles: their rims are where the answers are made.
            let grown = pair[0][..4].iter().zip(&pair[1]).map(|(before, now)| *now as f64 / *before as f64);
            assert!(grown.clone().all(|ratio| ratio > 1.5), "{counts:?}");
        }
    }
}
