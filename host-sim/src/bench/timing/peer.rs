//! The other process of an exchange: polls without sleeping, answers, ends when it is told to.

use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use firmware::contract::{NeedleSample, PaddleSample, TargetSample};
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
use crate::commands::controller::read_table;
use crate::error::SimError;
use crate::exchange::{ControllerPorts, Space};
use crate::runtime::clock::{release_real_time, request_real_time_at};
use crate::runtime::signals;
use crate::world::loop_settings::LoopArgs;

/// What is exchanged, and over what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Exchange {
    /// Needle, target and paddle samples and the command over the link, with the controller's step.
    Link,
    /// 32 bytes there and 64 bytes back over iceoryx2 itself, without anything else.
    Bare,
    /// The same samples and the same step over a Unix socket.
    Socket,
}

/// Polls between two looks at whether the other side is still there.
const POLLS_PER_LOOK: u64 = 4096;

/// Options of the peer process.
#[derive(Args, Clone, Debug)]
pub struct PeerArgs {
    /// What to answer
    #[arg(long, value_enum)]
    pub exchange: Exchange,
    /// Name of the link
    #[arg(long)]
    pub link: String,
    /// Controller table
    #[arg(long)]
    pub table: PathBuf,
    /// Loop rate, Hz
    #[arg(long)]
    pub rate: f64,
    /// Processor to stay on
    #[arg(long)]
    pub cpu: Option<usize>,
    /// Real-time priority to ask for
    #[arg(long)]
    pub priority: u8,
}

/// Samples over a socket.
pub(super) type Datagram = (NeedleSample, Option<TargetSample>, PaddleSample);

/// Longest datagram, bytes.
pub(super) const DATAGRAM: usize = 256;

/// Answers until the other side has gone.
///
/// # Errors
/// [`SimError`].
pub fn peer(args: &PeerArgs) -> Result<(), SimError> {
    signals::install();
    let (table, _) = read_table(&args.table)?;
    let loop_args = LoopArgs { rate: args.rate, target_rate: f64::min(50.0, args.rate), latency: 20.0, noise: None };
    let settings = loop_args.settings(table.validity.depth_end);
    let controller = Controller::new(&table, &settings)?;
    let mut state = State::new();
    if let Some(processor) = args.cpu {
        pin(processor);
    }
    match args.exchange {
        Exchange::Link => {
            let space = Space::new(&args.link)?;
            let mut ports = ControllerPorts::<ipc::Service>::open(&space)?;
            while !ports.has_peer() {
                look()?;
            }
            ports.connect()?;
            request_real_time_at(args.priority);
            let mut tick = 0;
            poll(|look| {
                let Some(needle) = ports.needle() else { return Ok(!look || ports.has_peer()) };
                let inputs = Inputs {
                    tick,
                    time_ns: needle.time_ns,
                    needle: Some(needle),
                    target: ports.target(),
                    paddle: ports.paddle(),
                };
                tick += 1;
                let command = controller.step(&mut state, &inputs);
                ports.send(&command)?;
                Ok(true)
            })?;
        }
        Exchange::Bare => {
            let space = Space::new(&args.link)?;
            let bare = Bare::open(&space, "pong", "ping")?;
            while !bare.has_peer() {
                look()?;
            }
            request_real_time_at(args.priority);
            poll(|look| {
                let Some(ping) = bare.receive()? else { return Ok(!look || bare.has_peer()) };
                bare.send(ping)?;
                Ok(true)
            })?;
        }
        Exchange::Socket => {
            // The socket is standard input: it has no name that anybody could connect to.
            let input = std::os::fd::AsFd::as_fd(&std::io::stdin()).try_clone_to_owned().map_err(SimError::Spawn)?;
            let socket = UnixDatagram::from(input);
            socket.set_nonblocking(true).map_err(SimError::Spawn)?;
            request_real_time_at(args.priority);
            let mut buffer = [0; DATAGRAM];
            let mut tick = 0;
            poll(|_| {
                let length = match socket.recv(&mut buffer) {
                    Ok(length) => length,
                    Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => return Ok(true),
                    Err(_) => return Ok(false),
                };
                let Ok((needle, target, paddle)) = postcard::from_bytes::<Datagram>(&buffer[..length]) else {
                    return Ok(false); // The empty datagram is the end.
                };
                let inputs =
                    Inputs { tick, time_ns: needle.time_ns, needle: Some(needle), target, paddle: Some(paddle) };
                tick += 1;
                let command = controller.step(&mut state, &inputs);
                let mut answer = [0; DATAGRAM];
                if let Ok(bytes) = postcard::to_slice(&command, &mut answer) {
                    let _ = socket.send(bytes);
                }
                Ok(true)
            })?;
        }
    }
    release_real_time();
    Ok(())
}

fn look() -> Result<(), SimError> {
    signals::check()?;
    std::thread::sleep(std::time::Duration::from_millis(1));
    Ok(())
}

/// Calls `answer` until it says that the other side has gone; it is told when it is time to look for that.
fn poll(mut answer: impl FnMut(bool) -> Result<bool, SimError>) -> Result<(), SimError> {
    let mut polls: u64 = 0;
    loop {
        polls += 1;
        let look = polls.is_multiple_of(POLLS_PER_LOOK);
        if look {
            signals::check()?;
        }
        if !answer(look)? {
            return Ok(());
        }
        std::hint::spin_loop();
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
    pub(super) fn open(space: &Space, out: &str, back: &str) -> Result<Self, SimError> {
        let failed = |error: &dyn std::fmt::Display| SimError::Protocol { peer: "bare", what: error.to_string() };
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

    pub(super) fn send(&self, payload: Payload) -> Result<(), SimError> {
        let sent = self.publisher.send_copy(payload);
        sent.map(drop).map_err(|error| SimError::Protocol { peer: "bare", what: error.to_string() })
    }

    pub(super) fn receive(&self) -> Result<Option<Payload>, SimError> {
        let sample = self.subscriber.receive();
        let sample = sample.map_err(|error| SimError::Protocol { peer: "bare", what: error.to_string() })?;
        Ok(sample.map(|sample| *sample.payload()))
    }
}
