//! The catalogue of faults as a figure: how soon each is found, and where the controller ends.

use firmware::Mode;
use model_offline::output::chart::number::count;
use model_offline::output::chart::{Axis, Colour, Figure, Marker, Panel, Series};

use crate::bench::faults::evidence::RowVerdict;
use crate::bench::faults::report::{FaultsResult, RowResult};

/// Ticks of a fault that is found on the very tick: on a logarithmic axis it needs a place.
const AT_ONCE: f64 = 0.5;

/// A point for every row that has something to find, by the state in which its last trial ends.
pub fn figure(result: &FaultsResult) -> Figure {
    let [mut passed, mut failed, mut not_run] = [0, 0, 0];
    for row in &result.rows {
        match row.result {
            RowVerdict::Passed => passed += 1,
            RowVerdict::Failed => failed += 1,
            RowVerdict::NotRun => not_run += 1,
        }
    }
    let lost: u64 = result.rows.iter().map(|row| row.unaccounted).sum();
    let mut title = format!(
        "{passed} of {} faults are answered as they must be, {lost} samples unaccounted for",
        result.rows.len()
    );
    for (count, words) in [(failed, "failed"), (not_run, "not run")] {
        if count > 0 {
            title.push_str(&format!(", {count} {words}"));
        }
    }
    Figure {
        title,
        caption: format!(
            "Rows by number, as the command prints them; seed {}. Longest time from the beginning of a fault to its answer over all \
             trials of a row, in periods: a gap is known by the sample after it, a limit when it is reached; what is \
             found on the very tick stands at the lower end. Rows without a point have nothing to detect.",
            result.seed
        ),
        panels: vec![panel(&result.rows)],
        columns: 1,
    }
}

fn panel(rows: &[RowResult]) -> Panel {
    let slowest = rows.iter().filter_map(|row| Some((row.ticks_to_detect?, row))).max_by_key(|(ticks, _)| *ticks);
    let title = match slowest {
        Some((ticks, row)) => format!("Longest until the answer: row {}, {}: {} ticks", row.id, row.name, count(ticks)),
        None => "Nothing was to be found".to_owned(),
    };
    let ids = rows.iter().map(|row| f64::from(row.id));
    let mut panel = Panel::new(
        &title,
        Axis::linear("row of the catalogue", "")
            .range(ids.clone().fold(f64::INFINITY, f64::min) - 1.0, ids.fold(0.0, f64::max) + 1.0),
        Axis::log("longest time to the answer", "ticks"),
    );
    let looks: [(&str, Option<Mode>, Colour, Marker); 4] = [
        ("goes on in RUN", Some(Mode::Run), Colour::Blue, Marker::Circle),
        ("ends in HOLD", Some(Mode::Hold), Colour::Orange, Marker::Square),
        ("ends in SAFE", Some(Mode::Safe), Colour::Vermillion, Marker::Triangle),
        ("no controller at the end", None, Colour::Quiet, Marker::Diamond),
    ];
    for (label, mode, colour, marker) in looks {
        let there = || rows.iter().filter(|row| row.final_state == mode);
        let point = |row: &RowResult| Some((f64::from(row.id), (row.ticks_to_detect? as f64).max(AT_ONCE)));
        let mut series = Series::scatter(label, colour, marker, Vec::new());
        for (row, point) in there().filter_map(|row| Some((row, point(row)?))) {
            series.titles.push(format!("{} {}: {} ticks", row.id, row.name, row.ticks_to_detect.unwrap_or(0)));
            series.points.push(point);
        }
        let failed = there().filter(|row| row.result == RowVerdict::Failed);
        series.failures = failed.map(|row| point(row).unwrap_or((f64::from(row.id), f64::NAN))).collect();
        if !series.points.is_empty() || !series.failures.is_empty() {
            panel.series.push(series);
        }
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(id: u32, ticks_to_detect: Option<u64>, state: Mode, result: RowVerdict) -> RowResult {
        RowResult {
            id,
            name: "stale".to_owned(),
            ticks_to_detect,
            final_state: Some(state),
            result,
            ..RowResult::default()
        }
    }

    #[test]
    fn what_failed_or_was_not_run_is_in_the_title_and_has_a_place() {
        let mut result = FaultsResult {
            rows: vec![
                row(1, Some(0), Mode::Run, RowVerdict::Passed),
                row(7, Some(250), Mode::Safe, RowVerdict::Passed),
                row(9, None, Mode::Run, RowVerdict::Failed),
                row(37, None, Mode::Hold, RowVerdict::NotRun),
            ],
            ..FaultsResult::default()
        };
        result.rows[2].unaccounted = 3;
        let figure = figure(&result);
        let told = "2 of 4 faults are answered as they must be, 3 samples unaccounted for, 1 failed, 1 not run";
        assert_eq!(figure.title, told);
        let panel = &figure.panels[0];
        assert_eq!(panel.title, "Longest until the answer: row 7, stale: 250 ticks");
        let [run, safe] = &panel.series[..] else { panic!("{} series", panel.series.len()) };
        assert_eq!((run.points.clone(), safe.points.clone()), (vec![(1.0, AT_ONCE)], vec![(7.0, 250.0)]));
        assert!(run.failures[0].0 == 9.0 && run.failures[0].1.is_nan());
    }
}
