//! Why there is no reduced model.

use crate::model::ModelError;
use crate::needle::NeedleError;
use crate::solver::equilibrium::Failure;

/// Why there is no reduced model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrainingError {
    /// The full model fails.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The tissue cannot be taken along an insertion.
    #[error("the insertion cannot be simulated beyond {time:.3} s after the needle's start: {source}")]
    Path {
        /// Seconds since the start of the needle.
        time: f64,
        /// Why.
        source: Box<NeedleError>,
    },
    /// The patient moves too fast for the steps that are tried.
    #[error(
        "the patient moves so fast that the insertion takes {steps} steps, at most {most} are tried: insert faster, or use --plant full"
    )]
    TooFast {
        /// Steps it would take.
        steps: f64,
        /// As many as are tried.
        most: f64,
    },
    /// The full model loses stability before any depth worth training.
    #[error(
        "the full model reaches depth {reached:.4} of {asked:.4} only: nothing to train on; ask for less depth, or give the law a barrier"
    )]
    TooShallow {
        /// Depth that every snapshot reached.
        reached: f64,
        /// Depth asked for.
        asked: f64,
    },
    /// The full model has no stable equilibrium somewhere in the range, however much it was shrunk.
    #[error(
        "the full model has no stable equilibrium at depth {depth:.4} with the paddle displaced by ({x:.4}, {y:.4}): {failure}; train for less depth or a smaller paddle range, or give the law a barrier"
    )]
    Unstable {
        /// Needle depth.
        depth: f64,
        /// Paddle displacement.
        x: f64,
        /// Paddle displacement.
        y: f64,
        /// What the full model said.
        failure: Failure,
    },
    /// The tangent on the modes is singular: no residual says what the error is.
    #[error("the stiffness on {modes} modes is singular, so that no error could be estimated: hold more of the body")]
    Singular {
        /// Modes, guard modes included.
        modes: usize,
    },
    /// The snapshots span too few modes for any to be left to watch the others.
    #[error(
        "the snapshots span {modes} modes, too few to use some and estimate the error with others; train for more depth"
    )]
    TooFewModes {
        /// Modes above rounding.
        modes: usize,
    },
    /// No number of modes passes the trial.
    #[error(
        "the best reduced model is wrong by {worst_error:.2e} of the largest target displacement and bounds its error by {worst_estimate:.2e}, {tolerance:.2e} was asked for; ask for that bound, or train for less depth or a smaller paddle range"
    )]
    TooInaccurate {
        /// Worst error of the best try.
        worst_error: f64,
        /// Its largest bound; infinite where the snapshots themselves could not be told apart well enough to try.
        worst_estimate: f64,
        /// Error asked for.
        tolerance: f64,
    },
    /// No reduced model had an equilibrium at all states that it was tried on.
    #[error(
        "no reduced model has an equilibrium at every state tried, up to depth {depth:.4}; train for less depth or a smaller paddle range"
    )]
    NoEquilibrium {
        /// Depth asked for.
        depth: f64,
    },
}
