//! What `timing` says on the terminal.

use std::fmt::Write as _;

use crate::bench::timing::{LeftRun, SweepResult, TimingResult};
use crate::runtime::accounting::ledger::TickResult;
use crate::runtime::names;
use crate::runtime::time::clock::SchedulingPolicy;
use crate::runtime::time::durations::{Distribution, LoopTiming};

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// The line that users of cyclictest know, in µs, and the percentiles that it does not have.
fn cyclictest(number: usize, priority: u8, timing: &LoopTiming, last_ns: u64) -> String {
    let lateness = &timing.release_lateness;
    let priority = if matches!(timing.scheduling.policy, SchedulingPolicy::Fifo { .. }) { priority } else { 0 };
    format!(
        "T:{number:2} ({:5}) P:{priority:2} I:{:.0} C:{:7} Min:{:7.0} Act:{:5.0} Avg:{:5.0} Max:{:8.0}",
        std::process::id(),
        1e6 / timing.rate_hz,
        timing.ticks,
        us(lateness.min_ns),
        us(last_ns),
        lateness.mean_ns * 1e-3,
        us(lateness.max_ns),
    )
}

fn percentiles(what: &str, of: &Distribution) -> String {
    let rare = of.p9999_ns.map_or_else(|| format!("{:>8}", "–"), |ns| format!("{:8.2}", us(ns)));
    format!(
        "  {what:<34} p50 {:8.2}  p99 {:8.2}  p99.9 {:8.2}  p99.99 {rare}  max {:9.2} µs",
        us(of.p50_ns),
        us(of.p99_ns),
        us(of.p999_ns),
        us(of.max_ns),
    )
}

fn ratio(what: &str, ratios: &[f64]) -> String {
    let mut sorted = ratios.to_vec();
    sorted.sort_by(f64::total_cmp);
    match (sorted.first(), sorted.get(sorted.len() / 2), sorted.last()) {
        (Some(least), Some(median), Some(most)) => {
            format!("{what}: {median:.2} (from {least:.2} to {most:.2} in {} rounds)", sorted.len())
        }
        _ => format!("{what}: every block was void"),
    }
}

/// Everything, for the terminal; `priority` is what was asked for.
pub fn timing_summary(result: &TimingResult, priority: u8) -> String {
    let mut text = String::new();
    // A string takes everything.
    let _ = write_loops(&mut text, result, priority).and_then(|()| write_exchanges(&mut text, result));
    text
}

/// The loops on the machine's clock.
fn write_loops(text: &mut String, result: &TimingResult, priority: u8) -> std::fmt::Result {
    writeln!(
        text,
        "obtained: {}; memory locked: {}; processors: {}",
        result.controller.scheduling.policy,
        if result.controller.scheduling.memory_locked { "yes" } else { "no" },
        if result.pinned { "as asked for" } else { "left to the kernel" },
    )?;
    let loops = [("empty loop", &result.empty), ("controller", &result.controller), ("exchange", &result.exchange)];
    for (number, ((name, timing), more)) in loops.into_iter().zip(&result.blocks).enumerate() {
        writeln!(text, "{}  {name}", cyclictest(number, priority, timing, more.last_lateness_ns))?;
        write_loop(text, timing, more.input_age.as_ref())?;
        let disturbance = &more.disturbance;
        writeln!(
            text,
            "  context switches {} voluntary, {} involuntary; steal {} ms; void blocks {} of {}",
            disturbance.voluntary_switches,
            disturbance.involuntary_switches,
            disturbance.steal_ms.map_or_else(|| "?".to_owned(), |steal| steal.to_string()),
            more.voided_blocks,
            more.blocks,
        )?;
        for outside in &more.outside_run {
            writeln!(text, "  outside of RUN:")?;
            write_loop(text, outside, None)?;
        }
    }
    write_void(text, result)?;
    writeln!(text, "{}", ratio("median wake latency, controller / empty loop", &result.lateness_ratios))?;
    writeln!(text, "{}", ratio("median wake latency, exchange / empty loop", &result.exchange_lateness_ratios))?;
    write_ledger(text, "controller", &result.ledger)?;
    write_ledger(text, "exchange", &result.exchange_ledger)
}

/// A loop's figures, labelled by the controller's mode.
fn write_loop(text: &mut String, timing: &LoopTiming, input_age: Option<&Distribution>) -> std::fmt::Result {
    let mode = timing.mode.map_or_else(String::new, |mode| format!("{}: ", mode.name()));
    let label = |what: &str| format!("{mode}{what}");
    writeln!(text, "{}", percentiles(&label("wake latency"), &timing.release_lateness))?;
    writeln!(text, "{}", percentiles(&label("execution"), &timing.execution_time))?;
    if let Some(age) = input_age {
        writeln!(text, "{}", percentiles(&label("input age at actuation"), age))?;
    }
    writeln!(text, "{}", percentiles(&label("end to end"), &timing.response_time))?;
    writeln!(
        text,
        "  {} {}, overruns {}, skipped {}",
        label("deadline misses"),
        timing.deadline_misses,
        timing.overruns,
        timing.skipped
    )
}

/// Which rounds say nothing about RUN, and why.
fn write_void(text: &mut String, result: &TimingResult) -> std::fmt::Result {
    for left in &result.left_run {
        let LeftRun { measurement, round, tick, mode, faults } = left;
        let mode = names::mode::name(*mode);
        writeln!(text, "VOID: {measurement}, round {round}: RUN ended in {mode} at release {tick}: {faults}")?;
    }
    Ok(())
}

fn write_ledger(text: &mut String, name: &str, ticks: &TickResult) -> std::fmt::Result {
    writeln!(
        text,
        "ledger, {name}: {} due = {} RUN + {} HOLD + {} SAFE + {} skipped, unaccounted {}",
        ticks.due, ticks.run, ticks.hold, ticks.safe, ticks.skipped, ticks.unaccounted
    )
}

/// Steps and exchanges without a schedule, and the sweep.
fn write_exchanges(text: &mut String, result: &TimingResult) -> std::fmt::Result {
    writeln!(text, "back to back, in RUN:")?;
    writeln!(text, "{}", percentiles("clock read twice", &result.clock))?;
    writeln!(text, "{}", percentiles("step, with both clock readings", &result.step))?;
    writeln!(text, "sample published to command received, both sides polling:")?;
    let names = ["shared memory, controller's step", "bare iceoryx2, no step", "Unix socket, controller's step"];
    for (name, distribution) in names.into_iter().zip(&result.polled) {
        writeln!(text, "{}", percentiles(name, distribution))?;
    }
    writeln!(text, "{}", ratio("medians, shared memory / bare iceoryx2", &result.link_over_bare))?;
    writeln!(text, "{}", ratio("medians, Unix socket / shared memory", &result.socket_over_link))?;
    for SweepResult { rate_hz, ticks, deadline_misses } in &result.sweep {
        writeln!(
            text,
            "sweep: {rate_hz:6.0} Hz, {:6} releases, {} in RUN: {deadline_misses} deadline misses, {} skipped",
            ticks.due, ticks.run, ticks.skipped
        )?;
    }
    if !result.sweep.is_empty() {
        // The highest one below which none was missed either.
        let is_clean = |rate: &&SweepResult| rate.deadline_misses == 0 && rate.ticks.run == rate.ticks.due;
        match result.sweep.iter().take_while(is_clean).last() {
            Some(rate) => writeln!(text, "highest rate in RUN without a missed deadline: {:.0} Hz", rate.rate_hz)?,
            None => writeln!(text, "no rate in RUN without a missed deadline")?,
        }
    }
    writeln!(text, "This describes this machine while it ran: no worst case, and nothing about hard real time.")
}
