//! Files, written whole or not at all.

use std::path::Path;

use model_offline::output::{OutputError, write_whole};
use model_offline::reading;
use serde::Serialize;

use super::error::FileError;

/// A file of a report that is still in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Artifact {
    /// File name.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Reads a table or a result.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    reading::read(path, reading::TEXT).map_err(|source| FileError::Read { path: path.to_owned(), source })
}

/// Reads a recording, which is as long as its run was.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_recording(path: &Path) -> Result<Vec<u8>, FileError> {
    reading::read_of_any_length(path).map_err(|source| FileError::Read { path: path.to_owned(), source })
}

/// Writes a file.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_whole(path, bytes).map_err(|OutputError { path, source, .. }| FileError::Write { path, source })
}

/// Writes a value as JSON for people to read.
///
/// # Errors
/// [`FileError::Write`]; also for a value that JSON has no form for.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), FileError> {
    let encoded = serde_json::to_vec_pretty(value);
    let mut bytes = encoded.map_err(std::io::Error::from).map_err(FileError::write(path))?;
    bytes.push(b'\n');
    write_bytes(path, &bytes)
}
