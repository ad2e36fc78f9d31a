//! `model-offline inspect`: what a table holds.

use super::error::CliError;
use super::json::write_json;
use model_offline::output::check_outputs;
use model_offline::output::table_text;
use std::path::PathBuf;

/// Options of `inspect`.
#[derive(Debug, clap::Args)]
pub(super) struct InspectArgs {
    /// Table file.
    table: PathBuf,
    /// Write the contents as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &InspectArgs) -> Result<(), CliError> {
    check_outputs(&[&args.table], &[("--json", args.json.as_deref())])?;
    let bytes = std::fs::read(&args.table)
        .map_err(|error| CliError::BadTable { path: args.table.clone(), reason: error.into() })?;
    let contents = table_text::read(&bytes)
        .map_err(|error| CliError::BadTable { path: args.table.clone(), reason: error.to_string().into() })?;
    write_json(args.json.as_deref(), &table_text::json(&contents))?;
    println!("{}: {} bytes, checked", args.table.display(), bytes.len());
    println!("{}", table_text::summary(&contents));
    Ok(())
}
