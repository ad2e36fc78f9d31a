//! What a table's size is worth, as CSV, as a figure, and on one screen.

use std::fmt::Write as _;

use firmware::scalar::ScalarKind;
use model_offline::output::chart::{Axis, Colour, Dash, Figure, Marker, Panel, Series};

use crate::bench::tables::{KNOTS, TableTrial};
use model_offline::output::csv::table;

/// Within this share of the least error a smaller table is as good.
const AS_GOOD: f64 = 1.1;

/// One line per table.
pub fn csv(trials: &[TableTrial]) -> Vec<u8> {
    let columns = ["knots", "scalar", "bytes", "step_ns", "max_error", "failure"];
    table(columns, trials, |trial| {
        [
            trial.knots.to_string(),
            trial.scalar.name().to_owned(),
            trial.bytes.to_string(),
            format!("{:.1}", trial.step_ns),
            format!("{:.6e}", trial.max_error),
            failure(trial),
        ]
    })
}

/// Why the loop stopped, in words; nothing where it did not.
fn failure(trial: &TableTrial) -> String {
    trial.failure.as_ref().map(ToString::to_string).unwrap_or_default()
}

/// The smallest table that is as good as any.
fn enough(trials: &[TableTrial]) -> Option<&TableTrial> {
    let worked = || trials.iter().filter(|trial| trial.worked());
    let least = worked().map(|trial| trial.max_error).fold(f64::INFINITY, f64::min);
    worked().filter(|trial| trial.max_error <= AS_GOOD * least).min_by_key(|trial| trial.bytes)
}

/// Closed-loop error and time of a step against the table's size; `unit` is that of the scene's lengths.
pub fn figure(trials: &[TableTrial], scene: &str, unit: &str) -> Figure {
    let answer = enough(trials).map_or_else(
        || "No table worked".to_owned(),
        |trial| {
            format!("{} knots in {} ({} bytes) are as good as any table", trial.knots, trial.scalar.name(), trial.bytes)
        },
    );
    let slowest = trials.iter().map(|t| t.step_ns).filter(|t| t.is_finite()).fold(1.0, f64::max);
    let panel = |title: &str, y: Axis, series| Panel { series, ..Panel::new(title, Axis::log("table", "bytes"), y) };
    Figure {
        title: format!("{answer}: {scene}"),
        caption: format!(
            "{} to {} depth knots; the firmware's controller at 1 kHz on the reduced tissue. As good: within 10 % of the least \
             error.",
            KNOTS[0],
            KNOTS[KNOTS.len() - 1]
        ),
        panels: vec![
            panel(
                "Error of the closed loop",
                Axis::log("largest orthogonal error", unit),
                series(trials, |trial| trial.max_error),
            ),
            panel(
                "Time of one step of the controller",
                Axis::linear("mean time", "ns").range(0.0, 1.3 * slowest),
                series(trials, |trial| trial.step_ns),
            ),
        ],
        columns: 2,
    }
}

fn series(trials: &[TableTrial], value: impl Fn(&TableTrial) -> f64) -> Vec<Series> {
    [(ScalarKind::F32, Colour::Vermillion, Marker::Square), (ScalarKind::F64, Colour::Blue, Marker::Circle)]
        .into_iter()
        .map(|(scalar, colour, marker)| {
            let of_kind = trials.iter().filter(|trial| trial.scalar == scalar);
            let (worked, failed): (Vec<_>, Vec<_>) = of_kind.partition(|trial| trial.worked());
            let point = |trial: &&TableTrial| (trial.bytes as f64, value(trial));
            let good = Series::scatter(scalar.name(), colour, marker, worked.iter().map(point).collect());
            Series { failures: failed.iter().map(point).collect(), ..good.joined(Dash::Solid) }
        })
        .collect()
}

/// The comparison as text.
pub fn summary(trials: &[TableTrial]) -> String {
    let mut out = String::from("knots  type   bytes     step  largest orthogonal error\n");
    for trial in trials {
        let TableTrial { knots, scalar, bytes, step_ns, max_error, .. } = trial;
        let (scalar, failure) = (scalar.name(), failure(trial));
        let _ = writeln!(out, "{knots:>5}  {scalar:>4}  {bytes:>6}  {step_ns:>4.0} ns  {max_error:.2e}  {failure}");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(knots: usize, bytes: usize, max_error: f64) -> TableTrial {
        TableTrial { knots, scalar: ScalarKind::F64, bytes, step_ns: 100.0, max_error, failure: None }
    }

    #[test]
    fn the_title_names_the_smallest_table_that_is_good_enough() {
        let failed = TableTrial { failure: Some(crate::SimError::QemuIsLockstepOnly), ..trial(2, 10, 1e-9) };
        let trials = [failed, trial(3, 20, 2e-6), trial(5, 30, 1.05e-6), trial(9, 50, 1e-6)];
        assert!(figure(&trials, "s", "mm").title.starts_with("5 knots in f64 (30 bytes)"));
        assert!(figure(&trials[..1], "s", "mm").title.starts_with("No table worked"));
        assert_eq!(csv(&trials).split(|b| *b == b'\n').filter(|line| !line.is_empty()).count(), 5);
    }
}
