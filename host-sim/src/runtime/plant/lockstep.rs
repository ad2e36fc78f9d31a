//! Time from the messages: the plant publishes, says the tick, and waits for the one command that answers it.

use std::time::Duration;

use firmware::contract::PaddleCommand;
use iceoryx2::service::Service;

use crate::error::SimError;
use crate::exchange::{ClockFrame, ClockKind, PlantPorts};
use crate::runtime::accounts::CommandAccount;
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::signals;
use crate::world::World;

/// Runs the whole insertion; `progress` is called at every tick.
///
/// # Errors
/// [`SimError`].
pub fn run<S: Service>(
    world: &mut World<'_>,
    ports: &mut PlantPorts<S>,
    peer: &mut Peer,
    period_ns: u64,
    timeout: Duration,
    progress: &dyn Fn(),
) -> Result<CommandAccount, SimError> {
    let mut account = CommandAccount::default();
    for tick in 0.. {
        let time_ns = tick * period_ns;
        if world.is_over(time_ns) {
            ports.clock.send(ClockFrame::new(ClockKind::Stop, tick, time_ns))?;
            break;
        }
        signals::check()?;
        world.publish(tick, time_ns, ports)?;
        ports.clock.send(ClockFrame::new(ClockKind::Step, tick, time_ns))?;
        let command = answer(ports, peer, tick, timeout)?;
        account.consume(command.sequence);
        world.act(Some(&command), time_ns, period_ns)?;
        progress();
    }
    Ok(account)
}

/// The command for `tick`.
fn answer<S: Service>(
    ports: &mut PlantPorts<S>,
    peer: &mut Peer,
    tick: u64,
    timeout: Duration,
) -> Result<PaddleCommand, SimError> {
    let mut patience = Patience::new(timeout);
    loop {
        match ports.command.oldest()? {
            Some(command) if command.tick == tick => return Ok(command),
            Some(command) => {
                return Err(SimError::Protocol {
                    peer: "controller",
                    what: format!("command for tick {} at tick {tick}", command.tick),
                });
            }
            None => patience.wait::<S>(peer)?,
        }
    }
}
