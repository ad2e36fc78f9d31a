//! `host-sim replay`.

use std::path::PathBuf;

use clap::Args;
use host_sim::SimError;
use host_sim::record::replay::replay_file;

/// Options of `replay`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReplayArgs {
    /// Recording, as `run` writes it
    pub(crate) recording: PathBuf,
}

/// Replays and says how much agrees.
///
/// # Errors
/// [`SimError::Record`].
pub(crate) fn replay(args: &ReplayArgs) -> Result<(), SimError> {
    let replayed = replay_file(&args.recording)?;
    println!(
        "{} of {} commands agree bit by bit ({}, seed {})",
        replayed.ticks, replayed.ticks, replayed.mode, replayed.seed
    );
    Ok(())
}
