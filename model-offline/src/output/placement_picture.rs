//! A placement study drawn: what every paddle does held and moved, alone or beside an earlier study.

use super::chart::Dash;
use super::chart::number::number;
use super::chart::{Axis, Bars, Colour, Figure, Marker, Panel, Place, ReferenceLine, Series};
use super::result_file::{ResultError, read_value};
use crate::placement::accuracy::measure_range;
use crate::placement::verdict::stays_on_the_line;
use serde::Deserialize;
use std::path::Path;

/// Measures that differ by less than this part are equal but for rounding.
const EQUAL: f64 = 1e-6;
/// Pairs of paddles that are drawn, the best ones; all are in the file.
const PAIRS: usize = 10;
/// How far an earlier value stands from the middle of its bar, where the estimated error is drawn.
const ASIDE: f64 = 0.2;
/// Paddles and pairs of a file that is drawn; larger ones are no studies of ours.
const MOST_SETS: usize = 10_000;

/// A study as `model-offline place --json` writes it, of this as much as is drawn.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct DrawnStudy {
    scene: String,
    tissue: String,
    /// Units of length and stress; absent in studies of older versions.
    #[serde(default)]
    units: Option<[String; 2]>,
    paddles: Vec<Single>,
    #[serde(default)]
    pairs: Vec<Pair>,
    no_paddle: NoPaddle,
    optimum: Optimum,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Single {
    index: u32,
    #[serde(flatten)]
    does: Does,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Pair {
    paddles: [u32; 2],
    #[serde(flatten)]
    does: Does,
}

/// What paddles do.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Does {
    /// ‖J⁻¹n‖, in space 1/σ_min(NᵀJ); none where they cannot control the target.
    controllability_measure: Option<f64>,
    #[serde(rename = "static")]
    held: Held,
    #[serde(default)]
    error: Option<Errors>,
}

/// The insertion with them held.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Held {
    #[serde(default)]
    depth: Option<Vec<f64>>,
    max_orthogonal: f64,
    failure: Option<serde_json::Value>,
}

impl Held {
    /// Largest displacement, length; not a number where the insertion stopped at once, so that nothing is known of it.
    fn largest(&self) -> f64 {
        let stopped_at_once = self.failure.is_some() && self.depth.as_ref().is_some_and(Vec::is_empty);
        if stopped_at_once { f64::NAN } else { self.max_orthogonal }
    }

    /// Whether the target does not leave the needle's line, but for rounding.
    fn stays_on_the_line(&self) -> bool {
        let deepest = self.depth.as_ref().and_then(|depth| depth.last());
        deepest.is_some_and(|depth| stays_on_the_line(self.max_orthogonal, *depth))
    }
}

/// Estimated errors: of the measure over itself, of the displacement in units of length.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Errors {
    controllability_measure: Option<f64>,
    #[serde(rename = "static")]
    held: Option<HeldError>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct HeldError {
    max_orthogonal: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct NoPaddle {
    #[serde(rename = "static")]
    held: Held,
}

/// The best, by index: one paddle, or in space those of a set.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Optimum {
    #[serde(rename = "static")]
    held: Option<Set>,
    dynamic: Option<Set>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Set {
    One(u32),
    Some(Vec<u32>),
}

impl Set {
    fn name(&self) -> String {
        match self {
            Self::One(index) => index.to_string(),
            Self::Some(paddles) => named(paddles),
        }
    }

    fn in_words(&self) -> String {
        match self {
            Self::Some(paddles) if paddles.len() > 1 => format!("pair {}", self.name()),
            _ => format!("paddle {}", self.name()),
        }
    }
}

fn named(paddles: &[u32]) -> String {
    paddles.iter().map(u32::to_string).collect::<Vec<_>>().join("+")
}

/// Reads a study; none where the file is a result of another kind.
///
/// # Errors
/// [`ResultError`]: it cannot be read, is no JSON, or calls itself a study and is none.
pub fn read_study(path: &Path) -> Result<Option<DrawnStudy>, ResultError> {
    let value = read_value(path)?;
    if value.get("optimum").is_none() {
        return Ok(None);
    }
    let none = |reason: String| ResultError::NotAResult { path: path.to_owned(), reason };
    let study: DrawnStudy = serde_json::from_value(value).map_err(|error| none(error.to_string()))?;
    let sets = study.paddles.len() + study.pairs.len();
    if study.paddles.is_empty() || sets > MOST_SETS {
        return Err(none(format!("it has {} paddles and {} pairs", study.paddles.len(), study.pairs.len())));
    }
    let numbers = study.sets().into_iter().flat_map(|(_, does)| [does.held.max_orthogonal, does.measure()]);
    if let Some(number) = numbers.chain([study.no_paddle.held.max_orthogonal]).find(|number| *number < 0.0) {
        return Err(none(format!("a size in it is {number}")));
    }
    Ok(Some(study))
}

impl Does {
    /// The controllability measure; not a number where the target cannot be controlled.
    fn measure(&self) -> f64 {
        self.controllability_measure.unwrap_or(f64::NAN)
    }

    /// Between what the measure may lie.
    fn measure_range(&self) -> Option<[f64; 2]> {
        Some(measure_range(self.measure(), self.error.as_ref()?.controllability_measure?))
    }

    /// Between what the displacement may lie, length.
    fn held_range(&self) -> Option<[f64; 2]> {
        let error = self.error.as_ref()?.held.as_ref()?.max_orthogonal?;
        Some([self.held.max_orthogonal - error, self.held.max_orthogonal + error])
    }
}

/// What one panel shows over every set.
struct Shown<'a> {
    title: String,
    y: Axis,
    best: Option<&'a Set>,
    colour: Colour,
    /// The height, and between what it may really lie.
    of: fn(&Does) -> (f64, Option<[f64; 2]>),
}

impl DrawnStudy {
    /// Every paddle, then the pairs that control the target best, with their names.
    fn sets(&self) -> Vec<(String, &Does)> {
        let mut pairs: Vec<&Pair> = self.pairs.iter().collect();
        pairs.sort_by(|a, b| a.does.measure().total_cmp(&b.does.measure()));
        let singles = self.paddles.iter().map(|single| (single.index.to_string(), &single.does));
        singles.chain(pairs.into_iter().take(PAIRS).map(|pair| (named(&pair.paddles), &pair.does))).collect()
    }

    fn does(&self, name: &str) -> Option<&Does> {
        let pair = || self.pairs.iter().find(|pair| named(&pair.paddles) == name).map(|pair| &pair.does);
        self.paddles.iter().find(|single| single.index.to_string() == name).map(|single| &single.does).or_else(pair)
    }

    /// How far the needle moves the target with these paddles held, length.
    fn largest(&self, paddles: &Set) -> f64 {
        self.does(&paddles.name()).map_or(f64::NAN, |does| does.held.largest())
    }

    fn length(&self) -> &str {
        self.units.as_ref().map_or("1", |units| units[0].as_str())
    }

    /// One panel: a bar for every set, with what it may be off by, and an earlier study's value as an open marker.
    fn panel(&self, Shown { title, y, best, colour, of }: Shown<'_>, earlier: Earlier) -> Panel {
        let sets = self.sets();
        let best = best.map(Set::name);
        let name = |name: &String| if best.as_ref() == Some(name) { format!("{name}\nbest") } else { name.clone() };
        let places = Axis::categories("paddle position", sets.iter().map(|(set, _)| name(set)).collect());
        let mut panel = Panel::new(&title, places, y);
        let heights: Vec<(f64, f64, Option<[f64; 2]>)> = sets
            .iter()
            .enumerate()
            .map(|(k, (_, does))| (k as f64, of(does)))
            .map(|(x, (height, range))| (x, height, range))
            .collect();
        let bars = heights.iter().filter(|(_, height, _)| height.is_finite()).map(|&(x, y, _)| [x - 0.35, x + 0.35, y]);
        panel.bars.push(Bars { label: earlier.map_or("", |_| "this study").to_owned(), colour, bars: bars.collect() });
        panel.lines.push(ReferenceLine::new("", Place::Y(0.0), Dash::Solid));
        // What may be any number is drawn to twice what was found.
        let range = |&(x, height, range): &(f64, f64, Option<[f64; 2]>)| {
            let [least, most] = range.filter(|[least, _]| least.is_finite())?;
            Some([(x, least.max(0.0)), (x, most.min(2.0 * height.max(0.0)).max(height))])
        };
        let ranges: Vec<[(f64, f64); 2]> = heights.iter().filter_map(range).collect();
        for (k, range) in ranges.into_iter().enumerate() {
            let label = if k == 0 { "estimated error" } else { "" };
            panel.series.push(Series::curve(label, Colour::Ink, Dash::Solid, range.to_vec()));
        }
        if let Some((name, study)) = earlier {
            let before = |(k, (set, _)): (usize, &(String, &Does))| Some((k as f64 + ASIDE, of(study.does(set)?).0));
            let points = sets.iter().enumerate().filter_map(before).collect();
            panel.series.push(Series::scatter(name, Colour::Ink, Marker::Diamond, points).open());
        }
        let mut failed = Series::scatter("", colour, Marker::Circle, Vec::new());
        failed.failures =
            heights.iter().filter(|(_, height, _)| !height.is_finite()).map(|&(x, y, _)| (x, y)).collect();
        panel.series.push(failed);
        panel
    }

    fn stopped(&self) -> Vec<String> {
        self.sets().into_iter().filter(|(_, does)| does.held.failure.is_some()).map(|(name, _)| name).collect()
    }
}

/// An earlier study with its name.
type Earlier<'a> = Option<(&'a str, &'a DrawnStudy)>;

/// The study as a figure: controllability, and the target's displacement with each paddle held. With an earlier one, named,
/// its values stand beside those of the same paddles.
pub fn svg(study: &DrawnStudy, earlier: Earlier) -> String {
    let Optimum { held, dynamic } = &study.optimum;
    let symbol = if study.pairs.is_empty() { "‖J⁻¹n‖" } else { "1/σ_min(NᵀJ)" };
    let controls = match dynamic {
        Some(set) => format!("Moved: {} needs the least travel{}", set.in_words(), as_well(study)),
        None => "Moved: no paddle controls the target".to_owned(),
    };
    let holds = match held {
        Some(set)
            if study.largest(set) > study.no_paddle.held.largest() || study.no_paddle.held.stays_on_the_line() =>
        {
            "Held: no paddle helps".to_owned()
        }
        Some(set) => format!("Held: {} moves the target least", set.in_words()),
        None => "Held: no paddle".to_owned(),
    };
    let axis = Axis::linear(&format!("travel per displacement of the target {symbol}"), "1");
    let moved = Shown {
        title: controls,
        y: axis,
        best: dynamic.as_ref(),
        colour: Colour::Blue,
        of: |does| (does.measure(), does.measure_range()),
    };
    let axis = Axis::linear("largest displacement orthogonal to the needle", study.length());
    let still = Shown {
        title: holds,
        y: axis,
        best: held.as_ref(),
        colour: Colour::Vermillion,
        of: |does| (does.held.largest(), does.held_range()),
    };
    let mut fixture = study.panel(still, earlier);
    let none = Some(study.no_paddle.held.largest()).filter(|none| none.is_finite());
    fixture.lines.extend(none.map(|none| ReferenceLine::new("no paddle", Place::Y(none), Dash::Dashed)));
    let panels = vec![study.panel(moved, earlier), fixture];
    Figure { title: title(study, earlier), caption: caption(study, earlier), panels, columns: 2 }.svg()
}

/// What the figure answers.
fn title(study: &DrawnStudy, earlier: Earlier) -> String {
    let best = |study: &DrawnStudy| study.optimum.dynamic.as_ref().map(|set| (set.in_words(), set.name()));
    let name = format!("{}, {}", study.scene, study.tissue);
    let (Some((words, set)), Some((_, before))) = (best(study), earlier) else {
        let words = best(study).map_or("no paddle".to_owned(), |(words, _)| words);
        return format!("{name}: {words} controls the target best{}", as_well(study));
    };
    let measure = |study: &DrawnStudy| study.does(&set).map_or(f64::NAN, Does::measure);
    let [was, is] = [before, study].map(measure);
    let held = match best(before) {
        Some((_, earlier)) if earlier == set => "is the best to move as before".to_owned(),
        Some((earlier, _)) => format!("is the best to move, in place of {earlier}"),
        None => "is the best to move, where none was".to_owned(),
    };
    format!("{name}: {words} {held}; its travel per displacement is {} where it was {}", number(is, 3), number(was, 3))
}

/// Those that control the target as well as the best, but for rounding.
fn as_well(study: &DrawnStudy) -> String {
    let Some(best) = study.optimum.dynamic.as_ref().map(Set::name) else { return String::new() };
    let least = study.does(&best).map_or(f64::NAN, Does::measure);
    let is_equal = |does: &Does| (does.measure() - least).abs() <= EQUAL * least;
    let all = study.sets().into_iter().filter(|(name, does)| *name != best && is_equal(does));
    let all: Vec<String> = all.map(|(name, _)| name).collect();
    if all.is_empty() { String::new() } else { format!(", {} as well", all.join(", ")) }
}

fn caption(study: &DrawnStudy, earlier: Earlier) -> String {
    let mut text =
        "Travel: how far the paddle moves per displacement of the target orthogonal to the needle, at rest.".to_owned();
    if let Some((name, before)) = earlier {
        text.push_str(&format!(" Open markers: {name} ({}, {}).", before.scene, before.tissue));
    }
    let left = study.pairs.len().saturating_sub(PAIRS);
    if left > 0 {
        text.push_str(&format!(" {left} more pairs are in the file."));
    }
    let stopped = study.stopped();
    if !stopped.is_empty() {
        text.push_str(&format!(
            " The insertion stopped early with {}: what is drawn is up to there.",
            stopped.join(", ")
        ));
    }
    text
}
