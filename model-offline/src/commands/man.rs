//! `model-offline man`: manual pages.

use super::error::CliError;
use model_offline::output::{self, OutputError};
use model_offline::say;
use std::path::PathBuf;

/// Options of `man`.
#[derive(Debug, clap::Args)]
pub(super) struct ManArgs {
    /// Directory for the pages.
    directory: PathBuf,
}

pub(super) fn run(args: &ManArgs, command: clap::Command) -> Result<(), CliError> {
    let fail = |source| OutputError { path: args.directory.clone(), source };
    output::make_folder(&args.directory)?;
    let together = output::together();
    clap_mangen::generate_to(command, &args.directory).map_err(fail)?;
    drop(together);
    say!("{}", args.directory.join("model-offline.1").display());
    Ok(())
}
