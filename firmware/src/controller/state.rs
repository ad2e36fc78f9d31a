//! What a controller remembers from tick to tick.

use nalgebra::SVector;

use super::D;
use super::clock::Clock;
use super::history::History;
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State<T: Scalar> {
    pub(super) supervisor: Supervisor,
    pub(super) mode: Mode,
    pub(super) faults: Faults,
    pub(super) ledger: Ledger,
    pub(super) clock: Clock,
    pub(super) command_sequence: u32,
    /// RUN has been reached since the start or the last re-arming; ages lead to SAFE from then on.
    pub(super) armed: bool,
    /// Last displacement commanded; `None` until the measured position has been adopted.
    pub(super) displacement: Option<SVector<T, D>>,
    /// What the feedback adds; `None` until the first tick in RUN makes it continue from the adopted position.
    pub(super) added: Option<Added<T>>,
    /// What the observer knows; `None` until the first tick in RUN, and without one.
    pub(super) estimate: Option<Estimate<T>>,
    /// Where needle and paddle were.
    pub(super) history: History<T>,
    /// The last motion at full rate.
    pub(super) underway: Option<Underway<T>>,
    pub(super) needle: StreamGate,
    pub(super) target: StreamGate,
    pub(super) paddle: StreamGate,
    pub(super) target_lost: bool,
    pub(super) needle_monitor: NeedleMonitor,
    pub(super) target_frozen: FrozenMonitor,
    pub(super) target_resolution: SensorStep,
    pub(super) paddle_frozen: FrozenMonitor,
    pub(super) rest: RestMonitor,
    pub(super) gate: InnovationGate,
    pub(super) following: FollowingMonitor,
    pub(super) divergence: DivergenceMonitor,
}

impl<T: Scalar> State<T> {
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

    /// What the feedback adds to the feed-forward since the last sample that it used, length; `None` before RUN.
    pub fn integral(&self) -> Option<[f64; 2]> {
        self.added.map(|added| to_frame(&added.at_sample))
    }

    /// What the feedback added to the feed-forward at the last tick in RUN, length: the depth may have changed it since the
    /// last sample. `None` before RUN.
    pub fn added(&self) -> Option<[f64; 2]> {
        self.added.map(|added| to_frame(&added.now))
    }

    /// The paddle's position is no longer known.
    pub(super) fn forget_position(&mut self) {
        (self.displacement, self.added, self.estimate) = (None, None, None);
        self.rest = RestMonitor::default();
    }

    /// Leaves SAFE after somebody has looked: accounts go on, everything else starts over, and the paddle's measured
    /// position is adopted once more. Does nothing in any other mode.
    #[inline(never)] // The loop's stack does not carry the new state.
    pub fn rearm(&mut self) {
        if self.mode != Mode::Safe {
            return;
        }
        *self = Self {
            ledger: self.ledger,
            clock: self.clock.rearmed(),
            command_sequence: self.command_sequence,
            ..Self::default()
        };
    }
}

/// What the feedback adds to the feed-forward, length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Added<T: Scalar> {
    /// At the last tick in RUN.
    pub(super) now: SVector<T, D>,
    /// At the last sample that it used.
    pub(super) at_sample: SVector<T, D>,
}

/// What the observer knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate<T: Scalar> {
    pub(super) observer: Observer<T>,
    /// Time of the last sample, ns.
    pub(super) time_ns: u64,
}

/// A motion at full rate: longer than the delay that the gain was chosen for knows of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Underway<T: Scalar> {
    /// First tick of it, ns.
    pub(super) since_ns: u64,
    /// When its last step shows, ns.
    pub(super) until_ns: u64,
    /// Its last step, length.
    pub(super) step: SVector<T, D>,
}

impl<T: Scalar> Underway<T> {
    /// Whether what was measured at `time_ns` shows a part of this motion only, and `correction` asks for the rest of it
    /// once more.
    pub(super) fn explains(&self, time_ns: u64, correction: &SVector<T, D>) -> bool {
        self.since_ns < time_ns && time_ns < self.until_ns && self.step.dot(correction) > T::zero()
    }
}

pub(super) fn to_frame<T: Scalar>(vector: &SVector<T, D>) -> [f64; D] {
    [vector.x.to_f64(), vector.y.to_f64()]
}

pub(super) fn from_frame<T: Scalar>(components: &[f64; D]) -> SVector<T, D> {
    SVector::from(components.map(T::of))
}
