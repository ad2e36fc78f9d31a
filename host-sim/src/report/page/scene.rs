//! The scene at rest, and the body that the strategies leave behind.

use std::collections::BTreeSet;

use maud::{Markup, html};

use model_offline::output::chart::number::{in_unit, number};
use model_offline::output::chart::style::band;
use model_offline::output::chart::{Anchor, Drawing, Names, Px, colour_bar};
use model_offline::output::field_picture::Field;
use model_offline::output::surface;
use model_offline::output::surface::Interpolated;
use model_offline::scene::TissueVariant;

use super::embed::inline;
use super::fields::ShownField;
use super::view::{PlaneView, along, inside, middle};
use crate::bench::result::{BodyFrame, CaseResult, Geometry, RunResult, StrategyResult};
use crate::bench::strategy::Strategy;

/// Width of the scene and of a body, px.
const SCENE_WIDTH: f64 = 420.0;
const BODY_WIDTH: f64 = 300.0;
/// Radius of a node, px.
const NODE: f64 = 0.9;
/// Half the widths of what names keep clear of, px.
const TARGET: f64 = 12.0;
const NUMBER: f64 = 9.0;
/// Where the strokes of what is held are, over the distance of a paddle's number.
const STROKES: f64 = 0.4;

/// The immobile boundary, its outer side with strokes.
fn held(drawing: &mut Drawing, view: &PlaneView, geometry: &Geometry, part: &[[f64; 2]]) {
    let outline = view.path(&geometry.outline);
    drawing.held(&view.path(part), view.length(0.03 * view.extent), |point| inside(&outline, point));
}

/// The needle at this depth.
fn needle(drawing: &mut Drawing, view: &PlaneView, geometry: &Geometry, depth: f64) {
    let [from, to] = view.needle(geometry, depth);
    drawing.needle(from, to);
}

/// A number beside a paddle, outside of the body.
fn beside(geometry: &Geometry, extent: f64, segment: &[[f64; 2]; 2]) -> [f64; 2] {
    let [dx, dy] = [segment[1][0] - segment[0][0], segment[1][1] - segment[0][1]];
    let length = dx.hypot(dy);
    let normal = [dy / length, -dx / length];
    let centre = middle(segment);
    let way = if inside(&geometry.outline, along(centre, normal, 0.02 * extent)) { -0.05 } else { 0.05 };
    along(centre, normal, way * extent)
}

/// The scene at rest with everything named.
pub(super) fn at_rest(run: &RunResult) -> Drawing {
    let geometry = &run.geometry;
    let view = PlaneView::new(run, SCENE_WIDTH);
    let mut drawing = Drawing::new(view.size(), format!("Scene {} at rest", run.scene));
    drawing.polygon("body", &view.path(&geometry.outline));
    for inclusion in &geometry.inclusions {
        drawing.polygon("inclusion", &view.path(inclusion));
    }
    geometry.nodes.iter().for_each(|node| drawing.circle("node", view.at(*node), NODE));
    geometry.immobile.iter().for_each(|part| held(&mut drawing, &view, geometry, part));
    drawing.polyline("contact", &view.path(&geometry.needle_contact));
    needle(&mut drawing, &view, geometry, 0.0);
    let dynamic: BTreeSet<u32> = run.placements.iter().filter_map(|placement| placement.best_dynamic).collect();
    let held: BTreeSet<u32> = run.placements.iter().map(|placement| placement.best_static).collect();
    for paddle in &geometry.paddles {
        let (class, number) = match paddle.index {
            index if dynamic.contains(&index) => ("paddle best", format!("{index}★")),
            index if held.contains(&index) => ("paddle", index.to_string()),
            index => ("paddle other", index.to_string()),
        };
        let [mut from, mut to] = paddle.segment;
        // Neighbours share a node: a gap shows where one ends.
        (from, to) = (along(from, sub(to, from), 0.1), along(to, sub(to, from), -0.1));
        drawing.line(class, view.at(from), view.at(to));
        let at = view.at(beside(geometry, view.extent, &paddle.segment));
        drawing.text("title halo", [at[0], at[1] + 4.5], Anchor::Middle, &number);
    }
    drawing.target(view.at(geometry.target));
    words(&mut drawing, &view, geometry);
    drawing
}

fn sub(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Names of the parts, where nothing else is drawn.
fn words(drawing: &mut Drawing, view: &PlaneView, geometry: &Geometry) {
    let mut names = Names::default();
    let closed = |path: Vec<Px>| -> Vec<Px> { path.iter().chain(path.first()).copied().collect() };
    let shapes = std::iter::once(&geometry.outline).chain(&geometry.inclusions);
    shapes.for_each(|shape| names.avoid(&closed(view.path(shape))));
    for [from, to] in geometry.immobile.iter().flat_map(|part| part.windows(2)).map(|pair| [pair[0], pair[1]]) {
        names.avoid(&view.path(&[from, to]));
        // Its strokes are outside.
        let outwards = sub(beside(geometry, view.extent, &[from, to]), middle(&[from, to]));
        names.avoid(&view.path(&[from, to].map(|end| along(end, outwards, STROKES))));
    }
    for paddle in &geometry.paddles {
        names.avoid(&view.path(&paddle.segment));
        names.avoid_around(view.at(beside(geometry, view.extent, &paddle.segment)), NUMBER);
    }
    let [outside, entry] = view.needle(geometry, 0.0);
    names.avoid(&view.path(&geometry.needle_contact));
    names.avoid(&[outside, entry]);
    let target = view.at(geometry.target);
    names.avoid_around(target, TARGET);
    names.add(target, "target", None);
    names.add(outside, "needle", None);
    let inclusion = geometry.inclusions.first().map(|inclusion| ("inclusion", middle(inclusion)));
    let immobile = geometry.immobile.first().map(|part| ("immobile", middle(part)));
    inclusion.into_iter().chain(immobile).for_each(|(name, at)| names.add(view.at(at), name, None));
    names.draw(drawing, [0.0; 2], view.size());
}

/// The nodes of a frame in a drawing, px, with their displacement from rest, px.
pub(super) fn displaced(view: &PlaneView, geometry: &Geometry, nodes: &[[f64; 2]]) -> Vec<(Px, f64)> {
    let rest = geometry.nodes.iter().map(|node| view.at(*node));
    nodes
        .iter()
        .zip(rest)
        .map(|(node, rest)| {
            let now = view.at(*node);
            (now, (now[0] - rest[0]).hypot(now[1] - rest[1]))
        })
        .collect()
}

/// Half a side of the window around the target, as a part of the scene's size.
const WINDOW: f64 = 0.18;

/// What all bodies of a page share.
#[derive(Debug)]
pub(super) struct Surface {
    pub(super) view: PlaneView,
    pub(super) triangles: Vec<[usize; 3]>,
    pub(super) boundary: Vec<usize>,
    /// Corners of every inclusion between the nodes, in order.
    pub(super) inclusions: Vec<Vec<Interpolated>>,
    /// Displacement at which the colours end, px.
    pub(super) largest: f64,
}

impl Surface {
    pub(super) fn new(run: &RunResult) -> Self {
        let view = PlaneView::new(run, BODY_WIDTH);
        let geometry = &run.geometry;
        let largest = run
            .results()
            .flat_map(|result| displaced(&view, geometry, &result.deformed_nodes))
            .map(|(_, displacement)| displacement)
            .filter(|displacement| displacement.is_finite())
            .fold(0.0, f64::max);
        let triangles = surface::triangles(&geometry.nodes, &geometry.outline);
        let between = |corner: &[f64; 2]| Interpolated::new(&geometry.nodes, &triangles, *corner);
        let rim = |inclusion: &Vec<[f64; 2]>| inclusion.iter().filter_map(between).collect();
        Self {
            inclusions: geometry.inclusions.iter().map(rim).collect(),
            triangles,
            boundary: super::view::boundary(geometry, view.extent),
            view,
            largest: largest.max(f64::MIN_POSITIVE),
        }
    }

    /// The body of this tissue at full depth: displacement field, outlines, needle, paddle, target.
    pub(super) fn body(
        &self,
        run: &RunResult,
        tissue: TissueVariant,
        (id, name): (String, &str),
        strategy: &StrategyResult,
    ) -> Drawing {
        let (view, geometry) = (&self.view, &run.geometry);
        let nodes = displaced(view, geometry, &strategy.deformed_nodes);
        let mut drawing = Drawing::new(view.size(), format!("Body at full depth: {name}"));
        drawing.id = id;
        drawing.open_group("field");
        for corners in &self.triangles {
            let corners: Vec<_> = corners.iter().filter_map(|corner| nodes.get(*corner)).collect();
            let displacement = corners.iter().map(|corner| corner.1).sum::<f64>() / corners.len().max(1) as f64;
            let points: Vec<Px> = corners.iter().map(|corner| corner.0).collect();
            drawing.polygon(&band(displacement / self.largest), &points);
        }
        drawing.close_group();
        drawing.polygon("rest", &view.path(&geometry.outline));
        let edge: Vec<Px> = self.boundary.iter().filter_map(|i| nodes.get(*i)).map(|node| node.0).collect();
        drawing.polygon("edge", &edge);
        if tissue == TissueVariant::Inclusion && nodes.len() == geometry.nodes.len() {
            let places: Vec<Px> = nodes.iter().map(|node| node.0).collect();
            for inclusion in &self.inclusions {
                let rim: Vec<Px> = inclusion.iter().map(|corner| corner.of(&places)).collect();
                drawing.polygon("lump", &rim);
            }
        }
        geometry.immobile.iter().for_each(|part| held(&mut drawing, view, geometry, part));
        needle(&mut drawing, view, geometry, run.settings.depth);
        let end = strategy.series.last();
        let moved = end.map_or([0.0; 2], |point| point.paddle);
        if let Some(paddle) = geometry.paddles.iter().find(|paddle| Some(paddle.index) == strategy.paddle) {
            let segment = paddle.segment.map(|point| view.at([point[0] + moved[0], point[1] + moved[1]]));
            drawing.open_group("tool");
            // As in the charts: orange is held still, blue is moved.
            drawing.line(if moved == [0.0; 2] { "paddle" } else { "paddle best" }, segment[0], segment[1]);
            let [x, y] = view.at(beside(geometry, view.extent, &paddle.segment));
            drawing.text("title halo", [x, y + 4.5], Anchor::Middle, &paddle.index.to_string());
            drawing.close_group();
        }
        let at = end.map_or(geometry.target, |point| {
            along(
                along(geometry.target, geometry.needle_axis, point.axial),
                geometry.orthogonal,
                point.orthogonal_error,
            )
        });
        drawing.target(view.at(at));
        drawing
    }

    /// What the colour can show: what the results have.
    pub(super) fn fields(run: &RunResult) -> Vec<ShownField> {
        let has = |of: fn(&BodyFrame) -> &Vec<f64>| {
            run.results().flat_map(|result| &result.frames).any(|frame| !of(frame).is_empty())
        };
        let (strain, stress) = (has(|frame| &frame.strain), has(|frame| &frame.von_mises));
        let is_there = |field: &Field| match field {
            Field::Size | Field::Orthogonal => true,
            Field::Strain => strain,
            Field::VonMises => stress,
        };
        let all = [Field::Size, Field::Orthogonal, Field::Strain, Field::VonMises];
        all.into_iter().filter(is_there).map(|field| ShownField::new(field, &run.units)).collect()
    }

    /// The window around the target: corner and size, px.
    pub(super) fn window(&self, geometry: &Geometry) -> [f64; 4] {
        let [x, y] = self.view.at(geometry.target);
        let half = self.view.length(WINDOW * self.view.extent);
        let [width, height] = self.view.size();
        [x - half, y - half * height / width, 2.0 * half, 2.0 * half * height / width]
    }

    /// The colours and what they mean.
    pub(super) fn colour_bar(&self, run: &RunResult) -> Drawing {
        let what = in_unit("size of the displacement", &run.units[0]);
        colour_bar(BODY_WIDTH, &what, self.largest / self.view.length(1.0))
    }
}

/// The strategies of a case side by side.
pub(super) fn bodies(run: &RunResult, surface: &Surface, case_number: usize, case: &CaseResult) -> Markup {
    html! {
        div.bodies {
            @for (strategy, result) in run.shown(case) {
                figure {
                    (inline(&surface.body(run, case.tissue, (body_id(case_number, strategy), strategy.title()), result)))
                    figcaption {
                        b { (strategy.title()) @if let Some(paddle) = result.paddle { ", paddle " (paddle) } }
                        " · " output id=(format!("{}-numbers", body_id(case_number, strategy))) {
                            "orthogonal error at the end "
                            (result.series.last().map_or_else(String::new, |point| number(point.orthogonal_error, 3)))
                        }
                    }
                }
            }
        }
    }
}

/// Identifier of a body in the page.
pub(super) fn body_id(case: usize, strategy: Strategy) -> String {
    format!("body{case}-{strategy}")
}
