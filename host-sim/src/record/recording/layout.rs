//! The bytes of headers and records.

use firmware::Settings;
use firmware::contract::frames::{MAX_DIMENSION, MAX_PADDLES};
use firmware::law::{Direction, Feedback};
use firmware::limits::PositionLimit;
use sha2::{Digest, Sha256};

use super::{BODY_BYTES, FORMAT_VERSION, MAGIC, Record, RecordingError, RecordingHeader, TICK_MARK};
use crate::exchange::bytes::{ByteReader, ByteWriter};
use crate::runtime::accounting::tick::{ControllerTick, TICK_BYTES};
use crate::runtime::time::mode::RunMode;
use crate::world::truth::Truth;

pub(super) fn encode_header(header: &RecordingHeader, writer: &mut ByteWriter) {
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
        Some(Direction::Inverse) => 1,
        Some(Direction::MinimumNorm) => 2,
        None => 3,
    });
    writer.u32(match settings.position_limit {
        PositionLimit::Norm => 1,
        PositionLimit::Box => 2,
    });
    writer.u32(match settings.feedback {
        Feedback::Integral => 1,
        Feedback::Observer => 2,
        Feedback::Harmonic => 3,
    });
    writer.u32(header.table.len() as u32);
    writer.bytes(&header.table);
}

pub(super) fn decode_header(reader: &mut ByteReader<'_>) -> Result<RecordingHeader, RecordingError> {
    if reader.array() != Some(MAGIC) {
        return Err(RecordingError::NotARecording);
    }
    let found = reader.u32().ok_or(RecordingError::Header)?;
    if found != FORMAT_VERSION {
        return Err(RecordingError::Version { found, known: FORMAT_VERSION });
    }
    decode_header_fields(reader).ok_or(RecordingError::Header)
}

fn decode_header_fields(reader: &mut ByteReader<'_>) -> Option<RecordingHeader> {
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
        1 => Some(Direction::Inverse),
        2 => Some(Direction::MinimumNorm),
        3 => None,
        _ => return None,
    };
    settings.position_limit = match reader.u32()? {
        1 => PositionLimit::Norm,
        2 => PositionLimit::Box,
        _ => return None,
    };
    settings.feedback = match reader.u32()? {
        1 => Feedback::Integral,
        2 => Feedback::Observer,
        3 => Feedback::Harmonic,
        _ => return None,
    };
    let length = reader.u32()? as usize;
    let table = reader.slice(length)?.to_vec();
    if table_hash != <[u8; 32]>::from(Sha256::digest(&table)) {
        return None;
    }
    Some(RecordingHeader { mode, seed, scene_hash, settings, table })
}

pub(super) fn encode_record(record: &Record, writer: &mut ByteWriter) {
    writer.u32(TICK_MARK);
    record.tick.encode(writer);
    writer.u32(u32::from(record.truth.is_some()));
    if let Some(truth) = &record.truth {
        // Number as the controller's: a truth belongs to the tick of its record.
        writer.u64(truth.time_ns);
        writer.f64(truth.depth);
        truth.target.iter().chain(truth.paddles.iter().flatten()).for_each(|component| writer.f64(*component));
    }
}

pub(super) fn decode_record(reader: &mut ByteReader<'_>) -> Option<Record> {
    let tick = ControllerTick::decode(reader)?;
    let truth = match reader.u32()? {
        0 => None,
        1 => Some(Truth {
            tick: tick.inputs.tick,
            time_ns: reader.u64()?,
            depth: reader.f64()?,
            target: reader.displacement()?,
            paddles: [reader.displacement()?, reader.displacement()?],
        }),
        _ => return None,
    };
    Some(Record { tick, truth })
}

const _: () = assert!(4 + TICK_BYTES + 4 + 8 + 8 + (1 + MAX_PADDLES) * MAX_DIMENSION * 8 <= BODY_BYTES);
