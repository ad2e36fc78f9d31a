//! What pictures need of a body: at rest, and with needle and paddles somewhere.

use crate::geometry::{Point, box_of};
use crate::model::space::surfaces::Surfaces;
use crate::model::space::{SpaceBody, SpaceModel};
use crate::output::field_picture::Field;
use crate::output::state::NodalFields;
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// How far the needle's directions may be from orthogonal unit vectors.
const UNIT: f64 = 1e-6;
/// What can be drawn: lengths whose squares are numbers, displacements over the body's size, and letters of names.
const EXTENTS: std::ops::RangeInclusive<f64> = 1e-100..=1e100;
const FARTHEST: f64 = 1e3;
const LONGEST_NAME: usize = 200;

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
    /// Norm of the Green–Lagrange strain at every node; empty where it was not asked for, and in results of older versions.
    #[serde(default)]
    pub strain: Vec<f64>,
    /// Von Mises stress at every node, stress; the same.
    #[serde(default)]
    pub von_mises: Vec<f64>,
}

/// A body in a state as a picture of its own shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnBody {
    /// What it is: scene, tissue, paddles.
    pub name: String,
    /// The body at rest.
    pub geometry: SpaceGeometry,
    /// The body now.
    pub state: SpaceState,
    /// Whether paddles are a fixture, held still.
    pub held_still: bool,
}

impl DrawnBody {
    /// A state of a body, which is that of a tissue or a strategy (`of`).
    pub fn new(geometry: SpaceGeometry, state: SpaceState, of: &str, held_still: bool) -> Self {
        let paddles: Vec<String> = state.paddles.iter().map(u32::to_string).collect();
        let attached = match &paddles[..] {
            [] => "no paddle".to_owned(),
            [one] => format!("paddle {one}"),
            more => format!("paddles {}", more.join(" + ")),
        };
        Self { name: format!("{}, {of}, {attached}", geometry.name), geometry, state, held_still }
    }
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

    /// Why it cannot be drawn: what is read from a file may be anything.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self) -> Result<(), &'static str> {
        let nodes = self.nodes.len();
        let known = |node: &u32| (*node as usize) < nodes;
        let patches = self.paddles.iter().map(|paddle| &paddle.triangles).chain(&self.inclusions);
        let mut triangles = patches.chain([&self.outside, &self.immobile, &self.needle]).flatten().flatten();
        if self.tetrahedra.is_empty() || self.parts.len() != self.tetrahedra.len() {
            return Err("its tetrahedra are not all there");
        }
        if !self.tetrahedra.iter().flatten().all(known) || !triangles.all(known) {
            return Err("it names nodes that it does not have");
        }
        if self.parts.iter().any(|part| *part as usize > self.inclusions.len()) {
            return Err("it names inclusions that it does not have");
        }
        let indices: BTreeSet<u32> = self.paddles.iter().map(|paddle| paddle.index).collect();
        if indices.len() != self.paddles.len() {
            return Err("two of its paddles have one index");
        }
        let directions = Matrix3::from_columns(&[self.axis, self.orthogonal[0], self.orthogonal[1]].map(Vector3::from));
        if !(directions.transpose() * directions - Matrix3::identity()).iter().all(|off| off.abs() < UNIT) {
            return Err("its needle's directions are no unit vectors that are orthogonal to each other");
        }
        let extent = self.extent();
        if !(EXTENTS.contains(&extent) && self.nodes.iter().flatten().all(|part| part.abs() < *EXTENTS.end())) {
            return Err("its nodes span no body");
        }
        let words = [&self.name, &self.units[0], &self.units[1]];
        if words.iter().any(|word| word.chars().count() > LONGEST_NAME) {
            return Err("its name, or the label of a unit, is no name");
        }
        Ok(())
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
            strain: Vec::new(),
            von_mises: Vec::new(),
        }
    }

    /// Of a body whose attached paddles have these indices.
    pub fn new(body: &SpaceBody<'_>, paddles: &[u32]) -> Self {
        let model = body.model();
        let fields = NodalFields::in_space(model, body.equilibrium().coefficients());
        let corners = model.spatial().tetrahedra().iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let moved = model.nodal_displacements(body.equilibrium().coefficients());
        Self {
            depth: body.depth(),
            paddles: paddles.to_vec(),
            paddle_displacements: body.paddles().iter().map(|u| (*u).into()).collect(),
            displacements: moved[..corners].iter().map(|u| (*u).into()).collect(),
            target: body.target_displacement().into(),
            strain: fields.strain,
            von_mises: fields.von_mises.unwrap_or_default(),
        }
    }

    /// Why it is none of this body, or cannot be drawn: what is read from a file may be anything.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, geometry: &SpaceGeometry) -> Result<(), &'static str> {
        let nodes = geometry.nodes.len();
        let fits = |values: &[f64]| values.is_empty() || values.len() == nodes;
        if self.displacements.len() != nodes || !fits(&self.strain) || !fits(&self.von_mises) {
            return Err("not every one of its nodes has a place and a value");
        }
        let attached: BTreeSet<u32> = self.paddles.iter().copied().collect();
        let known = |index: &u32| geometry.paddles.iter().any(|paddle| paddle.index == *index);
        if attached.len() != self.paddles.len() || !attached.iter().all(known) {
            return Err("a paddle of its is none of its scene, or is there twice");
        }
        if self.paddle_displacements.len() != self.paddles.len() {
            return Err("not every paddle has a place");
        }
        let farthest = FARTHEST * geometry.extent();
        let moved = self.displacements.iter().chain(&self.paddle_displacements).chain([&self.target]).flatten();
        if !moved.chain([&self.depth]).all(|part| part.abs() <= farthest) {
            return Err("it has moved farther than any body does");
        }
        if !self.strain.iter().chain(&self.von_mises).all(|value| *value == 0.0 || EXTENTS.contains(value)) {
            return Err("its strain and stress are no numbers from 0 on");
        }
        Ok(())
    }

    /// Nodes where they are now.
    pub(super) fn moved(&self, geometry: &SpaceGeometry) -> Vec<Point<3>> {
        let both = geometry.nodes.iter().zip(&self.displacements);
        both.map(|(x, u)| Point::from(*x) + Point::from(*u)).collect()
    }
}

impl Field {
    /// Values at the nodes of a body in space; none where the state does not have them.
    pub fn values_in_space(self, geometry: &SpaceGeometry, state: &SpaceState) -> Option<Vec<f64>> {
        let displacements = state.displacements.iter().map(|u| Point::from(*u));
        let axis = Point::from(geometry.axis);
        let there = |values: &[f64]| (!values.is_empty()).then(|| values.to_vec());
        match self {
            Self::Size => Some(displacements.map(|u| u.norm()).collect()),
            Self::Orthogonal => Some(displacements.map(|u| (u - axis * axis.dot(&u)).norm()).collect()),
            Self::Strain => there(&state.strain),
            Self::VonMises => there(&state.von_mises),
        }
    }
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
