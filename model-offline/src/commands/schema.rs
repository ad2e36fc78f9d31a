//! `model-offline schema`: the JSON Schema of the scene file.

use super::error::CliError;
use super::json::pretty;
use model_offline::scene::schema::json_schema;

pub(super) fn run() -> Result<(), CliError> {
    println!("{}", pretty(&json_schema()));
    Ok(())
}
