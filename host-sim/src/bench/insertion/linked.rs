//! A plant and its controller, which is a process of its own, over one insertion: in the plane and in space.

use std::path::Path;
use std::time::Duration;

use firmware::{Faults, Mode};
use iceoryx2::service::ipc;

use crate::bench::error::SimError;
use crate::exchange::{Departure, PlantPorts, Space};
use crate::record::error::FileError;
use crate::record::recording::{Record, Recording, RecordingHeader};
use crate::runtime::accounting::accounts::{CommandAccount, ControllerAccounts};
use crate::runtime::accounting::ledger::LedgerResult;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::error::RuntimeError;
use crate::runtime::executor::Hardware;
use crate::runtime::peer::child::{ControllerCall, ControllerProcess};
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::plant::free_run::FreeRun;
use crate::runtime::plant::lockstep::{self, Pace};
use crate::runtime::plant::{PlantLoop, published, waiting_command};
use crate::runtime::time::durations::LoopTiming;
use crate::runtime::time::mode::RunMode;
use crate::world::simulation::Simulation;
use crate::world::tissue::TissueResponse;
use crate::world::truth::Truth;

/// How long the other process may be silent before a run is given up.
const PEER_TIMEOUT: Duration = Duration::from_secs(30);

/// The same for a controller whose plant a spectator may pause.
const WATCHED_PATIENCE_S: f64 = 24.0 * 3600.0;

/// A plant's controller.
#[derive(Clone, Copy, Debug)]
pub(in crate::bench) struct LinkedController<'a> {
    /// This program, which is also the controller.
    pub(in crate::bench) program: &'a Path,
    /// Its table as encoded.
    pub(in crate::bench) table_bytes: &'a [u8],
    /// What drives time.
    pub(in crate::bench) mode: RunMode,
    /// What computes its steps.
    pub(in crate::bench) hardware: Hardware,
    /// Whether somebody looks on, who may pause.
    pub(in crate::bench) is_watched: bool,
}

/// A controlled insertion that is over.
pub(in crate::bench) struct FinishedInsertion<T, const D: usize = 2> {
    pub(in crate::bench) plant: PlantLoop<T, D>,
    pub(in crate::bench) accounts: ControllerAccounts,
    pub(in crate::bench) ticks: Vec<ControllerTick>,
    pub(in crate::bench) ledger: LedgerResult,
    pub(in crate::bench) plant_timing: Option<LoopTiming>,
}

/// How much of an insertion was in RUN.
pub(in crate::bench) struct RunShare {
    /// Part of the ticks from the needle's start on.
    pub(in crate::bench) share: f64,
    /// Faults of the others.
    pub(in crate::bench) outside: Faults,
}

impl<T: TissueResponse<D>, const D: usize> FinishedInsertion<T, D> {
    /// The recording; `depth_end` is the deepest needle of the table.
    pub(in crate::bench) fn recording(
        &self,
        controller: &LinkedController<'_>,
        simulation: &Simulation,
        scene_hash: [u8; 32],
        depth_end: f64,
    ) -> Recording {
        let header = RecordingHeader {
            mode: controller.mode,
            seed: simulation.seed,
            scene_hash,
            settings: simulation.loop_settings.settings(depth_end),
            table: controller.table_bytes.to_vec(),
        };
        Recording { header, records: merge(&self.ticks, self.plant.truths()) }
    }

    /// How much of the insertion was in RUN; the needle started at `started_ns`.
    pub(in crate::bench) fn run_share(&self, started_ns: u64) -> RunShare {
        let moving = || self.ticks.iter().filter(|tick| tick.inputs.time_ns >= started_ns);
        let (in_run, outside) = moving().fold((0, Faults::NONE), |(in_run, faults), tick| match tick.command.state {
            state if state == Mode::Run as u32 => (in_run + 1, faults),
            _ => (in_run, faults | Faults::from_bits(tick.command.faults)),
        });
        RunShare { share: f64::from(in_run) / moving().count().max(1) as f64, outside }
    }
}

/// An insertion of a plant under a controller.
pub(in crate::bench) struct LinkedInsertion<'a> {
    /// The controller.
    pub(in crate::bench) controller: LinkedController<'a>,
    /// The numbers.
    pub(in crate::bench) simulation: &'a Simulation,
    /// Called at every tick.
    pub(in crate::bench) progress: &'a dyn Fn(),
}

impl LinkedInsertion<'_> {
    /// Runs it in a link of its own that is tidied up whatever happens; `begins` is called when both processes are there.
    ///
    /// # Errors
    /// [`SimError`].
    pub(in crate::bench) fn run<T: TissueResponse<D>, const D: usize>(
        &self,
        plant: PlantLoop<T, D>,
        begins: impl FnOnce(&mut PlantLoop<T, D>),
    ) -> Result<FinishedInsertion<T, D>, SimError> {
        let space = Space::unique()?;
        let outcome = self.over(&space, plant, begins);
        space.leave::<ipc::Service>(Departure::Last);
        outcome
    }

    /// Starts the controller, runs the insertion, and closes the accounts.
    fn over<T: TissueResponse<D>, const D: usize>(
        &self,
        space: &Space,
        mut plant: PlantLoop<T, D>,
        begins: impl FnOnce(&mut PlantLoop<T, D>),
    ) -> Result<FinishedInsertion<T, D>, SimError> {
        let table = space.root().join("controller.table");
        std::fs::write(&table, self.controller.table_bytes).map_err(FileError::write(&table))?;
        let paddles = plant.world().actuators.len();
        let mut ports = PlantPorts::<ipc::Service>::open_for(space, paddles)?;
        let mut peer = Peer::Child(self.start(space, &table)?);
        let mut patience = Patience::new(PEER_TIMEOUT);
        while !ports.has_peer() {
            patience.wait::<ipc::Service>(&mut peer)?;
        }
        ports.connect()?;
        begins(&mut plant);
        let (mut commands, plant_timing) = self.drive(&mut plant, &mut ports, &mut peer)?;
        let Peer::Child(child) = peer else {
            unreachable!("the peer of a run is its child");
        };
        let (accounts, ticks) = child.finish()?;
        commands.end(waiting_command(&mut ports)?);
        let ledger = accounts.ledger(published(&ports), &commands);
        Ok(FinishedInsertion { plant, accounts, ticks, ledger, plant_timing })
    }

    fn start(&self, space: &Space, table: &Path) -> Result<ControllerProcess, RuntimeError> {
        let LinkedController { program, mode, hardware, is_watched, .. } = self.controller;
        ControllerProcess::start(&ControllerCall {
            program,
            table,
            space,
            mode,
            hardware,
            loop_settings: self.simulation.loop_settings,
            depth: self.simulation.depth,
            capacity: self.simulation.ticks(),
            patience_s: if is_watched { WATCHED_PATIENCE_S } else { PEER_TIMEOUT.as_secs_f64() },
        })
    }

    fn drive<T: TissueResponse<D>, const D: usize>(
        &self,
        plant: &mut PlantLoop<T, D>,
        ports: &mut PlantPorts<ipc::Service>,
        peer: &mut Peer,
    ) -> Result<(CommandAccount, Option<LoopTiming>), RuntimeError> {
        let settings = &self.simulation.loop_settings;
        let (rate_hz, period_ns) = (settings.rate, settings.period_ns());
        match self.controller.mode {
            RunMode::Lockstep => {
                let pace = Pace { period_ns, timeout: PEER_TIMEOUT };
                Ok((lockstep::run(plant, ports, peer, &pace, self.progress)?, None))
            }
            RunMode::FreeRun => {
                let patience = PEER_TIMEOUT;
                let free_run = FreeRun { ports, peer, rate_hz, period_ns, patience, succession: None };
                let (account, timing) = free_run.run(plant, self.progress)?;
                Ok((account, Some(timing)))
            }
        }
    }
}

/// Both sides of every tick; the truth is that of the plant's tick of the same number.
fn merge(ticks: &[ControllerTick], truths: &[Truth]) -> Vec<Record> {
    ticks
        .iter()
        .map(|tick| Record {
            tick: *tick,
            truth: truths.binary_search_by_key(&tick.inputs.tick, |truth| truth.tick).ok().map(|found| truths[found]),
        })
        .collect()
}
