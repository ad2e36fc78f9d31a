//! A run in space on a screen.

use std::fmt::Write as _;
use std::path::Path;

use super::summary::{FreeRun, share, write_early_end, write_free_runs, write_ledgers};
use crate::bench::in_space::{SpaceRun, SpaceStrategyResult};
use crate::report::below_noise::below_noise_in_space;
use crate::runtime::time::mode::RunMode;
use model_offline::number::{in_unit, length};

/// Everything that a person wants to know first.
pub fn summary(run: &SpaceRun, directory: &Path) -> String {
    let unit = &run.units[0];
    let mut out = format!(
        "{} · in space · {} nodes · insertion to {} in {} s · loop {} Hz, target seen at {} Hz, {} ms late, noise {}\n",
        run.scene,
        run.nodes,
        in_unit(run.depth, unit),
        run.insertion_s,
        run.rate_hz,
        run.target_rate_hz,
        run.target_latency_ms,
        in_unit(run.noise, unit),
    );
    for case in &run.cases {
        let _ = writeln!(
            out,
            "\n{} tissue, table of {} tissue\n  {:<34} {:>14} {:>14} {:>14}  state",
            case.tissue.name(),
            case.table_tissue.name(),
            "",
            "max error",
            "RMS",
            "paddle travel"
        );
        let strategies =
            [("none", Some(&case.none)), ("static", Some(&case.fixture)), ("dynamic", Some(&case.dynamic))];
        let once_more = ("dynamic, free-run", case.dynamic_free_run.as_ref());
        let strategies = strategies.into_iter().chain([once_more]);
        for (name, result) in strategies.filter_map(|(name, result)| Some((name, result?))) {
            let _ = writeln!(out, "  {:<34} {}", format!("{name}{}", paddles(result)), numbers(result));
        }
        let _ = writeln!(
            out,
            "  dynamic: {}, {}",
            share(case.improvement, "the best static paddles' error"),
            share(case.improvement_over_none, "that of none")
        );
        // A string takes everything.
        let _ = write_early_end(&mut out, case.tissue, case.table.ends_early.as_deref());
        let plant = &case.dynamic.plant;
        let checked = plant.largest_error.map_or_else(|| "not checked".to_owned(), |error| in_unit(error, unit));
        let _ = writeln!(
            out,
            "  tissue: {} states, {:.1} µs a step, estimated within {}, {checked} found; {} steps by the full model",
            plant.tabulation.knots,
            plant.step_us,
            in_unit(plant.largest_estimate, unit),
            plant.fallbacks
        );
    }
    if let Some(why) = below_noise_in_space(run) {
        let _ = writeln!(out, "\n{why}");
    }
    // A string takes everything.
    let _ = write_loop(&mut out, run);
    let _ = writeln!(out, "\n{:.1} s · {}", run.wall_s, directory.join("report.html").display());
    out
}

/// Loops on the machine's clock, and the accounts of all controlled runs.
fn write_loop(out: &mut String, run: &SpaceRun) -> std::fmt::Result {
    let controlled = || {
        run.cases
            .iter()
            .flat_map(|case| [Some((case, &case.dynamic)), case.dynamic_free_run.as_ref().map(|r| (case, r))])
            .flatten()
    };
    let on_a_clock = controlled().filter(|(_, result)| result.mode == RunMode::FreeRun);
    let free_runs = on_a_clock.map(|(case, result)| FreeRun {
        tissue: case.tissue,
        timing: [&result.timing, &result.plant_timing],
        final_state: result.final_state,
    });
    write_free_runs(out, run.rate_hz, free_runs)?;
    write_ledgers(out, controlled().filter_map(|(_, result)| result.ledger.as_ref()))
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
