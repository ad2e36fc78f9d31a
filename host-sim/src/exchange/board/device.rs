//! A device as the host sees it: give it a table, let it step, ask for its accounts.

use std::time::{Duration, Instant};

use firmware::contract::codec::FORMAT_VERSION;
use firmware::contract::frames::LAYOUT_VERSION;
use firmware::contract::{Header, PaddleCommand};
use firmware::scalar::ScalarKind;
use firmware::serial::message::{PROTOCOL_VERSION, TABLE_CHUNK_BYTES};
use firmware::serial::{Account, ClockSource, Identity, LineLedger, Refusal, Reply, Request};
use firmware::{Inputs, Settings};

use super::error::BoardError;
use super::image::{Control, Image};
use super::line::SerialLine;
use super::qemu::Qemu;
use super::tamper::Tamper;

/// How long a device may take for anything but a step. An emulator on a busy machine needs a second for a table.
const PATIENCE: Duration = Duration::from_secs(20);

/// The answer to one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The command.
    pub command: PaddleCommand,
    /// Counts of the device's counter that `Controller::step` took.
    pub counts: u32,
}

/// A device.
///
/// On a real board, instead of QEMU's pipes, its serial port:
///
/// ```no_run
/// use firmware::scalar::ScalarKind;
/// use host_sim::exchange::board::{Device, SerialLine};
/// use std::{fs::File, time::Duration};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let port = File::options().read(true).write(true).open("/dev/ttyACM0")?;
/// let mut device = Device::connect(SerialLine::new(port.try_clone()?, port), ScalarKind::F64, None)?;
/// let settings = firmware::Settings::new(1_000_000, 20_000_000, 20_000_000);
/// device.begin(&std::fs::read("my.table")?, &settings)?;
/// let answer = device.step(&firmware::Inputs::default(), Duration::from_secs(1))?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Device {
    line: SerialLine,
    identity: Identity,
    /// Ends with the device.
    qemu: Option<Qemu>,
}

impl Device {
    /// Starts an image in QEMU.
    ///
    /// # Errors
    /// [`BoardError`].
    pub fn emulate(image: &Image) -> Result<Self, BoardError> {
        let (qemu, line) = Qemu::start(&image.elf)?;
        Self::connect_to(line, image.scalar, image.control, Some(qemu))
    }

    /// Asks who is at the other end of the line: it must be a controller of the plane.
    ///
    /// # Errors
    /// [`BoardError::Silent`], [`BoardError::Identity`].
    pub fn connect(line: SerialLine, scalar: ScalarKind, qemu: Option<Qemu>) -> Result<Self, BoardError> {
        Self::connect_to(line, scalar, Control::Plane, qemu)
    }

    /// The same for a controller of this.
    ///
    /// # Errors
    /// As [`Device::connect`].
    pub fn connect_to(
        mut line: SerialLine,
        scalar: ScalarKind,
        control: Control,
        qemu: Option<Qemu>,
    ) -> Result<Self, BoardError> {
        let identity = hello(&mut line)?;
        let expected = Identity {
            protocol: PROTOCOL_VERSION,
            layout: LAYOUT_VERSION,
            table_format: FORMAT_VERSION,
            scalar: scalar as u8,
            dimension: control.dimension(),
            paddles: control.paddles(),
            ..identity
        };
        if identity != expected {
            return Err(BoardError::Identity { found: identity, expected: format!("{expected:?}") });
        }
        Ok(Self { line, identity, qemu })
    }

    /// What it says it is.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The emulator's process, if it is one.
    pub fn process(&self) -> Option<u32> {
        self.qemu.as_ref().map(Qemu::id)
    }

    /// Frames received from it.
    pub fn line_ledger(&self) -> LineLedger {
        self.line.ledger()
    }

    /// From now on the line damages what goes to the device in this way.
    pub fn set_tamper(&mut self, out: Tamper) {
        self.line.set_tamper(out);
    }

    /// Ends the run, if there is one, gives the device a table in its own scalar, and begins a run in lockstep.
    ///
    /// # Errors
    /// [`BoardError::Refused`], [`BoardError::Silent`].
    pub fn begin(&mut self, table: &[u8], settings: &Settings) -> Result<(), BoardError> {
        self.begin_with(table, settings, ClockSource::Frames)
    }

    /// As [`Device::begin`], with steps released by `clock`.
    ///
    /// # Errors
    /// As [`Device::begin`].
    pub fn begin_with(&mut self, table: &[u8], settings: &Settings, clock: ClockSource) -> Result<(), BoardError> {
        self.identity = hello(&mut self.line)?;
        for (i, bytes) in table.chunks(TABLE_CHUNK_BYTES).enumerate() {
            let offset = (i * TABLE_CHUNK_BYTES) as u32;
            self.line.send(&[Request::Table { offset, bytes }])?;
            let end = offset + bytes.len() as u32;
            self.expect("a piece of the table", |reply| (*reply == Reply::Taken { bytes: end }).then_some(()))?;
        }
        self.line.send(&[Request::Begin { settings: *settings, clock }])?;
        self.expect("the table and its settings", |reply| (*reply == Reply::Ready).then_some(()))
    }

    /// One tick in lockstep; `None` if nothing came back in time: the line has lost the question or the answer.
    ///
    /// # Errors
    /// [`BoardError::Restarted`], [`BoardError::Closed`].
    pub fn step(&mut self, inputs: &Inputs, patience: Duration) -> Result<Option<Answer>, BoardError> {
        let Inputs { tick, time_ns, needle, target, paddles } = *inputs;
        let [first, second] = paddles.map(|paddle| paddle.map(Request::Paddle));
        let samples = [needle.map(Request::Needle), target.map(Request::Target), first, second];
        let requests: Vec<_> = samples.into_iter().flatten().chain([Request::Time { tick, time_ns }]).collect();
        self.line.send(&requests)?;
        let deadline = Instant::now() + patience;
        while let Some(reply) = self.line.receive(deadline)? {
            match reply {
                Reply::Command { command, counts } if command.tick == tick => {
                    return Ok(Some(Answer { command, counts }));
                }
                Reply::Hello(found) => return Err(BoardError::Restarted { found }),
                // The answer to a tick that was given up, or to something else.
                _ => {}
            }
        }
        Ok(None)
    }

    /// The accounts of the run.
    ///
    /// # Errors
    /// [`BoardError::Refused`] without a run, [`BoardError::Silent`].
    pub fn account(&mut self) -> Result<Account, BoardError> {
        self.line.send(&[Request::Account])?;
        self.expect("Account", |reply| match reply {
            Reply::Account(account) => Some(*account),
            _ => None,
        })
    }

    /// Sends one request without waiting for anything.
    ///
    /// # Errors
    /// [`BoardError::Io`].
    pub fn tell(&mut self, request: Request<'_>) -> Result<(), BoardError> {
        self.line.send(&[request])
    }

    /// The next reply within `patience`.
    ///
    /// # Errors
    /// [`BoardError::Closed`].
    pub fn hear(&mut self, patience: Duration) -> Result<Option<Reply>, BoardError> {
        self.line.receive(Instant::now() + patience)
    }

    /// The reply that `pick` waits for; a refusal is an error.
    fn expect<V>(&mut self, to: &'static str, pick: impl Fn(&Reply) -> Option<V>) -> Result<V, BoardError> {
        let refused = |refusal: Refusal| BoardError::Refused { to, refusal };
        self.line.await_reply(to, PATIENCE, |reply| match reply {
            Reply::Refused(refusal) => Some(Err(refused(*refusal))),
            other => pick(other).map(Ok),
        })?
    }
}

/// The scalar of an encoded table, if it is one.
pub fn scalar_of(table: &[u8]) -> Option<ScalarKind> {
    Header::read(table).ok().map(|header| header.scalar)
}

/// Says Hello, and once more with the number of the run that this ends, if one is under way.
fn hello(line: &mut SerialLine) -> Result<Identity, BoardError> {
    let mut session = 0;
    for _ in 0..2 {
        line.send(&[Request::Hello { session }])?;
        let answer = line.await_reply("Hello", PATIENCE, |reply| match reply {
            Reply::Hello(identity) => Some(Ok(*identity)),
            Reply::Refused(Refusal::Session { current }) => Some(Err(*current)),
            _ => None,
        })?;
        match answer {
            Ok(identity) => return Ok(identity),
            Err(current) => session = current,
        }
    }
    Err(BoardError::Refused { to: "Hello", refusal: Refusal::Session { current: session } })
}
