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
//! | 100 | settings of the controller, see [`RecordingHeader`] |
//! | 4 + L | length of the table, and the table itself |
//! | 32 | chain value h₀ = SHA-256 of everything above |
//! | n · 416 | records: 384 bytes b, and hᵢ = SHA-256(hᵢ₋₁ ‖ b) |
//!
//! The last record is an end mark with the number of ticks: nothing can be changed, dropped, exchanged or cut off
//! without breaking the chain. Times of a lockstep recording come from its messages: no clock of the machine is in it.

use std::path::Path;

use firmware::Settings;
use sha2::{Digest, Sha256};

use super::error::{RecordError, RecordingError};
use super::files;
use crate::exchange::bytes::{ByteReader, ByteWriter};
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::time::mode::RunMode;
use crate::world::truth::Truth;

mod layout;
pub mod stream;

use layout::{decode_header, decode_record, encode_header, encode_record};

const MAGIC: [u8; 8] = *b"STILLREC";
/// Versions 1 and 2 had frames of two components and one paddle, and hold tables that are refused; what is true had two
/// components and one paddle in version 3. Replay of those needs the build that wrote them.
const FORMAT_VERSION: u32 = 4;
const BODY_BYTES: usize = 384;
const HASH_BYTES: usize = 32;
const RECORD_BYTES: usize = BODY_BYTES + HASH_BYTES;
const END_MARK: u32 = u32::from_le_bytes(*b"END.");
const TICK_MARK: u32 = u32::from_le_bytes(*b"TICK");

/// Everything that a replay needs besides the records.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingHeader {
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

/// One tick of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// The controller's side.
    pub tick: ControllerTick,
    /// The plant's side; none where the plant skipped the tick, or was not asked.
    pub truth: Option<Truth>,
}

/// A whole recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// What it is about.
    pub header: RecordingHeader,
    /// Its ticks.
    pub records: Vec<Record>,
}

impl Recording {
    /// What really happened, tick by tick, as far as it is known.
    pub fn truths(&self) -> Vec<Truth> {
        self.records.iter().filter_map(|record| record.truth).collect()
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`RecordError::File`], [`RecordError::Recording`].
    pub fn read(path: &Path) -> Result<Self, RecordError> {
        let bytes = files::read_recording(path)?;
        Self::decode(&bytes).map_err(|source| RecordError::Recording { path: path.to_owned(), source })
    }

    /// The bytes of the file.
    pub fn encode(&self) -> Vec<u8> {
        let (mut chain, mut bytes) = Chain::start(&self.header);
        for record in &self.records {
            chain.record(record, &mut bytes);
        }
        chain.end(self.records.len() as u64, &mut bytes);
        bytes
    }

    /// Reads what is whole of a file that is damaged or cut off, and says what is wrong with the rest.
    ///
    /// # Errors
    /// [`RecordError::File`]; [`RecordError::Recording`] where not a single record is whole.
    pub fn salvage(path: &Path) -> Result<Salvaged, RecordError> {
        let bytes = files::read_recording(path)?;
        let salvaged = Self::whole_records(&bytes).and_then(|salvaged| match salvaged.damage {
            Some(damage) if salvaged.recording.records.is_empty() => Err(damage),
            _ => Ok(salvaged),
        });
        salvaged.map_err(|source| RecordError::Recording { path: path.to_owned(), source })
    }

    /// Reads a file and checks the whole chain.
    ///
    /// # Errors
    /// [`RecordingError`], the first check that fails.
    pub fn decode(bytes: &[u8]) -> Result<Self, RecordingError> {
        let Salvaged { recording, damage } = Self::whole_records(bytes)?;
        damage.map_or(Ok(recording), Err)
    }

    /// Reads what is whole of a file that is still being written, or that was cut off.
    ///
    /// # Errors
    /// [`RecordingError`] for everything but a missing end.
    pub fn growing(bytes: &[u8]) -> Result<Self, RecordingError> {
        let Salvaged { recording, damage } = Self::whole_records(bytes)?;
        match damage {
            None | Some(RecordingError::Unfinished { .. }) => Ok(recording),
            Some(damage) => Err(damage),
        }
    }

    /// Reads the records before the first check that fails.
    ///
    /// # Errors
    /// [`RecordingError`] of the header: without it no record is worth anything.
    pub fn whole_records(bytes: &[u8]) -> Result<Salvaged, RecordingError> {
        let mut reader = ByteReader(bytes);
        let header = decode_header(&mut reader)?;
        let covered = bytes.len() - reader.0.len();
        let chain: [u8; HASH_BYTES] = Sha256::digest(&bytes[..covered]).into();
        if reader.array() != Some(chain) {
            return Err(RecordingError::Header);
        }
        let mut records = Vec::with_capacity(reader.0.len() / RECORD_BYTES);
        let damage = read_records(&mut reader, chain, &mut records).err();
        Ok(Salvaged { recording: Self { header, records }, damage })
    }
}

/// What is whole of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Salvaged {
    /// The ticks before the damage.
    pub recording: Recording,
    /// What is wrong after them; none: it is whole.
    pub damage: Option<RecordingError>,
}

impl From<Recording> for Salvaged {
    fn from(recording: Recording) -> Self {
        Self { recording, damage: None }
    }
}

/// Records up to the end mark, or up to the first that does not hold.
fn read_records(
    reader: &mut ByteReader<'_>,
    mut chain: [u8; HASH_BYTES],
    records: &mut Vec<Record>,
) -> Result<(), RecordingError> {
    loop {
        let (Some(body), Some(written)) = (reader.array::<BODY_BYTES>(), reader.array::<HASH_BYTES>()) else {
            return Err(RecordingError::Unfinished { records: records.len() });
        };
        chain = next_link(&chain, &body);
        if written != chain {
            return Err(RecordingError::Chain { record: records.len() });
        }
        let impossible = RecordingError::Value { record: records.len() };
        let mut body = ByteReader(&body);
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
    if reader.0.is_empty() { Ok(()) } else { Err(RecordingError::Trailing { bytes: reader.0.len() }) }
}

/// A recording being written, record by record.
#[derive(Clone, Debug)]
struct Chain([u8; HASH_BYTES]);

impl Chain {
    /// The chain of a recording, and the bytes that it starts with.
    fn start(header: &RecordingHeader) -> (Self, Vec<u8>) {
        let mut writer = ByteWriter::default();
        encode_header(header, &mut writer);
        let chain: [u8; HASH_BYTES] = Sha256::digest(&writer.0).into();
        writer.bytes(&chain);
        (Self(chain), writer.0)
    }

    fn record(&mut self, record: &Record, bytes: &mut Vec<u8>) {
        let mut body = ByteWriter::default();
        encode_record(record, &mut body);
        self.link(&body.0, bytes);
    }

    fn end(&mut self, records: u64, bytes: &mut Vec<u8>) {
        let mut body = ByteWriter::default();
        body.u32(END_MARK);
        body.u32(0);
        body.u64(records);
        self.link(&body.0, bytes);
    }

    fn link(&mut self, body: &[u8], bytes: &mut Vec<u8>) {
        let mut padded = [0; BODY_BYTES];
        padded[..body.len()].copy_from_slice(body);
        self.0 = next_link(&self.0, &padded);
        bytes.extend_from_slice(&padded);
        bytes.extend_from_slice(&self.0);
    }
}

fn next_link(chain: &[u8; HASH_BYTES], body: &[u8; BODY_BYTES]) -> [u8; HASH_BYTES] {
    Sha256::new().chain_update(chain).chain_update(body).finalize().into()
}

#[cfg(test)]
mod tests;
