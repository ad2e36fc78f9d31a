//! The plant in a terminal of its own; the controller is started in another one.

use std::time::Duration;

use clap::Args;
use iceoryx2::service::ipc;
use model_offline::placement::{TissueModel, place};
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector2;

use crate::error::SimError;
use crate::link::{Departure, PlantPorts, Space};
use crate::peer::{Patience, Peer};
use crate::recorder::RunMode;
use crate::run::{Tissue, WorldArgs};
use crate::world::World;
use crate::{free_run, interrupt, lockstep};

/// Options of the plant process.
#[derive(Args, Clone, Debug)]
pub struct PlantArgs {
    /// The simulated world.
    #[command(flatten)]
    pub world: WorldArgs,
    /// Tissue of the simulation [default: the scene as it is]
    #[arg(long, value_enum)]
    pub tissue: Option<Tissue>,
    /// Index of the attached paddle [default: the best dynamic one]
    #[arg(long, value_name = "K")]
    pub paddle: Option<u32>,
    /// Name of the link in shared memory; the same on both sides
    #[arg(long, default_value = "by-hand", value_name = "NAME")]
    pub link: String,
    /// What drives time
    #[arg(long, value_enum, default_value_t = RunMode::Lockstep)]
    pub mode: RunMode,
    /// Seconds of silence after which the controller is given up
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub patience: f64,
}

/// Runs the plant's side of one insertion.
///
/// # Errors
/// [`SimError`].
pub fn plant(args: &PlantArgs) -> Result<(), SimError> {
    interrupt::install();
    crate::control::positive("--patience", args.patience)?;
    let mut scene = args.world.scene()?;
    if args.tissue == Some(Tissue::Homogeneous) {
        scene = scene.without_inclusions();
    }
    let simulation = args.world.simulation(&scene)?;
    let model = TissueModel::new(&scene)?;
    let paddle = match args.paddle {
        Some(index) => index,
        None => place(&model, NewtonSettings::default(), 1, &|| {})?.optimum.dynamic,
    };
    let mut world = World::new(&model, Some(paddle), &simulation)?;
    let space = Space::new(&args.link)?;
    let outcome = insertion(args, &mut world, &space);
    space.leave::<ipc::Service>(Departure::Last);
    outcome?;
    let normal = scene.needle.orthogonal();
    let error = |target: [f64; 2]| Vector2::from(target).dot(&normal).abs();
    let largest = world.truths().iter().map(|truth| error(truth.target)).fold(0.0, f64::max);
    println!(
        "{} ticks with paddle {paddle}; largest orthogonal target displacement {largest:.6}",
        world.truths().len()
    );
    Ok(())
}

fn insertion(args: &PlantArgs, world: &mut World<'_>, space: &Space) -> Result<(), SimError> {
    let timeout = Duration::from_secs_f64(args.patience);
    let mut ports = PlantPorts::<ipc::Service>::open(space)?;
    let mut peer = Peer::Elsewhere(Box::new(space.clone()), "controller");
    let mut patience = Patience::new(timeout);
    while !ports.has_peer() {
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let loop_args = args.world.loop_args;
    let period_ns = loop_args.period_ns();
    match args.mode {
        RunMode::Lockstep => {
            lockstep::run(world, &mut ports, &mut peer, period_ns, timeout, &|| {})?;
        }
        RunMode::FreeRun => {
            let rate_hz = loop_args.rate;
            free_run::run(world, &mut ports, &mut peer, rate_hz, period_ns, &|| {})?;
        }
    }
    // The controller closes its accounts with what still waits: it leaves first.
    let mut patience = Patience::new(timeout);
    while ports.command.has_writer() {
        if patience.wait::<ipc::Service>(&mut peer).is_err() {
            break;
        }
    }
    Ok(())
}
