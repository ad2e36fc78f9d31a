//! The host's end of the serial line.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use firmware::serial::{Frame, FrameReader, FrameWriter, LineLedger, Reply, Request};

use super::error::BoardError;
use super::tamper::Tamper;

/// Sends requests, receives replies; a thread reads.
///
/// Any pair of byte streams will do. Here the other end is nobody:
///
/// ```
/// use host_sim::exchange::board::{BoardError, SerialLine};
/// use std::time::Instant;
///
/// let mut line = SerialLine::new(std::io::empty(), std::io::sink());
/// assert!(matches!(line.receive(Instant::now()), Ok(None) | Err(BoardError::Closed)));
/// ```
pub struct SerialLine {
    sink: Box<dyn Write + Send>,
    writer: FrameWriter,
    tamper: Tamper,
    replies: Receiver<Reply>,
    ledger: Arc<Mutex<LineLedger>>,
}

impl std::fmt::Debug for SerialLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SerialLine").field("ledger", &self.ledger).finish_non_exhaustive()
    }
}

impl SerialLine {
    /// A line over two streams of bytes.
    pub fn new(source: impl Read + Send + 'static, sink: impl Write + Send + 'static) -> Self {
        Self::tampered(source, sink, Tamper::none(), Tamper::none())
    }

    /// A line that damages what it carries: `out` to the board, `back` from it.
    pub fn tampered(
        source: impl Read + Send + 'static,
        sink: impl Write + Send + 'static,
        out: Tamper,
        back: Tamper,
    ) -> Self {
        let (sender, replies) = channel();
        let ledger = Arc::new(Mutex::new(LineLedger::new()));
        let shared = Arc::clone(&ledger);
        std::thread::spawn(move || receive(source, back, &sender, &shared));
        Self { sink: Box::new(sink), writer: FrameWriter::new(), tamper: out, replies, ledger }
    }

    /// Frames received so far.
    pub fn ledger(&self) -> LineLedger {
        self.ledger.lock().map_or_else(|poisoned| **poisoned.get_ref(), |ledger| *ledger)
    }

    /// From now on the line damages what goes to the board in this way.
    pub fn set_tamper(&mut self, out: Tamper) {
        self.tamper = out;
    }

    /// Sends requests as one write.
    ///
    /// # Errors
    /// [`BoardError::Io`].
    pub fn send(&mut self, requests: &[Request<'_>]) -> Result<(), BoardError> {
        let mut bytes = Vec::new();
        for request in requests {
            // A Hello is always the first frame of its sender.
            if matches!(request, Request::Hello { .. }) {
                self.writer.restart();
            }
            // Every request fits into a frame by construction.
            let frame = self.writer.encode(request).unwrap_or_default();
            bytes.extend(self.tamper.pass(frame));
        }
        self.sink
            .write_all(&bytes)
            .and_then(|()| self.sink.flush())
            .map_err(|source| BoardError::Io { what: "cannot write to the serial line", source })
    }

    /// The next reply, if one comes by `deadline`.
    ///
    /// # Errors
    /// [`BoardError::Closed`].
    pub fn receive(&mut self, deadline: Instant) -> Result<Option<Reply>, BoardError> {
        match self.replies.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(reply) => Ok(Some(reply)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(BoardError::Closed),
        }
    }

    /// The first reply for which `pick` has a value; others are passed over.
    ///
    /// # Errors
    /// [`BoardError::Closed`], [`BoardError::Silent`].
    pub fn await_reply<V>(
        &mut self,
        to: &'static str,
        patience: Duration,
        mut pick: impl FnMut(&Reply) -> Option<V>,
    ) -> Result<V, BoardError> {
        let deadline = Instant::now() + patience;
        while let Some(reply) = self.receive(deadline)? {
            if let Some(value) = pick(&reply) {
                return Ok(value);
            }
        }
        Err(BoardError::Silent { to, silent_s: patience.as_secs_f64() })
    }
}

/// Reads until the line is closed.
fn receive(mut source: impl Read, mut tamper: Tamper, replies: &Sender<Reply>, ledger: &Mutex<LineLedger>) {
    let mut reader = FrameReader::new();
    let mut buffer = [0; 4096];
    loop {
        let count = match source.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return,
        };
        for byte in tamper.pass(&buffer[..count]) {
            let frame = reader.feed(byte);
            // A board that starts, or starts again, is believed: it is the only one at the other end.
            if frame == Some(Frame::Start) {
                reader.follow();
            }
            if byte == 0
                && let Ok(mut shared) = ledger.lock()
            {
                *shared = *reader.ledger();
            }
            // A late reply answers a question that nobody asks any more.
            if matches!(frame, Some(Frame::Start | Frame::New)) {
                match reader.message() {
                    Some(reply) if replies.send(reply).is_err() => return,
                    Some(_) => {}
                    None => reader.count_unknown(),
                }
            }
        }
    }
}
