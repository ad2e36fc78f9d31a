//! What is beside the body in the same picture: needle, target, immobile boundary, paddles.

use super::grid::{Array, Grid, Shape};
use super::in_unit;
use crate::geometry::Point2;
use crate::model::TissueModel;
use crate::output::state::State;

/// A part's number in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Needle = 1,
    Target = 2,
    Immobile = 3,
    Paddle = 4,
}

/// How much of a needle is drawn outside of the body, part of its depth.
const OUTSIDE: f64 = 0.3;

/// Needle, target, immobile boundary and paddles as a VTU file of lines and points, at rest and with their displacement, as
/// the body has it: what warps the body by its displacement warps them too. Per cell `part` (1: needle, 2: target, 3:
/// immobile, 4: paddle) and `paddle`, its index (0: none).
pub fn parts(model: &TissueModel, state: State<'_>) -> String {
    let scene = model.scene();
    let mut file =
        Parts { model, state, grid: Grid::default(), moved: Vec::new(), part: Vec::new(), paddle: Vec::new() };
    match &scene.needle.shaft {
        Some(shaft) if state.within => {
            let way = scene.needle.axis * state.depth;
            file.rigid(&[shaft.entry - way * (1.0 + OUTSIDE), shaft.entry], way);
        }
        _ => file.with_tissue(Part::Needle, 0, Shape::PolyLine, &scene.needle.contact),
    }
    file.with_tissue(Part::Target, 0, Shape::Vertex, &[scene.target]);
    for path in &scene.immobile {
        file.with_tissue(Part::Immobile, 0, Shape::PolyLine, path);
    }
    for paddle in &scene.paddles {
        file.with_tissue(Part::Paddle, paddle.index, Shape::PolyLine, &paddle.segment);
    }
    let displacement = Array::new(in_unit("displacement", &scene.length_unit), 3, file.moved);
    file.grid.file(&[displacement], &[Array::counts("part", file.part), Array::counts("paddle", file.paddle)])
}

struct Parts<'a> {
    model: &'a TissueModel,
    state: State<'a>,
    grid: Grid<2>,
    moved: Vec<f64>,
    part: Vec<f64>,
    paddle: Vec<f64>,
}

impl Parts<'_> {
    fn with_tissue(&mut self, part: Part, paddle: u32, shape: Shape, points: &[Point2]) {
        self.push((part, paddle, shape), points);
        for x in points {
            let u = self.model.displacement_at(x, self.state.coefficients);
            self.moved.extend([u.x, u.y, 0.0]);
        }
    }

    fn rigid(&mut self, points: &[Point2], way: Point2) {
        self.push((Part::Needle, 0, Shape::PolyLine), points);
        self.moved.extend(points.iter().flat_map(|_| [way.x, way.y, 0.0]));
    }

    fn push(&mut self, (part, paddle, shape): (Part, u32, Shape), points: &[Point2]) {
        self.grid.push_alone(shape, points);
        self.part.push(part as u32 as f64);
        self.paddle.push(f64::from(paddle));
    }
}
