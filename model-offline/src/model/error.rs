//! Why a scene cannot be modelled.

use crate::discretization::meshing::StuffingError;
use crate::discretization::{DiscretizationError, Integration, ShapeError, SpatialError};
use crate::material::MaterialError;
use crate::number::{length, short};
use crate::scene::NoSuchPaddle;
use crate::scene::space::{FilePlace, SpaceScene};
use crate::solver::equilibrium::{Failure, FailureReason};
use std::fmt;

/// What the worst error estimate of a model is of.
#[derive(Debug, Clone, PartialEq)]
pub enum DecidedBy {
    /// The whole, or nobody knows.
    Whole,
    /// What the target does per depth of the needle.
    Displacement,
    /// The controllability measure of a paddle or pair.
    Measure {
        /// Indices of its paddles.
        paddles: Vec<u32>,
        /// Worst estimate of all else; none where there is nothing else.
        others: Option<f64>,
    },
}

impl DecidedBy {
    /// What decides among the estimated errors of sets of paddles, with what is known beside them.
    pub(crate) fn measures(sets: impl IntoIterator<Item = (Vec<u32>, f64)>, beside: Option<f64>) -> Self {
        let mut sets: Vec<_> = sets.into_iter().collect();
        sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut sets = sets.into_iter();
        let Some((paddles, worst)) = sets.next() else { return Self::Whole };
        if beside.is_some_and(|beside| beside >= worst) {
            return Self::Displacement;
        }
        let others = sets.next().map(|(_, error)| error).into_iter().chain(beside).reduce(f64::max);
        Self::Measure { paddles, others }
    }

    /// What else may be done where a single set of paddles is beyond a tolerance.
    fn alternative(&self, tolerance: f64) -> &'static str {
        match self {
            Self::Measure { paddles, others: Some(others) } if *others <= tolerance => match paddles[..] {
                [_] => {
                    ", leave that paddle out of the scene (it may hardly control the target: --spacing shows its measure)"
                }
                _ => ", leave that pair out of the scene",
            },
            _ => "",
        }
    }

    /// The same where estimates are told as multiples of what they were.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Measure { paddles, others } => Self::Measure { paddles, others: others.map(|error| factor * error) },
            other => other,
        }
    }
}

impl fmt::Display for DecidedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::Measure { paddles, others } = self else {
            let displacement = "of the target's displacement by the needle";
            return if *self == Self::Displacement { write!(f, " ({displacement})") } else { Ok(()) };
        };
        let named: Vec<_> = paddles.iter().map(u32::to_string).collect();
        write!(f, " (of the measure of paddle{} {}", if named.len() > 1 { "s" } else { "" }, named.join(" + "))?;
        others.map_or(Ok(()), |others| write!(f, "; {} of all else", estimate(others)))?;
        f.write_str(")")
    }
}

/// A relative error as it is told.
fn estimate(error: f64) -> String {
    if error.is_infinite() { "infinite".to_owned() } else { short(error) }
}

/// A rule that converges faster than the one that was asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faster {
    /// The rule.
    pub integration: Integration,
    /// Whether it is known to keep the tolerance.
    pub keeps: bool,
}

impl fmt::Display for Faster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = if self.keeps { "keeps it" } else { "converges faster" };
        write!(f, "--integration {}, which {what}", self.integration)
    }
}

/// Why a scene cannot be modelled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// Shape functions do not exist somewhere.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A body in space cannot be discretised.
    #[error(transparent)]
    Spatial(#[from] SpatialError),
    /// A body in space cannot be meshed.
    #[error("the body cannot be meshed: {0}")]
    Mesh(StuffingError),
    /// An inclusion between the nodes.
    #[error(
        "inclusion {number} is lost between the elements: it is too small or too thin for them; raise the level, lower the \
         spacing or tolerance, make it larger, or take it out"
    )]
    UnseenInclusion {
        /// Which one, from 1 in the scene's order.
        number: usize,
    },
    /// A part of the body that nothing holds.
    #[error(
        "a part of the body around {} hangs on nothing: neither the immobile part nor the needle holds it; join it to the rest, \
         take it out, or let [immobile] reach it",
        place(at)
    )]
    LoosePart {
        /// A point of it, length units.
        at: [f64; 3],
    },
    /// A region without any of the surface in it.
    #[error(
        "the region of the {part} catches no surface of the body{}: move it onto the surface, let it reach into the body, or \
         make it larger; where it does, take smaller elements",
        distance.map_or_else(String::new, |distance| format!(", which is about {} from it", short(distance)))
    )]
    NothingCaught {
        /// Whose region.
        part: BoundaryPart,
        /// How far it is from the surface, about, where it does not meet it; length units.
        distance: Option<f64>,
    },
    /// Two patches claim the same nodes.
    #[error(
        "the {part} touches the {other} at {}: tissue cannot follow both; move one of them or make it smaller",
        place(at)
    )]
    PatchesTouch {
        /// One of them.
        part: BoundaryPart,
        /// The other.
        other: BoundaryPart,
        /// A point of both, length units.
        at: [f64; 3],
    },
    /// What is wrong with a part of a scene in space, and where the scene's file has it.
    #[error("{place}: {error}")]
    InFile {
        /// Where.
        place: FilePlace,
        /// What: [`NothingCaught`](Self::NothingCaught), [`PatchesTouch`](Self::PatchesTouch),
        /// [`NothingConstrained`](Self::NothingConstrained), [`LoosePart`](Self::LoosePart) or
        /// [`UnseenInclusion`](Self::UnseenInclusion).
        error: Box<ModelError>,
    },
    /// The body cannot be discretised.
    #[error(transparent)]
    Discretization(#[from] DiscretizationError),
    /// The tangent at rest cannot be solved with, or a Jacobian cannot be computed.
    #[error(transparent)]
    Solve(#[from] Failure),
    /// A constrained feature has no node on it.
    #[error("no node lies on the {0}; refine the discretization")]
    NothingConstrained(BoundaryPart),
    /// The paddle cannot move the target orthogonally to the needle.
    #[error(
        "paddle {paddle}: the actuation Jacobian is singular (condition number {condition:.1e}): this paddle cannot control the target"
    )]
    Uncontrollable {
        /// Paddle index.
        paddle: u32,
        /// Condition number of the Jacobian.
        condition: f64,
    },
    /// None of the scene's paddles can move the target orthogonally to the needle.
    #[error("no paddle of this scene can control the target: move a paddle, turn the needle, or use one static")]
    NoPaddleControls,
    /// Paddles that are attached, and cannot move the target in every direction orthogonal to the needle.
    #[error(
        "these paddles cannot hold the target at depth {}: no displacement of theirs moves it in every direction orthogonal to the \
         needle; take others, or a pair",
        length(*depth)
    )]
    NotHeld {
        /// Depth, length units.
        depth: f64,
    },
    /// One paddle cannot be attached twice.
    #[error("paddle {index} is named twice: name another beside it, or it alone")]
    SamePaddle {
        /// Paddle index.
        index: u32,
    },
    /// A model of more nodes than are tried.
    #[error(
        "{nodes} nodes are needed, at most {limit} are tried: take a larger tolerance or spacing or a lower level, quadratic elements \
         (fem-t6, in space fem-t10) where it is another rule, or leave out what is much finer or thinner than the rest"
    )]
    TooManyNodes {
        /// Nodes it would take.
        nodes: usize,
        /// Nodes that are accepted.
        limit: usize,
    },
    /// Refinement ended before the tolerance.
    #[error(
        "tolerance {tolerance} was not reached on the nodes that are tried: the best estimate is {}{decided_by}{}; take a larger tolerance{}{}",
        estimate(*reached),
        memory.as_ref().map_or_else(String::new, |missing| format!("; a finer model did not fit into memory ({missing})")),
        decided_by.alternative(*tolerance),
        faster.as_ref().map_or_else(String::new, |faster| format!(", or {faster}"))
    )]
    ToleranceNotReached {
        /// Asked for.
        tolerance: f64,
        /// Best estimate.
        reached: f64,
        /// Whose it is.
        decided_by: DecidedBy,
        /// What a finer model had no memory for, where that was the end.
        memory: Option<Box<str>>,
        /// What may be asked for instead.
        faster: Option<Box<Faster>>,
    },
    /// A tolerance in space, where no two meshes could be compared.
    #[error(
        "no two meshes that differ on every patch can be afforded, so that nothing is known of errors: leave out details that are much finer than the patches, or give a level or spacing in [discretization]"
    )]
    NothingToCompare,
    /// The scene's resolution is a tolerance where nodes are needed.
    #[error("the resolution is a tolerance: refine to it with `placement::discretise`")]
    ToleranceIsNoResolution,
    /// A study with a model that is larger than is tried, or than there is memory for.
    #[error(
        "the study's model at spacing {} is too large, which would look like a failure of its method: take a larger --spacing, or, \
         where memory is short, --threads 1, so that one is in memory at a time ({detail})",
        short(*spacing)
    )]
    StudyTooLarge {
        /// Spacing of the model.
        spacing: f64,
        /// How much is missing.
        detail: String,
    },
    /// A study that varies the spacing of a scene that has none.
    #[error("the study varies a spacing: give one instead of a tolerance")]
    NoSpacing,
    /// No such paddle in the scene.
    #[error(transparent)]
    NoSuchPaddle(#[from] NoSuchPaddle),
    /// Nitsche's method for a needle that does not touch the boundary.
    #[error(
        "Nitsche's method holds boundary, and this needle contact is inside the body: use essential = \"transformation\""
    )]
    NitscheInside,
    /// Boundary values are imposed weakly where they have to be exact.
    #[error(
        "this needs nodal values that are imposed exactly, and the scene imposes them weakly: use essential = \"transformation\""
    )]
    ImposedWeakly,
    /// Nitsche's method on tissue that relaxes.
    #[error(
        "this tissue relaxes ([material.relaxation]), and its boundary values are imposed weakly: use essential = \"transformation\""
    )]
    RelaxesHeldWeakly,
    /// What is asked for is not known of a needle that slips.
    #[error(
        "this needle slips (mechanics = \"shaft\"), and placements, studies and reduced models are of a contact that moves with \
         the needle: use mechanics = \"patch\"; `solve`, `table`, `fit`, `compare` and `host-sim run` take it as it is"
    )]
    NeedleSlips,
    /// A law that was changed on the way is none.
    #[error(transparent)]
    Material(#[from] MaterialError),
}

impl From<StuffingError> for ModelError {
    fn from(error: StuffingError) -> Self {
        Self::Mesh(error)
    }
}

/// A point in words.
fn place(at: &[f64; 3]) -> String {
    let [x, y, z] = at.map(length);
    format!("({x}, {y}, {z})")
}

/// What kind of thing went wrong, by the name that results have for it.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ModelFailure {
    /// No equilibrium, or none that is stable.
    #[error("{0}")]
    Solve(FailureReason),
    /// Shape functions do not exist at a node.
    #[error("singular-moment-matrix")]
    SingularMomentMatrix,
    /// The nodes cannot be triangulated.
    #[error("no-triangulation")]
    NoTriangulation,
    /// A constrained feature has no node.
    #[error("nothing-constrained")]
    NothingConstrained,
    /// The paddle does not control the target, or none does.
    #[error("singular-jacobian")]
    SingularJacobian,
    /// The tolerance was not reached, or not with as many nodes as are tried.
    #[error("tolerance-not-reached")]
    ToleranceNotReached,
    /// What was asked for does not go together.
    #[error("unsupported")]
    Unsupported,
}

impl ModelError {
    /// What kind of thing went wrong.
    pub fn kind(&self) -> ModelFailure {
        match self {
            Self::Shape(_)
            | Self::Discretization(DiscretizationError::Shape(_))
            | Self::Spatial(SpatialError::Shape(_)) => ModelFailure::SingularMomentMatrix,
            Self::Discretization(DiscretizationError::Triangulation(_)) => ModelFailure::NoTriangulation,
            Self::Solve(failure) => ModelFailure::Solve(failure.reason),
            Self::NothingConstrained(_) => ModelFailure::NothingConstrained,
            Self::Uncontrollable { .. } | Self::NoPaddleControls | Self::NotHeld { .. } => {
                ModelFailure::SingularJacobian
            }
            Self::InFile { error, .. } => error.kind(),
            Self::StudyTooLarge { .. } => ModelFailure::Solve(FailureReason::TooLarge),
            Self::TooManyNodes { .. } | Self::ToleranceNotReached { .. } | Self::NothingToCompare => {
                ModelFailure::ToleranceNotReached
            }
            _ => ModelFailure::Unsupported,
        }
    }

    /// The error of a part of a scene with where the scene's file has that part; others as they are.
    pub(super) fn in_file(self, scene: &SpaceScene) -> Self {
        let parts = &scene.in_file;
        let place = match &self {
            Self::UnseenInclusion { number } => parts.inclusions.get(number - 1),
            Self::LoosePart { .. } => parts.immobile.first(),
            Self::NothingCaught { part, .. } | Self::PatchesTouch { part, .. } | Self::NothingConstrained(part) => {
                match part {
                    BoundaryPart::Immobile => parts.immobile.first(),
                    BoundaryPart::Needle => Some(&parts.needle),
                    BoundaryPart::Paddle(index) => parts.paddle(*index),
                }
            }
            _ => None,
        };
        self.at(place.cloned())
    }

    /// The error with this place of a file, if there is one.
    pub(super) fn at(self, place: Option<FilePlace>) -> Self {
        match place {
            Some(place) => Self::InFile { place, error: Box::new(self) },
            None => self,
        }
    }

    /// Whether a model is larger than is tried, or than there is memory for: a coarser one may do.
    pub fn is_too_large(&self) -> bool {
        let too_large = FailureReason::TooLarge;
        matches!(self, Self::TooManyNodes { .. }) || matches!(self, Self::Solve(failure) if failure.reason == too_large)
    }

    /// What there was no memory for; none of another error.
    pub(crate) fn missing_memory(&self) -> Option<Box<str>> {
        match self {
            Self::Solve(Failure { reason: FailureReason::TooLarge, detail, .. }) => Some(detail.as_str().into()),
            _ => None,
        }
    }

    /// Whether it is the question that was wrong, and not a computation that failed.
    pub fn is_usage(&self) -> bool {
        if let Self::InFile { error, .. } = self {
            return error.is_usage();
        }
        matches!(
            self,
            Self::ToleranceIsNoResolution
                | Self::NoSpacing
                | Self::NoSuchPaddle(_)
                | Self::SamePaddle { .. }
                | Self::NitscheInside
                | Self::ImposedWeakly
                | Self::RelaxesHeldWeakly
                | Self::NeedleSlips
                | Self::PatchesTouch { .. }
                | Self::NothingCaught { .. }
                | Self::LoosePart { .. }
                | Self::Spatial(SpatialError::Planar(_))
                | Self::Material(_)
        )
    }
}

/// A part of the boundary on which displacements are prescribed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::Display)]
pub enum BoundaryPart {
    /// What does not move.
    #[strum(to_string = "immobile part")]
    Immobile,
    /// Where the needle pushes.
    #[strum(to_string = "needle contact")]
    Needle,
    /// Where the paddle of this index is attached.
    #[strum(to_string = "paddle {0}")]
    Paddle(u32),
}
