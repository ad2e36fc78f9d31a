//! Whether the sensor can see what the needle does at all.

use model_offline::output::chart::number::number;

use crate::bench::in_space::SpaceRun;
use crate::bench::result::RunResult;
use crate::bench::strategy::Strategy;

/// Says so where the target leaves the needle's line by less than a measurement of it is off; none where it moves further, or
/// where no insertion without a paddle was simulated.
pub(super) fn below_noise(run: &RunResult) -> Option<String> {
    let without = run.cases.iter().filter_map(|case| case.strategies.none.as_ref());
    let moved = without.map(|none| none.max_orthogonal_error).reduce(f64::max)?;
    let stillest: Vec<Strategy> = run.cases.iter().map(|case| case.stillest()).collect();
    let dynamic = "what the dynamic paddle brings is the table's doing";
    let held = "the best static paddle, which needs no sensor, leaves less";
    told(moved, run.settings.noise, &run.units[0], advice(&stillest, dynamic, held))
}

/// The same of a body in space.
pub(super) fn below_noise_in_space(run: &SpaceRun) -> Option<String> {
    let moved = run.cases.iter().map(|case| case.none.max_orthogonal_error).reduce(f64::max)?;
    let stillest: Vec<Strategy> = run.cases.iter().map(|case| case.stillest()).collect();
    let dynamic = "what the dynamic paddles bring is the table's doing";
    let held = "the best static paddles, which need no sensor, leave less";
    told(moved, run.noise, &run.units[0], advice(&stillest, dynamic, held))
}

/// What to do, by what leaves the target stillest, case by case.
fn advice(stillest: &[Strategy], dynamic: &str, held: &str) -> String {
    let count = |strategy: Strategy| stillest.iter().filter(|best| **best == strategy).count();
    match (count(Strategy::None), count(Strategy::Static), stillest.len()) {
        (0, 0, _) => dynamic.to_owned(),
        (0, _, _) => held.to_owned(),
        (none, _, all) if none == all => "the target is stillest without any paddle".to_owned(),
        (none, _, all) => format!("the target is stillest without any paddle in {none} of {all} cases"),
    }
}

fn told(moved: f64, noise: f64, unit: &str, advice: String) -> Option<String> {
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    // Not where one of them is no number.
    (moved < noise).then(|| {
        format!(
            "without a paddle the target leaves the needle's line by at most {}{unit}, less than the sensor's noise of \
             {}{unit}: measurements can hardly help here; {advice}",
            number(moved, 2),
            number(noise, 2)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leaves_the_target_stillest_decides_and_noise_says_when() {
        use Strategy::{Dynamic, None, Static};
        let of = |stillest: &[Strategy]| advice(stillest, "dynamic", "held");
        assert_eq!([of(&[Dynamic; 2]), of(&[Dynamic, Static])], ["dynamic", "held"]);
        assert_eq!(of(&[None; 2]), "the target is stillest without any paddle");
        assert!(of(&[None, Static]).ends_with("in 1 of 2 cases"));
        let line = told(0.074, 0.4, "mm", of(&[Dynamic])).unwrap();
        assert!(line.contains("0.074 mm, less than") && line.ends_with("; dynamic"), "{line}");
        assert!([0.4, 0.41, f64::NAN].iter().all(|moved| told(*moved, 0.4, "mm", String::new()).is_none()));
    }
}
