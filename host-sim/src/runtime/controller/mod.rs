//! The controller's side of the loop: ticks, watchdog, accounts.

pub mod process;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use firmware::contract::PaddleCommand;
use firmware::contract::frames::MAX_PADDLES;
use firmware::io::{CommandSink, SampleSource};
use firmware::{Faults, Inputs, Mode};
use iceoryx2::service::Service;

use super::accounting::accounts::{ControllerAccounts, RecordAccount, SequenceSpan};
use super::accounting::ledger::TickResult;
use super::accounting::tick::ControllerTick;
use super::error::{Role, RuntimeError};
use super::executor::StepExecutor;
use super::peer::{Patience, Peer};
use super::signals;
use super::time::clock::{now_ns, release_real_time, request_real_time};
use super::time::durations::{LoopDurations, LoopTiming};
use super::time::periodic::PeriodicLoop;
use crate::exchange::{ClockKind, ControllerPorts, LinkError};
use crate::world::loop_settings::LoopSettings;

/// Keeps every tick while it happens.
pub trait TickRecorder {
    /// Takes a tick; neither waits nor allocates.
    fn record(&mut self, tick: &ControllerTick);

    /// Writes what waits, and says what became of everything.
    fn finish(self: Box<Self>) -> RecordAccount;
}

/// Time in free-run between two looks at the plant, ns.
const BETWEEN_LOOKS_NS: u64 = 16_000_000;
/// Ticks that an orphaned controller stays in SAFE before it leaves: whoever watches the commands has seen it then.
const TICKS_IN_SAFE: u64 = 20;

/// A controller at work.
pub struct ControlLoop<'c> {
    executor: Box<dyn StepExecutor + 'c>,
    kept: Vec<ControllerTick>,
    not_kept: u64,
    faults: Faults,
    /// Of the needle, the target, and each paddle.
    spans: [SequenceSpan; 2 + MAX_PADDLES],
    /// In free-run the schedule knows better than the ticks that happened.
    scheduled: Option<(u64, u64)>,
    timing: Option<LoopTiming>,
    /// Ticks by the mode of their command: HOLD, RUN, SAFE.
    modes: [u64; 3],
    /// Last command, and whether the watchdog has taken over since.
    last: PaddleCommand,
    tripped: bool,
    /// Where every tick is recorded while it happens.
    recorder: Option<Box<dyn TickRecorder>>,
    /// Where somebody who has looked asks for a re-arming.
    rearming: Arc<AtomicBool>,
    /// Tick with a panic on purpose.
    panic_at: Option<u64>,
}

impl std::fmt::Debug for ControlLoop<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ControlLoop").field("kept", &self.kept.len()).finish_non_exhaustive()
    }
}

impl<'c> ControlLoop<'c> {
    /// A controller before its first tick, with room for the record of `capacity` ticks.
    pub fn new(executor: Box<dyn StepExecutor + 'c>, capacity: usize) -> Self {
        Self {
            executor,
            kept: Vec::with_capacity(capacity),
            not_kept: 0,
            faults: Faults::NONE,
            spans: [SequenceSpan::default(); 2 + MAX_PADDLES],
            scheduled: None,
            timing: None,
            modes: [0; 3],
            last: PaddleCommand::default(),
            tripped: false,
            recorder: None,
            rearming: Arc::default(),
            panic_at: None,
        }
    }

    /// Has every tick recorded while it happens.
    #[must_use]
    pub fn recorded_by(mut self, recorder: Box<dyn TickRecorder>) -> Self {
        self.recorder = Some(recorder);
        self
    }

    /// Re-arms a controller in SAFE before the tick that finds this set; in any other mode nothing happens.
    #[must_use]
    pub fn rearmed_by(mut self, asked: Arc<AtomicBool>) -> Self {
        self.rearming = asked;
        self
    }

    /// Panics on purpose in this tick, to see the watchdog.
    #[must_use]
    pub fn with_panic_at(mut self, tick: u64) -> Self {
        self.panic_at = Some(tick);
        self
    }

    /// Answers every step of the plant until it says stop.
    ///
    /// # Errors
    /// [`RuntimeError`].
    pub fn lockstep<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        peer: &mut Peer,
        timeout: Duration,
    ) -> Result<(), RuntimeError> {
        let mut patience = Patience::new(timeout);
        loop {
            let Some(frame) = ports.clock.oldest()? else {
                patience.wait::<S>(peer)?;
                continue;
            };
            patience = Patience::new(timeout);
            signals::check()?;
            match frame.kind() {
                Some(ClockKind::Step) => self.tick(ports, frame.tick, frame.time_ns)?,
                Some(ClockKind::Stop) => return Ok(()),
                Some(ClockKind::Start) => {
                    let what = "it is in free-run, this controller in lockstep: give both the same --mode".to_owned();
                    return Err(RuntimeError::Protocol { peer: Role::Plant, what });
                }
                None => {
                    let what = format!("clock frame of kind {} in lockstep", frame.kind);
                    return Err(RuntimeError::Protocol { peer: Role::Plant, what });
                }
            }
        }
    }

    /// Runs on the machine's clock, half a period after the plant, until it says stop.
    ///
    /// # Errors
    /// [`RuntimeError`].
    pub fn free_run<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        peer: &mut Peer,
        timeout: Duration,
        loop_settings: &LoopSettings,
    ) -> Result<(), RuntimeError> {
        let mut patience = Patience::new(timeout);
        let start = loop {
            match ports.clock.oldest()? {
                Some(frame) if frame.kind() == Some(ClockKind::Start) => break frame.time_ns,
                // Nothing has begun: a bridge that is told to end before its rig comes.
                Some(frame) if frame.kind() == Some(ClockKind::Stop) => return Ok(()),
                Some(frame) if frame.kind() == Some(ClockKind::Step) => {
                    let what = "it is in lockstep, this controller in free-run: give both the same --mode".to_owned();
                    return Err(RuntimeError::Protocol { peer: Role::Plant, what });
                }
                Some(frame) => {
                    let what = format!("clock frame of kind {} instead of a start", frame.kind);
                    return Err(RuntimeError::Protocol { peer: Role::Plant, what });
                }
                None => patience.wait::<S>(peer)?,
            }
        };
        let period_ns = loop_settings.period_ns();
        let ahead_ns = start.saturating_sub(now_ns());
        if u128::from(ahead_ns) > timeout.as_nanos() {
            let what = format!("a start {:.1} s ahead, longer than --patience", ahead_ns as f64 * 1e-9);
            return Err(RuntimeError::Protocol { peer: Role::Plant, what });
        }
        let mut periodic = PeriodicLoop::new(start.saturating_add(period_ns / 2), period_ns);
        let mut durations = LoopDurations::default();
        let scheduling = request_real_time();
        let outcome = self.timed_ticks(ports, peer, &mut periodic, &mut durations);
        release_real_time();
        self.scheduled = Some((periodic.due(), periodic.skipped()));
        self.timing = Some(durations.timing(loop_settings.rate, &periodic, &scheduling));
        outcome
    }

    fn timed_ticks<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        peer: &mut Peer,
        periodic: &mut PeriodicLoop,
        durations: &mut LoopDurations,
    ) -> Result<(), RuntimeError> {
        let mut orphaned: Option<(RuntimeError, u64)> = None;
        let mut next_look_ns = periodic.next_release_ns();
        loop {
            periodic.wait()?;
            if let Some(frame) = ports.clock.oldest()?
                && frame.kind() == Some(ClockKind::Stop)
            {
                return Ok(());
            }
            let release = periodic.begin();
            self.tick(ports, release.tick, periodic.start_ns())?;
            durations.record(&periodic.finish());
            match &orphaned {
                None if release.release_ns >= next_look_ns => {
                    next_look_ns = release.release_ns + BETWEEN_LOOKS_NS;
                    // In RUN the samples are fresh: the plant lives.
                    if self.last.state != Mode::Run as u32 {
                        let alive = peer.check::<S>().and_then(|()| {
                            let left = RuntimeError::PeerDied {
                                peer: Role::Plant,
                                how: "it has left without a word".to_owned(),
                            };
                            if ports.has_peer() { Ok(()) } else { Err(left) }
                        });
                        orphaned = alive.err().map(|error| (error, release.tick));
                    }
                }
                None => {}
                // Without a plant the ages lead to SAFE. Before the first RUN there is nothing to make safe.
                Some((_, since)) => {
                    let safe_for = if self.last.state == Mode::Safe as u32 { release.tick - since } else { 0 };
                    let was_armed = self.modes[Mode::Run as usize - 1] > 0;
                    if let Some((error, _)) = orphaned.take_if(|_| safe_for >= TICKS_IN_SAFE || !was_armed) {
                        return Err(error);
                    }
                }
            }
        }
    }

    fn tick<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        tick: u64,
        time_ns: u64,
    ) -> Result<(), RuntimeError> {
        let stepped = if self.tripped {
            None
        } else {
            // A panic in the step must not end the commands: the paddle's owner hears SAFE from then on.
            let step = || {
                assert!(self.panic_at.is_none_or(|at| tick < at), "panic on purpose in tick {tick}");
                let asked = self.rearming.swap(false, Ordering::Relaxed);
                if asked && self.last.state == Mode::Safe as u32 {
                    self.executor.rearm()?;
                }
                let (needle, target) = (ports.needle(), ports.target());
                let inputs = Inputs { tick, time_ns, needle, target, paddles: ports.paddles() };
                self.executor.step(&inputs).map(|command| (inputs, command))
            };
            catch_unwind(AssertUnwindSafe(step)).ok()
        };
        let (inputs, command) = match stepped {
            Some(outcome) => {
                let (inputs, command) = outcome?;
                ports.send(&command)?;
                (inputs, command)
            }
            None => self.safe_command(ports, tick, time_ns)?,
        };
        self.last = command;
        if let Some(count) = self.modes.get_mut(command.state.wrapping_sub(1) as usize) {
            *count += 1;
        }
        let sequences = [
            inputs.needle.map(|sample| sample.sequence),
            inputs.target.map(|sample| sample.sequence),
            inputs.paddles[0].map(|sample| sample.sequence),
            inputs.paddles[1].map(|sample| sample.sequence),
        ];
        for (span, sequence) in self.spans.iter_mut().zip(sequences) {
            if let Some(sequence) = sequence {
                span.see(sequence);
            }
        }
        self.faults |= Faults::from_bits(command.faults);
        self.keep(&ControllerTick { inputs, command });
        Ok(())
    }

    fn keep(&mut self, tick: &ControllerTick) {
        if let Some(recorder) = &mut self.recorder {
            recorder.record(tick);
        }
        // Growing would allocate in the loop.
        if self.kept.len() < self.kept.capacity() {
            self.kept.push(*tick);
        } else {
            self.not_kept += 1;
        }
    }

    /// The watchdog's command: SAFE, where the paddle was told to be last. Samples are not read any more.
    fn safe_command<S: Service>(
        &mut self,
        ports: &mut ControllerPorts<S>,
        tick: u64,
        time_ns: u64,
    ) -> Result<(Inputs, PaddleCommand), LinkError> {
        self.tripped = true;
        let command = PaddleCommand {
            sequence: if self.modes == [0; 3] { 0 } else { self.last.sequence.wrapping_add(1) },
            state: Mode::Safe as u32,
            tick,
            time_ns,
            faults: Faults::WATCHDOG.bits(),
            ..self.last
        };
        ports.send(&command)?;
        Ok((Inputs { tick, time_ns, ..Inputs::default() }, command))
    }

    /// Closes the accounts, with what still waits in the buffers.
    ///
    /// # Errors
    /// [`RuntimeError::Board`] if a board does not tell its own.
    pub fn end<S: Service>(
        mut self,
        ports: &mut ControllerPorts<S>,
    ) -> Result<(ControllerAccounts, Vec<ControllerTick>), RuntimeError> {
        let ledger = self.executor.ledger()?;
        let [needle, target, paddle, second] = self.spans;
        let waiting =
            (ports.needle(), ports.target(), ports.paddles().map(|waiting| waiting.map(|sample| sample.sequence)));
        let ticks = &ledger.ticks;
        let (due, skipped) = self.scheduled.unwrap_or((ticks.due, ticks.skipped));
        let [hold, run, safe] = self.modes;
        let entries = run + hold + safe + skipped;
        // The ledger ends where the watchdog takes over; until then it must say what the commands say.
        let own = if self.tripped {
            0
        } else {
            ticks.unaccounted() + ticks.run.abs_diff(run) + ticks.hold.abs_diff(hold) + ticks.safe.abs_diff(safe)
        };
        let accounts = ControllerAccounts {
            needle: needle.account(&ledger.needle, waiting.0.map(|sample| sample.sequence)),
            target: target.account(&ledger.target, waiting.1.map(|sample| sample.sequence)),
            paddle: paddle.account(&ledger.paddles[0], waiting.2[0]),
            second_paddle: ports.has_second_paddle().then(|| second.account(&ledger.paddles[1], waiting.2[1])),
            ticks: TickResult { due, run, hold, safe, skipped, unaccounted: due.abs_diff(entries) + own },
            commands: ports.command.published(),
            final_state: Some(Mode::from_wire(self.last.state).unwrap_or_default()),
            faults: self.faults,
            timing: self.timing,
            kept: self.kept.len() as u64,
            not_kept: self.not_kept,
            record: self.recorder.map(TickRecorder::finish),
        };
        Ok((accounts, self.kept))
    }
}
