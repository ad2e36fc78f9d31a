//! The other process of an exchange: polls without sleeping, answers, ends when it is told to.

use std::os::unix::net::UnixDatagram;

use clap::ValueEnum;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, Table, TargetSample};
use firmware::io::{CommandSink, SampleSource};
use firmware::{Controller, Inputs, State};
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{ServiceName, SignalHandlingMode};
use iceoryx2::service::ipc;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::machine::pin;
use super::spin::Spin;
use crate::exchange::{ControllerPorts, Space};
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::signals;
use crate::runtime::time::clock::{release_real_time, request_real_time_at};
use crate::world::loop_settings::LoopSettings;

/// What is exchanged, and over what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Transport {
    /// Needle, target and paddle samples and the command over the link, with the controller's step.
    Link,
    /// 32 bytes there and 64 bytes back over iceoryx2 itself, without anything else.
    Bare,
    /// The same samples and the same step over a Unix socket.
    Socket,
}

/// Polls between two looks at whether the other side is still there.
const POLLS_PER_LOOK: u64 = 4096;

/// What the other process of an exchange does.
#[derive(Clone, Copy, Debug)]
pub struct PeerOptions<'o> {
    /// What to answer.
    pub transport: Transport,
    /// Name of the link.
    pub link: &'o str,
    /// Table of the controller.
    pub table: &'o Table<f64, 2>,
    /// Rates, latency, noise.
    pub loop_settings: LoopSettings,
    /// Processor to stay on.
    pub cpu: Option<usize>,
    /// Real-time priority to ask for.
    pub priority: u8,
}

/// Samples over a socket.
pub(super) type Datagram = (NeedleSample, Option<TargetSample>, PaddleSample);

/// Longest datagram, bytes.
pub(super) const DATAGRAM: usize = 256;

/// Answers until the other side has gone.
///
/// # Errors
/// [`RuntimeError`].
pub fn answer(options: &PeerOptions<'_>) -> Result<(), RuntimeError> {
    let settings = options.loop_settings.settings(options.table.validity.depth_end);
    let mut stepper = Stepper {
        controller: Controller::new(options.table, &settings)?,
        state: State::new(),
        period_ns: options.loop_settings.period_ns(),
    };
    if let Some(processor) = options.cpu {
        pin(processor);
    }
    match options.transport {
        Transport::Link => over_link(options, &mut stepper)?,
        Transport::Bare => over_bare(options)?,
        Transport::Socket => over_socket(options, &mut stepper)?,
    }
    release_real_time();
    Ok(())
}

/// A controller that takes samples as they come.
struct Stepper<'t> {
    controller: Controller<'t, f64>,
    state: State<f64>,
    period_ns: u64,
}

impl Stepper<'_> {
    fn step(
        &mut self,
        (needle, target, paddle): (NeedleSample, Option<TargetSample>, Option<PaddleSample>),
    ) -> PaddleCommand {
        // Samples are measured at releases: their time says which, and skipped ones leave gaps.
        let (tick, time_ns) = (needle.time_ns / self.period_ns, needle.time_ns);
        let inputs = Inputs { tick, time_ns, needle: Some(needle), target, paddles: [paddle, None] };
        self.controller.step(&mut self.state, &inputs)
    }
}

fn over_link(options: &PeerOptions<'_>, stepper: &mut Stepper<'_>) -> Result<(), RuntimeError> {
    let space = Space::new(options.link)?;
    let mut ports = ControllerPorts::<ipc::Service>::open(&space)?;
    while !ports.has_peer() {
        look()?;
    }
    ports.connect()?;
    request_real_time_at(options.priority);
    poll(|look| {
        let Some(needle) = ports.needle() else { return Ok(nothing(!look || ports.has_peer())) };
        let command = stepper.step((needle, ports.target(), ports.paddle(0)));
        ports.send(&command)?;
        Ok(Polled::Answered)
    })
}

fn over_bare(options: &PeerOptions<'_>) -> Result<(), RuntimeError> {
    let space = Space::new(options.link)?;
    let bare = Bare::open(&space, "pong", "ping")?;
    while !bare.has_peer() {
        look()?;
    }
    request_real_time_at(options.priority);
    poll(|look| {
        let Some(ping) = bare.receive()? else { return Ok(nothing(!look || bare.has_peer())) };
        bare.send(ping)?;
        Ok(Polled::Answered)
    })
}

fn over_socket(options: &PeerOptions<'_>, stepper: &mut Stepper<'_>) -> Result<(), RuntimeError> {
    // The socket is standard input: it has no name that anybody could connect to.
    let input = std::os::fd::AsFd::as_fd(&std::io::stdin()).try_clone_to_owned().map_err(RuntimeError::Spawn)?;
    let socket = UnixDatagram::from(input);
    socket.set_nonblocking(true).map_err(RuntimeError::Spawn)?;
    request_real_time_at(options.priority);
    let mut buffer = [0; DATAGRAM];
    poll(|_| {
        let length = match socket.recv(&mut buffer) {
            Ok(length) => length,
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => return Ok(Polled::Nothing),
            Err(_) => return Ok(Polled::Gone),
        };
        let Ok((needle, target, paddle)) = postcard::from_bytes::<Datagram>(&buffer[..length]) else {
            return Ok(Polled::Gone); // The empty datagram is the end.
        };
        let command = stepper.step((needle, target, Some(paddle)));
        let mut answer = [0; DATAGRAM];
        if let Ok(bytes) = postcard::to_slice(&command, &mut answer) {
            let _ = socket.send(bytes);
        }
        Ok(Polled::Answered)
    })
}

fn look() -> Result<(), RuntimeError> {
    signals::check()?;
    std::thread::sleep(std::time::Duration::from_millis(1));
    Ok(())
}

/// What a poll found.
enum Polled {
    Nothing,
    Answered,
    /// Nobody is left on the other side.
    Gone,
}

fn nothing(is_there: bool) -> Polled {
    if is_there { Polled::Nothing } else { Polled::Gone }
}

/// Calls `answer` until it says that the other side has gone; it is told when it is time to look for that.
fn poll(mut answer: impl FnMut(bool) -> Result<Polled, RuntimeError>) -> Result<(), RuntimeError> {
    let (mut polls, mut spin): (u64, _) = (0, Spin::default());
    // A nap is long: after each of them there is time to look.
    let mut napped = false;
    loop {
        polls += 1;
        let look = napped || polls.is_multiple_of(POLLS_PER_LOOK);
        if look {
            signals::check()?;
        }
        match answer(look)? {
            Polled::Nothing => napped = spin.nothing(),
            Polled::Answered => {
                spin.something();
                napped = false;
            }
            Polled::Gone => return Ok(()),
        }
    }
}

/// Two plain services of 64 bytes, as the first example of iceoryx2 has them: what the link is compared with.
pub(super) struct Bare {
    publisher: Publisher<ipc::Service, Payload, ()>,
    subscriber: Subscriber<ipc::Service, Payload, ()>,
    out: PortFactory<ipc::Service, Payload, ()>,
    _back: PortFactory<ipc::Service, Payload, ()>,
    _node: Node<ipc::Service>,
}

/// 64 bytes.
type Payload = [u64; 8];

impl Bare {
    /// Publishes `out` and reads `back`.
    pub(super) fn open(space: &Space, out: &str, back: &str) -> Result<Self, RuntimeError> {
        let failed =
            |error: &dyn std::fmt::Display| RuntimeError::Protocol { peer: Role::BareService, what: error.to_string() };
        let node = NodeBuilder::new()
            .config(space.config())
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| failed(&error))?;
        let service = |name: &str| {
            let name: ServiceName = name.try_into().map_err(|_| failed(&"name"))?;
            node.service_builder(&name).publish_subscribe::<Payload>().open_or_create().map_err(|error| failed(&error))
        };
        let (out, back) = (service(out)?, service(back)?);
        let publisher = out.publisher_builder().create().map_err(|error| failed(&error))?;
        let subscriber = back.subscriber_builder().create().map_err(|error| failed(&error))?;
        Ok(Self { publisher, subscriber, out, _back: back, _node: node })
    }

    /// Whether somebody reads what is published.
    pub(super) fn has_peer(&self) -> bool {
        self.out.dynamic_config().number_of_subscribers() > 0
    }

    pub(super) fn send(&self, payload: Payload) -> Result<(), RuntimeError> {
        let sent = self.publisher.send_copy(payload);
        sent.map(drop).map_err(|error| RuntimeError::Protocol { peer: Role::BareService, what: error.to_string() })
    }

    pub(super) fn receive(&self) -> Result<Option<Payload>, RuntimeError> {
        let sample = self.subscriber.receive();
        let sample =
            sample.map_err(|error| RuntimeError::Protocol { peer: Role::BareService, what: error.to_string() })?;
        Ok(sample.map(|sample| *sample.payload()))
    }
}
