//! What `timing` says on the terminal.

use super::TimingResult;
use crate::bench::result::{Distribution, LoopTiming};

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// The line that users of cyclictest know, in µs, and the percentiles that it does not have.
fn cyclictest(number: usize, priority: u8, timing: &LoopTiming, last_ns: u64) -> String {
    let lateness = &timing.release_lateness;
    let priority = if timing.scheduling.policy.starts_with("SCHED_FIFO") { priority } else { 0 };
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
    format!(
        "  {what:<34} p50 {:8.2}  p99 {:8.2}  p99.9 {:8.2}  p99.99 {:8.2}  max {:9.2} µs",
        us(of.p50_ns),
        us(of.p99_ns),
        us(of.p999_ns),
        us(of.p9999_ns),
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

/// Prints everything.
pub(super) fn print(result: &TimingResult, priority: u8) {
    println!(
        "obtained: {}; memory locked: {}; processors: {}",
        result.controller.scheduling.policy,
        if result.controller.scheduling.memory_locked { "yes" } else { "no" },
        if result.pinned { "as asked for" } else { "left to the kernel" },
    );
    let loops = [("empty loop", &result.empty), ("controller", &result.controller), ("exchange", &result.exchange)];
    for (number, ((name, timing), more)) in loops.into_iter().zip(&result.blocks).enumerate() {
        println!("{}  {name}", cyclictest(number, priority, timing, more.last_lateness_ns));
        println!("{}", percentiles("wake latency", &timing.release_lateness));
        println!("{}", percentiles("execution", &timing.execution_time));
        if let Some(age) = &more.input_age {
            println!("{}", percentiles("input age at actuation", age));
        }
        println!("{}", percentiles("end to end", more.end_to_end.as_ref().unwrap_or(&timing.response_time)));
        let disturbance = &more.disturbance;
        println!(
            "  deadline misses {}, overruns {}, skipped {}; context switches {} voluntary, {} involuntary; steal {} ms; \
             void blocks {} of {}",
            timing.deadline_misses,
            timing.overruns,
            timing.skipped,
            disturbance.voluntary_switches,
            disturbance.involuntary_switches,
            disturbance.steal_ms.map_or_else(|| "?".to_owned(), |steal| steal.to_string()),
            more.voided_blocks,
            more.blocks,
        );
    }
    println!("{}", ratio("median wake latency, controller / empty loop", &result.lateness_ratios));
    println!("{}", ratio("median wake latency, exchange / empty loop", &result.exchange_lateness_ratios));
    let ticks = &result.ledger;
    println!(
        "ledger: {} due = {} RUN + {} HOLD + {} SAFE + {} skipped, unaccounted {}",
        ticks.due, ticks.run, ticks.hold, ticks.safe, ticks.skipped, ticks.unaccounted
    );
    println!("back to back:");
    println!("{}", percentiles("clock read twice", &result.clock));
    println!("{}", percentiles("step, with both clock readings", &result.step));
    println!("sample published to command received, both sides polling:");
    let names = ["shared memory, controller's step", "bare iceoryx2, no step", "Unix socket, controller's step"];
    for (name, distribution) in names.into_iter().zip(&result.polled) {
        println!("{}", percentiles(name, distribution));
    }
    println!("{}", ratio("medians, shared memory / bare iceoryx2", &result.link_over_bare));
    println!("{}", ratio("medians, Unix socket / shared memory", &result.socket_over_link));
    for (rate, ticks, misses, skipped) in &result.sweep {
        println!("sweep: {rate:6.0} Hz, {ticks:6} ticks: {misses} deadline misses, {skipped} skipped");
    }
    if !result.sweep.is_empty() {
        // The highest one below which none was missed either.
        let clean = result.sweep.iter().take_while(|(_, _, misses, skipped)| misses + skipped == 0).last();
        match clean {
            Some((rate, ..)) => println!("highest rate without a missed deadline: {rate:.0} Hz"),
            None => println!("no rate without a missed deadline"),
        }
    }
    println!("This describes this machine while it ran: no worst case, and nothing about hard real time.");
}
