//! What the panels of Foxglove and Lichtblick show without being set up: messages of [their own schemas][schemas] as JSON, and
//! a layout. Lengths are in the scene's unit, where those panels say metres.
//!
//! [schemas]: https://docs.foxglove.dev/docs/sdk/schemas

mod layout;
mod plane;
mod scenery;
mod space;

#[cfg(test)]
mod tests;

pub use self::plane::Stage;
pub use self::scenery::Scenery;
pub use self::space::SpaceStage;

use model_offline::geometry::Point;
use schemars::JsonSchema;
use serde::Serialize;

/// The one frame of reference, and what it lies in.
const FRAME: &str = "scene";
const WORLD: &str = "world";

/// What is nearer than this to −x has no shortest way there.
const ABOUT: f64 = 1e-12;

/// Colours of Okabe and Ito, as in the report.
const GREY: Color = Color { r: 0.36, g: 0.38, b: 0.44, a: 1.0 };
const BLACK: Color = Color { r: 0.1, g: 0.11, b: 0.14, a: 1.0 };
const ORANGE: Color = Color { r: 0.9, g: 0.62, b: 0.0, a: 1.0 };
const BLUE: Color = Color { r: 0.0, g: 0.45, b: 0.7, a: 1.0 };
const PURPLE: Color = Color { r: 0.8, g: 0.47, b: 0.65, a: 1.0 };

/// A time or a duration.
#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
pub struct Time {
    sec: u64,
    nsec: u32,
}

impl Time {
    fn new(time_ns: u64) -> Self {
        Self { sec: time_ns / 1_000_000_000, nsec: (time_ns % 1_000_000_000) as u32 }
    }
}

/// A point or a size.
#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
pub struct Vector3 {
    x: f64,
    y: f64,
    z: f64,
}

impl<const D: usize> From<Point<D>> for Vector3 {
    fn from(point: Point<D>) -> Self {
        let [x, y, z] = [0, 1, 2].map(|k| point.get(k).copied().unwrap_or(0.0));
        Self { x, y, z }
    }
}

/// A rotation.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl Quaternion {
    const NONE: Self = Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };

    /// That turns x into this unit direction, the shortest way: (1 + x·d, x × d), normalized.
    fn towards<const D: usize>(direction: Point<D>) -> Self {
        let Vector3 { x, y, z } = direction.into();
        let norm = (1.0 + x).hypot(y.hypot(z));
        if norm < ABOUT {
            // No way about is the shortest.
            return Self { z: 1.0, w: 0.0, ..Self::NONE };
        }
        Self { x: 0.0, y: -z / norm, z: y / norm, w: (1.0 + x) / norm }
    }
}

/// A place and a rotation.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Pose {
    position: Vector3,
    orientation: Quaternion,
}

impl Pose {
    fn at<const D: usize>(position: Point<D>) -> Self {
        Self { position: position.into(), orientation: Quaternion::NONE }
    }
}

/// A colour, parts from 0 to 1.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Color {
    r: f64,
    g: f64,
    b: f64,
    a: f64,
}

/// An arrow along x.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ArrowPrimitive {
    pose: Pose,
    shaft_length: f64,
    shaft_diameter: f64,
    head_length: f64,
    head_diameter: f64,
    color: Color,
}

/// A ball.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SpherePrimitive {
    pose: Pose,
    size: Vector3,
    color: Color,
}

/// Lines.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LinePrimitive {
    /// 0: one after the other; 1: closed.
    #[serde(rename = "type")]
    kind: u8,
    pose: Pose,
    thickness: f64,
    scale_invariant: bool,
    points: Vec<Vector3>,
    color: Color,
    colors: Vec<Color>,
    indices: Vec<u32>,
}

impl LinePrimitive {
    fn new(points: &[[f64; 2]], is_closed: bool, thickness: f64, color: Color) -> Self {
        Self {
            kind: u8::from(is_closed),
            pose: Pose::at(Point::<2>::zeros()),
            thickness,
            scale_invariant: true,
            points: points.iter().map(|point| Point::from(*point).into()).collect(),
            color,
            colors: Vec::new(),
            indices: Vec::new(),
        }
    }
}

/// Triangles that share corners.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TriangleListPrimitive {
    pose: Pose,
    points: Vec<Vector3>,
    /// Of all of them where there are no `colors`.
    color: Color,
    /// One per point, or none.
    colors: Vec<Color>,
    /// Three per triangle.
    indices: Vec<u32>,
}

impl TriangleListPrimitive {
    /// These triangles of nodes that are somewhere, in one colour; and which nodes their corners are.
    fn of(triangles: &[[u32; 3]], at: impl Fn(u32) -> Point<3>, color: Color) -> (Self, Vec<u32>) {
        let mut nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let place = |node: &u32| nodes.partition_point(|known| known < node) as u32;
        let triangles = Self {
            pose: Pose::at(Point::<3>::zeros()),
            points: nodes.iter().map(|node| at(*node).into()).collect(),
            color,
            colors: Vec::new(),
            indices: triangles.iter().flatten().map(place).collect(),
        };
        (triangles, nodes)
    }
}

/// Something that is said of an entity.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct KeyValuePair {
    key: String,
    value: String,
}

/// Of what there is none in these scenes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Nothing {}

/// `foxglove.SceneEntity`: something to be seen. What is not used is there, too: readers look at all of it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SceneEntity {
    timestamp: Time,
    frame_id: String,
    id: String,
    lifetime: Time,
    frame_locked: bool,
    metadata: Vec<KeyValuePair>,
    arrows: Vec<ArrowPrimitive>,
    cubes: Vec<Nothing>,
    spheres: Vec<SpherePrimitive>,
    cylinders: Vec<Nothing>,
    lines: Vec<LinePrimitive>,
    triangles: Vec<TriangleListPrimitive>,
    texts: Vec<Nothing>,
    models: Vec<Nothing>,
}

impl SceneEntity {
    fn new(id: &str, time_ns: u64) -> Self {
        Self {
            timestamp: Time::new(time_ns),
            frame_id: FRAME.to_owned(),
            id: id.to_owned(),
            lifetime: Time::default(),
            frame_locked: true,
            metadata: Vec::new(),
            arrows: Vec::new(),
            cubes: Vec::new(),
            spheres: Vec::new(),
            cylinders: Vec::new(),
            lines: Vec::new(),
            triangles: Vec::new(),
            texts: Vec::new(),
            models: Vec::new(),
        }
    }
}

/// `foxglove.SceneUpdate`: what is to be seen from now on.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SceneUpdate {
    deletions: Vec<Nothing>,
    entities: Vec<SceneEntity>,
}

impl SceneUpdate {
    fn of(entities: Vec<SceneEntity>) -> Self {
        Self { deletions: Vec::new(), entities }
    }
}

/// `foxglove.FrameTransform`: where a frame lies in another one.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FrameTransform {
    timestamp: Time,
    parent_frame_id: String,
    child_frame_id: String,
    translation: Vector3,
    rotation: Quaternion,
}

/// `foxglove.PoseInFrame`: where something is, and how it is turned.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PoseInFrame {
    timestamp: Time,
    frame_id: String,
    pose: Pose,
}

impl PoseInFrame {
    fn new(time_ns: u64, pose: Pose) -> Self {
        Self { timestamp: Time::new(time_ns), frame_id: FRAME.to_owned(), pose }
    }
}

/// `foxglove.Log`: a line of a log.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Log {
    timestamp: Time,
    /// 2: information, 3: warning, 4: error.
    level: u8,
    message: String,
    name: String,
    file: String,
    line: u32,
}

impl Log {
    /// What the controller says.
    pub(super) fn of_controller(time_ns: u64, level: u8, message: String) -> Self {
        Self {
            timestamp: Time::new(time_ns),
            level,
            message,
            name: "controller".to_owned(),
            file: String::new(),
            line: 0,
        }
    }
}

/// The scene's frame where the world has its.
pub(super) fn frame(time_ns: u64) -> FrameTransform {
    FrameTransform {
        timestamp: Time::new(time_ns),
        parent_frame_id: WORLD.to_owned(),
        child_frame_id: FRAME.to_owned(),
        translation: Vector3::default(),
        rotation: Quaternion::NONE,
    }
}
