//! Whether the sensor can see what the needle does at all.

use model_offline::output::chart::number::number;

use crate::bench::result::RunResult;

/// Says so where the target leaves the needle's line by less than a measurement of it is off; none where it moves further, or
/// where no insertion without a paddle was simulated.
pub(super) fn below_noise(run: &RunResult) -> Option<String> {
    let without = run.cases.iter().filter_map(|case| case.strategies.none.as_ref());
    let moved = without.map(|none| none.max_orthogonal_error).reduce(f64::max)?;
    let noise = run.settings.noise;
    let unit = &run.units[0];
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let held_is_better = run.cases.iter().any(|case| case.improvement.is_some_and(|factor| factor < 1.0));
    let advice = match held_is_better {
        true => "the best static paddle, which needs no sensor, leaves less",
        false => "what the dynamic paddle brings is the table's doing",
    };
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
