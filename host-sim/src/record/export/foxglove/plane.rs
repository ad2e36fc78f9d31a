//! A planar scene to be seen: body, needle, paddle and target, from above.

use model_offline::geometry::Point;
use model_offline::output::{Geometry, surface};
use model_offline::scene::Scene;
use serde_json::Value;

use super::layout::{Camera, layout};
use super::scenery::{Scenery, Tools};
use super::{BLACK, BLUE, GREY, LinePrimitive, ORANGE, PoseInFrame, SceneEntity, SceneUpdate};
use crate::world::truth::Truth;

/// Thickness of lines, px.
const LINE: f64 = 2.0;
const TOOL: f64 = 5.0;
/// How much is seen, over the body's longer side.
const AROUND: f64 = 1.8;

/// A planar scene with one of its paddles.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Name of the scene.
    pub name: String,
    /// The scene at rest; its nodes are not looked at.
    pub geometry: Geometry,
    /// Index of the attached paddle.
    pub paddle: u32,
}

impl Stage {
    /// Of a scene with this paddle.
    pub fn new(scene: &Scene, paddle: u32) -> Self {
        Self { name: scene.name.clone(), geometry: Geometry::new(scene, &[]), paddle }
    }

    fn bounds(&self) -> [[f64; 2]; 2] {
        let corners = &self.geometry.outline;
        let least = |k: usize| corners.iter().map(|corner| corner[k]).fold(f64::INFINITY, f64::min);
        let most = |k: usize| corners.iter().map(|corner| corner[k]).fold(f64::NEG_INFINITY, f64::max);
        [[least(0), least(1)], [most(0), most(1)]]
    }

    fn tools(&self) -> Tools<2> {
        let (geometry, [low, high]) = (&self.geometry, self.bounds());
        Tools {
            extent: (high[0] - low[0]).max(high[1] - low[1]),
            entry: surface::middle(&geometry.needle_contact).into(),
            axis: geometry.needle_axis.into(),
            target: geometry.target.into(),
        }
    }
}

impl Scenery for Stage {
    fn scene(&self) -> &str {
        &self.name
    }

    /// The body's outline at rest, inclusions, the immobile part, the target at rest.
    fn at_rest(&self, time_ns: u64) -> SceneUpdate {
        let geometry = &self.geometry;
        let mut body = SceneEntity::new("body at rest", time_ns);
        body.lines.push(LinePrimitive::new(&geometry.outline, true, LINE, GREY));
        let inclusions = geometry.inclusions.iter();
        body.lines.extend(inclusions.map(|inclusion| LinePrimitive::new(inclusion, true, LINE, ORANGE)));
        let immobile = geometry.immobile.iter();
        body.lines.extend(immobile.map(|part| LinePrimitive::new(part, false, TOOL, BLACK)));
        SceneUpdate::of(vec![body, self.tools().target_at_rest(time_ns)])
    }

    fn at_tick(&self, truth: &Truth) -> SceneUpdate {
        let tools = self.tools();
        let mut paddle = SceneEntity::new("paddle", truth.time_ns);
        if let Some(at_rest) = self.geometry.paddles.iter().find(|paddle| paddle.index == self.paddle) {
            let now = at_rest.segment.map(|point| (Point::<2>::from(point) + truth.paddle::<2>()).into());
            paddle.lines.push(LinePrimitive::new(&now, false, TOOL, BLUE));
        }
        SceneUpdate::of(vec![tools.needle(truth), paddle, tools.target(truth)])
    }

    fn poses(&self, truth: &Truth) -> [PoseInFrame; 2] {
        self.tools().poses(truth)
    }

    /// It is not drawn in the plane.
    fn body_at(&self, _: &Truth) -> Option<SceneUpdate> {
        None
    }

    /// The scene from above.
    fn layout(&self) -> Value {
        let ([low, high], extent) = (self.bounds(), self.tools().extent);
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.0];
        let camera = Camera { middle, extent, distance: AROUND * extent, perspective: false, polar: 0.0, azimuth: 0.0 };
        layout(&camera, &["/scene"], &["/paddle.x", "/paddle.y", "/command.x", "/command.y"])
    }
}
