//! The bridge's socket: numbers what it sends, takes datagrams of one address, never waits.

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};

use super::datagram::{Datagram, LONGEST, Message};
use super::error::UdpError;
use super::refusal::Refusal;
use crate::exchange::space::random_key;

/// Where samples come from and commands go to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Addresses {
    /// Where samples are listened for.
    pub listen: SocketAddr,
    /// Where commands are sent to.
    pub send_to: SocketAddr,
    /// Whose datagrams are taken, from any of its ports.
    pub peer: IpAddr,
}

/// The bridge's end.
#[derive(Debug)]
pub struct Socket {
    socket: UdpSocket,
    addresses: Addresses,
    run: u64,
    sent: u64,
}

impl Socket {
    /// Listens, and draws a number for this run.
    ///
    /// # Errors
    /// [`UdpError::Bind`], [`UdpError::Random`].
    pub fn open(addresses: Addresses) -> Result<Self, UdpError> {
        let failed = |source| UdpError::Bind { address: addresses.listen, source };
        let socket = UdpSocket::bind(addresses.listen).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        let listen = socket.local_addr().map_err(failed)?;
        let key = random_key().map_err(UdpError::Random)?;
        let run = u64::from_str_radix(&key, 16).map_err(|error| UdpError::Random(std::io::Error::other(error)))?;
        Ok(Self { socket, addresses: Addresses { listen, ..addresses }, run, sent: 0 })
    }

    /// The addresses, with the port that is listened on.
    pub fn addresses(&self) -> &Addresses {
        &self.addresses
    }

    /// Number of this run.
    pub fn run(&self) -> u64 {
        self.run
    }

    /// The next datagram that waits, if there is one.
    ///
    /// # Errors
    /// [`UdpError::Receive`].
    pub fn receive(&self) -> Result<Option<Result<Datagram, Refusal>>, UdpError> {
        // One byte more than the longest: the rest of a longer one is cut off by the kernel.
        let mut bytes = [0; LONGEST + 1];
        match self.socket.recv_from(&mut bytes) {
            Ok((_, from)) if from.ip() != self.addresses.peer => Ok(Some(Err(Refusal::Foreign))),
            Ok((length, _)) => Ok(Some(Datagram::decode(bytes.get(..length).unwrap_or(&[])))),
            Err(error) if is_passing(&error) => Ok(None),
            Err(error) => Err(UdpError::Receive(error)),
        }
    }

    /// Sends a message without waiting.
    ///
    /// # Errors
    /// [`UdpError::Send`].
    pub fn send(&mut self, message: Message, sent_ns: u64) -> Result<(), UdpError> {
        let datagram = Datagram { run: self.run, number: self.sent, sent_ns, message };
        self.sent += 1;
        let address = self.addresses.send_to;
        match self.socket.send_to(&datagram.encode(), address) {
            Ok(_) => Ok(()),
            Err(source) => Err(UdpError::Send { address, source }),
        }
    }
}

impl UdpError {
    /// Whether it may be over in a moment: nobody listens yet, or the kernel's buffer is full.
    pub fn is_passing(&self) -> bool {
        matches!(self, Self::Send { source, .. } if is_passing(source))
    }
}

fn is_passing(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted | ErrorKind::ConnectionRefused)
}
