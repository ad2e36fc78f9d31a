//! Where to put the paddle: the paper's Figures 2 and 3 and its Table III.

use maud::{Markup, html};

use super::axis::Axis;
use super::chart::Chart;
use super::number::{NO_NUMBER, in_unit, number, plain};
use super::paper::{is_paper, paper_controllability, paper_optima};
use super::svg::{Drawing, Marker};
use crate::bench::result::{PaddlePlacement, PlacementResult, RunResult};

fn names(placement: &PlacementResult) -> impl Iterator<Item = String> {
    placement.paddles.iter().map(|paddle| paddle.index.to_string())
}

/// Place of a paddle on the horizontal axis.
fn place(placement: &PlacementResult, index: u32) -> Option<f64> {
    placement.paddles.iter().position(|paddle| paddle.index == index).map(|place| place as f64)
}

fn at_the_end(paddle: &PaddlePlacement) -> f64 {
    paddle.orthogonal.last().copied().unwrap_or(f64::NAN)
}

/// Orthogonal displacement with every paddle held, one chart per tissue on the same scale.
pub(super) fn static_charts(run: &RunResult) -> Vec<Drawing> {
    let all = run.placements.iter().flat_map(|placement| &placement.paddles);
    let values: Vec<f64> = all.flat_map(|paddle| [0.0, at_the_end(paddle), paddle.max_orthogonal]).collect();
    run.placements
        .iter()
        .map(|placement| {
            let figure = match placement.tissue.name() {
                "homogeneous" if is_paper(&run.scene) => ", as in Figure 2",
                "inclusion" if is_paper(&run.scene) => ", as in Figure 3",
                _ => "",
            };
            let mut chart = Chart::new(
                &format!("Tissue: {}{figure}", placement.tissue),
                &format!("Static error against paddle position, tissue {}", placement.tissue),
                Axis::places("paddle position", names(placement)),
                Axis::linear("orthogonal displacement", &run.units[0], values.iter().copied()),
            );
            if let Some((optimum, _)) = paper_optima(&run.scene, placement.tissue)
                && let Some(x) = place(placement, optimum)
            {
                chart.strip("strip", "the paper's optimum", x - 0.4, x + 0.4);
            }
            let points = || placement.paddles.iter().enumerate().map(|(i, paddle)| (i as f64, paddle));
            chart.segment("zero", [-0.5, 0.0], [placement.paddles.len() as f64 - 0.5, 0.0]);
            for (x, paddle) in points() {
                chart.segment("stem", [x, 0.0], [x, at_the_end(paddle)]);
            }
            chart.markers(Marker::Disc, "ours", "at full depth", points().map(|(x, p)| [x, at_the_end(p)]));
            chart.markers(
                Marker::Dash,
                "size",
                "largest size on the way",
                points().map(|(x, p)| [x, p.max_orthogonal]),
            );
            if let Some(x) = place(placement, placement.best_static) {
                chart.heading(x, "best");
            }
            chart.finish()
        })
        .collect()
}

/// Controllability measures, one chart per tissue on the same scale.
pub(super) fn controllability_charts(run: &RunResult) -> Vec<Drawing> {
    let paper = |placement: &PlacementResult, index| paper_controllability(&run.scene, placement.tissue, index);
    let values: Vec<f64> = run
        .placements
        .iter()
        .flat_map(|placement| placement.paddles.iter().map(move |paddle| (placement, paddle)))
        .flat_map(|(placement, paddle)| {
            [Some(paddle.controllability_measure), paper(placement, paddle.index)].into_iter().flatten()
        })
        .collect();
    run.placements
        .iter()
        .map(|placement| {
            let mut chart = Chart::new(
                &format!("Tissue: {}", placement.tissue),
                &format!("Controllability measure of every paddle, tissue {}", placement.tissue),
                Axis::places("paddle position", names(placement)),
                Axis::linear("controllability measure ‖J⁻¹n‖ (less is better)", "1", values.iter().copied()),
            );
            let points = || placement.paddles.iter().enumerate().map(|(i, paddle)| (i as f64, paddle));
            let reported: Vec<[f64; 2]> =
                points().filter_map(|(x, p)| paper(placement, p.index).map(|value| [x, value])).collect();
            if !reported.is_empty() {
                chart.line("paper-line", "", reported.iter().copied());
                chart.markers(Marker::Diamond, "paper", "the paper's Table III", reported);
            }
            let measures = || points().map(|(x, paddle)| [x, paddle.controllability_measure]);
            chart.line("ours-line", "", measures());
            chart.markers(Marker::Disc, "ours", "this run", measures());
            if let Some(x) = place(placement, placement.best_dynamic) {
                chart.heading(x, "best");
            }
            chart.finish()
        })
        .collect()
}

fn mark(best: bool) -> Option<&'static str> {
    best.then_some("best")
}

fn deviation(value: f64, reference: Option<f64>) -> String {
    match reference {
        Some(reference) if (value / reference).is_finite() => {
            super::number::minus(format!("{:+.1} %", (value / reference - 1.0) * 100.0))
        }
        _ => NO_NUMBER.to_owned(),
    }
}

fn remark(run: &RunResult, placement: &PlacementResult, paddle: &PaddlePlacement) -> String {
    let best = (paddle.index == placement.best_static).then(|| "best here".to_owned());
    let paper = paper_optima(&run.scene, placement.tissue).filter(|optima| optima.0 == paddle.index);
    let paper = paper.map(|_| "the paper's optimum".to_owned());
    let failure = paddle.failure.as_ref().map(|failure| format!("stopped early: {failure}"));
    best.into_iter().chain(paper).chain(failure).collect::<Vec<_>>().join(", ")
}

/// Numbers of [`static_charts`].
pub(super) fn static_table(run: &RunResult) -> Markup {
    let unit = &run.units[0];
    html! {
        div.scroll { table {
            caption { span { "Target displacement orthogonal to the needle, paddle held; the best one is bold" } }
            thead { tr {
                th { "tissue" } th { "paddle" }
                th { (in_unit("at full depth", unit)) } th { (in_unit("largest size", unit)) }
                th { (in_unit("depth reached", unit)) } th.left { "remark" }
            } }
            tbody { @for placement in &run.placements { @for paddle in &placement.paddles {
                tr class=[mark(paddle.index == placement.best_static)] {
                    td { (placement.tissue) } td { (paddle.index) }
                    td { (number(at_the_end(paddle), 4)) } td { (number(paddle.max_orthogonal, 4)) }
                    td { (plain(paddle.reached_depth)) }
                    td.wrap { (remark(run, placement, paddle)) }
                }
            } } }
        } }
    }
}

/// Numbers of [`controllability_charts`].
pub(super) fn controllability_table(run: &RunResult) -> Markup {
    html! {
        div.scroll { table {
            caption { span { "Controllability measure ‖J⁻¹n‖ (paddle travel per unit of target travel) and best direction" } }
            thead { tr {
                th { "tissue" } th { "paddle" } th { "this run" } th { "paper, Table III" } th { "difference" }
                th { "J⁻¹n, x" } th { "J⁻¹n, y" }
            } }
            tbody { @for placement in &run.placements { @for paddle in &placement.paddles {
                @let reported = paper_controllability(&run.scene, placement.tissue, paddle.index);
                tr class=[mark(paddle.index == placement.best_dynamic)] {
                    td { (placement.tissue) } td { (paddle.index) }
                    td { (number(paddle.controllability_measure, 5)) }
                    td { (reported.map_or_else(|| NO_NUMBER.to_owned(), |value| number(value, 5))) }
                    td { (deviation(paddle.controllability_measure, reported)) }
                    td { (number(paddle.best_direction[0], 4)) } td { (number(paddle.best_direction[1], 4)) }
                }
            } } }
        } }
    }
}
