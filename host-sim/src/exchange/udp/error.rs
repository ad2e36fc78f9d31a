//! What can go wrong with the socket.

use std::net::SocketAddr;

/// Failure of the datagrams' socket; says what to do where that is known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UdpError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: is another bridge there? Choose another --listen, or port 0 for any free one")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// Nothing can be received.
    #[error("cannot receive datagrams")]
    Receive(#[source] std::io::Error),
    /// Nothing can be sent.
    #[error("cannot send datagrams to {address}: is --send-to right, and can it be reached?")]
    Send {
        /// Where to.
        address: SocketAddr,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// There is no source of randomness for the number of a run.
    #[error("no random number for the run: /dev/urandom cannot be read")]
    Random(#[source] std::io::Error),
    /// The rig never said anything that could be taken.
    #[error(
        "no sample has come for {silent_s:.1} s: does the rig send to --listen, from the address of --peer, with the run \
         of the bridge's Hello? The counts say what was refused"
    )]
    NoSamples {
        /// How long was waited, s.
        silent_s: f64,
    },
}
