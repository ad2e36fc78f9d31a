//! What a controller remembers from tick to tick.

use nalgebra::SVector;

use super::D;
use crate::contract::{Faults, Mode, NeedleSample, PaddleSample, TargetSample};
use crate::detection::MAX_SUCCESSIVE_OVERRUNS;
use crate::inputs::monitors::{DivergenceMonitor, FollowingMonitor, FrozenMonitor, FrozenPaddle, InnovationGate};
use crate::inputs::stream::Stream;
use crate::inputs::supervisor::Supervisor;
use crate::inputs::{Inputs, Ledger};
use crate::scalar::Scalar;

/// Everything that changes from tick to tick. Equal states and inputs give equal commands, bit by bit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State<T: Scalar> {
    pub(super) supervisor: Supervisor,
    pub(super) mode: Mode,
    pub(super) faults: Faults,
    pub(super) ledger: Ledger,
    /// Tick number and time of the last tick, ns.
    pub(super) last_tick: Option<(u64, u64)>,
    pub(super) successive_overruns: u32,
    pub(super) command_sequence: u32,
    /// RUN has been reached since the start or the last re-arming; ages lead to SAFE from then on.
    pub(super) armed: bool,
    /// Last displacement commanded; `None` until the measured position has been adopted.
    pub(super) displacement: Option<SVector<T, D>>,
    /// Integral of the feedback; `None` until the first tick in RUN makes it continue from the adopted position.
    pub(super) integral: Option<SVector<T, D>>,
    /// The last motion at full rate.
    pub(super) underway: Option<Underway<T>>,
    pub(super) needle: Stream<NeedleSample>,
    pub(super) target: Stream<TargetSample>,
    pub(super) paddle: Stream<PaddleSample>,
    pub(super) target_lost: bool,
    pub(super) needle_frozen: FrozenMonitor,
    pub(super) target_frozen: FrozenMonitor,
    pub(super) paddle_frozen: FrozenPaddle,
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

    /// Integral part of the command, length; `None` before RUN.
    pub fn integral(&self) -> Option<[f64; 2]> {
        self.integral.as_ref().map(to_frame)
    }

    /// Leaves SAFE after somebody has looked: accounts go on, everything else starts over. The next command adopts
    /// the paddle's measured position.
    pub fn rearm(&mut self) {
        *self = Self {
            ledger: self.ledger,
            last_tick: self.last_tick,
            command_sequence: self.command_sequence,
            ..Self::default()
        };
    }
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

/// Enters the tick into the accounts and checks that time goes on. A tick from the past is rejected: nothing of it
/// is read.
pub(super) fn start_tick<T: Scalar>(state: &mut State<T>, inputs: &Inputs, faults: &mut Faults) -> bool {
    let Some((tick, time_ns)) = state.last_tick else {
        state.ledger.ticks.start(0);
        state.last_tick = Some((inputs.tick, inputs.time_ns));
        return true;
    };
    let skipped = inputs.tick.saturating_sub(tick).saturating_sub(1);
    state.ledger.ticks.start(skipped);
    if inputs.tick <= tick || inputs.time_ns < time_ns {
        // A number that went on is used up all the same: the next tick must not count it as skipped.
        state.last_tick = Some((inputs.tick.max(tick), time_ns));
        *faults |= Faults::CLOCK_REVERSED;
        return false;
    }
    state.last_tick = Some((inputs.tick, inputs.time_ns));
    state.successive_overruns = if skipped > 0 { state.successive_overruns.saturating_add(1) } else { 0 };
    faults.set_if(Faults::TICKS_SKIPPED, skipped > 0);
    faults.set_if(Faults::OVERRUN, state.successive_overruns >= MAX_SUCCESSIVE_OVERRUNS);
    true
}

pub(super) fn to_frame<T: Scalar>(vector: &SVector<T, D>) -> [f64; D] {
    [vector.x.to_f64(), vector.y.to_f64()]
}

pub(super) fn from_frame<T: Scalar>(components: &[f64; D]) -> SVector<T, D> {
    SVector::from(components.map(T::of))
}
