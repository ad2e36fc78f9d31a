//! `model-offline place` of a scene in space: singles and pairs.

use super::check_space;
use super::common::{RunArgs, StudyProgress, warned};
use super::error::CliError;
use super::json::write_json;
use super::place_text::in_lengths_of;
use model_offline::number::{decimals, length, smallest_told};
use model_offline::parallel;
use model_offline::placement::space::study::{SpaceAnswer, SpaceStatic};
use model_offline::placement::space::{SpaceErrorEstimate, SpaceStudy};
use model_offline::scene::space::SpaceScene;
use model_offline::tell;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// What stands where there is no number.
const NONE: &str = "–";
/// Pairs that are listed; all are in the JSON.
const LISTED: usize = 10;

pub(super) fn run(scene: &SpaceScene, json: Option<&Path>, run: &RunArgs) -> Result<(), CliError> {
    if !run.quiet {
        scene.notes.iter().for_each(|note| eprintln!("note: {note}"));
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
        for [a, b] in overlapping(&study) {
            eprintln!("note: paddles {a} and {b} overlap, and cannot be attached together: no such pair is the best");
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
    let (mut paddles, mut pairs) = (json!(placement.paddles), json!(placement.pairs));
    let results = paddles.as_array_mut().into_iter().flatten().chain(pairs.as_array_mut().into_iter().flatten());
    for (i, result) in results.enumerate() {
        let estimate = study.error_estimate.as_ref();
        for (key, of) in [("controllability_measure", by_set as OfSets), ("controllability_full", full_by_set)] {
            // Nothing is known of a number that is none.
            let error = estimate.and_then(|estimate| of(estimate).get(i)).filter(|_| !result[key].is_null());
            result["error"][key] = json!(error);
        }
        result["error"]["max_orthogonal"] = json!(static_error(study, i));
    }
    let mut no_paddle = json!(placement.no_paddle);
    no_paddle["error"] =
        json!({ "max_orthogonal": static_error(study, placement.paddles.len() + placement.pairs.len()) });
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
        "overlapping": overlapping(study),
        "no_paddle": no_paddle,
        "optimum": placement.optimum,
        "optimum_single": placement.optimum_single,
        "warnings": warnings,
    })
}

/// The static study of a paddle, then of a pair, then of none.
fn static_study(study: &SpaceStudy, set: usize) -> Option<&SpaceStatic> {
    let placement = &study.placement;
    let singles = placement.paddles.iter().map(|paddle| &paddle.answer.static_study);
    let pairs = placement.pairs.iter().map(|pair| &pair.answer.static_study);
    singles.chain(pairs).chain([&placement.no_paddle.static_study]).nth(set)
}

/// The same with what is estimated of its error per depth at rest.
fn static_of(study: &SpaceStudy, set: usize) -> Option<(&SpaceStatic, f64)> {
    let of = static_study(study, set)?;
    let per_depth = study.error_estimate.as_ref()?.per_depth_by_set.get(set)?;
    // Of an insertion that stopped at once nothing is known.
    (!of.depth.is_empty()).then_some((of, *per_depth))
}

/// Estimated error of its largest orthogonal displacement; none where nothing is known of the model at rest.
fn static_error(study: &SpaceStudy, set: usize) -> Option<f64> {
    static_of(study, set).map(|(of, per_depth)| of.largest(of.depth.len(), per_depth).1)
}

/// Pairs of paddles that cannot be attached together, by index.
fn overlapping(study: &SpaceStudy) -> Vec<[u32; 2]> {
    study.model.overlapping().iter().map(|pair| pair.map(|p| study.model.scene().paddles[p].index)).collect()
}

/// The study on a screen.
fn summary(study: &SpaceStudy) -> String {
    let (scene, placement) = (study.model.scene(), &study.placement);
    let singles = placement.paddles.iter().map(|p| (vec![p.index], &p.answer));
    let pairs = placement.pairs.iter().map(|p| (p.paddles.to_vec(), &p.answer));
    let all: Vec<(Vec<u32>, &SpaceAnswer)> = singles.chain(pairs).collect();
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
            if [&placement.optimum.dynamic, &placement.optimum_single.dynamic].contains(&paddles) { '*' } else { ' ' },
            error(by_set, answer.controllability_measure),
            measure(answer.controllability_full),
            error(full_by_set, answer.controllability_full),
            fixture(&answer.static_study, static_error(study, i), digits)
        );
    }
    if left > 0 {
        let _ = writeln!(out, "   ({left} more pairs in the JSON)");
    }
    let _ = writeln!(
        out,
        "    none   {NONE:>12}  {NONE:>8} {NONE:>10} {NONE:>8}   {}",
        fixture(&placement.no_paddle.static_study, static_error(study, all.len()), digits)
    );
    for (what, best) in [("single paddle", &placement.optimum_single), ("pair", &placement.optimum)] {
        if what == "pair" && placement.pairs.is_empty() {
            continue;
        }
        let words = |paddles: &[u32]| if paddles.is_empty() { NONE.to_owned() } else { named(paddles) };
        let _ = writeln!(
            out,
            "\nbest static {what}: {}{}; best dynamic {what}: {}",
            words(&best.fixture),
            as_good(study, &all, &best.fixture),
            words(&best.dynamic)
        );
        let fixture = all.iter().position(|(paddles, _)| *paddles == best.fixture);
        out.extend(fixture.and_then(|place| harms(what, study, place)));
    }
    if let Some(line) = second_pays(study) {
        let _ = writeln!(out, "{line}");
    }
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

/// Which other fixtures of as many paddles the errors leave as good as the best, to the depth that both reached; none that stopped where
/// the best did not.
fn as_good(study: &SpaceStudy, all: &[(Vec<u32>, &SpaceAnswer)], best: &[u32]) -> String {
    let Some(place) = all.iter().position(|(paddles, _)| paddles == best) else { return String::new() };
    let Some((of_best, best_per_depth)) = static_of(study, place) else { return String::new() };
    let is_as_good = |i: usize| {
        static_of(study, i).is_some_and(|(other, per_depth)| {
            let common = other.depth.len().min(of_best.depth.len());
            let (largest, error) = other.largest(common, per_depth);
            let (least, its_error) = of_best.largest(common, best_per_depth);
            (other.failure.is_none() || of_best.failure.is_some()) && largest - error <= least + its_error
        })
    };
    let overlapping = overlapping(study);
    let is_alike = |paddles: &[u32]| {
        paddles.len() == best.len() && paddles != best && !overlapping.iter().any(|pair| pair[..] == *paddles)
    };
    let alike = all.iter().enumerate().filter(|(i, (paddles, _))| is_alike(paddles) && is_as_good(*i));
    let found: Vec<String> = alike.map(|(_, (paddles, _))| named(paddles)).collect();
    match &found[..] {
        [] => String::new(),
        [one] => format!(" (or {one}, within the errors)"),
        [one, two] => format!(" (or {one}, or {two}, within the errors)"),
        [first, rest @ ..] => format!(" (or {first}, or {} others, within the errors)", rest.len()),
    }
}

/// Says so where even the best fixture, which is set `place`, moves the target more than no paddle does.
fn harms(what: &str, study: &SpaceStudy, place: usize) -> Option<String> {
    let none = study.placement.paddles.len() + study.placement.pairs.len();
    let (of, of_none) = (static_study(study, place)?, static_study(study, none)?);
    let factor = of.over(of_none).filter(|factor| *factor > 1.0)?;
    let common = of.depth.len().min(of_none.depth.len());
    let within = |set: usize| static_of(study, set).map(|(of, per_depth)| of.largest(common, per_depth));
    let is_open = within(place)
        .zip(within(none))
        .is_some_and(|((largest, error), (least, its_error))| largest - error <= least + its_error);
    let open = if is_open { ", which the errors leave open" } else { "" };
    Some(format!(
        "no static {what} helps: the best moves the target {factor:.2} times as far as no paddle does{open}\n"
    ))
}

/// Whether the second paddle buys anything at rest.
fn second_pays(study: &SpaceStudy) -> Option<String> {
    let placement = &study.placement;
    let least = |measures: &mut dyn Iterator<Item = f64>| measures.min_by(f64::total_cmp).filter(|m| m.is_finite());
    let single = least(&mut placement.paddles.iter().map(|p| p.answer.controllability_measure))?;
    let pair = least(&mut placement.pairs.iter().map(|p| p.answer.controllability_measure))?;
    let way = "the way for the worst direction";
    let gain = 100.0 * (1.0 - pair / single);
    // What would be told as nothing is nothing.
    Some(match format!("{gain:.1}") {
        told if gain > 0.0 && told != "0.0" => {
            format!("a second paddle shortens {way} by {told} % ({single:.3} to {pair:.3})")
        }
        _ => format!("a second paddle does not shorten {way} ({single:.3} to {pair:.3})"),
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
