//! What is said on a connection, in Foxglove's words.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::record::export::messages;

/// Opcodes of binary messages.
const DATA: u8 = 1;
const TIME: u8 = 2;

/// What a client may ask for. What else it says is not understood.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(super) enum ClientRequest {
    /// To be told of these channels.
    Subscribe {
        /// Under these numbers.
        subscriptions: Vec<Wanted>,
    },
    /// No more to be told under these numbers.
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        /// The client's own.
        subscription_ids: Vec<u32>,
    },
}

/// A channel that a client wants to be told of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Wanted {
    /// The client's own number.
    pub(super) id: u32,
    /// Channel.
    pub(super) channel_id: u64,
}

/// Topics, their schemas' names, and their schemas. Made once: a client that asks much is to cost little.
static TOPICS: LazyLock<Vec<(&str, &str, schemars::Schema)>> =
    LazyLock::new(|| messages::schemas().into_iter().collect());

/// What a client is told of them.
static ADVERTISED: LazyLock<String> = LazyLock::new(|| {
    let channel = |((topic, name, schema), id): (&(&str, &str, schemars::Schema), u64)| {
        json!({"id": id, "topic": topic, "encoding": "json", "schemaName": name, "schemaEncoding": "jsonschema",
            "schema": schema.as_value().to_string()})
    };
    let channels: Vec<Value> = TOPICS.iter().zip(1..).map(channel).collect();
    json!({"op": "advertise", "channels": channels}).to_string()
});

/// The topic of a channel.
pub(super) fn topic(channel: u64) -> Option<&'static str> {
    let place = usize::try_from(channel.checked_sub(1)?).ok()?;
    TOPICS.get(place).map(|(topic, ..)| *topic)
}

/// The first words to a client: the same `session` as long as this program runs.
pub(super) fn server_info(session: &str) -> Value {
    json!({"op": "serverInfo", "name": "stillpoint host-sim", "capabilities": ["time"], "sessionId": session,
        "metadata": {"version": env!("CARGO_PKG_VERSION")}})
}

/// Every channel with its schema.
pub(super) fn advertise() -> &'static str {
    &ADVERTISED
}

/// Something was not done.
pub(super) fn warning(message: &str) -> Value {
    json!({"op": "status", "level": 1, "message": message})
}

/// A message of a channel under this number of the client's, with its time, ns; none of what cannot be written.
pub(super) fn data(subscription: u32, time_ns: u64, message: &impl Serialize) -> Option<Vec<u8>> {
    let mut bytes = vec![DATA];
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(time_ns.to_le_bytes());
    serde_json::to_writer(&mut bytes, message).ok()?;
    Some(bytes)
}

/// The time that it is in the simulation, ns.
pub(super) fn time(time_ns: u64) -> Vec<u8> {
    let mut bytes = vec![TIME];
    bytes.extend(time_ns.to_le_bytes());
    bytes
}
