//! Why a world cannot be simulated.

use model_offline::model::ModelError;
use model_offline::reduction::train::TrainingError;
use model_offline::solver::equilibrium::Failure;

/// Why the world cannot be set up, or cannot go on.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum WorldError {
    /// The attached paddle is none of the scene's.
    #[error("the simulated scene has no paddle {index}")]
    NoPaddle {
        /// The index that was asked for.
        index: u32,
    },
    /// The tissue has no equilibrium any more.
    #[error("the simulated tissue failed at depth {depth:.4}")]
    Tissue {
        /// Needle depth, length.
        depth: f64,
        /// Why.
        source: Failure,
    },
    /// The reduced model that was asked for cannot be trained.
    #[error("no reduced model of the tissue: {0}")]
    #[diagnostic(help("use --plant full, or --plant auto to have the full model where no reduced one can be made"))]
    Training(TrainingError),
    /// The condensed model that was asked for cannot be made.
    #[error("no reduced model of the tissue: {0}")]
    #[diagnostic(help("use --plant full, or --plant auto to have the full model where no reduced one can be made"))]
    Condensation(ModelError),
}

/// A number that an option does not take.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{option} must be {bound}, not {value}")]
pub struct OutOfRange {
    /// The option, as on the command line.
    pub option: &'static str,
    /// What it must be.
    pub bound: Bound,
    /// What it was.
    pub value: f64,
}

/// What a number must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// Above 0.
    Positive,
    /// 0 or above.
    NotNegative,
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Positive => "above 0",
            Self::NotNegative => "0 or above",
        })
    }
}

/// Refuses numbers that are not above 0, infinity and NaN.
///
/// # Errors
/// [`OutOfRange`] names the option.
pub fn positive(option: &'static str, value: f64) -> Result<(), OutOfRange> {
    let holds = value.is_finite() && value > 0.0;
    if holds { Ok(()) } else { Err(OutOfRange { option, bound: Bound::Positive, value }) }
}

/// Refuses negative numbers, infinity and NaN.
///
/// # Errors
/// [`OutOfRange`] names the option.
pub fn not_negative(option: &'static str, value: f64) -> Result<(), OutOfRange> {
    let holds = value.is_finite() && value >= 0.0;
    if holds { Ok(()) } else { Err(OutOfRange { option, bound: Bound::NotNegative, value }) }
}
