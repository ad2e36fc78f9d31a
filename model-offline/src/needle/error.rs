//! Why a needle cannot go on.

use crate::discretization::ShapeError;
use crate::solver::equilibrium::Failure;

/// Why a needle cannot be taken to where it was asked to go; it is then where it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NeedleError {
    /// The scene's needle does not slip.
    #[error("the scene's needle does not slip: [needle] mechanics is \"patch\"")]
    NoShaft,
    /// Prescribed values are imposed weakly.
    #[error("a needle that slips needs nodal values that are imposed exactly: use essential = \"transformation\"")]
    HeldWeakly,
    /// The tissue has no equilibrium there.
    #[error("no equilibrium on the way to depth {depth}: {source}")]
    Equilibrium {
        /// Depth that was asked for, length.
        depth: f64,
        /// Why.
        source: Failure,
    },
    /// No forces along the shaft were found that the tissue and the laws of friction agree on.
    #[error("no forces along the shaft fit tissue and friction on the way to depth {depth}")]
    NoForces {
        /// Depth that was asked for, length.
        depth: f64,
    },
    /// The tissue would have to go further than the needle that takes it along.
    #[error(
        "on the way to depth {depth} the tissue goes along further than the needle: its forces are too large for this \
         tissue (a linear law adds them up on the undeformed body); use a nonlinear law, or less cutting force and friction"
    )]
    Outrun {
        /// Depth that was asked for, length.
        depth: f64,
    },
    /// Shape functions do not exist at a point of the shaft.
    #[error("the shaft would leave the body, or lie between nodes that are too far apart: {0}")]
    Shape(#[from] ShapeError),
}

impl NeedleError {
    /// Depth that was asked for, length; none where that did not matter.
    pub fn depth(&self) -> Option<f64> {
        match self {
            Self::Equilibrium { depth, .. } | Self::NoForces { depth } | Self::Outrun { depth } => Some(*depth),
            Self::NoShaft | Self::HeldWeakly | Self::Shape(_) => None,
        }
    }
}
