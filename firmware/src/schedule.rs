//! When the loop runs: absolute releases, overruns, timing in integers.
//!
//! The next release is the previous one plus the period, never "now plus the period": nothing drifts. When the next
//! release is already past at the end of a step, whole periods are skipped and counted, and the loop goes on in its
//! old phase. It never runs twice to catch up.

use core::num::NonZeroU64;

/// `dividend / divisor`, bit by bit: the compiler's division of 64 bits would take 0.9 KB of a microcontroller's flash.
/// As many rounds as the quotient has bits, usually none.
pub(crate) const fn quotient(dividend: u64, divisor: NonZeroU64) -> u64 {
    let (mut quotient, mut rest) = (0, dividend);
    let mut bit = (divisor.leading_zeros() + 1).saturating_sub(dividend.leading_zeros());
    while bit > 0 {
        bit -= 1;
        if rest >> bit >= divisor.get() {
            rest -= divisor.get() << bit;
            quotient |= 1 << bit;
        }
    }
    quotient
}

/// Minimum, maximum and mean of a duration, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DurationStatistics {
    /// Number of values.
    pub count: u64,
    /// Smallest value, ns; 0 without values.
    pub min_ns: u64,
    /// Largest value, ns.
    pub max_ns: u64,
    /// Sum of values, ns (saturating: full after 584 years).
    pub sum_ns: u64,
}

impl DurationStatistics {
    /// Adds a value.
    pub fn record(&mut self, duration_ns: u64) {
        self.min_ns = if self.count == 0 { duration_ns } else { self.min_ns.min(duration_ns) };
        self.max_ns = self.max_ns.max(duration_ns);
        self.sum_ns = self.sum_ns.saturating_add(duration_ns);
        self.count += 1;
    }

    /// Mean, ns, rounded down; 0 without values.
    pub const fn mean_ns(&self) -> u64 {
        match self.sum_ns.checked_div(self.count) {
            Some(mean) => mean,
            None => 0,
        }
    }
}

/// One release of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Release {
    /// Number of the release since the start, skipped ones included.
    pub tick: u64,
    /// When it was due, ns.
    pub release_ns: u64,
    /// How late it started, ns.
    pub release_lateness_ns: u64,
}

/// Releases of a periodic loop in absolute time, without accounts: what a device needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Releases {
    period_ns: NonZeroU64,
    tick: u64,
    next_release_ns: u64,
}

impl Releases {
    /// Releases of which the first is due at `first_release_ns`. A period of 0 is taken as 1 ns.
    pub fn new(first_release_ns: u64, period_ns: u64) -> Self {
        Self {
            period_ns: NonZeroU64::new(period_ns).unwrap_or(NonZeroU64::MIN),
            tick: 0,
            next_release_ns: first_release_ns,
        }
    }

    /// Number of the next release since the start, skipped ones included.
    pub const fn tick(&self) -> u64 {
        self.tick
    }

    /// When to wake up next, ns.
    pub const fn next_release_ns(&self) -> u64 {
        self.next_release_ns
    }

    /// The loop has woken up at `now_ns` and starts its step. Waking up whole periods late (a stopped process) skips
    /// these; returns how many.
    pub fn begin(&mut self, now_ns: u64) -> u64 {
        let late_periods = quotient(now_ns.saturating_sub(self.next_release_ns), self.period_ns);
        self.advance(late_periods);
        late_periods
    }

    /// The step has ended at `now_ns`; returns how many periods are skipped before the next release.
    pub fn finish(&mut self, now_ns: u64) -> u64 {
        self.advance(1);
        let past_ns = now_ns.saturating_sub(self.next_release_ns);
        let skipped = quotient(past_ns.saturating_add(self.period_ns.get() - 1), self.period_ns);
        self.advance(skipped);
        skipped
    }

    fn advance(&mut self, periods: u64) {
        self.tick = self.tick.saturating_add(periods);
        self.next_release_ns = self.next_release_ns.saturating_add(periods.saturating_mul(self.period_ns.get()));
    }
}

/// Periodic schedule in absolute time, with accounts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schedule {
    releases: Releases,
    started_ns: u64,
    skipped: u64,
    overruns: u64,
    deadline_misses: u64,
    /// Start minus release.
    pub release_lateness: DurationStatistics,
    /// End minus start.
    pub execution_time: DurationStatistics,
    /// End minus release.
    pub response_time: DurationStatistics,
}

impl Schedule {
    /// A schedule whose tick 0 is due at `first_release_ns`. A period of 0 is taken as 1 ns.
    pub fn new(first_release_ns: u64, period_ns: u64) -> Self {
        Self {
            releases: Releases::new(first_release_ns, period_ns),
            started_ns: first_release_ns,
            skipped: 0,
            overruns: 0,
            deadline_misses: 0,
            release_lateness: DurationStatistics::default(),
            execution_time: DurationStatistics::default(),
            response_time: DurationStatistics::default(),
        }
    }

    /// When to wake up next, ns.
    pub const fn next_release_ns(&self) -> u64 {
        self.releases.next_release_ns()
    }

    /// Periods that never started.
    pub const fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Steps that ended after the next release, and wake-ups a whole period late.
    pub const fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Steps that ended more than a period after their release.
    pub const fn deadline_misses(&self) -> u64 {
        self.deadline_misses
    }

    /// The loop has woken up at `now_ns` and starts its step. Waking up whole periods late (a stopped process) skips
    /// these.
    pub fn begin(&mut self, now_ns: u64) -> Release {
        let late_periods = self.releases.begin(now_ns);
        self.count_skipped(late_periods);
        self.started_ns = now_ns;
        let release_ns = self.next_release_ns();
        let release_lateness_ns = now_ns.saturating_sub(release_ns);
        self.release_lateness.record(release_lateness_ns);
        Release { tick: self.releases.tick(), release_ns, release_lateness_ns }
    }

    /// The step has ended at `now_ns`; returns how many periods are skipped before the next release.
    pub fn finish(&mut self, now_ns: u64) -> u64 {
        let response_ns = now_ns.saturating_sub(self.next_release_ns());
        self.execution_time.record(now_ns.saturating_sub(self.started_ns));
        self.response_time.record(response_ns);
        self.deadline_misses += u64::from(response_ns > self.releases.period_ns.get());
        let skipped = self.releases.finish(now_ns);
        self.count_skipped(skipped);
        skipped
    }

    fn count_skipped(&mut self, periods: u64) {
        self.overruns += u64::from(periods > 0);
        self.skipped = self.skipped.saturating_add(periods);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn quotients_are_those_of_the_compiler(a: u64, b: u64, right_a in 0..64u32, right_b in 0..64u32) {
            for (a, b) in [(a >> right_a, b >> right_b), (u64::MAX >> right_a, 1 << right_b), (0, b), (u64::MAX, b)] {
                let divisor = NonZeroU64::new(b).unwrap_or(NonZeroU64::MIN);
                prop_assert_eq!(quotient(a, divisor), a / divisor);
            }
        }
    }

    const PERIOD: u64 = 1_000_000;

    /// Runs one tick that wakes up on time and takes `execution_ns`; returns the skipped periods.
    fn tick(schedule: &mut Schedule, execution_ns: u64) -> u64 {
        let start = schedule.next_release_ns();
        schedule.begin(start);
        schedule.finish(start + execution_ns)
    }

    #[test]
    fn overruns_skip_whole_periods_and_keep_the_phase() {
        for (over, skipped) in [(PERIOD / 2, 1), (PERIOD, 1), (7 * PERIOD / 2, 4)] {
            let mut schedule = Schedule::new(5, PERIOD);
            assert_eq!(tick(&mut schedule, 1000), 0);
            assert_eq!(tick(&mut schedule, PERIOD + over), skipped);
            assert_eq!(schedule.next_release_ns(), 5 + (2 + skipped) * PERIOD, "no burst");
            assert_eq!(schedule.begin(schedule.next_release_ns()).tick, 2 + skipped);
            assert_eq!((schedule.overruns(), schedule.deadline_misses()), (1, 1));
        }
    }

    #[test]
    fn a_stopped_process_leaves_one_gap() {
        let mut schedule = Schedule::new(0, PERIOD);
        tick(&mut schedule, PERIOD);
        assert_eq!((schedule.overruns(), schedule.deadline_misses()), (0, 0), "a whole period is in time");
        let release = schedule.begin(101 * PERIOD + 17);
        assert_eq!((release.tick, release.release_lateness_ns), (101, 17));
        assert_eq!((schedule.skipped(), schedule.overruns()), (100, 1));
        for misses in 1..4 {
            tick(&mut schedule, PERIOD + 1);
            assert_eq!(schedule.deadline_misses(), misses);
        }
    }

    #[test]
    fn the_smallest_of_durations_is_that_of_all_not_of_the_last() {
        let mut statistics = DurationStatistics::default();
        let seen: [(u64, [u64; 3]); 4] = [(5, [5, 5, 5]), (9, [5, 9, 7]), (3, [3, 9, 5]), (4, [3, 9, 5])];
        for (duration_ns, expected) in seen {
            statistics.record(duration_ns);
            assert_eq!([statistics.min_ns, statistics.max_ns, statistics.mean_ns()], expected, "after {duration_ns}");
        }
    }

    #[test]
    fn lateness_does_not_drift() {
        let mut schedule = Schedule::new(0, PERIOD);
        for _ in 0..1000 {
            let start = schedule.next_release_ns() + 300_000;
            schedule.begin(start);
            schedule.finish(start + 10_000);
        }
        assert_eq!(schedule.next_release_ns(), 1000 * PERIOD);
        assert_eq!(schedule.release_lateness.mean_ns(), 300_000);
        assert_eq!(schedule.response_time.max_ns, 310_000);
    }
}
