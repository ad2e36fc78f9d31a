//! What the page is told, and the page itself in space.

use model_offline::model::TissueModel;
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::output::surface::triangles;
use serde_json::{Value, json};

use super::body::ShownBody;
use super::shared::{PAGE, Shared, ViewState};
use crate::report::page::space_view::{live_view, moved_body};
use crate::runtime::names;

fn path(points: &[model_offline::geometry::Point2]) -> Vec<[f64; 2]> {
    points.iter().map(|point| [point.x, point.y]).collect()
}

/// The page of a body in space, which it holds, seen from where these paddles are: what comes later moves it.
pub(super) fn page_in_space(geometry: &SpaceGeometry, units: &[String; 2], paddles: &[u32]) -> String {
    let live = live_view(geometry, units, paddles);
    let (before, rest) = PAGE.split_once("<!--body-->").unwrap_or((PAGE, ""));
    let (_, rest) = rest.split_once("<!--/body-->").unwrap_or(("", rest));
    let page = format!("{before}{}{rest}", live.body);
    page.replacen("/*space*/", &live.style, 1).replacen("<!--scripts-->", &live.scripts, 1)
}

/// Everything that stays the same during an insertion.
pub(super) fn scene(state: &ViewState, shared: &Shared) -> Value {
    let mut told = match &state.body {
        None => return json!({}),
        Some(ShownBody::Plane(model, paddle)) => planar_scene(model, *paddle),
        Some(ShownBody::Space(body)) => {
            let scene = body.model.scene();
            json!({
                "space": true,
                "name": scene.name,
                "unit": scene.length_unit,
                "depth": scene.needle.depth,
                "has_inclusions": !scene.inclusions.is_empty(),
                "paddles": body.paddles.len(),
                "indices": body.paddles,
            })
        }
    };
    let common = json!({
        "title": state.title,
        "live": state.live,
        "mode": state.mode.map(|mode| mode.to_string()),
        "knobs": shared.knobs(),
        "history": state.history.rows,
        "trail": state.history.trail,
    });
    extend(&mut told, common);
    told
}

fn planar_scene(model: &TissueModel, index: u32) -> Value {
    let scene = model.scene();
    let nodes = path(model.positions());
    let outline = path(scene.outline.vertices());
    let paddle = scene.paddles.iter().find(|known| known.index == index);
    json!({
        "name": scene.name,
        "unit": scene.length_unit,
        "outline": outline,
        "triangles": triangles(&nodes, &outline),
        "nodes": nodes,
        "immobile": scene.immobile.iter().map(|part| path(part)).collect::<Vec<_>>(),
        "inclusions": scene.inclusions.iter().map(|i| path(i.outline.vertices())).collect::<Vec<_>>(),
        "contact": path(&scene.needle.contact),
        "axis": [scene.needle.axis.x, scene.needle.axis.y],
        "depth": scene.needle.depth,
        "target": [scene.target.x, scene.target.y],
        "paddle": paddle.map(|paddle| path(&paddle.segment)),
        "indices": [index],
    })
}

/// Adds the members of another object.
fn extend(object: &mut Value, others: Value) {
    if let (Value::Object(object), Value::Object(others)) = (object, others) {
        object.extend(others);
    }
}

/// What of the body moves: displacements of nodes.
fn moved(state: &ViewState) -> Value {
    match &state.body {
        None => Value::Null,
        Some(ShownBody::Plane(model, _)) => {
            // Four significant digits of the depth are beyond any screen.
            let step = 10f64.powf((1e-4 * model.scene().needle.depth).log10().floor());
            let moved = model.nodal_displacements(&state.coefficients).unwrap_or_default();
            let rounded = |v: f64| (v / step).round() * step;
            moved.iter().flat_map(|u| [rounded(u.x), rounded(u.y)]).collect()
        }
        // Where the table does not reach there is no body to show.
        Some(ShownBody::Space(body)) => body.state(&state.truth).map_or(Value::Null, |state| json!(moved_body(&state))),
    }
}

/// One picture.
pub(super) fn frame(state: &ViewState, shared: &Shared) -> Value {
    let truth = &state.truth;
    json!({
        "time": state.time_s,
        "tick": truth.tick,
        "depth": truth.depth,
        "answer": state.answer.map(|answer| json!({
            "mode": names::mode::name(answer.mode),
            "faults": answer.faults.to_string(),
        })),
        "error": state.error,
        "largest": state.largest,
        "target": truth.target,
        "paddle": truth.paddles[0],
        "second_paddle": truth.paddles[1],
        "moved": moved(state),
        "solve_us": state.solve_ns as f64 * 1e-3,
        "late_us": state.late_ns as f64 * 1e-3,
        "paused": state.held,
        "pace": shared.pace(),
        "dropped": shared.dropped(),
    })
}
