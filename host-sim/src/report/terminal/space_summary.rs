//! A run in space on a screen.

use std::fmt::Write as _;
use std::path::Path;

use crate::bench::in_space::{SpaceRun, SpaceStrategyResult};
use model_offline::number::length;

/// Everything that a person wants to know first.
pub fn summary(run: &SpaceRun, directory: &Path) -> String {
    let unit = &run.units[0];
    let mut out = format!(
        "{} · in space · {} nodes · insertion to {} {unit} in {} s · loop {} Hz, target seen at {} Hz, {} ms late, noise {} {unit}\n",
        run.scene,
        run.nodes,
        length(run.depth),
        run.insertion_s,
        run.rate_hz,
        run.target_rate_hz,
        run.target_latency_ms,
        length(run.noise),
    );
    for case in &run.cases {
        let _ = writeln!(
            out,
            "\n{} tissue, table of {} tissue\n  {:<24} {:>14} {:>14} {:>14}  state",
            case.tissue.name(),
            case.table_tissue.name(),
            "",
            "max error",
            "RMS",
            "paddle travel"
        );
        for (name, result) in [("none", &case.none), ("static", &case.fixture), ("dynamic", &case.dynamic)] {
            let _ = writeln!(out, "  {:<24} {}", format!("{name}{}", paddles(result)), numbers(result));
        }
        let _ = writeln!(
            out,
            "  dynamic is {:.1} times better than the best fixture, {:.1} times better than nothing",
            case.improvement, case.improvement_over_none
        );
        let plant = &case.dynamic.plant;
        let checked = plant.largest_error.map_or_else(|| "not checked".to_owned(), length);
        let _ = writeln!(
            out,
            "  tissue: {} states, {:.1} µs a step, estimated within {}, {checked} found; {} steps by the full model",
            plant.tabulation.knots,
            plant.step_us,
            length(plant.largest_estimate),
            plant.fallbacks
        );
    }
    let _ = writeln!(out, "\n{:.1} s · {}", run.wall_s, directory.join("report.html").display());
    out
}

fn paddles(result: &SpaceStrategyResult) -> String {
    let names: Vec<String> = result.paddles.iter().map(u32::to_string).collect();
    if names.is_empty() { String::new() } else { format!(" (paddle {})", names.join(" + ")) }
}

fn numbers(result: &SpaceStrategyResult) -> String {
    let state = result.final_state.map_or_else(String::new, |mode| mode.to_string());
    format!(
        "{:>14} {:>14} {:>14}  {state}",
        length(result.max_orthogonal_error),
        length(result.rms_orthogonal_error),
        length(result.paddle_travel),
    )
}
