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
    if rest.best_direction.is_none() || rest.jacobian.norm() < FAINTEST {
        return Some(Hindrance::Uncontrollable { condition });
    }
    if condition > CONDITION_LIMIT {
        return Some(Hindrance::IllConditioned { condition });
    }
    let drift = rest.target_per_depth.dot(&scene.needle.orthogonal()).abs() * scene.needle.depth;
    let (needed, available) = (drift * rest.controllability_measure, scene.actuator.max_displacement);
    (needed > available).then_some(Hindrance::OutOfReach { needed, available, condition })
}

/// The target follows a paddle that is of any use by more than this of its way: with less, it would go a metre where the target
/// moves by a millimetre, and what is computed of it is little more than what a mesh leaves.
const FAINTEST: f64 = 1e-3;

/// Whether a table can be made of a paddle, as far as its Jacobian at rest tells.
pub fn is_usable(rest: &RestResponse) -> bool {
    let is_felt = rest.jacobian.norm() >= FAINTEST;
    is_felt && rest.best_direction.is_some() && condition_number(&rest.jacobian) <= CONDITION_LIMIT
}

/// The place of the paddle that controls the target best: the smallest measure of those that [a table can be made
/// of](is_usable); where there is none, the smallest that is finite.
pub fn best_to_control<'r>(responses: impl IntoIterator<Item = &'r RestResponse>) -> Option<usize> {
    let all = responses.into_iter().enumerate();
    let finite = all.filter(|(_, rest)| rest.controllability_measure.is_finite());
    let rank = |rest: &RestResponse| (!is_usable(rest), rest.controllability_measure);
    let better = finite.min_by(|(_, a), (_, b)| {
        let ((a_not, a), (b_not, b)) = (rank(a), rank(b));
        a_not.cmp(&b_not).then(a.total_cmp(&b))
    });
    better.map(|(place, _)| place)
}

/// Whether no table can be made of a paddle whose Jacobian is within `open` of this one, in the Frobenius norm, whichever it
/// is: condition numbers ‖J‖·‖J⁻¹‖ are at least (‖J‖ − open) / (σ_min + open) there, and norms at most ‖J‖ + open.
pub(super) fn is_useless_within(rest: &RestResponse, open: f64) -> bool {
    let (least, norm) = (rest.jacobian.singular_values().min(), rest.jacobian.norm());
    (least + open) * CONDITION_LIMIT < norm - open || norm + open < FAINTEST
}

/// Whether a table can be made of a paddle whose Jacobian is within `open` of this one, in the Frobenius norm, whichever it is:
/// condition numbers grow with the ratio of the singular values, which move by no more than that.
pub(super) fn is_usable_within(rest: &RestResponse, open: f64) -> bool {
    let values = rest.jacobian.singular_values();
    let (most, least) = (values.max() + open, values.min() - open);
    rest.best_direction.is_some()
        && rest.jacobian.norm() - open >= FAINTEST
        && least > 0.0
        && most / least + least / most <= CONDITION_LIMIT
}

/// What is left open of a response, absolute but for the measure.
#[derive(Debug, Clone, Copy)]
pub(super) struct Open {
    /// Of the controllability measure, relative.
    pub measure: f64,
    /// Of the Jacobian, in the Frobenius norm.
    pub jacobian: f64,
    /// Of the target's displacement per depth.
    pub displacement: f64,
}

/// Whether a paddle cannot hold the target, whichever response it is within what is left open: the [measure](RestResponse) ‖J⁻¹n‖
/// is no more than ‖J⁻¹‖, so that a condition number is at least ‖J‖ times it.
pub(super) fn is_hindered_within(rest: &RestResponse, open: &Open, scene: &Scene) -> bool {
    let measure = rest.controllability_measure * (1.0 - open.measure);
    if !measure.is_finite() || measure <= 0.0 {
        return false;
    }
    let drift = rest.target_per_depth.dot(&scene.needle.orthogonal()).abs() - open.displacement;
    let is_ill_conditioned = (rest.jacobian.norm() - open.jacobian) * measure > CONDITION_LIMIT;
    is_ill_conditioned || drift * scene.needle.depth * measure > scene.actuator.max_displacement
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    /// Every Jacobian around one that is useless within a distance is useless; around others there is one that is not.
    #[test]
    fn what_is_useless_within_a_distance_is_so_all_over_it() {
        let of = |j: Matrix2<f64>| RestResponse::new(j, Vector2::zeros(), Vector2::y());
        let turned = nalgebra::Rotation2::new(0.4).into_inner();
        for least in [0.0, 1e-4, 5e-4, 9e-4, 1.1e-3] {
            let jacobian = turned * Matrix2::new(1.0, 0.0, 0.0, least);
            for open in [0.0, 5e-5, 2e-4, 6e-4, 2e-3] {
                // Towards the best that there is: what is smallest grows, along its own singular vectors.
                let best = turned * Matrix2::new(1.0, 0.0, 0.0, least + open);
                assert_eq!(is_useless_within(&of(jacobian), open), !is_usable(&of(best)), "{least} {open}");
            }
        }
        // Every Jacobian around one that is usable within a distance is usable, the worst of them just.
        for least in [9e-4, 1.1e-3, 2e-3, 0.5] {
            let jacobian = turned * Matrix2::new(1.0, 0.0, 0.0, least);
            for open in [0.0, 5e-5, 2e-4, 6e-4, 2e-3] {
                let worst = turned * Matrix2::new(1.0 + open, 0.0, 0.0, least - open);
                let expected = least > open && is_usable(&of(worst));
                assert_eq!(is_usable_within(&of(jacobian), open), expected, "{least} {open}");
            }
        }
        // What the target hardly follows is useless however well it is conditioned, if that is certain.
        for (size, open, expected) in [(0.0, 0.0, true), (6e-4, 0.0, true), (6e-4, 2e-4, false), (8e-4, 0.0, false)] {
            let faint = of(turned * size);
            assert_eq!(is_useless_within(&faint, open), expected, "{size} {open}");
            assert!(open > 0.0 || is_usable(&faint) != expected);
        }
    }

    #[test]
    fn what_a_table_can_be_made_of_is_better_than_what_is_nearer() {
        let scene = Scene::bundled("paper").unwrap();
        let [good, bad] = [10.0, 3.0 * CONDITION_LIMIT].map(|c| dragged(&scene, c));
        let near = RestResponse { controllability_measure: 0.5, ..bad };
        let none = RestResponse { best_direction: None, controllability_measure: f64::INFINITY, ..bad };
        assert_eq!(best_to_control(&[none, near, good]), Some(2));
        assert_eq!(best_to_control(&[none, bad, near]), Some(2));
        assert_eq!(best_to_control(&[none]), None);
        assert_eq!([good, bad, none].map(|rest| is_usable(&rest)), [true, false, false]);
    }

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
