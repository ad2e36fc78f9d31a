//! The body drawn: cells in their deformed place, coloured by strain, with needle, paddles and target.

use super::chart::number::plain;
use super::chart::style::band;
use super::chart::{Drawing, Marker, Plane, Px, colour_bar, heading, sheet};
use super::state::{State, cell_gradients};
use crate::geometry::Point2;
use crate::material::green_lagrange;
use crate::model::TissueModel;

/// Width of the picture, and room around the body as a part of its size.
const WIDTH: f64 = 640.0;
const MARGIN: f64 = 0.06;
/// Part of the margin that is left beside a body that has moved into it.
const BESIDE: f64 = 0.3;

/// A picture of a body, self-contained.
pub fn svg(model: &TissueModel, state: State<'_>) -> String {
    let State { coefficients, depth, within } = state;
    let strains: Vec<f64> = cell_gradients(model, coefficients).iter().map(|h| green_lagrange(h).norm()).collect();
    let largest = strains.iter().copied().fold(1e-12, f64::max);
    let picture = Picture::new(model, coefficients);
    let mut drawing = Drawing::new(picture.plane.size, String::new());
    drawing.open_group("field");
    for (cell, strain) in model.cells().iter().zip(&strains) {
        drawing.polygon(&band(strain / largest), &picture.moved(&cell.corners()));
    }
    drawing.close_group();
    picture.parts(&mut drawing);
    if within {
        picture.shaft(&mut drawing, depth);
    } else {
        drawing.polyline("contact", &picture.moved(&model.scene().needle.contact));
    }
    let width = drawing.size[0].max(300.0);
    let bar = colour_bar(width, "Green–Lagrange strain ‖E‖", largest);
    let title = format!("{} at depth {}: largest strain {}", model.scene().name, plain(depth), plain(largest));
    let caption =
        "Grey: needle; blue: paddles; black: immobile; dashed: outline at rest; ring: target at rest, dot: now.";
    let heading = heading(&title, caption, width);
    sheet(&title, &[heading, drawing, bar], 1).file()
}

/// The scene on paper, deformed.
struct Picture<'a> {
    model: &'a TissueModel,
    coefficients: &'a [f64],
    plane: Plane,
}

impl<'a> Picture<'a> {
    fn new(model: &'a TissueModel, coefficients: &'a [f64]) -> Self {
        let (low, high) = model.scene().outline.bounds();
        let margin = MARGIN * (high - low).max();
        let (mut low, mut high) = (low.add_scalar(-margin), high.add_scalar(margin));
        // A body that leaves its place takes the picture with it.
        for x in model.positions() {
            let now = x + model.displacement_at(x, coefficients);
            (low, high) = (low.inf(&now.add_scalar(-BESIDE * margin)), high.sup(&now.add_scalar(BESIDE * margin)));
        }
        let plane = Plane::new([low.x, low.y], [high.x, high.y], WIDTH);
        Self { model, coefficients, plane }
    }

    fn rest(&self, points: &[Point2]) -> Vec<Px> {
        points.iter().map(|x| self.plane.at([x.x, x.y])).collect()
    }

    fn moved(&self, points: &[Point2]) -> Vec<Px> {
        let moved = |x: &Point2| x + self.model.displacement_at(x, self.coefficients);
        self.rest(&points.iter().map(moved).collect::<Vec<_>>())
    }

    /// The needle in its place, a little of it outside.
    fn shaft(&self, drawing: &mut Drawing, depth: f64) {
        let needle = &self.model.scene().needle;
        if let Some(shaft) = &needle.shaft {
            let outside = 0.3 * needle.depth;
            drawing.polyline(
                "contact",
                &self.rest(&[shaft.entry - needle.axis * outside, shaft.entry + needle.axis * depth]),
            );
        }
    }

    /// Outline at rest, immobile boundary, inclusions, paddles, target.
    fn parts(&self, drawing: &mut Drawing) {
        let scene = self.model.scene();
        drawing.polygon("rest", &self.rest(scene.outline.vertices()));
        scene.immobile.iter().for_each(|part| drawing.polyline("immobile", &self.rest(part)));
        for inclusion in &scene.inclusions {
            drawing.polygon("rim", &self.moved(inclusion.outline.vertices()));
        }
        scene.paddles.iter().for_each(|paddle| drawing.polyline("paddle best", &self.moved(&paddle.segment)));
        let [rest, now] = [self.rest(&[scene.target])[0], self.moved(&[scene.target])[0]];
        drawing.circle("under", rest, 6.0);
        drawing.circle("target", rest, 6.0);
        drawing.marker(Marker::Circle, "dot", now);
    }
}
