//! What a controller remembers from tick to tick.

use nalgebra::SVector;

use super::D;
use crate::contract::{NeedleSample, PaddleSample, TargetSample};
use crate::inputs::{Inputs, Stream};
use crate::ledger::Ledger;
use crate::monitor::{DivergenceMonitor, FollowingMonitor, FrozenMonitor, InnovationGate};
use crate::scalar::Scalar;
use crate::supervisor::{Faults, Mode, Supervisor};

/// Successive ticks with skipped periods before them that are tolerated: a loop that skips every second period no
/// longer runs at the rate that its gain was chosen for.
pub const MAX_SUCCESSIVE_OVERRUNS: u32 = 10;

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
    pub(super) needle: Stream<NeedleSample>,
    pub(super) target: Stream<TargetSample>,
    pub(super) paddle: Stream<PaddleSample>,
    pub(super) target_lost: bool,
    pub(super) needle_frozen: FrozenMonitor,
    pub(super) target_frozen: FrozenMonitor,
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

/// Enters the tick into the accounts and checks that time goes on. A tick from the past is rejected: nothing of it
/// is read.
pub(super) fn start_tick<T: Scalar>(state: &mut State<T>, inputs: &Inputs, faults: &mut Faults) -> bool {
    let Some((tick, time_ns)) = state.last_tick else {
        state.ledger.ticks.start(0);
        state.last_tick = Some((inputs.tick, inputs.time_ns));
        return true;
    };
    if inputs.tick <= tick || inputs.time_ns < time_ns {
        state.ledger.ticks.start(0);
        *faults |= Faults::CLOCK_REVERSED;
        return false;
    }
    let skipped = inputs.tick - tick - 1;
    state.ledger.ticks.start(skipped);
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
