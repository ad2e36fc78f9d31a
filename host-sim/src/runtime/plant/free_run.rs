//! Time from the machine: the plant on its own steady clock, absolute deadlines, late periods skipped and counted.
//!
//! The controller runs on the same clock half a period later (see [`crate::runtime::controller::Session::free_run`]): the
//! plant's step takes a part of its period, and samples should be fresh when they are used.

use firmware::contract::PaddleCommand;
use firmware::schedule::Schedule;
use iceoryx2::service::Service;

use crate::bench::result::LoopTiming;
use crate::error::SimError;
use crate::exchange::{ClockFrame, ClockKind, PlantPorts, Space};
use crate::runtime::accounts::CommandAccount;
use crate::runtime::clock::{now_ns, release_real_time, request_real_time, sleep_until};
use crate::runtime::durations::LoopDurations;
use crate::runtime::peer::Peer;
use crate::runtime::signals;
use crate::world::World;

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
    fn look<S: Service>(&mut self, ports: &mut PlantPorts<S>, next_ns: u64) -> Result<(), SimError> {
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

/// Runs the whole insertion in real time; `progress` is called at every tick.
///
/// # Errors
/// [`SimError`].
pub fn run<S: Service>(
    world: &mut World<'_>,
    ports: &mut PlantPorts<S>,
    peer: &mut Peer,
    rate_hz: f64,
    period_ns: u64,
    succession: Option<&mut Succession<'_>>,
    progress: &dyn Fn(),
) -> Result<(CommandAccount, LoopTiming), SimError> {
    let mut durations = LoopDurations::default();
    let scheduling = request_real_time();
    let first_ns = now_ns() + LEAD_NS;
    let mut schedule = Schedule::new(first_ns, period_ns);
    let outcome = ports
        .clock
        .send(ClockFrame::new(ClockKind::Start, 0, first_ns))
        .map_err(SimError::from)
        .and_then(|()| ticks(world, ports, peer, &mut schedule, &mut durations, succession, progress));
    release_real_time();
    let account = outcome?;
    ports.clock.send(ClockFrame::new(ClockKind::Stop, 0, now_ns()))?;
    Ok((account, durations.timing(rate_hz, &schedule, &scheduling)))
}

fn ticks<S: Service>(
    world: &mut World<'_>,
    ports: &mut PlantPorts<S>,
    peer: &mut Peer,
    schedule: &mut Schedule,
    durations: &mut LoopDurations,
    mut succession: Option<&mut Succession<'_>>,
    progress: &dyn Fn(),
) -> Result<CommandAccount, SimError> {
    let mut account = CommandAccount::default();
    let mut previous_ns = schedule.next_release_ns();
    loop {
        sleep_until(schedule.next_release_ns());
        let start_ns = now_ns();
        let release = schedule.begin(start_ns);
        // The world's time is that of the releases: lateness of this loop is not motion of the needle.
        let time_ns = release.release_ns;
        if world.is_over(time_ns) {
            return Ok(account);
        }
        let command = ports.command.newest()?;
        if let Some(succession) = &mut succession {
            succession.hear(command.as_ref(), &mut account);
        }
        if let Some(command) = &command {
            account.consume(command.sequence);
        }
        world.act(command.as_ref(), time_ns, time_ns - previous_ns)?;
        previous_ns = time_ns;
        world.publish(release.tick, time_ns, ports)?;
        let end_ns = now_ns();
        schedule.finish(end_ns);
        durations.record(release.release_ns, start_ns, end_ns);
        progress();
        if release.tick.is_multiple_of(TICKS_PER_LOOK) {
            signals::check()?;
            if succession.is_none() {
                peer.check::<S>()?;
            }
        }
        if let Some(succession) = &mut succession {
            succession.look(ports, schedule.next_release_ns())?;
        }
    }
}
