//! One strategy on one tissue: simulated, measured, recorded.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use firmware::contract::Table;
use iceoryx2::service::ipc;
use model_offline::placement::TissueModel;
use nalgebra::Vector2;
use sha2::{Digest, Sha256};

use crate::bench::result::{Frame, LedgerResult, LoopTiming, RecordingResult, SeriesPoint, StrategyResult};
use crate::error::SimError;
use crate::exchange::{Departure, PlantPorts, Space};
use crate::record::export::{mcap, paraview};
use crate::record::recording::{Exchange, Header, Record, Recording, RunMode, Truth};
use crate::runtime::accounts::Handover;
use crate::runtime::controller::child::{ControllerCall, ControllerProcess};
use crate::runtime::executor::Hardware;
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::plant::{free_run, lockstep};
use crate::runtime::signals;
use crate::view;
use crate::world::tissue::{PlantChoice, TissueSolver};
use crate::world::{Simulation, World, published, waiting_command};

/// How long the other process may be silent before a run is given up.
pub const PEER_TIMEOUT: Duration = Duration::from_secs(30);

/// The same for a controller whose plant a page may pause.
const WATCHED_PATIENCE_S: f64 = 24.0 * 3600.0;

/// Points of a time series in the result.
const SERIES_POINTS: usize = 500;

/// Pictures of the body along an insertion, and how many node positions all of them may have together.
const FRAMES: usize = 10;
const FRAME_NUMBERS: usize = 20_000;

/// A file of the report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Artifact {
    /// File name.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// A result and the files that belong to it.
pub type Measured = (StrategyResult, Vec<Artifact>);

/// Name of files of a strategy, unique in a run.
#[derive(Clone, Debug)]
pub struct Label<'a> {
    /// Tissue of the simulation.
    pub tissue: &'a str,
    /// Tissue of the table.
    pub table_tissue: &'a str,
    /// Strategy.
    pub strategy: &'a str,
}

impl Label<'_> {
    fn file(&self, extension: &str) -> String {
        format!("{}.{extension}", self.stem())
    }

    fn stem(&self) -> String {
        let Self { tissue, table_tissue, strategy } = self;
        if tissue == table_tissue {
            format!("{tissue}-{strategy}")
        } else {
            format!("{tissue}-with-{table_tissue}-table-{strategy}")
        }
    }
}

/// The insertion without a paddle, or with one held at zero: nothing to control, time in ticks all the same.
///
/// # Errors
/// [`SimError`].
pub fn passive(
    model: &TissueModel,
    paddle: Option<u32>,
    simulation: &Simulation,
    label: &Label<'_>,
    extras: Extras,
    progress: &dyn Fn(),
) -> Result<Measured, SimError> {
    let mut world = World::new(model, paddle, simulation)?;
    world.start_needle(0);
    let period_ns = simulation.loop_args.period_ns();
    for tick in 0.. {
        let time_ns = tick * period_ns;
        if world.is_over(time_ns) {
            break;
        }
        signals::check()?;
        world.solve(tick, time_ns)?;
        progress();
    }
    let mut result = measure(model, &mut world, RunMode::Lockstep, paddle, simulation.seed);
    let csv = Artifact { name: label.file("csv"), bytes: csv(model, &world, &[]) };
    result.csv = Some(csv.name.clone());
    let mut artifacts = vec![csv];
    if extras.vtu {
        artifacts.extend(paraview::series(model, paddle, world.truths(), 0, &label.stem()));
    }
    Ok((result, artifacts))
}

/// Files for other tools that are not always written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extras {
    /// Controlled insertions as MCAP.
    pub mcap: bool,
    /// The body along insertions as VTU series.
    pub vtu: bool,
}

/// The controller of an active strategy.
#[derive(Clone, Copy, Debug)]
pub struct Active<'a> {
    /// This program, which is also the controller.
    pub program: &'a Path,
    /// Its table.
    pub table: &'a Table<f64, 2>,
    /// The table as encoded.
    pub table_bytes: &'a [u8],
    /// What drives time.
    pub mode: RunMode,
    /// What computes the controller's steps.
    pub hardware: Hardware,
    /// A live view that looks on.
    pub view: Option<&'a Arc<view::Shared>>,
    /// Files besides recording and table.
    pub extras: Extras,
}

/// The insertion with the controller as a process of its own.
///
/// # Errors
/// [`SimError`].
pub fn active(
    model: &TissueModel,
    controller: &Active<'_>,
    simulation: &Simulation,
    label: &Label<'_>,
    progress: &dyn Fn(),
) -> Result<Measured, SimError> {
    let space = Space::unique()?;
    let title = format!("{}, table of {}: {}", label.tissue, label.table_tissue, label.strategy);
    let outcome = in_space(model, controller, simulation, &space, title, progress);
    space.leave::<ipc::Service>(Departure::Last);
    let mut run = outcome?;

    let paddle = controller.table.paddle.index;
    let mut result = measure(model, &mut run.world, controller.mode, Some(paddle), simulation.seed);
    let records = merge(&run.exchanges, run.world.truths());
    let csv = Artifact { name: label.file("csv"), bytes: csv(model, &run.world, &records) };
    let recording = Recording {
        header: Header {
            mode: controller.mode,
            seed: simulation.seed,
            scene_hash: model.scene().hash(),
            settings: simulation.loop_args.settings(controller.table.validity.depth_end),
            table: controller.table_bytes.to_vec(),
        },
        records,
    };
    let bytes = recording.encode();
    result.recording = Some(RecordingResult {
        file: label.file("rec"),
        sha256: hex(&Sha256::digest(&bytes)),
        ticks: recording.records.len() as u64,
    });
    result.csv = Some(csv.name.clone());
    result.table_hash = Some(hex(&Sha256::digest(controller.table_bytes)));
    result.final_state = run.handover.final_state;
    result.faults = run.handover.faults;
    result.ledger = Some(run.ledger);
    result.timing = run.handover.timing;
    result.plant_timing = run.plant_timing;
    let mut artifacts = vec![csv, Artifact { name: label.file("rec"), bytes }];
    if controller.extras.mcap {
        let name = label.file("mcap");
        let bytes = mcap::encode(&recording, controller.table.orthogonal.into())
            .map_err(|error| SimError::Write { path: name.clone().into(), source: std::io::Error::other(error) })?;
        artifacts.push(Artifact { name, bytes });
    }
    if controller.extras.vtu {
        let started_ns = run.world.needle_started_ns().unwrap_or(0);
        artifacts.extend(paraview::series(model, Some(paddle), run.world.truths(), started_ns, &label.stem()));
    }
    Ok((result, artifacts))
}

struct Run<'m> {
    world: World<'m>,
    handover: Handover,
    exchanges: Vec<Exchange>,
    ledger: LedgerResult,
    plant_timing: Option<LoopTiming>,
}

fn in_space<'m>(
    model: &'m TissueModel,
    controller: &Active<'_>,
    simulation: &Simulation,
    space: &Space,
    title: String,
    progress: &dyn Fn(),
) -> Result<Run<'m>, SimError> {
    let table = space.root().join("controller.table");
    std::fs::write(&table, controller.table_bytes).map_err(|source| SimError::Write { path: table.clone(), source })?;
    let mut world = World::new(model, Some(controller.table.paddle.index), simulation)?;
    let mut ports = PlantPorts::<ipc::Service>::open(space)?;
    let mut peer = Peer::Child(ControllerProcess::start(&ControllerCall {
        program: controller.program,
        table: &table,
        space,
        mode: controller.mode,
        hardware: controller.hardware,
        loop_args: simulation.loop_args,
        depth: simulation.depth,
        capacity: simulation.ticks(),
        // A page may hold time as long as it likes.
        patience_s: if controller.view.is_some() { WATCHED_PATIENCE_S } else { PEER_TIMEOUT.as_secs_f64() },
    })?);
    let mut patience = Patience::new(PEER_TIMEOUT);
    while !ports.has_peer() {
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let period_ns = simulation.loop_args.period_ns();
    if let Some(shared) = controller.view {
        world.watch(view::Watch::new(shared, model, controller.table.paddle.index, controller.mode, title));
    }
    let pacing = RefCell::new(view::Pacing::new(period_ns));
    let held = || {
        progress();
        if let Some(shared) = controller.view {
            shared.hold(&mut pacing.borrow_mut());
        }
    };
    let (mut commands, plant_timing) = match controller.mode {
        RunMode::Lockstep => {
            let account = lockstep::run(&mut world, &mut ports, &mut peer, period_ns, PEER_TIMEOUT, &held)?;
            (account, None)
        }
        RunMode::FreeRun => {
            let rate_hz = simulation.loop_args.rate;
            let (account, timing) =
                free_run::run(&mut world, &mut ports, &mut peer, rate_hz, period_ns, None, progress)?;
            (account, Some(timing))
        }
    };
    let Peer::Child(child) = peer else {
        unreachable!("the peer of a run is its child");
    };
    let (handover, exchanges) = child.finish()?;
    commands.end(waiting_command(&mut ports)?);
    let ledger = handover.ledger(published(&ports), &commands);
    Ok(Run { world, handover, exchanges, ledger, plant_timing })
}

/// Both sides of every tick; the truth is that of the plant's tick of the same number.
fn merge(exchanges: &[Exchange], truths: &[Truth]) -> Vec<Record> {
    exchanges
        .iter()
        .map(|exchange| Record {
            exchange: *exchange,
            truth: truths
                .binary_search_by_key(&exchange.inputs.tick, |truth| truth.tick)
                .ok()
                .map(|found| truths[found]),
        })
        .collect()
}

/// What the true motion of the target amounts to.
fn measure(
    model: &TissueModel,
    world: &mut World<'_>,
    mode: RunMode,
    paddle: Option<u32>,
    seed: u64,
) -> StrategyResult {
    let plant = world.plant_account();
    let needle = &model.scene().needle;
    let (normal, axis) = (needle.orthogonal(), needle.axis);
    let truths = world.truths();
    let started_ns = world.needle_started_ns().unwrap_or(0);
    let error = |truth: &Truth| Vector2::from(truth.target).dot(&normal);
    let worst = truths.iter().max_by(|a, b| error(a).abs().total_cmp(&error(b).abs()));
    let squares: f64 = truths.iter().map(|truth| error(truth).powi(2)).sum();
    let travel =
        truths.windows(2).map(|pair| (Vector2::from(pair[1].paddle) - Vector2::from(pair[0].paddle)).norm()).sum();
    let stride = truths.len().div_ceil(SERIES_POINTS - 1).max(1);
    let last = truths.len().saturating_sub(1);
    let series = truths
        .iter()
        .enumerate()
        .filter(|(i, _)| i % stride == 0 || *i == last)
        .map(|(_, truth)| SeriesPoint {
            time_s: seconds_since(truth.time_ns, started_ns),
            depth: truth.depth,
            orthogonal_error: error(truth),
            axial: Vector2::from(truth.target).dot(&axis),
            paddle: truth.paddle,
        })
        .collect();
    StrategyResult {
        mode,
        paddle,
        max_orthogonal_error: worst.map_or(0.0, |truth| error(truth).abs()),
        max_error_depth: worst.map_or(0.0, |truth| truth.depth),
        rms_orthogonal_error: (squares / truths.len().max(1) as f64).sqrt(),
        paddle_travel: travel,
        final_state: "none".to_owned(),
        faults: "NONE".to_owned(),
        ledger: None,
        timing: None,
        plant_timing: None,
        seed,
        table_hash: None,
        scene_hash: hex(&model.scene().hash()),
        recording: None,
        csv: None,
        series,
        deformed_nodes: world.deformed_nodes(),
        frames: frames(model, paddle, truths),
        plant_step_us: world.mean_step_us(),
        plant,
    }
}

/// The body along the insertion, solved once more after the run at some of its ticks: nothing is added to a loop on
/// the machine's clock. Ends early where the tissue has no equilibrium with such large steps.
fn frames(model: &TissueModel, paddle: Option<u32>, truths: &[Truth]) -> Vec<Frame> {
    let position = paddle.and_then(|index| model.paddle_position(index));
    let (Ok(mut plant), Some(last)) = (TissueSolver::new(model, position, PlantChoice::Full), truths.last()) else {
        return Vec::new();
    };
    let count = (FRAME_NUMBERS / model.nodes().max(1)).clamp(2, FRAMES);
    // A millionth of the depth is beyond any drawing.
    let places = 10f64.powi(6 - last.depth.abs().max(1e-9).log10().floor() as i32);
    let rounded = |coordinate: f64| (coordinate * places).round() / places;
    let mut frames = Vec::new();
    for i in 0..=count {
        let depth = last.depth * i as f64 / count as f64;
        // The last one is the end, with what the controller removed after the needle had arrived.
        let truth = if i == count { last } else { &truths[truths.partition_point(|truth| truth.depth < depth)] };
        if plant.step(truth.depth, Vector2::from(truth.paddle)).is_err() {
            break;
        }
        frames.push(Frame {
            depth: truth.depth,
            nodes: plant.deformed_nodes().into_iter().map(|node| node.map(rounded)).collect(),
        });
    }
    frames
}

/// Time since the start of the needle, s; negative before.
fn seconds_since(time_ns: u64, started_ns: u64) -> f64 {
    (time_ns as i64 - started_ns as i64) as f64 * 1e-9
}

/// The time series with a time column, for PlotJuggler and spreadsheets.
fn csv(model: &TissueModel, world: &World<'_>, records: &[Record]) -> Vec<u8> {
    use std::fmt::Write as _;
    let normal = model.scene().needle.orthogonal();
    let started_ns = world.needle_started_ns().unwrap_or(0);
    let mut text = String::from(
        "time_s,tick,depth,target_x,target_y,orthogonal_error,paddle_x,paddle_y,\
         command_x,command_y,measured_target_x,measured_target_y,state,faults\n",
    );
    for truth in world.truths() {
        let [x, y] = truth.target;
        let _ = write!(
            text,
            "{:.6},{},{},{x},{y},{},{},{}",
            seconds_since(truth.time_ns, started_ns),
            truth.tick,
            truth.depth,
            Vector2::from(truth.target).dot(&normal),
            truth.paddle[0],
            truth.paddle[1],
        );
        let record = records
            .binary_search_by_key(&truth.tick, |record| record.exchange.inputs.tick)
            .ok()
            .map(|found| &records[found].exchange);
        match record {
            None => text.push_str(",,,,,,\n"),
            Some(Exchange { inputs, command }) => {
                let [cx, cy] = command.displacement;
                let _ = write!(text, ",{cx},{cy},");
                if let Some(target) = &inputs.target {
                    let [mx, my] = target.displacement;
                    let _ = write!(text, "{mx},{my}");
                } else {
                    text.push(',');
                }
                let state =
                    firmware::Mode::from_wire(command.state).map_or("?", crate::commands::controller::mode_name);
                let faults = firmware::Faults::from_bits(command.faults);
                let _ = writeln!(text, ",{state},{faults}");
            }
        }
    }
    text.into_bytes()
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
