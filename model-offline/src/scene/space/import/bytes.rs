//! Numbers of a binary file, one after the other.

use super::error::{Place, ReadError};

/// The bytes of a file and how far they are read. Nothing is stored by a count that stands in the file: every number
/// that is read is there.
#[derive(Debug, Clone)]
pub(crate) struct Bytes<'a> {
    format: &'static str,
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

/// A type of numbers in binary files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    /// Bytes of a number.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number that so many bytes are. Whole numbers beyond 2⁵³ are rounded.
    pub(crate) fn number(self, bytes: &[u8], big: bool) -> f64 {
        let mut low = [0; 8];
        for (i, byte) in bytes.iter().take(self.size()).enumerate() {
            low[if big { self.size() - 1 - i } else { i }] = *byte;
        }
        let word = u64::from_le_bytes(low);
        match self {
            Self::I8 => f64::from(word as i8),
            Self::U8 => f64::from(word as u8),
            Self::I16 => f64::from(word as i16),
            Self::U16 => f64::from(word as u16),
            Self::I32 => f64::from(word as i32),
            Self::U32 => f64::from(word as u32),
            Self::I64 => word as i64 as f64,
            Self::U64 => word as f64,
            Self::F32 => f64::from(f32::from_bits(word as u32)),
            Self::F64 => f64::from_bits(word),
        }
    }
}

impl<'a> Bytes<'a> {
    /// Reads from a byte of the file on.
    pub(crate) fn new(format: &'static str, bytes: &'a [u8], at: usize, big: bool) -> Self {
        Self { format, bytes, at, big }
    }

    /// What is wrong where the reading is.
    pub(crate) fn wrong(&self, what: impl Into<String>) -> ReadError {
        ReadError::broken(self.format, Place::Byte(self.at), what)
    }

    /// How many bytes are left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// So many bytes.
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], ReadError> {
        let end = self.at.checked_add(count);
        let found = end.and_then(|end| self.bytes.get(self.at..end));
        let found = found.ok_or_else(|| {
            self.wrong(format!("the file ends {} bytes later, within numbers: it is cut off", self.left()))
        })?;
        self.at += count;
        Ok(found)
    }

    /// A number.
    pub(crate) fn number(&mut self, kind: Kind) -> Result<f64, ReadError> {
        Ok(kind.number(self.take(kind.size())?, self.big))
    }

    /// A finite number.
    pub(crate) fn coordinate(&mut self, kind: Kind) -> Result<f64, ReadError> {
        let number = self.number(kind)?;
        if number.is_finite() { Ok(number) } else { Err(self.wrong(format!("the coordinate before is {number}"))) }
    }
}
