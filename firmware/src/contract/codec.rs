//! Bytes of a table: fixed header, postcard payload, CRC-32.
//!
//! | offset | bytes | little-endian content |
//! |---|---|---|
//! | 0 | 8 | magic `STILLPT\0` |
//! | 8 | 2 | format version |
//! | 10 | 1 | scalar kind: 4 = f32, 8 = f64 |
//! | 11 | 1 | dimension of space |
//! | 12 | 2 | degrees of freedom of all paddles: their number times the dimension |
//! | 14 | 2 | reserved, 0 |
//! | 16 | 32 | SHA-256 of the scene |
//! | 48 | 4 | length L of the payload |
//! | 52 | L | payload: [`Table`] in postcard |
//! | 52 + L | 4 | CRC-32 (ISO-HDLC) over everything before it |
//!
//! Everything is checked before the payload is decoded, and nothing is allocated for lengths that a file claims.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::String;
use nalgebra::SMatrix;
use serde::Deserialize;

pub use super::format::{FORMAT_VERSION, MAX_TABLE_BYTES};
use super::frames::{MAX_DIMENSION, MAX_PADDLES};
use super::{Gains, Knot, Paddle, Table, TableError, Units, Validity};
use crate::scalar::{Scalar, ScalarKind};

/// Bytes before the payload.
pub const HEADER_BYTES: usize = 52;

const MAGIC: [u8; 8] = *b"STILLPT\0";
const CHECKSUM_BYTES: usize = 4;
/// Bit by bit: a table would take 1 KB of a microcontroller's flash.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Header of a table, readable without knowing the type of the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Version of the format.
    pub format_version: u16,
    /// Type of the numbers.
    pub scalar: ScalarKind,
    /// Dimension of space.
    pub dimension: u8,
    /// Degrees of freedom of all paddles.
    pub paddle_dof: u16,
    /// SHA-256 of the scene.
    pub scene_hash: [u8; 32],
    /// Length of the payload, bytes.
    pub payload_bytes: u32,
}

impl Header {
    /// Reads the header of a whole table file and checks everything that needs no payload type: magic, version,
    /// reserved bytes, length and checksum.
    ///
    /// # Errors
    /// The first check that fails, as its own [`TableError`].
    pub fn read(bytes: &[u8]) -> Result<Self, TableError> {
        split(bytes).map(|(header, _)| header)
    }

    fn parse(bytes: &[u8; HEADER_BYTES]) -> Result<Self, TableError> {
        let mut reader = Reader(bytes);
        if reader.take::<8>()? != MAGIC {
            return Err(TableError::NotATable);
        }
        let format_version = u16::from_le_bytes(reader.take()?);
        if format_version != FORMAT_VERSION {
            return Err(TableError::FormatVersion { found: format_version });
        }
        let [scalar, dimension] = reader.take()?;
        let paddle_dof = u16::from_le_bytes(reader.take()?);
        if reader.take()? != [0, 0] {
            return Err(TableError::Reserved);
        }
        Ok(Self {
            format_version,
            scalar: ScalarKind::from_byte(scalar).ok_or(TableError::UnknownScalar { found: scalar })?,
            dimension,
            paddle_dof,
            scene_hash: reader.take()?,
            payload_bytes: u32::from_le_bytes(reader.take()?),
        })
    }

    fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        let fields = MAGIC
            .into_iter()
            .chain(self.format_version.to_le_bytes())
            .chain([self.scalar as u8, self.dimension])
            .chain(self.paddle_dof.to_le_bytes())
            .chain([0, 0])
            .chain(self.scene_hash)
            .chain(self.payload_bytes.to_le_bytes());
        for (byte, value) in bytes.iter_mut().zip(fields) {
            *byte = value;
        }
        bytes
    }
}

/// Writes `table` into the front of `buffer` and returns the number of bytes used.
/// [`MAX_TABLE_BYTES`] are always enough.
///
/// # Errors
/// [`TableError::BufferTooSmall`], or what [`Table::validate`] refuses: an invalid table is never written.
pub fn encode<T: Scalar, const D: usize, const N: usize, const P: usize>(
    table: &Table<T, D, N, P>,
    buffer: &mut [u8],
) -> Result<usize, TableError> {
    table.validate()?;
    let too_small = TableError::BufferTooSmall { bytes: buffer.len() };
    let (header, body) = buffer.split_first_chunk_mut::<HEADER_BYTES>().ok_or(too_small)?;
    let payload_bytes = postcard::to_slice(table, body).map_err(|_| too_small)?.len();
    let paddle_dof = D * P;
    *header = Header {
        format_version: FORMAT_VERSION,
        scalar: T::KIND,
        dimension: u8::try_from(D).map_err(|_| TableError::Dimension { found: D, expected: MAX_DIMENSION })?,
        paddle_dof: u16::try_from(paddle_dof)
            .map_err(|_| TableError::PaddleDof { found: paddle_dof, expected: MAX_DIMENSION * MAX_PADDLES })?,
        scene_hash: table.scene_hash,
        payload_bytes: u32::try_from(payload_bytes).map_err(|_| too_small)?,
    }
    .to_bytes();
    let covered = HEADER_BYTES + payload_bytes;
    let (content, rest) = buffer.split_at_mut_checked(covered).ok_or(too_small)?;
    *rest.first_chunk_mut().ok_or(too_small)? = CRC.checksum(content).to_le_bytes();
    Ok(covered + CHECKSUM_BYTES)
}

/// Reads a table, checking everything: header, length, checksum, types, payload, invariants.
///
/// # Errors
/// The first check that fails, as its own [`TableError`].
pub fn decode<T: Scalar, const D: usize, const N: usize, const P: usize>(
    bytes: &[u8],
) -> Result<Table<T, D, N, P>, TableError> {
    let mut table = Table::empty();
    fill(bytes, &mut table, Labels::Keep)?;
    Ok(table)
}

/// As [`decode`], into a table that already has its place: one knot at a time, so that the stack holds one knot and
/// not all of them. Labels stay empty: what has no room for a table on its stack writes no reports, and the check of
/// their UTF-8 alone would take 0.6 KB of flash. After an error the table holds no knots, which validation refuses.
///
/// # Errors
/// As [`decode`].
pub fn decode_into<T: Scalar, const D: usize, const N: usize, const P: usize>(
    bytes: &[u8],
    table: &mut Table<T, D, N, P>,
) -> Result<(), TableError> {
    fill_again(bytes, table, Labels::Skip)
}

/// As [`decode_into`], with the labels: for whoever compares the table's unit with that of what is attached.
///
/// # Errors
/// As [`decode`].
pub fn decode_labelled_into<T: Scalar, const D: usize, const N: usize, const P: usize>(
    bytes: &[u8],
    table: &mut Table<T, D, N, P>,
) -> Result<(), TableError> {
    fill_again(bytes, table, Labels::Keep)
}

fn fill_again<T: Scalar, const D: usize, const N: usize, const P: usize>(
    bytes: &[u8],
    table: &mut Table<T, D, N, P>,
    labels: Labels,
) -> Result<(), TableError> {
    table.knots.clear();
    fill(bytes, table, labels).inspect_err(|_| table.knots.clear())
}

/// What becomes of the texts in a table, which only reports show.
#[derive(Clone, Copy)]
enum Labels {
    Keep,
    Skip,
}

fn fill<T: Scalar, const D: usize, const N: usize, const P: usize>(
    bytes: &[u8],
    table: &mut Table<T, D, N, P>,
    labels: Labels,
) -> Result<(), TableError> {
    let (header, payload) = split(bytes)?;
    if header.scalar != T::KIND {
        return Err(TableError::ScalarKind { found: header.scalar, expected: T::KIND });
    }
    if usize::from(header.dimension) != D {
        return Err(TableError::Dimension { found: header.dimension.into(), expected: D });
    }
    if usize::from(header.paddle_dof) != D * P {
        return Err(TableError::PaddleDof { found: header.paddle_dof.into(), expected: D * P });
    }
    // The fields of `Table` in their order, which postcard writes one after the other; the knots are the last.
    let mut payload = Payload(payload);
    table.units = Units { length: payload.label(labels)?, stress: payload.label(labels)? };
    table.tissue = payload.label(labels)?;
    for paddle in &mut table.paddles {
        *paddle = Paddle {
            index: payload.take()?,
            extent: [payload.numbers()?, payload.numbers()?],
            max_displacement: payload.take()?,
            max_rate: payload.take()?,
        };
    }
    table.needle_axis = payload.numbers()?;
    table.orthogonal = payload.numbers()?;
    table.target_position = payload.numbers()?;
    table.validity = Validity {
        depth_start: payload.take()?,
        depth_end: payload.take()?,
        paddle_displacement: payload.take()?,
        needle_speed: payload.take()?,
    };
    table.gains = Gains { loop_gain: payload.take()?, delay_samples: payload.take()?, lambda_max: payload.take()? };
    let knots: u32 = payload.take()?;
    for _ in 0..knots {
        let knot = Knot {
            depth: payload.take()?,
            jacobian: payload.jacobians()?,
            paddle_path: payload.numbers()?,
            paddle_path_slope: payload.numbers()?,
            target_displacement: payload.numbers()?,
            target_displacement_slope: payload.numbers()?,
            static_target_displacement: payload.numbers()?,
        };
        table.knots.push(knot).map_err(|_| TableError::Payload)?;
    }
    if !payload.0.is_empty() {
        return Err(TableError::PayloadTrailing { extra: payload.0.len() });
    }
    table.scene_hash = header.scene_hash;
    table.validate()
}

/// Takes values off the front of the payload: integers, numbers and texts only, of which everything else consists.
/// The decoders that serde derives do the same, but each for its own type: 1.5 KB more of flash.
struct Payload<'a>(&'a [u8]);

impl<'a> Payload<'a> {
    #[inline(never)]
    fn take<V: Deserialize<'a>>(&mut self) -> Result<V, TableError> {
        let (value, rest) = postcard::take_from_bytes(self.0).map_err(|_| TableError::Payload)?;
        self.0 = rest;
        Ok(value)
    }

    /// A vector or a matrix, column by column.
    fn numbers<T: Scalar, const R: usize, const C: usize>(&mut self) -> Result<SMatrix<T, R, C>, TableError> {
        let mut numbers = SMatrix::<T, R, C>::zeros();
        for number in numbers.iter_mut() {
            *number = self.take()?;
        }
        Ok(numbers)
    }

    /// One Jacobian for each paddle.
    fn jacobians<T: Scalar, const D: usize, const P: usize>(&mut self) -> Result<[SMatrix<T, D, D>; P], TableError> {
        let mut jacobians = [SMatrix::zeros(); P];
        for jacobian in &mut jacobians {
            *jacobian = self.numbers()?;
        }
        Ok(jacobians)
    }

    fn label<const N: usize>(&mut self, labels: Labels) -> Result<String<N>, TableError> {
        match labels {
            Labels::Keep => self.take(),
            Labels::Skip => self.take().map(|_: &[u8]| String::new()),
        }
    }
}

/// Header and payload of an intact file.
fn split(bytes: &[u8]) -> Result<(Header, &[u8]), TableError> {
    let too_short = TableError::TooShort { bytes: bytes.len() };
    let (content, checksum) = bytes.split_last_chunk::<CHECKSUM_BYTES>().ok_or(too_short)?;
    let (head, payload) = content.split_first_chunk::<HEADER_BYTES>().ok_or(too_short)?;
    let header = Header::parse(head)?;
    let claimed = header.payload_bytes as usize;
    if claimed > payload.len() {
        return Err(TableError::Truncated { missing: claimed - payload.len() });
    }
    if claimed < payload.len() {
        return Err(TableError::TrailingBytes { extra: payload.len() - claimed });
    }
    let (written, computed) = (u32::from_le_bytes(*checksum), CRC.checksum(content));
    if written != computed {
        return Err(TableError::Checksum { written, computed });
    }
    Ok((header, payload))
}

/// Takes fixed-size fields off the front of the header.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], TableError> {
        let (field, rest) = self.0.split_first_chunk::<N>().ok_or(TableError::TooShort { bytes: self.0.len() })?;
        self.0 = rest;
        Ok(*field)
    }
}

#[cfg(test)]
mod tests;
