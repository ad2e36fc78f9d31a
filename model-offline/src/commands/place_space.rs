//! `model-offline place` of a scene in space: singles and pairs.

use super::check_space;
use super::common::{RunArgs, StudyProgress, warned};
use super::error::CliError;
use super::json::write_json;
use super::place_text::in_lengths_of;
use model_offline::number::{decimals, length, smallest_told};
use model_offline::output::terminal::complain;
use model_offline::parallel;
use model_offline::placement::space::study::{SpaceAnswer, SpaceStatic};
use model_offline::placement::space::{SecondPaddle, SpaceErrorEstimate, SpaceStudy};
use model_offline::placement::verdict::{ON_ITS_LINE, stays_on_the_line, times_as_far};
use model_offline::scene::space::SpaceScene;
use model_offline::tell;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// What stands where there is no number.
const NONE: &str = "–";
/// What is said of a difference that is smaller than the errors.
const LEFT_OPEN: &str = ", which the errors leave open";
/// Pairs that are listed; all are in the JSON.
const LISTED: usize = 10;

pub(super) fn run(scene: &SpaceScene, json: Option<&Path>, run: &RunArgs) -> Result<(), CliError> {
    if !run.quiet {
        scene.notes.iter().for_each(|note| complain(&format!("note: {note}")));
    }
    place(scene, json, run).map_err(|error| error.reported_of(json, &scene.name, scene.tissue()))
}

fn place(scene: &SpaceScene, json: Option<&Path>, run: &RunArgs) -> Result<(), CliError> {
    let bar = StudyProgress::new(run, scene.discretization.resolution);
    let (begin, progress) = (|steps: u64| bar.begin(steps), || bar.step());
    // Before the study: what is found out is written at once.
    let is_told = json.is_some() || !run.quiet;
    let warnings = if is_told { parallel::within(run.threads(), || warnings(scene)) } else { Vec::new() };
    let study = SpaceStudy::run(scene, run.threads(), &begin, &progress)?;
    bar.finish();
    write_json(json, &document(&study, &warnings))?;
    if !run.quiet {
        for [a, b] in study.overlapping() {
            complain(&format!(
                "note: paddles {a} and {b} overlap, and cannot be attached together: no such pair is the best"
            ));
        }
        tell!("{}{}", summary(&study), warned(&warnings));
    }
    Ok(())
}

/// What is seldom meant in the scene, as `check` says it, but for what the study says better: that paddles overlap, and elements, which
/// are others. What cannot be meshed at all is the study's to say.
fn warnings(scene: &SpaceScene) -> Vec<String> {
    let Ok(mut survey) = check_space::survey(scene) else { return Vec::new() };
    survey.overlapping.clear();
    survey.mesh.worst.clear();
    check_space::warnings(scene, &survey)
}

/// Estimated errors of one of the measures, by set.
type OfSets = fn(&SpaceErrorEstimate) -> &Vec<f64>;

fn by_set(estimate: &SpaceErrorEstimate) -> &Vec<f64> {
    &estimate.by_set
}

fn full_by_set(estimate: &SpaceErrorEstimate) -> &Vec<f64> {
    &estimate.full_by_set
}

fn document(study: &SpaceStudy, warnings: &[String]) -> Value {
    let (scene, placement) = (study.model.scene(), &study.placement);
    let static_error = |set| study.uncertain().and_then(|uncertain| uncertain.static_error(set));
    let (mut paddles, mut pairs) = (json!(placement.paddles), json!(placement.pairs));
    let results = paddles.as_array_mut().into_iter().flatten().chain(pairs.as_array_mut().into_iter().flatten());
    for (i, result) in results.enumerate() {
        let estimate = study.error_estimate.as_ref();
        for (key, of) in [("controllability_measure", by_set as OfSets), ("controllability_full", full_by_set)] {
            // Nothing is known of a number that is none.
            let error = estimate.and_then(|estimate| of(estimate).get(i)).filter(|_| !result[key].is_null());
            result["error"][key] = json!(error);
        }
        result["error"]["max_orthogonal"] = json!(static_error(i));
    }
    let mut no_paddle = json!(placement.no_paddle);
    no_paddle["error"] = json!({ "max_orthogonal": static_error(placement.without()) });
    let overlapping = study.overlapping();
    let as_good = |best| study.uncertain().map(|uncertain| uncertain.as_good(best, &overlapping));
    json!({
        "scene": scene.name,
        "dimension": 3,
        "tissue": scene.tissue(),
        "units": [&scene.length_unit, &scene.stress_unit],
        "nodes": study.model.nodes(),
        "dofs": study.model.dofs(),
        "integration": scene.discretization.method.integration,
        "wall_s": study.wall_s,
        "error_estimate": study.error_estimate,
        "static_nodes": placement.profile_nodes,
        "paddles": paddles,
        "pairs": pairs,
        "overlapping": overlapping,
        "no_paddle": no_paddle,
        "optimum": placement.optimum,
        "optimum_single": placement.optimum_single,
        "as_good": as_good(&placement.optimum),
        "as_good_single": as_good(&placement.optimum_single),
        "second_paddle": study.second_paddle(),
        "warnings": warnings,
    })
}

/// The study on a screen.
fn summary(study: &SpaceStudy) -> String {
    let (scene, placement) = (study.model.scene(), &study.placement);
    let all: Vec<(&[u32], &SpaceAnswer)> = placement.sets().collect();
    let static_error = |set| study.uncertain().and_then(|uncertain| uncertain.static_error(set));
    let studies = all.iter().map(|(_, answer)| &answer.static_study).chain([&placement.no_paddle.static_study]);
    let digits = decimals(smallest_told(studies.map(|study| study.max_orthogonal)), 6);
    let mut out = format!(
        "{} · {} tissue · {} nodes ({}) · {:.1} s{}\n\n paddles   1/σ_min(NᵀJ)        ±      ‖J⁺N‖        ±   max orthogonal (static)\n",
        scene.name,
        scene.tissue(),
        study.model.nodes(),
        scene.discretization.method.integration,
        study.wall_s,
        in_lengths_of(&scene.length_unit)
    );
    let mut order: Vec<usize> = (0..placement.paddles.len()).collect();
    let mut of_pairs: Vec<usize> = (placement.paddles.len()..all.len()).collect();
    of_pairs.sort_by(|&a, &b| all[a].1.controllability_measure.total_cmp(&all[b].1.controllability_measure));
    let left = of_pairs.len().saturating_sub(LISTED);
    order.extend(of_pairs.into_iter().take(LISTED));
    for i in order {
        let (paddles, answer) = &all[i];
        let estimate = study.error_estimate.as_ref();
        let error = |of: OfSets, what: f64| {
            let error = estimate.and_then(|estimate| of(estimate).get(i)).filter(|_| what.is_finite());
            error.map_or(NONE.to_owned(), |&error| percent(error))
        };
        let _ = writeln!(
            out,
            "{:>8}   {:>12}{} {:>8} {:>10} {:>8}   {}",
            named(paddles),
            measure(answer.controllability_measure),
            if [&placement.optimum.dynamic, &placement.optimum_single.dynamic].iter().any(|best| best == paddles) {
                '*'
            } else {
                ' '
            },
            error(by_set, answer.controllability_measure),
            measure(answer.controllability_full),
            error(full_by_set, answer.controllability_full),
            fixture(&answer.static_study, static_error(i), digits)
        );
    }
    if left > 0 {
        let _ = writeln!(out, "   ({left} more pairs in the JSON)");
    }
    let _ = writeln!(
        out,
        "    none   {NONE:>12}  {NONE:>8} {NONE:>10} {NONE:>8}   {}",
        fixture(&placement.no_paddle.static_study, static_error(placement.without()), digits)
    );
    for (what, best) in [("single paddle", &placement.optimum_single), ("pair", &placement.optimum)] {
        if what == "pair" && placement.pairs.is_empty() {
            continue;
        }
        let as_good = study.uncertain().map(|uncertain| uncertain.as_good(best, &study.overlapping()));
        let as_good = as_good.unwrap_or_default();
        let words = |paddles: &[u32]| if paddles.is_empty() { NONE.to_owned() } else { named(paddles) };
        let _ = writeln!(
            out,
            "\nbest static {what}: {}{}; best dynamic {what}: {}{}",
            words(&best.fixture),
            or_others(&as_good.fixtures),
            words(&best.dynamic),
            or_others(&as_good.dynamic)
        );
        out.extend(harms(what, study, &best.fixture));
    }
    out.extend(second_pays(study));
    if placement.profile_nodes != study.model.nodes() {
        let _ = writeln!(
            out,
            "the insertion was followed on {} nodes: what of the static column is not linear in the depth is theirs{}",
            placement.profile_nodes,
            if study.error_estimate.is_some() { "" } else { ", and no error of it is estimated" }
        );
    }
    out
}

/// Others that the errors leave as good as the best.
fn or_others(others: &[Vec<u32>]) -> String {
    match others {
        [] => String::new(),
        [one] => format!(" (or {}, within the errors)", named(one)),
        [one, two] => format!(" (or {}, or {}, within the errors)", named(one), named(two)),
        [first, rest @ ..] => format!(" (or {}, or {} others, within the errors)", named(first), rest.len()),
    }
}

/// Says so where even the best fixture moves the target more than no paddle does.
fn harms(what: &str, study: &SpaceStudy, best: &[u32]) -> Option<String> {
    let placement = &study.placement;
    let (held, without) = (placement.sets().position(|(paddles, _)| paddles == best)?, placement.without());
    let (of, of_none) = (placement.static_study(held)?, placement.static_study(without)?);
    let largest = of_none.orthogonal.iter().copied().fold(0.0, f64::max);
    if of_none.depth.last().is_some_and(|depth| stays_on_the_line(largest, *depth)) {
        return Some(format!("no static {what} helps: {ON_ITS_LINE}\n"));
    }
    let factor = of.over(of_none).filter(|factor| *factor > 1.0)?;
    let is_open = study.uncertain().and_then(|uncertain| uncertain.may_hold_as_well(held, without)) == Some(true);
    let open = if is_open { LEFT_OPEN } else { "" };
    Some(format!("no static {what} helps: {}{open}\n", times_as_far("the best moves the target", factor)))
}

/// Whether the second paddle buys anything at rest.
fn second_pays(study: &SpaceStudy) -> Option<String> {
    let SecondPaddle { single, pair, gain, left_open } = study.second_paddle()?;
    let way = "the way for the worst direction";
    let gain = 100.0 * gain.unwrap_or(0.0);
    // What would be told as nothing is nothing.
    Some(match format!("{gain:.1}") {
        told if gain > 0.0 && told != "0.0" => {
            let open = if left_open == Some(true) { LEFT_OPEN } else { "" };
            format!("a second paddle shortens {way} by {told} % ({single:.3} to {pair:.3}){open}\n")
        }
        _ => format!("a second paddle does not shorten {way} ({single:.3} to {pair:.3})\n"),
    })
}

fn named(paddles: &[u32]) -> String {
    paddles.iter().map(ToString::to_string).collect::<Vec<_>>().join(" + ")
}

/// A relative error; a number that is all error says no more.
fn percent(error: f64) -> String {
    if error > 1.0 { "> 100 %".to_owned() } else { format!("{:.2} %", 100.0 * error) }
}

fn measure(value: f64) -> String {
    if value.is_finite() { format!("{value:.4}") } else { NONE.to_owned() }
}

fn fixture(study: &SpaceStatic, error: Option<f64>, digits: usize) -> String {
    let stopped = study
        .failure
        .as_ref()
        .map_or(String::new(), |f| format!("  stopped at depth {}: {}", length(f.depth), f.reason));
    // Of an insertion that stopped at once nothing is known.
    let largest = study.depth.last().map_or(NONE.to_owned(), |_| format!("{:.digits$}", study.max_orthogonal));
    let error = error.map_or(String::new(), |error| format!(" ± {error:.digits$}"));
    format!("{largest}{error}{stopped}")
}
