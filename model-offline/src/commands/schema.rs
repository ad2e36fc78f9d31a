//! `model-offline schema`: the JSON Schema of the scene file.

use super::error::CliError;
use super::json::pretty;
use model_offline::say;
use model_offline::scene::schema::json_schema;
use model_offline::scene::space;

/// Options of `schema`.
#[derive(Debug, clap::Args)]
pub(super) struct SchemaArgs {
    /// Dimension of the scenes: 2 for plane strain, 3 for space.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=3))]
    dimension: u8,
}

pub(super) fn run(args: &SchemaArgs) -> Result<(), CliError> {
    let schema = if args.dimension == 3 { space::schema::json_schema() } else { json_schema() };
    say!("{}", pretty(&schema));
    Ok(())
}
