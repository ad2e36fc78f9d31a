//! Scenes from files of other tools: an SVG drawing, a Gmsh mesh.
//!
//! Shapes whose names say so are the body, inclusions, the needle, the target, paddles and what is fixed. Without names
//! the largest closed shape becomes the body and the others inside it become inclusions. A summary says what was taken,
//! what was left out, and why.

mod along;
mod assemble;
mod flatten;
pub mod gmsh;
mod parts;
mod role;
mod shape;
mod summary;
pub mod svg;

pub(super) use flatten::straight_under;
pub use role::Role;
pub use summary::{LeftOut, Summary, Taken};

use crate::geometry::{Point2, Polygon};
use crate::material::Preset;

/// What a file is read for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImportOptions<'a> {
    /// The longer side of the body in the scene's unit of length; as in the file when absent.
    pub size: Option<f64>,
    /// Label of the scene's unit of length: drawings to scale are converted to it.
    pub length: &'a str,
    /// Label of the scene's unit of stress: materials by name need one that is known.
    pub stress: &'a str,
}

impl Default for ImportOptions<'_> {
    fn default() -> Self {
        Self { size: None, length: "mm", stress: "kPa" }
    }
}

/// A scene's parts as a drawing or a mesh gives them.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The body.
    pub outline: Polygon,
    /// What it is made of, where a name says so.
    pub material: Option<Preset>,
    /// Regions inside it.
    pub inclusions: Vec<ImportedInclusion>,
    /// What holds it: polylines on the outline. None where the file gives none.
    pub immobile: Vec<Vec<Point2>>,
    /// The needle.
    pub needle: Option<ImportedNeedle>,
    /// The point to hold still.
    pub target: Option<Point2>,
    /// How deep the needle goes.
    pub depth: Option<f64>,
    /// Places of the paddle, with their numbers. None where the file gives none.
    pub paddles: Vec<(u32, [Point2; 2])>,
    /// What became of everything in the file.
    pub summary: Summary,
}

impl Imported {
    /// A body and regions in it, and nothing else.
    pub fn of(outline: Polygon, inclusions: Vec<Polygon>) -> Self {
        let inclusions = inclusions.into_iter().map(|outline| ImportedInclusion { outline, material: None });
        Self {
            outline,
            material: None,
            inclusions: inclusions.collect(),
            immobile: Vec::new(),
            needle: None,
            target: None,
            depth: None,
            paddles: Vec::new(),
            summary: Summary::default(),
        }
    }
}

/// A region inside the body.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedInclusion {
    /// The region.
    pub outline: Polygon,
    /// What it is made of, where a name says so.
    pub material: Option<Preset>,
}

/// A needle on an outline.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedNeedle {
    /// The part of the boundary that moves with it.
    pub contact: Vec<Point2>,
    /// Unit direction of insertion.
    pub axis: Point2,
    /// How deep it can go at most: to its drawn tip, and within the body.
    pub most: f64,
}

impl ImportedNeedle {
    /// Straight into the middle of the upper side of a block that has a corner at the origin.
    pub fn into_block(width: f64, height: f64) -> Self {
        let contact = [0.65, 0.35].map(|share| Point2::new(share * width, height)).to_vec();
        Self { contact, axis: -Point2::y(), most: height }
    }
}

/// Where something is wrong, if it is on a line.
fn at_line(line: usize) -> String {
    if line == 0 { String::new() } else { format!("line {line}: ") }
}

/// Why a file gives no scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The file is not what its name says.
    #[error("{}{what}", at_line(*line))]
    Syntax {
        /// Line, from 1; 0 where what is wrong is on none of them.
        line: usize,
        /// What is wrong there.
        what: String,
    },
    /// A binary file is cut off, or is none.
    #[error("byte {at}: {what}")]
    Binary {
        /// Which byte, from 0.
        at: usize,
        /// What is wrong there.
        what: String,
    },
    /// A kind of file that is not read.
    #[error("{0}")]
    Unsupported(String),
    /// Nothing in it encloses an area.
    #[error("no closed outline is in it: {0}")]
    NoOutline(String),
    /// Its shapes make no valid scene.
    #[error("{role}: {what}")]
    NoScene {
        /// Whose shape it is.
        role: Role,
        /// What is wrong.
        what: String,
        /// What to do.
        help: String,
    },
}
