//! What the controller process tells the plant when all is over: a line of JSON, then everything that it saw.

use firmware::inputs::StreamLedger;
use firmware::{Discard, Faults, Mode};
use serde::{Deserialize, Serialize};

use crate::exchange::bytes::{ByteReader, ByteWriter};
use crate::runtime::accounting::ledger::{LedgerResult, StreamResult, TickResult};
use crate::runtime::accounting::tick::{ControllerTick, TICK_BYTES};
use crate::runtime::time::durations::LoopTiming;

/// Accounts of one stream at the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StreamAccount {
    /// Accepted.
    pub consumed: u64,
    /// Gaps in the sequence: overwritten before the controller looked.
    pub overwritten: u64,
    /// Refused, by reason.
    pub discarded: [u64; Discard::ALL.len()],
    /// Waiting when the controller stopped.
    pub in_flight: u64,
    /// What the controller's own ledger cannot account for.
    pub unaccounted: u64,
}

/// What became of the ticks of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordAccount {
    /// Handed over by the loop.
    pub offered: u64,
    /// Written.
    pub written: u64,
    /// Lost because the ring was full.
    pub lost_in_ring: u64,
    /// Lost because they could not be written.
    pub lost_on_disk: u64,
    /// Why not.
    pub error: Option<String>,
}

impl RecordAccount {
    /// Ticks without an entry: 0.
    pub fn unaccounted(&self) -> u64 {
        self.offered.abs_diff(self.written + self.lost_in_ring + self.lost_on_disk)
    }
}

/// Samples that a plant has published.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Published {
    /// Of the needle, the target, and the only or the first paddle.
    pub streams: [u64; 3],
    /// Of the second paddle, where there is one.
    pub second_paddle: Option<u64>,
}

/// The controller's accounts of a whole run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerAccounts {
    /// Needle samples.
    pub needle: StreamAccount,
    /// Target samples.
    pub target: StreamAccount,
    /// Samples of the only or the first paddle.
    pub paddle: StreamAccount,
    /// Samples of the second paddle, where the table has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_paddle: Option<StreamAccount>,
    /// Ticks.
    pub ticks: TickResult,
    /// Commands that left.
    pub commands: u64,
    /// State at the end.
    #[serde(with = "crate::runtime::names::mode")]
    pub final_state: Option<Mode>,
    /// Every fault that was ever present.
    #[serde(with = "crate::runtime::names::faults")]
    pub faults: Faults,
    /// Timing of the loop; free-run only.
    pub timing: Option<LoopTiming>,
    /// Ticks that were kept, and follow.
    #[serde(rename = "exchanges")]
    pub kept: u64,
    /// Ticks for which there was no room.
    #[serde(rename = "exchanges_lost")]
    pub not_kept: u64,
    /// What became of the recording, if there was one.
    #[serde(default)]
    pub record: Option<RecordAccount>,
}

impl ControllerAccounts {
    /// The line and the ticks. The type has only plain fields: an empty line, which nobody accepts, does not occur.
    pub fn encode(&self, kept: &[ControllerTick]) -> Vec<u8> {
        let mut writer = ByteWriter(serde_json::to_vec(self).unwrap_or_default());
        writer.bytes(b"\n");
        for tick in kept {
            tick.encode(&mut writer);
        }
        writer.0
    }

    /// Reads both; `None` for anything else.
    pub fn decode(bytes: &[u8]) -> Option<(Self, Vec<ControllerTick>)> {
        let end = bytes.iter().position(|byte| *byte == b'\n')?;
        let accounts: Self = serde_json::from_slice(&bytes[..end]).ok()?;
        let mut reader = ByteReader(&bytes[end + 1..]);
        if reader.0.len() as u64 != accounts.kept * TICK_BYTES as u64 {
            return None;
        }
        let kept = (0..accounts.kept).map(|_| ControllerTick::decode(&mut reader)).collect::<Option<_>>()?;
        Some((accounts, kept))
    }

    /// Both sides' accounts together.
    pub fn ledger(&self, published: Published, command: &CommandAccount) -> LedgerResult {
        let Published { streams: [needle, target, paddle], second_paddle } = published;
        let mut ledger = LedgerResult {
            needle: stream(&self.needle, needle),
            target: stream(&self.target, target),
            paddle: stream(&self.paddle, paddle),
            second_paddle: match (&self.second_paddle, second_paddle) {
                (None, None) => None,
                // Who knows of a paddle that the other does not has samples that nobody accounts for.
                (account, published) => Some(stream(&account.unwrap_or_default(), published.unwrap_or(0))),
            },
            command: command.result(self.commands),
            ticks: self.ticks,
            not_recorded: self.not_kept,
            unaccounted: 0,
        };
        ledger.unaccounted = [&ledger.needle, &ledger.target, &ledger.paddle, &ledger.command]
            .into_iter()
            .chain(&ledger.second_paddle)
            .map(|stream| stream.unaccounted)
            .sum::<u64>()
            + ledger.ticks.unaccounted;
        ledger
    }
}

/// The sender's count against the receiver's accounts.
fn stream(account: &StreamAccount, published: u64) -> StreamResult {
    let discarded = account.discarded.iter().sum::<u64>();
    let entries = account.consumed + account.overwritten + discarded + account.in_flight;
    StreamResult {
        published,
        consumed: account.consumed,
        overwritten: account.overwritten,
        discarded,
        discarded_for: Discard::ALL.into_iter().zip(account.discarded).filter(|(_, count)| *count > 0).collect(),
        in_flight: account.in_flight,
        unaccounted: published.abs_diff(entries) + account.unaccounted,
    }
}

/// First and last sequence number that the controller has seen of a stream. Streams start at 0 in every run.
#[derive(Clone, Copy, Debug, Default)]
pub struct SequenceSpan(Option<(u32, u32)>);

impl SequenceSpan {
    /// A sample with this number was seen.
    pub fn see(&mut self, sequence: u32) {
        self.0 = Some(self.0.map_or((sequence, sequence), |(first, _)| (first, sequence)));
    }

    /// Accounts of the stream, given the newest number that still waited at the end.
    pub fn account(&self, ledger: &StreamLedger, waiting: Option<u32>) -> StreamAccount {
        // Never looked at anything: the first sample is 0, so that `waiting` + 1 were published.
        let (before_first, after_last) = match self.0 {
            Some((first, last)) => (first, waiting.map_or(0, |newest| newest.wrapping_sub(last))),
            None => (0, waiting.map_or(0, |newest| newest.wrapping_add(1))),
        };
        StreamAccount {
            consumed: ledger.consumed,
            overwritten: ledger.lost + u64::from(before_first),
            discarded: ledger.discarded,
            in_flight: u64::from(after_last),
            unaccounted: ledger.unaccounted(),
        }
    }
}

/// Accounts of the commands at the plant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandAccount {
    next: u32,
    consumed: u64,
    overwritten: u64,
    in_flight: u64,
}

impl CommandAccount {
    /// A command with this number was executed.
    pub fn consume(&mut self, sequence: u32) {
        self.overwritten += u64::from(sequence.wrapping_sub(self.next));
        self.consumed += 1;
        self.next = sequence.wrapping_add(1);
    }

    /// Whether a number lies before the ones that are due: somebody else counts.
    pub fn is_behind(&self, sequence: u32) -> bool {
        sequence.wrapping_sub(self.next) > u32::MAX / 2
    }

    /// Another controller counts from 0 again.
    pub fn restart(&mut self) {
        self.next = 0;
    }

    /// Commands executed, and commands replaced by newer ones before the plant looked.
    pub fn counts(&self) -> [u64; 2] {
        [self.consumed, self.overwritten]
    }

    /// The newest command that still waited at the end.
    pub fn end(&mut self, waiting: Option<u32>) {
        self.in_flight = waiting.map_or(0, |newest| u64::from(newest.wrapping_sub(self.next).wrapping_add(1)));
    }

    fn result(&self, published: u64) -> StreamResult {
        let entries = self.consumed + self.overwritten + self.in_flight;
        StreamResult {
            published,
            consumed: self.consumed,
            overwritten: self.overwritten,
            in_flight: self.in_flight,
            unaccounted: published.abs_diff(entries),
            ..StreamResult::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accounts_survive_the_pipe() {
        let accounts =
            ControllerAccounts { commands: 3, kept: 2, final_state: Some(Mode::Run), ..ControllerAccounts::default() };
        let kept = vec![ControllerTick::default(); 2];
        let mut bytes = accounts.encode(&kept);
        assert_eq!(ControllerAccounts::decode(&bytes), Some((accounts, kept)));
        bytes.pop();
        assert_eq!(ControllerAccounts::decode(&bytes), None, "cut off");
    }

    #[test]
    fn a_lost_sample_shows_as_unaccounted() {
        let mut span = SequenceSpan::default();
        span.see(2);
        let ledger = StreamLedger { delivered: 1, published: 1, consumed: 1, ..StreamLedger::default() };
        let account = span.account(&ledger, Some(5));
        assert_eq!((account.overwritten, account.in_flight), (2, 3));
        assert_eq!(stream(&account, 6).unaccounted, 0);
        assert_eq!(stream(&account, 7).unaccounted, 1);
    }

    #[test]
    fn commands_are_accounted_for() {
        let mut account = CommandAccount::default();
        account.consume(0);
        account.consume(3);
        account.end(Some(5));
        assert_eq!(account.result(6).unaccounted, 0);
        assert_eq!((account.overwritten, account.in_flight), (2, 2));
    }
}
