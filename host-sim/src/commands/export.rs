//! `host-sim export`: a recording in the formats of other tools.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use firmware::{Faults, Mode};
use nalgebra::Vector2;

use crate::commands::controller::mode_name;
use crate::error::SimError;
use crate::record::export::mcap;
use crate::record::recording::{Recording, read_recording};
use crate::report::directory::write_bytes;

/// Options of `export`.
#[derive(Args, Clone, Debug)]
pub struct ExportArgs {
    /// Recording, as `run` writes it
    pub recording: PathBuf,
    /// Write MCAP, for Foxglove and Lichtblick
    #[arg(long, value_name = "FILE", required_unless_present = "csv")]
    pub mcap: Option<PathBuf>,
    /// Write a table with a time column, for PlotJuggler and spreadsheets
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
}

/// Writes the files that were asked for.
///
/// # Errors
/// [`SimError::Recording`], [`SimError::Read`], [`SimError::Write`].
pub fn export(args: &ExportArgs) -> Result<(), SimError> {
    let recording = read_recording(&args.recording)?;
    let table = firmware::contract::decode::<f64, 2>(&recording.header.table)
        .map_err(|source| SimError::Table { path: args.recording.clone(), source })?;
    let mut said = Vec::new();
    if let Some(path) = &args.mcap {
        let bytes = mcap::encode(&recording, table.orthogonal.into())
            .map_err(|error| SimError::Write { path: path.clone(), source: std::io::Error::other(error) })?;
        said.push(written(path, &bytes)?);
    }
    if let Some(path) = &args.csv {
        said.push(written(path, csv(&recording, &table.orthogonal).as_bytes())?);
    }
    println!("{} ticks, {}\n{}", recording.records.len(), recording.header.mode, said.join("\n"));
    Ok(())
}

fn written(path: &Path, bytes: &[u8]) -> Result<String, SimError> {
    write_bytes(path, bytes)?;
    Ok(format!("{}: {} bytes", path.display(), bytes.len()))
}

/// One line per tick of the controller; empty where nothing arrived.
fn csv(recording: &Recording, normal: &Vector2<f64>) -> String {
    let mut text = String::from(
        "time_s,tick,needle_depth,needle_velocity,target_x,target_y,paddle_x,paddle_y,command_x,command_y,state,faults,\
         true_depth,true_target_x,true_target_y,true_orthogonal_error\n",
    );
    let start_ns = recording.records.first().map_or(0, |record| record.exchange.inputs.time_ns);
    let pair = |pair: Option<[f64; 2]>| pair.map_or_else(|| ",".to_owned(), |[x, y]| format!("{x},{y}"));
    for record in &recording.records {
        let (inputs, command) = (&record.exchange.inputs, &record.exchange.command);
        let truth = record.truth.map(|t| (t.depth, t.target, Vector2::from(t.target).dot(normal)));
        let _ = writeln!(
            text,
            "{:.6},{},{},{},{},{},{},{},{}",
            (inputs.time_ns - start_ns) as f64 * 1e-9,
            inputs.tick,
            pair(inputs.needle.map(|s| [s.depth, s.velocity])),
            pair(inputs.target.map(|s| s.displacement)),
            pair(inputs.paddle.map(|s| s.displacement)),
            pair(command.is_valid().then_some(command.displacement)),
            Mode::from_wire(command.state).map_or("?", mode_name),
            Faults::from_bits(command.faults),
            truth.map_or_else(|| ",,,".to_owned(), |(depth, [x, y], error)| format!("{depth},{x},{y},{error}")),
        );
    }
    text
}
