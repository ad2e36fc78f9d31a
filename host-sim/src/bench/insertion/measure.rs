//! What an insertion amounts to.

use firmware::Faults;
use model_offline::model::TissueModel;
use model_offline::output::NodalFields;

use crate::bench::result::{BodyFrame, NeedlePoint, NeedleResult, SeriesPoint, StrategyResult};
use crate::record::export;
use crate::runtime::plant::PlantLoop;
use crate::runtime::time::mode::RunMode;
use crate::world::retrace::Retrace;
use crate::world::tissue::TissuePlant;
use crate::world::truth::{NeedleMoment, Truth};
use model_offline::output::table_text::hex;

/// Points of a time series in the result.
const SERIES_POINTS: usize = 500;

/// Pictures of the body along an insertion, and how many node positions all of them may have together.
const FRAMES: usize = 10;
const FRAME_NUMBERS: usize = 20_000;

/// What the true motion of the target amounts to.
pub(super) fn measure(
    model: &TissueModel,
    plant: &mut PlantLoop<TissuePlant<'_>>,
    mode: RunMode,
    paddle: Option<u32>,
    seed: u64,
) -> StrategyResult {
    let plant_account = plant.world().plant_account();
    let deformed_nodes = plant.world().tissue.deformed_nodes();
    let needle = needle(plant.world().tissue.needle());
    let started_ns = plant.world().needle_started_ns().unwrap_or(0);
    let waited_s = plant.world().drive.wait_s();
    let (normal, axis) = (model.scene().needle.orthogonal(), model.scene().needle.axis);
    let truths = plant.truths();
    let error = |truth: &Truth| truth.target::<2>().dot(&normal);
    // Before the needle moves nothing is to be held; at its start it has not moved.
    let waits = |truth: &Truth| {
        let since_start_s = export::csv::seconds_since(truth.time_ns, started_ns);
        since_start_s <= 0.0 || since_start_s < waited_s
    };
    let counted = &truths[truths.partition_point(waits)..];
    let worst = counted.iter().max_by(|a, b| error(a).abs().total_cmp(&error(b).abs()));
    let squares: f64 = counted.iter().map(|truth| error(truth).powi(2)).sum();
    let travel = truths.windows(2).map(|pair| (pair[1].paddle::<2>() - pair[0].paddle::<2>()).norm()).sum();
    let stride = truths.len().div_ceil(SERIES_POINTS - 1).max(1);
    let last = truths.len().saturating_sub(1);
    let series = truths
        .iter()
        .enumerate()
        .filter(|(i, _)| i % stride == 0 || *i == last)
        .map(|(_, truth)| SeriesPoint {
            time_s: export::csv::seconds_since(truth.time_ns, started_ns),
            depth: truth.depth,
            orthogonal_error: error(truth),
            axial: truth.target::<2>().dot(&axis),
            paddle: truth.paddle::<2>().into(),
        })
        .collect();
    StrategyResult {
        mode,
        paddle,
        max_orthogonal_error: worst.map_or(0.0, |truth| error(truth).abs()),
        max_error_depth: worst.map_or(0.0, |truth| truth.depth),
        rms_orthogonal_error: (squares / counted.len().max(1) as f64).sqrt(),
        paddle_travel: travel,
        final_state: None,
        run_share: None,
        outside_run_for: Faults::NONE,
        faults: Faults::NONE,
        ledger: None,
        timing: None,
        plant_timing: None,
        seed,
        table_hash: None,
        scene_hash: hex(&model.scene().hash()),
        recording: None,
        csv: None,
        needle_csv: Vec::new(),
        series,
        deformed_nodes,
        frames: frames(model, paddle, truths, started_ns),
        needle,
        plant_step_us: plant.mean_step_us(),
        plant: plant_account,
    }
}

/// The body along the insertion, solved once more after the run at some of its ticks: nothing is added to a loop on
/// the machine's clock. Ends early where the tissue has no equilibrium with such large steps.
fn frames(model: &TissueModel, paddle: Option<u32>, truths: &[Truth], started_ns: u64) -> Vec<BodyFrame> {
    let (Ok(mut retrace), Some(last)) = (Retrace::new(model, paddle, truths, started_ns), truths.len().checked_sub(1))
    else {
        return Vec::new();
    };
    let count = (FRAME_NUMBERS / model.nodes().max(1)).clamp(2, FRAMES);
    let rounded = rounding(model.scene().needle.depth);
    let mut frames = Vec::new();
    // The needle's way so far, in and out: of one that only goes in its depth.
    let gone: Vec<f64> = truths
        .iter()
        .scan((0.0, 0.0), |(before, gone), truth| {
            *gone += (truth.depth - *before).abs();
            *before = truth.depth;
            Some(*gone)
        })
        .collect();
    let whole = gone.last().copied().unwrap_or(0.0);
    for i in 0..=count {
        let part = whole * i as f64 / count as f64;
        // The last one is the end, with what the controller removed after the needle had arrived.
        let index = if i == count { last } else { gone.partition_point(|gone| *gone < part).min(last) };
        let Ok(tissue) = retrace.go_on_to(index) else { break };
        let NodalFields { strain, von_mises } = tissue.nodal_fields().unwrap_or_default();
        frames.push(BodyFrame {
            depth: truths[index].depth,
            nodes: tissue.deformed_nodes().into_iter().map(|node| node.map(&rounded)).collect(),
            strain: strain.into_iter().map(digits).collect(),
            von_mises: von_mises.unwrap_or_default().into_iter().map(digits).collect(),
        });
    }
    frames
}

/// Coordinates as they are drawn: a millionth of the needle's depth is beyond any drawing.
pub(in crate::bench) fn rounding(depth: f64) -> impl Fn(f64) -> f64 {
    let places = 10f64.powi(6 - depth.log10().floor() as i32);
    move |coordinate: f64| (coordinate * places).round() / places
}

/// Four significant digits are beyond any colour.
pub(in crate::bench) fn digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// Forces and slip in so many points at most, and the whole shaft where the needle is deepest.
fn needle(moments: &[NeedleMoment]) -> Option<NeedleResult> {
    let deepest = moments.iter().max_by(|a, b| a.reading.depth.total_cmp(&b.reading.depth))?;
    let stride = moments.len().div_ceil(SERIES_POINTS - 1).max(1);
    let last = moments.len() - 1;
    let kept = moments.iter().enumerate().filter(|(i, _)| i % stride == 0 || *i == last);
    Some(NeedleResult {
        points: kept.map(|(_, moment)| NeedlePoint::from(moment)).collect(),
        shaft_depth: deepest.reading.depth,
        shaft: deepest.reading.shaft.clone(),
    })
}
