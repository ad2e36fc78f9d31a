//! What the page's slider needs: the body along the way and the time series, as numbers only.

use model_offline::output::chart::style::BANDS;
use model_offline::output::surface::Interpolated;
use serde::Serialize;

use super::fields::ShownField;
use super::insertion::CaseCharts;
use super::scene::{Surface, body_id};
use crate::bench::result::{RunResult, StrategyResult};

/// Points of a time series that the slider can show.
const POINTS: usize = 200;

#[derive(Serialize)]
struct Data<'a> {
    depth: f64,
    bands: usize,
    fields: Vec<ShownField>,
    /// The window around the target: corner and size, px.
    window: [f64; 4],
    size: [f64; 2],
    triangles: &'a [[usize; 3]],
    boundary: &'a [usize],
    inclusions: &'a [Vec<Interpolated>],
    rest: Vec<[f64; 2]>,
    target: [f64; 2],
    axis: [f64; 2],
    normal: [f64; 2],
    /// Behind lengths; empty where there is none.
    unit: String,
    scale: f64,
    bodies: Vec<DrawnBody<'a>>,
    charts: Vec<(String, [f64; 4])>,
}

#[derive(Serialize)]
struct DrawnBody<'a> {
    id: String,
    frames: Vec<DrawnFrame<'a>>,
    /// Depth, orthogonal error, axial displacement, paddle x, paddle y.
    series: Vec<[f64; 5]>,
    /// Displacement of the paddle in the drawing.
    paddle_end: [f64; 2],
}

#[derive(Serialize)]
struct DrawnFrame<'a> {
    depth: f64,
    nodes: Vec<[f64; 2]>,
    strain: &'a [f64],
    von_mises: &'a [f64],
}

/// A hundredth of a pixel: displacements that are small beside the body are coloured, too.
fn rounded(point: [f64; 2]) -> [f64; 2] {
    point.map(|value| (value * 100.0).round() / 100.0)
}

/// Five significant digits are more than anybody reads.
fn short(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

fn body<'a>(run: &RunResult, surface: &Surface, id: String, strategy: &'a StrategyResult) -> DrawnBody<'a> {
    let path = |nodes: &[[f64; 2]]| surface.view.path(nodes).into_iter().map(rounded).collect();
    let rest = DrawnFrame { depth: 0.0, nodes: path(&run.geometry.nodes), strain: &[], von_mises: &[] };
    let frames = strategy.frames.iter().map(|frame| DrawnFrame {
        depth: frame.depth,
        nodes: path(&frame.nodes),
        strain: &frame.strain,
        von_mises: &frame.von_mises,
    });
    let stride = strategy.series.len().div_ceil(POINTS).max(1);
    let last = strategy.series.len().saturating_sub(1);
    let points = strategy.series.iter().enumerate().filter(|(i, _)| i % stride == 0 || *i == last);
    let [px, py] = strategy.series.last().map_or([0.0; 2], |point| point.paddle);
    DrawnBody {
        id,
        frames: std::iter::once(rest).chain(frames).collect(),
        series: points
            .map(|(_, p)| [p.depth, p.orthogonal_error, p.axial, p.paddle[0], p.paddle[1]].map(short))
            .collect(),
        paddle_end: [px, py],
    }
}

/// JSON that is safe inside of a script element.
pub(super) fn data(run: &RunResult, surface: &Surface, charts: &[CaseCharts]) -> String {
    let mut bodies = Vec::new();
    for (number, case) in run.cases.iter().enumerate() {
        for (strategy, result) in run.shown(case) {
            bodies.push(body(run, surface, body_id(number, strategy), result));
        }
    }
    let geometry = &run.geometry;
    let data = Data {
        depth: run.settings.depth,
        bands: BANDS,
        fields: Surface::fields(run),
        window: surface.window(geometry).map(|px| if px.is_finite() { px } else { 0.0 }),
        size: surface.view.size(),
        triangles: &surface.triangles,
        boundary: &surface.boundary,
        inclusions: &surface.inclusions,
        rest: surface.view.path(&geometry.nodes).into_iter().map(rounded).collect(),
        target: surface.view.at(geometry.target),
        axis: geometry.needle_axis,
        normal: geometry.orthogonal,
        unit: if run.units[0] == "1" { String::new() } else { format!(" {}", run.units[0]) },
        scale: surface.view.length(1.0),
        bodies,
        charts: charts.iter().flat_map(CaseCharts::spans).collect(),
    };
    // Numbers that are not finite become null, which the page skips.
    serde_json::to_string(&data).unwrap_or_else(|_| "null".to_owned()).replace('<', "\\u003c")
}
