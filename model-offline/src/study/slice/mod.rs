//! The planar scene that a plane through needle and target cuts of a scene in space: what plane strain makes of it.
//!
//! The plane holds the needle's direction and the target. Where the target is beside the needle's line that is one
//! plane. Where it is on it, as it usually is, the plane is free to turn about the line, and is laid through a paddle:
//! the one that is asked for, else the one whose plane meets the most paddles (where several meet as many, the most of
//! their width). The surface of a mesh is cut, whose edges follow the body's sharp edges; what is curved is then moved
//! onto the surface itself. Patches are what of the cut's boundary lies in their regions: of a paddle the chord of
//! that, since planar paddles are straight. Inclusions are cut likewise. Paddles that the plane misses are left out by
//! name.

mod boundary;
mod file;
mod outline;
mod plane;

pub use plane::Through;

use self::boundary::{Boundary, Meeting, Run};
use self::outline::{Nested, in_plane, loops, nested, onto_surface};
use self::plane::Planes;
use crate::discretization::TetMesh;
use crate::discretization::meshing::rim_points;
use crate::geometry::{Implicit, Point, Point2, bounds, signed_area, simplified_loop};
use crate::model::ModelError;
use crate::model::space::meshing::{MeshSize, mesh};
use crate::model::space::survey::Survey;
use crate::output::space_picture::CutPlane;
use crate::scene::space::SpaceScene;
use crate::scene::{NoSuchPaddle, Scene, SceneError};
use serde::Serialize;
use std::fmt;

/// Refinement levels of meshes to cut: the first that sees every patch.
const LEVELS: std::ops::RangeInclusive<i32> = 0..=3;
/// A plane meets a paddle if this part of the paddle's extent across it lies on either side.
const ON_BOTH_SIDES: f64 = 0.02;
/// Rims are looked at in steps of this part of the body's size.
const RIM: f64 = 5e-3;
/// Inclusions whose cut is smaller than this part of the body's size squared are not cut.
const SMALLEST: f64 = 1e-6;
/// Points along each side of a grid on which gaps are looked for, and how far outside of the body they are, over its
/// size.
const GRID: i32 = 60;
const GAP: f64 = 0.01;
/// Details of inclusions below this part of the body's size are left out.
const DETAIL: f64 = 1e-3;

/// A planar scene, and where in the body it lies.
#[derive(Debug, Clone)]
pub struct Slice {
    /// The scene.
    pub scene: Scene,
    /// Its text, which is a scene file.
    pub text: String,
    /// The plane: its coordinates are those of the planar scene, length units.
    pub plane: CutPlane,
    /// What fixes it.
    pub through: Through,
    /// Paddles that the slice does not have, in the scene's order.
    pub left_out: Vec<LeftOut>,
    /// Pieces of the body beside the one with the target, which the slice does not have.
    pub pieces_left_out: usize,
    /// Inclusions that the plane does not meet, counted from 1 in the scene's order.
    pub inclusions_left_out: Vec<usize>,
}

/// A paddle that a slice does not have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// Its index.
    pub index: u32,
    /// Why.
    pub reason: LeftOutReason,
}

/// Why a slice does not have a paddle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LeftOutReason {
    /// The plane does not meet it, or its rim alone.
    Missed,
    /// What the plane cuts of it is in several pieces.
    InPieces,
    /// What the plane cuts of it turns a corner, and planar paddles are straight.
    Bent,
    /// What the plane cuts of it meets the needle's contact, the immobile part or, where the boundary is curved,
    /// another paddle.
    Meets,
}

impl fmt::Display for LeftOutReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missed => "the plane misses it",
            Self::InPieces => "the plane cuts it into pieces",
            Self::Bent => "what the plane cuts of it turns a corner",
            Self::Meets => "what the plane cuts of it meets another part",
        })
    }
}

/// Why there is no slice.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SliceError {
    /// The body cannot be meshed.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// No such paddle in the scene.
    #[error(transparent)]
    NoSuchPaddle(#[from] NoSuchPaddle),
    /// The plane is given by needle and target.
    #[error(
        "the target is {} beside the needle's line: the plane through both is the only one; leave the paddle out",
        crate::number::in_unit(*off, unit)
    )]
    NotFree {
        /// How far, length units.
        off: f64,
        /// The scene's unit of length.
        unit: String,
    },
    /// A paddle gives no direction.
    #[error("paddle {paddle} is on the needle's line, as the target is: lay the plane through another one")]
    OnLine {
        /// Its index.
        paddle: u32,
    },
    /// No paddle gives a plane, or none of those makes a slice.
    #[error(
        "no plane through needle and target has a paddle in it: move a paddle into such a plane, or stay with the body"
    )]
    NoPaddle,
    /// The plane meets paddles, and none of them can be a planar one.
    #[error(
        "the slice ({plane}) has no paddle ({}): lay the plane through a paddle that it cuts in one straight piece, or stay with \
         the body",
        told(left_out)
    )]
    NothingLeft {
        /// The plane.
        plane: String,
        /// All paddles, and why each is left out.
        left_out: Vec<LeftOut>,
    },
    /// The target's piece of the cut has holes.
    #[error(
        "the slice ({plane}) has {holes} holes or clefts, and planar bodies have none: lay the plane through another paddle, or \
         stay with the body"
    )]
    Holes {
        /// The plane.
        plane: String,
        /// How many.
        holes: usize,
    },
    /// The plane does not meet what the slice has to have.
    #[error(
        "the slice ({plane}) does not meet the {what}: lay the plane through another paddle, or stay with the body"
    )]
    Misses {
        /// The plane.
        plane: String,
        /// What it misses.
        what: &'static str,
    },
    /// What was cut is no valid planar scene.
    #[error("the slice ({plane}) is no planar scene: {source}")]
    Invalid {
        /// The plane.
        plane: String,
        /// Why.
        source: Box<SceneError>,
    },
    /// The text of the scene in space cannot be read again.
    #[error("the scene changed meanwhile: {0}")]
    Text(String),
}

fn told(left_out: &[LeftOut]) -> String {
    left_out.iter().map(|left| format!("{}: {}", left.index, left.reason)).collect::<Vec<_>>().join("; ")
}

/// What a plane cuts, in its coordinates.
struct Cut {
    plane: CutPlane,
    outline: Vec<Point2>,
    /// By their places in the scene's list.
    inclusions: Vec<(usize, Vec<Point2>)>,
    immobile: Vec<Vec<Point2>>,
    contact: Vec<Point2>,
    target: Point2,
    paddles: Vec<(u32, [Point2; 2])>,
    left_out: Vec<LeftOut>,
    pieces_left_out: usize,
}

impl Slice {
    /// The slice of a scene in space whose text is `text`, through a paddle where one is asked for.
    ///
    /// # Errors
    /// [`SliceError`] says why there is none, and what to do.
    ///
    /// # Example
    /// ```
    /// use model_offline::Scene;
    /// use model_offline::scene::space::SpaceScene;
    /// use model_offline::study::slice::Slice;
    ///
    /// let (body, text) = (SpaceScene::bundled("block").expect("bundled"), Scene::text("block".as_ref())?);
    /// let slice = Slice::of(&body, &text, None)?; // the plane y = 0.5, with paddles 3 and 4
    /// assert_eq!(slice.scene.paddles.iter().map(|p| p.index).collect::<Vec<_>>(), [3, 4]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(scene: &SpaceScene, text: &str, paddle: Option<u32>) -> Result<Self, SliceError> {
        let mesh = mesh_of(scene)?;
        let survey = Survey::of(scene, &mesh)?;
        let planes = Planes::new(scene, &survey);
        let candidates = match paddle {
            Some(paddle) => vec![planes.of_paddle(paddle)?],
            None => planes.all(),
        };
        let body = Body { scene, mesh: &mesh, triangles: mesh.boundary() };
        let (mut best, mut failed): (Option<(Self, f64)>, _) = (None, None);
        for (through, plane) in candidates {
            match body.slice(text, through, plane) {
                Ok(slice) => {
                    let wide = slice.scene.paddles.iter().map(|p| (p.segment[1] - p.segment[0]).norm()).sum::<f64>();
                    let rank = (slice.scene.paddles.len(), wide);
                    // A hair more is rounding: the first of those that are alike.
                    let is_better = best.as_ref().is_none_or(|(best, width)| {
                        let count = best.scene.paddles.len();
                        rank.0 > count || rank.0 == count && rank.1 > width * (1.0 + 1e-6)
                    });
                    if is_better {
                        best = Some((slice, wide));
                    }
                }
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        best.map(|(slice, _)| slice).ok_or_else(|| failed.unwrap_or(SliceError::NoPaddle))
    }
}

fn mesh_of(scene: &SpaceScene) -> Result<TetMesh, ModelError> {
    let mut outcome = Err(ModelError::NoPaddleControls);
    for level in LEVELS {
        outcome = mesh(scene, &MeshSize::level(level));
        if outcome.as_ref().is_ok_and(|mesh| Survey::of(scene, mesh).is_ok()) {
            break;
        }
    }
    outcome
}

/// A body to cut.
struct Body<'a> {
    scene: &'a SpaceScene,
    mesh: &'a TetMesh,
    triangles: Vec<[u32; 3]>,
}

impl Body<'_> {
    fn slice(&self, text: &str, through: Through, plane: CutPlane) -> Result<Slice, SliceError> {
        let cut = self.cut(plane)?;
        let text = file::text(self.scene, text, &cut)?;
        let met = |place: usize| cut.inclusions.iter().any(|(other, _)| *other == place);
        let missed = (0..self.scene.inclusions.len()).filter(|place| !met(*place));
        let inclusions_left_out = missed.map(|place| place + 1).collect();
        let Cut { plane, left_out, pieces_left_out, .. } = cut;
        match Scene::parse(&text, "<slice>") {
            Ok(scene) => Ok(Slice { scene, text, plane, through, left_out, pieces_left_out, inclusions_left_out }),
            Err(error) => Err(SliceError::Invalid { plane: self.name(&plane), source: Box::new(error) }),
        }
    }

    fn name(&self, plane: &CutPlane) -> String {
        plane.name(&self.scene.length_unit).replace('\u{a0}', " ")
    }

    fn cut(&self, plane: CutPlane) -> Result<Cut, SliceError> {
        let (scene, size) = (self.scene, self.scene.size());
        let misses = |what| SliceError::Misses { plane: self.name(&plane), what };
        let found = nested(loops(&self.mesh.nodes, &self.triangles, &plane, size), &plane, &scene.target);
        let Nested { outline, holes, others } = found.ok_or_else(|| misses("target"))?;
        let outline = onto_surface(&outline, &|x| scene.body.level(x), &plane, size);
        // What the mesh is too coarse to see is seen by the body.
        let unseen = usize::from(has_gap(&in_plane(&outline, &plane), scene.body.as_ref(), &plane, size));
        if holes.max(unseen) > 0 {
            return Err(SliceError::Holes { plane: self.name(&plane), holes: holes.max(unseen) });
        }
        let boundary = Boundary::new(outline, &plane, size);
        let regions: Vec<&dyn Implicit> = scene.immobile.iter().map(|region| region as _).collect();
        let immobile = boundary.runs(&regions);
        if immobile.is_empty() {
            return Err(misses("immobile part"));
        }
        let contact = boundary.runs(&[&scene.needle.region]);
        // Where the needle's contact is cut into pieces, its largest.
        let contact = contact.into_iter().max_by(|a, b| a.length().total_cmp(&b.length()));
        let contact = contact.ok_or_else(|| misses("needle's contact"))?;
        let held: Vec<Run> = immobile.iter().copied().chain([contact]).collect();
        let (paddles, left_out) = self.paddles(&plane, &boundary, &held);
        if paddles.is_empty() {
            return Err(SliceError::NothingLeft { plane: self.name(&plane), left_out });
        }
        let straightened: Vec<Run> = paddles.iter().map(|(_, run)| *run).collect();
        let polygon = boundary.polygon(&held, &straightened);
        let path = |run: &Run| polygon.path(boundary.ends(run));
        let ends = |run: &Run| {
            let path = path(run);
            [path[0], path[path.len() - 1]]
        };
        Ok(Cut {
            inclusions: self.inclusions(&plane),
            immobile: immobile.iter().map(path).collect(),
            contact: path(&contact),
            target: Point2::from(plane.coordinates(&scene.target)),
            paddles: paddles.iter().map(|(index, run)| (*index, ends(run))).collect(),
            left_out,
            pieces_left_out: others,
            outline: polygon.vertices,
            plane,
        })
    }

    /// Paddles that can be planar ones, by index, and the others.
    fn paddles(&self, plane: &CutPlane, boundary: &Boundary<'_>, held: &[Run]) -> (Vec<(u32, Run)>, Vec<LeftOut>) {
        let (mut kept, mut left_out): (Vec<(u32, Run)>, Vec<LeftOut>) = (Vec::new(), Vec::new());
        for paddle in &self.scene.paddles {
            let judged = match boundary.runs(&[&paddle.region])[..] {
                _ if !self.meets(plane, &paddle.region) => Err(LeftOutReason::Missed),
                [] => Err(LeftOutReason::Missed),
                [run] if !boundary.is_nearly_straight(&run) => Err(LeftOutReason::Bent),
                [run] => {
                    let held = held.iter().any(|other| boundary.meet(&run, other) != Meeting::Apart);
                    // On a straight piece of boundary paddles may overlap: their ends stay on it.
                    let overlaps = |other: &Run| {
                        boundary.meet(&run, other) == Meeting::Overlap
                            && !(boundary.is_straight(&run) && boundary.is_straight(other))
                    };
                    match held || kept.iter().any(|(_, other)| overlaps(other)) {
                        true => Err(LeftOutReason::Meets),
                        false => Ok(run),
                    }
                }
                _ => Err(LeftOutReason::InPieces),
            };
            match judged {
                Ok(run) => kept.push((paddle.index, run)),
                Err(reason) => left_out.push(LeftOut { index: paddle.index, reason }),
            }
        }
        (kept, left_out)
    }

    /// Whether a plane goes through a patch, and not just along its rim.
    fn meets(&self, plane: &CutPlane, region: &dyn Implicit) -> bool {
        let rim = rim_points(self.scene.body.as_ref(), region, RIM * self.scene.size());
        let distances = rim.iter().map(|x| plane.distance(x));
        let (low, high) = distances.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| (l.min(d), h.max(d)));
        let least = ON_BOTH_SIDES * (high - low);
        low < -least && high > least
    }

    /// What the plane cuts of every inclusion, without what later ones take.
    fn inclusions(&self, plane: &CutPlane) -> Vec<(usize, Vec<Point2>)> {
        let (scene, size) = (self.scene, self.scene.size());
        let mut all = Vec::new();
        for (place, inclusion) in scene.inclusions.iter().enumerate() {
            let part = place as u32 + 1;
            let own = (0..self.mesh.tetrahedra.len()).filter(|t| self.mesh.part[*t] == part);
            let tetrahedra: Vec<[u32; 4]> = own.map(|t| self.mesh.tetrahedra[t]).collect();
            let own = TetMesh { nodes: self.mesh.nodes.clone(), part: vec![part; tetrahedra.len()], tetrahedra };
            let later = &scene.inclusions[place + 1..];
            let level = |x: &Point<3>| {
                let inside = scene.body.level(x).max(inclusion.region.level(x));
                later.iter().fold(inside, |level, later| level.max(-later.region.level(x)))
            };
            let cut = loops(&own.nodes, &own.boundary(), plane, size);
            let largest =
                cut.iter().map(|cut| signed_area(&in_plane(cut, plane))).max_by(|a, b| a.abs().total_cmp(&b.abs()));
            for cut in cut {
                let flat = simplified_loop(&in_plane(&onto_surface(&cut, &level, plane, size), plane), DETAIL * size);
                // Holes in one inclusion are others, which come later in the list.
                let is_outer = signed_area(&flat) * largest.unwrap_or(0.0) > 0.0;
                if is_outer && signed_area(&flat).abs() > SMALLEST * size * size {
                    all.push((place, flat));
                }
            }
        }
        all
    }
}

/// Whether a loop holds points that lie outside of the body, clearly.
fn has_gap(outline: &[Point2], body: &dyn Implicit, plane: &CutPlane, size: f64) -> bool {
    let (low, high) = bounds(outline);
    let steps = || (0..GRID).map(|i| (f64::from(i) + 0.5) / f64::from(GRID));
    let origin = plane.normal * plane.offset;
    let mut all = steps().flat_map(|u| steps().map(move |v| low + (high - low).component_mul(&Point2::new(u, v))));
    all.any(|at| {
        let x = origin + plane.directions[0] * at.x + plane.directions[1] * at.y;
        body.level(&x) > GAP * size && outline::holds(outline, at)
    })
}
