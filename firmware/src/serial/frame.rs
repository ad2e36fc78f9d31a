//! Frames on a line that may drop, change, double or swap bytes.
//!
//! `0 ‖ COBS(counter ‖ message ‖ CRC-32) ‖ 0`: counter (u32) and message in postcard, the CRC-32 (ISO-HDLC,
//! little-endian) over both. COBS leaves no 0 inside, so that a reader finds the next frame after any damage; with a
//! delimiter on both sides one lost delimiter costs one frame, not two. The counter tells lost, late and doubled
//! frames. It starts at 0, with which a sender says that it starts anew, and wraps to 1. Anybody can send frame 0 again:
//! the reader only reports it as a [`Frame::Start`], and whoever understands its message decides whether to
//! [follow](FrameReader::follow).

use cobs::{CobsEncoder, DecodeResult, DecoderState};
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use serde::{Deserialize, Serialize};

use crate::inputs::{Arrival, SequenceTracker};
use crate::inputs::{Discard, StreamLedger};

/// Largest content of a frame, bytes: an account with every counter full fits.
pub const MAX_CONTENT_BYTES: usize = 848;
/// Largest frame on the line: COBS adds one byte and one more per 254, the delimiters two.
pub const MAX_FRAME_BYTES: usize = MAX_CONTENT_BYTES + MAX_CONTENT_BYTES / 254 + 4;

const CHECKSUM_BYTES: usize = 4;
/// Bit by bit: a table would take 1 KB of a microcontroller's flash.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What became of the frames that a reader was sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineLedger {
    /// Intact frames, by their counters: sent = taken + missing + late.
    pub frames: StreamLedger,
    /// Frames refused by COBS, checksum or length. Also missing in `frames`, unless a piece of noise looked like one.
    pub damaged: u64,
    /// Intact frames whose message is none of this version's.
    pub unknown: u64,
    /// Starts of the sender that were followed.
    pub starts: u64,
    /// Frames 0 that were not followed, or not yet: sent again.
    pub replayed_starts: u64,
}

/// Makes frames out of messages.
#[derive(Debug)]
pub struct FrameWriter {
    counter: u32,
    content: [u8; MAX_CONTENT_BYTES],
    frame: [u8; MAX_FRAME_BYTES],
}

impl FrameWriter {
    /// A sender that starts.
    pub const fn new() -> Self {
        Self { counter: 0, content: [0; MAX_CONTENT_BYTES], frame: [0; MAX_FRAME_BYTES] }
    }

    /// Starts anew: the next frame carries the counter 0.
    pub const fn restart(&mut self) {
        self.counter = 0;
    }

    /// The next frame; `None` for a message that is larger than a frame.
    pub fn encode<M: Serialize>(&mut self, message: &M) -> Option<&[u8]> {
        let (body, _) = self.content.split_last_chunk_mut::<CHECKSUM_BYTES>()?;
        let length = postcard::to_slice(&(self.counter, message), body).ok()?.len();
        let checksum = CRC.checksum(self.content.get(..length)?).to_le_bytes();
        let (covered, rest) = self.content.split_at_mut_checked(length)?;
        *rest.first_chunk_mut()? = checksum;
        let (start, inner) = self.frame.split_first_mut()?;
        *start = 0;
        let mut encoder = CobsEncoder::new(inner);
        encoder.push(covered).ok()?;
        encoder.push(&checksum).ok()?;
        let encoded = encoder.finalize();
        *inner.get_mut(encoded)? = 0;
        self.counter = self.counter.checked_add(1).unwrap_or(1);
        self.frame.get(..encoded.checked_add(2)?)
    }
}

impl Default for FrameWriter {
    fn default() -> Self {
        Self::new()
    }
}

/// What a reader has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// A frame with the number 0: a sender that starts, or an old frame sent again. Nothing of the reader has changed.
    Start,
    /// A new frame.
    New,
    /// A frame that comes after a newer one.
    Late,
}

/// Finds frames in a stream of bytes.
#[derive(Debug)]
pub struct FrameReader {
    state: DecoderState,
    content: [u8; MAX_CONTENT_BYTES],
    filled: usize,
    /// Start and end of the message within the content, once a frame is complete.
    message: (usize, usize),
    /// Since the last delimiter something came that cannot be a frame.
    broken: bool,
    tracker: SequenceTracker,
    ledger: LineLedger,
}

impl FrameReader {
    /// A reader before the first byte.
    pub const fn new() -> Self {
        Self {
            state: DecoderState::Idle,
            content: [0; MAX_CONTENT_BYTES],
            filled: 0,
            message: (0, 0),
            broken: false,
            tracker: SequenceTracker::new(),
            ledger: LineLedger::new(),
        }
    }

    /// Accounts of this direction of the line.
    pub const fn ledger(&self) -> &LineLedger {
        &self.ledger
    }

    /// Takes one byte. Once it completes an intact frame that has not come before: what it is.
    /// Its [`message`](Self::message) stays until the next byte.
    pub fn feed(&mut self, byte: u8) -> Option<Frame> {
        if byte == 0 {
            return self.end();
        }
        match self.state.feed(byte) {
            Ok(DecodeResult::DataContinue(decoded)) => match self.content.get_mut(self.filled) {
                Some(place) => {
                    *place = decoded;
                    self.filled += 1;
                }
                None => self.broken = true,
            },
            Ok(_) => {}
            // Only a delimiter can come too early.
            Err(_) => self.broken = true,
        }
        None
    }

    /// Follows the sender whose [`Frame::Start`] has just come: its numbers count from now on.
    pub fn follow(&mut self) {
        self.tracker = SequenceTracker::new();
        self.ledger.starts += 1;
        self.ledger.replayed_starts = self.ledger.replayed_starts.saturating_sub(1);
        self.ledger.frames.delivered += 1;
        self.tracker.register(0, &mut self.ledger.frames);
        self.ledger.frames.consumed += 1;
    }

    /// A delimiter: the end of a frame, or one of several between two.
    fn end(&mut self) -> Option<Frame> {
        let empty = matches!(self.state, DecoderState::Idle);
        let whole = matches!(self.state.feed(0), Ok(DecodeResult::DataComplete)) && !self.broken;
        self.state = DecoderState::Idle;
        self.broken = false;
        let filled = core::mem::replace(&mut self.filled, 0);
        if empty {
            return None;
        }
        let counter = if whole { self.counter(filled) } else { None };
        let Some(counter) = counter else {
            self.ledger.damaged += 1;
            return None;
        };
        if counter == 0 {
            self.ledger.replayed_starts += 1;
            return Some(Frame::Start);
        }
        self.ledger.frames.delivered += 1;
        match self.tracker.register(counter, &mut self.ledger.frames) {
            Arrival::New => {
                self.ledger.frames.consumed += 1;
                Some(Frame::New)
            }
            Arrival::Late => Some(Frame::Late),
            Arrival::Duplicate | Arrival::Stray => None,
        }
    }

    /// The counter of the content, if the checksum is right; remembers where the message lies.
    fn counter(&mut self, filled: usize) -> Option<u32> {
        let (covered, written) = self.content.get(..filled)?.split_last_chunk::<CHECKSUM_BYTES>()?;
        if CRC.checksum(covered) != u32::from_le_bytes(*written) {
            return None;
        }
        let (counter, message) = postcard::take_from_bytes::<u32>(covered).ok()?;
        self.message = (covered.len() - message.len(), covered.len());
        Some(counter)
    }

    /// The message of the frame that the last byte completed; `None` for one that this version does not know.
    pub fn message<'a, M: Deserialize<'a>>(&'a self) -> Option<M> {
        let (start, end) = self.message;
        let (message, rest) = postcard::take_from_bytes(self.content.get(start..end)?).ok()?;
        rest.is_empty().then_some(message)
    }

    /// The last frame held no message of this version.
    pub fn count_unknown(&mut self) {
        self.ledger.unknown += 1;
    }
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl LineLedger {
    /// Accounts before the first byte.
    pub const fn new() -> Self {
        Self { frames: StreamLedger::new(), damaged: 0, unknown: 0, starts: 0, replayed_starts: 0 }
    }

    /// Frames that came after a newer one.
    pub fn late(&self) -> u64 {
        self.frames.discarded_for(Discard::Late)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn the_largest_content_fits_into_the_largest_frame_with_next_to_nothing_to_spare() {
        // COBS without a zero in the content: one byte, and one more for every 254.
        let encoded = MAX_CONTENT_BYTES + 1 + MAX_CONTENT_BYTES / 254;
        assert!((encoded + 2..encoded + 4).contains(&MAX_FRAME_BYTES), "{MAX_FRAME_BYTES}");
    }

    fn frames(count: u32) -> Vec<Vec<u8>> {
        let mut writer = FrameWriter::new();
        (0..count).map(|i| writer.encode(&(i, 0u8, 1.5f64)).unwrap().to_vec()).collect()
    }

    /// The numbers of the messages that a reader accepts.
    fn read(bytes: impl IntoIterator<Item = u8>) -> (Vec<u32>, LineLedger) {
        let mut reader = FrameReader::new();
        let mut numbers = Vec::new();
        for byte in bytes {
            if let Some(frame) = reader.feed(byte) {
                if frame == Frame::Start {
                    reader.follow();
                }
                numbers.push(reader.message::<(u32, u8, f64)>().unwrap().0);
            }
        }
        (numbers, *reader.ledger())
    }

    #[test]
    fn frames_survive_noise_between_them() {
        let noise = [1, 2, 3, 0, 0, 255, 0, 7];
        let stream = frames(5).into_iter().flat_map(|frame| frame.into_iter().chain(noise));
        assert_eq!(read(stream).0, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn a_changed_bit_costs_one_frame() {
        let frames = frames(3);
        for bit in 0..8 * frames[1].len() {
            let mut stream = frames.clone();
            stream[1][bit / 8] ^= 1 << (bit % 8);
            let (numbers, ledger) = read(stream.concat());
            // The delimiters belong to both neighbours: without one of them nothing is lost.
            assert!(numbers == [0, 2] || numbers == [0, 1, 2], "bit {bit}: {numbers:?}");
            assert_eq!(ledger.frames.unaccounted(), 0);
        }
    }

    #[test]
    fn a_lost_byte_costs_at_most_one_frame() {
        let frames = frames(3);
        for lost in 0..frames[1].len() {
            let mut stream = frames.clone();
            stream[1].remove(lost);
            let numbers = read(stream.concat()).0;
            assert!(numbers == [0, 2] || numbers == [0, 1, 2], "byte {lost}: {numbers:?}");
        }
    }

    /// Frames with number 0 that nobody follows are counted, and the one that is followed is no replay.
    #[test]
    fn starts_that_are_not_followed_are_counted() {
        let start = &frames(1)[0];
        let mut reader = FrameReader::new();
        for times in 1..=3 {
            assert_eq!(start.iter().find_map(|byte| reader.feed(*byte)), Some(Frame::Start));
            assert_eq!((reader.ledger().replayed_starts, reader.ledger().starts), (times, 0));
        }
        reader.follow();
        assert_eq!((reader.ledger().replayed_starts, reader.ledger().starts), (2, 1));
    }

    #[test]
    fn doubled_late_and_lost_frames_are_told_apart() {
        let f = frames(6);
        let (numbers, ledger) = read([&f[0], &f[2], &f[2], &f[1], &f[5]].into_iter().flatten().copied());
        assert_eq!(numbers, [0, 2, 1, 5]);
        assert_eq!((ledger.frames.duplicates, ledger.late(), ledger.frames.lost), (1, 1, 2));
        assert_eq!((ledger.frames.unaccounted(), ledger.starts), (0, 1));
    }

    #[test]
    fn every_late_frame_is_counted() {
        let frames = frames(6);
        for late in 0..5 {
            let order = [0, 5].into_iter().chain(1..=late);
            let (_, ledger) = read(order.flat_map(|i| frames[i].clone()));
            assert_eq!(ledger.late(), late as u64);
        }
    }

    #[test]
    fn a_sender_that_starts_anew_is_heard() {
        let (numbers, ledger) = read(frames(3).concat().into_iter().chain(frames(2).concat()));
        assert_eq!(numbers, [0, 1, 2, 0, 1]);
        assert_eq!((ledger.starts, ledger.frames.duplicates), (2, 0));
    }

    #[test]
    fn messages_of_another_version_are_counted() {
        let mut reader = FrameReader::new();
        for count in 1..4 {
            reader.count_unknown();
            assert_eq!(*reader.ledger(), LineLedger { unknown: count, ..LineLedger::new() });
        }
    }

    #[test]
    fn a_message_too_large_for_a_frame_is_not_sent() {
        let mut writer = FrameWriter::new();
        let large = [1u8; 32];
        assert!(writer.encode(&[large; 27]).is_none());
        assert!(writer.encode(&[large; 26]).is_some());
    }

    #[test]
    fn frames_are_no_larger_than_promised() {
        let mut writer = FrameWriter::new();
        let content = [[1u8; 28]; 30];
        assert!(writer.encode(&content).is_some_and(|frame| frame.len() <= MAX_FRAME_BYTES));
    }
}
