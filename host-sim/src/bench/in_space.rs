//! Strategies compared on a body in space: no paddle, the best fixture, and the paddles that control the target best.
//!
//! One process and simulated time: the firmware's own controller on the body's [table of states](model_offline::reduction::tabulated).

use std::hint::black_box;
use std::time::Instant;

use firmware::inputs::Ledger;
use firmware::{Faults, Mode};
use model_offline::output::table_text::hex;
use model_offline::placement::space::insertion::InsertionModel;
use model_offline::placement::space::study::{SpaceOptimum, place_in_space};
use model_offline::placement::space::workflow::insertion_model;
use model_offline::reduction::{Tabulated, TabulatedBody, TabulationOptions, TabulationReport};
use model_offline::scene::TissueVariant;
use model_offline::scene::space::SpaceScene;
use model_offline::table::TableOptions;
use model_offline::table::space::SpaceTable;
use nalgebra::Vector3;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::error::SimError;
use crate::runtime::executor::AnyTable;
use crate::runtime::names;
use crate::runtime::time::mode::RunMode;
use crate::world::error::WorldError;
use crate::world::simulation::Simulation;
use crate::world::space::{SpaceTissue, SpaceTruth, SpaceWorld};

/// Error of the tabulated tissue that is aimed at, over the target's largest orthogonal displacement.
const TOLERANCE: f64 = 0.01;
/// Points of a time series in the result.
const SERIES_POINTS: usize = 500;
/// States at which the tissue is held against the model that it was tabulated from, after a run.
const CHECKS: usize = 20;

/// A run on a body in space.
#[derive(Clone, Debug, Serialize)]
pub struct SpaceRun {
    /// Version of host-sim.
    pub version: String,
    /// Name of the scene.
    pub scene: String,
    /// 3.
    pub dimension: u32,
    /// Labels of length and stress.
    pub units: [String; 2],
    /// What drove time.
    pub mode: RunMode,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Rate of the loop, Hz.
    pub rate_hz: f64,
    /// Rate of the target's sensor, Hz.
    pub target_rate_hz: f64,
    /// Its latency, ms.
    pub target_latency_ms: f64,
    /// Standard deviation of its noise per component, length.
    pub noise: f64,
    /// Depth of the insertion, length.
    pub depth: f64,
    /// Duration of the insertion, s.
    pub insertion_s: f64,
    /// Nodes of the model of insertions.
    pub nodes: usize,
    /// The comparisons.
    pub cases: Vec<SpaceCase>,
    /// Duration of the whole, s.
    pub wall_s: f64,
}

/// Strategies on one tissue with one table.
#[derive(Clone, Debug, Serialize)]
pub struct SpaceCase {
    /// Tissue of the simulation.
    pub tissue: TissueVariant,
    /// Tissue that the planner and the table believed in.
    pub table_tissue: TissueVariant,
    /// The table.
    pub table: SpaceTableResult,
    /// No paddle.
    pub none: SpaceStrategyResult,
    /// The fixture that is best in the table's tissue.
    #[serde(rename = "static")]
    pub fixture: SpaceStrategyResult,
    /// The table's paddles, controlled.
    pub dynamic: SpaceStrategyResult,
    /// Largest error of `static` over that of `dynamic`.
    pub improvement: f64,
    /// Largest error without a paddle over that of `dynamic`.
    pub improvement_over_none: f64,
}

/// A table in short.
#[derive(Clone, Debug, Serialize)]
pub struct SpaceTableResult {
    /// SHA-256 of its bytes.
    pub hash: String,
    /// SHA-256 of the scene that it was made from.
    pub scene_hash: String,
    /// Its paddles.
    pub paddles: Vec<u32>,
    /// Its size, bytes.
    pub bytes: usize,
    /// Deepest knot, length.
    pub depth_end: f64,
}

/// One simulated insertion.
#[derive(Clone, Debug, Serialize)]
pub struct SpaceStrategyResult {
    /// The attached paddles.
    pub paddles: Vec<u32>,
    /// Largest true target displacement orthogonal to the needle, length.
    pub max_orthogonal_error: f64,
    /// Depth at which it occurs, length.
    pub max_error_depth: f64,
    /// Its root mean square, length.
    pub rms_orthogonal_error: f64,
    /// Length of the way of all paddles.
    pub paddle_travel: f64,
    /// State of the controller at the end; none without one.
    #[serde(with = "names::mode")]
    pub final_state: Option<Mode>,
    /// Part of the ticks from the needle's start on that ended in RUN; none without a controller.
    pub run_share: Option<f64>,
    /// Every fault that was ever present.
    #[serde(with = "names::faults")]
    pub faults: Faults,
    /// Accounts of samples and ticks; none without a controller.
    pub ledger: Option<Ledger>,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// SHA-256 of the table's bytes.
    pub table_hash: Option<String>,
    /// What answered for the tissue.
    pub plant: SpacePlantAccount,
    /// The way of target and paddles, thinned out.
    pub series: Vec<SpaceSeriesPoint>,
}

/// What answered for the tissue, and how well.
#[derive(Clone, Debug, Serialize)]
pub struct SpacePlantAccount {
    /// How it was tabulated.
    pub tabulation: TabulationReport,
    /// Mean time of a step of the table, µs, on the way of this run once more.
    pub step_us: f64,
    /// Steps that the full model answered.
    pub fallbacks: u64,
    /// Why, the first time.
    pub first_fallback: Option<String>,
    /// Largest error that the table estimated of itself, length.
    pub largest_estimate: f64,
    /// Largest distance from the full model at some states of the run, length; none where it could not go there.
    pub largest_error: Option<f64>,
}

/// A moment of an insertion.
#[derive(Clone, Debug, Serialize)]
pub struct SpaceSeriesPoint {
    /// Time since the start of the needle, s.
    pub time_s: f64,
    /// Needle depth, length.
    pub depth: f64,
    /// Length of the target's displacement orthogonal to the needle.
    pub orthogonal_error: f64,
    /// Its displacement along the needle, length.
    pub axial: f64,
    /// Displacement of every paddle, length.
    pub paddles: Vec<[f64; 3]>,
}

/// A tissue with what is best on it.
struct Tissue {
    model: InsertionModel,
    optimum: SpaceOptimum,
}

/// Compares strategies on a body in space: on both of its tissues, and on the one with inclusions by what homogeneous tissue
/// says; or on one tissue alone.
///
/// # Errors
/// [`SimError`].
pub fn compare(
    scene: &SpaceScene,
    tissue: Option<TissueVariant>,
    table_tissue: Option<TissueVariant>,
    simulation: &Simulation,
    threads: usize,
) -> Result<SpaceRun, SimError> {
    let start = Instant::now();
    if scene.inclusions.is_empty() && [tissue, table_tissue].contains(&Some(TissueVariant::Inclusion)) {
        return Err(SimError::NoInclusion { scene: scene.name.clone() });
    }
    let own = scene.tissue();
    let wanted: Vec<(TissueVariant, TissueVariant)> = match (tissue, table_tissue) {
        (Some(tissue), believed) => vec![(tissue, believed.unwrap_or(tissue))],
        (None, Some(believed)) => vec![(own, believed)],
        (None, None) if own == TissueVariant::Homogeneous => vec![(own, own)],
        (None, None) => vec![
            (TissueVariant::Homogeneous, TissueVariant::Homogeneous),
            (TissueVariant::Inclusion, TissueVariant::Inclusion),
            (TissueVariant::Inclusion, TissueVariant::Homogeneous),
        ],
    };
    let with = insertion_model(scene)?;
    let nodes = with.nodes();
    let study = |model: InsertionModel| -> Result<Tissue, SimError> {
        let placement = place_in_space(&model, threads, &|| ())?;
        Ok(Tissue { optimum: placement.optimum, model })
    };
    let homogeneous = study(with.without_inclusions()?)?;
    let inclusion = if scene.inclusions.is_empty() { None } else { Some(study(with)?) };
    let of = |variant| match (variant, &inclusion) {
        (TissueVariant::Inclusion, Some(tissue)) => tissue,
        _ => &homogeneous,
    };
    let mut cases = Vec::new();
    for (tissue, believed) in wanted {
        cases.push(case((tissue, of(tissue)), (believed, of(believed)), simulation, threads)?);
    }
    let settings = simulation.loop_settings;
    Ok(SpaceRun {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene.name.clone(),
        dimension: 3,
        units: [scene.length_unit.clone(), scene.stress_unit.clone()],
        mode: RunMode::Lockstep,
        seed: simulation.seed,
        rate_hz: settings.rate,
        target_rate_hz: settings.target_rate,
        target_latency_ms: settings.latency,
        noise: settings.noise_for(simulation.depth),
        depth: simulation.depth,
        insertion_s: simulation.needle.insertion_s(),
        nodes,
        cases,
        wall_s: start.elapsed().as_secs_f64(),
    })
}

fn case(
    (tissue, world): (TissueVariant, &Tissue),
    (table_tissue, believed): (TissueVariant, &Tissue),
    simulation: &Simulation,
    threads: usize,
) -> Result<SpaceCase, SimError> {
    let options = TableOptions { needle_speed: simulation.needle_speed(), ..TableOptions::default() };
    let table = SpaceTable::build(&believed.model, &believed.optimum.dynamic, &options)?;
    let bytes = table.to_bytes()?;
    let hash = hex(&Sha256::digest(&bytes));
    let run = Insertion { model: &world.model, simulation, threads };
    let none = run.of(&[], None)?;
    let fixture = run.of(&believed.optimum.fixture, None)?;
    let dynamic = run.of(&believed.optimum.dynamic, Some((&bytes, &hash)))?;
    Ok(SpaceCase {
        tissue,
        table_tissue,
        table: SpaceTableResult {
            hash,
            scene_hash: hex(&believed.model.scene().hash()),
            paddles: table.paddles(),
            bytes: bytes.len(),
            depth_end: table.validity().depth_end,
        },
        improvement: fixture.max_orthogonal_error / dynamic.max_orthogonal_error,
        improvement_over_none: none.max_orthogonal_error / dynamic.max_orthogonal_error,
        none,
        fixture,
        dynamic,
    })
}

/// An insertion that is to be simulated.
struct Insertion<'a> {
    model: &'a InsertionModel,
    simulation: &'a Simulation,
    threads: usize,
}

impl Insertion<'_> {
    /// With these paddles attached, steered by a controller with this table, or still.
    fn of(&self, paddles: &[u32], table: Option<(&[u8], &str)>) -> Result<SpaceStrategyResult, SimError> {
        let Self { model, simulation, threads } = self;
        let scene = model.scene();
        let places = paddles.iter().map(|&index| scene.paddle_position(index)).collect::<Result<Vec<_>, _>>();
        let attached = places.map_err(model_offline::model::ModelError::from)?;
        let options = TabulationOptions { tolerance: TOLERANCE, steered: table.is_some(), threads: *threads };
        let (states, tabulation) = Tabulated::learn(model, &attached, &options).map_err(WorldError::Tabulation)?;
        let tissue = SpaceTissue::new(model, &attached, &states);
        let mut world = SpaceWorld::new(tissue, &simulation.needle, paddles, simulation);
        let settings = simulation.loop_settings.settings(simulation.depth);
        let decoded = table.map(|(bytes, _)| AnyTable::decode(bytes)).transpose();
        let decoded = decoded.map_err(model_offline::table::TableBuildError::Invalid)?;
        let mut controller = decoded.as_ref().map(|table| table.on_this_machine(&settings)).transpose()?;
        if controller.is_none() {
            world.started.at(0);
        }
        let (mut truths, mut faults) = (Vec::new(), Faults::NONE);
        let (mut in_run, mut command) = (0_u64, None);
        for tick in 0..simulation.ticks() {
            let (truth, inputs) = world.tick(tick, command.as_ref(), settings.loop_period_ns)?;
            let since_start_s = world.started.since_s(truth.time_ns);
            if since_start_s >= simulation.duration_s {
                break;
            }
            command = controller.as_mut().map(|controller| controller.step(&inputs)).transpose()?;
            if since_start_s >= 0.0 {
                in_run += u64::from(command.as_ref().is_some_and(|command| command.state == Mode::Run as u32));
                truths.push((since_start_s, truth));
            }
            faults |= command.map_or(Faults::NONE, |command| Faults::from_bits(command.faults));
        }
        let ledger = controller.as_mut().map(|controller| controller.ledger()).transpose()?;
        let largest_error = held_against_full(&mut world.tissue, &truths);
        let plant = SpacePlantAccount {
            tabulation,
            step_us: step_us(states.body(), &truths),
            fallbacks: world.tissue.fallbacks,
            first_fallback: world.tissue.first_fallback.clone(),
            largest_estimate: world.tissue.largest_estimate,
            largest_error,
        };
        let mut result = self.measured(paddles, &truths, plant);
        result.run_share = controller.is_some().then(|| in_run as f64 / truths.len().max(1) as f64);
        result.final_state = command.and_then(|command| Mode::from_wire(command.state));
        (result.faults, result.ledger) = (faults, ledger);
        result.table_hash = table.map(|(_, hash)| hash.to_owned());
        Ok(result)
    }

    /// What the true motion of the target amounts to.
    fn measured(&self, paddles: &[u32], truths: &[(f64, SpaceTruth)], plant: SpacePlantAccount) -> SpaceStrategyResult {
        let needle = &self.model.scene().needle;
        let (orthogonal, axis) = (needle.orthogonal(), needle.axis);
        let error = |truth: &SpaceTruth| orthogonal.tr_mul(&truth.target).norm();
        let worst = truths.iter().map(|(_, truth)| truth).max_by(|a, b| error(a).total_cmp(&error(b)));
        let squares: f64 = truths.iter().map(|(_, truth)| error(truth).powi(2)).sum();
        let way = |pair: &[(f64, SpaceTruth)]| -> f64 {
            let steps = pair[0].1.paddles.iter().zip(&pair[1].1.paddles);
            steps.map(|(from, to)| (to - from).norm()).sum()
        };
        let stride = truths.len().div_ceil(SERIES_POINTS - 1).max(1);
        let last = truths.len().saturating_sub(1);
        let kept = truths.iter().enumerate().filter(|(i, _)| i % stride == 0 || *i == last);
        SpaceStrategyResult {
            paddles: paddles.to_vec(),
            max_orthogonal_error: worst.map_or(0.0, error),
            max_error_depth: worst.map_or(0.0, |truth| truth.depth),
            rms_orthogonal_error: (squares / truths.len().max(1) as f64).sqrt(),
            // The sum of nothing is −0.
            paddle_travel: truths.windows(2).map(way).sum::<f64>() + 0.0,
            final_state: None,
            run_share: None,
            faults: Faults::NONE,
            ledger: None,
            seed: self.simulation.seed,
            table_hash: None,
            plant,
            series: kept
                .map(|(_, (time_s, truth))| SpaceSeriesPoint {
                    time_s: *time_s,
                    depth: truth.depth,
                    orthogonal_error: error(truth),
                    axial: axis.dot(&truth.target),
                    paddles: truth.paddles.iter().map(|p: &Vector3<f64>| (*p).into()).collect(),
                })
                .collect(),
        }
    }
}

/// Mean time of a step, µs, on the way of a run.
fn step_us(mut body: TabulatedBody, truths: &[(f64, SpaceTruth)]) -> f64 {
    let start = Instant::now();
    for (_, truth) in truths {
        // Where the table does not reach, finding that out is what a step takes.
        let _ = black_box(body.drive(truth.depth, &truth.paddles));
    }
    start.elapsed().as_secs_f64() * 1e6 / truths.len().max(1) as f64
}

/// The largest distance of the tissue from its full model at some states of a run, in their order.
fn held_against_full(tissue: &mut SpaceTissue<'_>, truths: &[(f64, SpaceTruth)]) -> Option<f64> {
    let every = truths.len().div_ceil(CHECKS).max(1);
    let mut largest = 0.0_f64;
    for (_, truth) in truths.iter().step_by(every).chain(truths.last()) {
        largest = largest.max(tissue.held_against_full(truth).ok()?);
    }
    Some(largest)
}
