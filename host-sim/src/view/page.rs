//! What the page is told, and the page itself.

use serde_json::{Value, json};

use super::shared::{Shared, ViewState};
use crate::runtime::names;
use model_offline::output::surface::triangles;

/// One file: no network but the events of its own address.
pub(super) const PAGE: &str = include_str!("page.html");

fn path(points: &[model_offline::geometry::Point2]) -> Vec<[f64; 2]> {
    points.iter().map(|point| [point.x, point.y]).collect()
}

/// Everything that stays the same during an insertion.
pub(super) fn scene(state: &ViewState, shared: &Shared) -> Value {
    let Some(model) = &state.model else { return json!({}) };
    let scene = model.scene();
    let nodes = path(model.positions());
    let outline = path(scene.outline.vertices());
    let paddle = scene.paddles.iter().find(|paddle| paddle.index == state.paddle_index);
    let normal = scene.needle.orthogonal();
    json!({
        "name": scene.name,
        "title": state.title,
        "live": state.live,
        "mode": state.mode.map(|mode| mode.to_string()),
        "unit": scene.length_unit,
        "outline": outline,
        "triangles": triangles(&nodes, &outline),
        "nodes": nodes,
        "immobile": scene.immobile.iter().map(|part| path(part)).collect::<Vec<_>>(),
        "inclusions": scene.inclusions.iter().map(|i| path(i.outline.vertices())).collect::<Vec<_>>(),
        "contact": path(&scene.needle.contact),
        "axis": [scene.needle.axis.x, scene.needle.axis.y],
        "normal": [normal.x, normal.y],
        "depth": scene.needle.depth,
        "target": [scene.target.x, scene.target.y],
        "paddle": paddle.map(|paddle| path(&paddle.segment)),
        "knobs": shared.knobs(),
        "history": state.history.rows,
        "trail": state.history.trail,
    })
}

/// One picture.
pub(super) fn frame(state: &ViewState, shared: &Shared) -> Value {
    let nodes: Vec<f64> = state.model.as_ref().map_or_else(Vec::new, |model| {
        // Four significant digits of the depth are beyond any screen.
        let step = 10f64.powf((1e-4 * model.scene().needle.depth).log10().floor());
        let moved = model.nodal_displacements(&state.coefficients).unwrap_or_default();
        let rounded = |v: f64| (v / step).round() * step;
        moved.iter().flat_map(|u| [rounded(u.x), rounded(u.y)]).collect()
    });
    json!({
        "time": state.time_s,
        "tick": state.tick,
        "depth": state.depth,
        "answer": state.answer.map(|answer| json!({
            "mode": names::mode::name(answer.mode),
            "faults": answer.faults.to_string(),
        })),
        "largest": state.largest,
        "target": state.target,
        "paddle": state.paddle,
        "moved": nodes,
        "solve_us": state.solve_ns as f64 * 1e-3,
        "late_us": state.late_ns as f64 * 1e-3,
        "paused": state.held,
        "pace": shared.pace(),
        "dropped": shared.dropped(),
    })
}
