//! Why a world cannot be simulated.

use model_offline::model::ModelError;
use model_offline::needle::NeedleError;
use model_offline::number::length;
use model_offline::reduction::TabulationError;
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
    #[error("the simulated tissue failed at depth {}", length(*depth))]
    #[diagnostic(help(
        "insert less deep ([needle] depth), or widen the contact: a short one squeezes the tissue at its ends until the \
         law has no answer"
    ))]
    Tissue {
        /// Needle depth, length.
        depth: f64,
        /// Why.
        source: Failure,
    },
    /// The tissue's step takes longer than the loop has time for.
    #[error(
        "the simulated tissue takes {step_us:.0} µs a step and cannot keep a period of {period_us:.0} µs: at most \
         {rate_hz:.0} Hz{}", instead.as_ref().map_or_else(String::new, |why| format!("; no reduced tissue takes its place: {why}"))
    )]
    #[diagnostic(help(
        "lower --rate to that, take --plant reduced in place of full, insert less deep, take fewer nodes (a larger spacing or tolerance, or what `model-offline fit` finds), for small \
         depths --plant condensed, which is linear, or --mode lockstep, which has no clock"
    ))]
    TooSlow {
        /// Mean duration of a step, µs.
        step_us: f64,
        /// Period of the loop, µs.
        period_us: f64,
        /// Highest rate that this tissue keeps, Hz.
        rate_hz: f64,
        /// Why there is no reduced tissue in its place, where one was tried.
        instead: Option<Box<WorldError>>,
    },
    /// Needle and tissue cannot go on.
    #[error("the simulated needle cannot go on: {0}")]
    #[diagnostic(help("insert more slowly or less deep ([needle] depth), or with less cutting force and friction"))]
    Needle(NeedleError),
    /// The condensed model of tissue that has a past.
    #[error(
        "tissue that has a past (a needle that slips, stress that relaxes, a patient that moves) has no condensed model"
    )]
    #[diagnostic(help("use --plant reduced, the default there, or --plant full"))]
    CondensedHasNoPast,
    /// The scene asks for more than the simulated world has.
    #[error(transparent)]
    Scene(ModelError),
    /// The reduced model that was asked for cannot be trained.
    #[error("no reduced model of the tissue: {0}")]
    #[diagnostic(help("use --plant full, or --plant auto to have the full model where no reduced one can be made"))]
    Training(TrainingError),
    /// The body in space cannot be tabulated.
    #[error("no table of the tissue along the insertion: {0}")]
    #[diagnostic(help("insert less deep ([needle] depth), or give the law a barrier"))]
    Tabulation(TabulationError),
    /// The condensed model that was asked for cannot be made.
    #[error("no reduced model of the tissue: {0}")]
    #[diagnostic(help("use --plant full, or --plant auto to have the full model where no reduced one can be made"))]
    Condensation(ModelError),
}

/// A number that an option does not take.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{option} must be between {least} and {most}{unit}, not {value}")]
pub struct OutOfRange {
    /// The option, as on the command line.
    pub option: &'static str,
    /// The smallest number that it takes.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// Unit with a space before it; empty: none.
    pub unit: &'static str,
    /// What it was.
    pub value: f64,
}

/// The numbers that an option takes. Outside of them a number makes no sense, or overflows what it is multiplied with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptionRange {
    option: &'static str,
    least: f64,
    most: f64,
    unit: &'static str,
}

impl OptionRange {
    /// Numbers from `least` to `most` in `unit` (with a space before it; empty: none).
    pub const fn new(option: &'static str, least: f64, most: f64, unit: &'static str) -> Self {
        Self { option, least, most, unit }
    }

    /// Refuses numbers outside of the range, infinity and NaN.
    ///
    /// # Errors
    /// [`OutOfRange`] names the option.
    pub fn check(&self, value: f64) -> Result<(), OutOfRange> {
        let Self { option, least, most, unit } = *self;
        if (least..=most).contains(&value) { Ok(()) } else { Err(OutOfRange { option, least, most, unit, value }) }
    }
}
