//! Results in space, read to be drawn.

use super::{ResultError, Which, case_name, case_of, single_state};
use crate::output::space_picture::{DrawnBody, SpaceGeometry, SpaceState};
use crate::scene::TissueVariant;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// As `solve` writes it, of this as much as is drawn.
#[derive(Debug, Deserialize)]
struct Solved {
    tissue: String,
    geometry: SpaceGeometry,
    paddles: Vec<u32>,
    paddle_displacements: Vec<[f64; 3]>,
    depth: f64,
    target_displacement: [f64; 3],
    node_displacements: Vec<[f64; 3]>,
    strain: Vec<f64>,
    von_mises: Option<Vec<f64>>,
}

/// As `run` writes it.
#[derive(Debug, Deserialize)]
struct Compared {
    cases: Vec<Case>,
    bodies: Bodies,
}

#[derive(Debug, Deserialize)]
struct Case {
    tissue: String,
    table_tissue: String,
}

/// Per case the bodies of no paddle, the static ones and the dynamic ones, or why there is none.
#[derive(Debug, Deserialize)]
struct Bodies {
    geometry: SpaceGeometry,
    cases: Vec<[Result<SpaceState, String>; 3]>,
}

/// Strategies in the order of a case's bodies.
const STRATEGIES: [&str; 3] = ["none", "static", "dynamic"];

/// One state of a result in space.
pub(super) fn read(path: &Path, value: Value, which: &Which) -> Result<DrawnBody, ResultError> {
    let no_result =
        |error: serde_json::Error| ResultError::NotAResult { path: path.to_owned(), reason: error.to_string() };
    let body = if value.get("cases").is_some() {
        compared(path, serde_json::from_value(value).map_err(no_result)?, which)?
    } else {
        single_state(path, which)?;
        if value.get("geometry").is_none() {
            let reason = "it has no geometry".to_owned();
            return Err(ResultError::NotAResult { path: path.to_owned(), reason });
        }
        solved(serde_json::from_value(value).map_err(no_result)?)
    };
    let checked = body.geometry.check().and_then(|()| body.state.check(&body.geometry));
    checked.map_err(|reason| ResultError::NotAResult { path: path.to_owned(), reason: reason.to_owned() })?;
    Ok(body)
}

fn solved(solved: Solved) -> DrawnBody {
    let mut displacements = solved.node_displacements;
    // Middle nodes of quadratic elements, which stand behind the corners, are not drawn.
    displacements.truncate(solved.geometry.nodes.len());
    let state = SpaceState {
        depth: solved.depth,
        paddles: solved.paddles,
        paddle_displacements: solved.paddle_displacements,
        displacements,
        target: solved.target_displacement,
        strain: solved.strain,
        von_mises: solved.von_mises.unwrap_or_default(),
    };
    DrawnBody::new(solved.geometry, state, &solved.tissue, false)
}

fn compared(path: &Path, compared: Compared, which: &Which) -> Result<DrawnBody, ResultError> {
    let missing = |what: String, help: String| ResultError::NotInIt { path: path.to_owned(), what, help };
    let Compared { cases, bodies } = compared;
    let names: Vec<String> = cases.iter().map(|case| case_name(&case.tissue, &case.table_tissue)).collect();
    let place = case_of(path, which, &names)?;
    let Some(states) = bodies.cases.into_iter().nth(place) else {
        let reason = "not every case has its bodies".to_owned();
        return Err(ResultError::NotAResult { path: path.to_owned(), reason });
    };
    if which.depth.is_some() {
        let what = "a run in space keeps its bodies at the end of the insertion alone".to_owned();
        return Err(missing(what, "leave --depth out, or solve at that depth".to_owned()));
    }
    let wanted = which.strategy.as_deref().unwrap_or("dynamic");
    let Some(strategy) = STRATEGIES.iter().position(|name| *name == wanted) else {
        return Err(missing(format!("case {} has no {wanted}", place + 1), STRATEGIES.join(", ")));
    };
    let [none, fixture, dynamic] = states;
    let state = [none, fixture, dynamic].into_iter().nth(strategy).unwrap_or_else(|| Err(String::new()));
    let state = state.map_err(|why| {
        missing(format!("case {}, {wanted}, has no body: {why}", place + 1), "draw another strategy".to_owned())
    })?;
    let is_homogeneous = cases[place].tissue == TissueVariant::Homogeneous.name();
    let geometry = if is_homogeneous { bodies.geometry.without_inclusions() } else { bodies.geometry };
    Ok(DrawnBody::new(geometry, state, &format!("{}, {wanted}", names[place]), wanted == "static"))
}
