//! Numbers of a discretization that no scene is modelled with.

use crate::discretization::nodes::graded::{MAX_LEVEL, MIN_LEVEL};
use crate::discretization::{Discretization, Integration, Resolution};
use crate::geometry::{Point, Polygon};
use crate::number;

/// More nodes than this are refused before any memory is taken.
const MAX_NODES: f64 = 2.0e6;

/// A number that a discretization cannot have.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LimitError {
    /// A spacing that is no length.
    #[error("spacing is {0}")]
    Spacing(f64),
    /// Not even one row of nodes.
    #[error("spacing {spacing} is too coarse for a body of size {size:.4}")]
    TooCoarse {
        /// Spacing asked for, length units.
        spacing: f64,
        /// Diagonal of the body's bounding box, length units.
        size: f64,
    },
    /// More nodes than memory is meant for.
    #[error("spacing {spacing} would give about {nodes:.1e} nodes, at most {MAX_NODES:.0e} are accepted")]
    TooManyNodes {
        /// Spacing asked for, length units.
        spacing: f64,
        /// Nodes it would give, about.
        nodes: f64,
    },
    /// A tolerance that no refinement is asked for.
    #[error("tolerance is {0}")]
    Tolerance(f64),
    /// A refinement level that there is not.
    #[error("level is {0}")]
    Level(i32),
    /// A kernel support that does not work.
    #[error("support is {0}")]
    Support(f64),
    /// A limit of a paddle or of the needle that has another unit than the depth, or none.
    #[error("{what}: {} has another unit than a needle that goes {} deep", number::short(*.value), number::short(*.depth))]
    OtherUnit {
        /// Which.
        what: &'static str,
        /// What it is, length units, or those per second.
        value: f64,
        /// Depth of the needle, length units.
        depth: f64,
    },
    /// A rule that is not there in the plane.
    #[error("integration {0} is one of space, and this scene is planar")]
    Spatial(Integration),
    /// A rule that is not there in space.
    #[error("integration {0} is planar, and this scene is in space")]
    Planar(Integration),
}

impl LimitError {
    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::Spacing(_) => "spacing must be a positive finite number".to_owned(),
            Self::TooCoarse { .. } => "choose a spacing well below the size of the body".to_owned(),
            Self::TooManyNodes { .. } => "choose a larger spacing, or a tolerance".to_owned(),
            Self::Tolerance(_) => "give a relative error between 0.0001 and 0.5".to_owned(),
            Self::Level(_) => format!("give a refinement level between {MIN_LEVEL} and {MAX_LEVEL}"),
            Self::Support(_) => "give a kernel support between 1 and 6 spacings; 2 is usual".to_owned(),
            Self::OtherUnit { what, depth, .. } => {
                let [least, most] = [depth / OTHER_UNIT, depth * OTHER_UNIT].map(number::short);
                format!("give {what} in the scene's units, from {least} to {most}, or leave it out")
            }
            Self::Planar(_) => {
                let known: Vec<&str> = Integration::SPATIAL.iter().map(|i| i.name()).collect();
                format!("take one of {}", known.join(", "))
            }
            Self::Spatial(_) => "take fem-t3 or fem-t6 in the plane".to_owned(),
        }
    }
}

/// Whether a body can be discretized so.
///
/// # Errors
/// [`LimitError`], the first number that is out of its range.
pub fn check(discretization: &Discretization, outline: &Polygon) -> Result<(), LimitError> {
    check_resolution(discretization.resolution, outline)?;
    check_planar(discretization.method.integration)?;
    check_support(discretization.method.support)
}

/// Whether a body can have nodes at this resolution.
pub(super) fn check_resolution(resolution: Resolution, outline: &Polygon) -> Result<(), LimitError> {
    match resolution {
        Resolution::Spacing(h) => check_spacing(h, outline),
        Resolution::Tolerance(t) => check_tolerance(t),
        Resolution::Level(level) if (MIN_LEVEL..=MAX_LEVEL).contains(&level) => Ok(()),
        Resolution::Level(level) => Err(LimitError::Level(level)),
    }
}

fn check_spacing(h: f64, outline: &Polygon) -> Result<(), LimitError> {
    if !(h.is_finite() && h > 0.0) {
        return Err(LimitError::Spacing(h));
    }
    if h > 0.5 * outline.size() {
        return Err(LimitError::TooCoarse { spacing: h, size: outline.size() });
    }
    let nodes = outline.area() / (h * h);
    if nodes > MAX_NODES {
        return Err(LimitError::TooManyNodes { spacing: h, nodes });
    }
    Ok(())
}

/// Limits of paddles and needle that are so many times the depth, or less than its so manieth part, have another unit.
const OTHER_UNIT: f64 = 1e9;

/// Whether a limit of a paddle or of the needle, length units or those per second, is one of this scene.
///
/// # Errors
/// [`LimitError::OtherUnit`].
pub(super) fn check_actuator(what: &'static str, value: f64, depth: f64) -> Result<f64, LimitError> {
    if (depth / OTHER_UNIT..=depth * OTHER_UNIT).contains(&value) {
        Ok(value)
    } else {
        Err(LimitError::OtherUnit { what, value, depth })
    }
}

/// More cells than this are refused before any memory is taken.
const MOST_CELLS: f64 = 2e7;

/// Whether a body in space whose bounding box has these sides can be discretized so.
///
/// # Errors
/// [`LimitError`], the first number that is out of its range.
pub fn check_in_space(discretization: &Discretization, extent: Point<3>) -> Result<(), LimitError> {
    match discretization.resolution {
        Resolution::Spacing(h) if !(h.is_finite() && h > 0.0) => return Err(LimitError::Spacing(h)),
        Resolution::Spacing(h) if h > 0.5 * extent.norm() => {
            return Err(LimitError::TooCoarse { spacing: h, size: extent.norm() });
        }
        Resolution::Spacing(h) => {
            let nodes = extent.iter().map(|side| side / h).product::<f64>();
            if nodes > MOST_CELLS {
                return Err(LimitError::TooManyNodes { spacing: h, nodes });
            }
        }
        Resolution::Tolerance(t) => check_tolerance(t)?,
        Resolution::Level(level) if (MIN_LEVEL..=MAX_LEVEL).contains(&level) => {}
        Resolution::Level(level) => return Err(LimitError::Level(level)),
    }
    let integration = discretization.method.integration;
    if !Integration::SPATIAL.contains(&integration) {
        return Err(LimitError::Planar(integration));
    }
    check_support(discretization.method.support)
}

/// Whether a tolerance can be asked for.
///
/// # Errors
/// [`LimitError::Tolerance`].
pub fn check_tolerance(t: f64) -> Result<(), LimitError> {
    if (1e-4..=0.5).contains(&t) { Ok(()) } else { Err(LimitError::Tolerance(t)) }
}

/// Whether a rule is there in the plane.
pub(super) fn check_planar(integration: Integration) -> Result<(), LimitError> {
    if Integration::PLANAR.contains(&integration) { Ok(()) } else { Err(LimitError::Spatial(integration)) }
}

/// Whether a kernel support can be used.
pub(super) fn check_support(support: f64) -> Result<(), LimitError> {
    if (1.0..=6.0).contains(&support) { Ok(()) } else { Err(LimitError::Support(support)) }
}
