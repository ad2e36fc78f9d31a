//! `host-sim export`: a recording in the formats of other tools.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::SimError;
use host_sim::record::export::{csv, mcap};
use host_sim::record::files::write_bytes;
use host_sim::record::recording::{Recording, Salvaged};

use model_offline::output::check_outputs;

/// Options of `export`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ExportArgs {
    /// Recording, as `run` writes it
    pub(crate) recording: PathBuf,
    /// Write MCAP, for Foxglove and Lichtblick
    #[arg(long, value_name = "FILE", required_unless_present = "csv")]
    pub(crate) mcap: Option<PathBuf>,
    /// Write a table with a time column, for PlotJuggler and spreadsheets
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Export the ticks before the damage of a recording that is damaged or cut off
    #[arg(long)]
    pub(crate) salvage: bool,
}

/// Writes the files that were asked for.
///
/// # Errors
/// [`SimError::Record`], [`SimError::File`].
pub(crate) fn export(args: &ExportArgs) -> Result<(), SimError> {
    check_outputs(&[&args.recording], &[("--mcap", args.mcap.as_deref()), ("--csv", args.csv.as_deref())])?;
    let Salvaged { recording, damage } =
        if args.salvage { Recording::salvage(&args.recording)? } else { Recording::read(&args.recording)?.into() };
    let table = firmware::contract::decode::<f64, 2>(&recording.header.table)
        .map_err(|source| SimError::Table { path: args.recording.clone(), source })?;
    let mut said: Vec<String> = damage.map(|damage| format!("damaged: {damage}")).into_iter().collect();
    if let Some(path) = &args.mcap {
        let bytes = mcap::encode(&recording, table.orthogonal.into(), mcap::NeedleForces::default())?;
        said.push(written(path, &bytes)?);
    }
    if let Some(path) = &args.csv {
        said.push(written(path, &csv::recording(&recording, &table.orthogonal, table.units.length.as_str()))?);
    }
    println!("{} ticks, {}\n{}", recording.records.len(), recording.header.mode, said.join("\n"));
    Ok(())
}

fn written(path: &Path, bytes: &[u8]) -> Result<String, SimError> {
    write_bytes(path, bytes)?;
    Ok(format!("{}: {} bytes", path.display(), bytes.len()))
}
