//! The report: one HTML file and pictures, made from a [`RunResult`] alone.
//!
//! The page needs no network and no script to be read: the script only moves the bodies along the insertion. Charts come
//! from [`model_offline::output::chart`] and are styled by the page, so that they follow light, dark and print.

mod attachments;
mod conclusion;
mod embed;
mod fields;
mod insertion;
mod ledger;
mod placement;
mod scene;
mod settings;
mod slider;
pub(super) mod space;
pub(crate) mod space_view;
mod style;
mod timing;
mod view;

pub use self::attachments::Attachments;

#[cfg(test)]
mod tests;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use model_offline::output::chart::number::{in_unit, number, plain};
use model_offline::output::chart::{Drawing, Figure, Panel, heading, sheet};

use self::embed::{charts, head_of, inline, panels};
use self::insertion::{CaseCharts, case_charts, case_name, cause_panel, error_panels, needle_panels};
use super::paper::is_paper;
use crate::bench::result::{CaseResult, PlacementResult, RunResult, StrategyResult};
use crate::bench::strategy::Strategy;

const SCRIPT: &str = concat!(include_str!("common.js"), include_str!("page.js"), include_str!("charts.js"));

/// Identifiers and titles of the parts.
const PARTS: [(&str, &str); 7] = [
    ("scene", "The scene"),
    ("static", "Static paddle: error against position"),
    ("controllability", "Dynamic paddle: controllability"),
    ("insertion", "Error along the insertion"),
    ("timing", "Timing of the loop"),
    ("ledger", "Ledger"),
    ("repeat", "To repeat it"),
];

/// Columns of the first table.
const COLUMNS: [&str; 7] =
    ["tissue", "no paddle", "static", "dynamic", "static / dynamic", "none / dynamic", "table made from"];

fn head(run: &RunResult) -> Markup {
    let unit = &run.units[0];
    html! {
        p.quiet { "Stillpoint report" }
        h1 { "Scene " (run.scene) }
        @for sentence in conclusion::sentences(run) { p.lead { (sentence) } }
        div.scroll { table.cards {
            caption { span {
                (in_unit("Largest target displacement orthogonal to the needle", unit)) " over an insertion of "
                (plain(run.settings.depth)) @if unit != "1" { " " (unit) } " in " (plain(run.settings.insertion_s)) " s; paddle in brackets"
            } }
            thead { tr {
                @for (place, title) in COLUMNS.into_iter().enumerate() { th.left[place + 1 == COLUMNS.len()] { (title) } }
            } }
            tbody { @for case in &run.cases { tr { (case_cells(run, case)) } } }
        } }
        p.quiet {
            "Strategies compared in " (run.mode) ", seed " (run.seed) ". Lengths are in the scene's own unit"
            @if unit == "1" { ", which has no name" } @else { ", " (unit) } "."
        }
        @if is_paper(&run.scene) {
            p.notice {
                b { "The geometry is inferred." } " The paper's Figure 1 survives only as its caption. Outline, immobile \
                edge and needle contact of this scene were chosen so that all four optima that the paper reports come out; \
                paddles and material are from its Tables I and II. Agreement of the optima is therefore no independent \
                confirmation, and single values are not expected to match."
            }
        }
        nav { ol { @for (id, title) in PARTS { li { a href=(format!("#{id}")) { (title) } } } } }
    }
}

/// One case's numbers, each with its column's title, which narrow screens show beside it.
fn case_cells(run: &RunResult, case: &CaseResult) -> Markup {
    let factor = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |factor| number(factor, 3));
    let stillest = |strategy: Strategy| case.stillest() == strategy;
    let cells = [
        (case.tissue.to_string(), false),
        (largest(run.without_paddle(case)), stillest(Strategy::None)),
        (largest(case.strategies.static_paddle.as_ref()), stillest(Strategy::Static)),
        (largest(case.strategies.controlled()), stillest(Strategy::Dynamic)),
        (factor(case.improvement), false),
        (factor(case.improvement_over_none), false),
        (case.table_tissue.to_string(), false),
    ];
    html! {
        @for (place, (title, (cell, is_best))) in COLUMNS.into_iter().zip(cells).enumerate() {
            td.best[is_best].left[place + 1 == COLUMNS.len()] data-title=(title) { (cell) }
        }
    }
}

fn largest(strategy: Option<&StrategyResult>) -> String {
    strategy.map_or_else(
        || "–".to_owned(),
        |strategy| {
            let paddle = strategy.paddle.map_or_else(String::new, |index| format!(" ({index})"));
            format!("{}{paddle}", number(strategy.max_orthogonal_error, 3))
        },
    )
}

fn part(number: usize, content: &Markup) -> Markup {
    let (id, title) = PARTS[number];
    html! { section id=(id) { h2 { (number + 1) ". " (title) } (content) } }
}

fn scene_part(run: &RunResult, surface: &scene::Surface) -> Markup {
    let frames = run.results().map(|strategy| strategy.frames.len()).max().unwrap_or(0);
    html! {
        figure.scene { (inline(&scene::at_rest(run))) figcaption {
            "At rest: outline, nodes (dots), immobile boundary (hatched), needle with its contact and direction, paddle \
             positions with their numbers (the best dynamic one blue, with a star, the best static one orange, the others grey)"
            @if !run.geometry.inclusions.is_empty() { ", inclusion of the tissue “inclusion”" }
            ", target (ring with cross). Equal scales on both axes."
        } }
        h3 { "The body under each strategy" }
        p { "At the end of the insertion, or wherever the slider is. Colour is what is chosen below, the size of the \
             displacement from rest at first; dashed is the outline at rest, white are inclusions. Displacements are drawn as they are, not enlarged." }
        (controls(run))
        @for (i, case) in run.cases.iter().enumerate() {
            div data-case=(i) { h3 { "Tissue: " (case_name(case)) } (scene::bodies(run, surface, i, case)) }
        }
        figure.colours { (inline(&surface.colour_bar(run))) }
        p.quiet {
            @if frames > 1 { "Between " (frames) " solved states per strategy the slider interpolates. " }
            span.needs-script { "Values appear under the pointer. " }
            "Without a paddle, what the table knows makes no difference."
        }
    }
}

/// What the bodies show: case, depth, field, and how much of the body.
fn controls(run: &RunResult) -> Markup {
    html! {
        fieldset.needs-script.on-screen {
            legend { "Along the insertion" }
            @for (i, case) in run.cases.iter().enumerate() {
                label { input type="radio" name="case" value=(i) checked[i == 0]; " " (case_name(case)) } " "
            }
            div.slide {
                label for="depth-slider" { (in_unit("needle depth", &run.units[0])) }
                input #depth-slider type="range" min="0" max="200" value="200";
                output #depth-reading for="depth-slider" {}
            }
            div.slide {
                label for="field" { "colour" }
                select #field { @for field in scene::Surface::fields(run) { option value=(field.key) { (field.label) } } }
                label for="part" { "of" }
                select #part { option value="whole" { "the whole body" } option value="near" { "the target's surroundings" } }
            }
        }
    }
}

fn static_part(run: &RunResult) -> Markup {
    html! {
        p { "The paddle is attached and held while the needle goes in. The best place is where the target's largest \
             displacement orthogonal to the needle is smallest." }
        (panels(&placement::static_charts(run)))
        @if is_paper(&run.scene) {
            p.quiet { "The values of the paper's Figures 2 and 3 are not available, only the optima that its text names: \
                       4 in homogeneous tissue, 2 with the inclusion. These are marked." }
        }
        (placement::static_table(run))
    }
}

fn controllability_part(run: &RunResult) -> Markup {
    html! {
        p { "How far the paddle has to move to move the target by one unit orthogonal to the needle: ‖J⁻¹n‖, where J is \
             d(target)/d(paddle) at rest with the needle held. Less is better." }
        (panels(&placement::controllability_charts(run)))
        (placement::controllability_table(run))
    }
}

fn insertion_part(run: &RunResult, cases: &[CaseCharts]) -> Markup {
    html! {
        p { "Signed displacement of the true target orthogonal to the needle. The dynamic error is also drawn alone, \
             on its own scale." }
        @for (case, drawn) in run.cases.iter().zip(cases) {
            h3 { "Tissue: " (case_name(case)) }
            (charts(&drawn.drawings()))
            @if let Some(table) = insertion::cause_table(run, case) { (table) }
        }
        (insertion::table(run))
    }
}

/// The page.
pub fn render(run: &RunResult) -> String {
    render_with(run, &Attachments::default())
}

/// The page with what other commands have left beside it.
pub fn render_with(run: &RunResult, attachments: &Attachments) -> String {
    let attached = attachments.section();
    let surface = scene::Surface::new(run);
    let cases: Vec<CaseCharts> = run.cases.iter().enumerate().map(|(i, case)| case_charts(run, i, case)).collect();
    let parts = [
        scene_part(run, &surface),
        static_part(run),
        controllability_part(run),
        insertion_part(run, &cases),
        timing::section(run),
        ledger::section(run),
        settings::section(run),
    ];
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head_of(&run.scene))
            body {
                main {
                    (head(run))
                    @for (i, content) in parts.iter().enumerate() { (part(i, content)) }
                    @if let Some(attached) = &attached {
                        section #attached { h2 { (parts.len() + 1) ". From other commands" } (attached) }
                    }
                }
                div #tip.on-screen hidden {}
                script type="application/json" #insertion-data { (PreEscaped(slider::data(run, &surface, &cases))) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

/// Panels as a file of their own.
fn figure(title: String, panels: Vec<Panel>, columns: usize) -> String {
    Figure { title, caption: String::new(), panels, columns }.svg()
}

/// The best paddle of every tissue.
fn best(run: &RunResult, of: fn(&PlacementResult) -> String) -> String {
    let names = run.placements.iter().map(|placement| format!("{} {}", placement.tissue, of(placement)));
    names.collect::<Vec<_>>().join(", ")
}

/// The scene at rest and its body side by side, under a title.
fn scene_picture(run: &RunResult, drawings: &[Drawing]) -> String {
    let title = format!("Scene {}: at rest, and at full depth under the dynamic paddle", run.scene);
    let scene = sheet("", drawings, 2);
    let caption =
        "Dots: nodes; hatched: immobile; ring: target; numbers: paddle positions, the best dynamic one with a star.";
    sheet(&title, &[heading(&title, caption, scene.size[0]), scene], 1).file()
}

/// Pictures for use elsewhere: file name and SVG, on a white ground.
pub fn pictures(run: &RunResult) -> Vec<(&'static str, String)> {
    let surface = scene::Surface::new(run);
    let mut scene = vec![scene::at_rest(run)];
    if let Some((i, case)) = run.cases.iter().enumerate().find(|(_, case)| case.strategies.controlled().is_some()) {
        let name = format!("dynamic, case {i}");
        let body = |strategy| surface.body(run, case.tissue, (String::new(), &name), strategy);
        let body = case.strategies.controlled().map(body);
        scene.extend(body.map(|body| sheet("", &[body, surface.colour_bar(run)], 1)));
    }
    let panels = |of: fn(&RunResult, &CaseResult) -> Vec<(&'static str, Panel)>| -> Vec<Panel> {
        run.cases.iter().flat_map(|case| of(run, case)).map(|(_, panel)| panel).collect()
    };
    let (insertion, needle) = (panels(error_panels), panels(needle_panels));
    let columns = insertion.len().checked_div(run.cases.len()).unwrap_or(1);
    let reduction = conclusion::factors(run, |case| case.improvement).map_or_else(
        || "Error along the insertion".to_owned(),
        |change| format!("The dynamic paddle's largest error is {change} than the static one's"),
    );
    let static_title = format!("Best static paddle: {}", best(run, |placement| placement.best_static.to_string()));
    let dynamic_title = format!("Best dynamic paddle: {}", best(run, PlacementResult::dynamic_name));
    let mut pictures = vec![
        ("scene.svg", scene_picture(run, &scene)),
        ("static-error.svg", figure(static_title, placement::static_charts(run), 2)),
        ("controllability.svg", figure(dynamic_title, placement::controllability_charts(run), 2)),
        ("error-along-insertion.svg", figure(reduction, insertion, columns)),
    ];
    if !needle.is_empty() {
        pictures.push(("needle-forces.svg", figure("Forces on the needle and slip along it".to_owned(), needle, 2)));
    }
    let causes: Vec<Panel> = run.cases.iter().filter_map(|case| cause_panel(run, case)).collect();
    if !causes.is_empty() {
        pictures.push(("causes.svg", figure("What the controller's error is made of".to_owned(), causes, 1)));
    }
    let mut timing = timing::charts(run);
    timing.truncate(3);
    if !timing.is_empty() {
        pictures
            .push(("timing-histogram.svg", figure("Timing of the controller's loop, free-run".to_owned(), timing, 3)));
    }
    pictures
}

/// Histograms of loops with bins of 1 µs and logarithmic axes, as one picture.
pub fn timing_histograms(loops: &[(&str, &crate::runtime::time::durations::LoopTiming)]) -> String {
    figure("Timing of the loops".to_owned(), timing::histograms(loops), 3)
}
