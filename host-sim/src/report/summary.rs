//! The first screen: what was found, in a few lines.

use std::fmt::Write as _;
use std::path::Path;

use model_offline::scene::PlantModel;

use super::paper::paper_optima;
use crate::bench::result::{CaseResult, RunResult, StrategyResult};
use crate::runtime::names;

/// The summary of a run that is at `directory`.
pub fn summary(run: &RunResult, directory: &Path) -> String {
    let mut text = String::new();
    // A string takes everything.
    let _ = write_all(&mut text, run, directory);
    text
}

fn write_all(text: &mut String, run: &RunResult, directory: &Path) -> std::fmt::Result {
    let settings = &run.settings;
    writeln!(text, "Scene {}, {}, seed {}\n", run.scene, run.mode, run.seed)?;
    writeln!(text, "Best paddle       static   dynamic")?;
    for placement in &run.placements {
        let paper = match paper_optima(&run.scene, placement.tissue) {
            None => String::new(),
            Some((static_paddle, dynamic)) => {
                let agrees = (static_paddle, dynamic) == (placement.best_static, placement.best_dynamic);
                let verdict = if agrees { "same" } else { "DIFFERENT" };
                format!("      paper: {static_paddle} and {dynamic}, {verdict}")
            }
        };
        writeln!(
            text,
            "  {:<15} {:>6} {:>9}{paper}",
            placement.tissue.name(),
            placement.best_static,
            placement.best_dynamic
        )?;
    }
    writeln!(
        text,
        "\nLargest target displacement orthogonal to the needle, depth {} in {} s,\n\
         target seen at {} Hz, {} ms late, noise {:.1e}; paddle in brackets",
        settings.depth, settings.insertion_s, settings.target_rate_hz, settings.target_latency_ms, settings.noise
    )?;
    writeln!(text, "  {:<13} {:<13} {:>10} {:>13} {:>13}", "tissue", "table", "none", "static", "dynamic")?;
    for case in &run.cases {
        write_case(text, case)?;
    }
    write_plant(text, run)?;
    write_loop(text, run)?;
    writeln!(text, "\nReport: {}   ({:.1} s)", directory.join("report.html").display(), run.wall_s)
}

fn error(strategy: Option<&StrategyResult>) -> String {
    let Some(strategy) = strategy else {
        return "–".to_owned();
    };
    let paddle = strategy.paddle.map_or_else(String::new, |index| format!(" ({index})"));
    format!("{:.6}{paddle}", strategy.max_orthogonal_error)
}

fn write_case(text: &mut String, case: &CaseResult) -> std::fmt::Result {
    let strategies = &case.strategies;
    let dynamic = strategies.dynamic.as_ref().or(strategies.dynamic_free_run.as_ref());
    write!(
        text,
        "  {:<13} {:<13} {:>10} {:>13} {:>13}",
        case.tissue.name(),
        case.table_tissue,
        error(strategies.none.as_ref()),
        error(strategies.static_paddle.as_ref()),
        error(dynamic),
    )?;
    match (case.improvement, dynamic) {
        (Some(factor), Some(dynamic)) => {
            writeln!(text, "   {factor:.0} times less, {}", names::mode::name(dynamic.final_state))
        }
        _ => writeln!(text),
    }
}

const fn plant_name(model: PlantModel) -> &'static str {
    match model {
        PlantModel::Full => "full",
        PlantModel::Reduced => "reduced",
        PlantModel::Condensed => "condensed",
    }
}

/// What answered for the tissue, where it was not the full model: how far off it was, and how often it could not.
fn write_plant(text: &mut String, run: &RunResult) -> std::fmt::Result {
    for case in &run.cases {
        let strategies = &case.strategies;
        for strategy in [&strategies.dynamic, &strategies.dynamic_free_run].into_iter().flatten() {
            let plant = &strategy.plant;
            if plant.fallbacks == 0 && plant.first_fallback.is_none() && plant.model == PlantModel::Full {
                continue;
            }
            write!(text, "  {}, {}: tissue {}", case.tissue, strategy.mode, plant_name(plant.model))?;
            if let (Some(modes), Some([points, all])) = (plant.modes, plant.points) {
                write!(text, " ({modes} modes, {points} of {all} points)")?;
            }
            write!(text, ", {:.1} µs a step", strategy.plant_step_us)?;
            if let Some(error) = plant.error_at_end {
                write!(text, ", {error:.1e} from the full model at the end")?;
            }
            if plant.fallbacks > 0 {
                write!(text, "; the full model answered {} steps", plant.fallbacks)?;
            }
            match &plant.first_fallback {
                Some(why) => writeln!(text, ": {why}")?,
                None => writeln!(text)?,
            }
        }
    }
    Ok(())
}

fn write_loop(text: &mut String, run: &RunResult) -> std::fmt::Result {
    let strategies = || run.cases.iter().map(|case| &case.strategies);
    let us = |ns: u64| ns as f64 * 1e-3;
    if strategies().any(|strategies| strategies.dynamic_free_run.is_some()) {
        writeln!(text, "\nFree-run at {} Hz, from the scheduled time", run.settings.rate_hz)?;
    }
    for case in &run.cases {
        let free_run = case.strategies.dynamic_free_run.as_ref();
        let Some(timing) = free_run.and_then(|strategy| strategy.timing.as_ref()) else {
            continue;
        };
        let lateness = &timing.release_lateness;
        writeln!(
            text,
            "  {}: {} ticks, lateness p50 {:.0} µs, p99 {:.0} µs, max {:.0} µs; {} deadline misses, {} skipped; {}",
            case.tissue,
            timing.ticks,
            us(lateness.p50_ns),
            us(lateness.p99_ns),
            us(lateness.max_ns),
            timing.deadline_misses,
            timing.skipped,
            timing.scheduling.policy,
        )?;
    }
    let ledgers: Vec<_> = strategies()
        .flat_map(|strategies| [&strategies.dynamic, &strategies.dynamic_free_run])
        .flatten()
        .filter_map(|strategy| strategy.ledger.as_ref())
        .collect();
    let ticks: u64 = ledgers.iter().map(|ledger| ledger.ticks.due).sum();
    let unaccounted: u64 = ledgers.iter().map(|ledger| ledger.unaccounted).sum();
    writeln!(
        text,
        "Ledger of {} controlled runs: {ticks} ticks due, {unaccounted} ticks or samples unaccounted",
        ledgers.len()
    )
}
