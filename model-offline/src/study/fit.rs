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

use super::candidates::{Measured, families, measure, solved};
use super::cost::cost;
use super::extent::Extent;
use super::insertion::{TICK_SETTINGS, linear_profile, profile, profile_distance, time_ticks, with_mesh_limit};
use super::measurement::Linearity;
use super::search::{Trials, Verdict, cheapest};
use crate::discretization::{Basis, Discretization, Integration, Resolution};
use crate::model::{ModelError, TissueModel, graded_model};
use crate::placement::adaptive::{Reference, distance};
use crate::placement::rest::rest_responses;
use crate::placement::study::best_dynamic;
use crate::reduction::{Condensed, Invalid, TrainingOptions, train};
use crate::scene::Scene;
use crate::scene::schema::{FitSection, PlantModel, TableScalar};
use crate::solver::equilibrium::{Failure, NewtonSettings};
use crate::table::{TableBuildError, TableOptions, build as build_table};
use firmware::contract::Table;
use nalgebra::Vector2;
use serde::Serialize;
use std::convert::Infallible;
use std::time::Instant;

/// Shares of the tolerance; they add up to the whole.
const DISCRETIZATION_SHARE: f64 = 0.5;
const PLANT_SHARE: f64 = 0.3;
const TABLE_SHARE: f64 = 0.2;
/// Part of the discretization's share that the reference may leave open.
const REFERENCE_SHARE: f64 = 0.2;
/// Runs of the chosen model, to report its time; the best counts.
const REPEATS: u32 = 5;
/// Depths at which the plant is held against a finer model.
const STATIONS: u32 = 10;
/// Knots of the table that the others are held against, and the numbers tried.
const DENSE_KNOTS: usize = 65;
const KNOTS: [usize; 6] = [2, 3, 5, 9, 17, 33];
/// Ticks over which a plant's step is timed.
const TICKS: u32 = 500;

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
    /// Depth up to which that plant holds, length units.
    pub plant_depth: f64,
    /// Depth knots of the controller's table.
    pub table_knots: u32,
    /// Number type of the table.
    pub table_scalar: TableScalar,
}

/// What a fit decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decision {
    /// How the tissue is discretized.
    Discretization,
    /// Whether the linear law will do.
    Law,
    /// What a simulator solves.
    Plant,
    /// Knots and number type of the table.
    Table,
}

/// Something cheaper that is not good enough, or something good enough that is dearer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rejected {
    /// What it is.
    pub candidate: String,
    /// What it decides.
    pub decision: Decision,
    /// The number that rejected it.
    pub number: f64,
    /// What the number is, or why there is none.
    pub reason: String,
}

/// The chosen plant's target displacement along the insertion, the best paddle held still, against the full nonlinear model
/// two levels finer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndToEnd {
    /// Worst error over the largest displacement; none where the finer model cannot be had or goes nowhere.
    pub error: Option<f64>,
    /// Depth up to which both went, length units.
    pub depth: f64,
    /// Nodes of the finer model.
    pub nodes: usize,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// Scene name.
    pub scene: String,
    /// Tissue.
    pub tissue: &'static str,
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
/// [`ModelError::ToleranceNotReached`] when no candidate keeps it, others when the scene cannot be modelled at all.
pub fn fit(scene: &Scene, tolerance: f64, threads: usize) -> Result<Fit, ModelError> {
    let start = Instant::now();
    let mut rejected = Vec::new();
    let share = DISCRETIZATION_SHARE * tolerance;
    let reference = Reference::compute(scene, REFERENCE_SHARE * share)?;
    let (candidate, outcome, verified_error) = discretization(scene, share, &reference, &mut rejected)?;
    let outcome = Measured { wall_s: measure(candidate, scene, &reference, REPEATS)?.wall_s, ..outcome };
    let error_estimate = worst(&outcome, &reference);
    let model = build(scene, &candidate)?;
    let found = plant(&model, PLANT_SHARE * tolerance, threads, &mut rejected)?;
    let end_to_end = end_to_end(scene, &candidate, &found)?;
    let PlantChoice { law, plant, depth: plant_depth, step_us, .. } = found;
    let (table_knots, table_scalar) = table(&model, TABLE_SHARE * tolerance, &mut rejected)?;
    let chosen = Chosen {
        integration: candidate.method.integration,
        basis: candidate.method.displacement_basis(),
        support: (!candidate.method.integration.is_element()).then_some(candidate.method.support),
        graded: candidate.resolution.is_graded(),
        level: if let Resolution::Level(level) = candidate.resolution { Some(level) } else { None },
        spacing: outcome.spacing,
        nodes: outcome.nodes,
        law,
        plant,
        plant_depth,
        table_knots,
        table_scalar,
    };
    Ok(Fit {
        scene: scene.name.clone(),
        tissue: scene.tissue(),
        tolerance,
        chosen,
        rejected,
        error_estimate,
        verified_error,
        end_to_end,
        wall_s: outcome.wall_s,
        step_us,
        fit_wall_s: start.elapsed().as_secs_f64(),
    })
}

fn worst(outcome: &Measured, reference: &Reference) -> f64 {
    outcome.errors.0.max(outcome.errors.1) + reference.open
}

/// The cheapest candidate within the tolerance that the next finer one confirms, with what was found out about it and how
/// far the finer one is away; fills `rejected`.
///
/// # Errors
/// [`ModelError::ToleranceNotReached`] when no candidate keeps it.
pub fn discretization(
    scene: &Scene,
    tolerance: f64,
    reference: &Reference,
    rejected: &mut Vec<Rejected>,
) -> Result<(Discretization, Measured, f64), ModelError> {
    // Elements first: they are cheapest, so that dearer families are given up early.
    let mut families = families(scene, Extent::Full);
    families.sort_by_key(|family| !family.first().is_some_and(|d| d.method.integration.is_element()));
    let mut trials = Candidates { scene, reference, built: None };
    let (best, verdicts) = cheapest(&families, tolerance, &mut trials);
    let chosen_cost = best.as_ref().map_or(f64::NAN, |b| b.cost);
    let mut best_error = f64::INFINITY;
    for (candidate, verdict) in verdicts {
        let (number, reason) = match verdict {
            Verdict::TooWrong(error) => (error, "estimated error".to_owned()),
            Verdict::Unconfirmed(apart) => (apart, "distance from the next finer model".to_owned()),
            Verdict::Dearer(cost) => (cost / chosen_cost, "times the cost of the chosen one".to_owned()),
            Verdict::Unusable(ref why) => (f64::NAN, format!("does not work: {why}")),
        };
        if let Verdict::TooWrong(error) | Verdict::Unconfirmed(error) = verdict {
            best_error = best_error.min(error);
        }
        rejected.push(rejection(Decision::Discretization, candidate.to_string(), number, reason));
    }
    let best = best.ok_or(ModelError::ToleranceNotReached { tolerance, reached: best_error })?;
    Ok((best.candidate, best.outcome, best.apart))
}

/// The candidates of a scene, asked one after the other.
struct Candidates<'a> {
    scene: &'a Scene,
    reference: &'a Reference,
    /// The model whose cost was asked for last.
    built: Option<TissueModel>,
}

impl Trials<Discretization> for Candidates<'_> {
    type Outcome = Measured;

    fn cost(&mut self, candidate: &Discretization) -> Result<f64, String> {
        let model = build(self.scene, candidate).map_err(|error| error.to_string())?;
        Ok(cost(self.built.insert(model)))
    }

    fn solve(&mut self, candidate: &Discretization) -> Result<(f64, Measured), String> {
        let outcome = match &self.built {
            Some(model) => solved(model, self.reference),
            None => measure(*candidate, self.scene, self.reference, 1),
        };
        let outcome = outcome.map_err(|error| error.to_string())?;
        Ok((worst(&outcome, self.reference), outcome))
    }

    fn confirm(&mut self, candidate: &Discretization, outcome: &Measured) -> Result<f64, String> {
        let finer = Discretization { resolution: candidate.resolution.finer(), ..*candidate };
        let finer = build(self.scene, &finer).and_then(|model| rest_responses(&model));
        let finer = finer.map_err(|error| format!("the next finer model: {error}"))?;
        let (measure, displacement) = distance(&outcome.responses, &finer);
        Ok(measure.max(displacement))
    }
}

fn build(scene: &Scene, discretization: &Discretization) -> Result<TissueModel, ModelError> {
    TissueModel::new(&scene.with_discretization(*discretization))
}

fn rejection(decision: Decision, candidate: String, number: f64, reason: String) -> Rejected {
    Rejected { candidate, decision, number, reason }
}

/// Largest model on which the finite-depth profiles of both laws are compared: the law's error hardly depends on nodes.
const LAW_NODES: usize = 1500;

/// What a simulator should solve.
struct PlantChoice {
    law: Linearity,
    plant: PlantModel,
    /// Depth up to which it holds, length units.
    depth: f64,
    /// Time of a step, µs.
    step_us: f64,
    /// Paddle that the insertion is followed with, by its place.
    paddle: Option<usize>,
    /// Depths and target displacements along the insertion, that paddle held still.
    path: Vec<(f64, Vector2<f64>)>,
}

/// Stations along an insertion to `depth`, as far as there is an answer.
fn path<E>(depth: f64, mut at: impl FnMut(f64) -> Result<Vector2<f64>, E>) -> Vec<(f64, Vector2<f64>)> {
    let stations = (1..=STATIONS).map(|k| depth * f64::from(k) / f64::from(STATIONS));
    stations.map_while(|depth| Some((depth, at(depth).ok()?))).collect()
}

/// The plant's path against that of the full model two levels finer.
fn end_to_end(scene: &Scene, chosen: &Discretization, plant: &PlantChoice) -> Result<EndToEnd, ModelError> {
    let none = EndToEnd { error: None, depth: 0.0, nodes: 0 };
    let finer = Discretization { resolution: chosen.resolution.finer().finer(), ..*chosen };
    let Ok(model) = build(scene, &finer) else {
        return Ok(none);
    };
    let mut body = model.body(plant.paddle, NewtonSettings::default())?;
    let depth = plant.path.last().map_or(0.0, |station| station.0);
    let truth = path(depth, |depth| body.drive(depth, Vector2::zeros()).map(|()| body.target_displacement()));
    let largest = truth.iter().map(|station| station.1.norm()).fold(0.0, f64::max);
    let apart = plant.path.iter().zip(&truth).map(|(a, b)| (a.1 - b.1).norm()).fold(0.0, f64::max);
    let nodes = model.nodes();
    Ok(match truth.last() {
        Some(last) if largest > 0.0 => EndToEnd { error: Some(apart / largest), depth: last.0, nodes },
        _ => EndToEnd { nodes, ..none },
    })
}

/// The cheapest plant that keeps the tolerance on the model's scene; fills `rejected`.
fn plant(
    model: &TissueModel,
    tolerance: f64,
    threads: usize,
    rejected: &mut Vec<Rejected>,
) -> Result<PlantChoice, ModelError> {
    let scene = model.scene();
    let law_error = linear_law_error(model)?;
    let paddle = model.paddle_position(best_dynamic(model)?);
    if law_error <= tolerance {
        let condensed = Condensed::new(model, paddle)?;
        let depth = scene.needle.depth;
        let step_us = step_us(scene, depth, |depth| -> Result<_, Infallible> {
            Ok(condensed.target_displacement(std::hint::black_box(depth), Vector2::zeros()))
        });
        let path = path(depth, |depth| -> Result<_, Infallible> {
            Ok(condensed.target_displacement(depth, Vector2::zeros()))
        });
        let (law, plant) = (Linearity::Linear, PlantModel::Condensed);
        return Ok(PlantChoice { law, plant, depth, step_us, paddle, path });
    }
    let reason = "error of the target displacement along the insertion by the linear law".to_owned();
    rejected.push(rejection(Decision::Law, "linear law, condensed plant".into(), law_error, reason));
    let options = TrainingOptions { tolerance, threads, ..TrainingOptions::default() };
    match train(model, paddle, &options) {
        Ok((reduced, report)) => {
            let mut body = reduced.body();
            let depth = report.domain.depth;
            let path = path(depth, |depth| body.drive(depth, Vector2::zeros()).map(|()| body.target_displacement()));
            let mut body = reduced.body();
            let step_us = step_us(scene, depth, |depth| -> Result<_, Invalid> {
                body.drive(depth, Vector2::zeros())?;
                Ok(body.target_displacement())
            });
            let (law, plant) = (Linearity::Nonlinear, PlantModel::Reduced);
            Ok(PlantChoice { law, plant, depth, step_us, paddle, path })
        }
        Err(error) => {
            rejected.push(rejection(Decision::Plant, "reduced plant".into(), f64::NAN, error.to_string()));
            let mut body = model.body(paddle, TICK_SETTINGS)?;
            // As far as the tissue goes.
            let _ = body.drive(scene.needle.depth, Vector2::zeros());
            let depth = body.depth();
            let mut body = model.body(paddle, NewtonSettings::default())?;
            let path = path(depth, |depth| body.drive(depth, Vector2::zeros()).map(|()| body.target_displacement()));
            let mut body = model.body(paddle, TICK_SETTINGS)?;
            let step_us = step_us(scene, depth, |depth| -> Result<_, Failure> {
                body.drive(depth, Vector2::zeros())?;
                Ok(body.target_displacement())
            });
            let (law, plant) = (Linearity::Nonlinear, PlantModel::Full);
            Ok(PlantChoice { law, plant, depth, step_us, paddle, path })
        }
    }
}

/// Error of the target displacement over the whole insertion by the law's small-strain limit.
fn linear_law_error(model: &TissueModel) -> Result<f64, ModelError> {
    let (limited, _) = with_mesh_limit(model.scene())?;
    let compared = if model.nodes() <= LAW_NODES {
        TissueModel::new(&limited)?
    } else {
        graded_model(&limited, limited.discretization.method, -2)?
    };
    let nonlinear = profile(&compared)?;
    Ok(profile_distance(&linear_profile(&compared)?, &nonlinear))
}

/// Time of a step over the insertion to `depth`, µs; NaN where it fails.
fn step_us<E>(scene: &Scene, depth: f64, step: impl FnMut(f64) -> Result<Vector2<f64>, E>) -> f64 {
    let mut shallow = scene.clone();
    shallow.needle.depth = depth;
    time_ticks(&shallow, TICKS, step).map_or(f64::NAN, |(seconds, _)| 1e6 * seconds)
}

/// The fewest knots, and the number type.
fn table(model: &TissueModel, tolerance: f64, rejected: &mut Vec<Rejected>) -> Result<(u32, TableScalar), ModelError> {
    // Interpolation errors come from the law, not from the nodes.
    let small = if model.nodes() <= LAW_NODES {
        model.clone()
    } else {
        graded_model(model.scene(), model.planar().method(), -2)?
    };
    let paddle = best_dynamic(&small)?;
    let table = |knots: usize, depth: Option<f64>| {
        let mut model = small.clone();
        if let Some(depth) = depth {
            let mut scene = small.scene().clone();
            scene.needle.depth = depth;
            model = model.with_tissue_of(&scene);
        }
        build_table(&model, paddle, &TableOptions { knots, ..TableOptions::default() }).map_err(table_error)
    };
    let dense = table(DENSE_KNOTS, None)?;
    let depth = dense.validity.depth_end;
    let mut knots = DENSE_KNOTS;
    for count in KNOTS {
        let error = table_distance(&table(count, Some(depth))?, &dense);
        if error <= tolerance {
            knots = count;
            break;
        }
        let reason = "error of Jacobian or paddle path between its knots".to_owned();
        rejected.push(rejection(Decision::Table, format!("{count} knots"), error, reason));
    }
    let rounding = table_distance(&dense.cast::<f32>().cast::<f64>(), &dense);
    // Rounding must disappear in the tolerance, not use it up.
    if rounding <= 0.01 * tolerance {
        return Ok((knots as u32, TableScalar::F32));
    }
    rejected.push(rejection(Decision::Table, "f32".into(), rounding, "relative error of rounding".into()));
    Ok((knots as u32, TableScalar::F64))
}

fn table_error(error: TableBuildError) -> ModelError {
    match error {
        TableBuildError::Model(error) => error,
        other => ModelError::Unsupported(other.to_string()),
    }
}

/// Worst relative difference of Jacobian, and of the paddle's path over its largest value.
fn table_distance(a: &Table<f64, 2>, b: &Table<f64, 2>) -> f64 {
    let end = b.validity.depth_end;
    let farthest = b.knots.iter().map(|k| k.paddle_path.norm()).fold(f64::MIN_POSITIVE, f64::max);
    (0..=200)
        .filter_map(|k| {
            let depth = end * f64::from(k) / 200.0;
            let (a, b) = (a.locate(depth)?, b.locate(depth)?);
            let jacobian = (a.jacobian() - b.jacobian()).norm() / b.jacobian().norm();
            Some(jacobian.max((a.paddle_path() - b.paddle_path()).norm() / farthest))
        })
        .fold(0.0, f64::max)
}

impl Fit {
    /// The text of the scene with the choice written into it; everything else, comments included, stays.
    ///
    /// # Errors
    /// What the text does not parse as; a scene that was read before always does.
    pub fn written_into(&self, text: &str) -> Result<String, toml_edit::TomlError> {
        let mut document: toml_edit::DocumentMut = text.parse()?;
        let section = &mut document["discretization"];
        if let Some(table) = section.as_table_like_mut() {
            for key in ["spacing", "tolerance", "level", "support", "basis"] {
                table.remove(key);
            }
        }
        match self.chosen.level {
            Some(level) => section["level"] = toml_edit::value(i64::from(level)),
            None => section["spacing"] = toml_edit::value(self.chosen.spacing),
        }
        section["integration"] = toml_edit::value(self.chosen.integration.name());
        if let Some(support) = self.chosen.support {
            section["support"] = toml_edit::value(support);
            section["basis"] = toml_edit::value(self.chosen.basis.name());
        }
        let FitSection { plant, table_knots, table_scalar } = self.section();
        let mut fit = toml_edit::Table::new();
        fit["plant"] = toml_edit::value(plant.to_string());
        fit["table_knots"] = toml_edit::value(i64::from(table_knots));
        fit["table_scalar"] = toml_edit::value(table_scalar.to_string());
        document["fit"] = toml_edit::Item::Table(fit);
        Ok(document.to_string())
    }

    /// The part of the choice that the scene's `[fit]` carries.
    pub fn section(&self) -> FitSection {
        FitSection {
            plant: self.chosen.plant,
            table_knots: self.chosen.table_knots,
            table_scalar: self.chosen.table_scalar,
        }
    }

    /// The answer on one screen.
    pub fn summary(&self) -> String {
        use std::fmt::Write as _;
        let c = &self.chosen;
        let nodes = match c.level {
            Some(level) => format!("graded nodes, level {level}"),
            None => format!("nodes {:.4} apart", c.spacing),
        };
        let support = c.support.map_or(String::new(), |s| format!(", {} basis, support {s}", c.basis));
        let mut out = format!(
            "{} · {} tissue · tolerance {}\n\nchosen: {}{support}, {nodes} ({}); {} law; {} plant to depth {:.4}; {} table knots, {}\n\
             estimated error {:.3} %, distance from the next finer model {:.3} %\n\
             all Jacobians in {:.2} ms, one step of the plant in {:.2} µs (fitted in {:.1} s)\n",
            self.scene,
            self.tissue,
            self.tolerance,
            c.integration,
            c.nodes,
            c.law,
            c.plant,
            c.plant_depth,
            c.table_knots,
            c.table_scalar,
            100.0 * self.error_estimate,
            100.0 * self.verified_error,
            1e3 * self.wall_s,
            self.step_us,
            self.fit_wall_s,
        );
        let _ = match self.end_to_end {
            EndToEnd { error: Some(error), depth, nodes } => {
                let beyond = if error > self.tolerance { ": ABOVE the tolerance" } else { "" };
                writeln!(
                    out,
                    "end to end, against the full model on {nodes} nodes, to depth {depth:.4}: {:.3} %{beyond}\n",
                    100.0 * error
                )
            }
            EndToEnd { error: None, nodes, .. } => {
                writeln!(out, "end to end: nothing to compare with ({nodes} nodes go nowhere)\n")
            }
        };
        out.push_str("rejected:\n");
        for r in &self.rejected {
            let number = if !r.number.is_finite() {
                "–".to_owned()
            } else if r.reason.starts_with("times") {
                format!("{:.1}", r.number)
            } else {
                format!("{:.3} %", 100.0 * r.number)
            };
            let _ = writeln!(out, "  {:<56} {number:>10}  {}", r.candidate, r.reason);
        }
        out
    }
}
