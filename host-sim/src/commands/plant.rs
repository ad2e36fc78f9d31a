//! The plant in a terminal of its own; the controller is started in another one.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use iceoryx2::service::ipc;
use model_offline::placement::best_dynamic;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::bench::comparison::{Tissue, WorldArgs};
use crate::bench::result::LoopTiming;
use crate::error::SimError;
use crate::exchange::{ClockFrame, ClockKind, Departure, PlantPorts, Space};
use crate::record::recording::RunMode;
use crate::runtime::accounts::CommandAccount;
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::plant::free_run::Succession;
use crate::runtime::plant::{free_run, lockstep};
use crate::runtime::signals;
use crate::world::{World, published};

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
    /// Go on when the controller dies, with the paddle where it is, and let the next one in; free-run only
    #[arg(long)]
    pub keep: bool,
    /// Write what happened here, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Runs the plant's side of one insertion.
///
/// # Errors
/// [`SimError`].
pub fn plant(args: &PlantArgs) -> Result<(), SimError> {
    signals::install();
    crate::world::loop_settings::positive("--patience", args.patience)?;
    let mut scene = args.world.scene()?;
    if args.tissue == Some(Tissue::Homogeneous) {
        scene = scene.without_inclusions();
    }
    let simulation = args.world.simulation(&scene)?;
    let (model, _) = model_offline::placement::discretise(&scene)?;
    let paddle = match args.paddle {
        Some(index) => index,
        None => best_dynamic(&model)?,
    };
    let mut world = World::new(&model, Some(paddle), &simulation)?;
    let space = Space::new(&args.link)?;
    let outcome = insertion(args, &mut world, &space);
    space.leave::<ipc::Service>(Departure::Last);
    let (account, controllers, timing, published) = outcome?;
    let normal = scene.needle.orthogonal();
    let error = |target: [f64; 2]| Vector2::from(target).dot(&normal).abs();
    let largest = world.truths().iter().map(|truth| error(truth.target)).fold(0.0, f64::max);
    if let Some(path) = &args.json {
        let pairs = world.truths().windows(2);
        let [commands, overwritten] = account.counts();
        let result = PlantResult {
            ticks: world.truths().len() as u64,
            controllers,
            published,
            commands,
            overwritten,
            largest_error: largest,
            largest_step: pairs
                .map(|pair| {
                    let step = (Vector2::from(pair[1].paddle) - Vector2::from(pair[0].paddle)).norm();
                    step / (pair[1].tick - pair[0].tick) as f64
                })
                .fold(0.0, f64::max),
            timing,
        };
        crate::report::directory::write_json(path, &result)?;
    }
    println!(
        "{} ticks with paddle {paddle}; largest orthogonal target displacement {largest:.6}",
        world.truths().len()
    );
    Ok(())
}

/// What `plant --json` writes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlantResult {
    /// Ticks simulated.
    pub ticks: u64,
    /// Controllers that have come.
    pub controllers: u64,
    /// Needle, target and paddle samples published.
    pub published: [u64; 3],
    /// Commands executed.
    pub commands: u64,
    /// Commands replaced by newer ones before the plant looked.
    pub overwritten: u64,
    /// Largest orthogonal target displacement, length.
    pub largest_error: f64,
    /// Largest motion of the paddle per tick, length.
    pub largest_step: f64,
    /// Timing of the loop; free-run only.
    pub timing: Option<LoopTiming>,
}

/// Commands, controllers, timing, samples published.
type Inserted = (CommandAccount, u64, Option<LoopTiming>, [u64; 3]);

fn insertion(args: &PlantArgs, world: &mut World<'_>, space: &Space) -> Result<Inserted, SimError> {
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
    let mut drive = || match args.mode {
        RunMode::Lockstep => {
            let account = lockstep::run(world, &mut ports, &mut peer, period_ns, timeout, &|| {})?;
            Ok((account, 1, None))
        }
        RunMode::FreeRun => {
            let rate_hz = loop_args.rate;
            let mut succession = Succession::new(space);
            let keep = args.keep.then_some(&mut succession);
            let (account, timing) = free_run::run(world, &mut ports, &mut peer, rate_hz, period_ns, keep, &|| {})?;
            Ok((account, succession.controllers, Some(timing)))
        }
    };
    let outcome: Result<_, SimError> = drive();
    if outcome.is_err() {
        // Whatever has happened, the controller need not wait for its end.
        let _ = ports.clock.send(ClockFrame::new(ClockKind::Stop, 0, 0));
    }
    let (account, controllers, timing) = outcome?;
    // The controller closes its accounts with what still waits: it leaves first.
    let mut patience = Patience::new(timeout);
    while ports.command.has_writer() {
        if patience.wait::<ipc::Service>(&mut peer).is_err() {
            break;
        }
    }
    Ok((account, controllers, timing, published(&ports)))
}
