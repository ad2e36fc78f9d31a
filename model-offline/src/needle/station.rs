//! Material points along a cut.

use super::path::hat_integrals;
use crate::discretization::Stencil;
use crate::geometry::Point2;
use crate::scene::Resistance;
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Whether tissue sticks to the shaft, or in which direction the needle slides past it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Slide {
    Sticks,
    Forward,
    Backward,
}

/// A material point along the cut.
#[derive(Debug, Clone)]
pub(super) struct Station {
    pub(super) arc_length: f64,
    pub(super) stencil: Stencil<2>,
    pub(super) at: Point2,
    pub(super) resistance: Resistance,
    pub(super) slide: Slide,
    /// Whether it has been held to the shaft before, so that sticking means something.
    pub(super) known: bool,
    /// Whether it has taken over from the tip in this increment, and slides as that did: the forces along the shaft are
    /// divided anew, which moves the tissue by more than the needle goes and says nothing about sticking.
    pub(super) takes_over: bool,
    /// Forces across and along the needle on the tissue.
    pub(super) across: f64,
    pub(super) along: f64,
    /// Length of shaft that it stands for.
    pub(super) length: f64,
    /// Displacement along the axis.
    pub(super) axial: f64,
    /// How far the needle has slid past it.
    pub(super) slip: f64,
    /// Responses of the coefficients to unit forces across and along.
    pub(super) responses: Option<Arc<[Vec<f64>; 2]>>,
}

/// What the shaft does at a station.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StationState {
    /// Length of cut behind it, from the entry.
    pub arc_length: f64,
    /// How far the needle has slid past it.
    pub slip: f64,
    /// Friction on the tissue per length, positive along the insertion.
    pub friction: f64,
    /// Force on the tissue per length, positive along [`Needle::orthogonal`](crate::scene::Needle::orthogonal).
    pub normal: f64,
}

/// Adds a force at a point to loads, two numbers per node.
pub(super) fn add_force(stencil: &Stencil<2>, force: Vector2<f64>, out: &mut [f64]) {
    for (&i, value) in stencil.nodes.iter().zip(&stencil.values) {
        out[2 * i as usize] += value * force.x;
        out[2 * i as usize + 1] += value * force.y;
    }
}

/// Shares of the tip's force, spread evenly over a length behind it.
pub(super) fn spread(places: &[f64], engaged: f64, tip_length: f64) -> Vec<f64> {
    let length = tip_length.min(engaged);
    if length <= 0.0 {
        let mut shares = vec![0.0; places.len()];
        if let Some(last) = shares.last_mut() {
            *last = 1.0;
        }
        return shares;
    }
    hat_integrals(places, engaged - length, engaged).into_iter().map(|share| share / length).collect()
}
