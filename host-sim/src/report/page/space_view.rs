//! The bodies of a run in space, to be turned and cut in the page, and as pictures that need no script.
//!
//! The script draws with three.js, which the page holds. Where scripts or WebGL are missing, and on paper, pictures stand in
//! its place.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};
use model_offline::geometry::Point;
use model_offline::number::in_unit;
use model_offline::output::chart::{colour_bar, heading, sheet};
use model_offline::output::field_picture::Field;
use model_offline::output::space_picture::{
    Colours, CutPlane, Shown, SpaceGeometry, SpaceState, outside, planes, sections, seen_from,
};
use model_offline::scene::TissueVariant;
use serde::Serialize;

use super::embed::{CHART_WIDTH, charts, inline};
use super::fields::{ShownField, key};
use super::style;
use crate::bench::in_space::{SpaceCase, SpaceRun};

const THREE: &str = include_str!("three/three.min.js");
const THREE_LICENCE: &str = include_str!("three/LICENSE");
const SCRIPT: &str = include_str!("space_view.js");

/// Names of a case's strategies, in the order of its bodies.
pub(super) const STRATEGIES: [&str; 3] = ["no paddle", "static", "dynamic"];
/// The field of the pictures without script, which the view begins with as well.
const FIELD: Field = Field::Orthogonal;
/// How far from the target its surroundings reach, part of the body's diagonal.
const NEAR: f64 = 0.12;
/// What the normal of a plane has in common with the direction of view, at least: 25°.
const EDGE_ON: f64 = 0.42;
/// Steps of a displacement in the page, over the largest one.
const STEPS: f64 = 32_767.0;

/// The same scale for all strategies of a case: the largest value at a node.
fn scale(run: &SpaceRun, place: usize) -> f64 {
    let states = run.bodies.cases[place].iter().flatten();
    let all = states.flat_map(|state| FIELD.values_in_space(&run.bodies.geometry, state)).flatten();
    all.fold(0.0, f64::max)
}

/// The body of a case at rest: homogeneous tissue has no inclusions.
fn geometry(run: &SpaceRun, case: &SpaceCase) -> SpaceGeometry {
    match case.tissue {
        TissueVariant::Inclusion => run.bodies.geometry.clone(),
        TissueVariant::Homogeneous => run.bodies.geometry.without_inclusions(),
    }
}

/// Draws a case's body under a strategy, if it is there.
fn drawn<T>(run: &SpaceRun, place: usize, strategy: usize, draw: impl FnOnce(&Shown<'_>) -> T) -> Result<T, &str> {
    let state = run.bodies.cases[place][strategy].as_ref().map_err(String::as_str)?;
    let geometry = geometry(run, &run.cases[place]);
    let values = FIELD.values_in_space(&geometry, state).unwrap_or_default();
    let colours = Colours::Field { values: &values, scale: scale(run, place) };
    let shown = Shown { geometry: &geometry, state, colours, way: None, held_still: strategy == 1 };
    Ok(draw(&shown))
}

/// The case that the view begins with: one with inclusions, if there is one.
fn shown_first(run: &SpaceRun) -> usize {
    run.cases.iter().position(|case| case.tissue == TissueVariant::Inclusion).unwrap_or(0)
}

/// What the page begins with: the view, and what stands in its place.
pub(super) fn section(run: &SpaceRun) -> Markup {
    let unit = &run.units[0];
    let place = shown_first(run);
    html! {
        section #body {
            h2 { "The body at the end of the insertion" }
            @if let Ok(drawing) = drawn(run, place, 2, |shown| outside(shown, CHART_WIDTH)) {
                figure.stand-in {
                    (inline(&drawing))
                    figcaption { "Controlled, tissue " (run.cases[place].tissue.name()) ", displacements as they are. Blue: paddles; \
                        grey: needle and its contact; dark: immobile." }
                }
            }
            (view(&controls(run), true))
            figure.colours { (inline(&colour_bar(CHART_WIDTH, &FIELD.label(&run.units), scale(run, place)))) }
            p.quiet { "Bodies are solved for once more at the end of each insertion, to " (in_unit(run.depth, unit)) "." }
        }
    }
}

/// Indices of the paddles that any strategy attaches.
fn attached(run: &SpaceRun) -> Vec<u32> {
    run.bodies.cases.iter().flatten().flatten().flat_map(|state| state.paddles.iter().copied()).collect()
}

/// The view and how it is steered; whether what is read from it is read out, too.
fn view(controls: &Markup, is_read_out: bool) -> Markup {
    let politeness = if is_read_out { "polite" } else { "off" };
    html! {
        div #view.on-screen hidden {
            canvas tabindex="0" role="img" aria-label="The deformed body, to be turned" {}
            p.quiet { "Drag or arrow keys turn, two fingers or the right button move, + and − or, once the picture is chosen, the \
                wheel come nearer, 0 goes back." }
            (controls)
            p #view-reading aria-live=(politeness) {}
            ul.keys {
                li.k-led { "controlled paddle" }
                @if is_read_out { li.k-held { "paddle held still" } }
                li.k-needle { "needle, its contact and line" }
                li.k-immobile { "immobile" } li.k-inclusion { "inclusion" } li.k-target { "target: ring at rest, ball now" }
            }
        }
    }
}

/// What the view shows: case, strategy, field, cuts, exaggeration.
fn controls(run: &SpaceRun) -> Markup {
    let which = html! {
        label { "tissue " select #view-case { @for (i, case) in run.cases.iter().enumerate() {
            option value=(i) selected[i == shown_first(run)] { (case.tissue.name()) ", table of " (case.table_tissue.name()) }
        } } }
        label { "paddles " select #view-strategy { @for (i, name) in STRATEGIES.iter().enumerate() {
            option value=(i) selected[i == 2] { (name) }
        } } }
    };
    steering((&run.bodies.geometry, &run.units), &attached(run), &fields(run), &which)
}

/// What the colours can show: what all bodies have.
fn fields(run: &SpaceRun) -> Vec<Field> {
    let states: Vec<&SpaceState> = run.bodies.cases.iter().flatten().flatten().collect();
    let of_all = |field: &Field| {
        DISPLACEMENTS.contains(field) || !states.is_empty() && states.iter().all(|state| has(*field, run, state))
    };
    FIELDS.into_iter().filter(of_all).collect()
}

fn has(field: Field, run: &SpaceRun, state: &SpaceState) -> bool {
    field.values_in_space(&run.bodies.geometry, state).is_some()
}

/// The fields in the order in which they are offered.
const FIELDS: [Field; 4] = [Field::Orthogonal, Field::Size, Field::Strain, Field::VonMises];
/// Those that every displacement tells.
const DISPLACEMENTS: [Field; 2] = [Field::Orthogonal, Field::Size];

/// What the reader is offered.
fn called(field: Field) -> &'static str {
    match field {
        Field::Orthogonal => "orthogonal to the needle",
        Field::Size => "whole displacement",
        Field::Strain => "strain",
        Field::VonMises => "von Mises stress",
    }
}

/// How a body with these paddles attached is shown, beside what of it.
fn steering(
    (geometry, units): (&SpaceGeometry, &[String; 2]),
    attached: &[u32],
    fields: &[Field],
    which: &Markup,
) -> Markup {
    let planes = planes(geometry);
    let [view, _] = seen_from(geometry, attached);
    // Along the needle, and more aside than through the paddles that are looked at, unless it would be seen edge-on.
    let facing = |plane: &CutPlane| plane.normal.dot(&view).abs();
    let aside = usize::from(facing(&planes[1]) < facing(&planes[0]));
    let first = if facing(&planes[aside]) < EDGE_ON { 1 - aside } else { aside };
    html! {
        fieldset {
            legend { "What is shown" }
            div.choices {
                (which)
                label { "colour " select #view-field {
                    @for field in fields { option value=(key(*field)) { (called(*field)) } }
                } }
                label { "part " select #view-part {
                    option value="whole" { "the whole body" } option value="near" { "around the target, on a scale of its own" }
                } }
                label { "cut " select #view-cut {
                    option value="none" { "none" }
                    @for (i, plane) in planes.iter().enumerate() {
                        option value=(i) selected[i == first] { (plane.name(&units[0])) }
                    }
                    option value="all" { "all three: a corner taken out" }
                } }
            }
            div.slide {
                label for="view-times" { "displacements drawn" }
                input #view-times type="range" min="1" max="20" step="1" value="1";
                output #view-times-reading for="view-times" {}
            }
            div.choices {
                label { input #view-through type="checkbox"; " see through the outside" }
                label { input #view-rest type="checkbox"; " body at rest" }
            }
        }
    }
}

/// The parts of a live view that are a body in space.
#[derive(Debug)]
pub(crate) struct LiveView {
    /// What stands where the body is.
    pub(crate) body: String,
    /// Its style.
    pub(crate) style: String,
    /// Its data and scripts: they define `spaceView` where there is WebGL.
    pub(crate) scripts: String,
}

/// A view of a body at rest with these labels of length and stress, seen from where these paddles are, to be moved by a script.
pub(crate) fn live_view(geometry: &SpaceGeometry, units: &[String; 2], paddles: &[u32]) -> LiveView {
    let all: Vec<u32> = geometry.paddles.iter().map(|paddle| paddle.index).collect();
    let one = html! { input #view-case type="hidden" value="0"; input #view-strategy type="hidden" value="0"; };
    let body = html! {
        section #body {
            p.stand-in.quiet { "No picture of the body: this browser has no WebGL." }
            (view(&steering((geometry, units), paddles, &DISPLACEMENTS, &one), false))
            figure.colours { (inline(&colour_bar(CHART_WIDTH, &FIELD.label(units), 0.0))) }
            div #tip.on-screen hidden {}
        }
    };
    let rest = SpaceState { paddles: Vec::new(), paddle_displacements: Vec::new(), ..SpaceState::at_rest(geometry) };
    let case = Case { has_inclusions: !geometry.inclusions.is_empty(), strategies: vec![Some(moved_body(&rest))] };
    let data = data_of((geometry, units), (&all, &DISPLACEMENTS), &seen_from(geometry, paddles), (vec![case], true));
    LiveView {
        body: body.into_string(),
        style: format!("{}{}", style::view(), include_str!("live.css")),
        scripts: html! { script { (PreEscaped(include_str!("common.js"))) } (scripts_of(&data)) }.into_string(),
    }
}

/// Sections of a case under each strategy.
pub(super) fn case_sections(run: &SpaceRun, place: usize) -> Markup {
    html! {
        h3 { "Sections through the target at the end of the insertion" }
        p.quiet { "The planes are those through the target at rest. Dashed: at rest, and inclusions; ring: target at rest, dot: now; thick: \
            paddle, or dotted its rim where the section passes it by." }
        @for (strategy, name) in STRATEGIES.iter().enumerate() {
            h4 { (name) }
            @match drawn(run, place, strategy, |shown| sections(shown, 0.8 * CHART_WIDTH)) {
                Ok(drawings) => (charts(&drawings)),
                Err(why) => p { "No picture: the model did not get there (" (why) ")." },
            }
        }
        figure.colours { (inline(&colour_bar(CHART_WIDTH, &FIELD.label(&run.units), scale(run, place)))) }
    }
}

/// Outside and sections of a case under a strategy as a picture of its own; none where there is no body.
pub(super) fn sections_picture(run: &SpaceRun, place: usize, strategy: usize) -> Option<String> {
    let (case, unit) = (&run.cases[place], &run.units[0]);
    let draw = |shown: &Shown<'_>| {
        let mut drawings = vec![outside(shown, CHART_WIDTH)];
        drawings.extend(sections(shown, CHART_WIDTH));
        sheet("", &drawings, 2)
    };
    let all = drawn(run, place, strategy, draw).ok()?;
    let title = format!("{}: tissue {}, {}", run.scene, case.tissue, STRATEGIES[strategy]);
    let caption = format!(
        "Outside and sections through the target at rest at the end of the insertion, to {}.",
        in_unit(run.depth, unit)
    );
    let bar = colour_bar(CHART_WIDTH, &FIELD.label(&run.units), scale(run, place));
    let head = heading(&title, &caption, all.size[0]);
    Some(sheet(&title, &[head, all, bar], 1).file())
}

#[derive(Serialize)]
struct Data<'a> {
    /// Label of length.
    unit: &'a str,
    fields: Vec<ShownField>,
    /// How far from the target its surroundings reach, length.
    near: f64,
    /// Bytes of an index.
    index: usize,
    /// Positions of nodes, three numbers of 32 bits each; like all that follow little-endian in base 64.
    nodes: String,
    tetrahedra: String,
    /// One byte each.
    parts: String,
    outside: String,
    immobile: String,
    needle: String,
    paddles: Vec<Patch>,
    inclusions: Vec<String>,
    axis: [f64; 3],
    target: [f64; 3],
    contact: [f64; 3],
    extent: f64,
    /// Where the view is from at first, and upwards.
    view: [[f64; 3]; 2],
    planes: Vec<([f64; 3], f64)>,
    cases: Vec<Case>,
    /// Whether bodies are replaced again and again.
    live: bool,
}

#[derive(Serialize)]
struct Patch {
    index: u32,
    triangles: String,
}

#[derive(Serialize)]
struct Case {
    has_inclusions: bool,
    strategies: Vec<Option<MovedBody>>,
}

/// A body that has moved, as the script reads it.
#[derive(Serialize)]
pub(crate) struct MovedBody {
    depth: f64,
    paddles: Vec<u32>,
    moved: Vec<f64>,
    target: [f64; 3],
    /// Displacements of nodes, three numbers of 16 bits each, in steps of this length.
    step: f64,
    displacements: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    strain: Option<NodalValues>,
    #[serde(skip_serializing_if = "Option::is_none")]
    von_mises: Option<NodalValues>,
}

/// One value that is not negative per node, 16 bits each, in steps of this size.
#[derive(Serialize)]
struct NodalValues {
    step: f64,
    values: String,
}

impl NodalValues {
    /// None of no values.
    fn new(values: &[f64]) -> Option<Self> {
        let largest = values.iter().copied().fold(0.0, f64::max);
        let step = if largest > 0.0 { largest / f64::from(u16::MAX) } else { 1.0 };
        let steps = values.iter().flat_map(|value| ((value / step).round() as u16).to_le_bytes());
        let encoded = || STANDARD.encode(steps.collect::<Vec<u8>>());
        (!values.is_empty()).then(|| Self { step, values: encoded() })
    }
}

/// What the script reads of a state.
pub(crate) fn moved_body(state: &SpaceState) -> MovedBody {
    let largest = state.displacements.iter().flatten().fold(0.0_f64, |largest, part| largest.max(part.abs()));
    let step = if largest > 0.0 { largest / STEPS } else { 1.0 };
    let steps = state.displacements.iter().flatten().flat_map(|part| ((part / step).round() as i16).to_le_bytes());
    let length = |u: &[f64; 3]| u.iter().map(|part| part * part).sum::<f64>().sqrt();
    MovedBody {
        depth: state.depth,
        paddles: state.paddles.clone(),
        moved: state.paddle_displacements.iter().map(length).collect(),
        target: state.target,
        step,
        displacements: STANDARD.encode(steps.collect::<Vec<u8>>()),
        strain: NodalValues::new(&state.strain),
        von_mises: NodalValues::new(&state.von_mises),
    }
}

/// JSON of a run that is safe inside of a script element.
fn data(run: &SpaceRun) -> String {
    let attached = attached(run);
    let cases = run.cases.iter().zip(&run.bodies.cases).map(|(case, bodies)| Case {
        has_inclusions: case.tissue == TissueVariant::Inclusion,
        strategies: bodies.iter().map(|state| state.as_ref().ok().map(moved_body)).collect(),
    });
    let geometry = &run.bodies.geometry;
    let shown = (&attached[..], &fields(run)[..]);
    data_of((geometry, &run.units), shown, &seen_from(geometry, &attached), (cases.collect(), false))
}

/// The same of these cases of a body, or of one that lives, with these of its paddles and these fields, seen from there.
fn data_of(
    (geometry, units): (&SpaceGeometry, &[String; 2]),
    (paddles, fields): (&[u32], &[Field]),
    view: &[Point<3>; 2],
    (cases, live): (Vec<Case>, bool),
) -> String {
    // Two bytes number the nodes of most meshes.
    let index = if geometry.nodes.len() <= usize::from(u16::MAX) { 2 } else { 4 };
    let encode = |numbers: &mut dyn Iterator<Item = u32>| {
        STANDARD.encode(numbers.flat_map(|number| number.to_le_bytes().into_iter().take(index)).collect::<Vec<u8>>())
    };
    let triangles = |patch: &[[u32; 3]]| encode(&mut patch.iter().flatten().copied());
    let nodes = geometry.nodes.iter().flatten().flat_map(|part| (*part as f32).to_le_bytes());
    let data = Data {
        unit: &units[0],
        fields: fields.iter().map(|field| ShownField::new(*field, units)).collect(),
        near: NEAR * geometry.extent(),
        index,
        nodes: STANDARD.encode(nodes.collect::<Vec<u8>>()),
        tetrahedra: encode(&mut geometry.tetrahedra.iter().flatten().copied()),
        parts: STANDARD
            .encode(geometry.parts.iter().map(|part| u8::try_from(*part).unwrap_or(u8::MAX)).collect::<Vec<u8>>()),
        outside: triangles(&geometry.outside),
        immobile: triangles(&geometry.immobile),
        needle: triangles(&geometry.needle),
        paddles: geometry
            .paddles
            .iter()
            .filter(|patch| paddles.contains(&patch.index))
            .map(|patch| Patch { index: patch.index, triangles: triangles(&patch.triangles) })
            .collect(),
        inclusions: geometry.inclusions.iter().map(|surface| triangles(surface)).collect(),
        axis: geometry.axis,
        target: geometry.target,
        contact: geometry.middle(&geometry.needle).into(),
        extent: geometry.extent(),
        view: view.map(Into::into),
        planes: planes(geometry).map(|plane| (plane.normal.into(), plane.offset)).to_vec(),
        cases,
        live,
    };
    // Numbers that are not finite become null; the view then stays away.
    serde_json::to_string(&data).unwrap_or_else(|_| "null".to_owned()).replace('<', "\\u003c")
}

/// The view's data and scripts.
pub(super) fn scripts(run: &SpaceRun) -> Markup {
    scripts_of(&data(run))
}

fn scripts_of(data: &str) -> Markup {
    html! {
        script type="application/json" #space-data { (PreEscaped(data)) }
        script { (PreEscaped(format!("/* three.js\n{THREE_LICENCE}*/\n{THREE}"))) }
        script { (PreEscaped(SCRIPT)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_offline::output::table_text::hex;
    use sha2::{Digest as _, Sha256};

    /// The vendored file is the one that its README says how to make, and its licence is with it.
    #[test]
    fn the_vendored_file_has_the_hash_and_the_version_that_are_told() {
        let told = include_str!("three/README.md");
        let line = |name: &str| told.lines().find_map(|line| line.strip_prefix(name)).unwrap().trim().to_owned();
        assert_eq!(hex(&Sha256::digest(THREE)), line("SHA-256:"));
        let revision = line("Version:").split('.').nth(1).unwrap().to_owned();
        assert!(THREE.contains(&format!("=\"{revision}\"")), "three.js tells its revision");
        assert!(told.contains(&format!("npm install three@{}", line("Version:"))));
        assert!(THREE_LICENCE.starts_with("The MIT License"));
        // It stands in a script element and in a comment of it.
        assert!(!THREE.contains("</script") && !THREE.contains("<!--") && !THREE_LICENCE.contains("*/"));
    }
}
