//! Blocks of a periodic loop: measured from the scheduled release, one after the other.

use firmware::schedule::Schedule;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::machine::Disturbance;
use crate::runtime::clock::{Scheduling, now_ns, sleep_until};
use crate::runtime::durations::{Distribution, Durations, LoopDurations, LoopTiming};
use crate::runtime::error::RuntimeError;
use crate::runtime::signals;

/// From the set-up to the first release of a block.
const LEAD_NS: u64 = 5_000_000;
/// A block is void when the host took away more than this part of its time: it describes the host.
const VOID_STEAL: f64 = 0.01;

/// Blocks of one kind of loop.
pub(super) struct Blocks {
    rate_hz: f64,
    ticks: u64,
    scheduling: Scheduling,
    durations: LoopDurations,
    input_age: Durations,
    end_to_end: Durations,
    pub(super) medians_ns: Vec<Option<u64>>,
    last_lateness_ns: u64,
    sum: LoopTiming,
    disturbance: Disturbance,
    voided: u64,
}

/// What a step says about itself: when its input was measured and when its command was there, ns.
pub(super) type Stamps = Option<(u64, u64)>;

/// Everything about one kind of loop.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BlockResult {
    /// Age of the input when the command was there: command minus measurement.
    pub input_age: Option<Distribution>,
    /// From the scheduled release to the command.
    pub end_to_end: Option<Distribution>,
    /// Lateness of the very last release, ns (`Act` of cyclictest).
    pub last_lateness_ns: u64,
    /// What the machine did meanwhile.
    pub disturbance: Disturbance,
    /// Blocks that are not in the ratios because the host took time away.
    pub voided_blocks: u64,
    /// Blocks altogether.
    pub blocks: u64,
}

impl Blocks {
    /// `ticks` per block.
    pub(super) fn new(rate_hz: f64, ticks: u64, scheduling: &Scheduling) -> Self {
        Self {
            rate_hz,
            ticks,
            scheduling: scheduling.clone(),
            durations: LoopDurations::default(),
            input_age: Durations::default(),
            end_to_end: Durations::default(),
            medians_ns: Vec::with_capacity(64),
            last_lateness_ns: 0,
            sum: LoopTiming::default(),
            disturbance: Disturbance::default(),
            voided: 0,
        }
    }

    /// One block; `step` is called at every release with its number and its scheduled time.
    pub(super) fn block(
        &mut self,
        mut step: impl FnMut(u64, u64) -> Result<Stamps, RuntimeError>,
    ) -> Result<(), RuntimeError> {
        signals::check()?;
        let period_ns = (1e9 / self.rate_hz).round() as u64;
        let before = Disturbance::now();
        let first_ns = now_ns() + LEAD_NS;
        let mut schedule = Schedule::new(first_ns, period_ns);
        let mut own = Durations::default();
        for _ in 0..self.ticks {
            sleep_until(schedule.next_release_ns());
            let start_ns = now_ns();
            let release = schedule.begin(start_ns);
            let stamps = step(release.tick, release.release_ns)?;
            let end_ns = now_ns();
            schedule.finish(end_ns);
            own.record(release.release_lateness_ns);
            self.durations.record(release.release_ns, start_ns, end_ns);
            self.last_lateness_ns = release.release_lateness_ns;
            if let Some((measured_ns, command_ns)) = stamps {
                self.input_age.record(command_ns.saturating_sub(measured_ns));
                self.end_to_end.record(command_ns.saturating_sub(release.release_ns));
            }
        }
        let disturbance = Disturbance::now().since(&before);
        let elapsed_ms = (now_ns() - first_ns) as f64 * 1e-6;
        let void = disturbance.steal_ms.is_some_and(|steal| steal as f64 > VOID_STEAL * elapsed_ms);
        self.voided += u64::from(void);
        self.medians_ns.push((!void).then(|| own.median_ns()));
        self.disturbance = self.disturbance.plus(&disturbance);
        self.sum.ticks += self.ticks;
        self.sum.deadline_misses += schedule.deadline_misses();
        self.sum.overruns += schedule.overruns();
        self.sum.skipped += schedule.skipped();
        Ok(())
    }

    /// Periods that were not started so far.
    pub(super) fn skipped(&self) -> u64 {
        self.sum.skipped
    }

    /// Everything that was measured.
    pub(super) fn finish(self) -> (LoopTiming, BlockResult) {
        let given = |durations: &Durations| Some(durations.distribution()).filter(|found| found.count > 0);
        let result = BlockResult {
            input_age: given(&self.input_age),
            end_to_end: given(&self.end_to_end),
            last_lateness_ns: self.last_lateness_ns,
            disturbance: self.disturbance,
            voided_blocks: self.voided,
            blocks: self.medians_ns.len() as u64,
        };
        let timing = LoopTiming {
            rate_hz: self.rate_hz,
            scheduling: self.scheduling,
            release_lateness: self.durations.release_lateness.distribution(),
            execution_time: self.durations.execution_time.distribution(),
            response_time: self.durations.response_time.distribution(),
            ..self.sum
        };
        (timing, result)
    }
}

/// Ratios block by block, of those that are not void.
pub(super) fn ratios(of: &[Option<u64>], over: &[Option<u64>]) -> Vec<f64> {
    let pairs = of.iter().zip(over).filter_map(|(of, over)| of.zip(*over));
    pairs.map(|(of, over)| of as f64 / over.max(1) as f64).collect()
}
