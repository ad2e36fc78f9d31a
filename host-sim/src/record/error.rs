//! What can go wrong with recordings and other files.

use model_offline::output::make_folder;
use std::path::{Path, PathBuf};

use firmware::contract::TableError;

use super::difference::Difference;
use crate::runtime::error::RuntimeError;

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// It cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// File or directory.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

impl FileError {
    /// Turns the reason why `path` cannot be written into an error.
    pub fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Write { path, source }
    }

    /// Makes a folder for results, with those above it.
    ///
    /// # Errors
    /// [`Self::Write`] names the folder.
    pub fn make_folder(path: &Path) -> Result<(), Self> {
        make_folder(path).map_err(|error| Self::write(path)(error.source))
    }
}

/// Why bytes are not a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The magic is not there.
    #[error("this is not a recording of host-sim")]
    NotARecording,
    /// Another version.
    #[error("its format version is {found}, this program reads {known}")]
    Version {
        /// What was found.
        found: u32,
        /// What this program reads.
        known: u32,
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

impl RecordingError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::NotARecording => "name a .rec file that `run` or `controller --record` has written",
            Self::Version { .. } => "use it with the program that has written it, or record again",
            Self::Header | Self::Chain { record: 0 } | Self::Unfinished { records: 0 } | Self::Value { record: 0 } => {
                "nothing of it can be used: record again"
            }
            Self::Chain { .. } | Self::Unfinished { .. } | Self::Trailing { .. } | Self::Value { .. } => {
                "replay or export the ticks before the damage with --salvage"
            }
        }
    }
}

/// Why a recording cannot be used or replayed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum RecordError {
    /// Its file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// It is not valid.
    #[error("the recording {} cannot be used", path.display())]
    #[diagnostic(help("{}", source.help()))]
    Recording {
        /// File.
        path: PathBuf,
        /// Why.
        source: RecordingError,
    },
    /// Its table cannot be used.
    #[error("the table {} cannot be used", path.display())]
    Table {
        /// File.
        path: PathBuf,
        /// Why.
        source: TableError,
    },
    /// The controller cannot be built again.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Runtime(#[from] RuntimeError),
    /// A replayed command is not the recorded one.
    #[error("{}: {differences} of {ticks} commands differ, the first at tick {tick}: {first}", path.display())]
    ReplayDiffers {
        /// File.
        path: PathBuf,
        /// Commands that differ.
        differences: u64,
        /// Commands compared.
        ticks: u64,
        /// Tick of the first difference.
        tick: u64,
        /// What differs there.
        first: Difference,
    },
}
