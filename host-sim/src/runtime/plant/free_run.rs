//! Time from the machine: the plant on its own steady clock, absolute deadlines, late periods skipped and counted.
//!
//! The controller runs on the same clock half a period later (see [`crate::runtime::controller::ControlLoop::free_run`]): the
//! plant's step takes a part of its period, and samples should be fresh when they are used.

use std::time::Duration;

use firmware::contract::PaddleCommand;
use iceoryx2::service::Service;

use super::PlantLoop;
use crate::exchange::{ClockFrame, ClockKind, PlantPorts, Space};
use crate::runtime::accounting::accounts::CommandAccount;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::peer::Peer;
use crate::runtime::time::clock::{Scheduling, now_ns, release_real_time, request_real_time};
use crate::runtime::time::durations::{LoopDurations, LoopTiming};
use crate::runtime::time::periodic::PeriodicLoop;
use crate::world::tissue::TissueResponse;

/// From the start frame to tick 0: time for the controller to fall asleep.
const LEAD_NS: u64 = 20_000_000;
/// Time between two looks at the controller, ns.
const BETWEEN_LOOKS_NS: u64 = 16_000_000;

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
        if self.silent_ticks < SILENT_TICKS {
            return Ok(());
        }
        self.silent_ticks = 0;
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
    /// Silence before the needle starts after which the controller is given up. Once it has started, the run ends by
    /// itself.
    pub patience: Duration,
    /// Whether a controller that dies may be followed by another; else its death ends the run.
    pub succession: Option<&'r mut Succession<'s>>,
}

impl<S: Service> FreeRun<'_, '_, S> {
    /// Runs the whole insertion in real time; `progress` is called at every tick.
    ///
    /// # Errors
    /// [`RuntimeError`].
    pub fn run<T: TissueResponse<D>, const D: usize>(
        self,
        plant: &mut PlantLoop<T, D>,
        progress: &dyn Fn(),
    ) -> Result<(CommandAccount, LoopTiming), RuntimeError> {
        self.run_in(plant, progress, request_real_time, release_real_time)
    }

    /// The same with what asks for real time and what gives it up.
    fn run_in<T: TissueResponse<D>, const D: usize>(
        mut self,
        plant: &mut PlantLoop<T, D>,
        progress: &dyn Fn(),
        request: impl FnOnce() -> Scheduling,
        release: impl FnOnce(),
    ) -> Result<(CommandAccount, LoopTiming), RuntimeError> {
        let mut durations = LoopDurations::default();
        let scheduling = request();
        let first_ns = now_ns() + LEAD_NS;
        let mut periodic = PeriodicLoop::new(first_ns, self.period_ns);
        let started = self.ports.clock.send(ClockFrame::new(ClockKind::Start, 0, first_ns));
        let outcome = started.map_err(RuntimeError::from).and_then(|()| {
            let account = self.ticks(plant, &mut periodic, &mut durations, progress)?;
            // Before real time is given up: after that somebody else may have the processor for longer than samples may be
            // old, and a controller that has not heard of the end goes to HOLD or SAFE.
            self.ports.clock.send(ClockFrame::new(ClockKind::Stop, 0, now_ns()))?;
            Ok(account)
        });
        release();
        let account = outcome?;
        let [input_age, target_age] = plant.ages.distributions();
        let timing = durations.timing(self.rate_hz, &periodic, &scheduling);
        Ok((account, LoopTiming { input_age, target_age, ..timing }))
    }

    fn ticks<T: TissueResponse<D>, const D: usize>(
        &mut self,
        plant: &mut PlantLoop<T, D>,
        periodic: &mut PeriodicLoop,
        durations: &mut LoopDurations,
        progress: &dyn Fn(),
    ) -> Result<CommandAccount, RuntimeError> {
        let mut account = CommandAccount::default();
        let mut previous_ns = periodic.next_release_ns();
        let mut next_look_ns = previous_ns;
        let mut heard_ns = previous_ns;
        loop {
            periodic.wait()?;
            let release = periodic.begin();
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
                plant.ages.actuate(command, now_ns());
                heard_ns = time_ns;
            } else if plant.world().needle_started_ns().is_none() {
                self.check_patience(time_ns - heard_ns)?;
            }
            plant.act(command.as_ref(), time_ns, time_ns - previous_ns)?;
            previous_ns = time_ns;
            plant.publish(release.tick, time_ns, self.ports)?;
            durations.record(&periodic.finish());
            progress();
            if time_ns >= next_look_ns {
                next_look_ns = time_ns + BETWEEN_LOOKS_NS;
                self.look(periodic.next_release_ns())?;
            }
        }
    }

    /// Nothing has come for so long, ns, and the needle waits for it.
    fn check_patience(&self, silent_ns: u64) -> Result<(), RuntimeError> {
        if u128::from(silent_ns) <= self.patience.as_nanos() {
            return Ok(());
        }
        Err(RuntimeError::PeerSilent { peer: Role::Controller, silent_s: silent_ns as f64 * 1e-9 })
    }

    /// Looks what has become of the controller.
    fn look(&mut self, next_ns: u64) -> Result<(), RuntimeError> {
        match &mut self.succession {
            Some(succession) => succession.look(self.ports, next_ns),
            None => self.peer.check::<S>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use iceoryx2::service::local;
    use model_offline::scene::Scene;
    use nalgebra::Vector2;

    use super::*;
    use crate::exchange::{ControllerPorts, Departure};
    use crate::runtime::plant::observer::{Moment, Observer};
    use crate::world::World;
    use crate::world::error::WorldError;
    use crate::world::simulation::Simulation;

    /// Tissue that nothing moves.
    #[derive(Debug)]
    struct Rigid;

    impl TissueResponse for Rigid {
        fn step(&mut self, _: f64, _: &[Vector2<f64>]) -> Result<Vector2<f64>, WorldError> {
            Ok(Vector2::zeros())
        }
    }

    /// Has seen enough before the first tick.
    #[derive(Debug)]
    struct EndsAtOnce;

    impl Observer<Rigid> for EndsAtOnce {
        fn offer(&mut self, _: &Rigid, _: &Moment) {}

        fn ends_early(&self) -> bool {
            true
        }

        fn hold(&mut self) {}
    }

    #[test]
    fn the_controller_hears_of_the_end_before_real_time_is_given_up() {
        let space = Space::unique().unwrap();
        let mut ports = PlantPorts::<local::Service>::open(&space).unwrap();
        let controller = RefCell::new(ControllerPorts::<local::Service>::open(&space).unwrap());
        ports.connect().unwrap();
        let kinds = || {
            let clock = &mut controller.borrow_mut().clock;
            std::iter::from_fn(|| clock.oldest().unwrap()).map(|frame| frame.kind().unwrap()).collect::<Vec<_>>()
        };
        let simulation = Simulation::new(&Scene::bundled("paper").unwrap());
        let mut plant = PlantLoop::new(World::simulated(Rigid, 3, &simulation), &simulation);
        plant.observed_by(Box::new(EndsAtOnce));
        let (mut peer, patience) = (Peer::Thread(Role::Controller), Duration::from_secs(1));
        let (rate_hz, period_ns) = (1000.0, 1_000_000);
        let free_run = FreeRun { ports: &mut ports, peer: &mut peer, rate_hz, period_ns, patience, succession: None };
        let (mut before, mut heard) = (Vec::new(), Vec::new());
        let asks = || {
            before = kinds();
            Scheduling::default()
        };
        free_run.run_in(&mut plant, &|| {}, asks, || heard = kinds()).unwrap();
        assert!(before.is_empty(), "real time comes before the start: {before:?}");
        assert_eq!(heard, [ClockKind::Start, ClockKind::Stop]);
        drop((ports, controller));
        space.leave::<local::Service>(Departure::Last);
    }
}
