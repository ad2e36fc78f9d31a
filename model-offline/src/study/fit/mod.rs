//! The smallest model that a scene needs: chosen from the cheapest up, each rejection with its number.
//!
//! 0. **World**, of a scene that has a past: the fewest of its own effects (a needle that slips, tissue that creeps, a patient
//!    that moves) that leave target and controllability within their share of the model with all of them. Where none is
//!    needed, the rest is fitted to the scene without them; where some are, as said below.
//! 1. **Discretization**: every family of candidates from coarse to fine until one keeps its share of the tolerance (worst
//!    error of controllability and small-depth displacement against an extrapolated reference, plus what the reference
//!    leaves open) and the next finer model confirms it; of those the cheapest, by operations counted.
//! 2. **Law and plant**: the linear law, condensed, if its displacement over the whole insertion keeps its share; else a
//!    reduced model, if one can be trained to it; else the full one.
//! 3. **Table**: the fewest knots that interpolate the densest table within its share, and single precision if its
//!    rounding does.
//! 4. **End to end**: the plant against the full model two levels finer, along the insertion.
//!
//! With effects that are needed the discretization is that of the scene without them; the law is linear if that changes
//! less than the plant's share with these effects; the plant is the neighbourhood of an insertion
//! ([`AlongPath`](crate::reduction::along_path::AlongPath)), which a simulation learns itself and which is neither learnt nor
//! timed here; the table is fitted where breathing alone is needed, of which it knows nothing, and not where it would follow
//! the insertion in time; end to end is the full model with these effects on the chosen nodes, or on coarser ones that can be followed, against the one with all of
//! them one level finer.
//!
//! No decision looks at a clock, so that the answer is the same on every run.

mod change;
mod cost;
mod discretization;
mod error;
mod plant;
mod rejection;
mod search;
pub mod space;
mod table;
mod world;
mod written;

pub use change::Change;
pub use discretization::{ChosenDiscretization, discretization};
pub use error::FitError;
pub use plant::EndToEnd;
pub use rejection::{Alternative, Decision, Rejected, RejectionReason};
pub use world::{JudgedWorld, World, WorldEndToEnd, judge_world};

use self::table::FittedTable;
use super::candidates::{Assessment, assess};
use super::measurement::Linearity;
use crate::discretization::{Basis, Discretization, Integration, Resolution};
use crate::model::TissueModel;
use crate::placement::reference::Reference;
use crate::scene::schema::{PlantModel, TableScalar};
use crate::scene::{Scene, TissueVariant};
use serde::Serialize;
use std::time::Instant;

/// Shares of a tolerance; they add up to the whole.
struct Shares {
    effects: f64,
    discretization: f64,
    plant: f64,
    table: f64,
}

/// Where there is no effect to leave out, and where there is.
const SHARES: Shares = Shares { effects: 0.0, discretization: 0.5, plant: 0.3, table: 0.2 };
const WORLD_SHARES: Shares = Shares { effects: 0.15, discretization: 0.5, plant: 0.15, table: 0.2 };
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
    /// Which of its own effects it needs; none where it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub world: Option<World>,
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
    /// Time of one step of the chosen plant, µs; not a number (null in JSON) where a simulation is to learn it first.
    pub step_us: f64,
    /// Time of the fit itself, s.
    pub fit_wall_s: f64,
}

/// Fits the smallest model to the tolerance.
///
/// # Errors
/// [`ModelError::ToleranceNotReached`](crate::ModelError::ToleranceNotReached) when no candidate keeps it, others when the
/// scene cannot be modelled at all, has no table, or has effects with which it cannot be followed.
pub fn fit(scene: &Scene, tolerance: f64, threads: usize) -> Result<Fit, FitError> {
    fit_told(scene, tolerance, threads, &|_| {})
}

/// The same, telling what it does before it does it: each may take from a moment to minutes.
///
/// # Errors
/// As [`fit`].
pub fn fit_told(scene: &Scene, tolerance: f64, threads: usize, told: &dyn Fn(&str)) -> Result<Fit, FitError> {
    let start = Instant::now();
    let has_a_past = scene.has_a_past();
    let shares = if has_a_past { WORLD_SHARES } else { SHARES };
    if has_a_past {
        told("following the insertion with each of the scene's effects left out");
    }
    let judged = if has_a_past { Some(judge_world(scene, shares.effects * tolerance, threads)?) } else { None };
    let effects_rejected = judged.as_ref().map_or_else(Vec::new, |judged| judged.rejected.clone());
    let simple = if has_a_past { scene.without_a_past() } else { scene.clone() };
    let share = shares.discretization * tolerance;
    told("finding what the numbers are on ever finer nodes");
    let reference = Reference::compute(&simple, REFERENCE_SHARE * share)?;
    told("trying methods and nodes");
    let found = discretization(&simple, share, &reference)?;
    let wall_s = assess(found.discretization, &simple, &reference, REPEATS)?.wall_s;
    let plant_tolerance = shares.plant * tolerance;
    let parts = Parts { scene: &simple, chosen: &found.discretization, plant_tolerance, threads, told };
    let table_tolerance = shares.table * tolerance;
    let rest = match &judged {
        Some(judged) if !judged.needed.is_empty() => parts.of_a_world(judged, table_tolerance)?,
        judged => parts.without_a_past(judged.as_ref(), table_tolerance)?,
    };
    Ok(Fit {
        scene: scene.name.clone(),
        tissue: scene.tissue(),
        tolerance,
        chosen: chosen(&found, &rest, plant_tolerance),
        world: rest.world,
        rejected: [effects_rejected, found.rejected, rest.plants_rejected, rest.table.rejected].concat(),
        error_estimate: found.error_estimate,
        verified_error: found.verified_error,
        end_to_end: rest.end_to_end,
        wall_s,
        step_us: rest.step_us,
        fit_wall_s: start.elapsed().as_secs_f64(),
    })
}

fn chosen(found: &ChosenDiscretization, rest: &Rest, plant_tolerance: f64) -> Chosen {
    let method = found.discretization.method;
    let Assessment { nodes, spacing, .. } = found.assessment;
    Chosen {
        integration: method.integration,
        basis: method.displacement_basis(),
        support: (!method.integration.is_element()).then_some(method.support),
        graded: found.discretization.resolution.is_graded(),
        level: if let Resolution::Level(level) = found.discretization.resolution { Some(level) } else { None },
        spacing,
        nodes,
        law: rest.law,
        plant: rest.plant,
        plant_tolerance,
        plant_depth: rest.depth,
        table_knots: rest.table.knots,
        table_scalar: rest.table.scalar,
    }
}

/// What is fitted once the discretization is.
struct Parts<'a> {
    /// The scene without a past.
    scene: &'a Scene,
    chosen: &'a Discretization,
    plant_tolerance: f64,
    threads: usize,
    told: &'a dyn Fn(&str),
}

/// What is chosen besides effects and discretization.
struct Rest {
    law: Linearity,
    plant: PlantModel,
    /// Length units.
    depth: f64,
    /// µs.
    step_us: f64,
    plants_rejected: Vec<Rejected>,
    table: FittedTable,
    end_to_end: EndToEnd,
    world: Option<World>,
}

impl Parts<'_> {
    fn model(&self) -> Result<TissueModel, FitError> {
        Ok(TissueModel::new(&self.scene.with_discretization(*self.chosen))?)
    }

    /// A contact that moves with the needle in elastic tissue at rest.
    fn without_a_past(&self, judged: Option<&JudgedWorld>, table_tolerance: f64) -> Result<Rest, FitError> {
        let model = self.model()?;
        (self.told)(&format!("training reduced plants on {} nodes, and trying them", model.nodes()));
        let (plant, plants_rejected) = plant::plant(&model, self.plant_tolerance, self.threads)?;
        (self.told)("following the insertion on finer nodes, and trying knots of the table");
        Ok(Rest {
            law: plant.law,
            plant: plant.plant,
            depth: plant.depth,
            step_us: plant.step_us,
            plants_rejected,
            end_to_end: plant::end_to_end(self.scene, self.chosen, &plant)?,
            table: table::table(&model, table_tolerance)?,
            world: judged.map(|judged| judged.against_finer(self.chosen, plant.law, self.threads)),
        })
    }

    /// The neighbourhood of an insertion.
    fn of_a_world(&self, judged: &JudgedWorld, table_tolerance: f64) -> Result<Rest, FitError> {
        let (law, plants_rejected) = judged.law(self.plant_tolerance);
        (self.told)("following the insertion on finer nodes, and trying knots of the table");
        let world = judged.against_finer(self.chosen, law, self.threads);
        let table = match judged.needs_a_table_along_the_insertion() {
            false => table::table(&self.model()?, table_tolerance)?,
            true => table::usual(self.scene),
        };
        let depth = self.scene.needle.depth;
        let on_chosen_nodes = world.end_to_end.change.filter(|_| !world.end_to_end.is_coarser);
        let apart = on_chosen_nodes.map(|change| change.target);
        let reached = if apart.is_some() { depth } else { 0.0 };
        Ok(Rest {
            law,
            plant: PlantModel::Reduced,
            depth,
            step_us: f64::NAN,
            plants_rejected,
            table,
            end_to_end: EndToEnd { error: apart, depth: reached, nodes: world.end_to_end.nodes[1] },
            world: Some(world),
        })
    }
}
