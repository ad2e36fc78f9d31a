//! Results read again to be drawn: what `model-offline solve --json` and `host-sim run` wrote.

mod in_space;

use super::field_picture::ResultBody;
use super::geometry::Geometry;
use super::space_picture::DrawnBody;
use super::surface::triangles;
use crate::reading;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Which of a result's states is wanted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Which {
    /// Number of the case in a comparison, from 1 on; none: the first one.
    pub case: Option<usize>,
    /// `none`, `static`, `dynamic` or `dynamic-free-run`; none: the first of `dynamic`, `dynamic-free-run`, `static` and `none`
    /// that the case has.
    pub strategy: Option<String>,
    /// The depth, length; none: the deepest state.
    pub depth: Option<f64>,
}

/// Why a result cannot be drawn.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ResultError {
    /// It cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no result.
    #[error("{}: no result of `model-offline solve --json`, `model-offline place --json` or `host-sim run`: {reason}", path.display())]
    #[diagnostic(help(
        "a comparison's is DIR/result.json; results of `solve` of older versions have no geometry: solve again"
    ))]
    NotAResult {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// What is asked for is not in it.
    #[error("{}: {what}", path.display())]
    #[diagnostic(help("{help}"))]
    NotInIt {
        /// The file.
        path: PathBuf,
        /// What is missing.
        what: String,
        /// What there is.
        help: String,
    },
}

/// As `solve` writes it, of this as much as is drawn.
#[derive(Debug, Deserialize)]
struct Solved {
    scene: String,
    tissue: String,
    units: [String; 2],
    geometry: Geometry,
    paddle: Option<u32>,
    depth: f64,
    node_displacements: Vec<[f64; 2]>,
    strain: Vec<f64>,
    von_mises: Option<Vec<f64>>,
}

/// As `run` writes it.
#[derive(Debug, Deserialize)]
struct Compared {
    scene: String,
    units: [String; 2],
    geometry: Geometry,
    cases: Vec<Case>,
}

#[derive(Debug, Deserialize)]
struct Case {
    tissue: String,
    table_tissue: String,
    strategies: serde_json::Map<String, serde_json::Value>,
}

#[derive(Debug, Deserialize)]
struct Strategy {
    paddle: Option<u32>,
    frames: Vec<Frame>,
}

#[derive(Debug, Deserialize)]
struct Frame {
    depth: f64,
    nodes: Vec<[f64; 2]>,
    #[serde(default)]
    strain: Vec<f64>,
    #[serde(default)]
    von_mises: Vec<f64>,
}

/// The JSON of a file.
///
/// # Errors
/// [`ResultError`].
pub(super) fn read_value(path: &Path) -> Result<serde_json::Value, ResultError> {
    let text = reading::read_text(path, reading::TEXT)
        .map_err(|source| ResultError::Read { path: path.to_owned(), source })?;
    serde_json::from_str(&text)
        .map_err(|error| ResultError::NotAResult { path: path.to_owned(), reason: error.to_string() })
}

/// Strategies in the order in which they are looked for.
const STRATEGIES: [&str; 4] = ["dynamic", "dynamic-free-run", "static", "none"];

/// A body in a state, in the plane or in space.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyBody {
    /// In the plane.
    Planar(Box<ResultBody>),
    /// In space.
    Space(Box<DrawnBody>),
}

/// Reads one state of a result.
///
/// # Errors
/// [`ResultError`].
pub fn read_body(path: &Path, which: &Which) -> Result<AnyBody, ResultError> {
    let value = read_value(path)?;
    if value.get("dimension").is_some_and(|dimension| *dimension == 3) {
        return Ok(AnyBody::Space(Box::new(in_space::read(path, value, which)?)));
    }
    Ok(AnyBody::Planar(Box::new(in_the_plane(path, value, which)?)))
}

fn in_the_plane(path: &Path, value: serde_json::Value, which: &Which) -> Result<ResultBody, ResultError> {
    let no_result =
        |error: serde_json::Error| ResultError::NotAResult { path: path.to_owned(), reason: error.to_string() };
    let is_compared = value.get("cases").is_some();
    let body = if is_compared {
        compared(path, serde_json::from_value(value).map_err(no_result)?, which)?
    } else {
        solved(path, serde_json::from_value(value).map_err(no_result)?, which)?
    };
    let no_result = |reason: &str| ResultError::NotAResult { path: path.to_owned(), reason: reason.to_owned() };
    check(&body).map_err(no_result)?;
    let nodes = body.geometry.nodes.len();
    let fits = |values: &[f64]| values.is_empty() || values.len() == nodes;
    if body.nodes.len() != nodes || !fits(&body.strain) || !fits(&body.von_mises) {
        let reason = format!("not every one of its {nodes} nodes has a place and a value");
        return Err(ResultError::NotAResult { path: path.to_owned(), reason });
    }
    Ok(body)
}

/// Points of a scene that are drawn; larger ones are no scenes of ours.
const MOST_POINTS: usize = 20_000;
/// How far the needle's direction may be from a unit vector.
const UNIT: f64 = 1e-6;

/// Whether there is something to draw.
fn check(body: &ResultBody) -> Result<(), &'static str> {
    let geometry = &body.geometry;
    let paths =
        geometry.immobile.iter().chain(&geometry.inclusions).chain([&geometry.outline, &geometry.needle_contact]);
    let points: Vec<&[f64; 2]> = paths.flatten().chain([&geometry.target]).collect();
    let low = |k: usize| geometry.outline.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
    let high = |k: usize| geometry.outline.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
    let sides = [0, 1].map(|k| high(k) - low(k));
    let is_area = |[x, y]: [f64; 2]| x > 1e-9 * y && y > 1e-9 * x && (x * y).is_normal();
    let [ax, ay] = geometry.needle_axis;
    if points.len() > MOST_POINTS {
        return Err("its scene has more than 20,000 points");
    }
    if geometry.outline.len() < 3 || !is_area(sides) {
        return Err("its outline is no area");
    }
    if (ax.hypot(ay) - 1.0).abs() > UNIT {
        return Err("its needle's axis is no unit vector");
    }
    if triangles(&geometry.nodes, &geometry.outline).is_empty() {
        return Err("its nodes form no triangles");
    }
    if body.paddle.is_some_and(|index| geometry.paddles.iter().all(|paddle| paddle.index != index)) {
        return Err("its paddle is none of its scene");
    }
    Ok(())
}

fn solved(path: &Path, solved: Solved, which: &Which) -> Result<ResultBody, ResultError> {
    single_state(path, which)?;
    let Solved { scene, tissue, units, geometry, paddle, depth, node_displacements, strain, von_mises } = solved;
    let moved = geometry.nodes.iter().zip(&node_displacements).map(|(x, u)| [x[0] + u[0], x[1] + u[1]]);
    Ok(ResultBody {
        name: format!("{scene}, {tissue}, {}", attached(paddle)),
        nodes: moved.collect(),
        von_mises: von_mises.unwrap_or_default(),
        units,
        geometry,
        depth,
        paddle,
        strain,
    })
}

/// Refuses a choice among the states of a result that has one.
fn single_state(path: &Path, which: &Which) -> Result<(), ResultError> {
    if *which == Which::default() {
        return Ok(());
    }
    Err(ResultError::NotInIt {
        path: path.to_owned(),
        what: "a result of `solve` has one state".to_owned(),
        help: "leave --case, --strategy and --depth out".to_owned(),
    })
}

/// The place of the wanted one among the cases of these names.
fn case_of(path: &Path, which: &Which, names: &[String]) -> Result<usize, ResultError> {
    let number = which.case.unwrap_or(1);
    if (1..=names.len()).contains(&number) {
        return Ok(number - 1);
    }
    let names: Vec<String> = names.iter().zip(1..).map(|(name, k)| format!("{k}: {name}")).collect();
    Err(ResultError::NotInIt {
        path: path.to_owned(),
        what: format!("it has no case {number}"),
        help: names.join("; "),
    })
}

fn attached(paddle: Option<u32>) -> String {
    paddle.map_or_else(|| "no paddle".to_owned(), |index| format!("paddle {index}"))
}

fn compared(path: &Path, mut compared: Compared, which: &Which) -> Result<ResultBody, ResultError> {
    let missing = |what: String, help: String| ResultError::NotInIt { path: path.to_owned(), what, help };
    let names: Vec<String> = compared.cases.iter().map(Case::name).collect();
    let place = case_of(path, which, &names)?;
    let (number, case) = (place + 1, compared.cases.swap_remove(place));
    let get = |name: &str| case.strategies.get(&name.replace('-', "_")).filter(|strategy| !strategy.is_null());
    let there: Vec<&str> = STRATEGIES.into_iter().filter(|name| get(name).is_some()).collect();
    let wanted = which.strategy.as_deref().or(there.first().copied()).unwrap_or("any strategy");
    let found =
        get(wanted).cloned().ok_or_else(|| missing(format!("case {number} has no {wanted}"), there.join(", ")))?;
    let found: Strategy = serde_json::from_value(found)
        .map_err(|error| ResultError::NotAResult { path: path.to_owned(), reason: error.to_string() })?;
    if case.tissue == crate::scene::TissueVariant::Homogeneous.name() {
        compared.geometry.inclusions.clear();
    }
    let depths = || found.frames.iter().map(|frame| frame.depth);
    let deepest = depths().fold(f64::NEG_INFINITY, f64::max);
    let depth = which.depth.unwrap_or(deepest);
    let nearest = found.frames.into_iter().min_by(|a, b| (a.depth - depth).abs().total_cmp(&(b.depth - depth).abs()));
    let Some(Frame { depth, nodes, strain, von_mises }) = nearest else {
        return Err(missing(format!("case {number}, {wanted}, has no states"), there.join(", ")));
    };
    Ok(ResultBody {
        name: format!("{}, {}, {}, {}", compared.scene, case.name(), wanted.replace('-', " "), attached(found.paddle)),
        units: compared.units,
        geometry: compared.geometry,
        depth,
        paddle: found.paddle,
        nodes,
        strain,
        von_mises,
    })
}

impl Case {
    fn name(&self) -> String {
        case_name(&self.tissue, &self.table_tissue)
    }
}

/// A case is told by its tissue, and by that of its table where it is another.
fn case_name(tissue: &str, table_tissue: &str) -> String {
    if tissue == table_tissue { tissue.to_owned() } else { format!("{tissue} (table: {table_tissue})") }
}
