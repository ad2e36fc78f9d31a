//! A layout that shows what is recorded.

use serde_json::{Map, Value, json};

use super::FRAME;

/// Length of the axes of frames, of the body's longest side.
const AXES: f64 = 0.1;

/// Where a scene is looked at from, as the 3D panel has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    /// The middle of the body.
    pub(super) middle: [f64; 3],
    /// Its longest side, length.
    pub(super) extent: f64,
    /// How far the camera is from there, or how much it sees where far is not small, length.
    pub(super) distance: f64,
    /// Whether what is far is small.
    pub(super) perspective: bool,
    /// Angle from z down to where it is looked at from, degrees.
    pub(super) polar: f64,
    /// Its direction about z, degrees: 0 is from −y.
    pub(super) azimuth: f64,
}

/// The scene by this camera with these topics that move, the error, these curves of paddles, the log.
pub(super) fn layout(camera: &Camera, moving: &[&str], paddles: &[&str]) -> Value {
    let Camera { middle, extent, distance, perspective, polar, azimuth } = *camera;
    let topics: Map<String, Value> =
        moving.iter().chain(&["/scene/rest"]).map(|topic| ((*topic).to_owned(), json!({"visible": true}))).collect();
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
                    "perspective": perspective, "distance": distance, "phi": polar, "thetaOffset": azimuth,
                    "targetOffset": middle, "target": [0.0, 0.0, 0.0],
                    "targetOrientation": [0.0, 0.0, 0.0, 1.0], "fovy": 45.0, "near": 1e-3 * extent, "far": 1e3 * extent,
                },
                "followMode": "follow-none", "followTf": FRAME, "transforms": {}, "layers": {},
                // Axes and names of frames are as large as a metre, whatever the body.
                "scene": {"transforms": {"showLabel": false, "axisScale": AXES * extent}},
                "topics": topics,
            },
            "Plot!error": plot("Orthogonal error", &["/truth.orthogonal_error"]),
            "Plot!paddle": plot("Paddle", paddles),
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
