//! The result of a run, as `run --json` prints it and `DIR/result.json` keeps it. The report is made from this alone.
//!
//! Lengths are in the scene's unit, times in the unit that the name ends with.

use firmware::{Faults, Mode};
use model_offline::discretization::Integration;
pub use model_offline::output::{Geometry, PaddleGeometry};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::causes::CausesResult;
use super::strategy::Strategy;
use super::study_failure::StudyFailure;
use super::table_tissue::TableTissue;
use crate::record::files::Artifact;
use crate::runtime::accounting::ledger::LedgerResult;
use crate::runtime::names;
use crate::runtime::time::durations::LoopTiming;
use crate::runtime::time::mode::RunMode;
use crate::world::tissue::PlantAccount;
use crate::world::truth::NeedleMoment;
use model_offline::needle::StationState;
use model_offline::output::table_text::hex;
use model_offline::scene::TissueVariant;

/// Version of this format.
pub const FORMAT: u32 = 1;

/// A whole run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunResult {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of host-sim.
    pub version: String,
    /// Name of the scene.
    pub scene: String,
    /// Labels of length and stress.
    pub units: [String; 2],
    /// What drove time in the comparison of strategies.
    pub mode: RunMode,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// What was simulated.
    pub settings: SimulationSettings,
    /// What things look like at rest.
    pub geometry: Geometry,
    /// Placement studies, one per tissue.
    pub placements: Vec<PlacementResult>,
    /// Comparisons of strategies.
    pub cases: Vec<CaseResult>,
    /// Duration of the whole command, s.
    pub wall_s: f64,
    /// The command line, from the program's name on.
    #[serde(default)]
    pub command: Vec<String>,
    /// Architecture and operating system.
    #[serde(default)]
    pub platform: String,
}

impl RunResult {
    /// Every insertion, case after case.
    pub fn results(&self) -> impl Iterator<Item = &StrategyResult> {
        self.cases.iter().flat_map(|case| case.strategies.iter()).map(|(_, result)| result)
    }

    /// The insertion without a paddle of a case. What the table knows makes no difference to it, so that a case that did not run it
    /// shows that of its tissue.
    pub fn without_paddle(&self, case: &CaseResult) -> Option<&StrategyResult> {
        let of_tissue = || self.cases.iter().filter(|other| other.tissue == case.tissue);
        of_tissue().find_map(|other| other.strategies.none.as_ref())
    }

    /// What a case shows, in the order in which it is shown: its strategies but those that the clock drives, and [no
    /// paddle](Self::without_paddle).
    pub fn shown<'r>(&'r self, case: &'r CaseResult) -> impl Iterator<Item = (Strategy, &'r StrategyResult)> {
        let none = self.without_paddle(case).map(|none| (Strategy::None, none));
        let own =
            case.strategies.iter().filter(|(strategy, _)| strategy.is_reproducible() && *strategy != Strategy::None);
        none.into_iter().chain(own)
    }
}

fn unnamed() -> String {
    "sensor".to_owned()
}

fn integral() -> String {
    "integral".to_owned()
}

/// Settings of the simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimulationSettings {
    /// Rate of the loop, Hz.
    pub rate_hz: f64,
    /// Duration of the insertion, s.
    pub insertion_s: f64,
    /// Time that the needle waits at the skin before, s.
    #[serde(default)]
    pub wait_s: f64,
    /// Pauses of the insertion, rest and way back after it, s.
    #[serde(default)]
    pub pauses_s: f64,
    /// Time simulated after the start of the needle, s.
    pub duration_s: f64,
    /// Depth of the insertion, length.
    pub depth: f64,
    /// How deep the needle goes, length; none in results of older versions, whose needles went to the insertion's depth.
    #[serde(default)]
    pub needle_depth: Option<f64>,
    /// What the simulated world has besides a contact that moves with the needle in elastic tissue at rest; empty: nothing.
    #[serde(default)]
    pub world: Vec<String>,
    /// Whether tables that were computed for the run know a needle that slips and stress that relaxes, where there are.
    #[serde(default)]
    pub table_knows_the_world: bool,
    /// What sees the target: a preset, or one that was changed.
    #[serde(default = "unnamed")]
    pub sensor: String,
    /// How measurements of the target become corrections: `integral` or `observer`.
    #[serde(default = "integral")]
    pub feedback: String,
    /// Rate of the target sensor, Hz.
    pub target_rate_hz: f64,
    /// Latency of the target sensor, ms.
    pub target_latency_ms: f64,
    /// Standard deviation of the target sensor's noise per component, length.
    pub noise: f64,
    /// Time constant of the paddle's lag, ms.
    pub paddle_lag_ms: f64,
    /// Delay of the paddle, ticks.
    pub paddle_delay_ticks: u32,
    /// Part of its command that the paddle reaches.
    pub paddle_gain: f64,
    /// Largest speed of the paddle, length/s.
    pub paddle_max_rate: f64,
    /// Largest displacement of the paddle, length.
    pub paddle_max_displacement: f64,
}

impl SimulationSettings {
    /// What the world has, and whether tables know it.
    pub fn world_in_words(&self) -> String {
        if self.world.is_empty() {
            return "nothing".to_owned();
        }
        let knows =
            if self.table_knows_the_world { "tables know of it what a table can" } else { "tables do not know it" };
        format!("{}; {knows}", self.world.join(", "))
    }
}

/// The placement study of one tissue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlacementResult {
    /// Its tissue.
    pub tissue: TissueVariant,
    /// Nodes of the model.
    pub nodes: usize,
    /// Its integration rule.
    #[schemars(with = "String")]
    pub integration: Integration,
    /// Duration of the study, s.
    pub wall_s: f64,
    /// Best static paddle.
    pub best_static: u32,
    /// Best dynamic paddle; none where no paddle has a finite controllability measure.
    pub best_dynamic: Option<u32>,
    /// All paddles.
    pub paddles: Vec<PaddlePlacement>,
    /// The insertion without a paddle; results of older versions have none.
    #[serde(default)]
    pub no_paddle: Option<NoPaddlePlacement>,
}

impl PlacementResult {
    /// The best dynamic paddle as a person reads it.
    pub fn dynamic_name(&self) -> String {
        self.best_dynamic.map_or_else(|| "none".to_owned(), |index| index.to_string())
    }
}

/// One paddle in a placement study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PaddlePlacement {
    /// Its index in the scene.
    pub index: u32,
    /// d(target displacement)/d(paddle displacement) at depth 0, rows target.
    pub jacobian: [[f64; 2]; 2],
    /// ‖J⁻¹n‖; none where the paddle cannot control the target.
    pub controllability_measure: Option<f64>,
    /// J⁻¹n; none where the paddle cannot control the target.
    pub best_direction: Option<[f64; 2]>,
    /// Depths of the static study, length.
    pub depth: Vec<f64>,
    /// Orthogonal target displacement there, length.
    pub orthogonal: Vec<f64>,
    /// Largest of these, absolute.
    pub max_orthogonal: f64,
    /// Depth reached, length.
    pub reached_depth: f64,
    /// Why the study ended before the full depth.
    #[schemars(with = "Option<String>")]
    pub failure: Option<StudyFailure>,
}

/// The insertion without a paddle in a placement study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoPaddlePlacement {
    /// Depths, length.
    pub depth: Vec<f64>,
    /// Orthogonal target displacement there, length.
    pub orthogonal: Vec<f64>,
    /// Largest of these, absolute.
    pub max_orthogonal: f64,
    /// Depth reached, length.
    pub reached_depth: f64,
    /// Why it ended before the full depth.
    #[schemars(with = "Option<String>")]
    pub failure: Option<StudyFailure>,
}

/// Strategies on one tissue with one table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CaseResult {
    /// Tissue of the simulation.
    pub tissue: TissueVariant,
    /// Tissue that the planner and the table believed in.
    #[schemars(with = "String")]
    pub table_tissue: TableTissue,
    /// The table.
    pub table: TableResult,
    /// The strategies.
    pub strategies: Strategies,
    /// Largest error of `static` over that of `dynamic`.
    pub improvement: Option<f64>,
    /// Largest error without a paddle over that of `dynamic`; results of older versions have none.
    #[serde(default)]
    pub improvement_over_none: Option<f64>,
    /// What the error of `dynamic` is made of, where that was asked for.
    #[serde(default)]
    pub causes: Option<CausesResult>,
}

impl CaseResult {
    /// Which of `none`, `static` and `dynamic` leaves the target stillest, as far as they are known; `dynamic` where all do.
    pub fn stillest(&self) -> Strategy {
        stillest(self.improvement, self.improvement_over_none)
    }
}

/// Which of `none`, `static` and `dynamic` leaves the target stillest, by the largest errors of the static paddle and of none over
/// that of the dynamic one.
pub(super) fn stillest(held: Option<f64>, none: Option<f64>) -> Strategy {
    let known = |factor: Option<f64>| factor.filter(|factor| !factor.is_nan()).unwrap_or(f64::INFINITY);
    let (held, none) = (known(held), known(none));
    match held.min(none) {
        least if least >= 1.0 => Strategy::Dynamic,
        _ if none < held => Strategy::None,
        _ => Strategy::Static,
    }
}

/// A controller table in short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TableResult {
    /// SHA-256 of its bytes.
    pub hash: String,
    /// SHA-256 of the scene that it was made from.
    pub scene_hash: String,
    /// Its paddle.
    pub paddle: u32,
    /// Its depth knots.
    pub knots: usize,
    /// Its size, bytes.
    pub bytes: usize,
    /// Gain per target sample that the controller derives with it.
    pub loop_gain: f64,
    /// Delay of the loop, target samples.
    pub delay_samples: u32,
    /// Depths of its knots, length.
    pub depth: Vec<f64>,
    /// Feed-forward path of the paddle, length.
    pub paddle_path: Vec<[f64; 2]>,
    /// Where and why it ends before the needle does; results of older versions do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ends_early: Option<String>,
}

/// What was compared. Absent strategies were not asked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "WrittenStrategies", into = "WrittenStrategies")]
#[schemars(with = "WrittenStrategies")]
pub struct Strategies {
    /// No paddle.
    pub none: Option<StrategyResult>,
    /// The best static paddle of the table's tissue, held.
    pub static_paddle: Option<StrategyResult>,
    /// The table's paddle, controlled in lockstep.
    pub dynamic: Option<StrategyResult>,
    /// The same on the machine's clock.
    pub dynamic_free_run: Option<StrategyResult>,
}

/// The same in files, where `dynamic` is there whatever drove its time.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Strategies")]
struct WrittenStrategies {
    /// No paddle.
    none: Option<StrategyResult>,
    /// The best static paddle of the table's tissue, held.
    #[serde(rename = "static")]
    static_paddle: Option<StrategyResult>,
    /// The table's paddle, controlled: in lockstep, or on the machine's clock where that alone was asked for.
    dynamic: Option<StrategyResult>,
    /// The same once more on the machine's clock, beside lockstep.
    dynamic_free_run: Option<StrategyResult>,
}

impl From<Strategies> for WrittenStrategies {
    fn from(strategies: Strategies) -> Self {
        let Strategies { none, static_paddle, dynamic, mut dynamic_free_run } = strategies;
        Self { none, static_paddle, dynamic: dynamic.or_else(|| dynamic_free_run.take()), dynamic_free_run }
    }
}

impl From<WrittenStrategies> for Strategies {
    fn from(written: WrittenStrategies) -> Self {
        let WrittenStrategies { none, static_paddle, mut dynamic, dynamic_free_run } = written;
        let alone = dynamic.take_if(|dynamic| dynamic.mode == RunMode::FreeRun);
        Self { none, static_paddle, dynamic, dynamic_free_run: dynamic_free_run.or(alone) }
    }
}

impl Strategies {
    /// One of them.
    pub fn get(&self, strategy: Strategy) -> Option<&StrategyResult> {
        match strategy {
            Strategy::None => self.none.as_ref(),
            Strategy::Static => self.static_paddle.as_ref(),
            Strategy::Dynamic => self.dynamic.as_ref(),
            Strategy::DynamicFreeRun => self.dynamic_free_run.as_ref(),
        }
    }

    /// All that were asked for, to be changed.
    pub(super) fn all_mut(&mut self) -> impl Iterator<Item = &mut StrategyResult> {
        let Self { none, static_paddle, dynamic, dynamic_free_run } = self;
        [none, static_paddle, dynamic, dynamic_free_run].into_iter().flatten()
    }

    /// All that were asked for, in the order in which they are shown.
    pub fn iter(&self) -> impl Iterator<Item = (Strategy, &StrategyResult)> {
        Strategy::ALL.into_iter().filter_map(|strategy| Some((strategy, self.get(strategy)?)))
    }

    /// The dynamic one: in lockstep, or in free-run where that is all.
    pub fn controlled(&self) -> Option<&StrategyResult> {
        self.dynamic.as_ref().or(self.dynamic_free_run.as_ref())
    }

    /// Whether the controlled insertion left the neighbourhood of its planned way, and was simulated again in full.
    pub(crate) fn left_the_way(&self) -> bool {
        self.dynamic.as_ref().is_some_and(|dynamic| dynamic.plant.left_the_way)
    }
}

/// One simulated insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StrategyResult {
    /// What drove time.
    pub mode: RunMode,
    /// The attached paddle.
    pub paddle: Option<u32>,
    /// Largest true target displacement orthogonal to the needle over the whole insertion, length.
    pub max_orthogonal_error: f64,
    /// Depth at which it occurs, length.
    pub max_error_depth: f64,
    /// Its root mean square, length.
    pub rms_orthogonal_error: f64,
    /// Length of the paddle's way.
    pub paddle_travel: f64,
    /// State of the controller at the end: `RUN`, `HOLD`, `SAFE`; `none` without one.
    #[serde(with = "names::mode")]
    #[schemars(with = "String")]
    pub final_state: Option<Mode>,
    /// Part of the ticks from the needle's start on that ended in RUN; none without a controller.
    #[serde(default)]
    pub run_share: Option<f64>,
    /// Fault codes of the others.
    #[serde(default, with = "names::faults")]
    #[schemars(with = "String")]
    pub outside_run_for: Faults,
    /// Every fault that was ever present: names joined by ` | `, or `NONE`.
    #[serde(with = "names::faults")]
    #[schemars(with = "String")]
    pub faults: Faults,
    /// Accounts of samples and ticks.
    pub ledger: Option<LedgerResult>,
    /// Timing of the controller's loop; free-run only.
    pub timing: Option<LoopTiming>,
    /// Timing of the plant's loop; free-run only.
    pub plant_timing: Option<LoopTiming>,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// SHA-256 of the table's bytes.
    pub table_hash: Option<String>,
    /// SHA-256 of the plant's scene.
    pub scene_hash: String,
    /// The recording beside the result, and its SHA-256.
    pub recording: Option<RecordingResult>,
    /// The time series beside the result.
    pub csv: Option<String>,
    /// Forces on the needle, and its shaft, as tables beside the result.
    #[serde(default)]
    pub needle_csv: Vec<String>,
    /// The insertion in at most 500 points.
    pub series: Vec<SeriesPoint>,
    /// Nodes at the end.
    pub deformed_nodes: Vec<[f64; 2]>,
    /// The body along the way, for drawings; results of older versions have none.
    #[serde(default)]
    pub frames: Vec<BodyFrame>,
    /// What the needle met, where the world has one that slips; results of older versions do not say.
    #[serde(default)]
    pub needle: Option<NeedleResult>,
    /// Mean duration of a plant step, µs; not part of what is reproducible.
    pub plant_step_us: f64,
    /// Which model answered for the tissue, and how well; results of older versions do not say.
    #[serde(default)]
    pub plant: PlantAccount,
}

/// Part of the largest error by which its tissue may be off before the error is one of the tissue's model.
const MOST_OFF: f64 = 0.25;

impl StrategyResult {
    /// Part of the largest error by which the tissue was off, where that is too much to go by; infinite where a model stood in for the
    /// full one, which could not go the same way.
    pub fn tissue_off(&self) -> Option<f64> {
        let share = self.plant.off()? / self.max_orthogonal_error;
        (share > MOST_OFF).then_some(share)
    }

    /// The same in words.
    pub(crate) fn tissue_off_in_words(&self) -> Option<String> {
        let share = self.tissue_off()?;
        Some(match &self.plant.not_verified {
            None if share < 10.0 => format!("its tissue is up to {:.0} % of that off", 100.0 * share),
            None => "its tissue is off by more than ten times that".to_owned(),
            Some(why) => {
                format!("how far its tissue is off is not known, because the full model cannot go the same way ({why})")
            }
        })
    }

    /// The same with what to do.
    pub(crate) fn distrust(&self) -> Option<String> {
        let off = self.tissue_off_in_words()?;
        let advice = match (&self.plant.not_in_full, &self.plant.not_verified) {
            (Some(why), _) => format!("; the full model was tried and ended ({why})"),
            (None, Some(_)) => String::new(),
            (None, None) => "; simulate it with --plant full".to_owned(),
        };
        Some(off + &advice)
    }
}

/// The body at one moment of the insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BodyFrame {
    /// Needle depth, length.
    pub depth: f64,
    /// Nodes there.
    pub nodes: Vec<[f64; 2]>,
    /// Norm of the Green–Lagrange strain at every node; results of older versions have none.
    #[serde(default)]
    pub strain: Vec<f64>,
    /// Von Mises stress at every node, stress; empty where the displacement does not tell it (tissue that relaxes).
    #[serde(default)]
    pub von_mises: Vec<f64>,
}

/// What a needle that slips met on its way, by the full model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NeedleResult {
    /// At most 500 moments.
    pub points: Vec<NeedlePoint>,
    /// Depth of the needle where it was deepest, length.
    pub shaft_depth: f64,
    /// The shaft there, from the entry to the tip; empty where the skin held.
    pub shaft: Vec<StationState>,
}

/// Forces on a needle at one moment, force per unit thickness: positive where they push it in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NeedlePoint {
    /// Time since the start of the needle, s.
    pub time_s: f64,
    /// Needle depth, length.
    pub depth: f64,
    /// Force at the base: that of the tip and of the shaft.
    pub base_force: f64,
    /// Force of the tip.
    pub tip_force: f64,
    /// Friction all along the shaft.
    pub friction: f64,
    /// Length of tissue that the tip has passed; none while the skin holds.
    pub cut_length: Option<f64>,
    /// Farthest that the needle has slid past tissue anywhere, length; negative where it slid out.
    pub largest_slip: f64,
}

impl From<&NeedleMoment> for NeedlePoint {
    fn from(NeedleMoment { since_start_s, reading }: &NeedleMoment) -> Self {
        Self {
            time_s: *since_start_s,
            depth: reading.depth,
            base_force: reading.base_force,
            tip_force: reading.tip_force,
            friction: reading.friction(),
            cut_length: reading.cut_length,
            largest_slip: reading.largest_slip(),
        }
    }
}

/// A recording file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordingResult {
    /// File name.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Its ticks.
    pub ticks: u64,
}

impl RecordingResult {
    /// Of this file with so many ticks.
    pub fn of(file: &Artifact, ticks: u64) -> Self {
        Self { file: file.name.clone(), sha256: hex(&Sha256::digest(&file.bytes)), ticks }
    }
}

/// A point of a time series.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SeriesPoint {
    /// Time since the start of the needle, s.
    pub time_s: f64,
    /// Needle depth, length.
    pub depth: f64,
    /// True target displacement along n, length.
    pub orthogonal_error: f64,
    /// True target displacement along the axis, length.
    pub axial: f64,
    /// Paddle displacement, length.
    pub paddle: [f64; 2],
}
