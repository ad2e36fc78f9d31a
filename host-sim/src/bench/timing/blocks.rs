//! Blocks of a periodic loop: measured from the scheduled release, one after the other.

use firmware::contract::PaddleCommand;
use firmware::schedule::Release;
use firmware::{Faults, Mode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::machine::Disturbance;
use crate::bench::rounds::MeasuredLoop;
use crate::runtime::accounting::ledger::TickResult;
use crate::runtime::error::RuntimeError;
use crate::runtime::names;
use crate::runtime::time::clock::{Scheduling, now_ns};
use crate::runtime::time::durations::{Distribution, Durations, LoopDurations, LoopTiming};
use crate::runtime::time::periodic::{PeriodicLoop, Served};

/// From the set-up to the first release of a block.
const LEAD_NS: u64 = 5_000_000;
/// A block is void when the host took away more than this part of its time: it describes the host.
const VOID_STEAL: f64 = 0.01;

/// What a controller says about itself in a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ModeAnswer {
    mode: Mode,
    faults: Faults,
}

impl ModeAnswer {
    pub(super) fn of(command: &PaddleCommand) -> Self {
        let mode = Mode::from_wire(command.state).unwrap_or_default();
        Self { mode, faults: Faults::from_bits(command.faults) }
    }

    pub(super) fn is_run(self) -> bool {
        self.mode == Mode::Run
    }

    /// RUN has not come within so many ticks.
    pub(super) fn never_armed(self, ticks: u64, period_ns: u64) -> RuntimeError {
        RuntimeError::NeverArmed { waited_s: (ticks * period_ns) as f64 * 1e-9, faults: self.faults }
    }
}

/// What a step says about itself.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stamps {
    /// The controller's mode and reasons; none without a controller.
    pub(super) answer: Option<ModeAnswer>,
    /// When its input was measured and when its command was there, ns.
    pub(super) exchanged_ns: Option<(u64, u64)>,
}

/// Why a round is void: its controller did not stay in RUN.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftRun {
    /// What was being measured.
    pub measurement: MeasuredLoop,
    /// Round, from 1.
    pub round: u64,
    /// Release of the round, or exchange, at which RUN ended.
    pub tick: u64,
    /// Where to.
    #[serde(with = "names::optional_mode")]
    #[schemars(with = "Option<String>")]
    pub mode: Option<Mode>,
    /// Why.
    #[serde(with = "names::faults")]
    #[schemars(with = "String")]
    pub faults: Faults,
}

impl LeftRun {
    /// The answer of a controller that should be in RUN, if it is not.
    pub(super) fn found(measurement: MeasuredLoop, round: u64, tick: u64, answer: ModeAnswer) -> Option<Self> {
        let ModeAnswer { mode, faults } = answer;
        (mode != Mode::Run).then_some(Self { measurement, round, tick, mode: Some(mode), faults })
    }
}

/// Modes that figures are kept apart by: none stands for a loop without a controller.
const MODES: [Option<Mode>; 4] = [None, Some(Mode::Run), Some(Mode::Hold), Some(Mode::Safe)];

/// Blocks of one kind of loop.
pub(super) struct Blocks {
    measured: MeasuredLoop,
    rate_hz: f64,
    ticks: u64,
    scheduling: Scheduling,
    durations: [LoopDurations; MODES.len()],
    input_age: Durations,
    pub(super) medians_ns: Vec<Option<u64>>,
    last_lateness_ns: u64,
    due: u64,
    disturbance: Disturbance,
    voided: u64,
    left_run: Vec<LeftRun>,
}

/// Everything about one kind of loop.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BlockResult {
    /// Age of the input when the command was there: command minus measurement. Commands of RUN.
    pub input_age: Option<Distribution>,
    /// What was measured while the controller was not in RUN, by its mode.
    #[serde(default)]
    pub outside_run: Vec<LoopTiming>,
    /// Lateness of the very last release, ns (`Act` of cyclictest).
    pub last_lateness_ns: u64,
    /// What the machine did meanwhile.
    pub disturbance: Disturbance,
    /// Blocks that are not in the ratios: the host took time away, or the controller left RUN.
    pub voided_blocks: u64,
    /// Blocks altogether.
    pub blocks: u64,
}

/// What all blocks of one kind of loop come to.
pub(super) struct FinishedBlocks {
    /// In RUN; of a loop without a controller: all of it.
    pub(super) timing: LoopTiming,
    pub(super) more: BlockResult,
    pub(super) left_run: Vec<LeftRun>,
    /// Releases by mode.
    pub(super) ticks: TickResult,
}

impl Blocks {
    /// Blocks in which `ticks` releases come due.
    pub(super) fn new(measured: MeasuredLoop, rate_hz: f64, ticks: u64, scheduling: &Scheduling) -> Self {
        Self {
            measured,
            rate_hz,
            ticks,
            scheduling: scheduling.clone(),
            durations: Default::default(),
            input_age: Durations::default(),
            medians_ns: Vec::with_capacity(64),
            last_lateness_ns: 0,
            due: 0,
            disturbance: Disturbance::default(),
            voided: 0,
            left_run: Vec::new(),
        }
    }

    /// One block; `step` is called at every release that starts. A controller is in RUN before the first.
    pub(super) fn block(
        &mut self,
        mut step: impl FnMut(&Release) -> Result<Stamps, RuntimeError>,
    ) -> Result<(), RuntimeError> {
        let period_ns = (1e9 / self.rate_hz).round() as u64;
        let before = Disturbance::now();
        let first_ns = now_ns() + LEAD_NS;
        let mut periodic = PeriodicLoop::new(first_ns, period_ns);
        let mut own = Durations::default();
        // A release that was missed belongs to the mode in which it came due.
        let mut standing: Option<Option<Mode>> = None;
        let mut left_run = None;
        while periodic.due() < self.ticks {
            periodic.wait()?;
            let release = periodic.begin();
            let stamps = step(&release)?;
            let served = periodic.finish();
            own.record(served.start_ns.saturating_sub(served.first_due_ns));
            let mode = stamps.answer.map(|answer| answer.mode);
            self.of(standing.unwrap_or(mode.and(Some(Mode::Run)))).record_missed(&served);
            self.record(&served, &stamps);
            standing = Some(mode);
            let round = self.medians_ns.len() as u64 + 1;
            let found = |answer| LeftRun::found(self.measured, round, release.tick, answer);
            left_run = left_run.or_else(|| stamps.answer.and_then(found));
        }
        if let Some(unserved) = periodic.unserved() {
            self.of(standing.flatten()).record_missed(&unserved);
        }
        self.due += periodic.due();
        let disturbance = Disturbance::now().since(&before);
        let elapsed_ms = (now_ns() - first_ns) as f64 * 1e-6;
        let stolen = disturbance.steal_ms.is_some_and(|steal| steal as f64 > VOID_STEAL * elapsed_ms);
        let void = stolen || left_run.is_some();
        self.voided += u64::from(void);
        self.medians_ns.push((!void).then(|| own.median_ns()));
        self.disturbance = self.disturbance.plus(&disturbance);
        self.left_run.extend(left_run);
        Ok(())
    }

    fn of(&mut self, mode: Option<Mode>) -> &mut LoopDurations {
        &mut self.durations[MODES.iter().position(|known| *known == mode).unwrap_or(0)]
    }

    fn record(&mut self, served: &Served, stamps: &Stamps) {
        let mode = stamps.answer.map(|answer| answer.mode);
        self.of(mode).record_step(served);
        self.last_lateness_ns = served.start_ns.saturating_sub(served.first_due_ns);
        if let (Some(Mode::Run), Some((measured_ns, command_ns))) = (mode, stamps.exchanged_ns) {
            self.input_age.record(command_ns.saturating_sub(measured_ns));
        }
    }

    /// Everything that was measured.
    pub(super) fn finish(self) -> FinishedBlocks {
        let given = |durations: &Durations| Some(durations.distribution()).filter(|found| found.count > 0);
        let in_mode = |(mode, durations): (&Option<Mode>, &LoopDurations)| {
            durations.in_mode(*mode, self.rate_hz, &self.scheduling)
        };
        let [none, run, hold, safe] = [0, 1, 2, 3].map(|i| in_mode((&MODES[i], &self.durations[i])));
        let count = |timing: &LoopTiming| timing.ticks;
        let skipped = [&none, &run, &hold, &safe].iter().map(|timing| timing.skipped).sum();
        let entries = count(&none) + count(&run) + count(&hold) + count(&safe) + skipped;
        let ticks = TickResult {
            due: self.due,
            run: count(&run),
            hold: count(&hold),
            safe: count(&safe),
            skipped,
            unaccounted: self.due.abs_diff(entries),
        };
        let more = BlockResult {
            input_age: given(&self.input_age),
            outside_run: [hold, safe].into_iter().filter(|timing| timing.ticks + timing.skipped > 0).collect(),
            last_lateness_ns: self.last_lateness_ns,
            disturbance: self.disturbance,
            voided_blocks: self.voided,
            blocks: self.medians_ns.len() as u64,
        };
        let timing = if none.ticks > 0 { none } else { run };
        FinishedBlocks { timing, more, left_run: self.left_run, ticks }
    }
}

/// Ratios block by block, of those that are not void.
pub(super) fn ratios(of: &[Option<u64>], over: &[Option<u64>]) -> Vec<f64> {
    let pairs = of.iter().zip(over).filter_map(|(of, over)| of.zip(*over));
    pairs.map(|(of, over)| of as f64 / over.max(1) as f64).collect()
}
