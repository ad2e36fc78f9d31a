//! Recordings: every tick as the controller saw it, and what really happened, in a chain of hashes.
//!
//! Little-endian throughout:
//!
//! | bytes | content |
//! |---|---|
//! | 8 | magic `STILLREC` |
//! | 4 | format version |
//! | 4 | 1 = lockstep, 2 = free-run |
//! | 8 | seed |
//! | 32 | SHA-256 of the plant's scene |
//! | 32 | SHA-256 of the table's bytes |
//! | 96 | settings of the controller, see [`Header`] |
//! | 4 + L | length of the table, and the table itself |
//! | 32 | chain value h₀ = SHA-256 of everything above |
//! | n · 288 | records: 256 bytes b, and hᵢ = SHA-256(hᵢ₋₁ ‖ b) |
//!
//! The last record is an end mark with the number of ticks: nothing can be changed, dropped, exchanged or cut off
//! without breaking the chain. Times of a lockstep recording come from its messages: no clock of the machine is in it.

use firmware::Inputs;
use firmware::Settings;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::law::Direction;
use firmware::limits::PositionLimit;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::bytes::{Reader, Writer};

const MAGIC: [u8; 8] = *b"STILLREC";
const FORMAT_VERSION: u32 = 1;
const BODY_BYTES: usize = 256;
const HASH_BYTES: usize = 32;
const RECORD_BYTES: usize = BODY_BYTES + HASH_BYTES;
const END_MARK: u32 = u32::from_le_bytes(*b"END.");
const TICK_MARK: u32 = u32::from_le_bytes(*b"TICK");

/// Whether messages or the machine's clock drive time. Never mixed; every output says which it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum RunMode {
    /// Time comes from the messages: deterministic, as fast as it goes.
    Lockstep,
    /// Steady clock, absolute deadlines.
    FreeRun,
}

impl std::fmt::Display for RunMode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Lockstep => "lockstep",
            Self::FreeRun => "free-run",
        })
    }
}

/// Everything that a replay needs besides the records.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// What drove time.
    pub mode: RunMode,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// SHA-256 of the plant's scene.
    pub scene_hash: [u8; 32],
    /// Settings of the controller.
    pub settings: Settings,
    /// The controller's table, as encoded.
    pub table: Vec<u8>,
}

/// What the controller saw and answered in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    /// Inputs of the step.
    pub inputs: Inputs,
    /// Its command.
    pub command: PaddleCommand,
}

/// What really happened at a tick, which the controller does not see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Tick of the plant.
    pub tick: u64,
    /// Time of that tick, ns.
    pub time_ns: u64,
    /// Needle depth, length.
    pub depth: f64,
    /// Target displacement, length.
    pub target: [f64; 2],
    /// Paddle displacement, length.
    pub paddle: [f64; 2],
}

/// One tick of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// The controller's side.
    pub exchange: Exchange,
    /// The plant's side; none where the plant skipped the tick, or was not asked.
    pub truth: Option<Truth>,
}

/// A whole recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// What it is about.
    pub header: Header,
    /// Its ticks.
    pub records: Vec<Record>,
}

/// Why bytes are not a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The magic is not there.
    #[error("this is not a recording of host-sim")]
    NotARecording,
    /// Another version.
    #[error("its format version is {found}, this program reads {FORMAT_VERSION}")]
    Version {
        /// What was found.
        found: u32,
    },
    /// The header does not hash to its chain value.
    #[error("its header has been altered or cut off")]
    Header,
    /// A record does not continue the chain.
    #[error("the chain breaks at record {record}: altered from there on; the records before are intact")]
    Chain {
        /// Number of the record, from 0.
        record: usize,
    },
    /// The end mark is missing.
    #[error("it ends after {records} whole records without an end mark: the run was cut off")]
    Unfinished {
        /// Whole records.
        records: usize,
    },
    /// Something follows the end mark.
    #[error("{bytes} bytes follow its end mark")]
    Trailing {
        /// How many.
        bytes: usize,
    },
    /// A value that cannot be, although the chain is whole: written by something else.
    #[error("record {record} holds an impossible value")]
    Value {
        /// Number of the record, from 0.
        record: usize,
    },
}

impl Recording {
    /// The bytes of the file.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        encode_header(&self.header, &mut writer);
        let mut chain: [u8; 32] = Sha256::digest(&writer.0).into();
        writer.bytes(&chain);
        for record in &self.records {
            let mut body = Writer::default();
            encode_record(record, &mut body);
            link(&mut writer, &mut chain, body);
        }
        let mut end = Writer::default();
        end.u32(END_MARK);
        end.u32(0);
        end.u64(self.records.len() as u64);
        link(&mut writer, &mut chain, end);
        writer.0
    }

    /// Reads a file and checks the whole chain.
    ///
    /// # Errors
    /// [`RecordingError`], the first check that fails.
    pub fn decode(bytes: &[u8]) -> Result<Self, RecordingError> {
        let mut reader = Reader(bytes);
        let header = decode_header(&mut reader)?;
        let covered = bytes.len() - reader.0.len();
        let mut chain: [u8; 32] = Sha256::digest(&bytes[..covered]).into();
        if reader.array::<HASH_BYTES>() != Some(chain) {
            return Err(RecordingError::Header);
        }
        let mut records = Vec::with_capacity(reader.0.len() / RECORD_BYTES);
        loop {
            let unfinished = RecordingError::Unfinished { records: records.len() };
            let body: [u8; BODY_BYTES] = reader.array().ok_or(unfinished.clone())?;
            let written: [u8; HASH_BYTES] = reader.array().ok_or(unfinished)?;
            chain = next_link(&chain, &body);
            if written != chain {
                return Err(RecordingError::Chain { record: records.len() });
            }
            let impossible = RecordingError::Value { record: records.len() };
            let mut body = Reader(&body);
            match body.u32() {
                Some(TICK_MARK) => records.push(decode_record(&mut body).ok_or(impossible)?),
                Some(END_MARK) => {
                    let _ = body.u32();
                    if body.u64() != Some(records.len() as u64) {
                        return Err(impossible);
                    }
                    break;
                }
                _ => return Err(impossible),
            }
        }
        if !reader.0.is_empty() {
            return Err(RecordingError::Trailing { bytes: reader.0.len() });
        }
        Ok(Self { header, records })
    }
}

fn next_link(chain: &[u8; HASH_BYTES], body: &[u8; BODY_BYTES]) -> [u8; HASH_BYTES] {
    Sha256::new().chain_update(chain).chain_update(body).finalize().into()
}

fn link(writer: &mut Writer, chain: &mut [u8; HASH_BYTES], body: Writer) {
    let mut padded = [0; BODY_BYTES];
    padded[..body.0.len()].copy_from_slice(&body.0);
    *chain = next_link(chain, &padded);
    writer.bytes(&padded);
    writer.bytes(chain.as_slice());
}

fn encode_header(header: &Header, writer: &mut Writer) {
    writer.bytes(&MAGIC);
    writer.u32(FORMAT_VERSION);
    writer.u32(match header.mode {
        RunMode::Lockstep => 1,
        RunMode::FreeRun => 2,
    });
    writer.u64(header.seed);
    writer.bytes(&header.scene_hash);
    writer.bytes(&Sha256::digest(&header.table));
    let settings = &header.settings;
    writer.u64(settings.loop_period_ns);
    writer.u64(settings.target_period_ns);
    writer.u64(settings.target_latency_ns);
    writer.u64(settings.actuator_delay_ns);
    writer.f64(settings.target_noise);
    for optional in [settings.loop_gain, settings.lambda_max, settings.following_error] {
        writer.u64(u64::from(optional.is_some()));
        writer.f64(optional.unwrap_or(0.0));
    }
    writer.u32(match settings.direction {
        Direction::Inverse => 1,
        Direction::MinimumNorm => 2,
    });
    writer.u32(match settings.position_limit {
        PositionLimit::Norm => 1,
        PositionLimit::Box => 2,
    });
    writer.u32(header.table.len() as u32);
    writer.bytes(&header.table);
}

fn decode_header(reader: &mut Reader<'_>) -> Result<Header, RecordingError> {
    if reader.array() != Some(MAGIC) {
        return Err(RecordingError::NotARecording);
    }
    let found = reader.u32().ok_or(RecordingError::Header)?;
    if found != FORMAT_VERSION {
        return Err(RecordingError::Version { found });
    }
    decode_header_fields(reader).ok_or(RecordingError::Header)
}

fn decode_header_fields(reader: &mut Reader<'_>) -> Option<Header> {
    let mode = match reader.u32()? {
        1 => RunMode::Lockstep,
        2 => RunMode::FreeRun,
        _ => return None,
    };
    let seed = reader.u64()?;
    let scene_hash = reader.array()?;
    let table_hash: [u8; 32] = reader.array()?;
    let mut settings = Settings::new(reader.u64()?, reader.u64()?, reader.u64()?);
    settings.actuator_delay_ns = reader.u64()?;
    settings.target_noise = reader.f64()?;
    let mut optional = || -> Option<Option<f64>> {
        let given = reader.u64()? == 1;
        let value = reader.f64()?;
        Some(given.then_some(value))
    };
    settings.loop_gain = optional()?;
    settings.lambda_max = optional()?;
    settings.following_error = optional()?;
    settings.direction = match reader.u32()? {
        1 => Direction::Inverse,
        2 => Direction::MinimumNorm,
        _ => return None,
    };
    settings.position_limit = match reader.u32()? {
        1 => PositionLimit::Norm,
        2 => PositionLimit::Box,
        _ => return None,
    };
    let length = reader.u32()? as usize;
    let table = reader.slice(length)?.to_vec();
    if table_hash != <[u8; 32]>::from(Sha256::digest(&table)) {
        return None;
    }
    Some(Header { mode, seed, scene_hash, settings, table })
}

/// Bytes of an encoded [`Exchange`], as the controller process hands it over.
pub const EXCHANGE_BYTES: usize = 4 + 16 + 32 + 32 + 32 + 64;

impl Exchange {
    /// Writes the fixed-size form.
    pub fn encode(&self, writer: &mut Writer) {
        let (inputs, command) = (&self.inputs, &self.command);
        let present = u32::from(inputs.needle.is_some())
            | u32::from(inputs.target.is_some()) << 1
            | u32::from(inputs.paddle.is_some()) << 2;
        writer.u32(present);
        writer.u64(inputs.tick);
        writer.u64(inputs.time_ns);
        let needle = inputs.needle.unwrap_or_default();
        writer.u32(needle.sequence);
        writer.u32(needle.reserved);
        writer.u64(needle.time_ns);
        writer.f64(needle.depth);
        writer.f64(needle.velocity);
        let target = inputs.target.unwrap_or_default();
        writer.u32(target.sequence);
        writer.u32(target.flags);
        writer.u64(target.time_ns);
        writer.vector(&target.displacement);
        let paddle = inputs.paddle.unwrap_or_default();
        writer.u32(paddle.sequence);
        writer.u32(paddle.paddle_index);
        writer.u64(paddle.time_ns);
        writer.vector(&paddle.displacement);
        writer.u32(command.sequence);
        writer.u32(command.state);
        writer.u64(command.tick);
        writer.u64(command.time_ns);
        writer.u64(command.faults);
        writer.vector(&command.displacement);
        writer.u32(command.needle_sequence);
        writer.u32(command.target_sequence);
        writer.u32(command.paddle_index);
        writer.u32(command.flags);
    }

    /// Reads the fixed-size form; `None` for bytes that nobody writes.
    pub fn decode(reader: &mut Reader<'_>) -> Option<Self> {
        let present = reader.u32()?;
        if present > 7 {
            return None;
        }
        let (tick, time_ns) = (reader.u64()?, reader.u64()?);
        let needle = NeedleSample {
            sequence: reader.u32()?,
            reserved: reader.u32()?,
            time_ns: reader.u64()?,
            depth: reader.f64()?,
            velocity: reader.f64()?,
        };
        let target = TargetSample {
            sequence: reader.u32()?,
            flags: reader.u32()?,
            time_ns: reader.u64()?,
            displacement: reader.vector()?,
        };
        let paddle = PaddleSample {
            sequence: reader.u32()?,
            paddle_index: reader.u32()?,
            time_ns: reader.u64()?,
            displacement: reader.vector()?,
        };
        let command = PaddleCommand {
            sequence: reader.u32()?,
            state: reader.u32()?,
            tick: reader.u64()?,
            time_ns: reader.u64()?,
            faults: reader.u64()?,
            displacement: reader.vector()?,
            needle_sequence: reader.u32()?,
            target_sequence: reader.u32()?,
            paddle_index: reader.u32()?,
            flags: reader.u32()?,
        };
        Some(Self {
            inputs: Inputs {
                tick,
                time_ns,
                needle: (present & 1 != 0).then_some(needle),
                target: (present & 2 != 0).then_some(target),
                paddle: (present & 4 != 0).then_some(paddle),
            },
            command,
        })
    }
}

fn encode_record(record: &Record, writer: &mut Writer) {
    writer.u32(TICK_MARK);
    record.exchange.encode(writer);
    writer.u32(u32::from(record.truth.is_some()));
    if let Some(truth) = &record.truth {
        // Tick as the exchange's: a truth belongs to the tick of its record.
        writer.u64(truth.time_ns);
        writer.f64(truth.depth);
        writer.vector(&truth.target);
        writer.vector(&truth.paddle);
    }
}

fn decode_record(reader: &mut Reader<'_>) -> Option<Record> {
    let exchange = Exchange::decode(reader)?;
    let truth = match reader.u32()? {
        0 => None,
        1 => Some(Truth {
            tick: exchange.inputs.tick,
            time_ns: reader.u64()?,
            depth: reader.f64()?,
            target: reader.vector()?,
            paddle: reader.vector()?,
        }),
        _ => return None,
    };
    Some(Record { exchange, truth })
}

const _: () = assert!(4 + EXCHANGE_BYTES + 4 + 8 + 8 + 16 + 16 <= BODY_BYTES);

#[cfg(test)]
mod tests;
