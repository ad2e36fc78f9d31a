//! `host-sim plant`: the plant in a terminal of its own; the controller is started in another one.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use firmware::contract::frames::MAX_PADDLES;
use host_sim::SimError;
use host_sim::exchange::Space;
use host_sim::record::files::write_json;
use host_sim::runtime::error::RuntimeError;
use host_sim::runtime::peer::introduction::Expected;
use host_sim::runtime::plant::PlantLoop;
use host_sim::runtime::plant::process::{OnDeath, PlantResult, Visit, serve_in_plane, serve_in_space};
use host_sim::runtime::plant::rehearsal::{space_in_time, world_in_time};
use host_sim::runtime::signals;
use host_sim::runtime::time::mode::RunMode;
use host_sim::world::World;
use host_sim::world::simulation::Simulation;
use host_sim::world::space::PreparedBody;
use host_sim::world::tissue::{AttachedPaddle, Reductions};
use model_offline::output::table_text::hex;
use model_offline::parallel;
use model_offline::placement::model_with_paddle;
use model_offline::placement::space::workflow::insertion_model;
use model_offline::scene::TissueVariant;
use model_offline::scene::space::SpaceScene;
use model_offline::table::TableBuildError;

use super::world_args::{PATIENCE, WorldArgs};
use model_offline::output::check_outputs;
use model_offline::say;

/// Options of the plant process.
#[derive(Args, Clone, Debug)]
pub(crate) struct PlantArgs {
    /// The simulated world.
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    /// Tissue of the simulation [default: the scene as it is]
    #[arg(long, value_enum)]
    pub(crate) tissue: Option<TissueVariant>,
    /// Index of the attached paddle; of a scene in space one or two, as in `5,6` [default: the best to control with, in space
    /// the best pair]
    #[arg(long, value_name = "K", value_delimiter = ',', num_args = 1)]
    pub(crate) paddle: Vec<u32>,
    /// Name of the link in shared memory; the same on both sides
    #[arg(long, default_value = "by-hand", value_name = "NAME")]
    pub(crate) link: String,
    /// What drives time
    #[arg(long, value_enum, default_value_t = RunMode::Lockstep)]
    pub(crate) mode: RunMode,
    /// Seconds of silence after which the controller is given up
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub(crate) patience: f64,
    /// Take a controller whose table is of another scene all the same
    #[arg(long)]
    pub(crate) allow_other_scene: bool,
    /// Go on when the controller dies, with the paddle where it is, and let the next one in; free-run only
    #[arg(long)]
    pub(crate) keep: bool,
    /// Write what happened here, as JSON; also when no controller comes
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// Runs the plant's side of one insertion.
///
/// # Errors
/// [`SimError`].
pub(crate) fn plant(args: &PlantArgs) -> Result<(), SimError> {
    signals::install();
    super::sweep();
    PATIENCE.check(args.patience)?;
    if let Some(scene) = args.world.scene_in_space()? {
        return in_space(args, &scene);
    }
    let whole = args.world.scene()?;
    let scene = args.tissue.unwrap_or(TissueVariant::Inclusion).of(&whole);
    let simulation = args.world.simulation(&scene)?;
    check_json(args, &[])?;
    let paddle = match args.paddle[..] {
        [] => None,
        [index] => Some(index),
        _ => return Err(TableBuildError::Paddles(args.paddle.len()).into()),
    };
    let (model, paddle) = signals::ends_at_once(|| model_with_paddle(&scene, paddle))?;
    let world = signals::ends_at_once(|| match args.mode {
        RunMode::Lockstep => World::new(&model, Some(paddle), &simulation),
        RunMode::FreeRun => world_in_time(&model, AttachedPaddle::Moved(paddle), &simulation, &Reductions::default()),
    })?;
    let mut plant = PlantLoop::new(world, &simulation);
    let expected = Expected {
        dimension: 2,
        any_scene: args.allow_other_scene,
        scene_hashes: [&whole, &whole.without_a_past()]
            .into_iter()
            .flat_map(|scene| TissueVariant::ALL.iter().map(|tissue| hex(&tissue.of(scene).hash())))
            .collect(),
        units: [scene.length_unit.clone(), scene.stress_unit.clone()],
        paddles: None,
    };
    let visit = visit(args, &simulation, expected);
    let result = serve_in_plane(&mut plant, &Space::new(&args.link)?, &visit, &scene.needle.orthogonal());
    end(args, result, plant.truths().len(), &format!("paddle {paddle}"))
}

/// The same of a body in space.
fn in_space(args: &PlantArgs, scene: &SpaceScene) -> Result<(), SimError> {
    let simulation = args.world.simulation_in_space(scene)?;
    let files: Vec<&Path> = scene.files.iter().map(PathBuf::as_path).collect();
    check_json(args, &files)?;
    if scene.inclusions.is_empty() && args.tissue == Some(TissueVariant::Inclusion) {
        return Err(SimError::NoInclusion { scene: scene.name.clone() });
    }
    let threads = parallel::threads(None);
    let (model, paddles) = signals::ends_at_once(|| -> Result<_, SimError> {
        let whole = parallel::within(threads, || insertion_model(scene))?;
        let paddles = match args.paddle.is_empty() {
            true => whole.best_to_control()?,
            false => args.paddle.clone(),
        };
        let homogeneous = args.tissue == Some(TissueVariant::Homogeneous);
        Ok((if homogeneous { whole.without_inclusions()? } else { whole }, paddles))
    })?;
    if !(1..=MAX_PADDLES).contains(&paddles.len()) {
        return Err(TableBuildError::Paddles(paddles.len()).into());
    }
    let world = signals::ends_at_once(|| -> Result<_, SimError> {
        let body = PreparedBody::new(&model, &paddles, true, threads)?;
        Ok(match args.mode {
            RunMode::Lockstep => body.world(&simulation),
            RunMode::FreeRun => space_in_time(&body, &simulation)?,
        })
    })?;
    let mut plant = PlantLoop::new(world, &simulation);
    let expected = Expected {
        dimension: 3,
        any_scene: args.allow_other_scene,
        scene_hashes: [scene, &scene.without_inclusions()].map(|scene| hex(&scene.hash())).into(),
        units: [scene.length_unit.clone(), scene.stress_unit.clone()],
        paddles: Some(paddles.clone()),
    };
    let visit = visit(args, &simulation, expected);
    let result = serve_in_space(&mut plant, &Space::new(&args.link)?, &visit, &scene.needle.orthogonal());
    let names: Vec<String> = paddles.iter().map(u32::to_string).collect();
    end(args, result, plant.truths().len(), &format!("paddle {}", names.join(" + ")))
}

/// Refuses a result that would replace what is read.
fn check_json(args: &PlantArgs, files: &[&Path]) -> Result<(), SimError> {
    let inputs: Vec<&Path> = args.world.files().map(PathBuf::as_path).chain(files.iter().copied()).collect();
    Ok(check_outputs(&inputs, &[("--json", args.json.as_deref())])?)
}

/// How the plant is served; its controller's table is to be as `expected`.
fn visit(args: &PlantArgs, simulation: &Simulation, expected: Expected) -> Visit {
    Visit {
        mode: args.mode,
        loop_settings: simulation.loop_settings,
        timeout: Duration::from_secs_f64(args.patience),
        on_death: if args.keep { OnDeath::AwaitNext } else { OnDeath::Stop },
        expected: Some(expected),
    }
}

/// What `--json` holds of an insertion that came to no result: no controller, or one that was lost.
#[derive(serde::Serialize)]
struct Unserved {
    /// Ticks simulated until then.
    ticks: usize,
    /// Why it ended.
    ended: String,
}

/// Writes and says what happened in so many ticks.
fn end(args: &PlantArgs, result: Result<PlantResult, RuntimeError>, ticks: usize, with: &str) -> Result<(), SimError> {
    let result = result.map_err(|error| match error {
        // It is told.
        RuntimeError::Interrupted { signal } => RuntimeError::PlantStopped { signal },
        other => other,
    });
    let written = args.json.as_ref().map_or(Ok(()), |path| match &result {
        Ok(result) => write_json(path, result),
        Err(error) => write_json(path, &Unserved { ticks, ended: error.to_string() }),
    });
    // Why it ended is more than that it could not be written.
    let result = result?;
    written?;
    say!("{} ticks with {with}; largest orthogonal target displacement {:.6}", result.ticks, result.largest_error);
    Ok(())
}
