//! One connection, from its first word to its last.

use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use futures_util::{SinkExt as _, Stream as _};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use tokio::task::yield_now;
use tokio::time::{Interval, MissedTickBehavior, interval, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error, Message};

use super::protocol;
use super::teller::Teller;
use crate::view::limits::PATIENCE;
use crate::view::shared::{FRAME_NS, Shared};

/// No client has to say more than this at once, bytes.
const MAX_SAID: usize = 16 * 1024;
/// Requests that are not granted before a client is shown out.
const MAX_REFUSED: u32 = 16;
/// Time for the other side to answer a goodbye.
const PARTING: Duration = Duration::from_millis(500);

type Socket = WebSocketStream<TokioIo<Upgraded>>;

/// What happens next.
enum Event {
    /// It is time to look whether something is new.
    Look,
    /// The client says something, or is gone.
    Said(Option<Result<Message, Error>>),
}

/// The client is gone, or did not take a message in time.
struct Gone;

/// Serves a client until it goes away, or the program ends.
pub(super) async fn serve(io: TokioIo<Upgraded>, shared: Arc<Shared>, session: String) {
    let config = WebSocketConfig::default()
        .read_buffer_size(4096)
        .max_message_size(Some(MAX_SAID))
        .max_frame_size(Some(MAX_SAID));
    let mut socket = WebSocketStream::from_raw_socket(io, Role::Server, Some(config)).await;
    if let Ok(last_words) = converse(&mut socket, Teller::new(shared), &session).await {
        // The other side closes once it has heard them; what it says meanwhile is not listened to.
        let parting = async {
            socket.close(Some(last_words)).await.ok()?;
            while next(&mut socket).await?.is_ok() {}
            Some(())
        };
        let _ = timeout(PARTING, parting).await;
    }
}

/// Until the end: why it is one.
async fn converse(socket: &mut Socket, mut teller: Teller, session: &str) -> Result<CloseFrame, Gone> {
    let mut looks = interval(Duration::from_nanos(FRAME_NS / 2));
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    say(socket, Message::text(protocol::server_info(session).to_string())).await?;
    say(socket, Message::text(protocol::advertise())).await?;
    let mut refused = 0;
    loop {
        let refusal = match poll_fn(|context| poll_event(socket, &mut looks, context)).await {
            Event::Look => {
                // Looked at before: what was left until then is still told.
                let is_over = teller.is_over();
                for message in teller.look() {
                    say(socket, Message::binary(message)).await?;
                }
                if is_over {
                    return Ok(close(CloseCode::Away, "the simulation is over"));
                }
                continue;
            }
            Event::Said(None) => return Err(Gone),
            Event::Said(Some(Err(Error::Capacity(_)))) => return Ok(close(CloseCode::Size, "too long")),
            Event::Said(Some(Err(_))) => return Err(Gone),
            Event::Said(Some(Ok(Message::Text(text)))) => teller.hear(&text),
            Event::Said(Some(Ok(Message::Binary(_)))) => teller.hear(""),
            // What is answered to a ping is taken before the next one is read, so that answers do not pile up.
            Event::Said(Some(Ok(_))) => {
                timely(socket.flush()).await?;
                continue;
            }
        };
        // Others have their turn after every request, and the clock moves on: without, a look is not known to be due.
        yield_now().await;
        if let Err(refusal) = refusal {
            refused += 1;
            if refused > MAX_REFUSED {
                return Ok(close(CloseCode::Policy, "too much that is not understood"));
            }
            say(socket, Message::text(protocol::warning(&refusal.to_string()).to_string())).await?;
        }
    }
}

fn close(code: CloseCode, reason: &'static str) -> CloseFrame {
    CloseFrame { code, reason: reason.into() }
}

/// A look that is due comes first: whoever says much does not see less often what is new.
fn poll_event(socket: &mut Socket, looks: &mut Interval, context: &mut Context<'_>) -> Poll<Event> {
    if looks.poll_tick(context).is_ready() {
        return Poll::Ready(Event::Look);
    }
    Pin::new(socket).poll_next(context).map(Event::Said)
}

async fn next(socket: &mut Socket) -> Option<Result<Message, Error>> {
    poll_fn(|context| Pin::new(&mut *socket).poll_next(context)).await
}

/// Sends a message. Nothing else is made or read until the other side has taken it; whoever takes none for long is dropped.
async fn say(socket: &mut Socket, message: Message) -> Result<(), Gone> {
    timely(socket.send(message)).await
}

/// What is to be done in time.
async fn timely(doing: impl Future<Output = Result<(), Error>>) -> Result<(), Gone> {
    match timeout(PATIENCE, doing).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Gone),
    }
}
