//! Everything that ends a command early, with its exit code.

use std::path::PathBuf;

use firmware::contract::TableError;
use firmware::{Faults, SettingsError};
use model_offline::model::ModelError;
use model_offline::scene::SceneError;
use model_offline::solver::equilibrium::Failure;

use crate::exchange::LinkError;
use crate::record::recording::RecordingError;

/// Why a command ended early.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum SimError {
    /// The scene is not valid.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(Box<SceneError>),
    /// A combination of options that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A table cannot be used.
    #[error("the table {} cannot be used", path.display())]
    Table {
        /// File, or what it was computed from.
        path: PathBuf,
        /// Why.
        source: TableError,
    },
    /// A table was computed in other units than the scene's.
    #[error(
        "the table {} is in {}, the scene in {}: compute it from this scene", path.display(), found.join(" and "),
        expected.join(" and ")
    )]
    TableUnits {
        /// File.
        path: PathBuf,
        /// Units of length and stress in the table.
        found: [String; 2],
        /// Those of the scene.
        expected: [String; 2],
    },
    /// The controller refuses its settings.
    #[error("the controller refuses its settings")]
    Settings(#[from] SettingsError),
    /// A recording cannot be used.
    #[error("the recording {} cannot be used", path.display())]
    Recording {
        /// File.
        path: PathBuf,
        /// Why.
        source: RecordingError,
    },
    /// A file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// File or directory.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The finished run in a directory cannot be understood.
    #[error("{} does not hold a finished run: {reason}", path.display())]
    NotARun {
        /// File.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The tissue cannot be modelled.
    #[error("the tissue cannot be modelled")]
    Model(#[from] ModelError),
    /// The table cannot be computed.
    #[error("the controller table cannot be computed")]
    TableBuild(#[from] model_offline::table::TableBuildError),
    /// The tissue of the simulation has no equilibrium any more.
    #[error("the simulated tissue failed at depth {depth:.4}")]
    Tissue {
        /// Needle depth, length.
        depth: f64,
        /// Why.
        source: Failure,
    },
    /// The reduced or condensed model that was asked for cannot be made.
    #[error("no reduced model of the tissue: {0}")]
    #[diagnostic(help("use --plant full, or --plant auto to have the full model where no reduced one can be made"))]
    Reduction(String),
    /// Shared memory failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The live view cannot be served.
    #[error("no live view: {0}")]
    #[diagnostic(help("choose another --view-port, or leave it away for any free one"))]
    View(String),
    /// The controller process cannot be started.
    #[error("cannot start the controller process: {0}")]
    Spawn(std::io::Error),
    /// The controller on a board cannot be used.
    #[error("the controller on the board cannot be used")]
    Board(#[from] crate::exchange::board::BoardError),
    /// The peer is gone.
    #[error("the {peer} process has died ({how}); the run is void, shared memory has been cleaned up")]
    PeerDied {
        /// `controller` or `plant`.
        peer: &'static str,
        /// What is known about its end.
        how: String,
    },
    /// The peer is there, but silent.
    #[error(
        "no answer from the {peer} process for {silent_s:.1} s; the run is void. Is it stopped, or does --link differ?"
    )]
    PeerSilent {
        /// `controller` or `plant`.
        peer: &'static str,
        /// How long, s.
        silent_s: f64,
    },
    /// The peer says something impossible.
    #[error("the {peer} process broke the protocol: {what}")]
    Protocol {
        /// `controller` or `plant`.
        peer: &'static str,
        /// What it did.
        what: String,
    },
    /// The user, or somebody else, asked for the end.
    #[error("stopped by {signal}; nothing was written")]
    Interrupted {
        /// Name of the signal.
        signal: &'static str,
    },
    /// The controller never came to RUN, so that the needle never started.
    #[error("the controller did not reach RUN within {waited_s:.1} s: {faults}")]
    NeverArmed {
        /// How long was waited, s.
        waited_s: f64,
        /// What kept it.
        faults: Faults,
    },
    /// Some rows of the catalogue of faults do not hold.
    #[error("{failed} of {rows} rows of the catalogue and {schedules} random schedules failed; see above")]
    Faults {
        /// Rows that failed.
        failed: usize,
        /// Rows that were tried.
        rows: usize,
        /// Random schedules that failed.
        schedules: usize,
    },
    /// A replayed command is not the recorded one.
    #[error("{}: {differences} of {ticks} commands differ, the first at tick {tick}: {detail}", path.display())]
    ReplayDiffers {
        /// File.
        path: PathBuf,
        /// Commands that differ.
        differences: u64,
        /// Commands compared.
        ticks: u64,
        /// Tick of the first difference.
        tick: u64,
        /// What differs there.
        detail: String,
    },
}

impl SimError {
    /// Exit code of the process: 2 for bad input or usage, 1 for everything else.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_)
            | Self::Usage(_)
            | Self::Table { .. }
            | Self::TableUnits { .. }
            | Self::Settings(_)
            | Self::Recording { .. }
            | Self::Read { .. }
            | Self::NotARun { .. }
            | Self::Link(LinkError::Name { .. }) => 2,
            _ => 1,
        }
    }
}
