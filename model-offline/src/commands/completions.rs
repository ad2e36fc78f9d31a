//! `model-offline completions`: a completion script for a shell.

use super::error::CliError;

/// Options of `completions`.
#[derive(Debug, clap::Args)]
pub(super) struct CompletionsArgs {
    /// The shell.
    shell: clap_complete::Shell,
}

pub(super) fn run(args: &CompletionsArgs, command: &mut clap::Command) -> Result<(), CliError> {
    clap_complete::generate(args.shell, command, "model-offline", &mut std::io::stdout());
    Ok(())
}
