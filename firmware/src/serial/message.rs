//! What is said on the line. postcard numbers variants in their order: new ones go to the end, and every other
//! change bumps [`PROTOCOL_VERSION`].

use serde::{Deserialize, Serialize};

use super::frame::LineLedger;
use crate::contract::Faults;
use crate::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use crate::inputs::Ledger;
use crate::settings::Settings;

/// Version of the messages; the host refuses a device of another one.
pub const PROTOCOL_VERSION: u32 = 4;

/// Bytes of a table in one message: whole frames stay small against the line's buffers.
pub const TABLE_CHUNK_BYTES: usize = 256;

/// Host to device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Asks who is there, and ends the run with this number; always the first frame of its sender.
    ///
    /// A device without a run answers any number. One with a run answers [`Refusal::Session`] unless the number is the
    /// run's: a Hello sent again, or one of a host that does not know of the run, ends nothing.
    Hello {
        /// Number of the run that is to end; anything where there is none.
        session: u32,
    },
    /// A piece of the encoded table.
    Table {
        /// Where it begins; must be where the piece before ended, or 0 to begin anew.
        offset: u32,
        /// The piece.
        bytes: &'a [u8],
    },
    /// The table is complete: check it and begin a run.
    Begin {
        /// What the controller is built with.
        settings: Settings,
        /// What releases its steps.
        clock: ClockSource,
    },
    /// Needle sample.
    Needle(NeedleSample),
    /// Target sample.
    Target(TargetSample),
    /// Sample of a paddle; which one, its index says.
    Paddle(PaddleSample),
    /// The host's clock. With [`ClockSource::Frames`] the samples before it are one tick's: step now.
    Time {
        /// Number of the tick.
        tick: u64,
        /// Time on the clock that stamps the samples, ns.
        time_ns: u64,
    },
    /// Leaves SAFE; see [`crate::controller::State::rearm`]. Refused in any other mode.
    Rearm,
    /// Asks for the accounts.
    Account,
    /// Proof test of the watchdog: the device stops serving it, as a step that never returns would. Refused in a run
    /// that is not in SAFE.
    TestWatchdog,
}

/// Device to host. The device sends `Reply<&Account>`, which is as many bytes on the line, and small on its stack.
#[allow(clippy::large_enum_variant)] // Without an allocator there is nothing to box with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply<A = Account> {
    /// Answers [`Request::Hello`]; sent by itself once after every start.
    Hello(Identity),
    /// So many bytes of the table are there.
    Taken {
        /// Bytes from the beginning.
        bytes: u32,
    },
    /// The run begins.
    Ready,
    /// The request was not carried out.
    Refused(Refusal),
    /// The command of one step.
    Command {
        /// The command.
        command: PaddleCommand,
        /// Counts of [`Board::counter`](super::device::Board::counter) that `Controller::step` took.
        counts: u32,
    },
    /// Answers [`Request::Account`].
    Account(A),
}

/// What releases the steps of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClockSource {
    /// Lockstep: every [`Request::Time`] is a tick. Time comes from the messages.
    #[default]
    Frames,
    /// Free-run: the device's own counter, at the loop period; [`Request::Time`] tells what the host's clock shows.
    Board,
}

/// What a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// [`PROTOCOL_VERSION`].
    pub protocol: u32,
    /// [`crate::contract::frames::LAYOUT_VERSION`].
    pub layout: u32,
    /// [`crate::contract::codec::FORMAT_VERSION`] of the table.
    pub table_format: u16,
    /// [`crate::scalar::ScalarKind`] as a byte.
    pub scalar: u8,
    /// Dimension of space that it controls in.
    pub dimension: u8,
    /// Paddles that it moves.
    pub paddles: u8,
    /// Largest table that it can take, bytes.
    pub table_bytes: u32,
    /// Rate of [`Board::counter`](super::device::Board::counter), Hz.
    pub counter_hz: u32,
    /// Why it has started.
    pub reset: ResetCause,
}

/// Why the device has started. The numbers survive the reset in memory and are never reused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum ResetCause {
    /// Power, reset button or debugger.
    #[default]
    PowerOn = 0,
    /// The main loop did not serve the watchdog.
    Watchdog = 1,
    /// A hard fault: bus error, stack overflow, undefined instruction.
    HardFault = 2,
}

impl ResetCause {
    /// The cause with this number.
    pub const fn from_number(number: u32) -> Option<Self> {
        match number {
            0 => Some(Self::PowerOn),
            1 => Some(Self::Watchdog),
            2 => Some(Self::HardFault),
            _ => None,
        }
    }
}

/// Why a request was not carried out. The host has decoded the same table and built the same controller before, and
/// knows the words; the device names the fact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// A piece of the table that does not follow the one before.
    Offset {
        /// Where the next piece must begin.
        expected: u32,
    },
    /// The table is larger than the device's memory for it.
    TooLarge,
    /// The table is refused, with [`crate::contract::TableError::code`].
    Table {
        /// Which check failed.
        code: u8,
    },
    /// The settings are refused; see [`crate::SettingsError`].
    Settings,
    /// Makes no sense now: no run, or one that has begun.
    Order,
    /// A run is under way, and the Hello did not say that this is the one to end.
    Session {
        /// Number of the run.
        current: u32,
    },
}

/// Accounts of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Samples and ticks.
    pub ledger: Ledger,
    /// Frames that the device received.
    pub line: LineLedger,
    /// State after the last tick, as in [`PaddleCommand::state`].
    pub state: u32,
    /// Faults of the last tick.
    pub faults: Faults,
    /// Deepest use of the stack since the start, bytes.
    pub stack_bytes: u32,
}

#[cfg(test)]
mod tests {
    use super::ResetCause;

    #[test]
    fn every_cause_of_a_reset_is_told_by_its_number() {
        for cause in [ResetCause::PowerOn, ResetCause::Watchdog, ResetCause::HardFault] {
            assert_eq!(ResetCause::from_number(cause as u32), Some(cause));
        }
        assert_eq!(ResetCause::from_number(3), None);
    }
}
