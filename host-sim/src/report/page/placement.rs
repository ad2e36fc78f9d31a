//! Where to put the paddle: the paper's Figures 2 and 3 and its Table III.

use maud::{Markup, html};
use model_offline::output::chart::number::{NO_NUMBER, in_unit, minus, number, plain};
use model_offline::output::chart::{Axis, Bars, Colour, Dash, Marker, Panel, Place, ReferenceLine, Series, Strip};
use model_offline::placement::verdict::stays_on_the_line;
use model_offline::scene::TissueVariant;

use crate::bench::result::{PaddlePlacement, PlacementResult, RunResult};
use crate::report::paper::{is_paper, paper_controllability, paper_optima};

/// Paddles as places of an axis, one of them with words below its number.
fn places(placement: &PlacementResult, best: Option<u32>, words: &str) -> Axis {
    let name = |index: u32| if Some(index) == best { format!("{index}\n{words}") } else { index.to_string() };
    Axis::categories("paddle position", placement.paddles.iter().map(|paddle| name(paddle.index)).collect())
}

/// Place of a paddle on the horizontal axis.
fn place(placement: &PlacementResult, index: u32) -> Option<f64> {
    placement.paddles.iter().position(|paddle| paddle.index == index).map(|place| place as f64)
}

fn at_the_end(paddle: &PaddlePlacement) -> f64 {
    paddle.orthogonal.last().copied().unwrap_or(f64::NAN)
}

/// Its largest size on the way; not a number where the insertion stopped at once.
fn largest(orthogonal: &[f64], max_orthogonal: f64) -> f64 {
    if orthogonal.is_empty() { f64::NAN } else { max_orthogonal }
}

/// The same without a paddle.
fn without_paddle(placement: &PlacementResult) -> Option<f64> {
    placement.no_paddle.as_ref()?.orthogonal.last().copied()
}

/// Points of a chart over the paddles.
fn over(placement: &PlacementResult, value: impl Fn(&PaddlePlacement) -> f64) -> Vec<(f64, f64)> {
    placement.paddles.iter().enumerate().map(|(i, paddle)| (i as f64, value(paddle))).collect()
}

/// Which paddle to hold, if any.
fn static_answer(placement: &PlacementResult) -> String {
    let best = placement.paddles.iter().find(|paddle| paddle.index == placement.best_static);
    // Of an insertion that stopped at once nothing is known.
    let none = placement.no_paddle.as_ref().and_then(|none| Some((none.max_orthogonal, *none.depth.last()?)));
    match best.zip(none) {
        Some((_, (none, depth))) if stays_on_the_line(none, depth) => "no held paddle helps".to_owned(),
        Some((best, (none, _))) if best.max_orthogonal > none => "no held paddle helps".to_owned(),
        _ => format!("paddle {} moves the target least", placement.best_static),
    }
}

/// Orthogonal displacement with every paddle held, one chart per tissue on the same scale.
pub(super) fn static_charts(run: &RunResult) -> Vec<Panel> {
    let all = run.placements.iter().flat_map(|placement| &placement.paddles);
    let mut values: Vec<f64> = all.flat_map(|paddle| [0.0, at_the_end(paddle), paddle.max_orthogonal]).collect();
    values.extend(run.placements.iter().filter_map(without_paddle));
    run.placements
        .iter()
        .map(|placement| {
            let figure = match placement.tissue {
                _ if !is_paper(&run.scene) => "",
                TissueVariant::Homogeneous => " (the paper's Figure 2)",
                TissueVariant::Inclusion => " (the paper's Figure 3)",
            };
            let mut panel = Panel::new(
                &format!("Tissue {}: {}{figure}", placement.tissue, static_answer(placement)),
                places(placement, Some(placement.best_static), "best static"),
                Axis::linear("orthogonal displacement", &run.units[0]).enclosing(values.iter().copied()),
            );
            panel.description = format!("Static error against paddle position, tissue {}", placement.tissue);
            if let Some((optimum, _)) = paper_optima(&run.scene, placement.tissue)
                && let Some(x) = place(placement, optimum)
            {
                panel.strips.push(Strip { label: "the paper's optimum".to_owned(), range: [x - 0.4, x + 0.4] });
            }
            panel.lines.push(ReferenceLine::new("", Place::Y(0.0), Dash::Solid));
            let none = without_paddle(placement);
            panel.lines.extend(none.map(|none| ReferenceLine::new("no paddle", Place::Y(none), Dash::Dashed)));
            let ends = over(placement, at_the_end);
            let stems = ends.iter().map(|(x, y)| [x - 0.02, x + 0.02, *y]).collect();
            panel.bars.push(Bars { label: String::new(), colour: Colour::Vermillion, bars: stems });
            panel.series = vec![
                Series::scatter("at full depth", Colour::Vermillion, Marker::Circle, ends),
                Series::scatter(
                    "largest size on the way",
                    Colour::Ink,
                    Marker::Dash,
                    over(placement, |p| largest(&p.orthogonal, p.max_orthogonal)),
                ),
            ];
            panel
        })
        .collect()
}

/// Controllability measures, one chart per tissue on the same scale.
pub(super) fn controllability_charts(run: &RunResult) -> Vec<Panel> {
    let paper = |placement: &PlacementResult, index| paper_controllability(&run.scene, placement.tissue, index);
    let values: Vec<f64> = run
        .placements
        .iter()
        .flat_map(|placement| placement.paddles.iter().map(move |paddle| (placement, paddle)))
        .flat_map(|(placement, paddle)| {
            [paddle.controllability_measure, paper(placement, paddle.index)].into_iter().flatten()
        })
        .collect();
    run.placements
        .iter()
        .map(|placement| {
            let title = match placement.best_dynamic {
                Some(index) => format!("Tissue {}: paddle {index} needs the least travel", placement.tissue),
                None => format!("Tissue {}: no paddle moves the target sideways", placement.tissue),
            };
            let mut panel = Panel::new(
                &title,
                places(placement, placement.best_dynamic, "best dynamic"),
                Axis::linear("controllability measure ‖J⁻¹n‖ (less is better)", "1")
                    .enclosing(values.iter().copied().chain([0.0])),
            );
            panel.description = format!("Controllability measure of every paddle, tissue {}", placement.tissue);
            let places = placement.paddles.iter().enumerate();
            let reported: Vec<(f64, f64)> =
                places.filter_map(|(i, p)| paper(placement, p.index).map(|value| (i as f64, value))).collect();
            if !reported.is_empty() {
                let series = Series::scatter("the paper's Table III", Colour::Ink, Marker::Diamond, reported);
                panel.series.push(series.open().joined(Dash::Dashed));
            }
            let ours = over(placement, |p| p.controllability_measure.unwrap_or(f64::NAN));
            panel.series.push(Series::scatter("this run", Colour::Blue, Marker::Circle, ours).joined(Dash::Solid));
            panel
        })
        .collect()
}

fn deviation(value: f64, reference: Option<f64>) -> String {
    match reference {
        Some(reference) if (value / reference).is_finite() => {
            minus(format!("{:+.1} %", (value / reference - 1.0) * 100.0))
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
                tr class=[(paddle.index == placement.best_static).then_some("best")] {
                    td { (placement.tissue) } td { (paddle.index) }
                    td { (number(at_the_end(paddle), 4)) } td { (number(largest(&paddle.orthogonal, paddle.max_orthogonal), 4)) }
                    td { (plain(paddle.reached_depth)) }
                    td.wrap { (remark(run, placement, paddle)) }
                }
            }
            @if let Some(none) = &placement.no_paddle { tr {
                td { (placement.tissue) } td { "none" }
                td { (number(none.orthogonal.last().copied().unwrap_or(f64::NAN), 4)) }
                td { (number(largest(&none.orthogonal, none.max_orthogonal), 4)) } td { (plain(none.reached_depth)) }
                td.wrap { (none.failure.as_ref().map(|f| format!("stopped early: {f}")).unwrap_or_default()) }
            } }
            } }
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
                tr class=[(Some(paddle.index) == placement.best_dynamic).then_some("best")] {
                    td { (placement.tissue) } td { (paddle.index) }
                    td { (paddle.controllability_measure.map_or_else(|| "cannot control".to_owned(), |value| number(value, 5))) }
                    td { (reported.map_or_else(|| NO_NUMBER.to_owned(), |value| number(value, 5))) }
                    td { (deviation(paddle.controllability_measure.unwrap_or(f64::NAN), reported)) }
                    @let [x, y] = paddle.best_direction.unwrap_or([f64::NAN; 2]);
                    td { (number(x, 4)) } td { (number(y, 4)) }
                }
            } } }
        } }
    }
}
