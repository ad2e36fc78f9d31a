//! What scenes of any dimension have in common: what of them can be seen, and how needle and target look.

use std::fmt::Debug;

use model_offline::geometry::Point;
use serde_json::Value;

use super::{
    ArrowPrimitive, GREY, PURPLE, Pose, PoseInFrame, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Vector3,
};
use crate::world::truth::Truth;

/// Length of the needle outside the tissue, its thickness and the size of the target, part of the body's longest side.
const OUTSIDE: f64 = 0.2;
const NEEDLE: f64 = 0.01;
const TARGET: f64 = 0.03;

/// A scene to be seen along a recording.
pub trait Scenery: Debug {
    /// Name of the scene.
    fn scene(&self) -> &str;

    /// What does not move, from this time on, ns.
    fn at_rest(&self, time_ns: u64) -> SceneUpdate;

    /// What moves with every tick: needle, paddles, target.
    fn at_tick(&self, truth: &Truth) -> SceneUpdate;

    /// Where the needle's contact is, x along the insertion, and where the target is.
    fn poses(&self, truth: &Truth) -> [PoseInFrame; 2];

    /// The deformed body, at ticks at which it has been solved for.
    fn body_at(&self, truth: &Truth) -> Option<SceneUpdate>;

    /// A layout for these topics, as the programs import it: the scene, error and paddles over time, the log.
    fn layout(&self) -> Value;

    /// The layout as a file.
    fn layout_file(&self) -> Vec<u8> {
        format!("{:#}\n", self.layout()).into_bytes()
    }
}

/// Needle and target of a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tools<const D: usize> {
    /// Longest side of the body, length.
    pub(super) extent: f64,
    /// Where the needle's tip is at rest.
    pub(super) entry: Point<D>,
    /// Unit direction of insertion.
    pub(super) axis: Point<D>,
    /// The target at rest.
    pub(super) target: Point<D>,
}

impl<const D: usize> Tools<D> {
    fn ball(&self, id: &str, time_ns: u64, at: Point<D>) -> SceneEntity {
        let size = TARGET * self.extent;
        let mut ball = SceneEntity::new(id, time_ns);
        ball.spheres.push(SpherePrimitive {
            pose: Pose::at(at),
            size: Vector3 { x: size, y: size, z: size },
            color: PURPLE,
        });
        ball
    }

    /// The target's ball where it was at rest, pale.
    pub(super) fn target_at_rest(&self, time_ns: u64) -> SceneEntity {
        let mut target = self.ball("target at rest", time_ns, self.target);
        target.spheres.iter_mut().for_each(|sphere| sphere.color.a = 0.35);
        target
    }

    /// The target's ball where it is.
    pub(super) fn target(&self, truth: &Truth) -> SceneEntity {
        self.ball("target", truth.time_ns, self.target + truth.target::<D>())
    }

    /// Where the middle of the contact is, x along the insertion, and where the target is.
    pub(super) fn poses(&self, truth: &Truth) -> [PoseInFrame; 2] {
        let needle = Pose {
            position: (self.entry + self.axis * truth.depth).into(),
            orientation: Quaternion::towards(self.axis),
        };
        let target = Pose::at(self.target + truth.target::<D>());
        [needle, target].map(|pose| PoseInFrame::new(truth.time_ns, pose))
    }

    /// An arrow whose head ends where the needle is.
    pub(super) fn needle(&self, truth: &Truth) -> SceneEntity {
        let Self { extent, entry, axis, .. } = self;
        let from = entry + axis * (truth.depth - OUTSIDE * extent);
        let diameter = NEEDLE * extent;
        let mut needle = SceneEntity::new("needle", truth.time_ns);
        needle.arrows.push(ArrowPrimitive {
            pose: Pose { position: from.into(), orientation: Quaternion::towards(*axis) },
            shaft_length: OUTSIDE * extent - 2.0 * diameter,
            shaft_diameter: diameter,
            head_length: 2.0 * diameter,
            head_diameter: 2.0 * diameter,
            color: GREY,
        });
        needle
    }
}
