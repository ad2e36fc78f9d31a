//! What can go wrong with shared memory.

use std::path::PathBuf;

/// Failure of the link; says what to do where that is known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The name cannot be part of a file name.
    #[error("`{name}` cannot name a link: use 1 to {longest} letters, digits, `-` or `_`")]
    Name {
        /// The name.
        name: String,
        /// Characters that a name may have.
        longest: usize,
    },
    /// The directory for the link's files cannot be made.
    #[error("cannot make the directory {} for shared memory", path.display())]
    Directory {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The directory for the link's files is not ours alone.
    #[error("{} belongs to another user, or others may write to it; choose another --link name", path.display())]
    Foreign {
        /// Where.
        path: PathBuf,
    },
    /// The directory of the link's name has other things in it.
    #[error("{} is no link's: other files are in it; choose another --link name, or move them", path.display())]
    Occupied {
        /// Where.
        path: PathBuf,
    },
    /// The link was taken down and made anew by others in the meantime.
    #[error("the link `{name}` was taken down by its last user just now; start again")]
    Replaced {
        /// Its name.
        name: String,
    },
    /// Shared memory is full.
    #[error("shared memory (/dev/shm) has {available} bytes left, the link needs {needed}: make room there")]
    Memory {
        /// Bytes left.
        available: u64,
        /// Bytes needed.
        needed: u64,
    },
    /// The node, the process's own entry in shared memory, cannot be created.
    #[error("cannot enter shared memory")]
    Node(#[source] iceoryx2::node::NodeCreationFailure),
    /// A service cannot be opened or created.
    #[error("cannot open the service `{service}`")]
    Service {
        /// Name of the service.
        service: &'static str,
        /// Why.
        source: iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenOrCreateError,
    },
    /// Somebody else already has the one place of this kind.
    #[error("somebody else already {role} `{service}` on this link; end that process or choose another --link name")]
    Taken {
        /// Name of the service.
        service: &'static str,
        /// `publishes` or `reads`.
        role: &'static str,
    },
    /// A publisher cannot be created.
    #[error("cannot publish `{service}`")]
    Publisher {
        /// Name of the service.
        service: &'static str,
        /// Why.
        source: iceoryx2::port::publisher::PublisherCreateError,
    },
    /// A subscriber cannot be created.
    #[error("cannot read `{service}`")]
    Subscriber {
        /// Name of the service.
        service: &'static str,
        /// Why.
        source: iceoryx2::port::subscriber::SubscriberCreateError,
    },
    /// Connections to new peers cannot be made.
    #[error("cannot connect `{service}` to its reader")]
    Connect {
        /// Name of the service.
        service: &'static str,
        /// Why.
        source: iceoryx2::port::update_connections::ConnectionFailure,
    },
    /// A frame did not leave.
    #[error("cannot send on `{service}`")]
    Send {
        /// Name of the service.
        service: &'static str,
        /// Why.
        source: iceoryx2::port::SendError,
    },
    /// A frame cannot be read.
    #[error("cannot receive on `{service}`")]
    Receive {
        /// Name of the service.
        service: &'static str,
        /// Why.
        source: iceoryx2::port::ReceiveError,
    },
}
