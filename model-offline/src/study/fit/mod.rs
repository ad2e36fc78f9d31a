//! The smallest model that a scene needs: chosen from the cheapest up, each rejection with its number.
//!
//! 1. **Discretization**: every family of candidates from coarse to fine until one keeps its share of the tolerance (worst
//!    error of controllability and small-depth displacement against an extrapolated reference, plus what the reference
//!    leaves open) and the next finer model confirms it; of those the cheapest, by operations counted.
//! 2. **Law and plant**: the linear law, condensed, if its displacement over the whole insertion keeps its share; else a
//!    reduced model, if one can be trained to it; else the full one.
//! 3. **Table**: the fewest knots that interpolate the densest table within its share, and single precision if its
//!    rounding does.
//! 4. **End to end**: the plant against the full model two levels finer, along the insertion.
//!
//! No decision looks at a clock, so that the answer is the same on every run.

mod cost;
mod discretization;
mod plant;
mod rejection;
mod search;
mod table;
mod written;

pub use discretization::{ChosenDiscretization, discretization};
pub use plant::EndToEnd;
pub use rejection::{Alternative, Decision, Rejected, RejectionReason};

use super::candidates::{Assessment, assess};
use super::measurement::Linearity;
use crate::discretization::{Basis, Integration, Resolution};
use crate::model::TissueModel;
use crate::placement::reference::Reference;
use crate::scene::schema::{PlantModel, TableScalar};
use crate::scene::{Scene, TissueVariant};
use crate::table::TableBuildError;
use serde::Serialize;
use std::time::Instant;

/// Shares of the tolerance; they add up to the whole.
const DISCRETIZATION_SHARE: f64 = 0.5;
const PLANT_SHARE: f64 = 0.3;
const TABLE_SHARE: f64 = 0.2;
/// Part of the discretization's share that the reference may leave open.
const REFERENCE_SHARE: f64 = 0.2;
/// Runs of the chosen model, to report its time; the best counts.
const REPEATS: u32 = 5;
/// Largest model on which the finite-depth profiles of both laws are compared: the law's error hardly depends on nodes.
const LAW_NODES: usize = 1500;

/// What was chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chosen {
    /// Integration rule.
    pub integration: Integration,
    /// Basis of the shape functions (for elements: their order).
    pub basis: Basis,
    /// Kernel support over local spacing; none for elements.
    pub support: Option<f64>,
    /// Whether nodes are graded.
    pub graded: bool,
    /// Refinement level, where they are.
    pub level: Option<i32>,
    /// Node spacing, the finest where it varies, length units.
    pub spacing: f64,
    /// Number of nodes.
    pub nodes: usize,
    /// Which law.
    pub law: Linearity,
    /// What a simulator should solve.
    pub plant: PlantModel,
    /// The plant's part of the tolerance: what a reduced one is trained to.
    pub plant_tolerance: f64,
    /// Depth up to which that plant holds, length units.
    pub plant_depth: f64,
    /// Depth knots of the controller's table.
    pub table_knots: u32,
    /// Number type of the table.
    pub table_scalar: TableScalar,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// Scene name.
    pub scene: String,
    /// Tissue.
    pub tissue: TissueVariant,
    /// Relative error asked for.
    pub tolerance: f64,
    /// What was chosen.
    pub chosen: Chosen,
    /// What was not, and why.
    pub rejected: Vec<Rejected>,
    /// Worst error of controllability and small-depth displacement: distance from the reference, and what that leaves open.
    pub error_estimate: f64,
    /// Distance from the next finer model.
    pub verified_error: f64,
    /// The plant against a finer model.
    pub end_to_end: EndToEnd,
    /// Time of the chosen model for all Jacobians, one thread, s.
    pub wall_s: f64,
    /// Time of one step of the chosen plant, µs.
    pub step_us: f64,
    /// Time of the fit itself, s.
    pub fit_wall_s: f64,
}

/// Fits the smallest model to the tolerance.
///
/// # Errors
/// [`ModelError::ToleranceNotReached`](crate::ModelError::ToleranceNotReached) when no candidate keeps it, others when the
/// scene cannot be modelled at all or has no table.
pub fn fit(scene: &Scene, tolerance: f64, threads: usize) -> Result<Fit, TableBuildError> {
    let start = Instant::now();
    let share = DISCRETIZATION_SHARE * tolerance;
    let reference = Reference::compute(scene, REFERENCE_SHARE * share)?;
    let found = discretization(scene, share, &reference)?;
    let method = found.discretization.method;
    let wall_s = assess(found.discretization, scene, &reference, REPEATS)?.wall_s;
    let model = TissueModel::new(&scene.with_discretization(found.discretization))?;
    let plant_tolerance = PLANT_SHARE * tolerance;
    let (plant, plants_rejected) = plant::plant(&model, plant_tolerance, threads)?;
    let end_to_end = plant::end_to_end(scene, &found.discretization, &plant)?;
    let table = table::table(&model, TABLE_SHARE * tolerance)?;
    let Assessment { nodes, spacing, .. } = found.assessment;
    let chosen = Chosen {
        integration: method.integration,
        basis: method.displacement_basis(),
        support: (!method.integration.is_element()).then_some(method.support),
        graded: found.discretization.resolution.is_graded(),
        level: if let Resolution::Level(level) = found.discretization.resolution { Some(level) } else { None },
        spacing,
        nodes,
        law: plant.law,
        plant: plant.plant,
        plant_tolerance,
        plant_depth: plant.depth,
        table_knots: table.knots,
        table_scalar: table.scalar,
    };
    Ok(Fit {
        scene: scene.name.clone(),
        tissue: scene.tissue(),
        tolerance,
        chosen,
        rejected: [found.rejected, plants_rejected, table.rejected].concat(),
        error_estimate: found.error_estimate,
        verified_error: found.verified_error,
        end_to_end,
        wall_s,
        step_us: plant.step_us,
        fit_wall_s: start.elapsed().as_secs_f64(),
    })
}
