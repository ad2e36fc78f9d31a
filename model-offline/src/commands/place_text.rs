//! A placement study as text: a row per paddle and one without, with the error of every number beside it.

use super::common::warned;
use model_offline::discretization::Resolution;
use model_offline::model::ModelError;
use model_offline::number::{decimals, length, smallest_told};
use model_offline::placement::accuracy::{AsGood, PaddleErrors, StaticErrors};
use model_offline::placement::study::{Optimum, StaticStudy};
use model_offline::placement::verdict::AGAINST_NOTHING;
use model_offline::placement::workflow::StudyAccuracy;
use model_offline::placement::{PaddleResult, Placement, PlacementStudy};
use std::fmt::Write as _;

/// An error of a static displacement that is explained, part of the displacement.
const ROUGH: f64 = 0.1;
/// What stands where there is no number.
const NONE: &str = "–";
/// What marks the best of a column, and the others.
const BEST: char = '*';
const NOT_BEST: char = ' ';

/// What the columns mean.
const LEGEND: &str = "\nJ⁻¹n: how the paddle moves the target by 1 across the needle, ‖J⁻¹n‖: how far it goes for that; max orthogonal: how far\n\
                      the target goes across the needle with the paddle held; ±: estimated error; of no paddle: share of that without; *: best\n";

/// The study on a screen.
pub(super) fn summary(study: &PlacementStudy, accuracy: Option<&Result<StudyAccuracy, ModelError>>) -> String {
    let (scene, optimum) = (study.model.scene(), study.placement.optimum);
    let known = accuracy.and_then(|a| a.as_ref().ok());
    let mut out = format!(
        "{} · {} tissue · {} nodes · {:.0} ms{}\n\n paddle   ‖J⁻¹n‖         ±   J⁻¹n                  \
         max orthogonal (static)        ±   of no paddle\n",
        scene.name,
        scene.tissue(),
        study.model.nodes(),
        1e3 * study.wall_s,
        in_lengths_of(&scene.length_unit)
    );
    let studies = study.placement.paddles.iter().map(|paddle| &paddle.static_study);
    let largest = studies.chain([&study.placement.no_paddle.static_study]).map(|study| study.max_orthogonal);
    let digits = decimals(smallest_told(largest), 6);
    for (i, paddle) in study.placement.paddles.iter().enumerate() {
        let errors = known.map(|known| &known.errors.paddles[i]);
        let _ = writeln!(out, "{}", paddle_row(paddle, errors, optimum, digits));
    }
    let none = &study.placement.no_paddle.static_study;
    let errors = known.map(|known| &known.errors.no_paddle);
    let none = static_part((none, errors), NOT_BEST, Some(1.0), digits);
    let _ = writeln!(out, "   none  {NONE:>8}  {NONE:>8}   {NONE:<20}  {none}");
    out.push_str(LEGEND);
    out.push_str(&notes(study, accuracy));
    out
}

/// In what lengths are told, at the end of a line; nothing for scenes without units.
pub(super) fn in_lengths_of(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" · lengths in {unit}") }
}

fn paddle_row(paddle: &PaddleResult, errors: Option<&PaddleErrors>, optimum: Optimum, digits: usize) -> String {
    let measure = match paddle.best_direction {
        Some(_) => format!("{:8.4}", paddle.controllability_measure),
        None => format!("{NONE:>8}"),
    };
    let error = errors.and_then(|e| e.controllability_measure);
    let error = error.map_or(NONE.to_owned(), |e| format!("{:.2} %", 100.0 * e));
    let direction = paddle.best_direction.map_or(NONE.to_owned(), |[x, y]| format!("({x:8.4}, {y:8.4})"));
    let mark = if optimum.dynamic_paddle == Some(paddle.index) { BEST } else { NOT_BEST };
    let mark_static = if optimum.static_paddle == paddle.index { BEST } else { NOT_BEST };
    let errors = errors.map(|e| &e.static_study);
    let rest = static_part((&paddle.static_study, errors), mark_static, paddle.static_over_no_paddle, digits);
    format!("{:>7}  {measure}{mark} {error:>8}   {direction:<20}  {rest}", paddle.index)
}

/// Largest orthogonal displacement with its mark, its error, its share of that without a paddle, and why the insertion ended
/// early; lengths with so many decimals.
fn static_part(
    (study, errors): (&StaticStudy, Option<&StaticErrors>),
    mark: char,
    share: Option<f64>,
    digits: usize,
) -> String {
    let error = errors.and_then(|e| e.max_orthogonal).map_or(NONE.to_owned(), |e| format!("{e:.digits$}"));
    let share = share.map_or(NONE.to_owned(), |share| match share > AGAINST_NOTHING {
        true => format!("{share:.0e}"),
        false => format!("{share:.3}"),
    });
    let stopped = study
        .failure
        .as_ref()
        .map_or(String::new(), |f| format!("  stopped at depth {}: {}", length(f.depth), f.reason));
    let jumped =
        study.jump.map_or(String::new(), |j| format!("  jumps from depth {} to {}", length(j.from), length(j.to)));
    // Of an insertion that stopped at once nothing is known.
    let largest = study.depth.last().map(|_| format!("{:.digits$}", study.max_orthogonal));
    let largest = largest.unwrap_or_else(|| NONE.to_owned());
    format!("{largest:>23}{mark} {error:>8}   {share:>12}{jumped}{stopped}")
}

fn notes(study: &PlacementStudy, accuracy: Option<&Result<StudyAccuracy, ModelError>>) -> String {
    let optimum = study.placement.optimum;
    let dynamic = optimum.dynamic_paddle.map_or(NONE.to_owned(), |index| index.to_string());
    let as_good = match accuracy {
        Some(Ok(known)) => known.errors.as_good(&study.placement),
        _ => AsGood::default(),
    };
    let left_out = accuracy.and_then(|known| known.as_ref().ok()).map_or(&[][..], |known| &known.left_out);
    let mut out = String::new();
    if let Some(e) = study.error_estimate {
        let _ = writeln!(
            out,
            "\nestimated error: controllability {:.2} %{}, small-depth target displacement {:.2} % of the largest",
            100.0 * e.controllability,
            without(left_out),
            100.0 * e.target_displacement
        );
    }
    let _ = writeln!(
        out,
        "\nbest static paddle: {}{}; best dynamic paddle: {dynamic}{}",
        optimum.static_paddle,
        also(&as_good.static_paddles),
        also(&as_good.dynamic_paddles)
    );
    out.push_str(&compared_to(study).unwrap_or_default());
    out.push_str(jumps(study).unwrap_or_default());
    for line in study.verdict() {
        let _ = writeln!(out, "{line}");
    }
    match accuracy {
        Some(Ok(known)) => out.push_str(&how_known(study, known)),
        Some(Err(error)) => {
            let _ = writeln!(out, "errors are not known: {error}");
        }
        None => {}
    }
    out.push_str(&warned(&study.model.scene().told_warnings()));
    out
}

/// Paddles that estimate and cross-check do not count.
fn without(paddles: &[u32]) -> String {
    let names: Vec<String> = paddles.iter().map(ToString::to_string).collect();
    match names.len() {
        0 => String::new(),
        1 => format!(" (without paddle {}, which cannot hold the target: its error is in its row)", names[0]),
        _ => format!(
            " (without paddles {}, which cannot hold the target: their errors are in their rows)",
            names.join(", ")
        ),
    }
}

/// Paddles that the errors do not tell from the best.
fn also(paddles: &[u32]) -> String {
    let names: Vec<String> = paddles.iter().map(ToString::to_string).collect();
    match names.len() {
        0 => String::new(),
        1 => format!(" ({} is as good within the errors)", names[0]),
        _ => format!(" ({} are as good within the errors)", names.join(", ")),
    }
}

/// To which depth static paddles are compared, where none got to the end.
fn compared_to(study: &PlacementStudy) -> Option<String> {
    let all = || study.placement.paddles.iter().map(|paddle| &paddle.static_study);
    if all().any(|study| study.failure.is_none()) {
        return None;
    }
    let compared = match StaticStudy::common_depth(all()) {
        Some(depth) => format!("is best to depth {}, which all reach that reach an increment", length(depth)),
        None => "comes the farthest, or is best at rest".to_owned(),
    };
    Some(format!("no static paddle reaches the full depth: the best one {compared}\n"))
}

/// What a jump is, where there is one.
fn jumps(study: &PlacementStudy) -> Option<&'static str> {
    let Placement { paddles, no_paddle, .. } = &study.placement;
    let mut all = paddles.iter().map(|paddle| &paddle.static_study).chain([&no_paddle.static_study]);
    all.any(|study| study.jump.is_some()).then_some(
        "where an insertion jumps its tissue seems to go over to another equilibrium, as where a surface folds: numbers beyond depend \
         on the nodes\n",
    )
}

/// Where the errors come from, and what they do not cover.
fn how_known(study: &PlacementStudy, known: &StudyAccuracy) -> String {
    let mut out = String::new();
    if let Some(check) = known.cross_check {
        let _ = writeln!(out, "{}{}", check.line(), without(&known.left_out));
    }
    let placement = &study.placement;
    if placement.profile_nodes != study.model.nodes() {
        let _ = writeln!(out, "the insertion was followed on {} nodes", placement.profile_nodes);
    }
    let studies = placement.paddles.iter().zip(&known.errors.paddles);
    let mut followed = studies.filter(|(paddle, _)| !paddle.static_study.depth.is_empty());
    let unknown = followed.any(|(_, errors)| errors.static_study.max_orthogonal.is_none());
    if unknown {
        let why = match known.errors.second_nodes {
            Some(nodes) => format!("the insertion on other nodes ({nodes}) does not get as deep"),
            None => "the insertion could not be followed on other nodes".to_owned(),
        };
        let _ = writeln!(out, "static displacements without an error: {why}");
    }
    if let (Some(nodes), true) = (known.errors.second_nodes, is_static_rough(study, known)) {
        let _ = writeln!(
            out,
            "static displacements are told with how far those on {nodes} other nodes are off: the tolerance is of \
             controllability"
        );
    }
    out
}

/// Whether some static displacement of a scene with a tolerance is known to a tenth of itself at best.
fn is_static_rough(study: &PlacementStudy, known: &StudyAccuracy) -> bool {
    if !matches!(study.model.scene().discretization.resolution, Resolution::Tolerance(_)) {
        return false;
    }
    let pairs = study.placement.paddles.iter().zip(&known.errors.paddles);
    let mut errors =
        pairs.map(|(paddle, errors)| (paddle.static_study.max_orthogonal, errors.static_study.max_orthogonal));
    errors.any(|(value, error)| error.is_some_and(|error| error > ROUGH * value))
}
