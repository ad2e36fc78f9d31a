//! What a fit did not choose, and the number that spoke against it.

use super::change::Change;
use crate::discretization::Discretization;
use crate::model::ModelError;
use crate::reduction::train::TrainingError;
use crate::scene::Effect;
use crate::study::effects::EffectsError;
use serde::{Serialize, Serializer};
use std::fmt;

/// What a fit decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decision {
    /// Which of its own effects a scene needs.
    World,
    /// How the tissue is discretized.
    Discretization,
    /// Whether the linear law will do.
    Law,
    /// What a simulator solves.
    Plant,
    /// Knots and number type of the table.
    Table,
}

/// What was considered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Alternative {
    /// These of the scene's effects alone.
    Effects(&'static [Effect]),
    /// A discretization.
    Discretization(Discretization),
    /// The law's small-strain limit, and the condensed plant that it allows.
    LinearLaw,
    /// The law's small-strain limit, with the effects that the scene needs.
    LinearLawInWorld,
    /// A reduced plant.
    ReducedPlant,
    /// A table of so many depth knots.
    Knots(usize),
    /// A table in single precision.
    SinglePrecision,
}

impl Alternative {
    /// What it would have decided.
    pub fn decision(&self) -> Decision {
        match self {
            Self::Effects(_) => Decision::World,
            Self::Discretization(_) => Decision::Discretization,
            Self::LinearLaw | Self::LinearLawInWorld => Decision::Law,
            Self::ReducedPlant => Decision::Plant,
            Self::Knots(_) | Self::SinglePrecision => Decision::Table,
        }
    }
}

impl fmt::Display for Alternative {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Discretization(discretization) => discretization.fmt(f),
            Self::Effects([]) => f.pad("no effect"),
            Self::Effects(effects) => f.pad(&format!("{} alone", names(effects))),
            Self::LinearLaw => f.pad("linear law, condensed plant"),
            Self::LinearLawInWorld => f.pad("linear law"),
            Self::ReducedPlant => f.pad("reduced plant"),
            Self::Knots(count) => f.pad(&format!("{count} knots")),
            Self::SinglePrecision => f.pad("f32"),
        }
    }
}

/// Effects by name.
pub(super) fn names(effects: &[Effect]) -> String {
    effects.iter().map(|effect| effect.name()).collect::<Vec<_>>().join(", ")
}

/// Why something was not chosen. Errors are relative.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RejectionReason {
    /// What is left out counts.
    #[error("change against the model with all effects: {0}")]
    LeavesOut(Change),
    /// The nonlinear part of the law counts.
    #[error("change against the scene's own law with these effects: {0}")]
    LinearLawInWorld(Change),
    /// The insertion cannot be followed with it.
    #[error("does not work: {0}")]
    NotFollowed(EffectsError),
    /// Its estimated error is above its share of the tolerance.
    #[error("estimated error")]
    EstimatedError(f64),
    /// It is farther from the next finer model than its share.
    #[error("distance from the next finer model")]
    NotConfirmed(f64),
    /// It keeps the tolerance, and costs so many times what was chosen.
    #[error("times the cost of the chosen one")]
    Dearer(f64),
    /// It cannot be built or solved.
    #[error("does not work: {0}")]
    DoesNotWork(ModelError),
    /// The next finer model, which should confirm it, cannot be built or solved.
    #[error("does not work: the next finer model: {0}")]
    NoFinerModel(ModelError),
    /// Error of the target displacement along the insertion.
    #[error("error of the target displacement along the insertion by the linear law")]
    LinearLaw(f64),
    /// No reduced model keeps its share.
    #[error(transparent)]
    NotReduced(TrainingError),
    /// Error between the knots of a table.
    #[error("error of Jacobian or paddle path between its knots")]
    Interpolation(f64),
    /// Error by rounding.
    #[error("relative error of rounding")]
    Rounding(f64),
}

impl RejectionReason {
    /// The number that rejects; none where there is only a failure.
    pub fn number(&self) -> Option<f64> {
        match *self {
            Self::LeavesOut(change) | Self::LinearLawInWorld(change) => Some(change.worst()),
            Self::EstimatedError(number)
            | Self::NotConfirmed(number)
            | Self::Dearer(number)
            | Self::LinearLaw(number)
            | Self::Interpolation(number)
            | Self::Rounding(number) => Some(number),
            Self::NotFollowed(_) | Self::DoesNotWork(_) | Self::NoFinerModel(_) | Self::NotReduced(_) => None,
        }
    }

    /// The error that is above the tolerance, if that is what rejects.
    pub fn error(&self) -> Option<f64> {
        if let Self::Dearer(_) = self { None } else { self.number() }
    }

    /// The number as people read it.
    pub(super) fn number_text(&self) -> String {
        match (self, self.number()) {
            (Self::Dearer(ratio), _) => format!("{ratio:.1}"),
            (_, Some(error)) if error.is_finite() => format!("{:.3} %", 100.0 * error),
            _ => "–".to_owned(),
        }
    }
}

/// Something cheaper that is not good enough, or something good enough that is dearer. In JSON the two are texts beside the
/// decision and the number.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// What it is.
    pub alternative: Alternative,
    /// What rejected it.
    pub reason: RejectionReason,
}

impl Rejected {
    pub(super) fn new(alternative: Alternative, reason: RejectionReason) -> Self {
        Self { alternative, reason }
    }
}

impl Serialize for Rejected {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Row {
            candidate: String,
            decision: Decision,
            number: Option<f64>,
            reason: String,
        }
        let row = Row {
            candidate: self.alternative.to_string(),
            decision: self.alternative.decision(),
            number: self.reason.number(),
            reason: self.reason.to_string(),
        };
        row.serialize(serializer)
    }
}
