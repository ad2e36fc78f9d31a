//! What is attached to the tissue of a world, and what becomes of it.

use firmware::contract::Table;
use model_offline::model::TissueModel;
use model_offline::parallel;
use model_offline::reduction::TrainingOptions;
use nalgebra::Vector2;

use crate::world::needle::NeedleTrajectory;

/// What is attached to a body, and what becomes of it: all that a reduced model of the body depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Place of the paddle in the scene's list; none without one.
    pub paddle: Option<usize>,
    /// Whether it stays where it rests. A reduced model needs to know nothing else then.
    pub held: bool,
    /// Whether a loop so fast asks for it that a step must take no longer than its accuracy needs.
    pub fast: bool,
}

/// From this rate on a loop is fast, Hz: a reduced model of as many modes as there may be takes up to 65 µs a step.
const FAST: f64 = 5000.0;

impl Attachment {
    /// A paddle that moves.
    pub const fn moved(paddle: Option<usize>) -> Self {
        Self { paddle, held: false, fast: false }
    }

    /// A paddle that does not.
    pub const fn held(paddle: Option<usize>) -> Self {
        Self { paddle, held: true, fast: false }
    }

    /// The same for a loop of this rate, Hz.
    pub(in crate::world) fn at_rate(self, rate: f64) -> Self {
        Self { fast: rate > FAST, ..self }
    }

    /// To the scene's own accuracy, or better where there is time for it, on all threads: the result does not depend on how many there are.
    pub(super) fn training(self, model: &TissueModel) -> TrainingOptions {
        let options = TrainingOptions { threads: parallel::available(), ..TrainingOptions::of(model.scene()) };
        let options = if self.fast { TrainingOptions { aim: options.tolerance, ..options } } else { options };
        if self.held { TrainingOptions { paddle: Some(0.0), ..options } } else { options }
    }
}

/// One insertion.
#[derive(Clone, Debug, PartialEq)]
pub struct Insertion {
    /// How the needle goes.
    pub trajectory: NeedleTrajectory,
    /// Seconds from its start to the end.
    pub duration_s: f64,
    /// Where the paddle is planned to be.
    pub plan: PaddlePlan,
}

/// What is attached to the tissue of a world, and what becomes of it.
#[derive(Clone, Copy, Debug)]
pub enum AttachedPaddle<'t> {
    /// Nothing.
    None,
    /// The paddle of this index, which stays where it rests.
    Held(u32),
    /// The paddle of this index, which moves nobody knows where to.
    Moved(u32),
    /// A table's paddle, which moves as it plans, and as a controller corrects it.
    Steered(&'t Table<f64, 2>),
}

impl AttachedPaddle<'_> {
    /// Its index.
    pub fn index(&self) -> Option<u32> {
        match self {
            Self::None => None,
            Self::Held(index) | Self::Moved(index) => Some(*index),
            Self::Steered(table) => Some(table.paddles[0].index),
        }
    }

    pub(in crate::world) fn attachment(&self, position: Option<usize>) -> Attachment {
        match self {
            Self::None | Self::Held(_) => Attachment::held(position),
            Self::Moved(_) | Self::Steered(_) => Attachment::moved(position),
        }
    }

    pub(in crate::world) fn plan(&self) -> PaddlePlan {
        match self {
            Self::Steered(table) => PaddlePlan::of(table),
            _ => PaddlePlan::default(),
        }
    }
}

/// Where a paddle is planned to be along the depth; nowhere else than at rest by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PaddlePlan(Vec<(f64, Vector2<f64>)>);

impl PaddlePlan {
    /// A table's feed-forward path.
    pub fn of(table: &Table<f64, 2>) -> Self {
        Self(table.knots.iter().map(|knot| (knot.depth, knot.paddle_path)).collect())
    }

    /// At a depth, length; its ends are held.
    pub(super) fn at(&self, depth: f64) -> Vector2<f64> {
        let after = self.0.partition_point(|(knot, _)| *knot <= depth);
        match (after.checked_sub(1).map(|before| self.0[before]), self.0.get(after)) {
            (None, None) => Vector2::zeros(),
            (None, Some((_, only))) => *only,
            (Some((_, only)), None) => only,
            (Some((from, a)), Some((to, b))) => a + (b - a) * ((depth - from) / (to - from)),
        }
    }
}
