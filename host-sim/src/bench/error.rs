//! Everything that ends a command early, with its exit code.

use std::path::PathBuf;

use firmware::SettingsError;
use firmware::contract::TableError;
use mcap::McapError;
use model_offline::model::ModelError;
use model_offline::output::OutputRefused;
use model_offline::scene::{SceneError, TableScalar, TissueVariant, UnknownLength};
use model_offline::table::TableBuildError;

use super::board::measure::MeasureError;
use super::rounds::{AllVoid, TooLate};
use super::usage::UsageError;
use crate::exchange::LinkError;
use crate::exchange::board::BoardError;
use crate::record::error::{FileError, RecordError};
use crate::runtime::error::RuntimeError;
use crate::world::error::{OutOfRange, WorldError};

/// Why a command ended early.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum SimError {
    /// The scene is not valid.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(Box<SceneError>),
    /// A number that an option does not take.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// An output is refused before the work begins.
    #[error(transparent)]
    Refused(#[from] OutputRefused),
    /// A sensor in millimetres, and a scene in nobody knows what.
    #[error(transparent)]
    #[diagnostic(help("{}", _0.help()))]
    Sensor(#[from] UnknownLength),
    /// Options that cannot be obeyed.
    #[error(transparent)]
    Usage(#[from] UsageError),
    /// A tissue was asked for that the scene does not have.
    #[error("the scene {scene} has no inclusion: leave out --tissue and --table-tissue")]
    NoInclusion {
        /// Name of the scene.
        scene: String,
    },
    /// An emulated board's time is that of its instructions.
    #[error("--controller qemu runs in lockstep: add --mode lockstep")]
    QemuIsLockstepOnly,
    /// A table cannot be used.
    #[error("the table {} cannot be used", path.display())]
    Table {
        /// File, or what it was computed from.
        path: PathBuf,
        /// Why.
        source: TableError,
    },
    /// A table cannot be encoded in the number type that was asked for.
    #[error("the table cannot be encoded as {scalar}")]
    TableScalar {
        /// The number type.
        scalar: TableScalar,
        /// Why.
        source: TableError,
    },
    /// A recording cannot be written as MCAP.
    #[error("the recording cannot be written as MCAP")]
    Mcap(#[from] McapError),
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
    /// A table was computed from another scene than the simulated one.
    #[error("the table {} was computed from another scene than {scene}", path.display())]
    #[diagnostic(help(
        "compute it from this scene, with the same [discretization], or insist with --allow-other-scene"
    ))]
    OtherScene {
        /// File.
        path: PathBuf,
        /// Name of the simulated scene.
        scene: String,
    },
    /// A scene is not that of a recording.
    #[error("{}: this is not the scene that was recorded, with or without its inclusions", scene.display())]
    #[diagnostic(help("give the scene as it was simulated, effects of --world included, or leave --scene out"))]
    NotTheRecordings {
        /// The scene.
        scene: PathBuf,
    },
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A recording cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Record(#[from] RecordError),
    /// The finished run in a directory cannot be understood.
    #[error("{} does not hold a finished run: {reason}", path.display())]
    NotARun {
        /// File.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The new report lies there, or could not be put there, and what was there before could not be moved back.
    #[error("{}: what was there before is in {} now; move it back", directory.display(), path.display())]
    FormerReport {
        /// Directory of the report.
        directory: PathBuf,
        /// Where the former one is.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The tissue cannot be modelled.
    #[error("the tissue cannot be modelled")]
    Model(#[from] ModelError),
    /// One tissue of a scene cannot be modelled, or controlled by no paddle.
    #[error("the {tissue} tissue cannot be simulated")]
    Tissue {
        /// Which.
        tissue: TissueVariant,
        /// What may be asked for instead, if anything.
        #[help]
        instead: Option<String>,
        /// Why.
        source: Box<ModelError>,
    },
    /// The table cannot be computed.
    #[error("the controller table cannot be computed")]
    TableBuild(#[from] TableBuildError),
    /// The table of one tissue of a scene cannot be computed.
    #[error("the controller table of the {tissue} tissue cannot be computed for paddle {paddle}, its best")]
    TissueTable {
        /// Which.
        tissue: TissueVariant,
        /// The best dynamic paddle there.
        paddle: u32,
        /// What may be asked for instead, if anything.
        #[help]
        instead: Option<String>,
        /// Why.
        source: Box<TableBuildError>,
    },
    /// A run ended early.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Runtime(#[from] RuntimeError),
    /// The live view has no port.
    #[error("no live view: cannot listen on port {port} of 127.0.0.1")]
    #[diagnostic(help("choose another --view-port, or leave it out for any free one"))]
    ViewPort {
        /// The port; 0: any.
        port: u16,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The live view has no secret to be opened with.
    #[error("no live view: no random token")]
    #[diagnostic(help("the page needs /dev/urandom; run without --view where there is none"))]
    ViewToken {
        /// What the operating system says.
        source: std::io::Error,
    },
    /// Nothing of a timing measurement is left to compare.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Void(#[from] AllVoid),
    /// A release was later than allowed.
    #[error(transparent)]
    TooLate(#[from] TooLate),
    /// The images on the board cannot be measured, or cost too much.
    #[error(transparent)]
    Measure(#[from] MeasureError),
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
    /// A report is written, of all but what was to run on the machine's clock.
    #[error("the report has no free-run: {source}")]
    #[diagnostic(help(
        "lower --rate to that, take --plant reduced in place of full, insert less deep, take fewer nodes (a larger spacing or tolerance, or what `model-offline fit` finds), for small \
         depths --plant condensed, which is linear, or leave it out with --mode lockstep"
    ))]
    NotKept {
        /// Why.
        source: Box<SimError>,
    },
    /// The catalogue does not notice that monitors are off.
    #[error("no row notices that {monitors} of the controller's monitors are off; see above")]
    Unnoticed {
        /// How many.
        monitors: usize,
    },
}

// What happens inside a run, from wherever it comes, is one kind of error.
macro_rules! in_a_run {
    ($($error:ty),*) => {
        $(impl From<$error> for SimError {
            fn from(error: $error) -> Self {
                Self::Runtime(error.into())
            }
        })*
    };
}

in_a_run!(BoardError, LinkError, SettingsError, WorldError);

impl From<SceneError> for SimError {
    /// Boxed: errors travel through every result, and this one carries the scene's text.
    fn from(error: SceneError) -> Self {
        Self::Scene(error.into())
    }
}

impl SimError {
    /// That a tissue cannot be simulated, and what may be asked for instead.
    pub(super) fn of_tissue(tissue: TissueVariant, instead: Option<String>, source: ModelError) -> Self {
        Self::Tissue { tissue, instead, source: Box::new(source) }
    }

    /// Whether the simulated tissue cannot keep the period of the loop.
    pub(super) fn is_too_slow(&self) -> bool {
        matches!(self, Self::Runtime(RuntimeError::World(WorldError::TooSlow { .. })))
    }

    /// Exit code of the process: 2 for bad input or usage, 1 for everything else.
    pub fn exit_code(&self) -> u8 {
        let is_input = match self {
            Self::Scene(_)
            | Self::OutOfRange(_)
            | Self::Refused(_)
            | Self::OtherScene { .. }
            | Self::NotTheRecordings { .. }
            | Self::Sensor(_)
            | Self::Usage(_)
            | Self::NoInclusion { .. }
            | Self::QemuIsLockstepOnly
            | Self::Table { .. }
            | Self::TableScalar { .. }
            | Self::TableUnits { .. }
            | Self::NotARun { .. } => true,
            Self::Model(error) => error.is_usage(),
            Self::Tissue { source, .. } => source.is_usage(),
            Self::NotKept { source } => return source.exit_code(),
            Self::File(error) => is_unreadable(error),
            Self::Record(RecordError::File(error)) => is_unreadable(error),
            Self::Record(RecordError::Recording { .. } | RecordError::Table { .. }) => true,
            Self::Record(RecordError::Runtime(error)) | Self::Runtime(error) => is_input_of_a_run(error),
            _ => false,
        };
        if is_input { 2 } else { 1 }
    }
}

fn is_unreadable(error: &FileError) -> bool {
    matches!(error, FileError::Read { .. })
}

fn is_input_of_a_run(error: &RuntimeError) -> bool {
    matches!(
        error,
        RuntimeError::Settings(_)
            | RuntimeError::OtherScene
            | RuntimeError::OtherUnits { .. }
            | RuntimeError::OtherPaddles { .. }
            | RuntimeError::Board(BoardError::NoImage { .. })
            | RuntimeError::OtherSpace { .. }
            | RuntimeError::Link(LinkError::Name { .. })
            | RuntimeError::World(WorldError::NoPaddle { .. } | WorldError::TooSlow { .. })
    )
}
