//! `host-sim run` of a body in space.

use host_sim::SimError;
use host_sim::bench::in_space;
use host_sim::bench::usage::UsageError;
use host_sim::record::files::write_json;
use host_sim::report::directory::{check_directory, write_space_run};
use host_sim::report::terminal::space_summary::summary;
use host_sim::runtime::executor::Hardware;
use host_sim::runtime::signals;
use host_sim::runtime::time::mode::RunMode;
use model_offline::parallel;
use model_offline::scene::TableScalar;
use model_offline::scene::space::SpaceScene;
use std::path::{Path, PathBuf};

use super::outputs::check_json_beside_report;
use super::run::RunArgs;

/// Refuses by name what no run in space has.
fn check(args: &RunArgs) -> Result<(), UsageError> {
    let given = [
        (args.table.is_some(), "--table"),
        (args.mode == Some(RunMode::FreeRun), "--mode free-run"),
        (args.hardware != Hardware::Native, "--controller qemu"),
        (args.scalar != TableScalar::F64, "--scalar f32"),
        (args.view, "--view"),
        (args.mcap, "--mcap"),
        (args.vtu, "--vtu"),
        (args.causes, "--causes"),
    ];
    match given.iter().find(|(given, _)| *given) {
        Some((_, option)) => Err(UsageError::NotInSpace { option: (*option).to_owned() }),
        None => Ok(()),
    }
}

/// Runs everything that was asked for and writes the report.
///
/// # Errors
/// [`SimError`]; nothing is written then.
pub(super) fn run(args: &RunArgs, scene: &SpaceScene) -> Result<(), SimError> {
    check(args)?;
    let simulation = args.world.simulation_in_space(scene)?;
    check_directory(&args.out)?;
    let inputs: Vec<&Path> = args.world.scene.iter().chain(&scene.files).map(PathBuf::as_path).collect();
    check_json_beside_report(&inputs, args.json.as_deref(), &args.out)?;
    let threads = parallel::threads(args.threads);
    let compared =
        signals::ends_at_once(|| in_space::compare(scene, args.tissue, args.table_tissue, &simulation, threads))?;
    write_space_run(&args.out, &compared)?;
    if let Some(path) = &args.json {
        write_json(path, &compared)?;
    }
    if !args.quiet {
        scene.notes.iter().for_each(|note| eprintln!("note: {note}"));
        print!("{}", summary(&compared, &args.out));
    }
    Ok(())
}
