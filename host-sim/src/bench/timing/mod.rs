//! Timing of the fixed-rate loop and of the exchange with it, with something to compare with in the same run.
//!
//! Wake-up tails on a shared machine describe the machine. So an empty loop, the controller's loop and a loop that
//! exchanges samples with a controller process take turns, block by block, and the ratio of their medians says what
//! they add. Everything is measured from the *scheduled* release. The exchange by itself, with both sides polling, takes
//! turns with a bare ping-pong of iceoryx2 and with the same exchange over a Unix socket.

mod blocks;
mod exchange;
pub mod machine;
pub mod peer;
mod print;
mod stimulus;

use std::path::PathBuf;

use clap::Args;
use firmware::contract::{PaddleCommand, Table};
use firmware::{Controller, Inputs, State};
use model_offline::table::to_bytes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::blocks::BlockResult;
use self::blocks::{Blocks, ratios};
use self::exchange::{Partner, Running};
use self::machine::{Disturbance, pin, unpin};
use self::peer::Exchange;
use self::stimulus::Stimulus;
use crate::bench::result::{Distribution, LoopTiming, TickResult};
use crate::error::SimError;
use crate::report;
use crate::report::directory as output;
use crate::runtime::clock::{FIFO_PRIORITY, Scheduling, now_ns, release_real_time, request_real_time_at};
use crate::runtime::durations::Durations;
use crate::runtime::signals;
use crate::world::loop_settings::{LoopArgs, positive};

/// Rounds of blocks: enough for a range of ratios.
const ROUNDS: u64 = 5;
/// Steps back to back, and exchanges per block with both sides polling: 0.05 to 0.3 s, so that a kernel that limits
/// real-time threads to 95 % of each second never steps in.
const STEPS: u64 = 200_000;
const EXCHANGES: u64 = 20_000;
/// Rates of the sweep, Hz, and how long each, s.
const SWEEP_HZ: [f64; 7] = [100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0];
const SWEEP_S: f64 = 2.0;

/// Options of `timing`.
#[derive(Args, Clone, Debug)]
pub struct TimingArgs {
    /// Rate of the loop, Hz
    #[arg(long, default_value_t = 1000.0, value_name = "HZ")]
    pub rate: f64,
    /// Duration of the periodic measurement, s
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    pub seconds: f64,
    /// Processor of the loop; the controller process stays on the next one [default: left to the kernel]
    #[arg(long, value_name = "N")]
    pub cpu: Option<usize>,
    /// Real-time priority to ask for, 1 to 99; 0: the ordinary policy
    #[arg(long, default_value_t = FIFO_PRIORITY, value_name = "P", value_parser = clap::value_parser!(u8).range(0..=99))]
    pub priority: u8,
    /// Also find the highest rate at which no deadline is missed
    #[arg(long)]
    pub sweep: bool,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write timing.json and histograms into this directory
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
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

/// Measures and prints.
///
/// # Errors
/// [`SimError`].
pub fn timing(args: &TimingArgs) -> Result<TimingResult, SimError> {
    signals::install();
    positive("--rate", args.rate)?;
    positive("--seconds", args.seconds)?;
    if let Some(directory) = &args.out {
        std::fs::create_dir_all(directory).map_err(|source| SimError::Write { path: directory.clone(), source })?;
    }
    let table = crate::bench::faults::fixture()?;
    let folder = tempfile::tempdir().map_err(SimError::Spawn)?;
    let table_file = folder.path().join("controller.table");
    std::fs::write(&table_file, to_bytes(&table)?)
        .map_err(|source| SimError::Write { path: table_file.clone(), source })?;
    let loop_args = LoopArgs { rate: args.rate, target_rate: f64::min(50.0, args.rate), latency: 20.0, noise: None };
    let controller = Controller::new(&table, &loop_args.settings(table.validity.depth_end))?;
    let partner = Partner {
        program: std::env::current_exe().map_err(SimError::Spawn)?,
        table: &table,
        table_file,
        loop_args,
        cpu: args.cpu.map(|cpu| cpu + 1),
        priority: args.priority,
    };

    let before = Disturbance::now();
    let pinned = args.cpu.is_some_and(pin);
    let scheduling = request_real_time_at(args.priority);
    let outcome = measure(args, &table, &controller, &partner, &scheduling);
    release_real_time();
    unpin();
    let mut result = outcome?;
    result.pinned = pinned;
    result.steal_ms = Disturbance::now().since(&before).steal_ms;
    print::print(&result, args.priority);
    write(args, &result)?;
    Ok(result)
}

fn write(args: &TimingArgs, result: &TimingResult) -> Result<(), SimError> {
    if let Some(directory) = &args.out {
        output::write_json(&directory.join("timing.json"), result)?;
        let loops =
            [("empty loop", &result.empty), ("controller's loop", &result.controller), ("exchange", &result.exchange)];
        output::write_text(&directory.join("timing.svg"), &report::timing_histograms(&loops))?;
    }
    args.json.as_ref().map_or(Ok(()), |path| output::write_json(path, result))
}

fn measure(
    args: &TimingArgs,
    table: &Table<f64, 2>,
    controller: &Controller<'_, f64>,
    partner: &Partner<'_>,
    scheduling: &Scheduling,
) -> Result<TimingResult, SimError> {
    let mut result = TimingResult::default();
    periodic(args, table, controller, partner, scheduling, &mut result)?;
    (result.clock, result.step) = back_to_back(table, controller, &partner.loop_args);
    polled(partner, &mut result)?;
    if args.sweep {
        for rate in SWEEP_HZ {
            let loop_args = LoopArgs { rate, ..partner.loop_args };
            let mut own = Own::new(table, &loop_args);
            let controller = Controller::new(table, &loop_args.settings(table.validity.depth_end))?;
            let mut blocks = Blocks::new(rate, (SWEEP_S * rate) as u64, scheduling);
            blocks.block(|tick, time_ns| own.step(&controller, tick, time_ns))?;
            let (timing, _) = blocks.finish();
            result.sweep.push((rate, timing.ticks, timing.deadline_misses, timing.skipped));
        }
    }
    Ok(result)
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
    fn new(table: &Table<f64, 2>, loop_args: &LoopArgs) -> Self {
        let stimulus = Stimulus::new(table, loop_args);
        Self { stimulus, state: State::new(), command: PaddleCommand::default(), offset: 0, next: 0 }
    }

    /// A new block starts: numbers go on.
    fn start_block(&mut self) {
        self.offset = self.next;
    }

    /// The release `tick` of the block: skipped ones are in the ledger.
    fn step(&mut self, controller: &Controller<'_, f64>, tick: u64, time_ns: u64) -> Result<blocks::Stamps, SimError> {
        let samples = self.stimulus.samples(time_ns, self.command.displacement);
        let inputs = Inputs {
            tick: self.offset + tick,
            time_ns,
            needle: Some(samples.needle),
            target: samples.target,
            paddle: Some(samples.paddle),
        };
        self.next = inputs.tick + 1;
        self.command = controller.step(&mut self.state, std::hint::black_box(&inputs));
        std::hint::black_box(&self.command);
        Ok(None)
    }
}

/// Empty loop, controller, exchange, in turns.
fn periodic(
    args: &TimingArgs,
    table: &Table<f64, 2>,
    controller: &Controller<'_, f64>,
    partner: &Partner<'_>,
    scheduling: &Scheduling,
    result: &mut TimingResult,
) -> Result<(), SimError> {
    let ticks = ((args.seconds * args.rate) as u64 / (3 * ROUNDS)).max(1);
    let [mut empty, mut loaded, mut exchange] = [(); 3].map(|()| Blocks::new(args.rate, ticks, scheduling));
    let mut own = Own::new(table, &partner.loop_args);
    for _ in 0..ROUNDS {
        empty.block(|_, _| Ok(None))?;
        own.start_block();
        loaded.block(|tick, time_ns| own.step(controller, tick, time_ns))?;
        let mut running = Running::start(partner, Exchange::Link)?;
        exchange.block(|_, _| running.once().map(Some))?;
    }
    result.lateness_ratios = ratios(&loaded.medians_ns, &empty.medians_ns);
    result.exchange_lateness_ratios = ratios(&exchange.medians_ns, &empty.medians_ns);
    let ledger = own.state.ledger().ticks;
    // Periods skipped after the last tick of a block are in the schedule only: no tick has come to tell the controller.
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
    let more;
    (result.empty, more) = empty.finish();
    result.blocks.push(more);
    let more;
    (result.controller, more) = loaded.finish();
    result.blocks.push(more);
    let more;
    (result.exchange, more) = exchange.finish();
    result.blocks.push(more);
    Ok(())
}

/// Two readings of the clock with nothing between them, and with a step between them.
fn back_to_back(
    table: &Table<f64, 2>,
    controller: &Controller<'_, f64>,
    loop_args: &LoopArgs,
) -> (Distribution, Distribution) {
    let (mut clock, mut step) = (Durations::default(), Durations::default());
    let mut own = Own::new(table, loop_args);
    for tick in 0..STEPS {
        let start_ns = now_ns();
        clock.record(now_ns() - start_ns);
        let samples = own.stimulus.samples(tick * loop_args.period_ns(), own.command.displacement);
        let inputs = Inputs {
            tick,
            time_ns: tick * loop_args.period_ns(),
            needle: Some(samples.needle),
            target: samples.target,
            paddle: Some(samples.paddle),
        };
        let start_ns = now_ns();
        own.command = controller.step(&mut own.state, std::hint::black_box(&inputs));
        std::hint::black_box(&own.command);
        step.record(now_ns() - start_ns);
    }
    (clock.distribution(), step.distribution())
}

/// The exchange with both sides polling: link, bare, socket, in turns.
fn polled(partner: &Partner<'_>, result: &mut TimingResult) -> Result<(), SimError> {
    let kinds = [Exchange::Link, Exchange::Bare, Exchange::Socket];
    let mut all = kinds.map(|_| Durations::default());
    let mut medians = kinds.map(|_| Vec::new());
    for _ in 0..ROUNDS {
        for ((kind, all), medians) in kinds.into_iter().zip(&mut all).zip(&mut medians) {
            signals::check()?;
            let mut running = Running::start(partner, kind)?;
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
