//! `host-sim bridge`: sensors and actuators outside in the plant's place.

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use host_sim::SimError;
use host_sim::bench::usage::UsageError;
use host_sim::exchange::Space;
use host_sim::exchange::udp::{Addresses, Socket};
use host_sim::record::files::write_json;
use host_sim::runtime::bridge::accounts::BridgeResult;
use host_sim::runtime::bridge::{BridgeSettings, ServedController, serve};
use host_sim::runtime::error::RuntimeError;
use host_sim::runtime::peer::introduction::Introduction;
use host_sim::runtime::signals;
use host_sim::world::error::OptionRange;
use model_offline::output::check_outputs;
use model_offline::say;

use super::world_args::PATIENCE;

const DELAY: OptionRange = OptionRange::new("--delay", 0.0, 1000.0, " ms");
const SECONDS: OptionRange = OptionRange::new("--seconds", 1e-3, 86_400.0, " s");

/// Options of the bridge process.
#[derive(Args, Clone, Debug)]
pub(crate) struct BridgeArgs {
    /// Where commands are sent to
    #[arg(long, value_name = "ADDR:PORT")]
    pub(crate) send_to: SocketAddr,
    /// Where samples are listened for; port 0: any free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:47360")]
    pub(crate) listen: SocketAddr,
    /// Whose datagrams are taken [default: the address of --send-to]
    #[arg(long, value_name = "IP")]
    pub(crate) peer: Option<IpAddr>,
    /// Allow addresses that are not of this machine's loopback: whoever can send there as the peer is the peer
    #[arg(long)]
    pub(crate) network: bool,
    /// Name of the link in shared memory; the same on both sides
    #[arg(long, default_value = "by-hand", value_name = "NAME")]
    pub(crate) link: String,
    /// Least time that a datagram is under way, ms: samples are that much older than they seem
    #[arg(long, default_value_t = 0.0, value_name = "MS")]
    pub(crate) delay: f64,
    /// Seconds of silence after which the controller is given up, and the rig before its first sample
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub(crate) patience: f64,
    /// End so many seconds after the first sample [default: when it is told to]
    #[arg(long, value_name = "S")]
    pub(crate) seconds: Option<f64>,
    /// Write what went over it, however it ends, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// Carries samples and commands until it is told to end.
///
/// # Errors
/// [`SimError`].
pub(crate) fn bridge(args: &BridgeArgs) -> Result<(), SimError> {
    signals::install();
    super::sweep();
    PATIENCE.check(args.patience)?;
    DELAY.check(args.delay)?;
    args.seconds.map_or(Ok(()), |seconds| SECONDS.check(seconds))?;
    check_outputs(&[], &[("--json", args.json.as_deref())])?;
    let addresses = addresses(args)?;
    let space = Space::new(&args.link)?;
    let socket = Socket::open(addresses).map_err(RuntimeError::from)?;
    let Addresses { listen, send_to, peer } = socket.addresses();
    say!("Samples from {peer} to {listen}, commands to {send_to}, link {}", args.link);
    if args.network {
        say!("UDP is not authenticated and not encrypted: whoever can send as {peer} is the rig");
    }
    let settings = BridgeSettings {
        patience: Duration::from_secs_f64(args.patience),
        delay_ns: (args.delay * 1e6).round() as u64,
        duration: args.seconds.map(Duration::from_secs_f64),
    };
    let met = |told: &Introduction| {
        let Introduction { dimension, units: [unit, _], paddles, .. } = told;
        let paddles: Vec<_> = paddles.iter().map(u32::to_string).collect();
        // Its table may be anybody's.
        let unit = unit.escape_debug();
        say!("Controller in {dimension} dimensions, unit of length {unit}, paddle {}", paddles.join(" + "));
    };
    // Its accounts say as well that no controller came.
    let ServedController { result, ended } =
        serve(socket, &space, &settings, &met).unwrap_or_else(|error| ServedController {
            result: BridgeResult { ended: Some(error.to_string()), ..BridgeResult::default() },
            ended: Err(error),
        });
    if let Some(path) = &args.json {
        write_json(path, &result)?;
    }
    say!("{}", result.summary());
    Ok(ended?)
}

/// Whom to listen and to send to.
fn addresses(args: &BridgeArgs) -> Result<Addresses, UsageError> {
    let BridgeArgs { send_to, listen, network, .. } = *args;
    let peer = args.peer.unwrap_or_else(|| send_to.ip());
    if send_to.port() == 0 {
        return Err(UsageError::NoPort { address: send_to });
    }
    for (option, address) in [("--send-to", send_to.ip()), ("--peer", peer)] {
        if address.is_unspecified() {
            return Err(UsageError::NobodysAddress { option, address });
        }
    }
    let hears_it = listen.ip() == send_to.ip() || listen.ip().is_unspecified() && send_to.ip().is_loopback();
    if listen.port() == send_to.port() && hears_it {
        return Err(UsageError::ToItself { address: send_to });
    }
    for (option, address) in [("--listen", listen.ip()), ("--send-to", send_to.ip()), ("--peer", peer)] {
        if !network && !address.is_loopback() {
            return Err(UsageError::BeyondLoopback { option, address });
        }
        if address.is_ipv4() != listen.is_ipv4() {
            return Err(UsageError::MixedAddresses { option, address, listen: listen.ip() });
        }
        if listen.ip().is_loopback() && !address.is_loopback() {
            return Err(UsageError::FromLoopback { option, address, listen: listen.ip() });
        }
    }
    Ok(Addresses { listen, send_to, peer })
}
