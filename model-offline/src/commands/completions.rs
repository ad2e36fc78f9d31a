//! `model-offline completions`: a completion script for a shell.

use super::error::CliError;
use model_offline::tell;

/// Options of `completions`.
#[derive(Debug, clap::Args)]
pub(super) struct CompletionsArgs {
    /// The shell.
    shell: clap_complete::Shell,
}

pub(super) fn run(args: &CompletionsArgs, command: &mut clap::Command) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, command, "model-offline", &mut script);
    tell!("{}", String::from_utf8_lossy(&script));
    Ok(())
}
