//! Whether a paddle can hold the target at all, in words.

use super::study::{PaddleResult, Placement};
use crate::scene::Scene;
use firmware::contract::CONDITION_LIMIT;
use nalgebra::Vector2;

/// Why a paddle cannot hold the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hindrance {
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
pub fn hindrance(paddle: &PaddleResult, scene: &Scene) -> Option<Hindrance> {
    let condition = paddle.condition;
    if condition > CONDITION_LIMIT {
        return Some(Hindrance::IllConditioned { condition });
    }
    let drift = Vector2::from(paddle.target_per_depth).dot(&scene.needle.orthogonal()).abs() * scene.needle.depth;
    let (needed, available) = (drift * paddle.controllability_measure, scene.actuator.max_displacement);
    (needed > available).then_some(Hindrance::OutOfReach { needed, available, condition })
}

/// Lines for people about paddles that cannot hold the target; empty when all can.
pub fn verdict(placement: &Placement, scene: &Scene) -> Vec<String> {
    let hindered: Vec<_> = placement.paddles.iter().filter_map(|p| Some((p.index, hindrance(p, scene)?))).collect();
    let mut lines: Vec<String> = hindered
        .iter()
        .map(|(index, hindrance)| match hindrance {
            Hindrance::IllConditioned { condition } => format!(
                "paddle {index} cannot hold the target: its Jacobian is ill-conditioned \
                 (condition number {condition:.3e}, limit {CONDITION_LIMIT:.0e})"
            ),
            Hindrance::OutOfReach { needed, available, condition } => format!(
                "paddle {index} cannot hold the target: that takes {needed:.4} of paddle displacement, the actuator \
                 has {available:.4} (condition number of its Jacobian {condition:.3e})"
            ),
        })
        .collect();
    if hindered.len() == placement.paddles.len() {
        lines.push("no paddle of this scene can: move a paddle, turn the needle, or accept a static one".to_owned());
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TissueModel;
    use crate::placement::{PlacementOptions, place};

    fn lines(name: &str) -> Vec<String> {
        let scene = Scene::bundled(name).unwrap();
        let model = TissueModel::new(&scene).unwrap();
        verdict(&place(&model, &PlacementOptions::default()).unwrap(), &scene)
    }

    #[test]
    fn a_target_that_swings_on_a_stiff_band_cannot_be_held_and_the_papers_can() {
        let tethered = lines("tethered");
        assert_eq!(tethered.len(), 4, "{tethered:#?}");
        assert!(tethered[..3].iter().all(|line| line.contains("ill-conditioned")), "{tethered:#?}");
        assert!(tethered[3].starts_with("no paddle"), "{tethered:#?}");
        assert_eq!(lines("paper"), Vec::<String>::new());
        assert_eq!(lines("prostate"), Vec::<String>::new());
    }
}
