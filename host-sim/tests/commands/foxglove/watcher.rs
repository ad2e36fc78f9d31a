//! A client of Foxglove's protocol: tungstenite's side of the WebSocket, and a look at every message by its schema.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use host_sim::record::export::messages::schemas;
use serde_json::{Value, json};
use tungstenite::protocol::Role;
use tungstenite::{Message, WebSocket};

/// Longer than any patience of the server.
pub(crate) const LONG: Duration = Duration::from_secs(20);

/// All topics.
pub(crate) fn topics() -> Vec<&'static str> {
    schemas().into_iter().map(|(topic, ..)| topic).collect()
}

/// Asks for a WebSocket on this path with these header lines, the key being that of RFC 6455, section 1.3: status, head, and the
/// connection.
pub(crate) fn answer(host: &str, path: &str, lines: &[(&str, &str)]) -> (u16, String, TcpStream) {
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream.set_write_timeout(Some(LONG)).unwrap();
    let version = if lines.iter().any(|(name, _)| *name == "Sec-WebSocket-Version") {
        ""
    } else {
        "Sec-WebSocket-Version: 13\r\n"
    };
    let lines: String = lines.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let asked = format!(
        "GET {path} HTTP/1.1\r\nConnection: keep-alive, Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n{version}{lines}\r\n"
    );
    stream.write_all(asked.as_bytes()).unwrap();
    let mut head = Vec::new();
    let mut byte = [0];
    // No byte of what comes after the head is taken.
    while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|read| read == 1) {
        head.push(byte[0]);
    }
    let head = String::from_utf8(head).unwrap();
    let status = head.split_whitespace().nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    (status, head, stream)
}

/// A message of a channel.
#[derive(Clone, Debug)]
pub(crate) struct Told {
    pub(crate) topic: String,
    pub(crate) time_ns: u64,
    pub(crate) message: Value,
}

/// A client that is connected.
pub(crate) struct Watcher {
    socket: WebSocket<TcpStream>,
    pub(crate) info: Value,
    pub(crate) channels: Vec<Value>,
    /// Everything since the beginning.
    pub(crate) told: Vec<Told>,
    /// The time that it is there.
    pub(crate) clock_ns: u64,
    statuses: Vec<Value>,
    /// Numbers of subscriptions are those of channels and this.
    offset: u64,
}

impl Watcher {
    pub(crate) fn connect(address: &str, subprotocol: &str) -> Self {
        let (host, path) = address.strip_prefix("ws://").unwrap().split_once('/').unwrap();
        let lines = [("Host", host), ("Sec-WebSocket-Protocol", subprotocol)];
        let (status, head, stream) = answer(host, &format!("/{path}"), &lines);
        assert_eq!(status, 101, "{head}");
        let mut socket = WebSocket::from_raw_socket(stream, Role::Client, None);
        let mut text = || serde_json::from_str::<Value>(socket.read().unwrap().to_text().unwrap()).unwrap();
        let (info, advertised) = (text(), text());
        assert_eq!(advertised["op"], "advertise");
        let channels = advertised["channels"].as_array().unwrap().clone();
        Self { socket, info, channels, told: Vec::new(), clock_ns: 0, statuses: Vec::new(), offset: 1000 }
    }

    fn channel(&self, topic: &str) -> u64 {
        let channel = self.channels.iter().find(|channel| channel["topic"] == topic).unwrap();
        channel["id"].as_u64().unwrap()
    }

    pub(crate) fn subscribe(&mut self, topics: &[&str]) {
        let wanted = |topic: &&str| {
            let channel = self.channel(topic);
            json!({"id": channel + self.offset, "channelId": channel})
        };
        let subscriptions: Vec<Value> = topics.iter().map(wanted).collect();
        self.say(&json!({"op": "subscribe", "subscriptions": subscriptions}).to_string());
    }

    pub(crate) fn unsubscribe(&mut self, topic: &str) {
        let id = self.channel(topic) + self.offset;
        self.say(&json!({"op": "unsubscribe", "subscriptionIds": [id]}).to_string());
    }

    pub(crate) fn say(&mut self, text: &str) {
        // Whoever was shown out meanwhile is told so when it reads.
        let _ = self.socket.send(Message::text(text.to_owned()));
    }

    pub(crate) fn publish(&mut self, bytes: &[u8]) {
        self.socket.send(Message::binary(bytes.to_vec())).unwrap();
    }

    /// Whether a ping is taken.
    pub(crate) fn ping(&mut self, bytes: &[u8]) -> bool {
        self.socket.send(Message::Ping(bytes.to_vec().into())).is_ok()
    }

    /// Says something that is answered by a status.
    pub(crate) fn ask(&mut self, asked: &Value) -> Value {
        self.say(&asked.to_string());
        self.status()
    }

    /// The next status.
    pub(crate) fn status(&mut self) -> Value {
        let known = self.statuses.len();
        while self.statuses.len() == known {
            let message = self.socket.read().unwrap();
            self.hear(&message);
        }
        self.statuses[known].clone()
    }

    /// Reads until everything that was told is enough; each message satisfies its schema.
    pub(crate) fn until(&mut self, mut is_enough: impl FnMut(&[Told]) -> bool) -> Vec<Told> {
        let until = Instant::now() + 6 * LONG;
        while !is_enough(&self.told) {
            let message = self.socket.read().unwrap();
            self.hear(&message);
            assert!(Instant::now() < until, "{:?}", self.told.iter().map(|told| &told.topic).collect::<Vec<_>>());
        }
        self.told.clone()
    }

    fn hear(&mut self, message: &Message) {
        match message {
            Message::Text(text) => self.statuses.push(serde_json::from_str(text).unwrap()),
            Message::Binary(bytes) => match bytes[0] {
                1 => {
                    let id = u64::from(u32::from_le_bytes(bytes[1..5].try_into().unwrap()));
                    let channel = self.channels.iter().find(|c| c["id"] == id - self.offset).unwrap();
                    let message = serde_json::from_slice(&bytes[13..]).unwrap();
                    let schema: Value = serde_json::from_str(channel["schema"].as_str().unwrap()).unwrap();
                    let topic = channel["topic"].as_str().unwrap().to_owned();
                    satisfies(&schema, &message).unwrap_or_else(|why| panic!("{topic}{why}: {message}"));
                    let time_ns = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
                    self.told.push(Told { topic, time_ns, message });
                }
                2 => {
                    assert_eq!(bytes.len(), 9);
                    self.clock_ns = u64::from_le_bytes(bytes[1..].try_into().unwrap());
                }
                other => panic!("opcode {other}"),
            },
            _ => {}
        }
    }

    /// Reads to the end: the code of the goodbye, if there is one.
    pub(crate) fn rest(&mut self) -> Option<u16> {
        let mut code = None;
        while let Ok(message) = self.socket.read() {
            if let Message::Close(Some(goodbye)) = &message {
                code = Some(goodbye.code.into());
            }
        }
        code
    }
}

/// Whether a message is what its schema says, as far as schemas here go; else where it is not.
pub(crate) fn satisfies(schema: &Value, message: &Value) -> Result<(), String> {
    let is_right = match schema["type"].as_str() {
        Some("object") => {
            let (properties, members) = (&schema["properties"], message.as_object().ok_or(" is no object")?);
            let required = schema["required"].as_array().into_iter().flatten();
            if let Some(absent) = required.into_iter().find(|name| !members.contains_key(name.as_str().unwrap())) {
                return Err(format!(" lacks {absent}"));
            }
            for (name, member) in members {
                let schema = properties.get(name).ok_or_else(|| format!(".{name} is not described"))?;
                satisfies(schema, member).map_err(|why| format!(".{name}{why}"))?;
            }
            true
        }
        Some("array") => {
            let items = message.as_array().ok_or(" is no array")?;
            items.iter().try_for_each(|item| satisfies(&schema["items"], item).map_err(|why| format!("[]{why}")))?;
            true
        }
        Some("number") => message.is_number(),
        Some("integer") => {
            let within = |bound: &str, is: fn(f64, f64) -> bool| {
                schema[bound].as_f64().is_none_or(|bound| message.as_f64().is_some_and(|value| is(value, bound)))
            };
            (message.is_u64() || message.is_i64())
                && within("minimum", |v, b| v >= b)
                && within("maximum", |v, b| v <= b)
        }
        Some("boolean") => message.is_boolean(),
        Some("string") => message.is_string(),
        _ => false,
    };
    if is_right { Ok(()) } else { Err(format!(" is no {}", schema["type"])) }
}
