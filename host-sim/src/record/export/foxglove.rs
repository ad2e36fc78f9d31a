//! What the panels of Foxglove and Lichtblick show without being set up: messages of [their own schemas][schemas] as JSON, and
//! a layout. Lengths are in the scene's unit, where those panels say metres.
//!
//! [schemas]: https://docs.foxglove.dev/docs/sdk/schemas

use model_offline::output::Geometry;
use model_offline::scene::Scene;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use crate::world::truth::Truth;

/// The one frame of reference, and what it lies in.
const FRAME: &str = "scene";
const WORLD: &str = "world";
/// Length of the needle outside the tissue, its thickness and the size of the target, part of the body's longer side.
const OUTSIDE: f64 = 0.2;
const NEEDLE: f64 = 0.01;
const TARGET: f64 = 0.03;
/// Thickness of lines, px.
const LINE: f64 = 2.0;
const TOOL: f64 = 5.0;

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

impl From<[f64; 2]> for Vector3 {
    fn from([x, y]: [f64; 2]) -> Self {
        Self { x, y, z: 0.0 }
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

    /// That turns x into this direction of the plane.
    fn towards([x, y]: [f64; 2]) -> Self {
        let half = 0.5 * y.atan2(x);
        Self { z: half.sin(), w: half.cos(), ..Self::NONE }
    }
}

/// A place and a rotation.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Pose {
    position: Vector3,
    orientation: Quaternion,
}

impl Pose {
    fn at(position: [f64; 2]) -> Self {
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
            pose: Pose::at([0.0; 2]),
            thickness,
            scale_invariant: true,
            points: points.iter().map(|point| (*point).into()).collect(),
            color,
            colors: Vec::new(),
            indices: Vec::new(),
        }
    }
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
    metadata: Vec<Nothing>,
    arrows: Vec<ArrowPrimitive>,
    cubes: Vec<Nothing>,
    spheres: Vec<SpherePrimitive>,
    cylinders: Vec<Nothing>,
    lines: Vec<LinePrimitive>,
    triangles: Vec<Nothing>,
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

/// `foxglove.FrameTransform`: where a frame lies in another one.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FrameTransform {
    timestamp: Time,
    parent_frame_id: String,
    child_frame_id: String,
    translation: Vector3,
    rotation: Quaternion,
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

/// A scene to be seen: body, needle, paddle and target.
#[derive(Clone, Debug)]
pub struct Stage {
    /// The scene at rest; its nodes are not looked at.
    pub geometry: Geometry,
    /// Index of the attached paddle.
    pub paddle: u32,
}

impl Stage {
    /// Of a scene with this paddle.
    pub fn new(scene: &Scene, paddle: u32) -> Self {
        Self { geometry: Geometry::new(scene, &[]), paddle }
    }

    fn bounds(&self) -> [[f64; 2]; 2] {
        let corners = &self.geometry.outline;
        let least = |k: usize| corners.iter().map(|corner| corner[k]).fold(f64::INFINITY, f64::min);
        let most = |k: usize| corners.iter().map(|corner| corner[k]).fold(f64::NEG_INFINITY, f64::max);
        [[least(0), least(1)], [most(0), most(1)]]
    }

    /// Longer side of the body, length.
    fn extent(&self) -> f64 {
        let [low, high] = self.bounds();
        (high[0] - low[0]).max(high[1] - low[1])
    }

    /// What does not move: the body's outline at rest, inclusions, the immobile part, the target at rest.
    pub(super) fn at_rest(&self, time_ns: u64) -> SceneUpdate {
        let geometry = &self.geometry;
        let mut body = SceneEntity::new("body at rest", time_ns);
        body.lines.push(LinePrimitive::new(&geometry.outline, true, LINE, GREY));
        let inclusions = geometry.inclusions.iter();
        body.lines.extend(inclusions.map(|inclusion| LinePrimitive::new(inclusion, true, LINE, ORANGE)));
        let immobile = geometry.immobile.iter();
        body.lines.extend(immobile.map(|part| LinePrimitive::new(part, false, TOOL, BLACK)));
        let mut target = self.ball("target at rest", time_ns, geometry.target);
        target.spheres.iter_mut().for_each(|sphere| sphere.color.a = 0.35);
        SceneUpdate { deletions: Vec::new(), entities: vec![body, target] }
    }

    /// What moves, as it is at a tick.
    pub(super) fn at_tick(&self, truth: &Truth) -> SceneUpdate {
        let geometry = &self.geometry;
        let moved = |point: [f64; 2], by: [f64; 2]| [point[0] + by[0], point[1] + by[1]];
        let target = self.ball("target", truth.time_ns, moved(geometry.target, truth.target::<2>().into()));
        let mut paddle = SceneEntity::new("paddle", truth.time_ns);
        if let Some(at_rest) = geometry.paddles.iter().find(|paddle| paddle.index == self.paddle) {
            let now = at_rest.segment.map(|point| moved(point, truth.paddle::<2>().into()));
            paddle.lines.push(LinePrimitive::new(&now, false, TOOL, BLUE));
        }
        SceneUpdate { deletions: Vec::new(), entities: vec![self.needle(truth), paddle, target] }
    }

    fn ball(&self, id: &str, time_ns: u64, at: [f64; 2]) -> SceneEntity {
        let size = TARGET * self.extent();
        let mut ball = SceneEntity::new(id, time_ns);
        ball.spheres.push(SpherePrimitive {
            pose: Pose::at(at),
            size: Vector3 { x: size, y: size, z: size },
            color: PURPLE,
        });
        ball
    }

    fn needle(&self, truth: &Truth) -> SceneEntity {
        let (geometry, extent) = (&self.geometry, self.extent());
        let entry = model_offline::output::surface::middle(&geometry.needle_contact);
        let from = [0, 1].map(|k| entry[k] + (truth.depth - OUTSIDE * extent) * geometry.needle_axis[k]);
        let diameter = NEEDLE * extent;
        let mut needle = SceneEntity::new("needle", truth.time_ns);
        needle.arrows.push(ArrowPrimitive {
            pose: Pose { position: from.into(), orientation: Quaternion::towards(geometry.needle_axis) },
            shaft_length: OUTSIDE * extent - 2.0 * diameter,
            shaft_diameter: diameter,
            head_length: 2.0 * diameter,
            head_diameter: 2.0 * diameter,
            color: GREY,
        });
        needle
    }

    /// The layout as a file.
    pub fn layout_file(&self) -> Vec<u8> {
        format!("{:#}\n", self.layout()).into_bytes()
    }

    /// A layout for these topics, as the program imports it: the scene from above, error and paddle over time, the log.
    pub fn layout(&self) -> Value {
        let [low, high] = self.bounds();
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        let extent = self.extent();
        let plot = |title: &str, paths: &[&str]| {
            let paths: Vec<Value> = paths
                .iter()
                .map(|path| json!({"value": path, "enabled": true, "timestampMethod": "receiveTime"}))
                .collect();
            json!({"title": title, "paths": paths, "showXAxisLabels": true, "showYAxisLabels": true, "showLegend": true,
                "legendDisplay": "floating", "isSynced": true, "xAxisVal": "timestamp"})
        };
        json!({
            "configById": {
                "3D!scene": {
                    "cameraState": {
                        "perspective": false, "distance": 1.4 * extent, "phi": 0.0, "thetaOffset": 0.0,
                        "targetOffset": [middle[0], middle[1], 0.0], "target": [0.0, 0.0, 0.0],
                        "targetOrientation": [0.0, 0.0, 0.0, 1.0], "fovy": 45.0, "near": 1e-3 * extent, "far": 1e3 * extent,
                    },
                    "followMode": "follow-none", "followTf": FRAME, "scene": {}, "transforms": {}, "layers": {},
                    "topics": {"/scene": {"visible": true}, "/scene/rest": {"visible": true}},
                },
                "Plot!error": plot("Orthogonal error", &["/truth.orthogonal_error"]),
                "Plot!paddle": plot("Paddle", &["/paddle.x", "/paddle.y", "/command.x", "/command.y"]),
                "RosOut!log": {"searchTerms": [], "minLogLevel": 1},
            },
            "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1},
            "layout": {
                "direction": "row", "splitPercentage": 55, "first": "3D!scene",
                "second": {
                    "direction": "column", "splitPercentage": 70, "second": "RosOut!log",
                    "first": {"direction": "column", "first": "Plot!error", "second": "Plot!paddle"},
                },
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage() -> Stage {
        Stage::new(&Scene::bundled("paper").unwrap(), 3)
    }

    /// The needle's arrow ends where the needle is, and points along it; the paddle is where it was moved to.
    #[test]
    fn what_moves_is_where_the_truth_has_it() {
        let stage = stage();
        let truth = Truth {
            time_ns: 3_000_000_007,
            depth: 0.05,
            target: [0.01, -0.02, 0.0],
            paddles: [[0.0, -0.03, 0.0], [0.0; 3]],
            ..Truth::default()
        };
        let update = serde_json::to_value(stage.at_tick(&truth)).unwrap();
        let entity = |id: &str| {
            let entities = update["entities"].as_array().unwrap();
            entities.iter().find(|entity| entity["id"] == id).unwrap().clone()
        };
        assert_eq!(entity("needle")["timestamp"], json!({"sec": 3, "nsec": 7}));
        let arrow = entity("needle")["arrows"][0].clone();
        let number = |value: &Value| value.as_f64().unwrap();
        let [z, w] = ["z", "w"].map(|name| number(&arrow["pose"]["orientation"][name]));
        // A rotation by 2·atan2(z, w) about the axis out of the plane.
        let axis = [1.0 - 2.0 * z * z, 2.0 * z * w];
        let length = number(&arrow["shaft_length"]) + number(&arrow["head_length"]);
        let entry = model_offline::output::surface::middle(&stage.geometry.needle_contact);
        for (k, name) in ["x", "y"].into_iter().enumerate() {
            assert!((axis[k] - stage.geometry.needle_axis[k]).abs() < 1e-12);
            let tip = number(&arrow["pose"]["position"][name]) + length * axis[k];
            assert!((tip - entry[k] - 0.05 * stage.geometry.needle_axis[k]).abs() < 1e-12, "{name}: {tip}");
        }
        let paddle = &stage.geometry.paddles[2];
        assert_eq!(number(&entity("paddle")["lines"][0]["points"][0]["y"]), paddle.segment[0][1] - 0.03);
        assert_eq!(number(&entity("target")["spheres"][0]["pose"]["position"]["x"]), stage.geometry.target[0] + 0.01);
    }

    /// Every panel of the layout has its settings, and every topic that it names is written.
    #[test]
    fn the_layout_names_what_there_is() {
        let layout = stage().layout();
        let panels = layout["configById"].as_object().unwrap();
        let text = layout["layout"].to_string();
        assert!(panels.len() == 4 && panels.keys().all(|panel| text.contains(panel.as_str())), "{text}");
        let topics = super::super::mcap::schemas().map(|(topic, ..)| topic);
        let paths = panels.values().flat_map(|panel| panel["paths"].as_array().into_iter().flatten());
        for path in paths {
            let topic = path["value"].as_str().unwrap().split('.').next().unwrap();
            assert!(topics.contains(&topic), "{topic}");
        }
        assert!(topics.contains(&"/scene"));
    }
}
