//! The undeformed scene as results keep it, so that they can be drawn without the scene's file.

use crate::geometry::Point2;
use crate::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The undeformed scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Geometry {
    /// The body's outline.
    pub outline: Vec<[f64; 2]>,
    /// Immobile parts of the boundary.
    pub immobile: Vec<Vec<[f64; 2]>>,
    /// Tissue that moves with the needle.
    pub needle_contact: Vec<[f64; 2]>,
    /// Unit direction of insertion.
    pub needle_axis: [f64; 2],
    /// Unit direction orthogonal to it.
    pub orthogonal: [f64; 2],
    /// Target at rest.
    pub target: [f64; 2],
    /// Paddle positions.
    pub paddles: Vec<PaddleGeometry>,
    /// Inclusions of the tissue `inclusion`.
    pub inclusions: Vec<Vec<[f64; 2]>>,
    /// Nodes at rest.
    pub nodes: Vec<[f64; 2]>,
}

/// A paddle position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PaddleGeometry {
    /// Its index in the scene.
    pub index: u32,
    /// Its two ends.
    pub segment: [[f64; 2]; 2],
}

impl Geometry {
    /// Of a scene with these nodes.
    pub fn new(scene: &Scene, nodes: &[Point2]) -> Self {
        let path = |points: &[Point2]| -> Vec<[f64; 2]> { points.iter().map(|p| [p.x, p.y]).collect() };
        Self {
            outline: path(scene.outline.vertices()),
            immobile: scene.immobile.iter().map(|part| path(part)).collect(),
            needle_contact: path(&scene.needle.contact),
            needle_axis: scene.needle.axis.into(),
            orthogonal: scene.needle.orthogonal().into(),
            target: scene.target.into(),
            paddles: scene
                .paddles
                .iter()
                .map(|paddle| PaddleGeometry { index: paddle.index, segment: paddle.segment.map(|p| [p.x, p.y]) })
                .collect(),
            inclusions: scene.inclusions.iter().map(|inclusion| path(inclusion.outline.vertices())).collect(),
            nodes: path(nodes),
        }
    }
}
