//! `host-sim tables`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::SimError;
use host_sim::bench::progress::Progress as _;
use host_sim::bench::tables::{KNOTS, compare};
use host_sim::record::error::FileError;
use host_sim::record::files::write_bytes;
use host_sim::report::studies::tables::{csv, figure, summary};
use host_sim::runtime::signals;
use model_offline::parallel;
use model_offline::placement::model_with_paddle;
use model_offline::scene::Scene;
use model_offline::scene::TissueVariant;
use model_offline::tell;

/// Options of `tables`.
#[derive(Args, Clone, Debug)]
pub(crate) struct TablesArgs {
    /// Folder for tables.csv and tables.svg; made when it is not there
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Scene file, or the name of a bundled scene [default: paper]
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// Tissue of table and simulation
    #[arg(long, value_enum, default_value = "inclusion")]
    pub(crate) tissue: TissueVariant,
    /// Threads to use [default: all]
    #[arg(long)]
    pub(crate) threads: Option<usize>,
    /// No progress and no summary
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Tries every table and writes the files.
///
/// # Errors
/// [`SimError`]: a bad scene, tissue that cannot be modelled or reduced, files that cannot be written.
pub(crate) fn tables(args: &TablesArgs) -> Result<(), SimError> {
    signals::install();
    let scene = args.tissue.of(&Scene::read(args.scene.as_deref().unwrap_or(Path::new("paper")))?);
    FileError::make_folder(&args.out)?;
    let threads = parallel::threads(args.threads);
    let bar = super::progress_bar(args.quiet);
    bar.begin(KNOTS.len() as u64);
    let trials = signals::ends_at_once(|| {
        let (model, paddle) = model_with_paddle(&scene, None)?;
        compare(&model, paddle, threads, &|| bar.step())
    })?;
    bar.finish_and_clear();
    write_bytes(&args.out.join("tables.csv"), &csv(&trials))?;
    let svg = figure(&trials, &scene.name, &scene.length_unit).svg();
    write_bytes(&args.out.join("tables.svg"), svg.as_bytes())?;
    if !args.quiet {
        tell!("{}", summary(&trials));
    }
    Ok(())
}
