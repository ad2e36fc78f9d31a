//! The first screen: what was found, in a few lines.

use std::fmt::Write as _;
use std::path::Path;

use firmware::Mode;
use model_offline::number::{decimals, in_unit, smallest_told};
use model_offline::output::chart::number::plain;
use model_offline::scene::{PlantModel, TissueVariant};

use crate::bench::result::{CaseResult, RunResult, SimulationSettings, StrategyResult};
use crate::report::below_noise::below_noise;
use crate::report::paper::paper_optima;
use crate::report::{AGAINST_NOTHING, PAST_ITS_TABLE};
use crate::runtime::accounting::ledger::LedgerResult;
use crate::runtime::names;
use crate::runtime::time::durations::LoopTiming;
use crate::world::tissue::PlantAccount;

/// Part of the largest error above which the tissue's own is said beside it.
const TELLING: f64 = 0.1;

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
                let agrees = (static_paddle, Some(dynamic)) == (placement.best_static, placement.best_dynamic);
                let verdict = if agrees { "same" } else { "DIFFERENT" };
                format!("      paper: {static_paddle} and {dynamic}, {verdict}")
            }
        };
        writeln!(
            text,
            "  {:<15} {:>6} {:>9}{paper}",
            placement.tissue.name(),
            placement.best_static,
            placement.dynamic_name()
        )?;
    }
    writeln!(
        text,
        "\nLargest target displacement orthogonal to the needle, depth {} in {} s{},\n\
         target seen by {}: {} Hz, {} ms late, noise {}; feedback: {}; paddle in brackets",
        reached(settings),
        settings.insertion_s,
        programme(settings),
        settings.sensor,
        settings.target_rate_hz,
        settings.target_latency_ms,
        in_unit(settings.noise, &run.units[0]),
        settings.feedback,
    )?;
    if !settings.world.is_empty() {
        writeln!(text, "in a world with {}", settings.world_in_words())?;
    }
    writeln!(text, "  {:<13} {:<13} {:>12} {:>16} {:>16}", "tissue", "table", "none", "static", "dynamic")?;
    let results = run.cases.iter().flat_map(|case| case.strategies.iter());
    let digits = decimals(smallest_told(results.map(|(_, result)| result.max_orthogonal_error)), 6);
    for case in &run.cases {
        write_case(text, run, case, digits)?;
    }
    for case in &run.cases {
        write_early_end(text, case.tissue, case.table.ends_early.as_deref())?;
    }
    if let Some(why) = below_noise(run) {
        writeln!(text, "  {why}")?;
    }
    write_causes(text, run, digits)?;
    write_plant(text, run)?;
    write_loop(text, run)?;
    writeln!(text, "\nReport: {}   ({:.1} s)", directory.join("report.html").display(), run.wall_s)
}

/// How deep the needle goes, and how deep the scene's does where that is another depth.
fn reached(settings: &SimulationSettings) -> String {
    match settings.needle_depth {
        Some(depth) if (depth - settings.depth).abs() > 1e-9 * settings.depth => {
            format!("{} (of the scene's {})", plain(depth), settings.depth)
        }
        _ => settings.depth.to_string(),
    }
}

/// What the needle does besides going in.
fn programme(settings: &SimulationSettings) -> String {
    let seconds = |seconds: f64| (seconds * 1e3).round() * 1e-3;
    let waits = match settings.wait_s {
        wait_s if wait_s > 0.0 => format!(" after waiting for {} s", seconds(wait_s)),
        _ => String::new(),
    };
    match settings.pauses_s {
        pauses_s if pauses_s > 1e-9 => format!("{waits}, {} s of pauses, rest and way back", seconds(pauses_s)),
        _ => waits,
    }
}

/// The controller's state at the end; where it was not RUN throughout, how long it was, and why not.
fn state(dynamic: &StrategyResult) -> String {
    let end = names::mode::name(dynamic.final_state);
    match dynamic.run_share {
        Some(share) if share < 1.0 => {
            let percent = (100.0 * share).floor();
            format!("{end}; in RUN for {percent:.0} % of the time, else {}", dynamic.outside_run_for)
        }
        _ => end.to_owned(),
    }
}

/// The largest orthogonal error and the paddle.
fn error(strategy: Option<&StrategyResult>, digits: usize) -> String {
    let Some(strategy) = strategy else {
        return "–".to_owned();
    };
    let paddle = strategy.paddle.map_or_else(String::new, |index| format!(" ({index})"));
    format!("{:.digits$}{paddle}", strategy.max_orthogonal_error)
}

fn write_case(text: &mut String, run: &RunResult, case: &CaseResult, digits: usize) -> std::fmt::Result {
    let strategies = &case.strategies;
    let dynamic = strategies.controlled();
    write!(
        text,
        "  {:<13} {:<13} {:>12} {:>16} {:>16}",
        case.tissue.name(),
        case.table_tissue,
        error(run.without_paddle(case), digits),
        error(strategies.static_paddle.as_ref(), digits),
        error(dynamic, digits),
    )?;
    match (case.improvement, dynamic) {
        (Some(factor), Some(dynamic)) => {
            let none =
                case.improvement_over_none.map_or_else(String::new, |factor| format!("{}, ", share(factor, "none")));
            let off = dynamic.distrust().map_or_else(String::new, |off| format!("; NOT TO BE TRUSTED: {off}"));
            writeln!(text, "   {}, {none}{}{off}", share(factor, "static"), state(dynamic))
        }
        _ => writeln!(text),
    }
}

/// Says so where a table ends before the needle does.
pub(super) fn write_early_end(text: &mut String, tissue: TissueVariant, ends: Option<&str>) -> std::fmt::Result {
    ends.map_or(Ok(()), |ends| writeln!(text, "  {tissue}: {PAST_ITS_TABLE}: {ends}"))
}

/// What the controller's error is made of, where that was asked for.
fn write_causes(text: &mut String, run: &RunResult, digits: usize) -> std::fmt::Result {
    for case in &run.cases {
        let Some(causes) = &case.causes else { continue };
        let left = causes.without.iter().map(|w| format!("{:.digits$} without the {}", w.left.peak, w.cause.title()));
        let left: Vec<String> = left.collect();
        let left = match left.is_empty() {
            true => "nothing that can be taken away".to_owned(),
            false => format!("is left: {}; {:.digits$} without any of it", left.join(", "), causes.without_all.peak),
        };
        let near = if case.strategies.left_the_way() { "near the planned way, which it left, " } else { "" };
        writeln!(
            text,
            "  {}, of the dynamic error {near}{left}; with this sensor no controller could leave less on average than {:.digits$}, \
             with the paddle's rate none less than {:.digits$}",
            case.tissue, causes.bound.sensor.peak, causes.bound.paddle
        )?;
    }
    Ok(())
}

/// An error over another one, of which it is this many times smaller; a digit more where that is few.
pub(super) fn share(factor: f64, other: &str) -> String {
    if factor < AGAINST_NOTHING {
        format!("beyond {other}, which is 0 but for rounding")
    } else if factor < 1.0 {
        format!("{:.1} times {other}", 1.0 / factor)
    } else if factor < 10.0 {
        format!("1/{factor:.1} of {other}")
    } else {
        format!("1/{factor:.0} of {other}")
    }
}

/// What answered for the tissue, where it was not the full model: how far off it was, and how often it could not.
fn write_plant(text: &mut String, run: &RunResult) -> std::fmt::Result {
    for case in &run.cases {
        let strategies = &case.strategies;
        for strategy in [&strategies.dynamic, &strategies.dynamic_free_run].into_iter().flatten() {
            let plant = &strategy.plant;
            if let (Some(solves), Some(error)) = (plant.solves, plant.extrapolation_error) {
                writeln!(
                    text,
                    "  {}, {}: tissue solved for {solves} times, extrapolated between, {error:.1e} off at most where it \
                     was solved for next{}",
                    case.tissue,
                    strategy.mode,
                    telling(error, strategy.max_orthogonal_error)
                )?;
            }
            if plant.fallbacks == 0 && plant.first_fallback.is_none() && plant.model == PlantModel::Full {
                continue;
            }
            write!(text, "  {}, {}: tissue {}", case.tissue, strategy.mode, plant.model)?;
            if let (Some(modes), Some([points, all])) = (plant.modes, plant.points) {
                write!(text, " ({modes} modes, {points} of {all} points)")?;
            }
            write!(text, ", {:.1} µs a step", strategy.plant_step_us)?;
            write_accuracy(text, plant, strategy.max_orthogonal_error)?;
            if let Some(full) = plant.full_step_us {
                write!(text, "; the full model takes {full:.0} µs, too long for the period")?;
            }
            if plant.fallbacks > 0 {
                write!(text, "; the full model answered {} steps", plant.fallbacks)?;
            }
            if let Some(why) = &plant.first_fallback {
                write!(text, ": {why}")?;
            }
            // Rows have this of what they show, which is in lockstep where there is both.
            let beside = strategy
                .distrust()
                .filter(|_| !strategies.controlled().is_some_and(|shown| std::ptr::eq(shown, strategy)));
            writeln!(text, "{}", beside.map_or_else(String::new, |off| format!("; NOT TO BE TRUSTED: {off}")))?;
        }
    }
    Ok(())
}

/// How far a reduced model was off, where the full one went its way again.
fn write_accuracy(text: &mut String, plant: &PlantAccount, peak: f64) -> std::fmt::Result {
    let (states, largest) = (plant.states_verified, plant.largest_error);
    let off = match (&plant.not_verified, plant.path_knots, plant.extrapolation_error, largest) {
        (Some(why), _, _, _) => {
            write!(text, ", NOT VERIFIED: the full model cannot go the same way ({why})")?;
            if let Some(estimate) = plant.largest_estimate {
                write!(text, "; it takes itself to be {estimate:.1e} off at most")?;
            }
            plant.largest_estimate
        }
        (None, Some(_), Some(error), _) => {
            write!(text, ", at most {error:.1e} from the full model on the same way")?;
            if let Some(apart_s) = plant.puncture_apart_s {
                write!(text, " (whose skin gives way up to {:.0} ms apart", 1e3 * apart_s)?;
                match plant.puncture_apart_error {
                    Some(apart) => write!(text, ", the targets {apart:.1e} meanwhile)")?,
                    None => write!(text, ")")?,
                }
            }
            Some(error)
        }
        (_, _, _, Some(error)) => {
            let (states, s) = (states.unwrap_or(1), if states == Some(1) { "" } else { "s" });
            write!(text, ", at most {error:.1e} from the full model in {states} state{s} of its way")?;
            Some(error)
        }
        _ => None,
    };
    text.write_str(&off.map_or_else(String::new, |off| telling(off, peak)))
}

/// What an error of the tissue is of the largest error that a run found with it, where that is worth telling.
fn telling(off: f64, peak: f64) -> String {
    match off / peak {
        share if share <= TELLING || off == 0.0 => String::new(),
        share if share < 10.0 => format!(" ({:.0} % of the largest error)", 100.0 * share),
        _ => " (more than ten times the largest error)".to_owned(),
    }
}

/// A loop on the machine's clock.
pub(super) struct FreeRun<'r> {
    /// Its tissue.
    pub(super) tissue: TissueVariant,
    /// Timing of the controller and of the plant.
    pub(super) timing: [&'r Option<LoopTiming>; 2],
    /// State at the end.
    pub(super) final_state: Option<Mode>,
}

/// Both sides of a loop on the machine's clock: the counts first, then how late.
fn write_free_run(text: &mut String, free_run: &FreeRun<'_>) -> std::fmt::Result {
    let us = |ns: u64| ns as f64 * 1e-3;
    let sides = ["controller", "plant"].into_iter().zip(free_run.timing);
    let sides: Vec<_> = sides.filter_map(|(side, timing)| Some((side, timing.as_ref()?))).collect();
    let counts: Vec<_> = sides
        .iter()
        .map(|(side, timing)| {
            let LoopTiming { ticks, deadline_misses, skipped, .. } = timing;
            format!("{side} {ticks} ticks, {deadline_misses} deadline misses, {skipped} skipped")
        })
        .collect();
    let state = names::mode::name(free_run.final_state);
    writeln!(text, "  {}: {}; ended in {state}", free_run.tissue, counts.join("; "))?;
    for (side, LoopTiming { release_lateness: lateness, scheduling, .. }) in sides {
        let [p50, p99, max] = [lateness.p50_ns, lateness.p99_ns, lateness.max_ns].map(us);
        let policy = &scheduling.policy;
        writeln!(text, "    {side}: lateness p50 {p50:.0} µs, p99 {p99:.0} µs, max {max:.0} µs; {policy}")?;
    }
    Ok(())
}

fn write_loop(text: &mut String, run: &RunResult) -> std::fmt::Result {
    let strategies = || run.cases.iter().map(|case| &case.strategies);
    let free_runs = run.cases.iter().filter_map(|case| {
        let StrategyResult { timing, plant_timing, final_state, .. } = case.strategies.dynamic_free_run.as_ref()?;
        Some(FreeRun { tissue: case.tissue, timing: [timing, plant_timing], final_state: *final_state })
    });
    write_free_runs(text, run.settings.rate_hz, free_runs)?;
    let ledgers = strategies()
        .flat_map(|strategies| [&strategies.dynamic, &strategies.dynamic_free_run])
        .flatten()
        .filter_map(|strategy| strategy.ledger.as_ref());
    write_ledgers(text, ledgers)
}

/// All loops on the machine's clock, where there are any.
pub(super) fn write_free_runs<'r>(
    text: &mut String,
    rate_hz: f64,
    free_runs: impl Iterator<Item = FreeRun<'r>>,
) -> std::fmt::Result {
    for (k, free_run) in free_runs.enumerate() {
        if k == 0 {
            writeln!(text, "\nFree-run at {rate_hz} Hz, from the scheduled time")?;
        }
        write_free_run(text, &free_run)?;
    }
    Ok(())
}

/// What is in the accounts of all controlled runs together.
pub(super) fn write_ledgers<'r>(
    text: &mut String,
    ledgers: impl Iterator<Item = &'r LedgerResult>,
) -> std::fmt::Result {
    let ledgers: Vec<&LedgerResult> = ledgers.collect();
    let ticks: u64 = ledgers.iter().map(|ledger| ledger.ticks.due).sum();
    let unaccounted: u64 = ledgers.iter().map(|ledger| ledger.unaccounted).sum();
    let not_recorded: u64 = ledgers.iter().map(|ledger| ledger.not_recorded).sum();
    writeln!(
        text,
        "Ledger of {} controlled runs: {ticks} ticks due, {unaccounted} ticks or samples unaccounted, {not_recorded} \
         ticks not recorded",
        ledgers.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_far_the_tissue_is_off_is_said_for_the_whole_way_and_not_for_its_end_alone() {
        let said = |plant: PlantAccount| {
            let mut text = String::new();
            write_accuracy(&mut text, &plant, 0.5).unwrap();
            text
        };
        // Back at the skin every model is at rest.
        let path = PlantAccount {
            path_knots: Some(9),
            extrapolation_error: Some(0.2),
            error_at_end: Some(1e-9),
            largest_estimate: Some(0.3),
            ..PlantAccount::default()
        };
        assert_eq!(
            said(path.clone()),
            ", at most 2.0e-1 from the full model on the same way (40 % of the largest error)"
        );
        let small = PlantAccount { extrapolation_error: Some(0.04), ..path.clone() };
        assert_eq!(said(small.clone()), ", at most 4.0e-2 from the full model on the same way");
        let apart = PlantAccount { puncture_apart_s: Some(0.025), puncture_apart_error: Some(0.3), ..small.clone() };
        assert!(said(apart).ends_with("(whose skin gives way up to 25 ms apart, the targets 3.0e-1 meanwhile)"));
        let unknown = PlantAccount { not_verified: Some("no way".to_owned()), extrapolation_error: None, ..path };
        let words = said(unknown);
        assert!(words.contains("NOT VERIFIED") && words.contains("no way") && words.contains("60 %"), "{words}");
        let trained = PlantAccount { states_verified: Some(7), largest_error: Some(0.01), ..PlantAccount::default() };
        assert_eq!(said(trained), ", at most 1.0e-2 from the full model in 7 states of its way");
        assert_eq!(telling(0.0, 0.0), "");
        assert_eq!([telling(6.0, 0.5), telling(1e-9, 0.0)], [" (more than ten times the largest error)"; 2]);
        // Where it answered nothing itself, nothing is told of it.
        assert_eq!(said(PlantAccount { fallbacks: 5567, ..PlantAccount::default() }), "");
    }
}
