//! `model-offline inspect`: what a table holds.

use super::error::CliError;
use super::json::write_json;
use firmware::contract::{Header, TableError};
use model_offline::output::check_outputs;
use model_offline::output::{space_table_text, table_text};
use model_offline::reading;
use model_offline::say;
use model_offline::table::space::SpaceTable;
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
    let bytes = reading::read(&args.table, reading::TEXT)
        .map_err(|error| CliError::BadTable { path: args.table.clone(), reason: error.into() })?;
    let refused = |error: TableError| CliError::BadTable { path: args.table.clone(), reason: error.to_string().into() };
    let (json, summary) = match Header::read(&bytes).map_err(refused)?.dimension {
        3 => {
            let contents = SpaceTable::read(&bytes).map_err(refused)?;
            (space_table_text::json(&contents), space_table_text::summary(&contents))
        }
        _ => {
            let contents = table_text::read(&bytes).map_err(refused)?;
            (table_text::json(&contents), table_text::summary(&contents))
        }
    };
    write_json(args.json.as_deref(), &json)?;
    say!("{}: {} bytes, checked", args.table.display(), bytes.len());
    say!("{summary}");
    Ok(())
}
