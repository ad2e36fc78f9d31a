//! A small web server on loopback: who may come in, and how much of it.
//!
//! Everybody on this machine can connect, so everything is bounded before it is allocated: connections, header lines and
//! bytes, bodies, and the time that each of them may take. Whoever is slower is dropped. One request per connection.

use std::io::Read as _;
use std::net::{Ipv4Addr, TcpListener};
use std::pin::pin;
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::output::table_text::hex;
use rustix::net::sockopt::set_socket_send_buffer_size;
use tokio::net::TcpStream;

use super::limits::{Deadline, Gate, Slot};
use super::page::page_in_space;
use super::requests::answer;
use super::shared::{Knobs, Shared};
use super::watch::Watch;
use crate::bench::error::SimError;
use crate::runtime::error::RuntimeError;
use crate::runtime::plant::observer::{ObservedInsertion, Observer, PlanarBody, Spectator};
use crate::world::space::{PreparedBody, SpaceTissue};
use crate::world::tissue::TissuePlant;

/// Header lines, and bytes of all of them together with the request line.
const MAX_HEADERS: usize = 64;
const MAX_HEADER_BYTES: usize = 16 * 1024;
/// Time for the whole header.
const HEADER_TIME: Duration = Duration::from_secs(2);

/// What the kernel is asked to keep of what a connection has not taken yet, bytes: with more, a slow one would be shown a past
/// that nobody can tell from the present.
const UNSENT: usize = 64 * 1024;

/// Time for the last words to every page: a few looks at what is new.
const LAST_WORDS: Duration = Duration::from_millis(150);

/// A live view that is being served. It ends with the process.
#[derive(Debug)]
pub struct View {
    shared: Arc<Shared>,
    address: String,
    #[cfg(feature = "foxglove")]
    gate: Arc<Gate>,
}

impl View {
    /// Serves on 127.0.0.1 at this port; 0: any free one.
    ///
    /// # Errors
    /// [`SimError::ViewPort`] when the port is taken, [`SimError::ViewToken`] without randomness for the token.
    pub fn start(port: u16, knobs: Knobs) -> Result<Self, SimError> {
        Self::start_with(port, Shared::new(knobs))
    }

    /// The same for a body in space with these labels of length and stress, which its page is made for; seen from where these
    /// paddles are.
    ///
    /// # Errors
    /// As [`View::start`].
    pub fn start_in_space(
        port: u16,
        knobs: Knobs,
        geometry: &SpaceGeometry,
        units: &[String; 2],
        paddles: &[u32],
    ) -> Result<Self, SimError> {
        let page = page_in_space(geometry, units, paddles);
        Self::start_with(port, Shared::showing(knobs, page.into()))
    }

    fn start_with(port: u16, shared: Shared) -> Result<Self, SimError> {
        let token = token().map_err(|source| SimError::ViewToken { source })?;
        let failed = |source| SimError::ViewPort { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        // Connections have it from here.
        set_socket_send_buffer_size(&listener, UNSENT).map_err(|errno| failed(errno.into()))?;
        let port = listener.local_addr().map_err(failed)?.port();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let shared = Arc::new(shared);
        let address = format!("http://127.0.0.1:{port}/{token}/");
        let gate = Arc::new(Gate::new(token, port));
        let for_thread = (Arc::clone(&gate), Arc::clone(&shared));
        std::thread::Builder::new()
            .name("view".to_owned())
            .spawn(move || runtime.block_on(accept(listener, for_thread)))
            .map_err(RuntimeError::Spawn)?;
        Ok(Self {
            shared,
            address,
            #[cfg(feature = "foxglove")]
            gate,
        })
    }

    /// What the loop shares with it.
    pub(super) fn shared(&self) -> &Arc<Shared> {
        &self.shared
    }

    /// Where the page is, with the token that opens it.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Where Foxglove and Lichtblick look on, with the token that lets them in.
    #[cfg(feature = "foxglove")]
    pub fn foxglove_address(&self) -> String {
        self.address.replacen("http://", "ws://", 1) + super::foxglove::PATH
    }
}

impl Drop for View {
    /// Pages are told that this is the end, and not left to guess from a connection that breaks.
    fn drop(&mut self) {
        self.shared.end();
        std::thread::sleep(LAST_WORDS);
        #[cfg(feature = "foxglove")]
        self.gate.see_off();
    }
}

impl Spectator for View {
    fn observe<'m>(&self, insertion: ObservedInsertion<PlanarBody<'m>>) -> Box<dyn Observer<TissuePlant<'m>>> {
        Box::new(Watch::new(&self.shared, insertion))
    }

    fn observe_in_space<'m>(
        &self,
        insertion: ObservedInsertion<&PreparedBody<'m>>,
    ) -> Box<dyn Observer<SpaceTissue<'m>>> {
        Box::new(Watch::in_space(&self.shared, insertion))
    }
}

/// 128 bits from the operating system, as hexadecimal digits.
fn token() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(hex(&bytes))
}

async fn accept(listener: TcpListener, (gate, shared): (Arc<Gate>, Arc<Shared>)) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                // Beyond the limit: closed by being dropped.
                if let Some(place) = gate.connect() {
                    let (gate, shared) = (Arc::clone(&gate), Arc::clone(&shared));
                    drop(tokio::spawn(connection(stream, gate, shared, place)));
                }
            }
            // No descriptor is left, or the other side has gone already.
            Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
        }
    }
}

/// One connection, until it is answered or its time is over; what is agreed upon to go on is served elsewhere.
async fn connection(stream: TcpStream, gate: Arc<Gate>, shared: Arc<Shared>, place: Slot) {
    let deadline = Arc::new(Deadline::new());
    let for_answer = Arc::clone(&deadline);
    let service =
        service_fn(move |request| answer(request, Arc::clone(&gate), Arc::clone(&shared), Arc::clone(&for_answer)));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADER_TIME);
    http.max_headers(MAX_HEADERS).max_buf_size(MAX_HEADER_BYTES);
    let mut answered = pin!(http.serve_connection(TokioIo::new(stream), service).with_upgrades());
    let mut passed = pin!(deadline.passed());
    // Whoever went away, or sends what is no request, does not want an answer.
    std::future::poll_fn(|context| {
        let over = answered.as_mut().poll(context).is_ready() || passed.as_mut().poll(context).is_ready();
        if over { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
    drop(place);
}
