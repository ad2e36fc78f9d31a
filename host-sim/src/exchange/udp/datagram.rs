//! One datagram: header, one frame as it lies in memory, checksum. Fixed lengths, little-endian, so that a program in any
//! language packs it without a library; the frames and the CRC-32 are those of shared memory and of the serial line.

use crc::{CRC_32_ISO_HDLC, Crc};
use firmware::contract::frames::{MAX_PADDLES, TARGET_VISIBLE};
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};

use super::refusal::Refusal;
use crate::exchange::bytes::{ByteReader, ByteWriter};

/// What every datagram begins with.
pub const MAGIC: [u8; 4] = *b"SPBR";
/// Version of the layout; others are refused.
pub const VERSION: u32 = 1;
/// Longest datagram, bytes: a command.
pub const LONGEST: usize = HEADER_BYTES + 104 + CHECKSUM_BYTES;

const HEADER_BYTES: usize = 40;
const CHECKSUM_BYTES: usize = 4;
/// Bytes for the name of the unit of length, in UTF-8, filled with 0.
const UNIT_BYTES: usize = 24;

/// CRC-32 of zlib and of the serial line.
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Kinds of datagrams on the wire.
mod kind {
    pub(super) const HELLO: u32 = 1;
    pub(super) const NEEDLE: u32 = 2;
    pub(super) const TARGET: u32 = 3;
    pub(super) const PADDLE: u32 = 4;
    pub(super) const COMMAND: u32 = 5;
}

/// What the bridge says until it hears the rig: for what the controller's table is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hello {
    /// Dimension of space.
    pub dimension: u32,
    /// Indices of the paddles, in the order of the table.
    pub paddles: Vec<u32>,
    /// Unit of length.
    pub unit: String,
}

/// What a datagram says.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Bridge to rig.
    Hello(Hello),
    /// Rig to bridge.
    Needle(NeedleSample),
    /// Rig to bridge.
    Target(TargetSample),
    /// Rig to bridge.
    Paddle(PaddleSample),
    /// Bridge to rig.
    Command(PaddleCommand),
}

/// One datagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Datagram {
    /// Number that the bridge has drawn for this run of its own; a rig sends back that of the Hello.
    pub run: u64,
    /// Number of the datagram: each of a sender has a larger one than those before.
    pub number: u64,
    /// When it was sent, on the sender's own steady clock, ns.
    pub sent_ns: u64,
    /// What it says.
    pub message: Message,
}

impl Datagram {
    /// The bytes.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = ByteWriter(Vec::with_capacity(LONGEST));
        writer.bytes(&MAGIC);
        writer.u32(VERSION);
        writer.u32(match self.message {
            Message::Hello(_) => kind::HELLO,
            Message::Needle(_) => kind::NEEDLE,
            Message::Target(_) => kind::TARGET,
            Message::Paddle(_) => kind::PADDLE,
            Message::Command(_) => kind::COMMAND,
        });
        writer.u32(0);
        writer.u64(self.run);
        writer.u64(self.number);
        writer.u64(self.sent_ns);
        match &self.message {
            Message::Hello(hello) => hello.encode(&mut writer),
            Message::Needle(needle) => writer.needle(needle),
            Message::Target(target) => writer.target(target),
            Message::Paddle(paddle) => writer.paddle(paddle),
            Message::Command(command) => writer.command(command),
        }
        let checksum = CRC.checksum(&writer.0);
        writer.u32(checksum);
        writer.0
    }

    /// Reads one datagram.
    ///
    /// # Errors
    /// [`Refusal::Length`], [`Refusal::Damaged`], [`Refusal::Version`], [`Refusal::Meaning`].
    pub fn decode(bytes: &[u8]) -> Result<Self, Refusal> {
        if !(HEADER_BYTES + CHECKSUM_BYTES..=LONGEST).contains(&bytes.len()) {
            return Err(Refusal::Length);
        }
        let (covered, checksum) = bytes.split_last_chunk::<CHECKSUM_BYTES>().ok_or(Refusal::Length)?;
        if !covered.starts_with(&MAGIC) || CRC.checksum(covered) != u32::from_le_bytes(*checksum) {
            return Err(Refusal::Damaged);
        }
        let mut reader = ByteReader(&covered[MAGIC.len()..]);
        if reader.u32() != Some(VERSION) {
            return Err(Refusal::Version);
        }
        // The length was looked at above: what is missing here is a part of the frame.
        Self::decode_rest(&mut reader).ok_or(Refusal::Length)?.and_then(|datagram| match reader.0 {
            [] => Ok(datagram),
            _ => Err(Refusal::Length),
        })
    }

    /// What follows the version; `None` where bytes are missing.
    fn decode_rest(reader: &mut ByteReader<'_>) -> Option<Result<Self, Refusal>> {
        let (kind, reserved) = (reader.u32()?, reader.u32()?);
        let (run, number, sent_ns) = (reader.u64()?, reader.u64()?, reader.u64()?);
        let (message, means_something) = match kind {
            kind::HELLO => match Hello::decode(reader)? {
                Some(hello) => (Message::Hello(hello), true),
                None => return Some(Err(Refusal::Meaning)),
            },
            kind::NEEDLE => {
                let needle = reader.needle()?;
                (Message::Needle(needle), needle.reserved == 0)
            }
            kind::TARGET => {
                let target = reader.target()?;
                (Message::Target(target), target.flags & !TARGET_VISIBLE == 0)
            }
            kind::PADDLE => (Message::Paddle(reader.paddle()?), true),
            kind::COMMAND => (Message::Command(reader.command()?), true),
            _ => return Some(Err(Refusal::Meaning)),
        };
        let read = Self { run, number, sent_ns, message };
        Some(if means_something && reserved == 0 { Ok(read) } else { Err(Refusal::Meaning) })
    }
}

impl Hello {
    fn encode(&self, writer: &mut ByteWriter) {
        writer.u32(self.dimension);
        let paddles = &self.paddles[..self.paddles.len().min(MAX_PADDLES)];
        writer.u32(paddles.len() as u32);
        (0..MAX_PADDLES).for_each(|place| writer.u32(paddles.get(place).copied().unwrap_or(0)));
        let mut unit = [0; UNIT_BYTES];
        let cut = (0..=UNIT_BYTES.min(self.unit.len())).rev().find(|end| self.unit.is_char_boundary(*end));
        let shown = &self.unit.as_bytes()[..cut.unwrap_or(0)];
        unit[..shown.len()].copy_from_slice(shown);
        writer.bytes(&unit);
    }

    /// `None` where bytes are missing, none inside where they mean nothing.
    fn decode(reader: &mut ByteReader<'_>) -> Option<Option<Self>> {
        let (dimension, count) = (reader.u32()?, reader.u32()?);
        let mut paddles = Vec::with_capacity(MAX_PADDLES);
        for _ in 0..MAX_PADDLES {
            paddles.push(reader.u32()?);
        }
        let unit = reader.slice(UNIT_BYTES)?;
        let Ok(count) = usize::try_from(count) else { return Some(None) };
        if count > MAX_PADDLES {
            return Some(None);
        }
        paddles.truncate(count);
        let end = unit.iter().position(|byte| *byte == 0).unwrap_or(UNIT_BYTES);
        let unit = std::str::from_utf8(&unit[..end]).ok().map(str::to_owned);
        Some(unit.map(|unit| Self { dimension, paddles, unit }))
    }
}
