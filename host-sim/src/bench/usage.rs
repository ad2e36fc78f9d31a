//! What is asked for and makes no sense, and what to ask for instead.

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;

use model_offline::output::csv::CsvError;

use crate::world::needle::RecordedNeedleError;

/// Options that cannot be obeyed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UsageError {
    /// What no simulation of a body in space has yet.
    #[error("{option} is not there in space: leave it out")]
    NotInSpace {
        /// The option.
        option: String,
    },
    /// Nobody can send to port 0.
    #[error("--send-to {address}: name the port that the actuators listen on")]
    NoPort {
        /// The address.
        address: SocketAddr,
    },
    /// The unspecified address: listened on it is all of this machine's, but nobody sends from it.
    #[error("{option} {address} is nobody's address: name that of the machine with the rig")]
    NobodysAddress {
        /// The option.
        option: &'static str,
        /// The address.
        address: IpAddr,
    },
    /// Nobody elsewhere can be reached from the loopback.
    #[error(
        "{option} {address} cannot be reached from --listen {listen}: give this machine's own address in the network there"
    )]
    FromLoopback {
        /// The option.
        option: &'static str,
        /// The address.
        address: IpAddr,
        /// The address that is listened on.
        listen: IpAddr,
    },
    /// The bridge would hear itself and nobody else.
    #[error("--send-to {address} is where the bridge itself listens: name the port that the actuators listen on")]
    ToItself {
        /// The address.
        address: SocketAddr,
    },
    /// An address that others can reach.
    #[error(
        "{option} {address} is not of this machine's loopback: UDP is not authenticated, so that whoever can send there moves \
         the paddle; add --network if that is meant"
    )]
    BeyondLoopback {
        /// The option.
        option: &'static str,
        /// The address.
        address: IpAddr,
    },
    /// One of the addresses is of the other family.
    #[error("{option} {address} and --listen {listen} are not of one family: give all of them in IPv4, or all in IPv6")]
    MixedAddresses {
        /// The option.
        option: &'static str,
        /// The address.
        address: IpAddr,
        /// The address that is listened on.
        listen: IpAddr,
    },
    /// The report's directory would lie in one that is not there.
    #[error("--out {}: the directory {} does not exist; make it, or name another", directory.display(), parent.display())]
    NoParent {
        /// Directory of the report.
        directory: PathBuf,
        /// Where it would lie.
        parent: PathBuf,
    },
    /// The report's directory has something else in it.
    #[error(
        "--out {}: it exists and is not the report of a former run; name another directory", directory.display()
    )]
    NotAReport {
        /// Directory of the report.
        directory: PathBuf,
    },
    /// The report writes a file of this name itself.
    #[error("--json {}: the report has a file of that name itself; name another ending in .json", path.display())]
    NameOfTheReport {
        /// The file.
        path: PathBuf,
    },
    /// A budget cannot be understood.
    #[error("the budget {} cannot be understood; `host-sim board RECORDING --write-budget FILE` writes one", path.display())]
    Budget {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<toml::de::Error>,
    },
    /// More ticks than are kept.
    #[error(
        "--duration {duration_s} s at --rate {rate_hz} Hz are {ticks:.0} ticks, at most {most:.0} are kept; simulate a \
         shorter time or a slower loop"
    )]
    TooManyTicks {
        /// Duration, s.
        duration_s: f64,
        /// Rate of the loop, Hz.
        rate_hz: f64,
        /// Their product.
        ticks: f64,
        /// How many are kept.
        most: f64,
    },
    /// A recorded needle that is no table.
    #[error("--needle-motion {}: {source}; it takes two columns: time in s, depth", file.display())]
    NeedleFile {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        source: CsvError,
    },
    /// A recorded needle that cannot be followed.
    #[error("--needle-motion {}: {source}", file.display())]
    NeedleMotion {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        source: RecordedNeedleError,
    },
    /// A recorded needle that leaves the table.
    #[error(
        "--needle-motion {}: row {row}: depth {depth} is beyond the scene's, {most}; raise [needle] depth, or check the unit",
        file.display()
    )]
    NeedleTooDeep {
        /// The file.
        file: PathBuf,
        /// From 1.
        row: usize,
        /// Its depth.
        depth: f64,
        /// The scene's.
        most: f64,
    },
    /// Nothing is simulated but a needle that waits.
    #[error(
        "--duration {duration_s} s: the needle has not moved by then, it waits for {wait_s} s; simulate a longer time"
    )]
    OnlyWaits {
        /// Duration, s.
        duration_s: f64,
        /// Time that the needle waits, s.
        wait_s: f64,
    },
    /// This machine has no such processor.
    #[error("--cpu {cpu}: this machine has processors 0 to {last}")]
    NoProcessor {
        /// The processor.
        cpu: usize,
        /// The last one there is.
        last: usize,
    },
    /// The catalogue of faults has no such row.
    #[error("--only {row}: the catalogue has rows 1 to {last}")]
    NoRow {
        /// The row.
        row: u32,
        /// The last one there is.
        last: u32,
    },
    /// No controller runs that could be re-armed.
    #[error("no controller of this user is running; `host-sim controller --table FILE` starts one")]
    NoController,
    /// Another process, or somebody else's.
    #[error("process {process} is no controller of this user; without a number the only one that runs is meant")]
    NotAController {
        /// Its id.
        process: i32,
    },
    /// More than one controller could be meant.
    #[error("several controllers are running: say which, {}", list(processes))]
    SeveralControllers {
        /// Their ids.
        processes: Vec<i32>,
    },
}

fn list(processes: &[i32]) -> String {
    processes.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or ")
}
