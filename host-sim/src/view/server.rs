//! A small web server on loopback: the page, its events, and its buttons.

use std::io::{Read as _, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use model_offline::output::table_text::hex;
use serde::Deserialize;
use tiny_http::{Header, Method, Request, Response, Server};

use super::page;
use super::shared::{FRAME_NS, KnobOutOfRange, Knobs, Shared, ViewState};
use super::watch::Watch;
use crate::bench::error::SimError;
use crate::runtime::error::RuntimeError;
use crate::runtime::plant::observer::{ObservedInsertion, Observer, Spectator};

/// Pages that may look on at the same time.
const MAX_LOOKERS: usize = 4;
/// No button sends more than this.
const MAX_BODY: u64 = 4096;
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; \
                      img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A live view that is being served. It ends with the process.
#[derive(Debug)]
pub struct View {
    shared: Arc<Shared>,
    address: String,
}

/// What a button asks for.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum PageRequest {
    Pause(bool),
    Step(u64),
    Pace(u64),
    Knobs(Knobs),
    Restart,
    Finish,
}

impl View {
    /// Serves on 127.0.0.1 at this port; 0: any free one.
    ///
    /// # Errors
    /// [`SimError::View`] when the port is taken or there is no randomness for the token.
    pub fn start(port: u16, knobs: Knobs) -> Result<Self, SimError> {
        let token = token().map_err(|error| SimError::View(format!("no random token: {error}")))?;
        let server = Server::http(("127.0.0.1", port))
            .map_err(|error| SimError::View(format!("cannot listen on port {port} of 127.0.0.1: {error}")))?;
        let port = server.server_addr().to_ip().map_or(port, |address| address.port());
        let shared = Arc::new(Shared::new(knobs));
        let guard = Arc::new(Guard { token: token.clone(), port, lookers: AtomicUsize::new(0) });
        let for_threads = Arc::clone(&shared);
        std::thread::Builder::new()
            .name("view".to_owned())
            .spawn(move || {
                for request in server.incoming_requests() {
                    answer(request, &guard, &for_threads);
                }
            })
            .map_err(RuntimeError::Spawn)?;
        Ok(Self { shared, address: format!("http://127.0.0.1:{port}/{token}/") })
    }

    /// What the loop shares with it.
    pub(super) fn shared(&self) -> &Arc<Shared> {
        &self.shared
    }

    /// Where the page is, with the token that opens it.
    pub fn address(&self) -> &str {
        &self.address
    }
}

impl Spectator for View {
    fn observe(&self, insertion: ObservedInsertion<'_>) -> Box<dyn Observer> {
        Box::new(Watch::new(&self.shared, insertion))
    }
}

/// 128 bits from the operating system, as hexadecimal digits.
fn token() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(hex(&bytes))
}

/// Who may come in.
#[derive(Debug)]
struct Guard {
    token: String,
    port: u16,
    lookers: AtomicUsize,
}

impl Guard {
    /// The path after the token; none for other hosts, other origins, and a wrong token. A page elsewhere that rebinds
    /// its name to 127.0.0.1 still sends its own name as Host.
    fn path<'r>(&self, request: &'r Request) -> Option<&'r str> {
        let value = |name: &'static str| {
            let mut found = request.headers().iter().filter(move |header| header.field.equiv(name));
            (found.next().map(|header| header.value.as_str()), found.next().is_some())
        };
        let hosts = [format!("127.0.0.1:{}", self.port), format!("localhost:{}", self.port)];
        let (Some(host), false) = value("Host") else { return None };
        if !hosts.iter().any(|known| known == host) {
            return None;
        }
        if let (Some(origin), _) = value("Origin")
            && origin.strip_prefix("http://") != Some(host)
        {
            return None;
        }
        request.url().strip_prefix('/')?.strip_prefix(self.token.as_str())?.strip_prefix('/')
    }
}

fn header(name: &str, value: &str) -> Header {
    Header::from_bytes(name, value).expect("ASCII")
}

fn plain(request: Request, status: u16, text: &str) {
    // Whoever went away does not want an answer.
    let _ = request.respond(Response::from_string(text).with_status_code(status));
}

fn answer(mut request: Request, guard: &Arc<Guard>, shared: &Arc<Shared>) {
    let Some(path) = guard.path(&request).map(str::to_owned) else {
        return plain(request, 403, "forbidden: open the address that host-sim printed, with its token\n");
    };
    match (request.method().clone(), path.as_str()) {
        (Method::Get, "") => {
            let response = Response::from_string(page::PAGE)
                .with_header(header("Content-Type", "text/html; charset=utf-8"))
                .with_header(header("Content-Security-Policy", POLICY))
                .with_header(header("Cache-Control", "no-store"))
                .with_header(header("X-Content-Type-Options", "nosniff"))
                .with_header(header("Referrer-Policy", "no-referrer"));
            let _ = request.respond(response);
        }
        (Method::Get, "events") => {
            if guard.lookers.fetch_add(1, Ordering::AcqRel) >= MAX_LOOKERS {
                guard.lookers.fetch_sub(1, Ordering::AcqRel);
                return plain(request, 503, "too many pages look on already: close one\n");
            }
            let (for_thread, shared) = (Arc::clone(guard), Arc::clone(shared));
            let started = std::thread::Builder::new().name("view-events".to_owned()).spawn(move || {
                // A closed page ends with an error of its socket.
                let _ = events(request, &shared);
                for_thread.lookers.fetch_sub(1, Ordering::AcqRel);
            });
            if started.is_err() {
                guard.lookers.fetch_sub(1, Ordering::AcqRel);
            }
        }
        (Method::Post, "request") => {
            let mut body = Vec::new();
            if request.as_reader().take(MAX_BODY).read_to_end(&mut body).is_err() {
                return plain(request, 400, "unreadable\n");
            }
            let outcome =
                serde_json::from_slice(&body).map_err(Refusal::from).and_then(|request| grant(request, shared));
            match outcome {
                Ok(()) => plain(request, 204, ""),
                Err(reason) => plain(request, 400, &format!("{reason}\n")),
            }
        }
        _ => plain(request, 404, "not here\n"),
    }
}

/// Why a button's request is not granted.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Unreadable(#[from] serde_json::Error),
    #[error("{0} ticks; 1 to 1000 are possible")]
    Steps(u64),
    #[error("a pace of {0}; at most 100000 thousandths")]
    Pace(u64),
    #[error(transparent)]
    Knob(#[from] KnobOutOfRange),
}

fn grant(request: PageRequest, shared: &Shared) -> Result<(), Refusal> {
    match request {
        PageRequest::Pause(paused) => shared.set_paused(paused),
        PageRequest::Step(ticks) if (1..=1000).contains(&ticks) => shared.step(ticks),
        PageRequest::Step(ticks) => return Err(Refusal::Steps(ticks)),
        PageRequest::Pace(thousandths) if thousandths <= 100_000 => shared.set_pace(thousandths),
        PageRequest::Pace(thousandths) => return Err(Refusal::Pace(thousandths)),
        PageRequest::Knobs(knobs) => {
            knobs.check()?;
            shared.turn(knobs);
        }
        PageRequest::Restart => shared.restart(),
        PageRequest::Finish => shared.finish(),
    }
    Ok(())
}

/// Server-sent events until the page goes away: `scene` at every new insertion, `frame` at every new state.
fn events(request: Request, shared: &Shared) -> std::io::Result<()> {
    let mut writer = request.into_writer();
    writer.write_all(
        b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n\
          X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
    )?;
    let (mut insertion, mut number, mut idle) = (0, 0, 0);
    loop {
        match shared.newer(insertion, number) {
            Some(state) => {
                if state.insertion != insertion {
                    event(&mut writer, "scene", &page::scene(&state, shared))?;
                }
                event(&mut writer, "frame", &page::frame(&state, shared))?;
                ViewState { insertion, number, .. } = state;
                idle = 0;
            }
            None => {
                idle += 1;
                // A word now and then, so that a closed page is noticed.
                if idle % 60 == 0 {
                    event(&mut writer, "idle", &serde_json::json!({ "finished": shared.is_finished() }))?;
                }
            }
        }
        std::thread::sleep(Duration::from_nanos(FRAME_NS / 2));
    }
}

fn event(writer: &mut dyn Write, name: &str, data: &serde_json::Value) -> std::io::Result<()> {
    write!(writer, "event: {name}\ndata: {data}\n\n")?;
    writer.flush()
}
