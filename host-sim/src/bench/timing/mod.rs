//! Timing of the fixed-rate loop and of the exchange with it, with something to compare with in the same run.
//!
//! Wake-up tails on a shared machine describe the machine. So an empty loop, the controller's loop and a loop that
//! exchanges samples with a controller process take turns, block by block, and the ratio of their medians says what
//! they add. Everything is measured from the *scheduled* release. The exchange by itself, with both sides polling, takes
//! turns with a bare ping-pong of iceoryx2 and with the same exchange over a Unix socket.

mod blocks;
pub mod machine;
mod own;
mod partner;
pub mod peer;
mod spin;
mod stimulus;

use std::path::PathBuf;

use firmware::contract::Table;
use firmware::{Controller, Faults};
use model_offline::table::to_bytes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::blocks::{BlockResult, LeftRun};
use self::blocks::{Blocks, FinishedBlocks, Stamps, ratios};
use self::machine::{Disturbance, pin, unpin};
use self::own::Own;
use self::partner::{Partner, Running};
use self::peer::Transport;
use super::error::SimError;
use super::paper_table::paper_table;
use super::rounds::{AllVoid, MeasuredLoop, TooLate};
use crate::record::error::FileError;
use crate::runtime::accounting::ledger::TickResult;
use crate::runtime::error::RuntimeError;
use crate::runtime::signals;
use crate::runtime::time::clock::{Scheduling, now_ns, release_real_time, request_real_time_at};
use crate::runtime::time::durations::{Distribution, Durations, LoopTiming};
use crate::world::loop_settings::LoopSettings;

/// Rounds of blocks: enough for a range of ratios.
const ROUNDS: u64 = 5;
/// Steps back to back, and exchanges per block with both sides polling: 0.05 to 0.3 s, so that a kernel that limits
/// real-time threads to 95 % of each second never steps in.
const STEPS: u64 = 200_000;
const EXCHANGES: u64 = 20_000;
/// Of these, between two looks at signals.
const STEPS_PER_LOOK: u64 = 1024;
/// Rates of the sweep, Hz, and how long each, s.
const SWEEP_HZ: [f64; 7] = [100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0];
const SWEEP_S: f64 = 2.0;

/// What is measured, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct TimingOptions {
    /// Rate of the loop, Hz.
    pub rate: f64,
    /// Duration of the periodic measurement, s.
    pub seconds: f64,
    /// Processor of the loop; the other process stays on the next one. None: left to the kernel.
    pub cpu: Option<usize>,
    /// Real-time priority to ask for, 1 to 99; 0: the ordinary policy.
    pub priority: u8,
    /// Whether the highest rate at which no deadline is missed is looked for.
    pub sweep: bool,
    /// The program that serves as the other process: `host-sim`.
    pub program: PathBuf,
}

/// Result of `timing`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimingResult {
    /// The loop that does nothing. Its execution time is what reading the clock twice costs.
    pub empty: LoopTiming,
    /// The loop with the controller's step, in RUN.
    pub controller: LoopTiming,
    /// The loop that publishes samples and waits for the command of a controller process, in RUN.
    pub exchange: LoopTiming,
    /// Median lateness of the controller's loop over that of the empty loop, block by block.
    pub lateness_ratios: Vec<f64>,
    /// The same for the loop with the exchange.
    pub exchange_lateness_ratios: Vec<f64>,
    /// More about these loops, in this order.
    pub blocks: Vec<BlockResult>,
    /// Releases of the controller's loop over all blocks, by its mode.
    pub ledger: TickResult,
    /// The same of the loop with the exchange.
    #[serde(default)]
    pub exchange_ledger: TickResult,
    /// Rounds that are void because their controller did not stay in RUN.
    #[serde(default)]
    pub left_run: Vec<LeftRun>,
    /// The controller's step back to back in RUN: warm caches, no sleep before it.
    pub step: Distribution,
    /// Reading the clock twice, back to back.
    pub clock: Distribution,
    /// Sample published to command received with both sides polling: the link, bare iceoryx2, a Unix socket.
    pub polled: [Distribution; 3],
    /// Median of the link over that of bare iceoryx2, block by block.
    pub link_over_bare: Vec<f64>,
    /// Median of the Unix socket over that of the link, block by block.
    pub socket_over_link: Vec<f64>,
    /// Rates of the sweep.
    pub sweep: Vec<SweepResult>,
    /// Time that the host took away from this machine, all processors, ms; none where the kernel does not say.
    pub steal_ms: Option<u64>,
    /// Whether threads stay on the processors that were asked for.
    pub pinned: bool,
}

impl TimingResult {
    /// The loops on the machine's clock: everything that was measured of each, in every mode of its controller.
    pub fn loops(&self) -> [(MeasuredLoop, Vec<&LoopTiming>); 3] {
        let all = |place: usize, headline| {
            let outside = self.blocks.get(place).into_iter().flat_map(|more| &more.outside_run);
            std::iter::once(headline).chain(outside).collect()
        };
        [
            (MeasuredLoop::Empty, all(0, &self.empty)),
            (MeasuredLoop::Controller, all(1, &self.controller)),
            (MeasuredLoop::Exchange, all(2, &self.exchange)),
        ]
    }

    /// Refuses a measurement in which any release of any loop came later than this, µs: in void rounds, outside of RUN and
    /// skipped ones too.
    ///
    /// # Errors
    /// [`TooLate`] of the latest one.
    pub fn check_lateness(&self, limit_us: f64) -> Result<(), TooLate> {
        let of_loop = |(measured, timings): (MeasuredLoop, Vec<&LoopTiming>)| {
            (measured, timings.iter().map(|timing| timing.release_lateness.max_ns).max().unwrap_or(0))
        };
        let latest = self.loops().map(of_loop).into_iter().max_by_key(|(_, latest_ns)| *latest_ns);
        match latest {
            Some((measured, latest_ns)) if latest_ns as f64 > 1e3 * limit_us => {
                Err(TooLate { measured, latest_ns, limit_us })
            }
            _ => Ok(()),
        }
    }

    /// Refuses a measurement of which a comparison has no round left: whatever else it shows, it is no check of the loop.
    ///
    /// # Errors
    /// [`AllVoid`] of the first such comparison.
    pub fn check_rounds(&self) -> Result<(), AllVoid> {
        let compared = [
            (MeasuredLoop::Controller, &self.lateness_ratios),
            (MeasuredLoop::Exchange, &self.exchange_lateness_ratios),
            (MeasuredLoop::Link, &self.link_over_bare),
            (MeasuredLoop::Socket, &self.socket_over_link),
        ];
        let Some((measured, _)) = compared.into_iter().find(|(_, ratios)| ratios.is_empty()) else { return Ok(()) };
        let left = || self.left_run.iter().filter(|left| left.measurement == measured);
        let faults = left().fold(Faults::NONE, |all, left| all | left.faults);
        Err(AllVoid { measured, rounds: ROUNDS, left_run: left().count() as u64, faults })
    }
}

/// One rate of the sweep.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SweepResult {
    /// Rate, Hz.
    pub rate_hz: f64,
    /// Releases by the controller's mode.
    pub ticks: TickResult,
    /// Releases that were not answered within a period, in any mode.
    pub deadline_misses: u64,
}

/// Settings of a loop at this rate: both processes of an exchange need the same.
pub fn loop_settings(rate: f64) -> LoopSettings {
    LoopSettings { rate, target_rate: f64::min(50.0, rate), ..LoopSettings::default() }
}

/// Measures.
///
/// # Errors
/// [`SimError`].
pub fn timing(options: &TimingOptions) -> Result<TimingResult, SimError> {
    let table = signals::ends_at_once(paper_table)?;
    let folder = tempfile::tempdir().map_err(RuntimeError::Spawn)?;
    let table_file = folder.path().join("controller.table");
    std::fs::write(&table_file, to_bytes(&table)?).map_err(FileError::write(&table_file))?;
    let loop_settings = loop_settings(options.rate);
    let controller = Controller::new(&table, &loop_settings.settings(table.validity.depth_end))?;
    let partner = Partner {
        program: options.program.clone(),
        table: &table,
        table_file,
        loop_settings,
        cpu: options.cpu.map(|cpu| cpu + 1),
        priority: options.priority,
    };

    let before = Disturbance::now();
    let pinned = options.cpu.is_some_and(pin);
    let scheduling = request_real_time_at(options.priority);
    let measurement = TimingMeasurement { options, table: &table, controller: &controller, partner, scheduling };
    let outcome = measurement.measure();
    release_real_time();
    unpin();
    let mut result = outcome?;
    result.pinned = pinned;
    result.steal_ms = Disturbance::now().since(&before).steal_ms;
    Ok(result)
}

/// Everything that the measurements share.
struct TimingMeasurement<'t> {
    options: &'t TimingOptions,
    table: &'t Table<f64, 2>,
    controller: &'t Controller<'t, f64>,
    partner: Partner<'t>,
    scheduling: Scheduling,
}

impl TimingMeasurement<'_> {
    fn measure(&self) -> Result<TimingResult, SimError> {
        let mut result = TimingResult::default();
        self.periodic(&mut result)?;
        self.back_to_back(&mut result)?;
        self.polled(&mut result)?;
        if self.options.sweep {
            result.sweep = SWEEP_HZ.into_iter().map(|rate| self.sweep(rate)).collect::<Result<_, _>>()?;
        }
        Ok(result)
    }

    /// One rate of the sweep.
    fn sweep(&self, rate_hz: f64) -> Result<SweepResult, SimError> {
        let loop_settings = LoopSettings { rate: rate_hz, ..self.partner.loop_settings };
        let controller = Controller::new(self.table, &loop_settings.settings(self.table.validity.depth_end))?;
        let mut own = Own::in_run(&controller, self.table, &loop_settings)?;
        let mut blocks = Blocks::new(MeasuredLoop::Sweep, rate_hz, (SWEEP_S * rate_hz) as u64, &self.scheduling);
        blocks.block(|release| Ok(Stamps { answer: Some(own.step(release.tick)), exchanged_ns: None }))?;
        let FinishedBlocks { timing, more, ticks, .. } = blocks.finish();
        let outside = more.outside_run.iter().map(|timing| timing.deadline_misses).sum::<u64>();
        Ok(SweepResult { rate_hz, ticks, deadline_misses: timing.deadline_misses + outside })
    }

    /// Empty loop, controller, exchange, in turns.
    fn periodic(&self, result: &mut TimingResult) -> Result<(), SimError> {
        let Self { options, partner, .. } = self;
        let ticks = ((options.seconds * options.rate) as u64 / (3 * ROUNDS)).max(1);
        let [mut empty, mut loaded, mut exchange] =
            [MeasuredLoop::Empty, MeasuredLoop::Controller, MeasuredLoop::Exchange]
                .map(|measured| Blocks::new(measured, options.rate, ticks, &self.scheduling));
        let mut not_in_ledger = 0;
        for _ in 0..ROUNDS {
            empty.block(|_| Ok(Stamps::default()))?;
            let mut own = Own::in_run(self.controller, self.table, &partner.loop_settings)?;
            let mut started = 0;
            loaded.block(|release| {
                started = release.tick + 1;
                Ok(Stamps { answer: Some(own.step(release.tick)), exchanged_ns: None })
            })?;
            let (ledger, before) = own.ledger();
            not_in_ledger += ledger.unaccounted() + ledger.due.abs_diff(before + started);
            let mut running = Running::in_run(partner, Transport::Link)?;
            exchange.block(|release| running.release(release.tick))?;
        }
        result.lateness_ratios = ratios(&loaded.medians_ns, &empty.medians_ns);
        result.exchange_lateness_ratios = ratios(&exchange.medians_ns, &empty.medians_ns);
        let [empty, loaded, exchange] = [empty, loaded, exchange].map(Blocks::finish);
        result.ledger = TickResult { unaccounted: loaded.ticks.unaccounted + not_in_ledger, ..loaded.ticks };
        result.exchange_ledger = exchange.ticks;
        let timings = [&mut result.empty, &mut result.controller, &mut result.exchange];
        for (blocks, timing) in [empty, loaded, exchange].into_iter().zip(timings) {
            *timing = blocks.timing;
            result.blocks.push(blocks.more);
            result.left_run.extend(blocks.left_run);
        }
        Ok(())
    }

    /// Two readings of the clock with nothing between them, and with a step between them.
    fn back_to_back(&self, result: &mut TimingResult) -> Result<(), SimError> {
        let (mut clock, mut step) = (Durations::default(), Durations::default());
        let mut own = Own::in_run(self.controller, self.table, &self.partner.loop_settings)?;
        for tick in 0..STEPS {
            if tick.is_multiple_of(STEPS_PER_LOOK) {
                signals::check()?;
            }
            let start_ns = now_ns();
            clock.record(now_ns() - start_ns);
            let inputs = own.inputs(tick);
            let start_ns = now_ns();
            own.answer(&inputs);
            step.record(now_ns() - start_ns);
            if let Some(left) = LeftRun::found(MeasuredLoop::BackToBack, 1, tick, own.said()) {
                result.left_run.push(left);
                break;
            }
        }
        (result.clock, result.step) = (clock.distribution(), step.distribution());
        Ok(())
    }

    /// The exchange with both sides polling: link, bare, socket, in turns.
    fn polled(&self, result: &mut TimingResult) -> Result<(), SimError> {
        let transports = [Transport::Link, Transport::Bare, Transport::Socket];
        let mut all = transports.map(|_| Durations::default());
        let mut medians = transports.map(|_| Vec::new());
        for round in 1..=ROUNDS {
            for ((transport, all), medians) in transports.into_iter().zip(&mut all).zip(&mut medians) {
                let mut running = Running::in_run(&self.partner, transport)?;
                let mut own = Durations::default();
                let left_run = exchange_often(&mut running, round, |took_ns| {
                    own.record(took_ns);
                    all.record(took_ns);
                })?;
                medians.push(left_run.is_none().then(|| own.median_ns()));
                result.left_run.extend(left_run);
            }
        }
        let [link, bare, socket] = medians;
        result.link_over_bare = ratios(&link, &bare);
        result.socket_over_link = ratios(&socket, &link);
        result.polled = all.map(|durations| durations.distribution());
        Ok(())
    }
}

/// Exchanges back to back, while the controller at the other end stays in RUN.
fn exchange_often(
    running: &mut Running,
    round: u64,
    mut record: impl FnMut(u64),
) -> Result<Option<LeftRun>, RuntimeError> {
    // The first ones find cold caches on both sides.
    let cold = EXCHANGES / 10;
    for tick in 0..cold + EXCHANGES {
        if tick.is_multiple_of(STEPS_PER_LOOK) {
            signals::check()?;
        }
        let stamps = running.exchange(tick)?;
        if let Some(left) = stamps.answer.and_then(|answer| LeftRun::found(running.measured(), round, tick, answer)) {
            return Ok(Some(left));
        }
        if let (true, Some((start_ns, end_ns))) = (tick >= cold, stamps.exchanged_ns) {
            record(end_ns - start_ns);
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware::Mode;

    #[test]
    fn a_comparison_without_a_round_is_refused_and_one_round_is_enough() {
        let left = |round| LeftRun {
            measurement: MeasuredLoop::Exchange,
            round,
            tick: 3,
            mode: Some(Mode::Safe),
            faults: if round == 1 { Faults::OVERRUN } else { Faults::WATCHDOG },
        };
        let mut result = TimingResult {
            lateness_ratios: vec![1.1],
            exchange_lateness_ratios: vec![1.2],
            link_over_bare: vec![1.3],
            socket_over_link: vec![1.4],
            left_run: vec![left(1), left(2)],
            ..TimingResult::default()
        };
        assert_eq!(result.check_rounds(), Ok(()));
        result.exchange_lateness_ratios.clear();
        let faults = Faults::OVERRUN | Faults::WATCHDOG;
        let void = AllVoid { measured: MeasuredLoop::Exchange, rounds: ROUNDS, left_run: 2, faults };
        assert_eq!(result.check_rounds(), Err(void));
        type Ratios = fn(&mut TimingResult) -> &mut Vec<f64>;
        let others: [Ratios; 3] = [
            |result| &mut result.lateness_ratios,
            |result| &mut result.link_over_bare,
            |result| &mut result.socket_over_link,
        ];
        for take in others {
            let mut result = TimingResult { exchange_lateness_ratios: vec![1.2], ..result.clone() };
            take(&mut result).clear();
            assert!(result.check_rounds().is_err());
        }
    }
}
