//! Foxglove and Lichtblick look on, by [their WebSocket protocol][spec]: the topics, schemas and messages of
//! [MCAP files](crate::record::export::messages), at the rate of the page.
//!
//! ```text
//! newest snapshot ──(30 times a second, what is subscribed to)──→ messages ──(no queue: a picture is made when the one before is sent)──→ client
//! ```
//!
//! A client knows the token, like the page. It may come from any origin, since Foxglove's is not ours: browsers let any page open a
//! WebSocket, but none knows the token, and nothing that a client says changes anything but what it is told itself.
//!
//! [spec]: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md

mod connection;
mod handshake;
mod protocol;
mod teller;

pub(super) use self::handshake::{HandshakeRefusal, upgrade};

/// Its path after the token.
pub(super) const PATH: &str = "foxglove";
