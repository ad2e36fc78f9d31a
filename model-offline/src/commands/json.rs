//! JSON as all commands write it.

use model_offline::output::{OutputError, write_whole};
use std::path::Path;

pub(super) fn pretty(value: &impl serde::Serialize) -> String {
    // Values made of numbers, strings and lists always serialise.
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// Writes JSON where it is asked for.
pub(super) fn write_json(path: Option<&Path>, value: &impl serde::Serialize) -> Result<(), OutputError> {
    match path {
        Some(path) => write_whole(path, pretty(value).as_bytes()),
        None => Ok(()),
    }
}
