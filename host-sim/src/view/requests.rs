//! What is asked for, and the answers.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use http_body_util::{BodyExt as _, Full, LengthLimitError, Limited};
use hyper::body::{Body, Bytes, Frame, Incoming};
use hyper::{Method, Request, Response, StatusCode, header};
use serde::Deserialize;

use super::events::Events;
#[cfg(feature = "foxglove")]
use super::foxglove::HandshakeRefusal;
use super::limits::{Deadline, Gate};
use super::shared::{KnobOutOfRange, Knobs, Shared};

/// No button sends more than this, bytes.
const MAX_BODY: usize = 4096;
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; \
                      img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

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

/// The body of an answer.
#[derive(Debug)]
pub(super) enum HttpReply {
    /// All of it.
    Whole(Full<Bytes>),
    /// Events until the page goes away.
    Events(Box<Events>),
}

impl Body for HttpReply {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        match self.get_mut() {
            Self::Whole(body) => Pin::new(body).poll_frame(context),
            Self::Events(events) => events.poll_next(context).map(|event| Some(Ok(Frame::data(event)))),
        }
    }

    fn size_hint(&self) -> hyper::body::SizeHint {
        match self {
            Self::Whole(body) => body.size_hint(),
            Self::Events(_) => hyper::body::SizeHint::default(),
        }
    }
}

fn whole(status: StatusCode, kind: &'static str, text: impl Into<Bytes>) -> Response<HttpReply> {
    let mut response = Response::new(HttpReply::Whole(Full::new(text.into())));
    *response.status_mut() = status;
    let fixed = [
        // One request per connection. Hyper's own setting would say so of a WebSocket, too, which some clients refuse then.
        (header::CONNECTION, "close"),
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    let headers = response.headers_mut();
    for (name, value) in fixed {
        headers.insert(name, header::HeaderValue::from_static(value));
    }
    response
}

fn plain(status: StatusCode, text: impl Into<Bytes>) -> Response<HttpReply> {
    whole(status, "text/plain; charset=utf-8", text)
}

/// The path after the token, and whether the request comes from no other origin; none for other hosts, and a wrong token.
/// A page elsewhere that rebinds its name to 127.0.0.1 still sends its own name as Host.
fn path<'r, B>(request: &'r Request<B>, gate: &Gate) -> Option<(&'r str, bool)> {
    let value = |name: header::HeaderName| {
        let mut found = request.headers().get_all(name).iter();
        (found.next().map(|value| value.to_str().unwrap_or_default()), found.next().is_some())
    };
    let (Some(host), false) = value(header::HOST) else { return None };
    if ![format!("127.0.0.1:{}", gate.port), format!("localhost:{}", gate.port)].iter().any(|known| known == host) {
        return None;
    }
    let is_ours = match value(header::ORIGIN) {
        (Some(origin), several) => !several && origin.strip_prefix("http://") == Some(host),
        (None, _) => true,
    };
    if request.uri().authority().is_some() {
        return None;
    }
    let path = request.uri().path_and_query()?.as_str();
    let path = path.strip_prefix('/')?.strip_prefix(gate.token.as_str())?.strip_prefix('/')?;
    Some((path, is_ours))
}

/// A WebSocket for whom has the token, wherever its page comes from: Foxglove's web application and a Lichtblick of one's own have
/// origins of theirs. It shows, and changes nothing.
#[cfg(feature = "foxglove")]
fn websocket(request: Request<Incoming>, gate: &Arc<Gate>, shared: Arc<Shared>) -> Response<HttpReply> {
    match super::foxglove::upgrade(request, gate, shared) {
        Ok(headers) => {
            let mut response = plain(StatusCode::SWITCHING_PROTOCOLS, "");
            response.headers_mut().clear();
            response.headers_mut().extend(headers.map(|(name, value)| (Some(name), value)));
            response
        }
        Err(refusal @ HandshakeRefusal::Full) => plain(StatusCode::SERVICE_UNAVAILABLE, format!("{refusal}\n")),
        Err(refusal) => plain(StatusCode::BAD_REQUEST, format!("{refusal}\n")),
    }
}

/// Answers a request. A body is read only from who has the token, and never more than a button sends.
pub(super) async fn answer(
    request: Request<Incoming>,
    gate: Arc<Gate>,
    shared: Arc<Shared>,
    deadline: Arc<Deadline>,
) -> Result<Response<HttpReply>, Infallible> {
    let asked = path(&request, &gate);
    #[cfg(feature = "foxglove")]
    if asked.is_some_and(|(path, _)| path == super::foxglove::PATH) {
        return Ok(websocket(request, &gate, shared));
    }
    let Some((path, true)) = asked else {
        let text = "forbidden: open the address that host-sim printed, with its token\n";
        return Ok(plain(StatusCode::FORBIDDEN, text));
    };
    Ok(match (request.method(), path) {
        (&Method::GET, "") => whole(StatusCode::OK, "text/html; charset=utf-8", shared.page()),
        (&Method::GET, "events") => match gate.look_on() {
            None => plain(StatusCode::SERVICE_UNAVAILABLE, "too many pages look on already: close one\n"),
            Some(place) => {
                let mut response = whole(StatusCode::OK, "text/event-stream", "");
                *response.body_mut() = HttpReply::Events(Box::new(Events::new(shared, deadline, place)));
                response
            }
        },
        (&Method::POST, "request") => match button(request.into_body()).await.and_then(|asked| grant(asked, &shared)) {
            Ok(()) => plain(StatusCode::NO_CONTENT, ""),
            Err(refusal @ HttpRefusal::TooLong) => plain(StatusCode::PAYLOAD_TOO_LARGE, format!("{refusal}\n")),
            Err(refusal) => plain(StatusCode::BAD_REQUEST, format!("{refusal}\n")),
        },
        _ => plain(StatusCode::NOT_FOUND, "not here\n"),
    })
}

/// What a button sent. A length that is too large is refused before anything is read.
async fn button(body: Incoming) -> Result<PageRequest, HttpRefusal> {
    if body.size_hint().lower() > MAX_BODY as u64 {
        return Err(HttpRefusal::TooLong);
    }
    let read = Limited::new(body, MAX_BODY).collect().await;
    let body =
        read.map_err(|error| if error.is::<LengthLimitError>() { HttpRefusal::TooLong } else { HttpRefusal::CutOff })?;
    Ok(serde_json::from_slice(&body.to_bytes())?)
}

/// Why a button's request is not granted.
#[derive(Debug, thiserror::Error)]
enum HttpRefusal {
    #[error("no button sends more than {MAX_BODY} bytes")]
    TooLong,
    #[error("the request ended early")]
    CutOff,
    #[error(transparent)]
    Unreadable(#[from] serde_json::Error),
    #[error("{0} ticks; 1 to 1000 are possible")]
    Steps(u64),
    #[error("a pace of {0}; at most 100000 thousandths")]
    Pace(u64),
    #[error(transparent)]
    Knob(#[from] KnobOutOfRange),
}

fn grant(request: PageRequest, shared: &Shared) -> Result<(), HttpRefusal> {
    match request {
        PageRequest::Pause(paused) => shared.set_paused(paused),
        PageRequest::Step(ticks) if (1..=1000).contains(&ticks) => shared.step(ticks),
        PageRequest::Step(ticks) => return Err(HttpRefusal::Steps(ticks)),
        PageRequest::Pace(thousandths) if thousandths <= 100_000 => shared.set_pace(thousandths),
        PageRequest::Pace(thousandths) => return Err(HttpRefusal::Pace(thousandths)),
        PageRequest::Knobs(knobs) => {
            knobs.check()?;
            shared.turn(knobs);
        }
        PageRequest::Restart => shared.restart(),
        PageRequest::Finish => shared.finish(),
    }
    Ok(())
}
