//! `host-sim plant`: the plant in a terminal of its own; the controller is started in another one.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use host_sim::SimError;
use host_sim::exchange::Space;
use host_sim::record::files::write_json;
use host_sim::runtime::plant::PlantLoop;
use host_sim::runtime::plant::process::{Expected, OnDeath, Visit, serve};
use host_sim::runtime::plant::rehearsal::world_in_time;
use host_sim::runtime::signals;
use host_sim::runtime::time::mode::RunMode;
use host_sim::world::World;
use host_sim::world::tissue::{AttachedPaddle, Reductions};
use model_offline::output::table_text::hex;
use model_offline::placement::model_with_paddle;
use model_offline::scene::TissueVariant;

use super::world_args::{PATIENCE, WorldArgs};
use model_offline::output::check_outputs;

/// Options of the plant process.
#[derive(Args, Clone, Debug)]
pub(crate) struct PlantArgs {
    /// The simulated world.
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    /// Tissue of the simulation [default: the scene as it is]
    #[arg(long, value_enum)]
    pub(crate) tissue: Option<TissueVariant>,
    /// Index of the attached paddle [default: the best dynamic one]
    #[arg(long, value_name = "K")]
    pub(crate) paddle: Option<u32>,
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
    /// Write what happened here, as JSON
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
    let whole = args.world.scene()?;
    let scene = args.tissue.unwrap_or(TissueVariant::Inclusion).of(&whole);
    let simulation = args.world.simulation(&scene)?;
    let inputs: Vec<&Path> = args.world.scene.iter().map(PathBuf::as_path).collect();
    check_outputs(&inputs, &[("--json", args.json.as_deref())])?;
    let (model, paddle) = signals::ends_at_once(|| model_with_paddle(&scene, args.paddle))?;
    let world = signals::ends_at_once(|| match args.mode {
        RunMode::Lockstep => World::new(&model, Some(paddle), &simulation),
        RunMode::FreeRun => world_in_time(&model, AttachedPaddle::Moved(paddle), &simulation, &Reductions::default()),
    })?;
    let mut plant = PlantLoop::new(world, &simulation);
    let visit = Visit {
        mode: args.mode,
        loop_settings: simulation.loop_settings,
        timeout: Duration::from_secs_f64(args.patience),
        on_death: if args.keep { OnDeath::AwaitNext } else { OnDeath::Stop },
        expected: (!args.allow_other_scene).then(|| Expected {
            scene_hashes: [&whole, &whole.without_a_past()]
                .into_iter()
                .flat_map(|scene| TissueVariant::ALL.iter().map(|tissue| hex(&tissue.of(scene).hash())))
                .collect(),
            units: [scene.length_unit.clone(), scene.stress_unit.clone()],
        }),
    };
    let result = serve(&mut plant, &Space::new(&args.link)?, &visit, &scene.needle.orthogonal())?;
    if let Some(path) = &args.json {
        write_json(path, &result)?;
    }
    println!(
        "{} ticks with paddle {paddle}; largest orthogonal target displacement {:.6}",
        result.ticks, result.largest_error
    );
    Ok(())
}
