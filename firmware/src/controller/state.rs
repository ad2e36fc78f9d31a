//! What a controller remembers from tick to tick.

use nalgebra::{ArrayStorage, SMatrix, SVector};

use super::clock::Clock;
use super::history::History;
use crate::contract::frames::{MAX_DIMENSION, MAX_PADDLES};
use crate::contract::{Faults, Mode};
use crate::inputs::Ledger;
use crate::inputs::monitors::{
    DivergenceMonitor, FollowingMonitor, FrozenMonitor, InnovationGate, NeedleMonitor, RestMonitor, SensorStep,
};
use crate::inputs::stream::StreamGate;
use crate::inputs::supervisor::Supervisor;
use crate::observer::Observer;
use crate::scalar::Scalar;

/// Everything that changes from tick to tick. Equal states and inputs give equal commands, bit by bit.
#[derive(Clone, Debug, PartialEq)]
pub struct State<T: Scalar, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    pub(super) supervisor: Supervisor,
    pub(super) mode: Mode,
    pub(super) faults: Faults,
    pub(super) ledger: Ledger,
    pub(super) clock: Clock,
    pub(super) command_sequence: u32,
    /// RUN has been reached since the start or the last re-arming; ages lead to SAFE from then on.
    pub(super) armed: bool,
    /// What the feedback adds; `None` until the first tick in RUN makes it continue from the adopted positions.
    pub(super) added: Option<Added<T, D, P>>,
    /// What the observer knows; `None` until the first tick in RUN, and without one.
    pub(super) estimate: Option<Estimate<T, N>>,
    /// Where needle and paddles were.
    pub(super) history: History<T, D, P>,
    /// The last motion at full rate.
    pub(super) underway: Option<Underway<T, D, P>>,
    pub(super) needle: StreamGate,
    pub(super) target: StreamGate<D>,
    pub(super) target_lost: bool,
    pub(super) needle_monitor: NeedleMonitor,
    pub(super) target_frozen: FrozenMonitor<D>,
    pub(super) target_resolution: SensorStep,
    pub(super) gate: InnovationGate<D, P>,
    pub(super) divergence: DivergenceMonitor,
    pub(super) paddles: [PaddleState<T, D>; P],
}

/// What is remembered of one paddle.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PaddleState<T: Scalar, const D: usize> {
    /// Last displacement commanded; `None` until the measured position has been adopted.
    pub(super) displacement: Option<SVector<T, D>>,
    pub(super) stream: StreamGate<D>,
    pub(super) frozen: FrozenMonitor<D>,
    pub(super) rest: RestMonitor<D>,
    pub(super) following: FollowingMonitor,
}

impl<T: Scalar, const D: usize> PaddleState<T, D> {
    /// The paddle's position is no longer known. Before RUN only, so that no feedback continues from it.
    pub(super) fn forget_position(&mut self) {
        self.displacement = None;
        self.rest = RestMonitor::default();
    }
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Default for State<T, D, N, P> {
    #[inline(never)] // Written where it is to be, not put together on the way.
    fn default() -> Self {
        Self {
            supervisor: Supervisor::default(),
            mode: Mode::default(),
            faults: Faults::NONE,
            ledger: Ledger::default(),
            clock: Clock::default(),
            command_sequence: 0,
            armed: false,
            added: None,
            estimate: None,
            history: History::default(),
            underway: None,
            needle: StreamGate::default(),
            target: StreamGate::default(),
            target_lost: false,
            needle_monitor: NeedleMonitor::default(),
            target_frozen: FrozenMonitor::default(),
            target_resolution: SensorStep::default(),
            gate: InnovationGate::default(),
            divergence: DivergenceMonitor::default(),
            paddles: core::array::from_fn(|_| PaddleState::default()),
        }
    }
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> State<T, D, N, P> {
    /// The state before the first tick: HOLD, disarmed.
    pub fn new() -> Self {
        Self::default()
    }

    /// Mode after the last tick.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Faults of the last tick, and those that SAFE was entered for.
    pub fn faults(&self) -> Faults {
        self.faults
    }

    /// All accounts.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// What the feedback adds to the feed-forward since the last sample that it used, length, as commands have it; `None`
    /// before RUN.
    pub fn integral(&self) -> Option<[[f64; MAX_DIMENSION]; MAX_PADDLES]> {
        self.added.map(|added| to_frame(&added.at_sample))
    }

    /// What the feedback added to the feed-forward at the last tick in RUN, length, as commands have it: the depth may have
    /// changed it since the last sample. `None` before RUN.
    pub fn added(&self) -> Option<[[f64; MAX_DIMENSION]; MAX_PADDLES]> {
        self.added.map(|added| to_frame(&added.now))
    }

    /// Last displacements commanded, a column per paddle; `None` until every measured position has been adopted.
    #[inline(always)]
    pub(super) fn displacement(&self) -> Option<SMatrix<T, D, P>> {
        let mut columns = [[T::ZERO; D]; P];
        for (column, paddle) in columns.iter_mut().zip(&self.paddles) {
            *column = paddle.displacement?.into();
        }
        Some(of_columns(columns))
    }

    /// Leaves SAFE after somebody has looked: accounts go on, everything else starts over, and the paddles' measured
    /// positions are adopted once more. Does nothing in any other mode.
    #[inline(never)] // The loop's stack does not carry the new state.
    pub fn rearm(&mut self) {
        if self.mode != Mode::Safe {
            return;
        }
        let Self {
            supervisor,
            mode,
            faults,
            ledger: _,
            clock,
            command_sequence: _,
            armed,
            added,
            estimate,
            history,
            underway,
            needle,
            target,
            target_lost,
            needle_monitor,
            target_frozen,
            target_resolution,
            gate,
            divergence,
            paddles,
        } = self;
        *clock = clock.rearmed();
        // Piece by piece: a whole new state would be on the stack until it is moved here.
        *supervisor = Supervisor::default();
        (*mode, *faults, *armed) = (Mode::default(), Faults::NONE, false);
        (*added, *estimate, *underway) = (None, None, None);
        *history = History::default();
        *needle = StreamGate::default();
        *target = StreamGate::default();
        *target_lost = false;
        *needle_monitor = NeedleMonitor::default();
        *target_frozen = FrozenMonitor::default();
        *target_resolution = SensorStep::default();
        *gate = InnovationGate::default();
        *divergence = DivergenceMonitor::default();
        for paddle in paddles {
            *paddle = PaddleState::default();
        }
    }
}

/// What the feedback adds to the feed-forward, length; a column per paddle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Added<T: Scalar, const D: usize = 2, const P: usize = 1> {
    /// At the last tick in RUN.
    pub(super) now: SMatrix<T, D, P>,
    /// At the last sample that it used.
    pub(super) at_sample: SMatrix<T, D, P>,
}

/// What the observer knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate<T: Scalar, const N: usize = 1> {
    /// One for each direction orthogonal to the needle: what the table leaves there has nothing to do with the others.
    pub(super) observers: [Observer<T>; N],
    /// Time of the last sample, ns.
    pub(super) time_ns: u64,
}

/// A motion at full rate: longer than the delay that the gain was chosen for knows of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Underway<T: Scalar, const D: usize = 2, const P: usize = 1> {
    /// First tick of it, ns.
    pub(super) since_ns: u64,
    /// When its last step shows, ns.
    pub(super) until_ns: u64,
    /// Its last step, length.
    pub(super) step: SMatrix<T, D, P>,
}

impl<T: Scalar, const D: usize, const P: usize> Underway<T, D, P> {
    /// Whether what was measured at `time_ns` shows a part of this motion only, and `correction` asks for the rest of it
    /// once more.
    pub(super) fn explains(&self, time_ns: u64, correction: &SMatrix<T, D, P>) -> bool {
        self.since_ns < time_ns && time_ns < self.until_ns && self.step.dot(correction) > T::zero()
    }
}

/// Displacements as commands have them: a component or a paddle that does not exist is 0.
#[inline(always)]
pub(super) fn to_frame<T: Scalar, const D: usize, const P: usize>(
    displacements: &SMatrix<T, D, P>,
) -> [[f64; MAX_DIMENSION]; MAX_PADDLES] {
    let component = |paddle: usize, axis: usize| {
        columns(displacements).get(paddle).and_then(|column| column.get(axis)).map_or(0.0, |value| value.to_f64())
    };
    // Written out, so that every place is known when this is compiled: clearing all of them before filling some takes longer.
    let paddle = |paddle: usize| [component(paddle, 0), component(paddle, 1), component(paddle, 2)];
    [paddle(0), paddle(1)]
}

/// A vector as measurements have it.
pub(super) fn to_components<T: Scalar, const D: usize>(vector: &SVector<T, D>) -> [f64; D] {
    let components: [T; D] = (*vector).into();
    components.map(T::to_f64)
}

/// A vector of what was measured.
pub(super) fn from_components<T: Scalar, const D: usize>(components: &[f64; D]) -> SVector<T, D> {
    SVector::from(components.map(T::of))
}

/// The columns of a matrix, as arrays: their number is known when this is compiled, so that nothing can be out of bounds.
#[inline(always)]
pub(super) const fn columns<T, const R: usize, const C: usize>(matrix: &SMatrix<T, R, C>) -> &[[T; R]; C] {
    &matrix.data.0
}

/// The matrix with these columns.
#[inline(always)]
pub(super) fn of_columns<T: Scalar, const R: usize, const C: usize>(columns: [[T; R]; C]) -> SMatrix<T, R, C> {
    SMatrix::from_array_storage(ArrayStorage(columns))
}
