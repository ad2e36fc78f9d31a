//! `host-sim stability`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::SimError;
use host_sim::bench::loop_stability::simulate;
use host_sim::bench::progress::Progress as _;
use host_sim::record::error::FileError;
use host_sim::record::files::write_bytes;
use host_sim::report::studies::loop_stability::{csv, summary};
use host_sim::report::studies::loop_stability_chart::figure;
use host_sim::runtime::signals;
use model_offline::parallel;
use model_offline::scene::Scene;
use model_offline::study::Extent;
use model_offline::tell;

/// Parts of the simulation.
const PARTS: u64 = 3;

/// Options of `stability`.
#[derive(Args, Clone, Debug)]
pub(crate) struct LoopStabilityArgs {
    /// Folder for closed_loop.csv and closed_loop.svg; made when it is not there
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Scene file, or the name of a bundled scene [default: paper]
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// Wider cells
    #[arg(long)]
    pub(crate) quick: bool,
    /// Threads to use [default: all]
    #[arg(long)]
    pub(crate) threads: Option<usize>,
    /// No progress and no summary
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Simulates everything and writes the files.
///
/// # Errors
/// [`SimError`]: a bad scene, tissue that cannot be modelled, files that cannot be written.
pub(crate) fn stability(args: &LoopStabilityArgs) -> Result<(), SimError> {
    signals::install();
    let scene = Scene::read(args.scene.as_deref().unwrap_or(Path::new("paper")))?;
    FileError::make_folder(&args.out)?;
    let bar = super::progress_bar(args.quiet);
    bar.begin(PARTS);
    let threads = parallel::threads(args.threads);
    let extent = Extent::of_flag(args.quick);
    let result = signals::ends_at_once(|| simulate(&scene, extent, threads, &|| bar.step()))?;
    bar.finish_and_clear();
    write_bytes(&args.out.join("closed_loop.csv"), &csv(&result))?;
    write_bytes(&args.out.join("closed_loop.svg"), figure(&result).svg().as_bytes())?;
    if !args.quiet {
        tell!("{}", summary(&result));
    }
    Ok(())
}
