//! What an attack found: one file per row, the class behind it by generated histories.

mod adoption;
mod clock;
mod frozen;
mod proportions;
mod sequences;
mod too_often;

use proptest::prelude::*;

use super::*;
use crate::contract::{Field, NeedleSample, PaddleSample};
use crate::detection::FOLLOWING_FRACTION;

/// Largest paddle displacement, rate per second, and depth range of the table.
const RANGE: f64 = 0.05;
const RATE: f64 = 0.1;
const DEPTH: f64 = 0.1;
/// What the paddle's sensor resolves: a tenth of the following error.
const RESOLUTION: f64 = 0.1 * FOLLOWING_FRACTION * RANGE;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (Vector2::from(a) - Vector2::from(b)).norm()
}
