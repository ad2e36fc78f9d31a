//! What is wrong with a file, where in it, and what to do.

use std::fmt;
use std::path::PathBuf;

/// What was read, and what the reader did about what it found.
#[derive(Debug, Clone, PartialEq)]
pub struct Noted<T> {
    /// What was read.
    pub value: T,
    /// What was left out, changed or assumed, a sentence each.
    pub notes: Vec<String>,
}

/// Where in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Nowhere in particular.
    Whole,
    /// A line, from 1.
    Line(usize),
    /// A byte, from 0.
    Byte(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Byte(byte) => write!(f, ", byte {byte}"),
        }
    }
}

/// Why bytes are not what their format says, or not what can be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// The file breaks the rules of its format, or is cut off.
    #[error("{format}{place}: {what}")]
    Broken {
        /// What the file is read as.
        format: &'static str,
        /// Where.
        place: Place,
        /// What is wrong, and what to do where that is not to export the file again.
        what: String,
    },
    /// The file may be right, but nothing here can use it.
    #[error("{format}{place}: {what}; {help}")]
    Unsupported {
        /// What the file is read as.
        format: &'static str,
        /// Where.
        place: Place,
        /// What it has.
        what: String,
        /// What to do.
        help: String,
    },
    /// The file, or what its header says, is larger than what is read.
    #[error("{format}: {what}, and at most {most} are read; make it coarser or cut it to the body")]
    TooLarge {
        /// What the file is read as.
        format: &'static str,
        /// How much of what.
        what: String,
        /// The limit.
        most: u64,
    },
}

impl ReadError {
    pub(crate) fn broken(format: &'static str, place: Place, what: impl Into<String>) -> Self {
        Self::Broken { format, place, what: what.into() }
    }

    pub(crate) fn unsupported(format: &'static str, what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Unsupported { format, place: Place::Whole, what: what.into(), help: help.into() }
    }
}

/// What is wrong with which file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be opened or read.
    #[error("{}: {source}", .path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// Its contents are not what its name says.
    #[error("{}: {source}", .path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        source: ReadError,
    },
    /// Its name ends in nothing that is read here.
    #[error("{}: files of this kind are not read as {wanted}; they end in {endings}", .path.display())]
    Ending {
        /// Which file.
        path: PathBuf,
        /// What was wanted.
        wanted: &'static str,
        /// How names of such files end.
        endings: &'static str,
    },
}
