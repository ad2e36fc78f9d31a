//! Time from the messages: the plant publishes, says the tick, and waits for the one command that answers it.

use std::time::Duration;

use firmware::contract::PaddleCommand;
use iceoryx2::service::Service;

use super::PlantLoop;
use crate::exchange::{ClockFrame, ClockKind, PlantPorts};
use crate::runtime::accounting::accounts::CommandAccount;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::signals;
use crate::world::tissue::TissueResponse;

/// Runs the whole insertion; `progress` is called at every tick.
///
/// # Errors
/// [`RuntimeError`].
pub fn run<S: Service, T: TissueResponse<D>, const D: usize>(
    plant: &mut PlantLoop<T, D>,
    ports: &mut PlantPorts<S>,
    peer: &mut Peer,
    pace: &Pace,
    progress: &dyn Fn(),
) -> Result<CommandAccount, RuntimeError> {
    let mut account = CommandAccount::default();
    for tick in 0.. {
        let time_ns = tick * pace.period_ns;
        if plant.is_over(time_ns) {
            ports.clock.send(ClockFrame::new(ClockKind::Stop, tick, time_ns))?;
            break;
        }
        signals::check()?;
        plant.publish(tick, time_ns, ports)?;
        ports.clock.send(ClockFrame::new(ClockKind::Step, tick, time_ns))?;
        let command = answer(ports, peer, tick, pace.timeout)?;
        account.consume(command.sequence);
        plant.act(Some(&command), time_ns, pace.period_ns)?;
        progress();
        plant.between_ticks();
    }
    Ok(account)
}

/// How fast simulated time goes, and how long an answer may take.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Period of the loop, ns.
    pub period_ns: u64,
    /// Silence after which the controller is given up.
    pub timeout: Duration,
}

/// The command for `tick`.
fn answer<S: Service>(
    ports: &mut PlantPorts<S>,
    peer: &mut Peer,
    tick: u64,
    timeout: Duration,
) -> Result<PaddleCommand, RuntimeError> {
    let mut patience = Patience::new(timeout);
    loop {
        match ports.command.oldest()? {
            Some(command) if command.tick == tick => return Ok(command),
            Some(command) => {
                return Err(RuntimeError::Protocol {
                    peer: Role::Controller,
                    what: format!("command for tick {} at tick {tick}", command.tick),
                });
            }
            None => patience.wait::<S>(peer)?,
        }
    }
}
