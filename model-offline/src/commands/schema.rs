//! `model-offline schema`: the JSON Schema of the scene file.

use super::common::pretty;
use super::error::CliError;
use model_offline::scene::schema::json_schema;

pub(super) fn run() -> Result<(), CliError> {
    println!("{}", pretty(&json_schema()));
    Ok(())
}
