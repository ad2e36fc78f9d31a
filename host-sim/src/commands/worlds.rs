//! `host-sim worlds`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::SimError;
use host_sim::bench::progress::Progress as _;
use host_sim::bench::worlds::{compare, count};
use host_sim::record::files::{write_bytes, write_json};
use host_sim::report::studies::worlds::summary;
use host_sim::report::studies::worlds_chart::figure;
use host_sim::runtime::signals;
use model_offline::output::check_outputs;
use model_offline::parallel;
use model_offline::scene::Scene;
use model_offline::tell;

/// Options of `worlds`.
#[derive(Args, Clone, Debug)]
pub(crate) struct WorldsArgs {
    /// Scene file, or the name of a bundled scene [default: breast]
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// Insertions with every controller, each with sensor noise of its own
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// Threads to use [default: all]
    #[arg(long)]
    pub(crate) threads: Option<usize>,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Draw peaks over all worlds
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// No progress and no summary
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Tries every world and prints the table.
///
/// # Errors
/// [`SimError`]: a bad scene, tissue that fails in one of the worlds, files that cannot be written.
pub(crate) fn worlds(args: &WorldsArgs) -> Result<(), SimError> {
    signals::install();
    let scene = Scene::read(args.scene.as_deref().unwrap_or(Path::new("breast")))?;
    let inputs: Vec<&Path> = args.scene.iter().map(PathBuf::as_path).collect();
    check_outputs(&inputs, &[("--json", args.json.as_deref()), ("--svg", args.svg.as_deref())])?;
    let bar = super::progress_bar(args.quiet);
    bar.begin(count());
    bar.say("insertions into worlds");
    let threads = parallel::threads(args.threads);
    let result = signals::ends_at_once(|| compare(&scene, args.seeds, threads, &|| bar.step()))?;
    bar.finish_and_clear();
    if let Some(path) = &args.json {
        write_json(path, &result)?;
    }
    if let Some(path) = &args.svg {
        write_bytes(path, figure(&result).svg().as_bytes())?;
    }
    if !args.quiet {
        tell!("{}", summary(&result));
    }
    Ok(())
}
