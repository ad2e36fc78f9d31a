//! The opening of a WebSocket (RFC 6455, section 4.2).

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::body::Incoming;
use hyper::header::{self, HeaderName, HeaderValue};
use hyper::{HeaderMap, Method, Request};
use hyper_util::rt::TokioIo;
use sha1::{Digest as _, Sha1};

use super::connection::serve;
use crate::view::limits::Gate;
use crate::view::shared::Shared;

/// What is spoken here: of today's Foxglove, and of Lichtblick and Foxglove before its SDK. The messages of both are the same as
/// far as they are used here.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// What every server signs with.
const RFC_6455: &[u8] = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11";

/// Why no WebSocket is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(in crate::view) enum HandshakeRefusal {
    /// Another request.
    #[error("this address is for Foxglove and Lichtblick: open it there as \"Foxglove WebSocket\"")]
    NoWebSocket,
    /// Nothing that is spoken here.
    #[error("none of the subprotocols that are spoken here: foxglove.sdk.v1, foxglove.websocket.v1")]
    Subprotocol,
    /// No place is free.
    #[error("too many look on already: close a connection")]
    Full,
}

/// What is listed in these header lines, separated by commas.
fn listed(headers: &HeaderMap, name: HeaderName) -> impl Iterator<Item = &str> {
    let lines = headers.get_all(name).into_iter().filter_map(|line| line.to_str().ok());
    lines.flat_map(|line| line.split(',').map(str::trim))
}

/// The signature that answers this key; none for what is no key.
fn signature(key: &HeaderValue) -> Option<HeaderValue> {
    (STANDARD.decode(key).ok()?.len() == 16).then_some(())?;
    let signed = Sha1::new().chain_update(key).chain_update(RFC_6455).finalize();
    HeaderValue::from_str(&STANDARD.encode(signed)).ok()
}

/// Opens a WebSocket on the connection of this request, and serves it from then on; the headers of the answer.
pub(in crate::view) fn upgrade(
    request: Request<Incoming>,
    gate: &Arc<Gate>,
    shared: Arc<Shared>,
) -> Result<[(HeaderName, HeaderValue); 4], HandshakeRefusal> {
    let headers = request.headers();
    let lists = |name, wanted: &str| listed(headers, name).any(|word| word.eq_ignore_ascii_case(wanted));
    let is_asked_for = request.method() == Method::GET
        && lists(header::CONNECTION, "upgrade")
        && lists(header::UPGRADE, "websocket")
        && lists(header::SEC_WEBSOCKET_VERSION, "13");
    let key = headers.get(header::SEC_WEBSOCKET_KEY).filter(|_| is_asked_for);
    let signature = key.and_then(signature).ok_or(HandshakeRefusal::NoWebSocket)?;
    let chosen = listed(headers, header::SEC_WEBSOCKET_PROTOCOL)
        .find_map(|offered| SUBPROTOCOLS.into_iter().find(|spoken| *spoken == offered))
        .ok_or(HandshakeRefusal::Subprotocol)?;
    let place = gate.join().ok_or(HandshakeRefusal::Full)?;
    let session = gate.session();
    drop(tokio::spawn(async move {
        // Whoever went away before the answer has no connection.
        if let Ok(upgraded) = hyper::upgrade::on(request).await {
            serve(TokioIo::new(upgraded), shared, session).await;
        }
        drop(place);
    }));
    Ok([
        (header::CONNECTION, HeaderValue::from_static("Upgrade")),
        (header::UPGRADE, HeaderValue::from_static("websocket")),
        (header::SEC_WEBSOCKET_ACCEPT, signature),
        (header::SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(chosen)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of RFC 6455, section 1.3.
    #[test]
    fn keys_are_signed_as_the_standard_has_it() {
        let signed = signature(&HeaderValue::from_static("dGhlIHNhbXBsZSBub25jZQ=="));
        assert_eq!(signed.unwrap(), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
        assert_eq!(signature(&HeaderValue::from_static("dGhlIHNhbXBsZQ==")), None, "too short");
        assert_eq!(signature(&HeaderValue::from_static("no key")), None);
    }
}
