//! `host-sim export`: a recording in the formats of other tools.

use std::path::{Path, PathBuf};

use clap::Args;
use firmware::contract::{Header, decode};
use host_sim::SimError;
use host_sim::bench::usage::UsageError;
use host_sim::record::export::foxglove::Stage;
use host_sim::record::export::{csv, mcap};
use host_sim::record::files::write_bytes;
use host_sim::record::recording::{Recording, Salvaged};

use model_offline::output::check_outputs;
use model_offline::scene::{Scene, TissueVariant};

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
    /// The recording's scene, a file or the name of a bundled scene: MCAP then has what is to be seen, too
    #[arg(long, value_name = "FILE", requires = "mcap")]
    pub(crate) scene: Option<PathBuf>,
    /// Export the ticks before the damage of a recording that is damaged or cut off
    #[arg(long)]
    pub(crate) salvage: bool,
}

/// Writes the files that were asked for.
///
/// # Errors
/// [`SimError::Record`], [`SimError::File`].
pub(crate) fn export(args: &ExportArgs) -> Result<(), SimError> {
    let inputs: Vec<&Path> = args.scene.iter().chain([&args.recording]).map(PathBuf::as_path).collect();
    check_outputs(&inputs, &[("--mcap", args.mcap.as_deref()), ("--csv", args.csv.as_deref())])?;
    let Salvaged { recording, damage } =
        if args.salvage { Recording::salvage(&args.recording)? } else { Recording::read(&args.recording)?.into() };
    let shape = Header::read(&recording.header.table).map_or((2, 2), |header| (header.dimension, header.paddle_dof));
    let files = match shape {
        (3, 3) => files::<3, 2, 1>(args, &recording),
        (3, _) => files::<3, 2, 2>(args, &recording),
        _ => files::<2, 1, 1>(args, &recording),
    };
    let mut said: Vec<String> = damage.map(|damage| format!("damaged: {damage}")).into_iter().collect();
    for (path, bytes) in files? {
        said.push(written(path, &bytes)?);
    }
    println!("{} ticks, {}\n{}", recording.records.len(), recording.header.mode, said.join("\n"));
    Ok(())
}

/// What was asked for, of a recording in D dimensions with N directions orthogonal to the needle and P paddles.
fn files<'a, const D: usize, const N: usize, const P: usize>(
    args: &'a ExportArgs,
    recording: &Recording,
) -> Result<Vec<(&'a Path, Vec<u8>)>, SimError> {
    let table = decode::<f64, D, N, P>(&recording.header.table)
        .map_err(|source| SimError::Table { path: args.recording.clone(), source })?;
    let series = csv::Series { orthogonal: &table.orthogonal, paddles: P, length: table.units.length.as_str() };
    let mut files = Vec::new();
    if let Some(path) = &args.mcap {
        if D > 2 && args.scene.is_some() {
            return Err(UsageError::NotInSpace { option: "--scene".to_owned() }.into());
        }
        let stage = args.scene.as_deref().map(|scene| stage(scene, recording, table.paddles[0].index)).transpose()?;
        let known = mcap::Known { stage: stage.as_ref(), ..mcap::Known::default() };
        files.push((path.as_path(), mcap::encode(recording, &series, known)?));
    }
    if let Some(path) = &args.csv {
        files.push((path.as_path(), series.recording(recording)));
    }
    Ok(files)
}

/// The scene of a recording, with or without its inclusions.
fn stage(path: &Path, recording: &Recording, paddle: u32) -> Result<Stage, SimError> {
    let scene = Scene::read(path)?;
    let is_its = |scene: &Scene| scene.hash() == recording.header.scene_hash;
    let simulated = TissueVariant::ALL.map(|tissue| tissue.of(&scene)).into_iter().find(is_its);
    let simulated = simulated.ok_or_else(|| SimError::NotTheRecordings { scene: path.to_owned() })?;
    Ok(Stage::new(&simulated, paddle))
}

fn written(path: &Path, bytes: &[u8]) -> Result<String, SimError> {
    write_bytes(path, bytes)?;
    Ok(format!("{}: {} bytes", path.display(), bytes.len()))
}
