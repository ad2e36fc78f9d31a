//! What the strategies do along the insertion.

use maud::{Markup, html};
use model_offline::output::chart::number::{NO_NUMBER, in_unit, number, plain};
use model_offline::output::chart::{Axis, Bars, Colour, Dash, Drawing, Panel, Place, ReferenceLine, Series};

use super::embed::CHART_WIDTH;
use crate::bench::in_process::Errors;
use crate::bench::result::{CaseResult, NeedlePoint, NeedleResult, RunResult, StrategyResult};
use crate::bench::strategy::Strategy;
use crate::record::export::csv;
use crate::report::AGAINST_NOTHING;
use crate::runtime::names;

/// A case in words.
pub(super) fn case_name(case: &CaseResult) -> String {
    if case.table_tissue.is(case.tissue) {
        format!("{}, table of the same tissue", case.tissue)
    } else {
        format!("{}, table of tissue {}", case.tissue, case.table_tissue)
    }
}

/// Colour and pattern of a strategy's line, the same in every chart.
fn look(strategy: Strategy) -> (Colour, Dash) {
    match strategy {
        Strategy::None => (Colour::Quiet, Dash::Dotted),
        Strategy::Static => (Colour::Vermillion, Dash::Dashed),
        Strategy::Dynamic => (Colour::Blue, Dash::Solid),
        Strategy::DynamicFreeRun => (Colour::Green, Dash::DashDot),
    }
}

/// The charts of one case with their identifiers in the page.
#[derive(Debug)]
pub(super) struct CaseCharts(Vec<(String, Panel)>);

impl CaseCharts {
    /// Each as a drawing of the page.
    pub(super) fn drawings(&self) -> Vec<Drawing> {
        let draw = |(id, panel): &(String, Panel)| {
            let mut drawing = panel.drawing(CHART_WIDTH);
            drawing.id.clone_from(id);
            drawing
        };
        self.0.iter().map(draw).collect()
    }

    /// Where the page's slider finds the horizontal axes that it moves along.
    pub(super) fn spans(&self) -> impl Iterator<Item = (String, [f64; 4])> {
        let along_depth = self.0.iter().filter(|(_, panel)| panel.cursor);
        along_depth.map(|(id, panel)| (id.clone(), panel.horizontal_span(CHART_WIDTH)))
    }
}

/// The sensor's noise is drawn beside errors of which it is at most so many times the largest.
pub(super) const NOISE_BESIDE: f64 = 3.0;

fn zero() -> ReferenceLine {
    ReferenceLine::new("", Place::Y(0.0), Dash::Solid)
}

fn errors(strategy: &StrategyResult) -> Vec<(f64, f64)> {
    strategy.series.iter().map(|point| (point.depth, point.orthogonal_error)).collect()
}

/// Tissue, and table where that is of another one.
fn short_name(case: &CaseResult) -> String {
    if case.table_tissue.is(case.tissue) {
        case.tissue.to_string()
    } else {
        format!("{} (table: {})", case.tissue, case.table_tissue)
    }
}

/// Error of all strategies.
fn error_panel(run: &RunResult, case: &CaseResult) -> Panel {
    let title = case.improvement.filter(|factor| factor.is_finite() && *factor > AGAINST_NOTHING).map_or_else(
        || format!("Tissue {}: all strategies", short_name(case)),
        |factor| match factor < 1.0 {
            true => format!("Tissue {}: dynamic error {} × static", short_name(case), number(1.0 / factor, 2)),
            false => format!("Tissue {}: static error {} × dynamic", short_name(case), number(factor, 2)),
        },
    );
    let depth = Axis::linear("needle depth", &run.units[0]).range(0.0, run.settings.depth);
    let mut panel = Panel::new(&title, depth, Axis::linear("orthogonal error", &run.units[0]));
    panel.description = format!("Orthogonal error along the insertion, {}", case_name(case));
    panel.lines.push(zero());
    for (strategy, result) in run.shown(case) {
        let name = strategy.title();
        let name = result.paddle.map_or_else(|| name.to_owned(), |paddle| format!("{name}, paddle {paddle}"));
        let (colour, dash) = look(strategy);
        panel.series.push(Series::curve(&name, colour, dash, errors(result)));
    }
    panel
}

/// Error of the dynamic strategies, enlarged, beside the sensor's noise.
fn enlarged_panel(run: &RunResult, case: &CaseResult) -> Panel {
    let dynamic = || case.strategies.iter().filter(|shown| shown.0.has_controller());
    let largest = dynamic().map(|(_, result)| result.max_orthogonal_error).fold(0.0, f64::max);
    let noise = run.settings.noise;
    // Beside much larger noise the curve would be a line.
    let hides = noise > NOISE_BESIDE * largest;
    let title = dynamic_alone(largest, noise, hides, &run.units[0]);
    let depth = Axis::linear("needle depth", &run.units[0]).range(0.0, run.settings.depth);
    let mut panel = Panel::new(&title, depth, Axis::linear("orthogonal error", &run.units[0]));
    panel.description = format!("Orthogonal error of the dynamic paddle, enlarged, {}", case_name(case));
    panel.lines.push(zero());
    if noise > 0.0 && !hides {
        for level in [noise, -noise] {
            panel.lines.push(ReferenceLine::new("±1 σ of the sensor's noise", Place::Y(level), Dash::DashDot));
        }
    }
    for (strategy, result) in dynamic() {
        let (colour, dash) = look(strategy);
        panel.series.push(Series::curve(strategy.title(), colour, dash, errors(result)));
    }
    panel
}

/// What a panel of the dynamic error alone is called, with the noise that is not drawn in it.
pub(super) fn dynamic_alone(largest: f64, noise: f64, hides_noise: bool, unit: &str) -> String {
    let beyond = if hides_noise { format!(", of noise {}", with_unit(noise, unit)) } else { String::new() };
    format!("Dynamic alone, enlarged: at most {}{beyond}", with_unit(largest, unit))
}

/// Two digits with their unit, if there is one.
pub(super) fn with_unit(value: f64, unit: &str) -> String {
    if unit == "1" { number(value, 2) } else { format!("{}\u{a0}{unit}", number(value, 2)) }
}

/// Displacement of the paddle over time.
fn paddle_panel(run: &RunResult, case: &CaseResult, name: &str, strategy: &StrategyResult) -> Panel {
    // Before that, the controller waits for its sensors.
    let series = || strategy.series.iter().filter(|point| point.time_s >= 0.0);
    let farthest = series().map(|p| p.paddle[0].hypot(p.paddle[1])).fold(0.0, f64::max);
    let times = series().map(|p| p.time_s).chain([0.0, run.settings.duration_s]);
    let mut panel = Panel::new(
        &format!("Paddle displacement: at most {}", with_unit(farthest, &run.units[0])),
        Axis::linear("time since the start of the needle", "s").enclosing(times),
        Axis::linear("displacement", &run.units[0]),
    );
    panel.description = format!("Paddle displacement over time, {}", case_name(case));
    for (axis, dash) in [Dash::Solid, Dash::Dashed].into_iter().enumerate() {
        let points = series().map(|p| (p.time_s, p.paddle[axis])).collect();
        panel.series.push(Series::curve(&format!("{}, {name}", ["x", "y"][axis]), Colour::Blue, dash, points));
    }
    panel
}

/// Unit of force per thickness.
fn force_unit(run: &RunResult) -> String {
    csv::Units { length: &run.units[0], stress: &run.units[1] }.force()
}

/// Forces on a needle that slips, under the controller or else without a paddle.
fn force_panel(run: &RunResult, name: &str, needle: &NeedleResult) -> Panel {
    let largest = needle.points.iter().map(|point| point.base_force).fold(0.0, f64::max);
    let mut panel = Panel::new(
        &format!("Forces on the needle, {name}: at most {}", number(largest, 2)),
        Axis::linear("time since the start of the needle", "s").enclosing(needle.points.iter().map(|p| p.time_s)),
        Axis::linear("force per thickness", &force_unit(run)),
    );
    panel.description = format!("Forces at the needle's base, of its tip and along its shaft over time, {name}");
    panel.lines.push(zero());
    let mut add = |label: &str, (colour, dash): (Colour, Dash), force: &dyn Fn(&NeedlePoint) -> f64| {
        let points = needle.points.iter().map(|point| (point.time_s, force(point))).collect();
        panel.series.push(Series::curve(label, colour, dash, points));
    };
    add("base", (Colour::Blue, Dash::Solid), &|point| point.base_force);
    add("tip", (Colour::Vermillion, Dash::Dashed), &|point| point.tip_force);
    add("friction along the shaft", (Colour::Green, Dash::DashDot), &|point| point.friction);
    panel
}

/// How far the needle has slid past the tissue along its shaft, where it was deepest.
fn slip_panel(run: &RunResult, name: &str, needle: &NeedleResult) -> Panel {
    let unit = &run.units[0];
    let mut panel = Panel::new(
        &format!("Slip along the shaft at depth {}", number(needle.shaft_depth, 3)),
        Axis::linear("length of cut from the entry", unit).enclosing(needle.shaft.iter().map(|s| s.arc_length)),
        Axis::linear("slip", unit),
    );
    panel.description = format!("Slip of the needle past the tissue along its shaft where it was deepest, {name}");
    panel.lines.push(zero());
    let points = needle.shaft.iter().map(|station| (station.arc_length, station.slip)).collect();
    panel.series.push(Series::curve("slip", Colour::Blue, Dash::Solid, points));
    panel
}

/// Error of all strategies, error of the dynamic ones enlarged, paddle displacement.
pub(super) fn error_panels(run: &RunResult, case: &CaseResult) -> Vec<(&'static str, Panel)> {
    let mut charts = vec![("error", Panel { cursor: true, ..error_panel(run, case) })];
    if let Some((strategy, result)) = case.strategies.iter().find(|shown| shown.0.has_controller()) {
        charts.push(("enlarged", Panel { cursor: true, ..enlarged_panel(run, case) }));
        charts.push(("paddle", paddle_panel(run, case, strategy.title(), result)));
    }
    charts
}

/// Forces on a needle that slips and its shaft: under the controller, without one as it is alone.
pub(super) fn needle_panels(run: &RunResult, case: &CaseResult) -> Vec<(&'static str, Panel)> {
    let shown = case.strategies.iter().filter_map(|(strategy, result)| Some((strategy, result.needle.as_ref()?)));
    let by_controller =
        |(strategy, _): &(Strategy, &NeedleResult)| (strategy.has_controller(), strategy.is_reproducible());
    let Some((strategy, needle)) = shown.max_by_key(by_controller) else { return Vec::new() };
    let mut charts = vec![("forces", force_panel(run, strategy.title(), needle))];
    if needle.shaft.len() > 1 {
        charts.push(("slip", slip_panel(run, strategy.title(), needle)));
    }
    charts
}

/// What the controller's error is made of: a bar for what is left without each cause.
pub(super) fn cause_panel(run: &RunResult, case: &CaseResult) -> Option<Panel> {
    let causes = case.causes.as_ref()?;
    let mut names = vec!["nothing".to_owned()];
    names.extend(causes.without.iter().map(|without| without.cause.word().to_owned()));
    names.extend(["all", "(bound)"].map(str::to_owned));
    let errors = || {
        let left = causes.without.iter().map(|without| &without.left);
        std::iter::once(&causes.whole).chain(left).chain([&causes.without_all, &causes.bound.sensor])
    };
    let title = causes.chief().map_or_else(
        || "Nothing but the controller leaves an error".to_owned(),
        |chief| {
            let (whole, left) = (number(causes.whole.peak, 2), number(chief.left.peak, 2));
            format!("Largest error {whole}; without the {} {left}", chief.cause.title())
        },
    );
    let heights = Axis::linear("largest and RMS orthogonal error", &run.units[0]);
    let mut panel = Panel::new(
        &title,
        Axis::categories("without", names),
        heights.enclosing(errors().map(|errors| errors.peak).chain([0.0])),
    );
    panel.description = format!("Largest and RMS error without each of its causes, {}", case_name(case));
    let mut add = |label: &str, (colour, from): (Colour, f64), of: &dyn Fn(&Errors) -> f64| {
        let bar = |(k, errors): (usize, &Errors)| [k as f64 + from, k as f64 + from + 0.35, of(errors)];
        panel.bars.push(Bars { label: label.to_owned(), colour, bars: errors().enumerate().map(bar).collect() });
    };
    add("largest", (Colour::Blue, -0.35), &|errors| errors.peak);
    add("RMS", (Colour::Orange, 0.0), &|errors| errors.rms);
    Some(panel)
}

/// What is left without each cause in numbers.
pub(super) fn cause_table(run: &RunResult, case: &CaseResult) -> Option<Markup> {
    let causes = case.causes.as_ref()?;
    let unit = &run.units[0];
    let near = if case.strategies.left_the_way() { ", near the planned way, which it left" } else { "" };
    let row = |name: &str, errors: &Errors| {
        html! { tr { td.left { (name) } td { (number(errors.peak, 3)) } td { (number(errors.rms, 3)) } } }
    };
    Some(html! {
        div.scroll { table {
            caption { span { "What is left of the controlled insertion's error without each of its causes, in lockstep" (near) } }
            thead { tr { th.left { "without" } th { (in_unit("largest", unit)) } th { (in_unit("RMS", unit)) } } }
            tbody {
                (row("nothing: as it is", &causes.whole))
                @for without in &causes.without { (row(without.cause.title(), &without.left)) }
                (row("all of these", &causes.without_all))
                (row("bound: any controller, this sensor", &causes.bound.sensor))
                (row("bound: any controller, a sensor as late without noise", &causes.bound.delay))
            }
        } }
        p.quiet {
            "Causes do not add up: each row is the same insertion with one thing taken away. The bounds are what a controller would leave on "
            "average that is told beforehand what the table does not know and how the patient moves, but not how much of it there is "
            "(a standard normal factor each). The paddle's rate alone allows for "
            (number(causes.bound.paddle, 3)) " " (unit) "."
        }
    })
}

/// All charts of a case.
pub(super) fn case_charts(run: &RunResult, number: usize, case: &CaseResult) -> CaseCharts {
    let causes = cause_panel(run, case).map(|panel| ("causes", panel));
    let charts = error_panels(run, case).into_iter().chain(causes).chain(needle_panels(run, case));
    CaseCharts(charts.map(|(what, panel)| (format!("case{number}-{what}"), panel)).collect())
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
            tbody { @for case in &run.cases { @for (strategy, result) in case.strategies.iter() {
                tr {
                    td { (case.tissue) } td.left { (case.table_tissue) } td.left { (strategy.title()) } td.left { (result.mode) }
                    td { (result.paddle.map_or_else(|| NO_NUMBER.to_owned(), |index| index.to_string())) }
                    td { (number(result.max_orthogonal_error, 4)) } td { (plain(result.max_error_depth)) }
                    td { (number(result.rms_orthogonal_error, 4)) }
                    td { (number(result.paddle_travel, 4)) }
                    td.left { (names::mode::name(result.final_state)) } td.wrap { (result.faults) }
                }
            } } }
        } }
    }
}
