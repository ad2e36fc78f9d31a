//! Why a command failed, and what scripts are told.

use super::json;
use model_offline::model::ModelError;
use model_offline::needle::NeedleError;
use model_offline::output::result_file::ResultError;
use model_offline::output::{OutputError, OutputRefused, PictureError};
use model_offline::scene::{LimitError, Scene, SceneError, TissueVariant};
use model_offline::solver::equilibrium::Failure;
use model_offline::study::effects::EffectsError;
use model_offline::study::fit::FitError;
use model_offline::study::slice::SliceError;
use model_offline::table::TableBuildError;
use std::path::{Path, PathBuf};

/// Why a command failed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub(crate) enum CliError {
    /// The scene is bad.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// An argument is bad.
    #[error("{message}")]
    #[diagnostic(help("{help}"))]
    Usage {
        /// What is wrong.
        message: String,
        /// What to do.
        help: String,
    },
    /// An output is refused before the work begins.
    #[error(transparent)]
    Refused(#[from] OutputRefused),
    /// The table file cannot be used.
    #[error("{}: {reason}", path.display())]
    BadTable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The model cannot be made or solved.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The table cannot be made.
    #[error(transparent)]
    Table(TableBuildError),
    /// No equilibrium.
    #[error("no equilibrium: {failure}; last converged state at depth {depth:.4}")]
    #[diagnostic(help(
        "the tissue law loses stability under strong compression: reduce the depth, or add a barrier to the material; \
         where tissue is much softer or stiffer than what is beside it, another rule may go on for longer (fem-t6, in \
         space fem-t10)"
    ))]
    Solve {
        /// Why.
        failure: Failure,
        /// Depth of the last converged state.
        depth: f64,
    },
    /// The needle cannot go on.
    #[error(transparent)]
    #[diagnostic(help(
        "spread the cutting force over more tip_length (tissue beside a tip bears about twice its shear modulus per \
         length of it, which coarse nodes hide), insert less deep or in more increments, or with less cutting force and friction"
    ))]
    Needle(#[from] NeedleError),
    /// The model of everything that a scene has cannot be followed.
    #[error(transparent)]
    #[diagnostic(help(
        "insert less deep, or with less cutting force and friction; give [discretization] spacing in place of a tolerance; \
         where the law loses stability, add a barrier to the material"
    ))]
    World(FitError),
    /// There is no slice of the scene.
    #[error(transparent)]
    Slice(SliceError),
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A picture could not be made or written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Picture(#[from] PictureError),
    /// A result cannot be drawn.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Result(#[from] ResultError),
}

impl From<TableBuildError> for CliError {
    fn from(error: TableBuildError) -> Self {
        match error {
            TableBuildError::Model(error) => Self::Model(error),
            other => Self::Table(other),
        }
    }
}

impl From<EffectsError> for CliError {
    fn from(error: EffectsError) -> Self {
        match error {
            EffectsError::Model(error) => Self::Model(error),
            EffectsError::Needle(error) => Self::Needle(error),
        }
    }
}

impl From<FitError> for CliError {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Model(error) => Self::Model(error),
            FitError::Table(error) => error.into(),
            // What is no fault of the tissue has an answer of its own.
            FitError::World { source: EffectsError::Model(error), .. } if error.is_usage() => Self::Model(error),
            FitError::World { source: EffectsError::Needle(NeedleError::HeldWeakly), .. } => {
                Self::Needle(NeedleError::HeldWeakly)
            }
            world @ FitError::World { .. } => Self::World(world),
        }
    }
}

impl From<SliceError> for CliError {
    fn from(error: SliceError) -> Self {
        match error {
            SliceError::Model(error) => Self::Model(error),
            SliceError::NoSuchPaddle(error) => Self::Model(error.into()),
            other => Self::Slice(other),
        }
    }
}

impl From<LimitError> for CliError {
    fn from(error: LimitError) -> Self {
        // Scenes are checked when they are read: it is the option of that name.
        Self::usage(format!("--{error}"), error.help())
    }
}

impl CliError {
    pub(super) fn usage(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Usage { message: message.into(), help: help.into() }
    }

    /// 2 for bad input or usage, 1 for a computation that failed.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_) | Self::Refused(_) | Self::Usage { .. } | Self::BadTable { .. } => 2,
            Self::Slice(SliceError::NotFree { .. } | SliceError::OnLine { .. }) => 2,
            Self::Model(error) if error.is_usage() => 2,
            Self::Table(TableBuildError::Knots(_) | TableBuildError::Paddles(_)) => 2,
            Self::Needle(NeedleError::HeldWeakly) | Self::Picture(PictureError::Format { .. }) | Self::Result(_) => 2,
            _ => 1,
        }
    }

    fn reason(&self) -> String {
        match self {
            Self::Solve { failure, .. } => failure.reason.to_string(),
            Self::Model(error) => error.kind().to_string(),
            Self::Needle(NeedleError::Equilibrium { source, .. }) => source.reason.to_string(),
            Self::Needle(_) => "no-shaft-forces".into(),
            Self::World(_) => "no-insertion".into(),
            Self::Slice(_) => "no-slice".into(),
            Self::Table(TableBuildError::Stopped { source, .. }) => source.kind().to_string(),
            Self::Table(_) => "no-table".into(),
            Self::Output(_) | Self::Picture(_) => "not-written".into(),
            Self::Result(_) => "bad-input".into(),
            Self::Scene(_) | Self::Refused(_) | Self::Usage { .. } | Self::BadTable { .. } => "bad-input".into(),
        }
    }

    /// Depth of the last converged state, or of the one that was not found; none where it is not about depths.
    fn depth(&self) -> Option<f64> {
        match self {
            Self::Solve { depth, .. } => Some(*depth),
            Self::Needle(error) => error.depth(),
            Self::Table(TableBuildError::Stopped { depth, .. }) => Some(*depth),
            _ => None,
        }
    }

    /// The error, told in the JSON too when a computation failed, so that a script sees the reason.
    pub(super) fn reported(self, file: Option<&Path>, scene: &Scene) -> Self {
        self.reported_of(file, &scene.name, scene.tissue())
    }

    /// The same of a scene of this name and tissue.
    pub(super) fn reported_of(self, file: Option<&Path>, scene: &str, tissue: TissueVariant) -> Self {
        if self.exit_code() == 1 && file.is_some() {
            let document = serde_json::json!({
                "scene": scene, "tissue": tissue,
                "failure": {"reason": self.reason(), "depth": self.depth(), "detail": self.to_string()},
            });
            if let Err(output) = json::write_json(file, &document) {
                return output.into();
            }
        }
        self
    }
}
