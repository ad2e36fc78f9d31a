//! What to conclude from a run, in three sentences: where the paddle belongs, what it brings, and whether to believe it.

use firmware::Mode;
use model_offline::output::chart::number::{number, plain};

use crate::bench::result::{CaseResult, PlacementResult, RunResult, StrategyResult};
use crate::bench::strategy::Strategy;
use crate::report::below_noise::below_noise;
use crate::report::paper::paper_optima;

/// The three sentences; those that a result has nothing for are left out.
pub(super) fn sentences(run: &RunResult) -> Vec<String> {
    [placement(run), reduction(run), trust(run)].into_iter().flatten().collect()
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
    (!both.is_empty()).then(|| format!("The dynamic paddle's largest error is {}{why}{advice}.", both.join(" and ")))
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
    let low = factors.iter().copied().fold(f64::INFINITY, f64::min);
    let high = factors.iter().copied().fold(0.0, f64::max);
    let range = |from: f64, to: f64| {
        let (from, to) = (times(from), times(to));
        if from == to { from } else { format!("{from} to {to}") }
    };
    if low >= 1.0 {
        format!("{} times smaller", range(low, high))
    } else if high < 1.0 {
        format!("{} times larger", range(high.recip(), low.recip()))
    } else {
        format!("between {} times larger and {} times smaller", times(low.recip()), times(high))
    }
}

/// Whether the controller controlled, whether the loop held its period, and whether anything was lost.
fn trust(run: &RunResult) -> Option<String> {
    let controlled = || run.results().filter(|strategy| strategy.ledger.is_some());
    controlled().next()?;
    let unaccounted: u64 =
        controlled().filter_map(|strategy| strategy.ledger.as_ref()).map(|ledger| ledger.unaccounted).sum();
    let ledger = match unaccounted {
        0 => "no tick or sample is unaccounted for".to_owned(),
        lost => format!("{lost} ticks or samples are UNACCOUNTED for"),
    };
    let said: Vec<String> = [Some(state(controlled())), punctuality(run), Some(ledger)].into_iter().flatten().collect();
    Some(format!("{}.", said.join("; ")))
}

/// How much of the insertions the controller was in RUN, the worst one's.
fn state<'a>(controlled: impl Iterator<Item = &'a StrategyResult>) -> String {
    let in_run = |strategy: &StrategyResult| {
        strategy.run_share.unwrap_or(if strategy.final_state == Some(Mode::Run) { 1.0 } else { 0.0 })
    };
    match controlled.min_by(|a, b| in_run(a).total_cmp(&in_run(b))) {
        Some(worst) if in_run(worst) < 1.0 => format!(
            "The controller was in RUN for only {:.0} % of an insertion ({}, {})",
            (100.0 * in_run(worst)).floor(),
            worst.mode,
            worst.outside_run_for
        ),
        _ => "The controller was in RUN all the time".to_owned(),
    }
}

/// Deadlines missed on the machine's clock, of both sides of the loop.
fn punctuality(run: &RunResult) -> Option<String> {
    let loops = || run.results().flat_map(|strategy| [&strategy.timing, &strategy.plant_timing]).flatten();
    let due: u64 = loops().map(|timing| timing.ticks + timing.skipped).sum();
    let missed: u64 = loops().map(|timing| timing.deadline_misses).sum();
    let worst = loops().map(|timing| timing.release_lateness.max_ns).max()?;
    let late = number(worst as f64 * 1e-6, 2);
    let rate = plain(run.settings.rate_hz);
    Some(match missed {
        0 => format!("at {rate} Hz none of {due} deadlines was missed (largest lateness {late} ms)"),
        _ => format!("at {rate} Hz {missed} of {due} deadlines were MISSED (largest lateness {late} ms)"),
    })
}
