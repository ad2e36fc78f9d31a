//! How punctual the loops were.

use maud::{Markup, html};
use model_offline::output::chart::number::{count, number};
use model_offline::output::chart::{Axis, Bars, Colour, Dash, Panel, Place, ReferenceLine};

use super::embed::panels;
use crate::bench::result::RunResult;
use crate::runtime::error::Role;
use crate::runtime::time::durations::{Distribution, LoopTiming};

/// A loop on the machine's clock.
struct Loop<'r> {
    /// Tissue and side.
    name: String,
    side: Role,
    timing: &'r LoopTiming,
}

/// Both sides of every case that ran on the machine's clock.
fn loops(run: &RunResult) -> Vec<Loop<'_>> {
    let free_runs = run.cases.iter().filter_map(|case| case.strategies.dynamic_free_run.as_ref().map(|s| (case, s)));
    free_runs
        .flat_map(|(case, strategy)| {
            let tissue = if case.table_tissue.is(case.tissue) {
                case.tissue.to_string()
            } else {
                format!("{} with the table of {}", case.tissue, case.table_tissue)
            };
            let sides = [(Role::Controller, &strategy.timing), (Role::Plant, &strategy.plant_timing)];
            let measured = sides.into_iter().filter_map(|(side, timing)| Some((side, timing.as_ref()?)));
            measured.map(move |(side, timing)| Loop { name: format!("{tissue}: {side}"), side, timing })
        })
        .collect()
}

fn distributions(timing: &LoopTiming) -> [(&'static str, &Distribution); 3] {
    [
        ("release lateness", &timing.release_lateness),
        ("execution time", &timing.execution_time),
        ("response time", &timing.response_time),
    ]
}

/// The same, and the ages of what the actuator acted on: the plant knows them.
fn all_distributions(timing: &LoopTiming) -> Vec<(&'static str, &Distribution)> {
    let ages = [
        ("age of needle and paddle samples at actuation", &timing.input_age),
        ("age of the target sample at actuation", &timing.target_age),
    ];
    let ages = ages.into_iter().filter_map(|(what, of)| of.as_ref().map(|of| (what, of)));
    distributions(timing).into_iter().chain(ages).collect()
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// The power of ten at or above a value.
fn next_power(value: f64) -> f64 {
    10f64.powi((value * 0.999_999).log10().ceil() as i32)
}

fn histogram(name: &str, what: &str, distribution: &Distribution, period_us: f64) -> Panel {
    // Bin 0 has no left end on a logarithmic axis; half a microsecond stands for it.
    let [left, right] = [|bin: u64| (bin as f64).max(0.5), |bin: u64| bin as f64 + 1.0];
    let bins = &distribution.bins_us;
    let first = bins.first().map_or(1.0, |bin| left(bin.0));
    let low = 10f64.powi(first.log10().floor() as i32).max(0.5);
    let high = bins.last().map_or(10.0, |bin| right(bin.0)).max(period_us);
    let most = bins.iter().map(|bin| bin.1).max().unwrap_or(1) as f64;
    let [median, late] = [distribution.p50_ns, distribution.p999_ns].map(us);
    let mut panel = Panel::new(
        &format!("{name}: {what} below {} µs in 99.9 % of the ticks", number(late, 3)),
        Axis::log(what, "µs").range(low, next_power(high)),
        Axis::log("ticks per bin of 1 µs", "").range(0.7, next_power(most.max(1.4))),
    );
    panel.description = format!("Histogram of the {what}, {name}");
    let bars = bins.iter().map(|(bin, ticks)| [left(*bin), right(*bin), *ticks as f64]).collect();
    panel.bars.push(Bars { label: String::new(), colour: Colour::Blue, bars });
    panel.lines = vec![
        ReferenceLine::new(&format!("median {} µs", number(median, 3)), Place::X(median), Dash::Dashed),
        ReferenceLine::new(&format!("99.9 % {} µs", number(late, 3)), Place::X(late), Dash::Dotted),
        ReferenceLine::new(&format!("period {} µs", number(period_us, 3)), Place::X(period_us), Dash::Solid),
    ];
    panel
}

/// Three histograms per loop.
pub(super) fn histograms(loops: &[(&str, &LoopTiming)]) -> Vec<Panel> {
    loops
        .iter()
        .flat_map(|(name, timing)| {
            let period_us = 1e6 / timing.rate_hz;
            distributions(timing).map(|(what, distribution)| histogram(name, what, distribution, period_us))
        })
        .collect()
}

/// Three histograms per controller.
pub(super) fn charts(run: &RunResult) -> Vec<Panel> {
    let loops = loops(run);
    let controllers = loops.iter().filter(|of| of.side == Role::Controller);
    histograms(&controllers.map(|of| (of.name.as_str(), of.timing)).collect::<Vec<_>>())
}

fn percentiles(run: &RunResult) -> Markup {
    html! {
        div.scroll { table {
            caption { span { "Durations in µs, from the scheduled release; free-run only" } }
            thead { tr {
                th { "loop" } th.left { "duration" } th { "ticks" } th { "min" } th { "mean" } th { "p50" } th { "p99" }
                th { "p99.9" } th { "p99.99" } th { "max" }
            } }
            tbody { @for Loop { name, timing, .. } in loops(run) { @for (what, of) in all_distributions(timing) {
                tr {
                    td { (name) } td.left { (what) } td { (count(of.count)) } td { (number(us(of.min_ns), 3)) }
                    td { (number(of.mean_ns * 1e-3, 3)) }
                    @for ns in [Some(of.p50_ns), Some(of.p99_ns), Some(of.p999_ns), of.p9999_ns, Some(of.max_ns)] {
                        td { @if let Some(ns) = ns { (number(us(ns), 3)) } @else { "–" } }
                    }
                }
            } } }
        } }
    }
}

fn counts(run: &RunResult) -> Markup {
    html! {
        div.scroll { table {
            caption { span { "What the schedules counted" } }
            thead { tr {
                th { "loop" } th { "rate [Hz]" } th { "ticks run" } th { "deadline misses" } th { "overruns" }
                th { "periods skipped" } th.left { "scheduling obtained" } th.left { "memory locked" }
            } }
            tbody { @for Loop { name, timing, .. } in loops(run) {
                tr {
                    td { (name) } td { (number(timing.rate_hz, 4)) } td { (count(timing.ticks)) }
                    td { (count(timing.deadline_misses)) } td { (count(timing.overruns)) } td { (count(timing.skipped)) }
                    td.left { (timing.scheduling.policy) }
                    td.left { @if timing.scheduling.memory_locked { "yes" } @else { "no" } }
                }
            } }
        } }
    }
}

/// The part of the page.
pub(super) fn section(run: &RunResult) -> Markup {
    let none = loops(run).is_empty();
    html! {
        p {
            "Every figure here is from " b { "free-run" } ": controller and plant are two processes that follow the \
             machine's steady clock with absolute deadlines. " b { "Lockstep" } " takes its time from messages and has \
             no timing; no figure here is from it."
        }
        @if none {
            p { b { "This run had no free-run part, so there is nothing to show." }
                " Run it with " code { "--mode free-run" } " for these figures." }
        } @else {
            (counts(run))
            (percentiles(run))
            (panels(&charts(run)))
            p.quiet {
                "Release lateness is start minus scheduled release, execution time end minus start, response time end \
                 minus scheduled release. A deadline miss is a response longer than the period. A period that had passed \
                 already is skipped, never made up for; its release is a miss too, late until the next step: a stop is \
                 in these figures from the first release that it swallowed. The 99.99th percentile needs 10,000 values. \
                 Both axes are logarithmic: one late tick in thousands is seen."
            }
            p.notice {
                "What this does not say: nothing here is a guarantee. It is a measurement on a general-purpose operating \
                 system, not hard real-time. On a virtual machine the tails describe the host and its other guests rather \
                 than this program."
            }
        }
    }
}
