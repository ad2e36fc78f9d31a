//! An insertion into a body in space, and what is told of it.

use std::hint::black_box;
use std::time::Instant;

use firmware::Faults;
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::output::table_text::hex;
use model_offline::reduction::TabulatedBody;
use model_offline::table::TableBuildError;
use sha2::{Digest, Sha256};

use super::{SpacePlantAccount, SpaceSeriesPoint, SpaceStrategyResult};
use crate::bench::error::SimError;
use crate::bench::insertion::linked::{LinkedController, LinkedInsertion, RunShare};
use crate::bench::insertion::{Extras, Label};
use crate::bench::result::RecordingResult;
use crate::record::export::foxglove::{Scenery as _, SpaceStage};
use crate::record::export::{csv, mcap, paraview};
use crate::record::files::Artifact;
use crate::record::recording::{Record, Recording};
use crate::runtime::executor::AnyTable;
use crate::runtime::plant::PlantLoop;
use crate::runtime::plant::observer::{ObservedInsertion, Spectator};
use crate::runtime::plant::rehearsal::space_in_time;
use crate::runtime::signals;
use crate::runtime::time::mode::RunMode;
use crate::world::retrace::solved_bodies;
use crate::world::simulation::Simulation;
use crate::world::space::{PreparedBody, SpaceTissue};
use crate::world::truth::{Truth, from_frame};

/// Points of a time series in the result.
const SERIES_POINTS: usize = 500;
/// States at which the tissue is held against the model that it was tabulated from, after a run.
const CHECKS: usize = 20;

/// An insertion that is to be simulated.
pub(super) struct Insertion<'a, 'm> {
    pub(super) body: &'a PreparedBody<'m>,
    pub(super) simulation: &'a Simulation,
    pub(super) label: Label,
    pub(super) extras: Extras,
    pub(super) spectator: Option<&'a dyn Spectator>,
    /// Whether it is told how well the tissue was answered for, which takes further solves.
    pub(super) is_held_against_full: bool,
}

impl Insertion<'_, '_> {
    /// Without a controller: paddles stay where they rest.
    pub(super) fn uncontrolled(&self, artifacts: &mut Vec<Artifact>) -> Result<SpaceStrategyResult, SimError> {
        let mut plant = PlantLoop::new(self.body.world(self.simulation), self.simulation);
        plant.uncontrolled(self.simulation.loop_settings.period_ns(), &|| ())?;
        let result = self.measured(&mut plant, RunMode::Lockstep, &[], artifacts);
        artifacts.extend(self.extras(plant.truths(), None)?);
        Ok(result)
    }

    /// Steered by a controller in a process of its own.
    pub(super) fn controlled(
        &self,
        controller: LinkedController<'_>,
        artifacts: &mut Vec<Artifact>,
    ) -> Result<SpaceStrategyResult, SimError> {
        let Self { body, simulation, label, .. } = *self;
        let world = match controller.mode {
            RunMode::Lockstep => body.world(simulation),
            RunMode::FreeRun => signals::ends_at_once(|| space_in_time(body, simulation))?,
        };
        let linked = LinkedInsertion { controller, simulation, progress: &|| () };
        let mut run = linked.run(PlantLoop::new(world, simulation), |plant| {
            if let Some(spectator) = self.spectator {
                let (mode, period_ns) = (controller.mode, simulation.loop_settings.period_ns());
                let insertion = ObservedInsertion { body, mode, period_ns, title: label.title() };
                plant.observed_by(spectator.observe_in_space(insertion));
            }
        })?;
        let table = AnyTable::decode(controller.table_bytes).map_err(TableBuildError::Invalid)?;
        let recording = run.recording(&controller, simulation, body.model().scene().hash(), table.depth_end());
        let started_ns = run.plant.world().needle_started_ns().unwrap_or(0);
        let RunShare { share, outside } = run.run_share(started_ns);
        let measured = || self.measured(&mut run.plant, controller.mode, &recording.records, artifacts);
        let mut result = signals::ends_at_once(measured);
        let file = Artifact { name: label.file("rec"), bytes: recording.encode() };
        result.recording = Some(RecordingResult::of(&file, recording.records.len() as u64));
        artifacts.push(file);
        artifacts.extend(signals::ends_at_once(|| self.extras(&recording.truths(), Some(&recording)))?);
        result.table_hash = Some(hex(&Sha256::digest(controller.table_bytes)));
        (result.run_share, result.outside_run_for) = (Some(share), outside);
        (result.final_state, result.faults) = (run.accounts.final_state, run.accounts.faults);
        (result.timing, result.plant_timing) = (run.accounts.timing, run.plant_timing);
        result.ledger = Some(run.ledger);
        Ok(result)
    }

    /// What an insertion is for other tools, as far as that was asked for: its bodies are solved for once more.
    fn extras(&self, truths: &[Truth], recording: Option<&Recording>) -> Result<Vec<Artifact>, SimError> {
        let Self { body, label, extras, .. } = *self;
        let recording = recording.filter(|_| extras.mcap);
        let (coarse, mut files) = (body.model().coarse(), Vec::new());
        if recording.is_none() && !extras.vtu {
            return Ok(files);
        }
        let solved = solved_bodies(coarse, body.paddles(), truths)?;
        if let Some(recording) = recording {
            let scene = body.model().scene();
            let stage = SpaceStage::new(SpaceGeometry::new(coarse), body.paddles(), &solved);
            let (orthogonal, paddles) = (scene.needle.orthogonal(), body.paddles().len());
            let series = csv::Series { orthogonal: &orthogonal, paddles, length: &scene.length_unit };
            let known = mcap::Known { stage: Some(&stage), ..mcap::Known::default() };
            let bytes = mcap::encode(recording, &series, known)?;
            files.push(Artifact { name: label.file("mcap"), bytes });
            files.push(Artifact { name: label.file("foxglove.json"), bytes: stage.layout_file() });
        }
        if extras.vtu {
            let started_ns = solved.first().map_or(0, |body| body.truth.time_ns);
            files.extend(paraview::series_in_space(coarse, body.paddles(), &solved, started_ns, &label.stem()));
        }
        Ok(files)
    }

    /// What the true motion of the target amounts to, with its time series.
    fn measured(
        &self,
        plant: &mut PlantLoop<SpaceTissue<'_>, 3>,
        mode: RunMode,
        records: &[Record],
        artifacts: &mut Vec<Artifact>,
    ) -> SpaceStrategyResult {
        let Self { body, simulation, label, .. } = *self;
        let (scene, paddles) = (body.model().scene(), body.paddles());
        let (orthogonal, axis) = (scene.needle.orthogonal(), scene.needle.axis);
        let series = csv::Series { orthogonal: &orthogonal, paddles: paddles.len(), length: &scene.length_unit };
        let table = Artifact { name: label.file("csv"), bytes: series.insertion(plant.truths(), records) };
        let started_ns = plant.world().needle_started_ns().unwrap_or(0);
        let moving = plant.truths().partition_point(|truth| truth.time_ns < started_ns);
        let truths = plant.truths()[moving..].to_vec();
        let error = |truth: &Truth| orthogonal.tr_mul(&truth.target::<3>()).norm();
        let worst = truths.iter().max_by(|a, b| error(a).total_cmp(&error(b)));
        let squares: f64 = truths.iter().map(|truth| error(truth).powi(2)).sum();
        let way = |pair: &[Truth]| -> f64 {
            let steps = pair[0].paddles.iter().zip(&pair[1].paddles);
            steps.map(|(from, to)| (from_frame::<3>(*to) - from_frame::<3>(*from)).norm()).sum()
        };
        let stride = truths.len().div_ceil(SERIES_POINTS - 1).max(1);
        let last = truths.len().saturating_sub(1);
        let kept = truths.iter().enumerate().filter(|(i, _)| i % stride == 0 || *i == last);
        let result = SpaceStrategyResult {
            mode,
            paddles: paddles.to_vec(),
            max_orthogonal_error: worst.map_or(0.0, error),
            max_error_depth: worst.map_or(0.0, |truth| truth.depth),
            rms_orthogonal_error: (squares / truths.len().max(1) as f64).sqrt(),
            // The sum of nothing is −0.
            paddle_travel: truths.windows(2).map(way).sum::<f64>() + 0.0,
            final_state: None,
            run_share: None,
            faults: Faults::NONE,
            outside_run_for: Faults::NONE,
            ledger: None,
            timing: None,
            plant_timing: None,
            seed: simulation.seed,
            table_hash: None,
            recording: None,
            csv: Some(table.name.clone()),
            plant: self.plant_account(&mut plant.world().tissue, &truths),
            series: kept
                .map(|(_, truth)| SpaceSeriesPoint {
                    time_s: csv::seconds_since(truth.time_ns, started_ns),
                    depth: truth.depth,
                    orthogonal_error: error(truth),
                    axial: axis.dot(&truth.target::<3>()),
                    paddles: truth.paddles.iter().take(paddles.len()).copied().collect(),
                })
                .collect(),
        };
        artifacts.push(table);
        result
    }

    /// What answered for the tissue, and how well.
    fn plant_account(&self, tissue: &mut SpaceTissue<'_>, truths: &[Truth]) -> SpacePlantAccount {
        let Self { body, .. } = *self;
        let (fallbacks, first_fallback) = (tissue.fallbacks, tissue.first_fallback.clone());
        SpacePlantAccount {
            tabulation: body.report.clone(),
            step_us: if self.is_held_against_full {
                step_us(body.table().body(), body.paddles().len(), truths)
            } else {
                f64::NAN
            },
            fallbacks,
            first_fallback,
            largest_estimate: tissue.largest_estimate,
            largest_error: if self.is_held_against_full { held_against_full(tissue, truths) } else { None },
        }
    }
}

/// Mean time of a step, µs, on the way of a run.
fn step_us(mut body: TabulatedBody, paddles: usize, truths: &[Truth]) -> f64 {
    let start = Instant::now();
    for truth in truths {
        // Where the table does not reach, finding that out is what a step takes.
        let places = truth.paddles.map(from_frame);
        let _ = black_box(body.drive(truth.depth, &places[..paddles]));
    }
    start.elapsed().as_secs_f64() * 1e6 / truths.len().max(1) as f64
}

/// The largest distance of the tissue from its full model at some states of a run, in their order.
fn held_against_full(tissue: &mut SpaceTissue<'_>, truths: &[Truth]) -> Option<f64> {
    let every = truths.len().div_ceil(CHECKS).max(1);
    let mut largest = 0.0_f64;
    for truth in truths.iter().step_by(every).chain(truths.last()) {
        largest = largest.max(tissue.held_against_full(truth).ok()?);
    }
    Some(largest)
}
