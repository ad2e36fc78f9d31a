//! Runs the controller again on recorded inputs and compares every command bit by bit.

use std::path::Path;

use firmware::contract::PaddleCommand;

use crate::error::SimError;
use crate::record::recording::{Recording, RunMode, read_recording};
use crate::runtime::executor::AnyTable;

/// A replay without differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Replayed {
    /// Commands compared.
    pub ticks: u64,
    /// What drove time in the recording.
    pub mode: RunMode,
    /// Its seed.
    pub seed: u64,
}

/// Reads and checks a recording file, then replays it.
///
/// # Errors
/// [`SimError::Read`], [`SimError::Recording`], and as [`replay`].
pub fn replay_file(path: &Path) -> Result<Replayed, SimError> {
    replay(&read_recording(path)?, path)
}

/// Replays a recording; `path` is for messages.
///
/// # Errors
/// [`SimError::ReplayDiffers`]; [`SimError::Table`], [`SimError::Settings`] if the controller cannot be built again.
pub fn replay(recording: &Recording, path: &Path) -> Result<Replayed, SimError> {
    let header = &recording.header;
    let table = AnyTable::decode(&header.table).map_err(|source| SimError::Table { path: path.to_owned(), source })?;
    let mut core = table.native(&header.settings)?;
    let mut differences = 0;
    let mut first = None;
    for record in &recording.records {
        let inputs = &record.exchange.inputs;
        let command = core.step(inputs)?;
        if let Some(detail) = difference(&record.exchange.command, &command) {
            differences += 1;
            first.get_or_insert((inputs.tick, detail));
        }
    }
    let ticks = recording.records.len() as u64;
    match first {
        None => Ok(Replayed { ticks, mode: header.mode, seed: header.seed }),
        Some((tick, detail)) => {
            Err(SimError::ReplayDiffers { path: path.to_owned(), differences, ticks, tick, detail })
        }
    }
}

/// The first field that differs in a single bit; NaN and −0 are not excused.
pub fn difference(recorded: &PaddleCommand, again: &PaddleCommand) -> Option<String> {
    macro_rules! compare {
        ($($field:ident),*) => {
            $(if recorded.$field != again.$field {
                let (was, is) = (recorded.$field, again.$field);
                return Some(format!(concat!(stringify!($field), " was {}, is {}"), was, is));
            })*
        };
    }
    compare!(sequence, state, tick, time_ns, faults, needle_sequence, target_sequence, paddle_index, flags);
    let pairs = recorded.displacement.iter().zip(&again.displacement);
    for (axis, (was, is)) in ["x", "y"].iter().zip(pairs) {
        if was.to_bits() != is.to_bits() {
            return Some(format!("displacement {axis} was {was:?}, is {is:?}"));
        }
    }
    None
}
