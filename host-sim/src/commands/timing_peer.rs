//! `host-sim timing-peer`: the other process of `timing`.

use std::path::PathBuf;

use clap::Args;
use host_sim::SimError;
use host_sim::bench::comparison::read_table;
use host_sim::bench::timing::loop_settings;
use host_sim::bench::timing::peer::{PeerOptions, Transport, answer};
use host_sim::runtime::signals;

/// Options of the peer process.
#[derive(Args, Clone, Debug)]
pub(crate) struct PeerArgs {
    /// What to answer
    #[arg(long = "exchange", value_enum)]
    pub(crate) transport: Transport,
    /// Name of the link
    #[arg(long)]
    pub(crate) link: String,
    /// Controller table
    #[arg(long)]
    pub(crate) table: PathBuf,
    /// Loop rate, Hz
    #[arg(long)]
    pub(crate) rate: f64,
    /// Processor to stay on
    #[arg(long)]
    pub(crate) cpu: Option<usize>,
    /// Real-time priority to ask for
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub(crate) priority: u8,
}

/// Answers until the other side has gone.
///
/// # Errors
/// [`SimError`].
pub(crate) fn timing_peer(args: &PeerArgs) -> Result<(), SimError> {
    signals::install();
    let loop_settings = loop_settings(args.rate);
    loop_settings.check()?;
    let table = read_table(&args.table)?.table;
    Ok(answer(&PeerOptions {
        transport: args.transport,
        link: &args.link,
        table: &table,
        loop_settings,
        cpu: args.cpu,
        priority: args.priority,
    })?)
}
