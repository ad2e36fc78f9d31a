//! What pictures need of a body: at rest, and with needle and paddles somewhere.

use crate::geometry::{Point, box_of};
use crate::model::space::surfaces::Surfaces;
use crate::model::space::{SpaceBody, SpaceModel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A body at rest, as pictures need it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceGeometry {
    /// Name of the scene.
    pub name: String,
    /// Labels of length and stress.
    pub units: [String; 2],
    /// Nodes at the corners of tetrahedra, length.
    pub nodes: Vec<[f64; 3]>,
    /// Tetrahedra as numbers of nodes.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Per tetrahedron: 0 in the body, 1 + i in inclusion i.
    pub parts: Vec<u32>,
    /// Triangles of the outside, outwards.
    pub outside: Vec<[u32; 3]>,
    /// What of it cannot move.
    pub immobile: Vec<[u32; 3]>,
    /// What of it moves with the needle.
    pub needle: Vec<[u32; 3]>,
    /// What of it moves with each paddle.
    pub paddles: Vec<PaddlePatch>,
    /// The surface of each inclusion, outwards.
    pub inclusions: Vec<Vec<[u32; 3]>>,
    /// Unit direction of insertion.
    pub axis: [f64; 3],
    /// Two unit directions orthogonal to it and to each other.
    pub orthogonal: [[f64; 3]; 2],
    /// Target at rest, length.
    pub target: [f64; 3],
}

/// Where a paddle may be attached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PaddlePatch {
    /// Its index in the scene.
    pub index: u32,
    /// Its triangles.
    pub triangles: Vec<[u32; 3]>,
}

/// A body with needle and paddles somewhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceState {
    /// Needle depth, length.
    pub depth: f64,
    /// Indices of the attached paddles.
    pub paddles: Vec<u32>,
    /// Their displacements, length.
    pub paddle_displacements: Vec<[f64; 3]>,
    /// Displacement of every node, length.
    pub displacements: Vec<[f64; 3]>,
    /// Displacement of the target, length.
    pub target: [f64; 3],
}

impl SpaceGeometry {
    /// That of a model.
    pub fn new(model: &SpaceModel) -> Self {
        let (scene, spatial, surfaces) = (model.scene(), model.spatial(), Surfaces::new(model));
        let tetrahedra = spatial.tetrahedra().to_vec();
        let orthogonal = scene.needle.orthogonal();
        // Middle nodes of quadratic elements stand behind the corners.
        let corners = tetrahedra.iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let paddles = scene.paddles.iter().zip(surfaces.paddles);
        Self {
            name: scene.name.clone(),
            units: [scene.length_unit.clone(), scene.stress_unit.clone()],
            nodes: spatial.positions()[..corners].iter().map(|x| (*x).into()).collect(),
            tetrahedra,
            parts: surfaces.parts,
            outside: surfaces.outside,
            immobile: surfaces.immobile,
            needle: surfaces.needle,
            paddles: paddles.map(|(paddle, triangles)| PaddlePatch { index: paddle.index, triangles }).collect(),
            inclusions: surfaces.inclusions,
            axis: scene.needle.axis.into(),
            orthogonal: [0, 1].map(|k| orthogonal.column(k).into_owned().into()),
            target: scene.target.into(),
        }
    }

    /// The same in homogeneous tissue.
    #[must_use]
    pub fn without_inclusions(&self) -> Self {
        Self { inclusions: Vec::new(), parts: vec![0; self.parts.len()], ..self.clone() }
    }

    /// The middle of a patch at rest, by its area.
    pub fn middle(&self, triangles: &[[u32; 3]]) -> Point<3> {
        let (mut area, mut moment) = (0.0, Point::zeros());
        for triangle in triangles {
            let [a, b, c] = triangle.map(|node| Point::from(self.nodes[node as usize]));
            let twice = (b - a).cross(&(c - a)).norm();
            area += twice;
            moment += (a + b + c) * (twice / 3.0);
        }
        if area > 0.0 { moment / area } else { moment }
    }

    /// Length of the diagonal of the body's bounding box.
    pub fn extent(&self) -> f64 {
        let nodes: Vec<Point<3>> = self.nodes.iter().map(|x| Point::from(*x)).collect();
        let size = box_of(&nodes).map_or(0.0, |(low, high)| (high - low).norm());
        if size.is_finite() { size } else { 0.0 }
    }
}

impl SpaceState {
    /// Before the needle goes in, with all paddles.
    pub fn at_rest(geometry: &SpaceGeometry) -> Self {
        let paddles: Vec<u32> = geometry.paddles.iter().map(|patch| patch.index).collect();
        Self {
            depth: 0.0,
            paddle_displacements: vec![[0.0; 3]; paddles.len()],
            paddles,
            displacements: vec![[0.0; 3]; geometry.nodes.len()],
            target: [0.0; 3],
        }
    }

    /// Of a body whose attached paddles have these indices.
    pub fn new(body: &SpaceBody<'_>, paddles: &[u32]) -> Self {
        let model = body.model();
        let corners = model.spatial().tetrahedra().iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let moved = model.nodal_displacements(body.equilibrium().coefficients());
        Self {
            depth: body.depth(),
            paddles: paddles.to_vec(),
            paddle_displacements: body.paddles().iter().map(|u| (*u).into()).collect(),
            displacements: moved[..corners].iter().map(|u| (*u).into()).collect(),
            target: body.target_displacement().into(),
        }
    }

    /// Nodes where they are now.
    pub(super) fn moved(&self, geometry: &SpaceGeometry) -> Vec<Point<3>> {
        let both = geometry.nodes.iter().zip(&self.displacements);
        both.map(|(x, u)| Point::from(*x) + Point::from(*u)).collect()
    }
}

/// Displacement orthogonal to the needle, its size, at every node, length.
pub fn orthogonal(geometry: &SpaceGeometry, state: &SpaceState) -> Vec<f64> {
    let axis = Point::from(geometry.axis);
    let all = state.displacements.iter().map(|u| Point::from(*u));
    all.map(|u| (u - axis * axis.dot(&u)).norm()).collect()
}

/// What colours say.
#[derive(Debug, Clone, Copy)]
pub enum Colours<'a> {
    /// A field: its values at the nodes, and the value at which the colours end.
    Field {
        /// One value per node.
        values: &'a [f64],
        /// Where the colours end.
        scale: f64,
    },
    /// What is body and what is inclusion: nothing has moved yet.
    Parts,
}

/// What a picture shows of a state.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// The body at rest.
    pub geometry: &'a SpaceGeometry,
    /// The body now.
    pub state: &'a SpaceState,
    /// What its colours say.
    pub colours: Colours<'a>,
    /// How deep the needle is to go from where it is, length; nothing where that is not shown.
    pub way: Option<f64>,
    /// Whether paddles are a fixture, held still.
    pub held_still: bool,
}

impl Shown<'_> {
    /// Class of paddles.
    pub(super) fn paddle(&self) -> &'static str {
        if self.held_still { "paddle" } else { "paddle best" }
    }

    /// Whether nothing has moved yet.
    pub(super) fn is_at_rest(&self) -> bool {
        matches!(self.colours, Colours::Parts)
    }

    /// A value at every node: the field's, over that where colours end.
    pub(super) fn parts_of_scale(&self) -> Vec<f64> {
        match self.colours {
            Colours::Field { values, scale } if scale > 0.0 => values.iter().map(|value| value / scale).collect(),
            _ => vec![0.0; self.geometry.nodes.len()],
        }
    }
}
