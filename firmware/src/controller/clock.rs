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
    pub(super) fn start<T: Scalar, const P: usize>(
        &mut self,
        runtime: &Runtime<T, P>,
        inputs: &Inputs,
        ledger: &mut TickLedger,
        faults: &mut Faults,
    ) -> Option<u64> {
        let slack_ns = runtime.needle_age.safe_ns;
        let ticks = self.tick.map_or(1, |tick| inputs.tick.saturating_sub(tick));
        // A product of 64 bits is a loop of its own on a microcontroller.
        let due_ns = if ticks == 1 { runtime.loop_period_ns } else { ticks.saturating_mul(runtime.loop_period_ns) };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::example::table;
    use crate::settings::Settings;

    const MS: u64 = 1_000_000;

    /// A clock, its accounts, and what became of a tick: time since the last one, faults, skipped, due.
    struct Ticks {
        runtime: Runtime<f64>,
        clock: Clock,
        ledger: TickLedger,
    }

    impl Ticks {
        fn new() -> Self {
            let runtime = Runtime::new(&table(), &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
            Self { runtime, clock: Clock::default(), ledger: TickLedger::default() }
        }

        fn start(&mut self, tick: u64, time_ns: u64) -> (Option<u64>, Faults, u64, u64) {
            let mut faults = Faults::NONE;
            let inputs = Inputs { tick, time_ns, ..Inputs::default() };
            let before = self.ledger;
            let elapsed = self.clock.start(&self.runtime, &inputs, &mut self.ledger, &mut faults);
            (elapsed, faults, self.ledger.skipped - before.skipped, self.ledger.due - before.due)
        }
    }

    #[test]
    fn ticks_in_step_are_believed_and_skipped_ones_counted() {
        let mut ticks = Ticks::new();
        assert_eq!(ticks.start(7, 100 * MS), (Some(MS), Faults::NONE, 0, 1), "the first may be any");
        assert_eq!(ticks.clock.now_ns(), Some(100 * MS));
        assert_eq!(ticks.start(8, 101 * MS + 3), (Some(MS + 3), Faults::NONE, 0, 1));
        assert_eq!(ticks.start(11, 104 * MS), (Some(3 * MS - 3), Faults::TICKS_SKIPPED, 2, 3));
        assert_eq!(ticks.clock.now_ns(), Some(104 * MS));
    }

    #[test]
    fn time_and_numbers_may_differ_by_a_quarter_of_a_second() {
        let slack = 250 * MS;
        for (time_ns, fault) in [
            (MS + slack, Faults::NONE),
            (MS + slack + 1, Faults::CLOCK_JUMPED),
            (1 << 63, Faults::CLOCK_JUMPED),
            (u64::MAX, Faults::CLOCK_JUMPED),
        ] {
            let mut ticks = Ticks::new();
            ticks.start(0, 0);
            let (elapsed, faults, ..) = ticks.start(1, time_ns);
            assert_eq!((elapsed.is_some(), faults), (fault.is_empty(), fault), "{time_ns}");
            // What was rejected has moved nothing.
            let expected = if fault.is_empty() { time_ns } else { 0 };
            assert_eq!(ticks.clock.now_ns(), Some(expected));
        }
        for (tick, skipped, fault) in
            [(251, 250, Faults::TICKS_SKIPPED), (252, 0, Faults::CLOCK_JUMPED), (1 << 63, 0, Faults::CLOCK_JUMPED)]
        {
            let mut ticks = Ticks::new();
            ticks.start(0, 0);
            assert_eq!(ticks.start(tick, MS), ((skipped > 0).then_some(MS), fault, skipped, skipped + 1), "{tick}");
        }
    }

    #[test]
    fn a_rejected_tick_uses_up_its_number_if_that_can_be() {
        let mut ticks = Ticks::new();
        ticks.start(0, 10 * MS);
        assert_eq!(ticks.start(1, 10 * MS), (None, Faults::CLOCK_REVERSED, 0, 1), "time stands");
        assert_eq!(ticks.start(2, 5 * MS), (None, Faults::CLOCK_REVERSED, 0, 1), "time goes back");
        assert_eq!(ticks.start(5, 5 * MS), (None, Faults::CLOCK_REVERSED, 2, 3), "and numbers go on");
        assert_eq!(ticks.start(6, 11 * MS), (Some(MS), Faults::NONE, 0, 1));
        assert_eq!(ticks.start(6, 12 * MS), (None, Faults::CLOCK_REVERSED, 0, 1), "the number stands");
        assert_eq!(ticks.start(3, 12 * MS), (None, Faults::CLOCK_REVERSED, 0, 1), "the number goes back");
        assert_eq!(ticks.start(1_000_000, 9 * MS), (None, Faults::CLOCK_REVERSED, 0, 1), "a number from nowhere");
        assert_eq!(ticks.start(256, 9 * MS), (None, Faults::CLOCK_REVERSED, 249, 250), "the last one that can be");
        assert_eq!(ticks.start(257, 12 * MS), (Some(MS), Faults::NONE, 0, 1));
    }

    #[test]
    fn after_rearming_any_clock_is_believed() {
        let mut ticks = Ticks::new();
        ticks.start(100, 100 * MS);
        ticks.clock = ticks.clock.rearmed();
        assert_eq!(ticks.clock.now_ns(), None);
        assert_eq!(ticks.start(103, 7), (Some(MS), Faults::TICKS_SKIPPED, 2, 3));
        ticks.clock = ticks.clock.rearmed();
        assert_eq!(ticks.start(1 << 62, 1 << 62), (Some(MS), Faults::NONE, 0, 1));
        ticks.clock = ticks.clock.rearmed();
        assert_eq!(ticks.start(3, 3 * MS), (Some(MS), Faults::NONE, 0, 1));
        assert_eq!(ticks.start(4, 4 * MS), (Some(MS), Faults::NONE, 0, 1));
    }

    #[test]
    fn ten_skips_in_a_row_are_too_many() {
        let mut ticks = Ticks::new();
        ticks.start(0, 0);
        let overrun = |ticks: &mut Ticks, i: u64| ticks.start(2 * i, 2 * i * MS).1.contains(Faults::OVERRUN);
        let found: std::vec::Vec<bool> = (1..=11).map(|i| overrun(&mut ticks, i)).collect();
        assert_eq!(found.iter().position(|found| *found), Some(9));
    }
}
