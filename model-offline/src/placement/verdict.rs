//! Whether a paddle can hold the target at all, in words.

use super::hindrance::Hindrance;
use super::study::Placement;
use crate::number::length;
use firmware::contract::CONDITION_LIMIT;

/// Lines for people about paddles that cannot hold the target; empty when all can.
pub fn verdict(placement: &Placement) -> Vec<String> {
    let hindered: Vec<_> = placement.paddles.iter().filter_map(|p| Some((p.index, p.hindrance?))).collect();
    let mut lines: Vec<String> = hindered
        .iter()
        .map(|(index, hindrance)| match hindrance {
            Hindrance::Uncontrollable { condition } => format!(
                "paddle {index} cannot control the target: whatever it does moves the target along one line or hardly at \
                 all (condition number of its Jacobian {condition:.1e}); put it elsewhere, or use it static"
            ),
            Hindrance::IllConditioned { condition } => format!(
                "paddle {index} cannot hold the target: its Jacobian is ill-conditioned \
                 (condition number {condition:.3e}, limit {CONDITION_LIMIT:.0e})"
            ),
            Hindrance::OutOfReach { needed, available, condition } => format!(
                "paddle {index} cannot hold the target: that takes {} of paddle displacement, the actuator has {} \
                 (condition number of its Jacobian {condition:.3e})",
                length(*needed),
                length(*available)
            ),
        })
        .collect();
    if hindered.len() == placement.paddles.len() {
        lines.push("no paddle of this scene can: move a paddle, turn the needle, or accept a static one".to_owned());
    }
    lines.extend(static_paddles_no_better_than_none(placement));
    lines
}

/// Says so where even the best static paddle moves the target more than no paddle does.
fn static_paddles_no_better_than_none(placement: &Placement) -> Option<String> {
    let best = placement.paddles.iter().find(|p| p.index == placement.optimum.static_paddle)?;
    let none = &placement.no_paddle.static_study;
    if none.depth.last().is_some_and(|depth| stays_on_the_line(none.max_orthogonal, *depth)) {
        return Some(format!("no static paddle helps: {ON_ITS_LINE}"));
    }
    let factor = best.static_over_no_paddle.filter(|factor| *factor > 1.0)?;
    let best = format!("the best one, {}, moves the target", best.index);
    Some(format!("no static paddle helps: {}", times_as_far(&best, factor)))
}

/// What is said where a paddle has nothing to hold.
pub const ON_ITS_LINE: &str = "without one the target does not leave the needle's line";

/// Part of its depth to which rounding moves the target off the line of a needle that pushes it along that line.
const ON_THE_LINE: f64 = 1e-10;

/// Whether a needle that goes so deep leaves the target on its line, but for rounding.
pub fn stays_on_the_line(largest_orthogonal: f64, depth: f64) -> bool {
    largest_orthogonal <= ON_THE_LINE * depth
}

/// Factors beyond this hold a displacement against what rounding leaves of none.
pub const AGAINST_NOTHING: f64 = 1e6;

/// "What it does" so many times as far as no paddle does, in words.
pub fn times_as_far(what_it_does: &str, factor: f64) -> String {
    if factor > AGAINST_NOTHING {
        return ON_ITS_LINE.to_owned();
    }
    format!("{what_it_does} {factor:.2} times as far as no paddle does")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TissueModel;
    use crate::placement::{PlacementOptions, place};
    use crate::scene::Scene;

    fn lines(name: &str) -> Vec<String> {
        let scene = Scene::bundled(name).unwrap();
        let model = TissueModel::new(&scene).unwrap();
        verdict(&place(&model, &PlacementOptions::default()).unwrap())
    }

    #[test]
    fn a_target_that_swings_on_a_stiff_band_cannot_be_held_and_the_papers_can() {
        let tethered = lines("tethered");
        assert_eq!(tethered.len(), 4, "{tethered:#?}");
        assert!(tethered[..3].iter().all(|line| line.contains("ill-conditioned")), "{tethered:#?}");
        assert!(tethered[3].starts_with("no paddle"), "{tethered:#?}");
        assert_eq!(lines("paper"), Vec::<String>::new());
        assert_eq!(times_as_far("it moves", 2.5), "it moves 2.50 times as far as no paddle does");
        // On the needle's line nothing but rounding moves the target.
        assert!(times_as_far("it moves", 1.6e14).ends_with("does not leave the needle's line"));
        assert_eq!(lines("prostate"), Vec::<String>::new());
    }
}
