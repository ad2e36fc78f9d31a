//! The ports of both sides. Ports belong to the thread that uses them: create them there.

use std::time::{Duration, Instant};

use firmware::contract::frames::MAX_PADDLES;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::io::{CommandSink, SampleSource};
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::SignalHandlingMode;
use iceoryx2::service::Service;
use serde::{Deserialize, Serialize};

use super::error::LinkError;
use super::space::{Presence, Space};
use super::stream::{Receiver, Sender};
use super::wire::{ClockFrame, WireFrame};

fn node<S: Service>(space: &Space) -> Result<Node<S>, LinkError> {
    NodeBuilder::new()
        .config(space.config())
        // Signals belong to the program.
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<S>()
        .map_err(LinkError::Node)
}

/// Name of the service that carries the second paddle's samples.
const SECOND_PADDLE: &str = "second-paddle";

/// How long a place is tried that the dead still hold, and how often.
const DEAD_TIMEOUT: Duration = Duration::from_secs(5);
const BETWEEN_TRIALS: Duration = Duration::from_millis(20);

/// Opens a side. Where a process that was killed still holds its place, or has left it half made, clears that and tries
/// again, for a bounded time.
fn patiently<S: Service, P>(space: &Space, open: impl Fn(Presence) -> Result<P, LinkError>) -> Result<P, LinkError> {
    space.check_room()?;
    let until = Instant::now() + DEAD_TIMEOUT;
    loop {
        // One at a time: whoever finds something half made knows that nobody is at it.
        let locked = space.lock()?;
        let opened = {
            let _owner_only = Space::owner_only();
            open(space.enter(&locked)?)
        };
        match opened {
            Err(_) if Instant::now() < until && space.clear_if_dead::<S>(&locked)? => {
                drop(locked);
                std::thread::sleep(BETWEEN_TRIALS);
            }
            Err(error) => return Err(error),
            Ok(ports) => {
                space.secure()?;
                return Ok(ports);
            }
        }
    }
}

/// The side of tissue, sensors and actuator.
#[derive(Debug)]
pub struct PlantPorts<S: Service> {
    /// Needle samples out.
    pub needle: Sender<S, NeedleSample>,
    /// Target samples out.
    pub target: Sender<S, TargetSample>,
    /// Samples of the only or the first paddle out.
    pub paddle: Sender<S, PaddleSample>,
    /// Samples of the second paddle out, where there is one.
    pub second_paddle: Option<Sender<S, PaddleSample>>,
    /// Clock frames out.
    pub clock: Sender<S, ClockFrame>,
    /// Commands in.
    pub command: Receiver<S, PaddleCommand>,
    space: Space,
    // Ports go before their node, and that before this process has left.
    _node: Node<S>,
    _presence: Presence,
}

impl<S: Service> PlantPorts<S> {
    /// Opens the plant's side for one paddle.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn open(space: &Space) -> Result<Self, LinkError> {
        Self::open_for(space, 1)
    }

    /// Opens the plant's side for one paddle or two.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn open_for(space: &Space, paddles: usize) -> Result<Self, LinkError> {
        patiently::<S, _>(space, |presence| {
            let node = node::<S>(space)?;
            Ok(Self {
                command: Receiver::new(&node)?,
                needle: Sender::new(&node)?,
                target: Sender::new(&node)?,
                paddle: Sender::new(&node)?,
                second_paddle: (paddles > 1).then(|| Sender::of(&node, SECOND_PADDLE)).transpose()?,
                clock: Sender::new(&node)?,
                space: space.clone(),
                _node: node,
                _presence: presence,
            })
        })
    }

    /// Publishes the samples of a tick, in the order of the controller's table.
    ///
    /// # Errors
    /// [`LinkError::Send`].
    pub fn send_paddles(&mut self, samples: &[Option<PaddleSample>; MAX_PADDLES]) -> Result<(), LinkError> {
        let senders = [Some(&mut self.paddle), self.second_paddle.as_mut()];
        let mut sent = senders.into_iter().zip(samples).filter_map(|(sender, sample)| sender.zip(*sample));
        sent.try_for_each(|(sender, sample)| sender.send(sample))
    }

    /// Whether the controller has opened its side. It may be one of fewer paddles, which hears nothing of the second.
    pub fn has_peer(&self) -> bool {
        self.needle.has_reader()
            && self.target.has_reader()
            && self.paddle.has_reader()
            && self.clock.has_reader()
            && self.command.has_writer()
    }

    /// Connects to the controller; call once it is there and before the first frame.
    ///
    /// # Errors
    /// [`LinkError::Connect`].
    pub fn connect(&self) -> Result<(), LinkError> {
        let _owner_only = Space::owner_only();
        self.needle.connect()?;
        self.target.connect()?;
        self.paddle.connect()?;
        self.second_paddle.iter().try_for_each(Sender::connect)?;
        self.clock.connect()?;
        self.space.secure()
    }
}

/// What a receiver counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReceiveCounts {
    /// Frames taken out of the buffer.
    pub received: u64,
    /// Of these, received together with a newer one and not used.
    pub superseded: u64,
}

/// The side of the controller.
#[derive(Debug)]
pub struct ControllerPorts<S: Service> {
    needle: Receiver<S, NeedleSample>,
    target: Receiver<S, TargetSample>,
    paddle: Receiver<S, PaddleSample>,
    second_paddle: Option<Receiver<S, PaddleSample>>,
    /// Clock frames in.
    pub clock: Receiver<S, ClockFrame>,
    /// Commands out.
    pub command: Sender<S, PaddleCommand>,
    /// First failure of a read: the traits of `firmware` cannot return it, the next send does.
    failed: Option<LinkError>,
    space: Space,
    _node: Node<S>,
    _presence: Presence,
}

impl<S: Service> ControllerPorts<S> {
    /// Opens the side of a controller of one paddle; its command publisher comes last and tells the plant that all is ready.
    ///
    /// # Errors
    /// [`LinkError`]; [`LinkError::Taken`] for a second controller.
    pub fn open(space: &Space) -> Result<Self, LinkError> {
        Self::open_for(space, 1)
    }

    /// The same of a controller of one paddle or two.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_for(space: &Space, paddles: usize) -> Result<Self, LinkError> {
        patiently::<S, _>(space, |presence| {
            let node = node::<S>(space)?;
            Ok(Self {
                needle: Receiver::new(&node)?,
                target: Receiver::new(&node)?,
                paddle: Receiver::new(&node)?,
                second_paddle: (paddles > 1).then(|| Receiver::of(&node, SECOND_PADDLE)).transpose()?,
                clock: Receiver::new(&node)?,
                command: Sender::new(&node)?,
                failed: None,
                space: space.clone(),
                _node: node,
                _presence: presence,
            })
        })
    }

    /// Whether the plant has opened its side.
    pub fn has_peer(&self) -> bool {
        self.command.has_reader() && self.clock.has_writer()
    }

    /// Connects to the plant; call once it is there.
    ///
    /// # Errors
    /// [`LinkError::Connect`].
    pub fn connect(&self) -> Result<(), LinkError> {
        let _owner_only = Space::owner_only();
        self.command.connect()?;
        self.space.secure()
    }

    /// Whether a second paddle is heard of.
    pub fn has_second_paddle(&self) -> bool {
        self.second_paddle.is_some()
    }

    /// The newest samples of the paddles, in the order of the table.
    pub fn paddles(&mut self) -> [Option<PaddleSample>; MAX_PADDLES] {
        std::array::from_fn(|place| self.paddle(place))
    }

    /// What the receivers of needle, target and paddle samples counted.
    pub fn counts(&self) -> [ReceiveCounts; 3] {
        [counts(&self.needle), counts(&self.target), counts(&self.paddle)]
    }

    fn keep<F>(&mut self, outcome: Result<Option<F>, LinkError>) -> Option<F> {
        outcome.unwrap_or_else(|error| {
            self.failed.get_or_insert(error);
            None
        })
    }
}

fn counts<S: Service, F: WireFrame>(receiver: &Receiver<S, F>) -> ReceiveCounts {
    ReceiveCounts { received: receiver.received(), superseded: receiver.superseded() }
}

impl<S: Service> SampleSource for ControllerPorts<S> {
    fn needle(&mut self) -> Option<NeedleSample> {
        let outcome = self.needle.newest();
        self.keep(outcome)
    }

    fn target(&mut self) -> Option<TargetSample> {
        let outcome = self.target.newest();
        self.keep(outcome)
    }

    fn paddle(&mut self, place: usize) -> Option<PaddleSample> {
        let receiver = match place {
            0 => Some(&mut self.paddle),
            1 => self.second_paddle.as_mut(),
            _ => None,
        };
        let outcome = receiver?.newest();
        self.keep(outcome)
    }
}

impl<S: Service> CommandSink for ControllerPorts<S> {
    type Error = LinkError;

    fn send(&mut self, command: &PaddleCommand) -> Result<(), LinkError> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        self.command.send(*command)
    }
}
