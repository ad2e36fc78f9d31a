//! Runs the controller again on recorded inputs and compares every command bit by bit.

use std::path::Path;

use firmware::Mode;

use super::difference::difference;
use super::error::RecordError;
use super::recording::Recording;
use crate::runtime::executor::AnyTable;
use crate::runtime::time::mode::RunMode;

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
/// ```no_run
/// let replayed = host_sim::replay_file("report/inclusion-dynamic.rec".as_ref())?;
/// println!("{} commands agree bit by bit", replayed.ticks);
/// # Ok::<(), host_sim::record::error::RecordError>(())
/// ```
///
/// # Errors
/// [`RecordError::File`], [`RecordError::Recording`], and as [`replay`].
pub fn replay_file(path: &Path) -> Result<Replayed, RecordError> {
    replay(&Recording::read(path)?, path)
}

/// Replays a recording; `path` is for messages.
///
/// # Errors
/// [`RecordError::ReplayDiffers`]; [`RecordError::Table`], [`RecordError::Runtime`] if the controller cannot be built again.
pub fn replay(recording: &Recording, path: &Path) -> Result<Replayed, RecordError> {
    let header = &recording.header;
    let table =
        AnyTable::decode(&header.table).map_err(|source| RecordError::Table { path: path.to_owned(), source })?;
    let mut executor = table.on_this_machine(&header.settings)?;
    let mut differences = 0;
    let mut first = None;
    let mut was_safe = false;
    for record in &recording.records {
        let inputs = &record.tick.inputs;
        // Nothing but a re-arming leads out of SAFE, and it is not recorded by itself.
        if was_safe && record.tick.command.state != Mode::Safe as u32 {
            executor.rearm()?;
        }
        was_safe = record.tick.command.state == Mode::Safe as u32;
        let command = executor.step(inputs)?;
        if let Some(difference) = difference(&record.tick.command, &command) {
            differences += 1;
            first.get_or_insert((inputs.tick, difference));
        }
    }
    let ticks = recording.records.len() as u64;
    match first {
        None => Ok(Replayed { ticks, mode: header.mode, seed: header.seed }),
        Some((tick, first)) => {
            Err(RecordError::ReplayDiffers { path: path.to_owned(), differences, ticks, tick, first })
        }
    }
}
