//! `host-sim export`: a recording in the formats of other tools.

use std::path::{Path, PathBuf};

use clap::Args;
use firmware::contract::{Header, decode};
use host_sim::SimError;
use host_sim::record::export::foxglove::{Scenery, SpaceStage, Stage};
use host_sim::record::export::{csv, mcap};
use host_sim::record::files::write_bytes;
use host_sim::record::recording::{Recording, Salvaged};
use host_sim::world::retrace::solved_bodies;

use model_offline::model::space::SpaceModel;
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::output::{check_outputs, is_stream, together};
use model_offline::placement::space::workflow::coarse;
use model_offline::say;
use model_offline::scene::TissueVariant;
use model_offline::scene::space::{AnyScene, SpaceScene};

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
    /// The recording's scene, a file or the name of a bundled scene: MCAP then has what is to be seen, too (of a body in space
    /// solved again at some ticks)
    #[arg(long, value_name = "FILE", requires = "mcap")]
    pub(crate) scene: Option<PathBuf>,
    /// Write the layout that shows it, to be imported in Foxglove or Lichtblick
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub(crate) layout: Option<PathBuf>,
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
    let outputs = [("--mcap", &args.mcap), ("--csv", &args.csv), ("--layout", &args.layout)];
    check_outputs(&inputs, &outputs.map(|(option, path)| (option, path.as_deref())))?;
    let Salvaged { recording, damage } =
        if args.salvage { Recording::salvage(&args.recording)? } else { Recording::read(&args.recording)?.into() };
    let shape = Header::read(&recording.header.table).map_or((2, 2), |header| (header.dimension, header.paddle_dof));
    let files = match shape {
        (3, 3) => files::<3, 2, 1>(args, &recording),
        (3, _) => files::<3, 2, 2>(args, &recording),
        _ => files::<2, 1, 1>(args, &recording),
    };
    let mut said: Vec<String> = damage.map(|damage| format!("damaged: {damage}")).into_iter().collect();
    let mut files = files?;
    // What flows into a pipe or a device can fail at any time: nothing is left then.
    files.sort_by_key(|(path, _)| !is_stream(path));
    let together = together();
    for (path, bytes) in files {
        said.push(written(path, &bytes)?);
    }
    drop(together);
    say!("{} ticks, {}\n{}", recording.records.len(), recording.header.mode, said.join("\n"));
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
        let paddles: Vec<u32> = table.paddles.iter().map(|paddle| paddle.index).collect();
        let mut seen = |stage: Option<&dyn Scenery>| {
            let bytes = mcap::encode(recording, &series, mcap::Known { stage, ..mcap::Known::default() })?;
            files.push((path.as_path(), bytes));
            files.extend(args.layout.as_deref().zip(stage.map(Scenery::layout_file)));
            Ok::<_, SimError>(())
        };
        match args.scene.as_deref() {
            None => seen(None)?,
            Some(scene) if D == 2 => seen(Some(&stage(scene, recording, paddles[0])?))?,
            Some(scene) => {
                let model = model_in_space(scene, recording)?;
                let solved = solved_bodies(&model, &paddles, &recording.truths())?;
                seen(Some(&SpaceStage::new(SpaceGeometry::new(&model), &paddles, &solved)))?;
            }
        }
    }
    if let Some(path) = &args.csv {
        files.push((path.as_path(), series.recording(recording)));
    }
    Ok(files)
}

/// The planar scene of a recording, with or without its inclusions.
fn stage(path: &Path, recording: &Recording, paddle: u32) -> Result<Stage, SimError> {
    let not_its = || SimError::NotTheRecordings { scene: path.to_owned() };
    let AnyScene::Planar(scene) = AnyScene::read(path)? else { return Err(not_its()) };
    let simulated = TissueVariant::ALL.map(|tissue| tissue.of(&scene)).into_iter();
    let simulated = simulated.into_iter().find(|scene| scene.hash() == recording.header.scene_hash);
    Ok(Stage::new(&simulated.ok_or_else(not_its)?, paddle))
}

/// The model that insertions into a recording's body in space were followed on, with or without its inclusions.
fn model_in_space(path: &Path, recording: &Recording) -> Result<SpaceModel, SimError> {
    let not_its = || SimError::NotTheRecordings { scene: path.to_owned() };
    let AnyScene::Space(scene) = AnyScene::read(path)? else { return Err(not_its()) };
    let is_its = |scene: &SpaceScene| scene.hash() == recording.header.scene_hash;
    if is_its(&scene) {
        Ok(coarse(&scene)?)
    } else if is_its(&scene.without_inclusions()) {
        // On the same mesh as in the run, which is that of the scene with them.
        Ok(coarse(&scene)?.without_inclusions())
    } else {
        Err(not_its())
    }
}

fn written(path: &Path, bytes: &[u8]) -> Result<String, SimError> {
    write_bytes(path, bytes)?;
    Ok(format!("{}: {} bytes", path.display(), bytes.len()))
}
