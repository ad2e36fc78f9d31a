//! What is beside the body in the same picture: needle, target, immobile boundary, paddles.

use super::grid::{Array, Grid, Shape, in_three};
use super::in_unit;
use crate::geometry::{Point, Point2};
use crate::model::TissueModel;
use crate::output::space_picture::{SpaceGeometry, SpaceState};
use crate::output::state::State;

/// A part's number in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Needle = 1,
    Target = 2,
    Immobile = 3,
    Paddle = 4,
}

/// How much of a needle is drawn outside of the body, part of its depth; of the body's diagonal in space.
const OUTSIDE: f64 = 0.3;

/// Needle, target, immobile boundary and paddles as a VTU file of lines and points, at rest and with their displacement, as
/// the body has it: what warps the body by its displacement warps them too. Per cell `part` (1: needle, 2: target, 3:
/// immobile, 4: paddle) and `paddle`, its index (0: none).
pub fn parts(model: &TissueModel, state: State<'_>) -> String {
    let scene = model.scene();
    let with_tissue = |points: &[Point2]| points.iter().map(|x| model.displacement_at(x, state.coefficients)).collect();
    let mut file = Parts::default();
    let needle = (Part::Needle, 0, Shape::PolyLine);
    match &scene.needle.shaft {
        Some(shaft) if state.within => {
            let way = scene.needle.axis * state.depth;
            file.push(needle, &[shaft.entry - way * (1.0 + OUTSIDE), shaft.entry], vec![way; 2]);
        }
        _ => file.push(needle, &scene.needle.contact, with_tissue(&scene.needle.contact)),
    }
    let mut push = |cell, points: &[Point2]| file.push(cell, points, with_tissue(points));
    push((Part::Target, 0, Shape::Vertex), &[scene.target]);
    for path in &scene.immobile {
        push((Part::Immobile, 0, Shape::PolyLine), path);
    }
    for paddle in &scene.paddles {
        push((Part::Paddle, paddle.index, Shape::PolyLine), &paddle.segment);
    }
    file.written(&scene.length_unit)
}

/// The same of a body in space: the needle is a line from outside to the middle of its contact, which is of triangles, as are the
/// immobile part and all of the scene's paddles.
pub fn parts_in_space(geometry: &SpaceGeometry, state: &SpaceState) -> String {
    let mut file = Parts::default();
    let patches = geometry.paddles.iter().map(|paddle| (Part::Paddle, paddle.index, &paddle.triangles));
    let patches = patches.chain([(Part::Immobile, 0, &geometry.immobile), (Part::Needle, 0, &geometry.needle)]);
    for (part, paddle, triangles) in patches {
        for corners in triangles {
            let points = corners.map(|node| Point::from(geometry.nodes[node as usize]));
            let moved = corners.map(|node| Point::from(state.displacements[node as usize]));
            file.push((part, paddle, Shape::Triangle), &points, moved.to_vec());
        }
    }
    let (axis, tip) = (Point::from(geometry.axis), geometry.middle(&geometry.needle));
    let far = tip - axis * (OUTSIDE * geometry.extent());
    file.push((Part::Needle, 0, Shape::PolyLine), &[far, tip], vec![axis * state.depth; 2]);
    file.push((Part::Target, 0, Shape::Vertex), &[geometry.target.into()], vec![state.target.into()]);
    file.written(&geometry.units[0])
}

/// Cells with points of their own, and how far those have moved.
#[derive(Default)]
struct Parts<const D: usize> {
    grid: Grid<D>,
    moved: Vec<Point<D>>,
    part: Vec<f64>,
    paddle: Vec<f64>,
}

impl<const D: usize> Parts<D> {
    fn push(&mut self, (part, paddle, shape): (Part, u32, Shape), points: &[Point<D>], moved: Vec<Point<D>>) {
        self.grid.push_alone(shape, points);
        self.moved.extend(moved);
        self.part.push(part as u32 as f64);
        self.paddle.push(f64::from(paddle));
    }

    fn written(self, unit: &str) -> String {
        let moved = self.moved.iter().flat_map(in_three).collect();
        let displacement = Array::new(in_unit("displacement", unit), 3, moved);
        self.grid.file(&[displacement], &[Array::counts("part", self.part), Array::counts("paddle", self.paddle)])
    }
}
