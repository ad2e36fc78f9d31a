//! The plane of a slice: along the needle and through the target.

use super::SliceError;
use crate::geometry::{Implicit as _, Point, Solid};
use crate::model::space::survey::Survey;
use crate::output::space_picture::CutPlane;
use crate::scene::space::SpaceScene;
use nalgebra::Vector3;
use serde::Serialize;

/// The target is on the needle's line if it is no farther from it than this part of the contact's width.
const ON_LINE: f64 = 0.25;
/// A direction shorter than this part of the body's size is none.
const NO_DIRECTION: f64 = 1e-6;
/// A part of a unit vector that rounding leaves.
const ROUNDING: f64 = 1e-9;
/// The plane holds a coordinate's direction if that much of it is left in the plane.
const UPRIGHT: f64 = 0.1;

/// What fixes a plane that holds the needle's direction and the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Through {
    /// The needle's line, which the target is beside.
    NeedleBesideTarget,
    /// The middle of a paddle, by its index: the target is on the needle's line, about which the plane is free to turn.
    Paddle(u32),
}

/// Planes that a slice may lie in.
pub(super) struct Planes<'a> {
    scene: &'a SpaceScene,
    survey: &'a Survey,
}

impl<'a> Planes<'a> {
    pub(super) fn new(scene: &'a SpaceScene, survey: &'a Survey) -> Self {
        Self { scene, survey }
    }

    /// The one plane where the target is beside the needle's line, else one through each paddle that is beside it.
    pub(super) fn all(&self) -> Vec<(Through, CutPlane)> {
        if !self.is_free() {
            let entry = Point::from(self.survey.needle.contact.middle);
            return self.along(&entry).map(|plane| (Through::NeedleBesideTarget, plane)).into_iter().collect();
        }
        let through = |paddle: &_| self.through(paddle).map(|plane| (Through::Paddle(*paddle), plane));
        self.survey.paddles.iter().filter_map(|paddle| through(&paddle.index)).collect()
    }

    /// The one through a paddle.
    pub(super) fn of_paddle(&self, paddle: u32) -> Result<(Through, CutPlane), SliceError> {
        self.scene.paddle_position(paddle)?;
        if !self.is_free() {
            let off = self.survey.target.off_needle;
            return Err(SliceError::NotFree { off, unit: self.scene.length_unit.clone() });
        }
        let plane = self.through(&paddle).ok_or(SliceError::OnLine { paddle })?;
        Ok((Through::Paddle(paddle), plane))
    }

    fn is_free(&self) -> bool {
        self.survey.target.off_needle <= ON_LINE * self.survey.needle.contact.area.sqrt()
    }

    fn through(&self, paddle: &u32) -> Option<CutPlane> {
        let place = self.scene.paddle_position(*paddle).ok()?;
        // Where a region says its own middle, that is free of what a mesh adds.
        let middle = match &self.scene.paddles[place].region {
            region @ (Solid::Box { .. } | Solid::Sphere { .. } | Solid::Ellipsoid { .. }) => region.bounds(),
            _ => None,
        };
        let of_mesh = || Point::from(self.survey.paddles[place].patch.middle);
        self.along(&middle.map_or_else(of_mesh, |(low, high)| low.lerp(&high, 0.5)))
    }

    /// Along the needle, through the target and a point beside it.
    fn along(&self, point: &Point<3>) -> Option<CutPlane> {
        let (axis, target) = (self.scene.needle.axis, self.scene.target);
        let beside = point - target;
        let beside = beside - axis * axis.dot(&beside);
        let normal = axis.cross(&beside.try_normalize(NO_DIRECTION * self.scene.size())?);
        // Digits that rounding leaves would make oblique what is along a coordinate.
        let normal = normal.map(|part| if part.abs() < ROUNDING { 0.0 } else { part }).normalize();
        let normal = largest_positive(normal);
        let within = |v: Vector3<f64>| (v - normal * normal.dot(&v)).try_normalize(UPRIGHT);
        let up = within(Vector3::z()).or_else(|| within(Vector3::y()))?;
        let right = largest_positive(up.cross(&normal));
        Some(CutPlane { normal, offset: normal.dot(&target), directions: [right, up], across_needle: false })
    }
}

fn largest_positive(v: Vector3<f64>) -> Vector3<f64> {
    // Adding zero turns a negative zero into a positive one.
    let v = if v[v.iamax()] < 0.0 { -v } else { v };
    v.add_scalar(0.0)
}
