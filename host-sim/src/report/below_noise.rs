//! Whether the sensor can see what the needle does at all.

use model_offline::output::chart::number::number;

use crate::bench::result::RunResult;
use crate::bench::strategy::Strategy;

/// Says so where the target leaves the needle's line by less than a measurement of it is off; none where it moves further, or
/// where no insertion without a paddle was simulated.
pub(super) fn below_noise(run: &RunResult) -> Option<String> {
    let without = run.cases.iter().filter_map(|case| case.strategies.none.as_ref());
    let moved = without.map(|none| none.max_orthogonal_error).reduce(f64::max)?;
    let noise = run.settings.noise;
    let unit = &run.units[0];
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let is = |strategy: Strategy| run.cases.iter().filter(|case| case.stillest() == strategy).count();
    let advice = match (is(Strategy::None), is(Strategy::Static), run.cases.len()) {
        (0, 0, _) => "what the dynamic paddle brings is the table's doing".to_owned(),
        (0, _, _) => "the best static paddle, which needs no sensor, leaves less".to_owned(),
        (none, _, all) if none == all => "the target is stillest without any paddle".to_owned(),
        (none, _, all) => format!("the target is stillest without any paddle in {none} of {all} cases"),
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
