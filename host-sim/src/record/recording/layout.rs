//! The bytes of headers and records.

use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::law::Direction;
use firmware::limits::PositionLimit;
use firmware::{Inputs, Settings};
use sha2::{Digest, Sha256};

use super::{BODY_BYTES, Exchange, FORMAT_VERSION, Header, MAGIC, Record, RecordingError, RunMode, TICK_MARK, Truth};
use crate::exchange::bytes::{Reader, Writer};

pub(super) fn encode_header(header: &Header, writer: &mut Writer) {
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

pub(super) fn decode_header(reader: &mut Reader<'_>) -> Result<Header, RecordingError> {
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

pub(super) fn encode_record(record: &Record, writer: &mut Writer) {
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

pub(super) fn decode_record(reader: &mut Reader<'_>) -> Option<Record> {
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
