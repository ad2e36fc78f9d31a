//! `host-sim controller`: decodes a table, then does nothing but ticks and accounts.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use firmware::contract::Header;
use host_sim::SimError;
use host_sim::exchange::Space;
use host_sim::record::error::FileError;
use host_sim::record::files::{read_bytes, write_json};
use host_sim::record::recording::RecordingHeader;
use host_sim::record::recording::stream::StreamRecorder;
use host_sim::runtime::accounting::accounts::ControllerAccounts;
use host_sim::runtime::controller::ControlLoop;
use host_sim::runtime::controller::process::{ControllerResult, ServedPlant, Service, serve};
use host_sim::runtime::executor::{AnyTable, Hardware, on_emulated_board};
use host_sim::runtime::names;
use host_sim::runtime::peer::introduction::Introduction;
use host_sim::runtime::signals;
use host_sim::runtime::time::mode::RunMode;
use host_sim::world::loop_settings::{LoopArgs, LoopSettings};
use model_offline::output::table_text::hex;
use model_offline::output::terminal::complain;
use model_offline::scene::{Motion, SensorPreset};
use model_offline::table::TableBuildError;

use super::world_args::PATIENCE;
use model_offline::output::check_outputs;
use model_offline::say;

/// Options of the controller process.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct ControllerArgs {
    /// Controller table, as `model-offline table` writes it
    #[arg(long, value_name = "FILE")]
    pub(crate) table: PathBuf,
    /// Name of the link in shared memory; the same on both sides
    #[arg(long, default_value = "by-hand", value_name = "NAME")]
    pub(crate) link: String,
    /// What drives time
    #[arg(long, value_enum, default_value_t = RunMode::Lockstep)]
    pub(crate) mode: RunMode,
    /// What computes the steps
    #[arg(long = "controller", value_enum, default_value_t)]
    pub(crate) hardware: Hardware,
    /// Rates, and what sees the target.
    #[command(flatten)]
    pub(crate) loop_args: LoopArgs,
    /// Seconds of silence after which the plant is given up
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub(crate) patience: f64,
    /// Process id of the plant that started this: accounts go to stdout, for it to read
    #[arg(long, hide = true, value_parser = clap::value_parser!(i32).range(1..))]
    pub(crate) parent: Option<i32>,
    /// Ticks to keep room for
    #[arg(long, hide = true, default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(..=20_000_000))]
    pub(crate) capacity: u32,
    /// Record every tick in this file while it happens
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// Write the accounts here when all is over, however it ends, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Panic in this tick, to see the watchdog
    #[arg(long, hide = true)]
    pub(crate) panic_at: Option<u64>,
}

/// Runs the controller until the plant says stop.
///
/// # Errors
/// [`SimError`].
pub(crate) fn controller(args: &ControllerArgs) -> Result<(), SimError> {
    signals::install();
    // A plant that starts its controller has swept already.
    if args.parent.is_none() {
        super::sweep();
    }
    PATIENCE.check(args.patience)?;
    check_outputs(&[&args.table], &[("--record", args.record.as_deref()), ("--json", args.json.as_deref())])?;
    let timeout = Duration::from_secs_f64(args.patience);
    let bytes = read_bytes(&args.table)?;
    let table = AnyTable::decode(&bytes).map_err(|source| SimError::Table { path: args.table.clone(), source })?;
    let loop_settings = loop_settings(&args.loop_args, &table)?;
    let settings = loop_settings.settings(table.depth_end());
    let executor = match args.hardware {
        Hardware::Native => table.on_this_machine(&settings)?,
        Hardware::Qemu if args.mode == RunMode::FreeRun => return Err(SimError::QemuIsLockstepOnly),
        Hardware::Qemu => on_emulated_board(&bytes, &settings, timeout)?,
    };
    let dimension = Header::read(&bytes).map_err(TableBuildError::Invalid)?.dimension;
    let header = RecordingHeader { mode: args.mode, seed: 0, scene_hash: table.scene_hash(), settings, table: bytes };
    let space = Space::new(&args.link)?;
    let mut control_loop = ControlLoop::new(executor, args.capacity as usize).rearmed_by(signals::install_rearming());
    if let Some(path) = &args.record {
        control_loop = control_loop.recorded_by(Box::new(StreamRecorder::create(path, &header)?));
    }
    if let Some(tick) = args.panic_at {
        control_loop = control_loop.with_panic_at(tick);
    }
    let parent = args.parent.and_then(rustix::process::Pid::from_raw);
    let (scene_hash, units, paddles) = (hex(&table.scene_hash()), table.units(), table.paddles());
    let introduction = Introduction { dimension, scene_hash, units, paddles };
    let service = Service { mode: args.mode, loop_settings, timeout, parent, introduction };
    // Its accounts say as well that no plant came.
    let served = serve(control_loop, &space, &service).unwrap_or_else(|error| ServedPlant {
        accounts: ControllerAccounts::default(),
        ticks: Vec::new(),
        ended: Err(error),
    });
    hand_in(args, served)
}

/// What the command line asks for; what it leaves open is as in a scene with the table's units.
fn loop_settings(args: &LoopArgs, table: &AnyTable) -> Result<LoopSettings, SimError> {
    let ([unit, _], depth) = (table.units(), table.depth_end());
    let own = SensorPreset::of_unit(&unit).sensor(depth, &unit)?;
    Ok(args.settings(&args.sensor(&own, depth, &unit)?, &Motion::default())?)
}

/// Writes the accounts where they are wanted.
fn hand_in(args: &ControllerArgs, served: ServedPlant) -> Result<(), SimError> {
    let ServedPlant { accounts, ticks, ended } = served;
    if let Some(path) = &args.json {
        let ended = ended.as_ref().err().map(ToString::to_string);
        write_json(path, &ControllerResult { accounts: accounts.clone(), ended })?;
    }
    ended?;
    if args.parent.is_some() {
        let said = std::io::stdout().write_all(&accounts.encode(&ticks));
        said.map_err(|source| FileError::Write { path: "standard output".into(), source })?;
    } else {
        let final_state = names::mode::name(accounts.final_state);
        say!(
            "{} ticks ({} without room in the record), {} commands, final state {final_state}, faults seen: {}",
            accounts.ticks.due,
            accounts.not_kept,
            accounts.commands,
            accounts.faults
        );
        if accounts.ticks.due == 0 {
            complain(
                "note: the other side ended before the first tick, and says why: a table of another scene is refused",
            );
        }
    }
    Ok(())
}
