//! The page of a run in space.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use model_offline::number::in_unit;
use model_offline::output::chart::number::{in_unit as labelled, number};
use model_offline::output::chart::{Axis, Colour, Dash, Figure, Panel, Place, ReferenceLine, Series};

use super::attachments::Attachments;
use super::conclusion::{self, change};
use super::embed::{head_of, panels};
use super::insertion::{NOISE_BESIDE, dynamic_alone, with_unit};
use super::space_view::{self, STRATEGIES};
use crate::bench::in_space::{SpaceCase, SpaceRun, SpaceStrategyResult};
use crate::report::AGAINST_NOTHING;
use crate::runtime::time::mode::RunMode;

/// Numbers under the pointer, pictures to keep.
const SCRIPT: &str = concat!(include_str!("common.js"), include_str!("charts.js"));

/// The whole page, with what other commands have left beside it; it needs nothing else.
pub(in crate::report) fn render(run: &SpaceRun, attachments: &Attachments) -> String {
    let unit = &run.units[0];
    html! {
        (DOCTYPE)
        html lang="en" {
            (head_of(&run.scene))
            body {
                main {
                    h1 { "Stillpoint: " (run.scene) ", in space" }
                    @for sentence in conclusion::sentences_in_space(run) { p.lead { (sentence) } }
                    p.quiet {
                        "Insertion to " (in_unit(run.depth, unit)) " in " (run.insertion_s) " s. Loop " (run.rate_hz)
                        " Hz; target seen at " (run.target_rate_hz) " Hz, " (run.target_latency_ms) " ms late, noise "
                        (in_unit(run.noise, unit)) " per component; seed " (run.seed) ". Tissue: linear tetrahedra, "
                        (run.nodes) " nodes, tabulated along each insertion. Plant and controller are two processes; "
                        @match run.mode {
                            RunMode::Lockstep => "time is simulated.",
                            RunMode::FreeRun => "the machine's clock drives time.",
                        }
                    }
                    (space_view::section(run))
                    @for (place, case) in run.cases.iter().enumerate() { (of_case(run, place, case)) }
                    @if let Some(attached) = attachments.section() {
                        section #attached { h2 { "From other commands" } (attached) }
                    }
                }
                div #tip.on-screen hidden {}
                script { (PreEscaped(SCRIPT)) }
                (space_view::scripts(run))
            }
        }
    }
    .into_string()
}

/// Pictures for use elsewhere, on a white ground: file name and SVG. Of every case the charts, and the sections of every strategy.
pub(in crate::report) fn pictures(run: &SpaceRun) -> Vec<(String, String)> {
    let mut pictures = Vec::new();
    for (place, case) in run.cases.iter().enumerate() {
        let name = match case.tissue == case.table_tissue {
            true => case.tissue.to_string(),
            false => format!("{}-with-{}-table", case.tissue, case.table_tissue),
        };
        let factor = case.improvement.is_finite().then(|| change(&[case.improvement]));
        let told = factor.map_or_else(
            || "errors along the insertion".to_owned(),
            |factor| format!("the dynamic paddles' error is {factor} than the best static paddles'"),
        );
        let title = format!("Tissue {}: {told}", case.tissue);
        let panels = charts_of(run, case).to_vec();
        let errors = Figure { title, caption: String::new(), panels, columns: 3 }.svg();
        pictures.push((format!("{name}-error.svg"), errors));
        for (strategy, called) in STRATEGIES.iter().enumerate() {
            let sections = space_view::sections_picture(run, place, strategy);
            pictures.extend(sections.map(|svg| (format!("{name}-{}.svg", called.replace(' ', "-")), svg)));
        }
    }
    pictures
}

fn charts_of(run: &SpaceRun, case: &SpaceCase) -> [Panel; 3] {
    [error_panel(run, case), enlarged_panel(run, case), paddle_panel(run, case)]
}

fn of_case(run: &SpaceRun, place: usize, case: &SpaceCase) -> Markup {
    let unit = &run.units[0];
    let rows = STRATEGIES.into_iter().zip([&case.none, &case.fixture, &case.dynamic]);
    let [error, rms, travel] = ["largest error", "RMS", "travel"].map(|title| labelled(title, unit));
    let titles = ["".to_owned(), "paddles".to_owned(), error, rms, travel, "state".to_owned()];
    html! {
        section {
            h2 { "Tissue " (case.tissue.name()) ", table of tissue " (case.table_tissue.name()) }
            // Factors that are no numbers are of targets that do not move.
            @if case.improvement.is_finite() && case.improvement_over_none.is_finite() { p {
                "The dynamic paddles' largest error is " (change(&[case.improvement])) " than the best static paddles', and "
                (change(&[case.improvement_over_none])) " than without any."
            } }
            div.scroll { table.cards {
                thead { tr { @for title in &titles { th { (title) } } } }
                tbody { @for (name, result) in rows { tr { (cells(&titles, name, result)) } } }
            } }
            (panels(&charts_of(run, case)))
            (space_view::case_sections(run, place))
        }
    }
}

/// One strategy's numbers, each with its column's title, which narrow screens show beside it.
fn cells(titles: &[String], name: &str, result: &SpaceStrategyResult) -> Markup {
    let cells = [
        name.to_owned(),
        paddles(result),
        number(result.max_orthogonal_error, 3),
        number(result.rms_orthogonal_error, 3),
        number(result.paddle_travel, 3),
        result.final_state.map_or_else(String::new, |mode| mode.to_string()),
    ];
    html! { @for (title, cell) in titles.iter().zip(cells) { td data-title=(title) { (cell) } } }
}

fn paddles(result: &SpaceStrategyResult) -> String {
    let names: Vec<String> = result.paddles.iter().map(u32::to_string).collect();
    if names.is_empty() { "–".to_owned() } else { names.join(" + ") }
}

fn errors(result: &SpaceStrategyResult) -> Vec<(f64, f64)> {
    result.series.iter().map(|point| (point.depth, point.orthogonal_error)).collect()
}

fn depth_axis(run: &SpaceRun) -> Axis {
    Axis::linear("needle depth", &run.units[0]).range(0.0, run.depth)
}

/// Error of all strategies: the length of the target's way off the needle's line.
fn error_panel(run: &SpaceRun, case: &SpaceCase) -> Panel {
    let title = match case.improvement {
        factor if !factor.is_finite() || factor < AGAINST_NOTHING => "Error of all strategies".to_owned(),
        factor if factor < 1.0 => format!("Dynamic error {} × static", number(1.0 / factor, 2)),
        factor => format!("Static error {} × dynamic", number(factor, 2)),
    };
    let mut panel = Panel::new(&title, depth_axis(run), Axis::linear("orthogonal error", &run.units[0]));
    panel.description = format!("Orthogonal error along the insertion, tissue {}", case.tissue.name());
    for (name, colour, dash, result) in [
        ("no paddle", Colour::Quiet, Dash::Dotted, &case.none),
        ("static", Colour::Vermillion, Dash::Dashed, &case.fixture),
        ("dynamic", Colour::Blue, Dash::Solid, &case.dynamic),
    ] {
        panel.series.push(Series::curve(name, colour, dash, errors(result)));
    }
    panel
}

/// The dynamic paddles' error alone, beside the sensor's noise.
fn enlarged_panel(run: &SpaceRun, case: &SpaceCase) -> Panel {
    let largest = case.dynamic.max_orthogonal_error;
    let hides = run.noise > NOISE_BESIDE * largest;
    let title = dynamic_alone(largest, run.noise, hides, &run.units[0]);
    let mut panel = Panel::new(&title, depth_axis(run), Axis::linear("orthogonal error", &run.units[0]));
    panel.description = format!("Orthogonal error of the dynamic paddles, tissue {}", case.tissue.name());
    if run.noise > 0.0 && !hides {
        panel.lines.push(ReferenceLine::new("1 σ of the sensor's noise", Place::Y(run.noise), Dash::DashDot));
    }
    panel.series.push(Series::curve("dynamic", Colour::Blue, Dash::Solid, errors(&case.dynamic)));
    panel
}

/// How far the dynamic paddles are displaced.
fn paddle_panel(run: &SpaceRun, case: &SpaceCase) -> Panel {
    let norm = |p: &[f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let farthest = case.dynamic.series.iter().flat_map(|point| &point.paddles).map(norm).fold(0.0, f64::max);
    let title = format!("Paddle displacement: at most {}", with_unit(farthest, &run.units[0]));
    let mut panel = Panel::new(&title, depth_axis(run), Axis::linear("displacement", &run.units[0]));
    panel.description = "Length of the dynamic paddles' displacements along the insertion".to_owned();
    let looks = [(Colour::Blue, Dash::Solid), (Colour::Green, Dash::DashDot)];
    for ((place, index), (colour, dash)) in case.dynamic.paddles.iter().enumerate().zip(looks) {
        let points =
            case.dynamic.series.iter().filter_map(|point| Some((point.depth, norm(point.paddles.get(place)?))));
        panel.series.push(Series::curve(&format!("paddle {index}"), colour, dash, points.collect()));
    }
    panel
}
