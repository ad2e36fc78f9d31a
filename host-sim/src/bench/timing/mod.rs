//! Timing of the fixed-rate loop and of the exchange with it, with something to compare with in the same run.
//!
//! Wake-up tails on a shared machine describe the machine. So an empty loop, the controller's loop and a loop that
//! exchanges samples with a controller process take turns, block by block, and the ratio of their medians says what
//! they add. Everything is measured from the *scheduled* release. The exchange by itself, with both sides polling, takes
//! turns with a bare ping-pong of iceoryx2 and with the same exchange over a Unix socket.

mod blocks;
pub mod machine;
mod partner;
pub mod peer;
mod stimulus;

use std::path::PathBuf;

use firmware::contract::{PaddleCommand, Table};
use firmware::{Controller, Inputs, State};
use model_offline::table::to_bytes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::blocks::BlockResult;
use self::blocks::{Blocks, ratios};
use self::machine::{Disturbance, pin, unpin};
use self::partner::{Partner, Running};
use self::peer::Transport;
use self::stimulus::Stimulus;
use super::error::SimError;
use super::paper_table::paper_table;
use crate::record::error::FileError;
use crate::runtime::clock::{Scheduling, now_ns, release_real_time, request_real_time_at};
use crate::runtime::durations::{Distribution, Durations, LoopTiming};
use crate::runtime::error::RuntimeError;
use crate::runtime::ledger::TickResult;
use crate::runtime::signals;
use crate::world::loop_settings::LoopSettings;

/// Rounds of blocks: enough for a range of ratios.
const ROUNDS: u64 = 5;
/// Steps back to back, and exchanges per block with both sides polling: 0.05 to 0.3 s, so that a kernel that limits
/// real-time threads to 95 % of each second never steps in.
const STEPS: u64 = 200_000;
const EXCHANGES: u64 = 20_000;
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
    /// The loop with the controller's step.
    pub controller: LoopTiming,
    /// The loop that publishes samples and waits for the command of a controller process.
    pub exchange: LoopTiming,
    /// Median lateness of the controller's loop over that of the empty loop, block by block.
    pub lateness_ratios: Vec<f64>,
    /// The same for the loop with the exchange.
    pub exchange_lateness_ratios: Vec<f64>,
    /// More about these loops, in this order.
    pub blocks: Vec<BlockResult>,
    /// Ticks of the controller's ledger over all blocks.
    pub ledger: TickResult,
    /// The controller's step back to back: warm caches, no sleep before it.
    pub step: Distribution,
    /// Reading the clock twice, back to back.
    pub clock: Distribution,
    /// Sample published to command received with both sides polling: the link, bare iceoryx2, a Unix socket.
    pub polled: [Distribution; 3],
    /// Median of the link over that of bare iceoryx2, block by block.
    pub link_over_bare: Vec<f64>,
    /// Median of the Unix socket over that of the link, block by block.
    pub socket_over_link: Vec<f64>,
    /// Rates of the sweep, Hz, with ticks, deadline misses and periods skipped.
    pub sweep: Vec<(f64, u64, u64, u64)>,
    /// Time that the host took away from this machine, all processors, ms; none where the kernel does not say.
    pub steal_ms: Option<u64>,
    /// Whether threads stay on the processors that were asked for.
    pub pinned: bool,
}

/// Settings of a loop at this rate: both processes of an exchange need the same.
pub fn loop_settings(rate: f64) -> LoopSettings {
    LoopSettings { rate, target_rate: f64::min(50.0, rate), latency: 20.0, noise: None }
}

/// Measures.
///
/// # Errors
/// [`SimError`].
pub fn timing(options: &TimingOptions) -> Result<TimingResult, SimError> {
    let table = paper_table()?;
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
    let measurement = Measurement { options, table: &table, controller: &controller, partner, scheduling };
    let outcome = measurement.measure();
    release_real_time();
    unpin();
    let mut result = outcome?;
    result.pinned = pinned;
    result.steal_ms = Disturbance::now().since(&before).steal_ms;
    Ok(result)
}

/// Everything that the measurements share.
struct Measurement<'t> {
    options: &'t TimingOptions,
    table: &'t Table<f64, 2>,
    controller: &'t Controller<'t, f64>,
    partner: Partner<'t>,
    scheduling: Scheduling,
}

/// A controller in this thread, with its samples.
struct Own {
    stimulus: Stimulus,
    state: State<f64>,
    command: PaddleCommand,
    /// Number of the first tick of this block: the ledger counts over all blocks.
    offset: u64,
    next: u64,
}

impl Own {
    fn new(table: &Table<f64, 2>, loop_settings: &LoopSettings) -> Self {
        let stimulus = Stimulus::new(table, loop_settings);
        Self { stimulus, state: State::new(), command: PaddleCommand::default(), offset: 0, next: 0 }
    }

    /// A new block starts: numbers go on.
    fn start_block(&mut self) {
        self.offset = self.next;
    }

    /// What arrives for this tick.
    fn inputs(&mut self, tick: u64, time_ns: u64) -> Inputs {
        let samples = self.stimulus.samples(time_ns, self.command.displacement);
        Inputs { tick, time_ns, needle: Some(samples.needle), target: samples.target, paddle: Some(samples.paddle) }
    }

    fn answer(&mut self, controller: &Controller<'_, f64>, inputs: &Inputs) {
        self.command = controller.step(&mut self.state, std::hint::black_box(inputs));
        std::hint::black_box(&self.command);
    }

    /// The release `tick` of the block: skipped ones are in the ledger.
    fn step(&mut self, controller: &Controller<'_, f64>, tick: u64, time_ns: u64) -> blocks::Stamps {
        let inputs = self.inputs(self.offset + tick, time_ns);
        self.next = inputs.tick + 1;
        self.answer(controller, &inputs);
        None
    }
}

impl Measurement<'_> {
    fn measure(&self) -> Result<TimingResult, SimError> {
        let mut result = TimingResult::default();
        self.periodic(&mut result)?;
        (result.clock, result.step) = self.back_to_back();
        self.polled(&mut result)?;
        if self.options.sweep {
            result.sweep = SWEEP_HZ.into_iter().map(|rate| self.sweep(rate)).collect::<Result<_, _>>()?;
        }
        Ok(result)
    }

    /// One rate of the sweep: with ticks, deadline misses and periods skipped.
    fn sweep(&self, rate: f64) -> Result<(f64, u64, u64, u64), SimError> {
        let loop_settings = LoopSettings { rate, ..self.partner.loop_settings };
        let mut own = Own::new(self.table, &loop_settings);
        let controller = Controller::new(self.table, &loop_settings.settings(self.table.validity.depth_end))?;
        let mut blocks = Blocks::new(rate, (SWEEP_S * rate) as u64, &self.scheduling);
        blocks.block(|tick, time_ns| Ok(own.step(&controller, tick, time_ns)))?;
        let (timing, _) = blocks.finish();
        Ok((rate, timing.ticks, timing.deadline_misses, timing.skipped))
    }

    /// Empty loop, controller, exchange, in turns.
    fn periodic(&self, result: &mut TimingResult) -> Result<(), SimError> {
        let Self { options, partner, .. } = self;
        let ticks = ((options.seconds * options.rate) as u64 / (3 * ROUNDS)).max(1);
        let [mut empty, mut loaded, mut exchange] =
            [(); 3].map(|()| Blocks::new(options.rate, ticks, &self.scheduling));
        let mut own = Own::new(self.table, &partner.loop_settings);
        for _ in 0..ROUNDS {
            empty.block(|_, _| Ok(None))?;
            own.start_block();
            loaded.block(|tick, time_ns| Ok(own.step(self.controller, tick, time_ns)))?;
            let mut running = Running::start(partner, Transport::Link)?;
            exchange.block(|_, _| running.once().map(Some))?;
        }
        result.lateness_ratios = ratios(&loaded.medians_ns, &empty.medians_ns);
        result.exchange_lateness_ratios = ratios(&exchange.medians_ns, &empty.medians_ns);
        let ledger = own.state.ledger().ticks;
        // Periods skipped after the last tick of a block are in the schedule only: no tick has come to tell the
        // controller.
        let skipped = loaded.skipped();
        let told = ROUNDS * ticks + ledger.skipped;
        result.ledger = TickResult {
            due: ROUNDS * ticks + skipped,
            run: ledger.run,
            hold: ledger.hold,
            safe: ledger.safe,
            skipped,
            unaccounted: ledger.unaccounted() + ledger.due.abs_diff(told),
        };
        let timings = [&mut result.empty, &mut result.controller, &mut result.exchange];
        for (blocks, timing) in [empty, loaded, exchange].into_iter().zip(timings) {
            let more;
            (*timing, more) = blocks.finish();
            result.blocks.push(more);
        }
        Ok(())
    }

    /// Two readings of the clock with nothing between them, and with a step between them.
    fn back_to_back(&self) -> (Distribution, Distribution) {
        let (mut clock, mut step) = (Durations::default(), Durations::default());
        let loop_settings = &self.partner.loop_settings;
        let mut own = Own::new(self.table, loop_settings);
        for tick in 0..STEPS {
            let start_ns = now_ns();
            clock.record(now_ns() - start_ns);
            let inputs = own.inputs(tick, tick * loop_settings.period_ns());
            let start_ns = now_ns();
            own.answer(self.controller, &inputs);
            step.record(now_ns() - start_ns);
        }
        (clock.distribution(), step.distribution())
    }

    /// The exchange with both sides polling: link, bare, socket, in turns.
    fn polled(&self, result: &mut TimingResult) -> Result<(), SimError> {
        let transports = [Transport::Link, Transport::Bare, Transport::Socket];
        let mut all = transports.map(|_| Durations::default());
        let mut medians = transports.map(|_| Vec::new());
        for _ in 0..ROUNDS {
            for ((transport, all), medians) in transports.into_iter().zip(&mut all).zip(&mut medians) {
                signals::check()?;
                let mut running = Running::start(&self.partner, transport)?;
                let mut own = Durations::default();
                // The first ones find cold caches on both sides.
                for _ in 0..EXCHANGES / 10 {
                    running.once()?;
                }
                for _ in 0..EXCHANGES {
                    let (start_ns, end_ns) = running.once()?;
                    own.record(end_ns - start_ns);
                    all.record(end_ns - start_ns);
                }
                medians.push(Some(own.median_ns()));
            }
        }
        let [link, bare, socket] = medians;
        result.link_over_bare = ratios(&link, &bare);
        result.socket_over_link = ratios(&socket, &link);
        result.polled = all.map(|durations| durations.distribution());
        Ok(())
    }
}
