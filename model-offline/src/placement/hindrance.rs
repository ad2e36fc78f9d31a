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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    /// A target that the needle drags along by 0.3 across its axis per depth, and a paddle that moves it by half of its own
    /// displacement across and by `1/condition` of that along.
    fn dragged(scene: &Scene, condition: f64) -> RestResponse {
        let (axis, across) = (scene.needle.axis, scene.needle.orthogonal());
        let jacobian: Matrix2<f64> = across * across.transpose() * 0.5 + axis * axis.transpose() * (0.5 / condition);
        RestResponse {
            jacobian,
            controllability_measure: 2.0,
            best_direction: Some(across * 2.0),
            target_per_depth: across * 0.3 + axis * 0.7,
        }
    }

    #[test]
    fn a_paddle_is_out_of_reach_from_where_its_actuator_ends() {
        let mut scene = Scene::bundled("paper").unwrap();
        let rest = dragged(&scene, 3.0);
        let expected = 0.3 * scene.needle.depth * 2.0;
        scene.actuator.max_displacement = expected * (1.0 + 1e-9);
        assert_eq!(hindrance(&rest, &scene), None);
        scene.actuator.max_displacement = expected * (1.0 - 1e-9);
        match hindrance(&rest, &scene) {
            Some(Hindrance::OutOfReach { needed, available, condition }) => {
                assert!((needed / expected - 1.0).abs() < 1e-12 && available == scene.actuator.max_displacement);
                // The Frobenius norm of singular values 1 and 1/3 against that of 1 and 3.
                assert!((condition - (3.0 + 1.0 / 3.0)).abs() < 1e-9);
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_cannot_be_controlled_is_told_before_what_is_far() {
        let mut scene = Scene::bundled("paper").unwrap();
        scene.actuator.max_displacement = 1e-9;
        let nearly = dragged(&scene, 1.01 * CONDITION_LIMIT);
        assert!(matches!(hindrance(&nearly, &scene), Some(Hindrance::IllConditioned { .. })));
        let enough = dragged(&scene, 0.99 * CONDITION_LIMIT);
        assert!(matches!(hindrance(&enough, &scene), Some(Hindrance::OutOfReach { .. })));
        let not = RestResponse { best_direction: None, target_per_depth: Vector2::zeros(), ..nearly };
        assert!(matches!(hindrance(&not, &scene), Some(Hindrance::Uncontrollable { .. })));
    }
}
