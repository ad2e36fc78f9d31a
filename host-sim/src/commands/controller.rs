//! The controller process: decodes a table, then does nothing but ticks and accounts.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use firmware::contract::{Table, decode};
use iceoryx2::service::ipc;
use serde::{Deserialize, Serialize};

use crate::error::SimError;
use crate::exchange::{ControllerPorts, Departure, Space};
use crate::record::recording::stream::StreamRecorder;
use crate::record::recording::{Exchange, Header, RunMode};
use crate::runtime::accounts::Handover;
use crate::runtime::controller::Session;
use crate::runtime::executor::{AnyTable, Hardware, emulated};
use crate::runtime::peer::{Patience, Peer};
use crate::runtime::signals;
use crate::world::loop_settings::LoopArgs;

/// Options of the controller process.
#[derive(clap::Args, Clone, Debug)]
pub struct ControllerArgs {
    /// Controller table, as `model-offline table` writes it
    #[arg(long, value_name = "FILE")]
    pub table: PathBuf,
    /// Name of the link in shared memory; the same on both sides
    #[arg(long, default_value = "by-hand", value_name = "NAME")]
    pub link: String,
    /// What drives time
    #[arg(long, value_enum, default_value_t = RunMode::Lockstep)]
    pub mode: RunMode,
    /// What computes the steps
    #[arg(long = "controller", value_enum, default_value_t)]
    pub hardware: Hardware,
    /// Rates, latency, noise.
    #[command(flatten)]
    pub loop_args: LoopArgs,
    /// Seconds of silence after which the plant is given up
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub patience: f64,
    /// Process id of the plant that started this: accounts go to stdout, for it to read
    #[arg(long, hide = true)]
    pub parent: Option<i32>,
    /// Ticks to keep room for
    #[arg(long, hide = true, default_value_t = 100_000)]
    pub capacity: usize,
    /// Record every tick in this file while it happens
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Write the accounts here when all is over, however it ends, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Panic in this tick, to see the watchdog
    #[arg(long, hide = true)]
    pub panic_at: Option<u64>,
}

/// Reads and validates a table file.
///
/// # Errors
/// [`SimError::Read`], [`SimError::Table`].
pub fn read_table(path: &Path) -> Result<(Table<f64, 2>, Vec<u8>), SimError> {
    let bytes = std::fs::read(path).map_err(|source| SimError::Read { path: path.to_owned(), source })?;
    let table = decode(&bytes).map_err(|source| SimError::Table { path: path.to_owned(), source })?;
    Ok((table, bytes))
}

/// Runs the controller until the plant says stop. Leaves nothing behind in shared memory, however it ends.
///
/// # Errors
/// [`SimError`].
pub fn serve(args: &ControllerArgs) -> Result<(), SimError> {
    signals::install();
    args.loop_args.check()?;
    crate::world::loop_settings::positive("--patience", args.patience)?;
    let path = &args.table;
    let bytes = std::fs::read(path).map_err(|source| SimError::Read { path: path.clone(), source })?;
    let table = AnyTable::decode(&bytes).map_err(|source| SimError::Table { path: path.clone(), source })?;
    let settings = args.loop_args.settings(table.depth_end());
    let core = match args.hardware {
        Hardware::Native => table.native(&settings)?,
        Hardware::Qemu if args.mode == RunMode::FreeRun => return Err(qemu_is_lockstep_only()),
        Hardware::Qemu => emulated(&bytes, &settings, Duration::from_secs_f64(args.patience))?,
    };
    let header = Header { mode: args.mode, seed: 0, scene_hash: table.scene_hash(), settings, table: bytes };
    let recorder = args.record.as_deref().map(|path| StreamRecorder::create(path, &header)).transpose()?;
    let mut session = Session::new(core, args.capacity);
    session.recorder = recorder;
    session.panic_at = args.panic_at;
    let space = Space::new(&args.link)?;
    let outcome = serve_in(session, &space, args);
    space.leave::<ipc::Service>(Departure::First);
    let (handover, exchanges, ended) = outcome?;
    if let Some(path) = &args.json {
        let ended = ended.as_ref().err().map(ToString::to_string);
        crate::report::directory::write_json(path, &ControllerResult { handover: handover.clone(), ended })?;
    }
    ended?;
    if args.parent.is_some() {
        let said = std::io::stdout().write_all(&handover.encode(&exchanges));
        said.map_err(|source| SimError::Write { path: "standard output".into(), source })?;
    } else {
        println!(
            "{} ticks, {} commands, final state {}, faults seen: {}",
            handover.ticks.due, handover.commands, handover.final_state, handover.faults
        );
    }
    Ok(())
}

/// An emulated board's time is that of its instructions.
pub(crate) fn qemu_is_lockstep_only() -> SimError {
    SimError::Usage("--controller qemu runs in lockstep: add --mode lockstep".to_owned())
}

/// What `controller --json` writes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerResult {
    /// The accounts.
    pub handover: Handover,
    /// Why it ended, if the plant did not say stop.
    pub ended: Option<String>,
}

/// Accounts, exchanges, and how it ended.
type Served = (Handover, Vec<Exchange>, Result<(), SimError>);

fn serve_in(mut session: Session<'_>, space: &Space, args: &ControllerArgs) -> Result<Served, SimError> {
    let parent = args.parent.and_then(rustix::process::Pid::from_raw);
    let mut peer = parent.map_or_else(|| Peer::Elsewhere(Box::new(space.clone()), "plant"), Peer::Parent);
    let timeout = Duration::from_secs_f64(args.patience);
    let mut ports = ControllerPorts::<ipc::Service>::open(space)?;
    let mut patience = Patience::new(timeout);
    while !ports.has_peer() {
        patience.wait::<ipc::Service>(&mut peer)?;
    }
    ports.connect()?;
    let ended = match args.mode {
        RunMode::Lockstep => session.lockstep(&mut ports, &mut peer, timeout),
        RunMode::FreeRun => session.free_run(&mut ports, &mut peer, timeout, &args.loop_args),
    };
    let (handover, exchanges) = session.end(&mut ports)?;
    Ok((handover, exchanges, ended))
}
