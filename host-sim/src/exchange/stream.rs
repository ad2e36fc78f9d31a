//! One direction of one service: a sender that never blocks, a receiver that keeps the newest.

use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ServiceName;
use iceoryx2::service::Service;
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::error::LinkError;
use super::wire::{Wire, WireFrame};

/// Frames that wait at most; older ones are overwritten. Enough for a stopped reader to see that time has passed,
/// short enough that draining never takes long.
const BUFFERED_FRAMES: usize = 8;

/// How long a service that another process is creating or removing right now is waited for.
const IN_FLUX_TIMEOUT: Duration = Duration::from_millis(500);

type Factory<S, F> = PortFactory<S, Wire<F>, ()>;

fn open<S: Service, F: WireFrame>(node: &Node<S>, service: &'static str) -> Result<Factory<S, F>, LinkError> {
    let name: ServiceName = service.try_into().expect("the names of services are short and plain");
    let until = Instant::now() + IN_FLUX_TIMEOUT;
    loop {
        let opened = node
            .service_builder(&name)
            .publish_subscribe::<Wire<F>>()
            .max_publishers(1)
            .max_subscribers(1)
            .max_nodes(4)
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(BUFFERED_FRAMES)
            .history_size(0)
            .open_or_create();
        match opened {
            Err(source) if in_flux(&source) && Instant::now() < until => {
                std::thread::sleep(Duration::from_millis(5));
            }
            Err(source) => {
                return Err(LinkError::Service { service, source });
            }
            Ok(factory) => return Ok(factory),
        }
    }
}

/// Whether another process is in the middle of creating or removing the service.
fn in_flux(error: &PublishSubscribeOpenOrCreateError) -> bool {
    use PublishSubscribeOpenOrCreateError as Either;
    matches!(
        error,
        Either::SystemInFlux
            | Either::PublishSubscribeOpenError(
                PublishSubscribeOpenError::IsMarkedForDestruction
                    | PublishSubscribeOpenError::ServiceInCorruptedState
                    | PublishSubscribeOpenError::HangsInCreation
            )
            | Either::PublishSubscribeCreateError(
                PublishSubscribeCreateError::ServiceInCorruptedState
                    | PublishSubscribeCreateError::IsBeingCreatedByAnotherInstance
                    | PublishSubscribeCreateError::HangsInCreation
            )
    )
}

/// Publishes frames of one type; the only one to do so.
#[derive(Debug)]
pub struct Sender<S: Service, F: WireFrame> {
    publisher: Publisher<S, Wire<F>, ()>,
    factory: Factory<S, F>,
    service: &'static str,
    published: u64,
}

impl<S: Service, F: WireFrame> Sender<S, F> {
    pub(super) fn new(node: &Node<S>) -> Result<Self, LinkError> {
        Self::of(node, F::SERVICE)
    }

    /// The same by a service of this name.
    pub(super) fn of(node: &Node<S>, service: &'static str) -> Result<Self, LinkError> {
        let factory = open(node, service)?;
        let publisher = factory
            .publisher_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|source| match source {
            PublisherCreateError::ExceedsMaxSupportedPublishers => LinkError::Taken { service, role: "publishes" },
            source => LinkError::Publisher { service, source },
        })?;
        Ok(Self { publisher, factory, service, published: 0 })
    }

    /// Publishes a frame without waiting for anybody.
    ///
    /// # Errors
    /// [`LinkError::Send`].
    pub fn send(&mut self, frame: F) -> Result<(), LinkError> {
        self.publisher.send_copy(Wire(frame)).map_err(|source| LinkError::Send { service: self.service, source })?;
        self.published += 1;
        Ok(())
    }

    /// Frames published so far.
    pub fn published(&self) -> u64 {
        self.published
    }

    /// Whether somebody reads.
    pub fn has_reader(&self) -> bool {
        use iceoryx2::service::port_factory::PortFactory as _;
        self.factory.dynamic_config().number_of_subscribers() > 0
    }

    /// Connects to readers that have come since; without this, the first frames are lost to them.
    pub(super) fn connect(&self) -> Result<(), LinkError> {
        self.publisher.update_connections().map_err(|source| LinkError::Connect { service: self.service, source })
    }
}

/// Reads frames of one type; the only one to do so.
#[derive(Debug)]
pub struct Receiver<S: Service, F: WireFrame> {
    subscriber: Subscriber<S, Wire<F>, ()>,
    factory: Factory<S, F>,
    service: &'static str,
    received: u64,
    superseded: u64,
}

impl<S: Service, F: WireFrame> Receiver<S, F> {
    pub(super) fn new(node: &Node<S>) -> Result<Self, LinkError> {
        Self::of(node, F::SERVICE)
    }

    /// The same by a service of this name.
    pub(super) fn of(node: &Node<S>, service: &'static str) -> Result<Self, LinkError> {
        let factory = open(node, service)?;
        let subscriber =
            factory.subscriber_builder().buffer_size(BUFFERED_FRAMES).create().map_err(|source| match source {
                SubscriberCreateError::ExceedsMaxSupportedSubscribers => LinkError::Taken { service, role: "reads" },
                source => LinkError::Subscriber { service, source },
            })?;
        Ok(Self { subscriber, factory, service, received: 0, superseded: 0 })
    }

    /// The oldest frame that waits.
    ///
    /// # Errors
    /// [`LinkError::Receive`].
    pub fn oldest(&mut self) -> Result<Option<F>, LinkError> {
        let sample =
            self.subscriber.receive().map_err(|source| LinkError::Receive { service: self.service, source })?;
        Ok(sample.map(|sample| {
            self.received += 1;
            sample.payload().0
        }))
    }

    /// The newest frame of those that wait; the others are counted as superseded. At most a buffer full: a sender that is
    /// faster than this reads would hold the loop up for ever.
    ///
    /// # Errors
    /// [`LinkError::Receive`].
    pub fn newest(&mut self) -> Result<Option<F>, LinkError> {
        let mut newest = None;
        for _ in 0..BUFFERED_FRAMES {
            let Some(frame) = self.oldest()? else { break };
            self.superseded += u64::from(newest.is_some());
            newest = Some(frame);
        }
        Ok(newest)
    }

    /// Frames taken out of the buffer so far.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Frames that were received together with a newer one and not used.
    pub fn superseded(&self) -> u64 {
        self.superseded
    }

    /// Whether somebody publishes.
    pub fn has_writer(&self) -> bool {
        use iceoryx2::service::port_factory::PortFactory as _;
        self.factory.dynamic_config().number_of_publishers() > 0
    }
}
