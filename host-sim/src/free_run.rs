//! Time from the machine: the plant on its own steady clock, absolute deadlines, late periods skipped and counted.
//!
//! The controller runs on the same clock half a period later (see [`crate::controller::Session::free_run`]): the
//! plant's step takes a part of its period, and samples should be fresh when they are used.

use firmware::schedule::Schedule;
use iceoryx2::service::Service;

use crate::clock::{now_ns, release_real_time, request_real_time, sleep_until};
use crate::error::SimError;
use crate::handover::CommandAccount;
use crate::interrupt;
use crate::link::{ClockFrame, ClockKind, PlantPorts};
use crate::peer::Peer;
use crate::result::LoopTiming;
use crate::statistics::LoopDurations;
use crate::world::World;

/// From the start frame to tick 0: time for the controller to fall asleep.
const LEAD_NS: u64 = 20_000_000;
/// Ticks between two looks at the controller and at signals.
const TICKS_PER_LOOK: u64 = 16;

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
        .and_then(|()| ticks(world, ports, peer, &mut schedule, &mut durations, progress));
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
            interrupt::check()?;
            peer.check::<S>()?;
        }
    }
}
