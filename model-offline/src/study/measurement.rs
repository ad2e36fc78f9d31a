//! One discretization, measured: time and errors of a job.

use crate::discretization::{Discretization, Resolution};
use crate::model::ModelError;
use crate::reduction::Invalid;
use crate::reduction::train::TrainingError;
use crate::solver::equilibrium::Failure;
use serde::Serialize;
use std::convert::Infallible;
use strum::{Display, VariantArray};

/// One discretization or plant, measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Which job.
    pub job: Job,
    /// What kind of model answers.
    pub model_kind: ModelKind,
    /// The discretization.
    pub discretization: Discretization,
    /// Number of nodes (0 where building failed).
    pub nodes: usize,
    /// Finest spacing, length units.
    pub spacing: f64,
    /// Which law.
    pub law: Linearity,
    /// Best time, s.
    pub wall_s: f64,
    /// Worst relative error of the controllability measures; NaN where the job has none.
    pub error_cm: f64,
    /// Worst error of the target displacement, over the largest.
    pub error_static: f64,
    /// Why it failed.
    pub failure: Option<MeasurementFailure>,
    /// Whether nothing is both faster and more accurate.
    pub on_front: bool,
}

/// What somebody else's program took for the Jacobians of all single paddles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peer {
    /// Unknowns.
    pub dofs: u32,
    /// Whether its elements are quadratic.
    pub quadratic: bool,
    /// Time on one thread, s.
    pub wall_s: f64,
    /// Worst error of the measures, relative.
    pub error: f64,
}

/// Why there is no time or no error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeasurementFailure {
    /// It cannot be built, or solved at rest.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An equilibrium on the way was not found.
    #[error(transparent)]
    Solve(#[from] Failure),
    /// It cannot be reduced.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The reduced model has no answer somewhere.
    #[error(transparent)]
    Reduced(#[from] Invalid),
    /// Never: the condensed model always answers.
    #[error(transparent)]
    None(#[from] Infallible),
}

/// What is charted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Display, VariantArray)]
#[strum(serialize_all = "kebab-case")]
pub enum Job {
    /// Jacobians and small-depth displacements of all paddles.
    Placement,
    /// Target displacement along the insertion, all paddles.
    Insertion,
    /// One tick of a simulator.
    Step,
}

/// What kind of model answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Display)]
#[strum(serialize_all = "kebab-case")]
pub enum ModelKind {
    /// The full model on reproducing kernels.
    Rkpm,
    /// The full model on finite elements.
    Fem,
    /// The reduced nonlinear model.
    Reduced,
    /// The linear model, statically condensed.
    Condensed,
}

/// Whether the law's own nonlinearity is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Display, Serialize)]
#[strum(serialize_all = "kebab-case")]
#[serde(rename_all = "kebab-case")]
pub enum Linearity {
    /// The law's small-strain limit.
    Linear,
    /// The law itself.
    Nonlinear,
}

impl Measurement {
    /// The error by which the job's front is drawn.
    pub fn error(&self) -> f64 {
        if self.job == Job::Placement { self.error_cm } else { self.error_static }
    }
}

impl Measurement {
    pub(super) fn new(job: Job, discretization: Discretization, law: Linearity) -> Self {
        Self {
            job,
            model_kind: if discretization.method.integration.is_element() { ModelKind::Fem } else { ModelKind::Rkpm },
            discretization,
            nodes: 0,
            spacing: if let Resolution::Spacing(h) = discretization.resolution { h } else { f64::NAN },
            law,
            wall_s: f64::NAN,
            error_cm: f64::NAN,
            error_static: f64::NAN,
            failure: None,
            on_front: false,
        }
    }
}
