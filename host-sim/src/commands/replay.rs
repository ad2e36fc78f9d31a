//! `host-sim replay`.

use model_offline::say;
use std::path::PathBuf;

use clap::Args;
use host_sim::SimError;
use host_sim::record::recording::{Recording, Salvaged};
use host_sim::record::replay::replay as replay_recording;

/// Options of `replay`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReplayArgs {
    /// Recording, as `run` writes it
    pub(crate) recording: PathBuf,
    /// Replay the ticks before the damage of one that is damaged or cut off
    #[arg(long)]
    pub(crate) salvage: bool,
}

/// Replays and says how much agrees.
///
/// # Errors
/// [`SimError::Record`].
pub(crate) fn replay(args: &ReplayArgs) -> Result<(), SimError> {
    let Salvaged { recording, damage } =
        if args.salvage { Recording::salvage(&args.recording)? } else { Recording::read(&args.recording)?.into() };
    if let Some(damage) = damage {
        say!("damaged: {damage}");
    }
    let replayed = replay_recording(&recording, &args.recording)?;
    say!(
        "{} of {} commands agree bit by bit ({}, seed {})",
        replayed.ticks,
        replayed.ticks,
        replayed.mode,
        replayed.seed
    );
    Ok(())
}
