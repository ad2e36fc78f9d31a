//! Time from the machine: the plant on its own steady clock, absolute deadlines, late periods skipped and counted.
//!
//! The controller runs on the same clock half a period later (see [`crate::runtime::controller::ControlLoop::free_run`]): the
//! plant's step takes a part of its period, and samples should be fresh when they are used.

use firmware::contract::PaddleCommand;
use firmware::schedule::Schedule;
use iceoryx2::service::Service;

use super::PlantLoop;
use crate::exchange::{ClockFrame, ClockKind, PlantPorts, Space};
use crate::runtime::accounts::CommandAccount;
use crate::runtime::clock::{now_ns, release_real_time, request_real_time, sleep_until};
use crate::runtime::durations::{LoopDurations, LoopTiming};
use crate::runtime::error::RuntimeError;
use crate::runtime::peer::Peer;
use crate::runtime::signals;

/// From the start frame to tick 0: time for the controller to fall asleep.
const LEAD_NS: u64 = 20_000_000;
/// Ticks between two looks at the controller and at signals.
const TICKS_PER_LOOK: u64 = 16;

/// Lets one controller follow another: when the present one dies, its place is cleared and the next one is let in.
#[derive(Debug)]
pub struct Succession<'s> {
    space: &'s Space,
    silent_ticks: u64,
    /// Controllers so far.
    pub controllers: u64,
}

/// Ticks without a command after which somebody looks what has become of the controller, and how often then.
const SILENT_TICKS: u64 = 32;

impl<'s> Succession<'s> {
    /// The first controller is there.
    pub fn new(space: &'s Space) -> Self {
        Self { space, silent_ticks: 0, controllers: 1 }
    }

    /// Notes what came in a tick, and whether that is from another controller than before.
    fn hear(&mut self, command: Option<&PaddleCommand>, account: &mut CommandAccount) {
        let Some(command) = command else {
            self.silent_ticks += 1;
            return;
        };
        self.silent_ticks = 0;
        if account.is_behind(command.sequence) {
            account.restart();
            self.controllers += 1;
        }
    }

    /// Clears the place of a dead controller, and tells whoever is there that its first release is at `next_ns`. One
    /// that is already at work does not mind.
    fn look<S: Service>(&mut self, ports: &mut PlantPorts<S>, next_ns: u64) -> Result<(), RuntimeError> {
        if self.silent_ticks == 0 || !self.silent_ticks.is_multiple_of(SILENT_TICKS) {
            return Ok(());
        }
        self.space.clear_dead::<S>();
        if ports.has_peer() {
            ports.connect()?;
            ports.clock.send(ClockFrame::new(ClockKind::Start, 0, next_ns))?;
        }
        Ok(())
    }
}

/// The plant's end of a link on the machine's clock.
#[derive(Debug)]
pub struct FreeRun<'r, 's, S: Service> {
    /// Ports of the plant.
    pub ports: &'r mut PlantPorts<S>,
    /// The controller.
    pub peer: &'r mut Peer,
    /// Rate of the loop, Hz.
    pub rate_hz: f64,
    /// Its period, ns.
    pub period_ns: u64,
    /// Whether a controller that dies may be followed by another; else its death ends the run.
    pub succession: Option<&'r mut Succession<'s>>,
}

impl<S: Service> FreeRun<'_, '_, S> {
    /// Runs the whole insertion in real time; `progress` is called at every tick.
    ///
    /// # Errors
    /// [`RuntimeError`].
    pub fn run(
        mut self,
        plant: &mut PlantLoop<'_>,
        progress: &dyn Fn(),
    ) -> Result<(CommandAccount, LoopTiming), RuntimeError> {
        let mut durations = LoopDurations::default();
        let scheduling = request_real_time();
        let first_ns = now_ns() + LEAD_NS;
        let mut schedule = Schedule::new(first_ns, self.period_ns);
        let outcome = self
            .ports
            .clock
            .send(ClockFrame::new(ClockKind::Start, 0, first_ns))
            .map_err(RuntimeError::from)
            .and_then(|()| self.ticks(plant, &mut schedule, &mut durations, progress));
        release_real_time();
        let account = outcome?;
        self.ports.clock.send(ClockFrame::new(ClockKind::Stop, 0, now_ns()))?;
        Ok((account, durations.timing(self.rate_hz, &schedule, &scheduling)))
    }

    fn ticks(
        &mut self,
        plant: &mut PlantLoop<'_>,
        schedule: &mut Schedule,
        durations: &mut LoopDurations,
        progress: &dyn Fn(),
    ) -> Result<CommandAccount, RuntimeError> {
        let mut account = CommandAccount::default();
        let mut previous_ns = schedule.next_release_ns();
        loop {
            sleep_until(schedule.next_release_ns());
            let start_ns = now_ns();
            let release = schedule.begin(start_ns);
            // The world's time is that of the releases: lateness of this loop is not motion of the needle.
            let time_ns = release.release_ns;
            if plant.is_over(time_ns) {
                return Ok(account);
            }
            let command = self.ports.command.newest()?;
            if let Some(succession) = &mut self.succession {
                succession.hear(command.as_ref(), &mut account);
            }
            if let Some(command) = &command {
                account.consume(command.sequence);
            }
            plant.act(command.as_ref(), time_ns, time_ns - previous_ns)?;
            previous_ns = time_ns;
            plant.publish(release.tick, time_ns, self.ports)?;
            let end_ns = now_ns();
            schedule.finish(end_ns);
            durations.record(release.release_ns, start_ns, end_ns);
            progress();
            self.look(release.tick, schedule.next_release_ns())?;
        }
    }

    /// Looks at signals and at the controller now and then.
    fn look(&mut self, tick: u64, next_ns: u64) -> Result<(), RuntimeError> {
        if tick.is_multiple_of(TICKS_PER_LOOK) {
            signals::check()?;
            if self.succession.is_none() {
                self.peer.check::<S>()?;
            }
        }
        match &mut self.succession {
            Some(succession) => succession.look(self.ports, next_ns),
            None => Ok(()),
        }
    }
}
