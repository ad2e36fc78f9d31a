//! The command line: one file per command.

mod board;
mod bridge;
mod controller;
mod export;
mod faults;
mod live;
mod outputs;
mod plant;
mod rearm;
mod replay;
mod report;
mod run;
mod run_space;
mod schema;
mod stability;
mod tables;
mod timing;
mod timing_peer;
mod world_args;
mod worlds;

use std::path::{Path, PathBuf};

use clap::error::ContextKind;
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use host_sim::SimError;
use host_sim::record::error::FileError;
use indicatif::ProgressBar;
use model_offline::output::end_between_results;
use model_offline::output::terminal;
use model_offline::{say, tell};

use self::board::{BoardArgs, board};
use self::bridge::{BridgeArgs, bridge};
use self::controller::{ControllerArgs, controller};
use self::export::{ExportArgs, export};
use self::faults::{FaultsArgs, faults};
use self::plant::{PlantArgs, plant};
use self::rearm::{RearmArgs, rearm};
use self::replay::{ReplayArgs, replay};
use self::report::{ReportArgs, report};
use self::run::{RunArgs, run};
use self::schema::{Subject, schema};
use self::stability::{LoopStabilityArgs, stability};
use self::tables::{TablesArgs, tables};
use self::timing::{TimingArgs, timing};
use self::timing_peer::{PeerArgs, timing_peer};
use self::worlds::{WorldsArgs, worlds};

/// Simulates needle insertions with a paddle that holds the target still. Without a command: `run` on the paper's scene
#[derive(Debug, Parser)]
#[command(version)]
#[command(after_help = "Example: host-sim run --tissue inclusion --seed 7 --out my-report")]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Compares no paddle, the best static and the best dynamic paddle, and writes a report
    #[command(
        after_help = "Examples:\n  host-sim run\n  host-sim run --tissue inclusion --table-tissue homogeneous --noise 0\n  host-sim run --scene my.toml --mode free-run --rate 500 --json result.json"
    )]
    Run(Box<RunArgs>),
    /// The controller's side of a link by hand
    #[command(
        after_help = "Example, in two terminals:\n  model-offline table paper -o paper.table && host-sim controller --table paper.table\n  host-sim plant --scene paper"
    )]
    Controller(ControllerArgs),
    /// The plant's side of a link by hand
    #[command(
        after_help = "Example, in two terminals:\n  host-sim controller --table paper.table --mode free-run\n  host-sim plant --scene paper --mode free-run"
    )]
    Plant(Box<PlantArgs>),
    /// Sensors and actuators outside in the plant's place, by UDP, for a controller in free-run
    #[command(
        after_help = "Example, in three terminals:\n  host-sim controller --table paper.table --mode free-run --rate 200\n  host-sim bridge --send-to 127.0.0.1:47361\n  python3 host-sim/examples/rig.py"
    )]
    Bridge(BridgeArgs),
    /// Lets a running controller out of SAFE, once somebody has looked
    #[command(after_help = "Example, beside a controller by hand that has gone to SAFE: host-sim rearm")]
    Rearm(RearmArgs),
    /// Checks the fixed-rate loop against an empty one
    #[command(
        after_help = "Examples:\n  host-sim timing --rate 1000 --seconds 10 --out timing\n  host-sim timing --sweep --cpu 0\n  host-sim timing -i 1000 -D 60 -p 80 --max-lateness 500 --histogram lateness.txt"
    )]
    Timing(TimingArgs),
    /// The other process of `timing`
    #[command(hide = true)]
    TimingPeer(PeerArgs),
    /// Injects every fault of the catalogue and accounts for everything
    #[command(
        after_help = "Examples:\n  host-sim faults --out faults\n  host-sim faults --only 16,23 --seed 7\n  host-sim faults --dimension 3 --only 46,49\n  nice host-sim faults --only 1 --seeds 4000"
    )]
    Faults(FaultsArgs),
    /// Where the closed loop stops being stable: simulated beside theory
    #[command(after_help = "Example: host-sim stability --out stability --quick")]
    Stability(LoopStabilityArgs),
    /// Charts what a table's size is worth: closed-loop error and time of a step against knots and number type
    #[command(after_help = "Example: host-sim tables --scene paper --tissue homogeneous --out charts")]
    Tables(TablesArgs),
    /// Tries the loop in worlds that are more than the table's model: needles that slip, tissue that creeps, patients that
    /// breathe
    #[command(after_help = "Example: host-sim worlds --scene prostate --seeds 20")]
    Worlds(WorldsArgs),
    /// Runs the controller again on recorded inputs and compares bit by bit
    #[command(after_help = "Example: host-sim replay stillpoint-report/inclusion-dynamic.rec")]
    Replay(ReplayArgs),
    /// Measures the controller's bare-metal images on a Cortex-M7 in QEMU
    #[command(
        after_help = "Example:\n  host-sim run --tissue inclusion --mode lockstep --insertion-time 1.5 --out short\n  host-sim board short/inclusion-dynamic.rec --budget firmware/image/budget.toml"
    )]
    Board(BoardArgs),
    /// Writes a recording as MCAP (Foxglove, Lichtblick) or CSV with a time column (PlotJuggler)
    #[command(
        after_help = "Example: host-sim export stillpoint-report/inclusion-dynamic.rec --mcap run.mcap --csv run.csv"
    )]
    Export(ExportArgs),
    /// Prints the JSON Schema of what is written as JSON
    #[command(after_help = "Example: host-sim schema result > result.schema.json")]
    Schema {
        /// What the schema is about
        #[arg(value_enum, default_value_t)]
        of: Subject,
    },
    /// Prints a completion script for a shell
    #[command(after_help = "Example: host-sim completions bash > ~/.local/share/bash-completion/completions/host-sim")]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Writes manual pages, one for every command
    #[command(after_help = "Example: host-sim man man1 && man ./man1/host-sim.1")]
    Man {
        /// Directory for the pages
        directory: PathBuf,
    },
    /// Makes the report of a finished run again
    #[command(
        after_help = "Examples:\n  host-sim report stillpoint-report\n  host-sim report stillpoint-report --svg-dir figures"
    )]
    Report(ReportArgs),
}

/// Does what was asked for.
///
/// # Errors
/// [`SimError`], with its exit code.
pub(crate) fn execute(command: Command) -> Result<(), SimError> {
    match command {
        Command::Run(args) => run(&args),
        Command::Controller(args) => controller(&args),
        Command::Plant(args) => plant(&args),
        Command::Bridge(args) => bridge(&args),
        Command::Rearm(args) => rearm(&args),
        Command::Timing(args) => timing(&args),
        Command::TimingPeer(args) => timing_peer(&args),
        Command::Faults(args) => faults(&args),
        Command::Stability(args) => stability(&args),
        Command::Tables(args) => tables(&args),
        Command::Worlds(args) => worlds(&args),
        Command::Replay(args) => replay(&args),
        Command::Board(args) => board(&args),
        Command::Export(args) => {
            end_between_results();
            export(&args)
        }
        Command::Schema { of } => {
            say!("{:#}", schema(of));
            Ok(())
        }
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "host-sim", &mut script);
            tell!("{}", String::from_utf8_lossy(&script));
            Ok(())
        }
        Command::Man { directory } => man(&directory),
        Command::Report(args) => {
            end_between_results();
            report(&args)
        }
    }
}

/// The progress of a command whose steps are not counted yet; hidden for a quiet one.
fn progress_bar(quiet: bool) -> ProgressBar {
    if quiet { ProgressBar::hidden() } else { terminal::progress(0) }
}

/// Removes what runs that were killed have left in shared memory, and says so.
fn sweep() {
    let swept = host_sim::exchange::sweep();
    if !swept.is_empty() {
        terminal::complain(&format!(
            "Removed from shared memory what killed processes had left there: {}",
            swept.join(", ")
        ));
    }
}

/// Writes the manual pages.
fn man(directory: &Path) -> Result<(), SimError> {
    FileError::make_folder(directory)?;
    clap_mangen::generate_to(Cli::command(), directory).map_err(FileError::write(directory))?;
    say!("{}", directory.join("host-sim.1").display());
    Ok(())
}

/// Commands of the other program of this project, for those who mix them up.
const ELSEWHERE: [&str; 13] = [
    "place",
    "check",
    "draw",
    "solve",
    "table",
    "inspect",
    "new",
    "fit",
    "slice",
    "compare",
    "materials",
    "pareto",
    "sweep",
];

/// Reads the command line; ends the process with help, or with what is wrong and what was meant. Without a word it is `run`.
pub(crate) fn parse() -> Command {
    let mut words: Vec<_> = std::env::args_os().collect();
    if words.len() < 2 {
        words.push("run".into());
    }
    let mut command = terminal::accepting_negative_numbers(Cli::command());
    let matches = command.try_get_matches_from_mut(words);
    let cli = matches.and_then(|matches| Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command)));
    cli.map_or_else(|error| refuse(&error), |cli| cli.command)
}

fn refuse(error: &clap::Error) -> ! {
    let context = |kind| error.get(kind).map(ToString::to_string);
    let _ = error.print();
    if let Some(word) = context(ContextKind::InvalidSubcommand) {
        if ELSEWHERE.contains(&word.as_str()) {
            terminal::complain(&format!(
                "\n  tip: `{word}` is a command of model-offline: model-offline {word} --help"
            ));
        } else {
            terminal::suggest(error, &word, &Cli::command());
        }
    } else if let Some(option) = context(ContextKind::InvalidArg)
        && std::env::args().nth(1).is_some_and(|first| first.starts_with(&option))
        && is_option_of_run(&option)
    {
        terminal::complain(&format!("\n  tip: `{option}` is an option of run: host-sim run {option}"));
    }
    std::process::exit(error.exit_code());
}

fn is_option_of_run(option: &str) -> bool {
    let name = option.trim_start_matches('-');
    let cli = Cli::command();
    cli.find_subcommand("run").is_some_and(|run| run.get_arguments().any(|arg| arg.get_long() == Some(name)))
}
