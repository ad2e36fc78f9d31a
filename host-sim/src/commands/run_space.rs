//! `host-sim run` of a body in space.

use host_sim::SimError;
use host_sim::bench::in_space::{SpaceComparison, SpaceOptions};
use host_sim::bench::insertion::Extras;
use host_sim::bench::usage::UsageError;
use host_sim::record::files::write_json;
use host_sim::report::directory::{check_directory, write_space_run};
use host_sim::report::terminal::space_summary::summary;
use host_sim::runtime::error::RuntimeError;
use host_sim::runtime::executor::Hardware;
use host_sim::runtime::plant::observer::Spectator;
use host_sim::runtime::time::mode::RunMode;
use host_sim::view::{View, insertions_in_space};
use model_offline::output::terminal::{LongRun, complain};
use model_offline::parallel;
use model_offline::scene::TissueVariant;
use model_offline::scene::space::SpaceScene;
use model_offline::tell;
use std::path::{Path, PathBuf};

use super::live::{first_knobs, going_on, said, say};
use super::outputs::check_json_beside_report;
use super::world_args::WorldArgs;

/// What is asked for.
#[derive(Debug)]
pub(super) struct SpaceJob<'a> {
    /// The simulated world.
    pub(super) world: &'a WorldArgs,
    /// Tissue of the simulation.
    pub(super) tissue: Option<TissueVariant>,
    /// Tissue that the table believes in.
    pub(super) table_tissue: Option<TissueVariant>,
    /// What drives time.
    pub(super) mode: Option<RunMode>,
    /// What computes the controller's steps.
    pub(super) hardware: Hardware,
    /// Files for other tools that are not always written.
    pub(super) extras: Extras,
    /// Directory for the report.
    pub(super) out: &'a Path,
    /// File for the result.
    pub(super) json: Option<&'a Path>,
    /// Neither progress nor summary.
    pub(super) quiet: bool,
    /// Threads.
    pub(super) threads: Option<usize>,
    /// Port of the page that shows what is controlled, if one is wanted.
    pub(super) view_port: Option<u16>,
    /// An option that no run in space has.
    pub(super) refused: Option<&'static str>,
}

/// Runs everything that was asked for and writes the report.
///
/// # Errors
/// [`SimError`]; nothing is written then.
pub(super) fn run(args: &SpaceJob<'_>, scene: &SpaceScene) -> Result<(), SimError> {
    if let Some(option) = args.refused {
        return Err(UsageError::NotInSpace { option: option.to_owned() }.into());
    }
    let simulation = args.world.simulation_in_space(scene)?;
    check_directory(args.out)?;
    let inputs: Vec<&Path> = args.world.files().chain(&scene.files).map(PathBuf::as_path).collect();
    check_json_beside_report(&inputs, args.json, args.out)?;
    let threads = parallel::threads(args.threads);
    let program = std::env::current_exe().map_err(RuntimeError::Spawn)?;
    let SpaceJob { tissue, table_tissue, mode, hardware, extras, .. } = *args;
    let options = SpaceOptions { program: &program, tissue, table_tissue, mode, hardware, extras, threads };
    let progress = if args.quiet { LongRun::hidden() } else { LongRun::new() };
    let comparison = SpaceComparison::prepare(scene, &options, &simulation, &progress)?;
    let units = [scene.length_unit.clone(), scene.stress_unit.clone()];
    let start = |port| {
        let knobs = first_knobs(&simulation.loop_settings);
        View::start_in_space(port, knobs, &comparison.geometry(), &units, comparison.paddles()).map(said)
    };
    let view = args.view_port.map(start).transpose()?;
    let (compared, artifacts) = comparison.run(view.as_ref().map(|view| view as &dyn Spectator))?;
    progress.bar.finish_and_clear();
    write_space_run(args.out, &compared, artifacts)?;
    if let Some(path) = args.json {
        write_json(path, &compared)?;
    }
    if !args.quiet {
        scene.notes.iter().for_each(|note| complain(&format!("note: {note}")));
        tell!("{}", summary(&compared, args.out));
    }
    let Some(view) = view else { return Ok(()) };
    let say = say(args.quiet);
    say(&going_on(&view));
    let mode = mode.unwrap_or(RunMode::Lockstep);
    comparison.last_case()?.map_or(Ok(()), |case| insertions_in_space(&view, &case, &simulation, mode, &say))
}
