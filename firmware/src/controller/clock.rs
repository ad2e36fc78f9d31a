//! The controller's own view of time: ticks must go on, and in step with their numbers.

use crate::contract::Faults;
use crate::detection::MAX_SUCCESSIVE_OVERRUNS;
use crate::inputs::Inputs;
use crate::inputs::ledger::TickLedger;
use crate::inputs::monitors::LeakyBucket;
use crate::scalar::Scalar;
use crate::settings::Runtime;

/// Number and time of the last tick that was believed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Clock {
    tick: Option<u64>,
    /// `None` before the first tick, and after re-arming: whoever has looked has the clock looked at, too.
    time_ns: Option<u64>,
    skips: LeakyBucket,
}

impl Clock {
    /// Time of the last tick, ns.
    pub(super) fn now_ns(&self) -> Option<u64> {
        self.time_ns
    }

    /// The clock after re-arming.
    pub(super) fn rearmed(&self) -> Self {
        Self { tick: self.tick, ..Self::default() }
    }

    /// Enters a tick into the accounts. Returns the time since the tick before, ns (one period for the first), or `None`
    /// for a tick that is rejected: nothing of it is to be read.
    ///
    /// Time must go on, and by as much as the numbers do: otherwise a single tick from the far future would make every
    /// right one after it a tick from the past.
    pub(super) fn start<T: Scalar>(
        &mut self,
        runtime: &Runtime<T>,
        inputs: &Inputs,
        ledger: &mut TickLedger,
        faults: &mut Faults,
    ) -> Option<u64> {
        let slack_ns = runtime.needle_age.safe_ns;
        let ticks = self.tick.map_or(1, |tick| inputs.tick.saturating_sub(tick));
        let due_ns = ticks.saturating_mul(runtime.loop_period_ns);
        let Some(time_ns) = self.time_ns else {
            let skipped = if due_ns <= slack_ns { ticks.saturating_sub(1) } else { 0 };
            self.believe(inputs, skipped, ledger, faults);
            return Some(runtime.loop_period_ns);
        };
        let elapsed_ns = inputs.time_ns.saturating_sub(time_ns);
        let fault = if ticks == 0 || elapsed_ns == 0 {
            Faults::CLOCK_REVERSED
        } else if elapsed_ns.abs_diff(due_ns) > slack_ns {
            Faults::CLOCK_JUMPED
        } else {
            self.believe(inputs, ticks - 1, ledger, faults);
            return Some(elapsed_ns);
        };
        *faults |= fault;
        // A number that went on is used up all the same: the next tick must not count it as skipped.
        let used_up = ticks > 0 && due_ns <= slack_ns;
        ledger.start(if used_up { ticks - 1 } else { 0 });
        if used_up {
            self.tick = Some(inputs.tick);
        }
        None
    }

    fn believe(&mut self, inputs: &Inputs, skipped: u64, ledger: &mut TickLedger, faults: &mut Faults) {
        ledger.start(skipped);
        (self.tick, self.time_ns) = (Some(inputs.tick), Some(inputs.time_ns));
        faults.set_if(Faults::TICKS_SKIPPED, skipped > 0);
        faults.set_if(Faults::OVERRUN, self.skips.enter(skipped > 0, MAX_SUCCESSIVE_OVERRUNS));
    }
}
