//! The controller process: decodes a table, then does nothing but ticks and accounts.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use firmware::contract::{Table, decode};
use firmware::io::{SampleSource, run_tick};
use firmware::schedule::Schedule;
use firmware::{Controller, Faults, Mode, State};
use iceoryx2::service::{Service, ipc};

use crate::clock::{now_ns, release_real_time, request_real_time, sleep_until};
use crate::control::LoopArgs;
use crate::error::SimError;
use crate::handover::{Handover, SequenceSpan};
use crate::interrupt;
use crate::link::{ClockKind, ControllerPorts, Departure, LinkError, Space};
use crate::peer::{Patience, Peer};
use crate::recorder::{Exchange, RunMode};
use crate::result::{LoopTiming, TickResult};
use crate::statistics::LoopDurations;

/// Ticks in free-run between two looks at the parent and at signals.
const TICKS_PER_LOOK: u64 = 16;

/// Options of the controller process.
#[derive(clap::Args, Clone, Debug)]
pub struct ControllerArgs {
    /// Controller table, as `model-offline table` writes it
    #[arg(long, value_name = "FILE")]
    pub table: PathBuf,
    /// Name of the link in shared memory; the same on both sides
    #[arg(long, default_value = "by-hand", value_name = "NAME")]
    pub link: String,
    /// What drives time
    #[arg(long, value_enum, default_value_t = RunMode::Lockstep)]
    pub mode: RunMode,
    /// Rates, latency, noise.
    #[command(flatten)]
    pub loop_args: LoopArgs,
    /// Seconds of silence after which the plant is given up
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub patience: f64,
    /// Process id of the plant that started this: accounts go to stdout, for it to read
    #[arg(long, hide = true)]
    pub parent: Option<i32>,
    /// Ticks to keep room for
    #[arg(long, hide = true, default_value_t = 100_000)]
    pub capacity: usize,
}

/// Reads and validates a table file.
///
/// # Errors
/// [`SimError::Read`], [`SimError::Table`].
pub fn read_table(path: &Path) -> Result<(Table<f64, 2>, Vec<u8>), SimError> {
    let bytes = std::fs::read(path).map_err(|source| SimError::Read { path: path.to_owned(), source })?;
    let table = decode(&bytes).map_err(|source| SimError::Table { path: path.to_owned(), source })?;
    Ok((table, bytes))
}

/// Runs the controller until the plant says stop. Leaves nothing behind in shared memory, however it ends.
///
/// # Errors
/// [`SimError`].
pub fn serve(args: &ControllerArgs) -> Result<(), SimError> {
    interrupt::install();
    args.loop_args.check()?;
    crate::control::positive("--patience", args.patience)?;
    let (table, _) = read_table(&args.table)?;
    let settings = args.loop_args.settings(table.validity.depth_end);
    let controller = Controller::new(&table, &settings)?;
    let space = Space::new(&args.link)?;
    let outcome = serve_in(&controller, &space, args);
    space.leave::<ipc::Service>(Departure::First);
    let (handover, exchanges) = outcome?;
    if args.parent.is_some() {
        let said = std::io::stdout().write_all(&handover.encode(&exchanges));
        said.map_err(|source| SimError::Write { path: "standard output".into(), source })?;
    } else {
        println!(
            "{} ticks, {} commands, final state {}, faults seen: {}",
            handover.ticks.due, handover.commands, handover.final_state, handover.faults
        );
    }
    Ok(())
}

fn serve_in(
    controller: &Controller<'_, f64>,
    space: &Space,
    args: &ControllerArgs,
) -> Result<(Handover, Vec<Exchange>), SimError> {
    let parent = args.parent.and_then(rustix::process::Pid::from_raw);
    let mut peer = parent.map_or_else(|| Peer::Elsewhere(Box::new(space.clone()), "plant"), Peer::Parent);
    let timeout = Duration::from_secs_f64(args.patience);
    let mut ports = ControllerPorts::<ipc::Service>::open(space)?;
    let mut patience = Patience::new(timeout);
    while !ports.has_peer() {
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let mut session = Session::new(controller, args.capacity);
    match args.mode {
        RunMode::Lockstep => session.lockstep(&mut ports, &mut peer, timeout)?,
        RunMode::FreeRun => session.free_run(&mut ports, &mut peer, timeout, &args.loop_args)?,
    }
    Ok(session.end(&mut ports))
}

/// A controller at work.
#[derive(Debug)]
pub struct Session<'c> {
    controller: &'c Controller<'c, f64>,
    state: State<f64>,
    exchanges: Vec<Exchange>,
    exchanges_lost: u64,
    faults: Faults,
    spans: [SequenceSpan; 3],
    /// In free-run the schedule knows better than the ticks that happened.
    scheduled: Option<(u64, u64)>,
    timing: Option<LoopTiming>,
}

impl<'c> Session<'c> {
    /// A controller before its first tick, with room for the record of `capacity` ticks.
    pub fn new(controller: &'c Controller<'c, f64>, capacity: usize) -> Self {
        Self {
            controller,
            state: State::new(),
            exchanges: Vec::with_capacity(capacity),
            exchanges_lost: 0,
            faults: Faults::NONE,
            spans: [SequenceSpan::default(); 3],
            scheduled: None,
            timing: None,
        }
    }

    /// Answers every step of the plant until it says stop.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn lockstep<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        peer: &mut Peer,
        timeout: Duration,
    ) -> Result<(), SimError> {
        let mut patience = Patience::new(timeout);
        loop {
            let Some(frame) = ports.clock.oldest()? else {
                patience.wait::<S>(peer)?;
                continue;
            };
            patience = Patience::new(timeout);
            interrupt::check()?;
            match frame.kind() {
                Some(ClockKind::Step) => self.tick(ports, frame.tick, frame.time_ns)?,
                Some(ClockKind::Stop) => return Ok(()),
                Some(ClockKind::Start) | None => {
                    return Err(SimError::Protocol {
                        peer: "plant",
                        what: format!("clock frame of kind {} in lockstep", frame.kind),
                    });
                }
            }
        }
    }

    /// Runs on the machine's clock, half a period after the plant, until it says stop.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn free_run<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        peer: &mut Peer,
        timeout: Duration,
        loop_args: &LoopArgs,
    ) -> Result<(), SimError> {
        let mut patience = Patience::new(timeout);
        let start = loop {
            match ports.clock.oldest()? {
                Some(frame) if frame.kind() == Some(ClockKind::Start) => break frame.time_ns,
                Some(frame) => {
                    return Err(SimError::Protocol {
                        peer: "plant",
                        what: format!("clock frame of kind {} instead of a start", frame.kind),
                    });
                }
                None => patience.wait::<S>(peer)?,
            }
        };
        let period_ns = loop_args.period_ns();
        let first_release_ns = start + period_ns / 2;
        let mut schedule = Schedule::new(first_release_ns, period_ns);
        let mut durations = LoopDurations::default();
        let scheduling = request_real_time();
        let outcome = self.timed_ticks(ports, peer, &mut schedule, &mut durations);
        release_real_time();
        let due = (schedule.next_release_ns() - first_release_ns) / period_ns;
        self.scheduled = Some((due, schedule.skipped()));
        self.timing = Some(durations.timing(loop_args.rate, &schedule, &scheduling));
        outcome
    }

    fn timed_ticks<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        peer: &mut Peer,
        schedule: &mut Schedule,
        durations: &mut LoopDurations,
    ) -> Result<(), SimError> {
        loop {
            sleep_until(schedule.next_release_ns());
            if let Some(frame) = ports.clock.oldest()?
                && frame.kind() == Some(ClockKind::Stop)
            {
                return Ok(());
            }
            let start_ns = now_ns();
            let release = schedule.begin(start_ns);
            self.tick(ports, release.tick, start_ns)?;
            let end_ns = now_ns();
            schedule.finish(end_ns);
            durations.record(release.release_ns, start_ns, end_ns);
            if release.tick.is_multiple_of(TICKS_PER_LOOK) {
                interrupt::check()?;
                peer.check::<S>()?;
            }
        }
    }

    fn tick<S: Service>(&mut self, ports: &mut ControllerPorts<S>, tick: u64, time_ns: u64) -> Result<(), LinkError> {
        let (inputs, command) = run_tick(self.controller, &mut self.state, tick, time_ns, ports)?;
        let sequences = [
            inputs.needle.map(|sample| sample.sequence),
            inputs.target.map(|sample| sample.sequence),
            inputs.paddle.map(|sample| sample.sequence),
        ];
        for (span, sequence) in self.spans.iter_mut().zip(sequences) {
            if let Some(sequence) = sequence {
                span.see(sequence);
            }
        }
        self.faults |= self.state.faults();
        // Growing would allocate in the loop.
        if self.exchanges.len() < self.exchanges.capacity() {
            self.exchanges.push(Exchange { inputs, command });
        } else {
            self.exchanges_lost += 1;
        }
        Ok(())
    }

    /// Closes the accounts, with what still waits in the buffers.
    pub fn end<S: Service>(self, ports: &mut ControllerPorts<S>) -> (Handover, Vec<Exchange>) {
        let ledger = self.state.ledger();
        let [needle, target, paddle] = self.spans;
        let waiting = (ports.needle(), ports.target(), ports.paddle());
        let ticks = &ledger.ticks;
        let (due, skipped) = self.scheduled.unwrap_or((ticks.due, ticks.skipped));
        let entries = ticks.run + ticks.hold + ticks.safe + skipped;
        let handover = Handover {
            needle: needle.account(&ledger.needle, waiting.0.map(|sample| sample.sequence)),
            target: target.account(&ledger.target, waiting.1.map(|sample| sample.sequence)),
            paddle: paddle.account(&ledger.paddle, waiting.2.map(|sample| sample.sequence)),
            ticks: TickResult {
                due,
                run: ticks.run,
                hold: ticks.hold,
                safe: ticks.safe,
                skipped,
                unaccounted: due.abs_diff(entries) + ticks.unaccounted(),
            },
            commands: ports.command.published(),
            final_state: mode_name(self.state.mode()).to_owned(),
            faults: self.faults.to_string(),
            timing: self.timing,
            exchanges: self.exchanges.len() as u64,
            exchanges_lost: self.exchanges_lost,
        };
        (handover, self.exchanges)
    }
}

/// Name of a state, as reports show it.
pub const fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Run => "RUN",
        Mode::Hold => "HOLD",
        Mode::Safe => "SAFE",
    }
}
