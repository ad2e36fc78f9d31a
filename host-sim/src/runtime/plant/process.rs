//! The plant in a process of its own, with a controller that somebody else starts.

use std::time::Duration;

use iceoryx2::service::ipc;
use nalgebra::{Matrix3x2, SMatrix, Vector2};
use serde::{Deserialize, Serialize};

use super::free_run::{FreeRun, Succession};
use super::lockstep::Pace;
use super::{PlantLoop, lockstep, published};
use crate::exchange::{ClockFrame, ClockKind, Departure, PlantPorts, Space};
use crate::runtime::accounting::accounts::{CommandAccount, Published};
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::peer::introduction::{Expected, Introduction};
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::time::durations::LoopTiming;
use crate::runtime::time::mode::RunMode;
use crate::world::loop_settings::LoopSettings;
use crate::world::space::SpaceTissue;
use crate::world::tissue::{TissuePlant, TissueResponse};
use crate::world::truth::{Truth, from_frame};

/// What `plant --json` writes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlantResult {
    /// Ticks simulated.
    pub ticks: u64,
    /// Controllers that have come.
    pub controllers: u64,
    /// Samples published of the needle, the target, and the only or the first paddle.
    pub published: [u64; 3],
    /// Those of the second paddle, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published_second_paddle: Option<u64>,
    /// Commands executed.
    pub commands: u64,
    /// Commands replaced by newer ones before the plant looked.
    pub overwritten: u64,
    /// Largest orthogonal target displacement, length.
    pub largest_error: f64,
    /// Largest motion of a paddle per tick, length.
    pub largest_step: f64,
    /// Timing of the loop; free-run only.
    pub timing: Option<LoopTiming>,
}

/// How a plant is served by whatever controller comes.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// What drives time.
    pub mode: RunMode,
    /// Rates, latency, noise.
    pub loop_settings: LoopSettings,
    /// Silence after which the controller is given up.
    pub timeout: Duration,
    /// What the death of a controller means; free-run only.
    pub on_death: OnDeath,
    /// What a controller's table must have been computed from; none: anything will do.
    pub expected: Option<Expected>,
}

/// What the death of a controller means to the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnDeath {
    /// The end of the run.
    Stop,
    /// The paddle stays where it is until the next controller comes.
    AwaitNext,
}

/// Commands, controllers, timing, samples published.
type Inserted = (CommandAccount, u64, Option<LoopTiming>, Published);

/// Runs one insertion in the plane. Leaves nothing behind in shared memory, however it ends. `orthogonal` is the direction
/// orthogonal to the needle.
///
/// # Errors
/// [`RuntimeError`].
pub fn serve_in_plane(
    plant: &mut PlantLoop<TissuePlant<'_>>,
    space: &Space,
    visit: &Visit,
    orthogonal: &Vector2<f64>,
) -> Result<PlantResult, RuntimeError> {
    serve(plant, space, visit, orthogonal)
}

/// The same in space, where `orthogonal` are the two directions orthogonal to the needle.
///
/// # Errors
/// [`RuntimeError`].
pub fn serve_in_space(
    plant: &mut PlantLoop<SpaceTissue<'_>, 3>,
    space: &Space,
    visit: &Visit,
    orthogonal: &Matrix3x2<f64>,
) -> Result<PlantResult, RuntimeError> {
    serve(plant, space, visit, orthogonal)
}

fn serve<T: TissueResponse<D>, const D: usize, const N: usize>(
    plant: &mut PlantLoop<T, D>,
    space: &Space,
    visit: &Visit,
    orthogonal: &SMatrix<f64, D, N>,
) -> Result<PlantResult, RuntimeError> {
    let outcome = insertion(plant, space, visit);
    space.leave::<ipc::Service>(Departure::Last);
    let (account, controllers, timing, published) = outcome?;
    let truths = plant.truths();
    let error = |truth: &Truth| orthogonal.tr_mul(&truth.target::<D>()).norm();
    let [commands, overwritten] = account.counts();
    Ok(PlantResult {
        ticks: truths.len() as u64,
        controllers,
        published: published.streams,
        published_second_paddle: published.second_paddle,
        commands,
        overwritten,
        largest_error: truths.iter().map(error).fold(0.0, f64::max),
        largest_step: truths
            .windows(2)
            .map(|pair| {
                let steps = pair[1].paddles.iter().zip(&pair[0].paddles);
                let step = steps.map(|(to, from)| (from_frame::<D>(*to) - from_frame::<D>(*from)).norm());
                step.fold(0.0, f64::max) / (pair[1].tick - pair[0].tick) as f64
            })
            .fold(0.0, f64::max),
        timing,
    })
}

fn insertion<T: TissueResponse<D>, const D: usize>(
    plant: &mut PlantLoop<T, D>,
    space: &Space,
    visit: &Visit,
) -> Result<Inserted, RuntimeError> {
    let paddles = plant.world().actuators.len();
    let mut ports = PlantPorts::<ipc::Service>::open_for(space, paddles)?;
    let mut peer = Peer::Elsewhere(Box::new(space.clone()), Role::Controller);
    let mut patience = Patience::new(visit.timeout);
    while !ports.has_peer() {
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let agreed = visit
        .expected
        .as_ref()
        .map_or(Ok(()), |expected| Introduction::hear(space).and_then(|told| told.check(expected)));
    let outcome = agreed.and_then(|()| drive(plant, space, visit, &mut ports, &mut peer));
    if outcome.is_err() {
        // Whatever has happened, the controller need not wait for its end.
        let _ = ports.clock.send(ClockFrame::new(ClockKind::Stop, 0, 0));
    }
    let (account, controllers, timing) = outcome?;
    // The controller closes its accounts with what still waits: it leaves first.
    let mut patience = Patience::new(visit.timeout);
    while ports.command.has_writer() {
        if patience.wait::<ipc::Service>(&mut peer).is_err() {
            break;
        }
    }
    Ok((account, controllers, timing, published(&ports)))
}

fn drive<T: TissueResponse<D>, const D: usize>(
    plant: &mut PlantLoop<T, D>,
    space: &Space,
    visit: &Visit,
    ports: &mut PlantPorts<ipc::Service>,
    peer: &mut Peer,
) -> Result<(CommandAccount, u64, Option<LoopTiming>), RuntimeError> {
    let period_ns = visit.loop_settings.period_ns();
    match visit.mode {
        RunMode::Lockstep => {
            let pace = Pace { period_ns, timeout: visit.timeout };
            Ok((lockstep::run(plant, ports, peer, &pace, &|| {})?, 1, None))
        }
        RunMode::FreeRun => {
            let rate_hz = visit.loop_settings.rate;
            let mut succession = Succession::new(space);
            let kept = (visit.on_death == OnDeath::AwaitNext).then_some(&mut succession);
            let patience = visit.timeout;
            let free_run = FreeRun { ports, peer, rate_hz, period_ns, patience, succession: kept };
            let (account, timing) = free_run.run(plant, &|| {})?;
            Ok((account, succession.controllers, Some(timing)))
        }
    }
}
