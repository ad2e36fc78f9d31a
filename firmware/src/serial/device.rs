//! The device's side of the line: takes a table, runs the controller, answers.
//!
//! One loop without interrupts of its own: poll the line, serve the watchdog, step when it is time. The watchdog is
//! served once per pass, so that a step that never returns is noticed, and a silent host is not: silence is the
//! controller's own business (ages of samples, HOLD, SAFE).

use heapless::Vec;

use super::frame::{Frame, FrameReader, FrameWriter};
use super::message::{Account, ClockSource, Identity, PROTOCOL_VERSION, Refusal, Reply, Request, ResetCause};
use crate::contract::codec::FORMAT_VERSION;
use crate::contract::frames::LAYOUT_VERSION;
use crate::contract::{Faults, Mode};
use crate::contract::{PaddleCommand, PaddleSample, Table, decode_into};
use crate::controller::{Controller, State};
use crate::inputs::Inputs;
use crate::scalar::Scalar;
use crate::schedule::Releases;
use crate::settings::Settings;

/// Room for an encoded table in the plane: 256 knots in f64 take 31 KB.
pub const TABLE_BYTES: usize = 32 * 1024;

/// Room for one in space: 256 knots in f64 with two paddles take 82 KB.
pub const SPATIAL_TABLE_BYTES: usize = 84 * 1024;

/// Bits of [`Board::counter`]: those of a SysTick.
pub const COUNTER_BITS: u32 = 24;
const COUNTER_MASK: u32 = (1 << COUNTER_BITS) - 1;

/// A reply as it is sent.
type BorrowedReply<'a> = Reply<&'a Account>;

/// What a microcontroller has to provide.
pub trait Board {
    /// Rate of the counter, Hz; at least 65,536.
    const COUNTER_HZ: u32;

    /// A byte from the line, if one has arrived.
    fn read(&mut self) -> Option<u8>;
    /// Sends a byte; waits while the transmitter is busy.
    fn write(&mut self, byte: u8);
    /// A counter that goes up and wraps after [`COUNTER_BITS`].
    fn counter(&mut self) -> u32;
    /// Serves the watchdog.
    fn alive(&mut self);
    /// Never returns and never serves the watchdog.
    fn hang(&mut self);
    /// Deepest use of the stack since the start, bytes.
    fn stack_bytes(&self) -> u32;
    /// Whether the line is gone for good, which it never is outside of tests.
    fn is_closed(&self) -> bool {
        false
    }
}

/// Everything large that a device needs, for a `static`: tables of one dimension and number of paddles, and the bytes of
/// one.
#[derive(Debug)]
pub struct Memory<
    T: Scalar,
    const D: usize = 2,
    const N: usize = 1,
    const P: usize = 1,
    const BYTES: usize = TABLE_BYTES,
> {
    table: Table<T, D, N, P>,
    encoded: [u8; BYTES],
    filled: usize,
    line: Line,
    /// Of the last run. Here and not on the stack, which it would nearly double. A list, empty before the first run: that is
    /// all zeros, so that a `static` takes no flash; an `Option` is not.
    state: Vec<State<T, D, N, P>, 1>,
}

#[derive(Debug)]
struct Line {
    reader: FrameReader,
    writer: FrameWriter,
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize, const BYTES: usize> Memory<T, D, N, P, BYTES> {
    /// Memory of a device that starts.
    pub const fn new() -> Self {
        let line = Line { reader: FrameReader::new(), writer: FrameWriter::new() };
        Self { table: Table::empty(), encoded: [0; BYTES], filled: 0, line, state: Vec::new() }
    }

    /// The frame of a SAFE command that moves nothing, for an exception to send before it resets the device: it has
    /// nothing left to compute then. To be asked for before [`serve`].
    pub fn last_word(&mut self) -> &[u8] {
        let command =
            PaddleCommand { state: Mode::Safe as u32, faults: Faults::WATCHDOG.bits(), ..PaddleCommand::default() };
        self.line.writer.restart();
        self.line.writer.encode(&BorrowedReply::Command { command, counts: 0 }).unwrap_or_default()
    }
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize, const BYTES: usize> Default
    for Memory<T, D, N, P, BYTES>
{
    fn default() -> Self {
        Self::new()
    }
}

/// Serves the line for ever (in tests: until it is closed).
pub fn serve<T: Scalar, const D: usize, const N: usize, const P: usize, const BYTES: usize, B: Board>(
    board: &mut B,
    memory: &mut Memory<T, D, N, P, BYTES>,
    reset: ResetCause,
) {
    let Memory { table, encoded, filled, line, state } = memory;
    line.writer.restart();
    let identity = Identity {
        protocol: PROTOCOL_VERSION,
        layout: LAYOUT_VERSION,
        table_format: FORMAT_VERSION,
        scalar: T::KIND as u8,
        dimension: D as u8,
        paddles: P as u8,
        table_bytes: BYTES as u32,
        counter_hz: B::COUNTER_HZ,
        reset,
    };
    line.send_hello(board, identity);
    // From 1: the 0 of a host that knows of no run ends none.
    let mut session = 1u32;
    while !board.is_closed() {
        board.alive();
        let Some(frame) = line.poll(board) else { continue };
        match line.reader.message() {
            // Without a run nothing can be ended.
            Some(Request::Hello { .. }) => line.welcome(board, identity),
            _ if frame == Frame::Start => {}
            Some(Request::Table { offset, bytes }) => match take(encoded, filled, offset, bytes) {
                Ok(bytes) => line.send_taken(board, bytes),
                Err(refusal) => line.send_refusal(board, refusal),
            },
            Some(Request::Begin { settings, clock }) => {
                let begun = check_table(encoded.get(..*filled).unwrap_or_default(), table)
                    .and_then(|()| run(board, line, table, afresh(state)?, &Start { settings, clock, session }));
                session = session.checked_add(1).unwrap_or(1);
                match begun {
                    Ok(()) if board.is_closed() => {}
                    // The run was ended by a Hello.
                    Ok(()) => line.welcome(board, identity),
                    Err(refusal) => line.send_refusal(board, refusal),
                }
            }
            Some(Request::TestWatchdog) => board.hang(),
            Some(Request::Account | Request::Rearm) => line.send_refusal(board, Refusal::Order),
            // Samples of a run that a reset has ended: the host will see the Hello.
            Some(Request::Needle(_) | Request::Target(_) | Request::Paddle(_) | Request::Time { .. }) => {}
            None => line.reader.count_unknown(),
        }
    }
}

// What happens once, and what is large, is kept out of line below: the stack of the loop then does not carry it.

/// Appends a piece of the table; returns the bytes that are there.
#[inline(never)]
fn take(encoded: &mut [u8], filled: &mut usize, offset: u32, bytes: &[u8]) -> Result<u32, Refusal> {
    if offset == 0 {
        *filled = 0;
    }
    let start = offset as usize;
    if start != *filled {
        return Err(Refusal::Offset { expected: *filled as u32 });
    }
    let place = encoded.get_mut(start..).and_then(|rest| rest.get_mut(..bytes.len())).ok_or(Refusal::TooLarge)?;
    for (to, from) in place.iter_mut().zip(bytes) {
        *to = *from;
    }
    *filled = start + bytes.len();
    Ok(*filled as u32)
}

#[inline(never)]
fn check_table<T: Scalar, const D: usize, const N: usize, const P: usize>(
    encoded: &[u8],
    table: &mut Table<T, D, N, P>,
) -> Result<(), Refusal> {
    decode_into(encoded, table).map_err(|error| Refusal::Table { code: error.code() })
}

#[inline(never)]
fn build<'t, T: Scalar, const D: usize, const N: usize, const P: usize>(
    table: &'t Table<T, D, N, P>,
    settings: &Settings,
) -> Result<Controller<'t, T, D, N, P>, Refusal> {
    Controller::new(table, settings).map_err(|_| Refusal::Settings)
}

/// The state before the first tick, in its place.
#[inline(never)]
fn afresh<T: Scalar, const D: usize, const N: usize, const P: usize>(
    state: &mut Vec<State<T, D, N, P>, 1>,
) -> Result<&mut State<T, D, N, P>, Refusal> {
    state.clear();
    // Neither can fail: the list is empty before, and is not afterwards.
    state.push(State::new()).map_err(|_| Refusal::Order)?;
    state.last_mut().ok_or(Refusal::Order)
}

/// Builds the controller and runs it until the host says Hello.
#[inline(never)]
fn run<T: Scalar, const D: usize, const N: usize, const P: usize, B: Board>(
    board: &mut B,
    line: &mut Line,
    table: &Table<T, D, N, P>,
    state: &mut State<T, D, N, P>,
    start: &Start,
) -> Result<(), Refusal> {
    let controller = build(table, &start.settings)?;
    let period_ns = start.settings.loop_period_ns;
    line.send_ready(board);
    Run {
        controller: &controller,
        state,
        inbox: Inputs::default(),
        paddles: table.paddles.each_ref().map(|paddle| paddle.index),
        clock: start.clock,
        session: start.session,
        now: Now::new(board.counter()),
        period_ns,
        releases: Releases::new(0, period_ns),
    }
    .serve(board, line);
    Ok(())
}

/// What a run begins with.
struct Start {
    settings: Settings,
    clock: ClockSource,
    session: u32,
}

/// A controller at work.
struct Run<'r, T: Scalar, const D: usize, const N: usize, const P: usize> {
    controller: &'r Controller<'r, T, D, N, P>,
    state: &'r mut State<T, D, N, P>,
    /// Newest sample of each stream since the last step.
    inbox: Inputs,
    /// Identities of the table's paddles.
    paddles: [u32; P],
    clock: ClockSource,
    /// Number of the run since the reset.
    session: u32,
    now: Now,
    period_ns: u64,
    /// Those of the board's clock, in the host's time.
    releases: Releases,
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Run<'_, T, D, N, P> {
    #[inline(never)]
    fn serve<B: Board>(&mut self, board: &mut B, line: &mut Line) {
        while !board.is_closed() {
            board.alive();
            let now_ns = self.now.read(board);
            if let (ClockSource::Board, Some(now_ns)) = (self.clock, now_ns)
                && now_ns >= self.releases.next_release_ns()
            {
                self.releases.begin(now_ns);
                self.step(board, line, self.releases.tick(), now_ns);
                if let Some(end_ns) = self.now.read(board) {
                    self.releases.finish(end_ns);
                }
            }
            let Some(frame) = line.poll(board) else { continue };
            let is_safe = self.state.mode() == Mode::Safe;
            match line.reader.message() {
                Some(Request::Hello { session }) if frame == Frame::Start => {
                    if session == self.session {
                        return;
                    }
                    line.send_refusal(board, Refusal::Session { current: self.session });
                }
                // Frame 0 is a Hello, or nothing.
                _ if frame == Frame::Start => {}
                Some(Request::Needle(sample)) => keep_newest(&mut self.inbox.needle, sample, |s| s.sequence),
                Some(Request::Target(sample)) => keep_newest(&mut self.inbox.target, sample, |s| s.sequence),
                Some(Request::Paddle(sample)) => self.keep_paddle(sample),
                // Anything but a sample means something only in its place.
                _ if frame == Frame::Late => {}
                Some(Request::Time { tick, time_ns }) => match self.clock {
                    ClockSource::Frames => self.step(board, line, tick, time_ns),
                    ClockSource::Board => self.set_clock(board, time_ns),
                },
                Some(Request::Rearm) if is_safe => self.state.rearm(),
                Some(Request::Account) => self.send_account(board, line),
                Some(Request::TestWatchdog) if is_safe => board.hang(),
                Some(
                    Request::Rearm
                    | Request::TestWatchdog
                    | Request::Hello { .. }
                    | Request::Table { .. }
                    | Request::Begin { .. },
                ) => line.send_refusal(board, Refusal::Order),
                None => line.reader.count_unknown(),
            }
        }
    }

    /// A sample goes to the place of its paddle. One of another paddle goes to the last: the controller refuses it there.
    fn keep_paddle(&mut self, sample: PaddleSample) {
        let place = self.paddles.iter().position(|index| *index == sample.paddle_index).unwrap_or(P.saturating_sub(1));
        if let Some(kept) = self.inbox.paddles.get_mut(place) {
            keep_newest(kept, sample, |s| s.sequence);
        }
    }

    /// One tick.
    #[inline(never)]
    fn step<B: Board>(&mut self, board: &mut B, line: &mut Line, tick: u64, time_ns: u64) {
        // Read where they are: a copy would be on the stack below the deepest step.
        (self.inbox.tick, self.inbox.time_ns) = (tick, time_ns);
        let reply = timed_step(board, self.controller, self.state, &self.inbox);
        self.inbox = Inputs::default();
        line.send(board, &reply);
    }

    /// The host's clock shows `time_ns` now. The first time, the next release is one period ahead.
    fn set_clock<B: Board>(&mut self, board: &mut B, time_ns: u64) {
        if self.now.offset_ns.is_none() {
            self.releases = Releases::new(time_ns.saturating_add(self.period_ns), self.period_ns);
        }
        self.now.set(board, time_ns);
    }

    #[inline(never)]
    fn send_account<B: Board>(&self, board: &mut B, line: &mut Line) {
        let account = Account {
            ledger: *self.state.ledger(),
            line: *line.reader.ledger(),
            state: self.state.mode() as u32,
            faults: self.state.faults(),
            stack_bytes: board.stack_bytes(),
        };
        line.send(board, &BorrowedReply::Account(&account));
    }
}

/// `Controller::step` and the counts that it took, as the reply to send. Not inlined, and with its arguments and result opaque, so that
/// nothing of the step is moved out of the count and nothing else into it.
#[inline(never)]
fn timed_step<T: Scalar, const D: usize, const N: usize, const P: usize, B: Board>(
    board: &mut B,
    controller: &Controller<'_, T, D, N, P>,
    state: &mut State<T, D, N, P>,
    inputs: &Inputs,
) -> BorrowedReply<'static> {
    use core::hint::black_box;
    let before = board.counter();
    let command = black_box(controller).step(black_box(&mut *state), black_box(inputs));
    black_box((&command, state));
    let counts = board.counter().wrapping_sub(before) & COUNTER_MASK;
    BorrowedReply::Command { command, counts }
}

/// Keeps the newer of two samples; sequence numbers wrap.
fn keep_newest<S>(kept: &mut Option<S>, sample: S, sequence: impl Fn(&S) -> u32) {
    let older = kept.as_ref().is_some_and(|kept| sequence(&sample).wrapping_sub(sequence(kept)) > u32::MAX / 2);
    if !older {
        *kept = Some(sample);
    }
}

/// The host's time, carried on by the board's counter. Never goes back.
struct Now {
    counter: u32,
    /// Since the start of the run, ns.
    board_ns: u64,
    /// What of it is less than 1 ns, in 2^-[`FRACTION_BITS`] ns.
    fraction: u64,
    /// Host time minus board time, ns; `None` before the first word of the host.
    offset_ns: Option<i64>,
    /// Board time of the last word of the host, ns.
    told_ns: u64,
    last_ns: u64,
}

/// Of the time that one count takes.
const FRACTION_BITS: u32 = 24;
/// Two crystals may drift apart by one part in this many: 122 ppm. A power of two, which costs no division.
const DRIFT: u64 = 1 << 13;

impl Now {
    fn new(counter: u32) -> Self {
        Self { counter, board_ns: 0, fraction: 0, offset_ns: None, told_ns: 0, last_ns: 0 }
    }

    /// Must be called at least once per wrap of the counter. `None` until the host has said the time.
    fn read<B: Board>(&mut self, board: &mut B) -> Option<u64> {
        let board_ns = self.board_ns(board);
        let now_ns = board_ns.saturating_add_signed(self.offset_ns?);
        self.last_ns = self.last_ns.max(now_ns);
        Some(self.last_ns)
    }

    /// The host's clock showed `time_ns` when it sent this. Every message is late by its time on the line, so that
    /// the offset is the largest one seen, forgotten as fast as crystals drift.
    fn set<B: Board>(&mut self, board: &mut B, time_ns: u64) {
        let board_ns = self.board_ns(board);
        let measured = time_ns.wrapping_sub(board_ns).cast_signed();
        let forgotten = (board_ns.saturating_sub(self.told_ns) / DRIFT).cast_signed();
        self.offset_ns = Some(match self.offset_ns {
            Some(offset) => measured.max(offset.saturating_sub(forgotten)),
            None => measured,
        });
        self.told_ns = board_ns;
    }

    fn board_ns<B: Board>(&mut self, board: &mut B) -> u64 {
        // A constant, so that no pass of the loop divides. For a rate that does not divide 10⁹ it is rounded, up to 1 GHz
        // by less than 0.1 ppm: a crystal is not that good.
        let ns_per_count = const {
            assert!(B::COUNTER_HZ >= 1 << 16, "a wrap of a slower counter would overflow below");
            (1_000_000_000 << FRACTION_BITS) / B::COUNTER_HZ as u64
        };
        let counter = board.counter();
        let counts = u64::from(counter.wrapping_sub(self.counter) & COUNTER_MASK);
        self.counter = counter;
        let elapsed = self.fraction + counts * ns_per_count;
        self.board_ns += elapsed >> FRACTION_BITS;
        self.fraction = elapsed % (1 << FRACTION_BITS);
        self.board_ns
    }
}

impl Line {
    /// Sends a reply. Every reply fits into a frame.
    #[inline(never)]
    fn send<B: Board>(&mut self, board: &mut B, reply: &BorrowedReply<'_>) {
        for byte in self.writer.encode(reply).unwrap_or_default() {
            board.write(*byte);
        }
    }

    #[inline(never)]
    fn send_hello<B: Board>(&mut self, board: &mut B, identity: Identity) {
        self.send(board, &BorrowedReply::Hello(identity));
    }

    /// Answers a host that starts.
    fn welcome<B: Board>(&mut self, board: &mut B, identity: Identity) {
        self.reader.follow();
        self.send_hello(board, identity);
    }

    #[inline(never)]
    fn send_taken<B: Board>(&mut self, board: &mut B, bytes: u32) {
        self.send(board, &BorrowedReply::Taken { bytes });
    }

    #[inline(never)]
    fn send_ready<B: Board>(&mut self, board: &mut B) {
        self.send(board, &BorrowedReply::Ready);
    }

    #[inline(never)]
    fn send_refusal<B: Board>(&mut self, board: &mut B, refusal: Refusal) {
        self.send(board, &BorrowedReply::Refused(refusal));
    }

    /// Takes the bytes that have arrived, up to the end of a frame.
    fn poll<B: Board>(&mut self, board: &mut B) -> Option<Frame> {
        while let Some(byte) = board.read() {
            let frame = self.reader.feed(byte);
            if frame.is_some() {
                return frame;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
