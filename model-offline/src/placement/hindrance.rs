//! What keeps a paddle from holding the target, by the linearisation at rest.

use super::rest::RestResponse;
use crate::scene::Scene;
use firmware::contract::{CONDITION_LIMIT, condition_number};
use serde::Serialize;

/// Why a paddle cannot hold the target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
pub enum Hindrance {
    /// The target does not answer to the paddle in every direction, or hardly at all: there is no J⁻¹n.
    Uncontrollable {
        /// Condition number of the Jacobian.
        condition: f64,
    },
    /// The actuation Jacobian is too nearly singular: whatever the paddle does moves the target in one direction.
    IllConditioned {
        /// Its condition number.
        condition: f64,
    },
    /// The paddle would have to go farther than its actuator can, by the linearisation at rest.
    OutOfReach {
        /// Paddle displacement it takes at full depth, length units.
        needed: f64,
        /// Paddle displacement there is, length units.
        available: f64,
        /// Condition number of the Jacobian.
        condition: f64,
    },
}

/// What keeps a paddle from holding the target; none when nothing does.
pub fn hindrance(rest: &RestResponse, scene: &Scene) -> Option<Hindrance> {
    let condition = condition_number(&rest.jacobian);
    if rest.best_direction.is_none() {
        return Some(Hindrance::Uncontrollable { condition });
    }
    if condition > CONDITION_LIMIT {
        return Some(Hindrance::IllConditioned { condition });
    }
    let drift = rest.target_per_depth.dot(&scene.needle.orthogonal()).abs() * scene.needle.depth;
    let (needed, available) = (drift * rest.controllability_measure, scene.actuator.max_displacement);
    (needed > available).then_some(Hindrance::OutOfReach { needed, available, condition })
}
