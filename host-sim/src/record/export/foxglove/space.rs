//! A body in space to be seen: its deformed surface, inclusions, needle, paddles and target.

use std::collections::BTreeSet;

use model_offline::geometry::{Point, box_of};
use model_offline::number::in_unit;
use model_offline::output::chart::style::band_colour;
use model_offline::output::field_picture::Field;
use model_offline::output::space_picture::{SpaceGeometry, SpaceState, seen_from};
use serde_json::Value;

use super::layout::{Camera, layout};
use super::scenery::{Scenery, Tools};
use super::{
    BLACK, BLUE, Color, GREY, KeyValuePair, ORANGE, Pose, PoseInFrame, SceneEntity, SceneUpdate, TriangleListPrimitive,
};
use crate::world::retrace::SolvedBody;
use crate::world::truth::Truth;

/// How far paddles are drawn off the surface, part of the body's longest side: what is drawn in one place flickers.
const OFF: f64 = 0.004;
/// Distance of the camera, over the body's diagonal: half of it is in sight on either side, and some room.
const AWAY: f64 = 1.5;
/// What is inside can be seen.
const SKIN: f64 = 0.5;
const HELD: f64 = 0.7;
const INSIDE: f64 = 0.35;

/// A body in space with the paddles that a table moves.
#[derive(Clone, Debug)]
pub struct SpaceStage<'b> {
    geometry: SpaceGeometry,
    /// Indices of the paddles, in the order of the table.
    paddles: Vec<u32>,
    bodies: &'b [SolvedBody],
    /// Values at its nodes for each of them: displacement orthogonal to the needle, length.
    values: Vec<Vec<f64>>,
    /// The largest of all.
    scale: f64,
}

/// Displacement orthogonal to the needle, its size, at every node, length.
fn orthogonal(geometry: &SpaceGeometry, state: &SpaceState) -> Vec<f64> {
    Field::Orthogonal.values_in_space(geometry, state).unwrap_or_default()
}

impl<'b> SpaceStage<'b> {
    /// Of a body at rest and at some ticks of a recording, with these paddles of the scene.
    pub fn new(geometry: SpaceGeometry, paddles: &[u32], bodies: &'b [SolvedBody]) -> Self {
        let values: Vec<Vec<f64>> = bodies.iter().map(|body| orthogonal(&geometry, &body.state)).collect();
        let scale = values.iter().flatten().copied().fold(0.0, f64::max);
        Self { geometry, paddles: paddles.to_vec(), bodies, values, scale }
    }

    /// A body that is somewhere at this time, ns, with what is inside. Colours end at its own largest value, or at `scale`
    /// where that is larger; where they end is `scale` from then on.
    pub fn seen(&self, time_ns: u64, state: &SpaceState, scale: &mut f64) -> SceneUpdate {
        let values = orthogonal(&self.geometry, state);
        *scale = values.iter().copied().fold(*scale, f64::max);
        self.with_inside(time_ns, state, &values, *scale)
    }

    fn with_inside(&self, time_ns: u64, state: &SpaceState, values: &[f64], scale: f64) -> SceneUpdate {
        let now = moved(&self.geometry, state);
        let inside = |(i, surface): (usize, &Vec<[u32; 3]>)| {
            let mut inclusion = SceneEntity::new(&format!("inclusion {}", i + 1), time_ns);
            inclusion.triangles.push(TriangleListPrimitive::of(surface, now, Color { a: INSIDE, ..ORANGE }).0);
            inclusion
        };
        let mut entities = vec![self.body(time_ns, state, values, scale)];
        entities.extend(self.geometry.inclusions.iter().enumerate().map(inside));
        SceneUpdate::of(entities)
    }

    fn bounds(&self) -> [Point<3>; 2] {
        let nodes: Vec<Point<3>> = self.geometry.nodes.iter().map(|x| Point::from(*x)).collect();
        box_of(&nodes).map_or([Point::zeros(); 2], |(low, high)| [low, high])
    }

    fn tools(&self) -> Tools<3> {
        let (geometry, [low, high]) = (&self.geometry, self.bounds());
        Tools {
            extent: (high - low).max(),
            entry: geometry.middle(&geometry.needle),
            axis: geometry.axis.into(),
            target: geometry.target.into(),
        }
    }

    /// The surface in the colours of the field, what of it cannot move and what the needle moves in their own: together all of it.
    fn body(&self, time_ns: u64, state: &SpaceState, values: &[f64], scale: f64) -> SceneEntity {
        let geometry = &self.geometry;
        let now = moved(geometry, state);
        let patches = [(&geometry.immobile, Color { a: HELD, ..BLACK }), (&geometry.needle, GREY)];
        let of_patches: BTreeSet<&[u32; 3]> = patches.iter().flat_map(|(patch, _)| patch.iter()).collect();
        let free: Vec<[u32; 3]> = geometry.outside.iter().filter(|t| !of_patches.contains(t)).copied().collect();
        let (mut skin, nodes) = TriangleListPrimitive::of(&free, now, Color { a: SKIN, ..GREY });
        skin.colors =
            nodes.iter().map(|node| colour(values.get(*node as usize).copied().unwrap_or(0.0), scale)).collect();
        let mut body = SceneEntity::new("body", time_ns);
        let field = "displacement orthogonal to the needle, dark to bright";
        let range = format!("0 to {}", in_unit(scale, &geometry.units[0]));
        body.metadata.push(KeyValuePair { key: field.to_owned(), value: range });
        body.triangles.push(skin);
        body.triangles.extend(patches.map(|(patch, color)| TriangleListPrimitive::of(patch, now, color).0));
        body
    }

    /// A patch a little off the surface, where the paddle has moved it.
    fn paddle(&self, id: &str, index: u32, truth: &Truth, moved_by: [f64; 3]) -> SceneEntity {
        let mut paddle = SceneEntity::new(id, truth.time_ns);
        paddle.metadata.push(KeyValuePair { key: "index".to_owned(), value: index.to_string() });
        let patch = self.geometry.paddles.iter().find(|patch| patch.index == index);
        paddle.triangles.extend(patch.map(|patch| {
            let off = self.off(&patch.triangles);
            let at = |node: u32| Point::from(self.geometry.nodes[node as usize]) + off;
            let mut plate = TriangleListPrimitive::of(&patch.triangles, at, BLUE).0;
            plate.pose = Pose::at(Point::<3>::from(moved_by));
            plate
        }));
        paddle
    }

    /// A short way outwards from a patch, by its mean normal.
    fn off(&self, triangles: &[[u32; 3]]) -> Point<3> {
        let normal = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|node| Point::<3>::from(self.geometry.nodes[node as usize]));
            (b - a).cross(&(c - a))
        };
        let sum: Point<3> = triangles.iter().map(normal).sum();
        sum.try_normalize(0.0).unwrap_or_default() * (OFF * self.tools().extent)
    }
}

/// Colour of a value of the field, of which this is the largest.
fn colour(value: f64, largest: f64) -> Color {
    let [r, g, b] = band_colour(if largest > 0.0 { value / largest } else { 0.0 });
    Color { r, g, b, a: SKIN }
}

/// Where the nodes of a body are.
fn moved<'a>(geometry: &'a SpaceGeometry, state: &'a SpaceState) -> impl Fn(u32) -> Point<3> + Copy + 'a {
    |node| Point::<3>::from(geometry.nodes[node as usize]) + Point::from(state.displacements[node as usize])
}

impl Scenery for SpaceStage<'_> {
    fn scene(&self) -> &str {
        &self.geometry.name
    }

    /// The target at rest: all else moves.
    fn at_rest(&self, time_ns: u64) -> SceneUpdate {
        SceneUpdate::of(vec![self.tools().target_at_rest(time_ns)])
    }

    fn at_tick(&self, truth: &Truth) -> SceneUpdate {
        let tools = self.tools();
        let plates = ["paddle", "second paddle"].into_iter().zip(&self.paddles).zip(truth.paddles);
        let mut entities = vec![tools.needle(truth), tools.target(truth)];
        entities.extend(plates.map(|((id, index), moved_by)| self.paddle(id, *index, truth, moved_by)));
        SceneUpdate::of(entities)
    }

    fn poses(&self, truth: &Truth) -> [PoseInFrame; 2] {
        self.tools().poses(truth)
    }

    fn body_at(&self, truth: &Truth) -> Option<SceneUpdate> {
        let (body, values) = self.bodies.iter().zip(&self.values).find(|(body, _)| body.truth.tick == truth.tick)?;
        Some(self.with_inside(truth.time_ns, &body.state, values, self.scale))
    }

    /// From where the paddles are seen.
    fn layout(&self) -> Value {
        let ([low, high], [view, _]) = (self.bounds(), seen_from(&self.geometry, &self.paddles));
        let camera = Camera {
            middle: ((low + high) * 0.5).into(),
            extent: (high - low).max(),
            distance: AWAY * self.geometry.extent(),
            perspective: true,
            polar: view.z.acos().to_degrees(),
            azimuth: (-view.x).atan2(-view.y).to_degrees(),
        };
        let components = ["x", "y", "z"];
        let topics = ["/paddle.", "/second_paddle."].into_iter().take(self.paddles.len());
        let paths: Vec<String> = topics.flat_map(|topic| components.map(|name| format!("{topic}{name}"))).collect();
        layout(&camera, &["/scene", "/scene/body"], &paths.iter().map(String::as_str).collect::<Vec<_>>())
    }
}
