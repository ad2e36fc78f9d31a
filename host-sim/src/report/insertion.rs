//! What the strategies do along the insertion.

use maud::{Markup, html};

use super::axis::Axis;
use super::chart::Chart;
use super::number::{NO_NUMBER, in_unit, number, plain};
use super::svg::Drawing;
use crate::bench::result::{CaseResult, RunResult, StrategyResult};
use crate::runtime::names;

/// Strategies in the order in which they are shown: class of their line and name.
pub(super) fn strategies(case: &CaseResult) -> Vec<(&'static str, &'static str, &StrategyResult)> {
    let all = &case.strategies;
    [
        ("none", "no paddle", &all.none),
        ("static", "static", &all.fixture),
        ("dynamic", "dynamic", &all.dynamic),
        ("free", "dynamic, free-run", &all.dynamic_free_run),
    ]
    .into_iter()
    .filter_map(|(class, name, strategy)| strategy.as_ref().map(|strategy| (class, name, strategy)))
    .collect()
}

/// Whether a strategy has a controller.
fn is_dynamic(class: &str) -> bool {
    matches!(class, "dynamic" | "free")
}

/// A case in words.
pub(super) fn case_name(case: &CaseResult) -> String {
    if case.tissue.name() == case.table_tissue {
        format!("{}, table of the same tissue", case.tissue)
    } else {
        format!("{}, table of tissue {}", case.tissue, case.table_tissue)
    }
}

/// The charts of one case, and where the page's slider finds their horizontal axes.
#[derive(Debug)]
pub(super) struct CaseCharts {
    pub(super) drawings: Vec<Drawing>,
    pub(super) spans: Vec<(String, [f64; 4])>,
}

/// Error of all strategies, error of the dynamic ones enlarged, paddle displacement.
pub(super) fn case_charts(run: &RunResult, number: usize, case: &CaseResult) -> CaseCharts {
    let unit = &run.units[0];
    let shown = strategies(case);
    let errors = |only_dynamic: bool| {
        let of = shown.iter().filter(move |(class, ..)| !only_dynamic || is_dynamic(class));
        of.flat_map(|(.., strategy)| strategy.series.iter().map(|point| point.orthogonal_error))
    };
    let depth = || Axis::linear("needle depth", unit, [0.0, run.settings.depth]);
    let mut charts = CaseCharts { drawings: Vec::new(), spans: Vec::new() };
    let mut finish = |mut chart: Chart, what: &str, along_depth: bool| {
        let id = format!("case{number}-{what}");
        if along_depth {
            chart.cursor();
            charts.spans.push((id.clone(), chart.horizontal_span()));
        }
        let mut drawing = chart.finish();
        drawing.id = id;
        charts.drawings.push(drawing);
    };

    let mismatch = case.tissue.name() != case.table_tissue;
    let mut chart = Chart::new(
        &format!(
            "All strategies, {}{}",
            case.tissue,
            if mismatch { format!(" (table of {})", case.table_tissue) } else { String::new() }
        ),
        &format!("Orthogonal error along the insertion, {}", case_name(case)),
        depth(),
        Axis::linear("orthogonal error", unit, errors(false).chain([0.0])),
    );
    chart.segment("zero", [0.0, 0.0], [run.settings.depth, 0.0]);
    for (class, name, strategy) in shown.iter().filter(|shown| shown.0 != "free") {
        let name = strategy.paddle.map_or_else(|| (*name).to_owned(), |paddle| format!("{name}, paddle {paddle}"));
        chart.line(class, &name, strategy.series.iter().map(|point| [point.depth, point.orthogonal_error]));
    }
    finish(chart, "error", true);

    if shown.iter().any(|(class, ..)| is_dynamic(class)) {
        let noise = run.settings.noise;
        let mut chart = Chart::new(
            "Dynamic alone, enlarged",
            &format!("Orthogonal error of the dynamic paddle, enlarged, {}", case_name(case)),
            depth(),
            Axis::linear("orthogonal error", unit, errors(true).chain([0.0, noise, -noise])),
        );
        chart.segment("zero", [0.0, 0.0], [run.settings.depth, 0.0]);
        for sign in [1.0, -1.0] {
            let level = sign * noise;
            let name = if noise > 0.0 { "±1 σ of the sensor's noise" } else { "" };
            chart.line("noise", name, [[0.0, level], [run.settings.depth, level]]);
        }
        for (class, name, strategy) in shown.iter().filter(|(class, ..)| is_dynamic(class)) {
            chart.line(class, name, strategy.series.iter().map(|point| [point.depth, point.orthogonal_error]));
        }
        finish(chart, "enlarged", true);
    }

    let controlled = shown.iter().find(|(class, ..)| is_dynamic(class));
    if let Some((_, name, strategy)) = controlled {
        // Before that, the controller waits for its sensors.
        let series = || strategy.series.iter().filter(|point| point.time_s >= 0.0);
        let times = series().map(|point| point.time_s);
        let mut chart = Chart::new(
            "Paddle displacement",
            &format!("Paddle displacement over time, {}", case_name(case)),
            Axis::linear("time since the start of the needle", "s", times.chain([0.0, run.settings.duration_s])),
            Axis::linear("displacement", unit, strategy.series.iter().flat_map(|point| point.paddle)),
        );
        chart.line("first", &format!("x, {name}"), series().map(|p| [p.time_s, p.paddle[0]]));
        chart.line("second", &format!("y, {name}"), series().map(|p| [p.time_s, p.paddle[1]]));
        finish(chart, "paddle", false);
    }
    charts
}

/// Every strategy of every case in numbers.
pub(super) fn table(run: &RunResult) -> Markup {
    let unit = &run.units[0];
    html! {
        div.scroll { table {
            caption { span { "Target displacement orthogonal to the needle over the whole insertion" } }
            thead { tr {
                th { "tissue" } th.left { "table of" } th.left { "strategy" } th.left { "mode" } th { "paddle" }
                th { (in_unit("largest error", unit)) } th { (in_unit("at depth", unit)) } th { (in_unit("RMS error", unit)) }
                th { (in_unit("paddle travel", unit)) } th.left { "final state" } th.left { "faults ever present" }
            } }
            tbody { @for case in &run.cases { @for (_, name, strategy) in strategies(case) {
                tr {
                    td { (case.tissue) } td.left { (case.table_tissue) } td.left { (name) } td.left { (strategy.mode) }
                    td { (strategy.paddle.map_or_else(|| NO_NUMBER.to_owned(), |index| index.to_string())) }
                    td { (number(strategy.max_orthogonal_error, 4)) } td { (plain(strategy.max_error_depth)) }
                    td { (number(strategy.rms_orthogonal_error, 4)) }
                    td { (number(strategy.paddle_travel, 4)) }
                    td.left { (names::mode::name(strategy.final_state)) } td.wrap { (strategy.faults) }
                }
            } } }
        } }
    }
}
