//! The controller's process: waits for a plant, answers it, closes the accounts.

use std::time::Duration;

use iceoryx2::service::ipc;
use rustix::process::Pid;
use serde::{Deserialize, Serialize};

use super::ControlLoop;
use crate::exchange::{ControllerPorts, Departure, Space};
use crate::runtime::accounting::accounts::ControllerAccounts;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::peer::introduction::Introduction;
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::time::mode::RunMode;
use crate::world::loop_settings::LoopSettings;

/// What `controller --json` writes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerResult {
    /// The accounts.
    #[serde(rename = "handover")]
    pub accounts: ControllerAccounts,
    /// Why it ended, if the plant did not say stop.
    pub ended: Option<String>,
}

/// How a controller serves a plant.
#[derive(Clone, Debug, PartialEq)]
pub struct Service {
    /// What drives time.
    pub mode: RunMode,
    /// Rates, latency, noise.
    pub loop_settings: LoopSettings,
    /// Silence after which the plant is given up.
    pub timeout: Duration,
    /// The plant's process, if it has started this one.
    pub parent: Option<Pid>,
    /// What the table was computed from, and for which paddles.
    pub introduction: Introduction,
}

/// What is left when all is over.
#[derive(Debug)]
pub struct ServedPlant {
    /// The accounts.
    pub accounts: ControllerAccounts,
    /// Every tick that there was room for.
    pub ticks: Vec<ControllerTick>,
    /// How it ended.
    pub ended: Result<(), RuntimeError>,
}

/// Serves a plant until it says stop. Leaves nothing behind in shared memory, however it ends.
///
/// # Errors
/// [`RuntimeError`] of whatever happens before the first tick and after the last; [`ServedPlant::ended`] has the rest.
pub fn serve(control_loop: ControlLoop<'_>, space: &Space, service: &Service) -> Result<ServedPlant, RuntimeError> {
    let outcome = serve_in(control_loop, space, service);
    space.leave::<ipc::Service>(Departure::First);
    outcome
}

fn serve_in(mut control_loop: ControlLoop<'_>, space: &Space, service: &Service) -> Result<ServedPlant, RuntimeError> {
    let elsewhere = || Peer::Elsewhere(Box::new(space.clone()), Role::Plant);
    let mut peer = service.parent.map_or_else(elsewhere, Peer::Parent);
    let mut ports = ControllerPorts::<ipc::Service>::open_for(space, service.introduction.paddles.len())?;
    service.introduction.tell(space)?;
    let mut patience = Patience::new(service.timeout);
    while !ports.has_peer() {
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let ended = match service.mode {
        RunMode::Lockstep => control_loop.lockstep(&mut ports, &mut peer, service.timeout),
        RunMode::FreeRun => control_loop.free_run(&mut ports, &mut peer, service.timeout, &service.loop_settings),
    };
    let (accounts, ticks) = control_loop.end(&mut ports)?;
    Ok(ServedPlant { accounts, ticks, ended })
}
