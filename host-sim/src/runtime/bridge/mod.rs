//! The bridge: stands where the plant stands on the link, and has the samples from outside.
//!
//! It invents nothing. Samples that do not come are the controller's to notice, by their ages; what comes damaged, late,
//! again or from elsewhere is counted and left out. Nothing waits in it: of samples the controller takes the newest,
//! commands are sent on as they come, without VALID if they had to wait, and what is more than the buffers of kernel and link is lost and counted.

pub mod accounts;
pub mod admission;

use std::collections::BTreeMap;
use std::time::Duration;

use firmware::contract::PaddleCommand;
use firmware::contract::frames::{COMMAND_VALID, MAX_PADDLES};
use firmware::{Faults, Mode};
use iceoryx2::service::ipc;

use self::accounts::BridgeResult;
use self::admission::{Admission, Sample};
use super::error::{Role, RuntimeError};
use super::peer::introduction::Introduction;
use super::peer::{Patience, Peer};
use super::signals;
use super::time::clock::{now_ns, release_real_time, request_real_time, sleep_until};
use crate::exchange::udp::refusal::Refused;
use crate::exchange::udp::{Hello, Message, Socket, UdpError};
use crate::exchange::{ClockFrame, ClockKind, Departure, PlantPorts, Space};

/// From the start frame to tick 0: time for the controller to fall asleep.
const LEAD_NS: u64 = 20_000_000;
/// Looks at the socket and the link in a period of the controller: the most that one adds to an age is a twentieth of that.
const LOOKS_PER_PERIOD: u64 = 20;
/// Shortest time between two looks, ns. It is slept under a flood, too: whoever runs at a real-time priority and never sleeps
/// takes the controller's processor.
const SHORTEST_NAP_NS: u64 = 50_000;
/// Longest time between two looks, ns.
const LONGEST_NAP_NS: u64 = 500_000;
/// Most datagrams between two looks at the commands: a flood must not hold them up.
const BURST: usize = 64;
/// Most commands between two looks at the datagrams: what the link keeps.
const COMMANDS: usize = 8;
/// Between two Hellos, ns.
const BETWEEN_HELLOS_NS: u64 = 100_000_000;
/// Between two looks at the controller, ns.
const BETWEEN_LOOKS_NS: u64 = 16_000_000;
/// Silence of the controller after which the actuators are told to keep their positions, and how often then, ns. A command
/// that has waited longer, because this process was stopped, is not to be moved by either.
const SILENCE_NS: u64 = 100_000_000;
/// How often the last word is said: a datagram may be lost.
const LAST_WORDS: usize = 3;
/// How long the controller is waited for that has been told to stop.
const LEAVE_TIMEOUT: Duration = Duration::from_millis(500);

/// How a bridge serves a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BridgeSettings {
    /// Silence after which the controller is given up, or the rig before its first sample.
    pub patience: Duration,
    /// Least time that a datagram is under way, ns.
    pub delay_ns: u64,
    /// Time after the first sample at which the bridge ends; none: when it is told to.
    pub duration: Option<Duration>,
}

/// What is left when all is over.
#[derive(Debug)]
pub struct ServedController {
    /// The accounts.
    pub result: BridgeResult,
    /// How it ended.
    pub ended: Result<(), RuntimeError>,
}

/// Waits for a controller, then carries samples and commands until one of the two ends it. Leaves nothing behind in shared
/// memory, however it ends. `met` hears of the controller when it has come.
///
/// # Errors
/// [`RuntimeError`] of whatever happens before the controller is met; [`ServedController::ended`] has the rest.
pub fn serve(
    socket: Socket,
    space: &Space,
    settings: &BridgeSettings,
    met: &dyn Fn(&Introduction),
) -> Result<ServedController, RuntimeError> {
    let outcome = serve_in(socket, space, settings, met);
    space.leave::<ipc::Service>(Departure::Last);
    outcome
}

fn serve_in(
    socket: Socket,
    space: &Space,
    settings: &BridgeSettings,
    met: &dyn Fn(&Introduction),
) -> Result<ServedController, RuntimeError> {
    // Which paddles there are, the controller tells once it is here. One of fewer hears nothing of the second.
    let mut ports = PlantPorts::<ipc::Service>::open_for(space, MAX_PADDLES)?;
    let mut peer = Peer::Elsewhere(Box::new(space.clone()), Role::Controller);
    let mut patience = Patience::new(settings.patience);
    while !ports.has_peer() {
        // What comes too early must not be taken for news later.
        socket.receive()?;
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let outcome = Introduction::hear(space).map(|told| {
        met(&told);
        let mut bridge = Bridge::new(socket, *settings, &told);
        request_real_time();
        let ended = bridge.carry(&mut ports, &mut peer);
        bridge.say_last_words();
        release_real_time();
        ServedController { result: bridge.result(&ended), ended }
    });
    // Whatever has happened, the controller need not wait for its end, and leaves first.
    let _ = ports.clock.send(ClockFrame::new(ClockKind::Stop, 0, now_ns()));
    let mut patience = Patience::new(LEAVE_TIMEOUT);
    while ports.command.has_writer() && patience.wait::<ipc::Service>(&mut peer).is_ok() {}
    outcome
}

/// A bridge at work.
#[derive(Debug)]
struct Bridge {
    socket: Socket,
    settings: BridgeSettings,
    hello: Hello,
    admission: Admission,
    /// Samples of needle, target and paddles that were taken.
    taken: [u64; 2 + MAX_PADDLES],
    refused: Refused,
    accounts: BridgeResult,
    /// Last command of the controller or of the bridge itself, and when it was sent, ns.
    last: PaddleCommand,
    last_ns: u64,
    /// Last command of the controller, ns.
    heard_ns: u64,
    /// From one tick of the controller to the next, ns; the largest number before two were heard of.
    period_ns: u64,
    /// When the first sample came, ns.
    started_ns: Option<u64>,
}

impl Bridge {
    fn new(socket: Socket, settings: BridgeSettings, told: &Introduction) -> Self {
        let Introduction { dimension, paddles, units: [unit, _], .. } = told;
        let admission = Admission::new(socket.run(), paddles, settings.delay_ns);
        let now_ns = now_ns();
        Self {
            socket,
            settings,
            hello: Hello { dimension: u32::from(*dimension), paddles: paddles.clone(), unit: unit.clone() },
            admission,
            taken: [0; 2 + MAX_PADDLES],
            refused: Refused::default(),
            accounts: BridgeResult::default(),
            last: PaddleCommand::default(),
            last_ns: now_ns,
            heard_ns: now_ns,
            period_ns: u64::MAX,
            started_ns: None,
        }
    }

    /// Carries both ways until somebody ends it.
    fn carry(&mut self, ports: &mut PlantPorts<ipc::Service>, peer: &mut Peer) -> Result<(), RuntimeError> {
        let began_ns = now_ns();
        let (mut next_hello_ns, mut next_look_ns) = (began_ns, began_ns);
        loop {
            signals::check().map_err(stopped)?;
            let more_wait = self.take_samples(ports)?;
            self.pass_commands(ports)?;
            let now_ns = now_ns();
            match self.started_ns {
                None if now_ns >= next_hello_ns => {
                    next_hello_ns = now_ns + BETWEEN_HELLOS_NS;
                    self.check_rig(now_ns - began_ns)?;
                    self.say_hello(now_ns)?;
                }
                None => {}
                Some(started_ns) => {
                    let carried = u128::from(now_ns - started_ns);
                    if self.settings.duration.is_some_and(|duration| carried >= duration.as_nanos()) {
                        return Ok(());
                    }
                    self.watch_silence(now_ns)?;
                }
            }
            if now_ns >= next_look_ns {
                next_look_ns = now_ns + BETWEEN_LOOKS_NS;
                peer.check::<ipc::Service>()?;
                if !ports.command.has_writer() {
                    let how = "it has left without a word".to_owned();
                    return Err(RuntimeError::PeerDied { peer: Role::Controller, how });
                }
            }
            sleep_until(now_ns + if more_wait { SHORTEST_NAP_NS } else { nap_ns(self.period_ns) });
        }
    }

    /// Takes what waits at the socket, up to a burst; whether more may wait.
    fn take_samples(&mut self, ports: &mut PlantPorts<ipc::Service>) -> Result<bool, RuntimeError> {
        for _ in 0..BURST {
            let Some(received) = self.socket.receive()? else { return Ok(false) };
            let now_ns = now_ns();
            let sample = received.and_then(|datagram| self.admission.admit(&datagram, now_ns));
            match sample {
                Ok(sample) => self.publish(sample, ports, now_ns)?,
                Err(refusal) => self.refused.count(refusal),
            }
        }
        Ok(true)
    }

    fn publish(
        &mut self,
        sample: Sample,
        ports: &mut PlantPorts<ipc::Service>,
        now_ns: u64,
    ) -> Result<(), RuntimeError> {
        if self.started_ns.is_none() {
            self.started_ns = Some(now_ns);
            self.heard_ns = now_ns;
            ports.clock.send(ClockFrame::new(ClockKind::Start, 0, now_ns + LEAD_NS))?;
        }
        let stream = match sample {
            Sample::Needle(needle) => {
                ports.needle.send(needle)?;
                0
            }
            Sample::Target(target) => {
                ports.target.send(target)?;
                1
            }
            Sample::Paddle(place, paddle) => {
                let at_place = |other| (other == place).then_some(paddle);
                ports.send_paddles(&std::array::from_fn(at_place))?;
                2 + place
            }
        };
        self.taken[stream] += 1;
        Ok(())
    }

    /// Sends on what the controller has said.
    fn pass_commands(&mut self, ports: &mut PlantPorts<ipc::Service>) -> Result<(), RuntimeError> {
        for _ in 0..COMMANDS {
            let Some(mut command) = ports.command.oldest()? else { break };
            let ticks = command.tick.saturating_sub(self.last.tick);
            let since_last_ns = command.time_ns.saturating_sub(self.last.time_ns);
            self.period_ns = since_last_ns.checked_div(ticks).unwrap_or(self.period_ns);
            if now_ns().saturating_sub(command.time_ns) > SILENCE_NS {
                self.accounts.expired += u64::from(command.is_valid());
                command.flags &= !COMMAND_VALID;
            }
            let sent_ns = self.send(command);
            self.heard_ns = sent_ns;
            self.accounts.commands += 1;
            let delay_ns = sent_ns.saturating_sub(command.time_ns);
            self.accounts.largest_delay_ns = self.accounts.largest_delay_ns.max(Some(delay_ns));
        }
        Ok(())
    }

    /// Sends a command; when that was, ns. What the operating system does not take is counted: the next one comes soon.
    fn send(&mut self, command: PaddleCommand) -> u64 {
        let sent = self.socket.send(Message::Command(command), now_ns());
        self.accounts.not_sent += u64::from(sent.is_err());
        self.last = command;
        self.last_ns = now_ns();
        self.last_ns
    }

    fn say_hello(&mut self, now_ns: u64) -> Result<(), RuntimeError> {
        match self.socket.send(Message::Hello(self.hello.clone()), now_ns) {
            Err(error) if !error.is_passing() => Err(error.into()),
            Err(_) => {
                self.accounts.not_sent += 1;
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Nothing of the rig could be taken for so long, ns.
    fn check_rig(&self, silent_ns: u64) -> Result<(), RuntimeError> {
        if u128::from(silent_ns) <= self.settings.patience.as_nanos() {
            return Ok(());
        }
        Err(UdpError::NoSamples { silent_s: silent_ns as f64 * 1e-9 }.into())
    }

    /// A controller that is there and says nothing is stopped, or has no processor: nobody may move by its last word.
    fn watch_silence(&mut self, now_ns: u64) -> Result<(), RuntimeError> {
        let silent_ns = now_ns.saturating_sub(self.heard_ns);
        if silent_ns < SILENCE_NS {
            return Ok(());
        }
        if now_ns.saturating_sub(self.last_ns) >= SILENCE_NS {
            self.say_stay();
        }
        if u128::from(silent_ns) <= self.settings.patience.as_nanos() {
            return Ok(());
        }
        Err(RuntimeError::PeerSilent { peer: Role::Controller, silent_s: silent_ns as f64 * 1e-9 })
    }

    /// A command of the bridge's own: keep your positions.
    fn say_stay(&mut self) {
        let stay = PaddleCommand {
            sequence: self.last.sequence.wrapping_add(1),
            state: Mode::Safe as u32,
            time_ns: now_ns(),
            faults: Faults::WATCHDOG.bits(),
            flags: self.last.flags & !COMMAND_VALID,
            ..self.last
        };
        self.send(stay);
        self.accounts.own_commands += 1;
    }

    fn say_last_words(&mut self) {
        (0..LAST_WORDS).for_each(|_| self.say_stay());
    }

    /// Closes the accounts.
    fn result(&self, ended: &Result<(), RuntimeError>) -> BridgeResult {
        const STREAMS: [&str; 2 + MAX_PADDLES] = ["needle", "target", "paddle", "second-paddle"];
        let streams = STREAMS.iter().zip(self.taken).take(2 + self.hello.paddles.len());
        let taken: BTreeMap<_, _> = streams.map(|(name, count)| ((*name).to_owned(), count)).collect();
        BridgeResult {
            taken,
            missing: self.admission.missing(),
            refused: self.refused.by_name(),
            ended: ended.as_ref().err().map(ToString::to_string),
            ..self.accounts.clone()
        }
    }
}

/// Between two looks at the socket and the link of a controller of this period, ns.
fn nap_ns(period_ns: u64) -> u64 {
    (period_ns / LOOKS_PER_PERIOD).clamp(SHORTEST_NAP_NS, LONGEST_NAP_NS)
}

/// A signal ends a bridge as it ends everything, but not without a last word.
fn stopped(error: RuntimeError) -> RuntimeError {
    match error {
        RuntimeError::Interrupted { signal } => RuntimeError::BridgeStopped { signal },
        other => other,
    }
}
