//! What can be known of a scene in space without solving: its numbers, its mesh, and what of it is seldom meant.

use super::patches::{Surface, nodes_of, parts};
use super::seen::{BodySurface, outside, sampled_volume};
use super::{loose_part, overlapping, patches_of, touching};
use crate::discretization::TetMesh;
use crate::discretization::meshing::mesh::Element;
use crate::geometry::implicit::distance_from;
use crate::geometry::{Implicit, Point, box_of};
use crate::model::error::ModelError;
use crate::scene::SceneWarning;
use crate::scene::millimetres;
use crate::scene::space::SpaceScene;
use crate::scene::warning::{self, ALONG};
use serde::Serialize;
use std::collections::BTreeMap;

/// So many of the worst elements are named.
const NAMED: usize = 5;
/// Points of the body's surface are so far apart, over the size of the body.
const SAMPLED: f64 = 0.05;
/// From so many of the mesh's nearest triangles the surface is followed to where it is nearest to the target.
const STARTS: usize = 12;
/// The needle's way is followed in so many steps over the size of the body.
const STEPS: i32 = 1000;

/// The numbers of a scene in space and of a mesh of it; lengths in the scene's unit.
#[derive(Debug, Clone, Serialize)]
pub struct Survey {
    /// Lowest corner of the body's bounding box.
    pub low: [f64; 3],
    /// Highest corner.
    pub high: [f64; 3],
    /// Volume of the mesh.
    pub volume: f64,
    /// Area of its surface.
    pub surface: f64,
    /// What cannot move.
    pub immobile: PatchSurvey,
    /// The needle.
    pub needle: NeedleSurvey,
    /// The target.
    pub target: TargetSurvey,
    /// Regions of another stiffness or material, in the order of the file.
    pub inclusions: Vec<InclusionSurvey>,
    /// Paddle positions, in the order of the file.
    pub paddles: Vec<PaddleSurvey>,
    /// The mesh.
    pub mesh: MeshSurvey,
    /// Pairs of paddles that overlap, by index.
    pub overlapping: Vec<[u32; 2]>,
    /// Parts that the body falls into: nothing more than an edge joins them.
    pub parts: usize,
    /// Paddles on another part than the target's, by index.
    pub apart: Vec<u32>,
    /// Whether the needle enters another part than the target's.
    pub needle_apart: bool,
    /// Why there is no model of this scene, although it can be looked at.
    #[serde(skip)]
    pub refused: Option<ModelError>,
    /// What is seldom meant.
    #[serde(skip)]
    pub warnings: Vec<SceneWarning>,
}

/// A patch of the surface.
#[derive(Debug, Clone, Serialize)]
pub struct PatchSurvey {
    /// Its area.
    pub area: f64,
    /// Its middle.
    pub middle: [f64; 3],
    /// Triangles of the mesh that it has.
    pub triangles: usize,
    /// Mean of its outer normals, no longer than 1.
    #[serde(skip)]
    pub normal: [f64; 3],
}

/// The needle.
#[derive(Debug, Clone, Serialize)]
pub struct NeedleSurvey {
    /// Its contact, in whose middle it enters.
    pub contact: PatchSurvey,
    /// Unit direction of insertion.
    pub axis: [f64; 3],
    /// How far it goes.
    pub depth: f64,
}

/// The target.
#[derive(Debug, Clone, Serialize)]
pub struct TargetSurvey {
    /// Where it is.
    pub position: [f64; 3],
    /// Its distance from the entry along the needle's line.
    pub along_needle: f64,
    /// Its distance from the needle's line.
    pub off_needle: f64,
    /// Its distance from the surface; about that of what a segmentation gives.
    pub from_boundary: f64,
}

/// An inclusion.
#[derive(Debug, Clone, Serialize)]
pub struct InclusionSurvey {
    /// From 1, in the order of the file.
    pub number: usize,
    /// Factor on the energy.
    pub stiffness: f64,
    /// Its volume in elements with straight edges, without what later inclusions take.
    pub volume: f64,
    /// The same of the inclusion itself, sampled to a few per cent; none of what is too thin to be sampled.
    pub sampled_volume: Option<f64>,
    /// The part of it that is outside of the body, 0 to 1, sampled; 0 of what reaches across the body, as layers do.
    pub outside: f64,
    /// Elements that it has.
    pub elements: usize,
}

/// A paddle position.
#[derive(Debug, Clone, Serialize)]
pub struct PaddleSurvey {
    /// Its index.
    pub index: u32,
    /// Where it is attached.
    pub patch: PatchSurvey,
}

/// A mesh.
#[derive(Debug, Clone, Serialize)]
pub struct MeshSurvey {
    /// Corners of tetrahedra.
    pub nodes: usize,
    /// Tetrahedra.
    pub tetrahedra: usize,
    /// Smallest and largest dihedral angle, degrees.
    pub dihedral: [f64; 2],
    /// Smallest and largest volume of a tetrahedron.
    pub volume: [f64; 2],
    /// The tetrahedra with the smallest angles, the worst first.
    pub worst: Vec<Element>,
    /// The longest way from a point of the body's surface to that of the mesh, of points a twentieth of the body apart.
    pub off_surface: f64,
}

/// Bounds of what a differing or cut solid leaves may be far off; those of a mesh lie a little inside of a curved body.
const LOOSE: f64 = 0.05;

/// Lowest and highest coordinates: the body's own bounds, where the mesh is about as large.
fn extent(scene: &SpaceScene, mesh: &TetMesh) -> (Point<3>, Point<3>) {
    let (low, high) = box_of(&mesh.nodes).unwrap_or_default();
    let Some(bounds) = scene.body.extent() else { return (low, high) };
    let near = LOOSE * (high - low).max();
    let nearer = |own: f64, found: f64| if (own - found).abs() <= near { own } else { found };
    (bounds.0.zip_map(&low, nearer), bounds.1.zip_map(&high, nearer))
}

impl Survey {
    /// Of a scene on one of its meshes.
    ///
    /// # Errors
    /// [`ModelError`] for patches without surface, and parts that nothing holds.
    pub fn of(scene: &SpaceScene, mesh: &TetMesh) -> Result<Self, ModelError> {
        let surface = Surface::new(mesh, scene.size());
        let patches = patches_of(scene, &surface)?;
        loose_part(scene, mesh, &patches)?;
        let measured: Vec<PatchSurvey> = patches.iter().map(|patch| PatchSurvey::of(mesh, patch)).collect();
        let volumes = mesh.volumes();
        let inclusions = scene.inclusions.iter().enumerate().map(|(i, inclusion)| {
            let own = || mesh.part.iter().zip(&volumes).filter(move |(part, _)| **part as usize == i + 1);
            let in_elements = own().map(|(_, volume)| volume).sum();
            InclusionSurvey {
                number: i + 1,
                stiffness: inclusion.stiffness,
                volume: in_elements,
                sampled_volume: sampled_volume(scene, i),
                outside: outside(scene, i),
                elements: own().count(),
            }
        });
        let (low, high) = extent(scene, mesh);
        let needle =
            NeedleSurvey { contact: measured[1].clone(), axis: scene.needle.axis.into(), depth: scene.needle.depth };
        let paddles = scene.paddles.iter().zip(&measured[2..]);
        let overlapping = overlapping(scene, &patches);
        let (parts, on_other) = on_other_parts(scene, mesh, &patches[1..]);
        let apart = scene.paddles.iter().zip(&on_other[1..]).filter(|(_, is_apart)| **is_apart);
        let mut survey = Self {
            low: low.into(),
            high: high.into(),
            volume: volumes.iter().sum(),
            surface: PatchSurvey::of(mesh, surface.triangles()).area,
            immobile: measured[0].clone(),
            target: TargetSurvey::of(scene, &Point::from(needle.contact.middle), mesh),
            needle,
            inclusions: inclusions.collect(),
            paddles: paddles.map(|(p, patch)| PaddleSurvey { index: p.index, patch: patch.clone() }).collect(),
            mesh: MeshSurvey::of(scene, mesh, &volumes),
            overlapping: overlapping.iter().map(|pair| pair.map(|p| scene.paddles[p].index)).collect(),
            parts,
            apart: apart.map(|(paddle, _)| paddle.index).collect(),
            needle_apart: on_other[0],
            refused: refused(scene, mesh, &patches),
            warnings: Vec::new(),
        };
        survey.warnings = survey.seldom_meant(scene);
        Ok(survey)
    }

    fn seldom_meant(&self, scene: &SpaceScene) -> Vec<SceneWarning> {
        let Self { needle, target, .. } = self;
        let (axis, size) = (scene.needle.axis, scene.size());
        let inwards = -axis.dot(&Point::from(needle.contact.normal).try_normalize(0.0).unwrap_or_default());
        let degrees = inwards.clamp(-1.0, 1.0).acos().to_degrees();
        let to_surface = (90.0 - degrees).abs();
        let mut found: Vec<SceneWarning> =
            another_unit(scene).map(|of_file| SceneWarning::BodyInOtherUnit { of_file }).into_iter().collect();
        if to_surface < ALONG {
            found.push(SceneWarning::NeedleAlongSurface { degrees: to_surface });
        } else if degrees > 90.0 {
            found.push(SceneWarning::NeedlePointsOut { degrees });
        } else {
            found.extend(warning::towards_target(needle.depth, target.along_needle, target.off_needle, size));
            let at = comes_out(scene.body.as_ref(), Point::from(needle.contact.middle), axis, size);
            let leaves = at.filter(|at| needle.depth > *at);
            found.extend(leaves.map(|at| SceneWarning::NeedleLeavesBody { depth: needle.depth, at }));
        }
        found
    }
}

/// The unit of length of the body's file, where the scene's is another one that is known.
fn another_unit(scene: &SpaceScene) -> Option<&'static str> {
    scene.unit_of_body.filter(|_| millimetres(&scene.length_unit).is_some())
}

/// Parts of the body, and which of some patches are not on the target's.
fn on_other_parts(scene: &SpaceScene, mesh: &TetMesh, patches: &[Vec<[u32; 3]>]) -> (usize, Vec<bool>) {
    let part = parts(mesh);
    let count = part.iter().max().map_or(0, |last| *last as usize + 1);
    if count <= 1 {
        return (count, vec![false; patches.len()]);
    }
    // The target is a corner of the mesh.
    let to_target = |t: usize| {
        let corners = mesh.tetrahedra[t].iter().map(|node| (mesh.nodes[*node as usize] - scene.target).norm());
        corners.fold(f64::INFINITY, f64::min)
    };
    let target = (0..part.len()).min_by(|a, b| to_target(*a).total_cmp(&to_target(*b))).map(|t| part[t]);
    let sorted = |mut triangle: [u32; 3]| {
        triangle.sort_unstable();
        triangle
    };
    let mut of: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for (&[a, b, c, d], part) in mesh.tetrahedra.iter().zip(&part) {
        of.extend([[a, b, c], [a, b, d], [a, c, d], [b, c, d]].map(|face| (sorted(face), *part)));
    }
    let is_apart = |patch: &Vec<[u32; 3]>| patch.iter().all(|face| of.get(&sorted(*face)).copied() != target);
    (count, patches.iter().map(is_apart).collect())
}

/// Why patches cannot move as they should: of elements with straight edges, whose corners any rule holds.
fn refused(scene: &SpaceScene, mesh: &TetMesh, patches: &[Vec<[u32; 3]>]) -> Option<ModelError> {
    let corners: Vec<Vec<u32>> = patches.iter().map(|patch| nodes_of(patch, &BTreeMap::new())).collect();
    let [immobile, needle, paddles @ ..] = &corners[..] else { return None };
    let (part, other, node) = touching(scene, [immobile, needle], paddles)?;
    Some(ModelError::PatchesTouch { part, other, at: mesh.nodes[node as usize].into() }.in_file(scene))
}

/// Depth at which a line that goes into a body comes out of it again, to a thousandth of its size.
fn comes_out(body: &dyn Implicit, entry: Point<3>, axis: Point<3>, size: f64) -> Option<f64> {
    let depth = |step: i32| size * f64::from(step) / f64::from(STEPS);
    let is_in = |step: &i32| body.level(&(entry + axis * depth(*step))) < 0.0;
    let first = (0..=STEPS).find(is_in)?;
    (first..=STEPS).find(|step| !is_in(step)).map(depth)
}

impl PatchSurvey {
    fn of(mesh: &TetMesh, triangles: &[[u32; 3]]) -> Self {
        let (mut area, mut middle, mut normal) = (0.0, Point::<3>::zeros(), Point::<3>::zeros());
        for triangle in triangles {
            let [a, b, c] = triangle.map(|node| mesh.nodes[node as usize]);
            let across = (b - a).cross(&(c - a)) * 0.5;
            area += across.norm();
            middle += (a + b + c) * (across.norm() / 3.0);
            normal += across;
        }
        Self { area, middle: (middle / area).into(), triangles: triangles.len(), normal: (normal / area).into() }
    }
}

impl TargetSurvey {
    fn of(scene: &SpaceScene, entry: &Point<3>, mesh: &TetMesh) -> Self {
        let way = scene.target - entry;
        let along = way.dot(&scene.needle.axis);
        Self {
            position: scene.target.into(),
            along_needle: along,
            off_needle: (way - scene.needle.axis * along).norm(),
            from_boundary: from_surface(scene, mesh),
        }
    }
}

/// Distance of the target from the surface. Levels of files are distances, those of solids are at their surfaces alone.
fn from_surface(scene: &SpaceScene, mesh: &TetMesh) -> f64 {
    let (body, target) = (scene.body.as_ref(), &scene.target);
    let level = -body.level(target);
    if body.is_measured() {
        return level;
    }
    let middles =
        mesh.boundary().into_iter().map(|t| t.iter().map(|n| mesh.nodes[*n as usize]).sum::<Point<3>>() / 3.0);
    let mut near: Vec<(f64, Point<3>)> = middles.map(|x| ((x - target).norm(), x)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found = distance_from(body, target, near.into_iter().take(STARTS).map(|(_, x)| x));
    if found.is_finite() { found } else { level }
}

impl MeshSurvey {
    fn of(scene: &SpaceScene, mesh: &TetMesh, volumes: &[f64]) -> Self {
        let quality = mesh.quality();
        Self {
            nodes: mesh.nodes.len(),
            tetrahedra: mesh.tetrahedra.len(),
            dihedral: [quality.min_dihedral, quality.max_dihedral],
            volume: [quality.min_volume, volumes.iter().copied().fold(0.0, f64::max)],
            worst: mesh.worst(NAMED),
            off_surface: BodySurface::new(scene, &|_| SAMPLED * scene.size()).farthest(mesh),
        }
    }
}
