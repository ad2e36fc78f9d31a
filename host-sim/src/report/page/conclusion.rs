//! What to conclude from a run, in three sentences and what stands in the way: where the paddle belongs, what it brings, and whether to believe it.

use firmware::{Faults, Mode};
use model_offline::output::chart::number::{number, plain};
use model_offline::scene::TissueVariant;

use crate::bench::in_space::{SpaceCase, SpaceRun, SpaceStrategyResult};
use crate::bench::result::{CaseResult, PlacementResult, RunResult, StrategyResult};
use crate::bench::strategy::Strategy;
use crate::report::below_noise::{below_noise, below_noise_in_space};
use crate::report::paper::paper_optima;
use crate::report::{AGAINST_NOTHING, PAST_ITS_TABLE};
use crate::runtime::accounting::ledger::LedgerResult;
use crate::runtime::time::durations::LoopTiming;
use crate::runtime::time::mode::RunMode;

/// The three sentences; those that a result has nothing for are left out.
pub(super) fn sentences(run: &RunResult) -> Vec<String> {
    let controlled: Vec<_> = run.results().filter_map(Controlled::in_plane).collect();
    let trust = trust(&controlled, run.settings.rate_hz);
    let ends = early_ends(run.cases.iter().map(|case| (case.tissue, case.table.ends_early.as_deref())));
    [placement(run), reduction(run), ends, trust].into_iter().flatten().collect()
}

/// Which tables end before the needle does.
fn early_ends<'r>(tables: impl Iterator<Item = (TissueVariant, Option<&'r str>)>) -> Option<String> {
    let ends: Vec<String> = tables.filter_map(|(tissue, ends)| Some(format!("tissue {tissue}, {}", ends?))).collect();
    (!ends.is_empty()).then(|| format!("{PAST_ITS_TABLE}: {}.", ends.join("; ")).replacen("past", "Past", 1))
}

/// The best paddles, held and controlled.
fn placement(run: &RunResult) -> Option<String> {
    let paddles = |placement: &PlacementResult| Some((placement.best_static, placement.best_dynamic?));
    let paper: Vec<_> = run.placements.iter().map(|p| paper_optima(&run.scene, p.tissue)).collect();
    let all_agree =
        paper.iter().zip(&run.placements).all(|(paper, placement)| paper.is_some() && *paper == paddles(placement));
    let found = run.placements.iter().zip(&paper).map(|(placement, paper)| {
        let (held, controlled) = (placement.best_static, placement.dynamic_name());
        let differs = match paper {
            Some((held, controlled)) if !all_agree => format!(" (the paper: {held} and {controlled})"),
            _ => String::new(),
        };
        format!("tissue {}: best static paddle {held}, best dynamic paddle {controlled}{differs}", placement.tissue)
    });
    let found: Vec<String> = found.collect();
    if found.is_empty() {
        return None;
    }
    let agreement = if all_agree { ", all as in the paper" } else { "" };
    Some(format!("{}{agreement}.", found.join("; ")).replacen("tissue", "Tissue", 1))
}

/// What the controlled paddle leaves, against a held one and against none.
fn reduction(run: &RunResult) -> Option<String> {
    let none = factors(run, |case| case.improvement_over_none).map(|times| format!("{times} than without a paddle"));
    let held = factors(run, |case| case.improvement).map(|times| format!("{times} than the best static paddle's"));
    let both: Vec<String> = [none, held].into_iter().flatten().collect();
    let why = below_noise(run).map_or_else(String::new, |why| format!("; {why}"));
    let always = |strategy| run.cases.iter().all(|case| case.stillest() == strategy);
    let advice = match () {
        () if always(Strategy::None) => ": leave the paddle away here",
        () if run.cases.iter().all(|case| case.improvement.is_some_and(|factor| factor < 1.0)) => {
            ": hold it still here"
        }
        () => "",
    };
    let off = tissue_off(run).map_or_else(String::new, |off| format!(" {off}"));
    (!both.is_empty())
        .then(|| format!("The dynamic paddle's largest error is {}{why}{advice}.{off}", both.join(" and ")))
}

/// Says so where the tissue of a case was off by so much of the error that the error says little of the loop.
fn tissue_off(run: &RunResult) -> Option<String> {
    let worst = run.cases.iter().filter_map(|case| case.strategies.controlled()).max_by(|a, b| {
        let share = |result: &StrategyResult| result.tissue_off().unwrap_or(0.0);
        share(a).total_cmp(&share(b))
    })?;
    Some(format!("That is not to be trusted: {}.", worst.distrust()?))
}

/// How many times smaller, or larger, the dynamic paddle's largest error is than another one, over all cases.
pub(super) fn factors(run: &RunResult, factor: impl Fn(&CaseResult) -> Option<f64>) -> Option<String> {
    let factors: Vec<f64> = run.cases.iter().filter_map(factor).filter(|factor| factor.is_finite()).collect();
    (!factors.is_empty()).then(|| change(&factors))
}

/// "2.5 to 40 times smaller", "3 times larger" for errors that are so many times smaller.
pub(super) fn change(factors: &[f64]) -> String {
    // Small factors with a digit behind the point: "1 times smaller" says nothing.
    let times = |factor: f64| if factor < 10.0 { number(factor, 2) } else { plain(factor.round()) };
    let larger = |factor: f64| match factor < AGAINST_NOTHING {
        true => "incomparably larger".to_owned(),
        false => format!("{} times larger", times(factor.recip())),
    };
    let low = factors.iter().copied().fold(f64::INFINITY, f64::min);
    let high = factors.iter().copied().fold(0.0, f64::max);
    let range = |from: f64, to: f64| {
        let (from, to) = (times(from), times(to));
        if from == to { from } else { format!("{from} to {to}") }
    };
    if low >= 1.0 {
        format!("{} times smaller", range(low, high))
    } else if high >= 1.0 {
        format!("between {} and {} times smaller", larger(low), times(high))
    } else if low >= AGAINST_NOTHING {
        format!("{} times larger", range(high.recip(), low.recip()))
    } else if high < AGAINST_NOTHING {
        larger(low)
    } else {
        format!("{} to {}", larger(high), larger(low))
    }
}

/// The same of a body in space.
pub(super) fn sentences_in_space(run: &SpaceRun) -> Vec<String> {
    let controlled: Vec<_> = run
        .cases
        .iter()
        .flat_map(|case| [Some(&case.dynamic), case.dynamic_free_run.as_ref()])
        .flatten()
        .filter_map(Controlled::in_space)
        .collect();
    let trust = trust(&controlled, run.rate_hz);
    let ends = early_ends(run.cases.iter().map(|case| (case.tissue, case.table.ends_early.as_deref())));
    [placement_in_space(run), reduction_in_space(run), ends, trust].into_iter().flatten().collect()
}

fn placement_in_space(run: &SpaceRun) -> Option<String> {
    let known = run.cases.iter().filter(|case| case.tissue == case.table_tissue);
    let names = |paddles: &[u32]| paddles.iter().map(u32::to_string).collect::<Vec<_>>().join(" + ");
    let found = known.map(|case| {
        let (held, controlled) = (names(&case.fixture.paddles), names(&case.dynamic.paddles));
        format!("tissue {}: best static paddles {held}, best dynamic paddles {controlled}", case.tissue)
    });
    let found = found.collect::<Vec<_>>().join("; ");
    (!found.is_empty()).then(|| format!("{found}.").replacen("tissue", "Tissue", 1))
}

fn reduction_in_space(run: &SpaceRun) -> Option<String> {
    let factors = |of: fn(&SpaceCase) -> f64| -> Option<Vec<f64>> {
        let all: Vec<f64> = run.cases.iter().map(of).collect();
        (!all.is_empty() && all.iter().all(|factor| factor.is_finite())).then_some(all)
    };
    let (none, held) = (factors(|case| case.improvement_over_none)?, factors(|case| case.improvement)?);
    let advice = match () {
        () if run.cases.iter().all(|case| case.stillest() == Strategy::None) => ": leave the paddles away here",
        () if held.iter().all(|held| *held < 1.0) => ": hold them still here",
        () => "",
    };
    let (none, held) = (change(&none), change(&held));
    let why = below_noise_in_space(run).map_or_else(String::new, |why| format!("; {why}"));
    Some(format!(
        "The dynamic paddles' largest error is {none} than without paddles and {held} than the best static ones'{why}{advice}."
    ))
}

/// An insertion with a controller, in either dimension.
struct Controlled<'r> {
    mode: RunMode,
    /// Part of it that the controller was in RUN.
    in_run: f64,
    outside_run_for: Faults,
    ledger: &'r LedgerResult,
    /// Of the controller's loop and the plant's.
    timing: [Option<&'r LoopTiming>; 2],
}

impl<'r> Controlled<'r> {
    fn in_plane(result: &'r StrategyResult) -> Option<Self> {
        Some(Self {
            mode: result.mode,
            in_run: share_in_run(result.run_share, result.final_state),
            outside_run_for: result.outside_run_for,
            ledger: result.ledger.as_ref()?,
            timing: [result.timing.as_ref(), result.plant_timing.as_ref()],
        })
    }

    fn in_space(result: &'r SpaceStrategyResult) -> Option<Self> {
        Some(Self {
            mode: result.mode,
            in_run: share_in_run(result.run_share, result.final_state),
            outside_run_for: result.outside_run_for,
            ledger: result.ledger.as_ref()?,
            timing: [result.timing.as_ref(), result.plant_timing.as_ref()],
        })
    }
}

fn share_in_run(share: Option<f64>, final_state: Option<Mode>) -> f64 {
    share.unwrap_or(if final_state == Some(Mode::Run) { 1.0 } else { 0.0 })
}

/// Whether the controller controlled, whether the loop held its period, and whether anything was lost.
fn trust(controlled: &[Controlled<'_>], rate_hz: f64) -> Option<String> {
    let state = state(controlled)?;
    let ledger = match controlled.iter().map(|insertion| insertion.ledger.unaccounted).sum::<u64>() {
        0 => "no tick or sample is unaccounted for".to_owned(),
        lost => format!("{lost} ticks or samples are UNACCOUNTED for"),
    };
    let said: Vec<String> =
        [Some(state), punctuality(controlled, rate_hz), Some(ledger)].into_iter().flatten().collect();
    Some(format!("{}.", said.join("; ")))
}

/// How much of the insertions the controller was in RUN, the worst one's; none where it was in none.
fn state(controlled: &[Controlled<'_>]) -> Option<String> {
    let worst = controlled.iter().min_by(|a, b| a.in_run.total_cmp(&b.in_run))?;
    Some(if worst.in_run < 1.0 {
        format!(
            "The controller was in RUN for only {:.0} % of an insertion ({}, {})",
            (100.0 * worst.in_run).floor(),
            worst.mode,
            worst.outside_run_for
        )
    } else {
        "The controller was in RUN all the time".to_owned()
    })
}

/// Deadlines missed on the machine's clock, of both sides of the loop.
fn punctuality(controlled: &[Controlled<'_>], rate_hz: f64) -> Option<String> {
    let loops = || controlled.iter().flat_map(|insertion| insertion.timing).flatten();
    let due: u64 = loops().map(|timing| timing.ticks + timing.skipped).sum();
    let missed: u64 = loops().map(|timing| timing.deadline_misses).sum();
    let worst = loops().map(|timing| timing.release_lateness.max_ns).max()?;
    let late = number(worst as f64 * 1e-6, 2);
    let rate = plain(rate_hz);
    Some(match missed {
        0 => format!("at {rate} Hz none of {due} deadlines was missed (largest lateness {late} ms)"),
        _ => format!("at {rate} Hz {missed} of {due} deadlines were MISSED (largest lateness {late} ms)"),
    })
}
