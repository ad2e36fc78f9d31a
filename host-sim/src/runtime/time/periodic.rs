//! A periodic loop on the machine's clock, with a record of every release that came due.
//!
//! A schedule that has been stopped goes on in its old phase, and the releases in between never start. Measured from
//! where it goes on, a stop of a second would look like a fraction of a period. So each release that was missed has its
//! own entry: late until the next step started, answered when that step ended.

use firmware::schedule::{Release, Schedule};

use crate::runtime::error::RuntimeError;
use crate::runtime::signals;
use crate::runtime::time::clock::{self, now_ns};

/// Longest sleep without a look at signals, ns: one that comes between the look and the sleep waits no longer than this.
const SLEEP_NS: u64 = 100_000_000;

/// A step, and the releases that it served: its own, and those that came due before it and never started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Served {
    /// The first release that was due, ns.
    pub first_due_ns: u64,
    /// The release of the step, ns; whole periods after the first one that was due.
    pub release_ns: u64,
    /// Period, ns.
    pub period_ns: u64,
    /// Start of the step, ns.
    pub start_ns: u64,
    /// Its end, ns.
    pub end_ns: u64,
}

impl Served {
    /// Releases that came due and never started.
    pub const fn missed(&self) -> u64 {
        (self.release_ns - self.first_due_ns) / self.period_ns
    }
}

/// Releases of a loop, and when they were served.
#[derive(Clone, Debug)]
pub struct PeriodicLoop {
    schedule: Schedule,
    period_ns: u64,
    first_release_ns: u64,
    /// First release that no step has served.
    due_ns: u64,
    release_ns: u64,
    start_ns: u64,
    end_ns: u64,
}

impl PeriodicLoop {
    /// A loop whose tick 0 is due at `first_release_ns`. A period of 0 is taken as 1 ns.
    pub fn new(first_release_ns: u64, period_ns: u64) -> Self {
        Self {
            schedule: Schedule::new(first_release_ns, period_ns),
            period_ns: period_ns.max(1),
            first_release_ns,
            due_ns: first_release_ns,
            release_ns: first_release_ns,
            start_ns: first_release_ns,
            end_ns: first_release_ns,
        }
    }

    /// When to wake up next, ns.
    pub const fn next_release_ns(&self) -> u64 {
        self.schedule.next_release_ns()
    }

    /// Sleeps until the next release; a signal that asks for the end wakes it.
    ///
    /// # Errors
    /// [`RuntimeError::Interrupted`].
    pub fn wait(&self) -> Result<(), RuntimeError> {
        sleep_until(self.next_release_ns())
    }

    /// The step starts now.
    pub fn begin(&mut self) -> Release {
        self.begin_at(now_ns())
    }

    /// The step ends now.
    pub fn finish(&mut self) -> Served {
        self.finish_at(now_ns())
    }

    fn begin_at(&mut self, start_ns: u64) -> Release {
        self.start_ns = start_ns;
        let release = self.schedule.begin(start_ns);
        self.release_ns = release.release_ns;
        release
    }

    fn finish_at(&mut self, end_ns: u64) -> Served {
        self.schedule.finish(end_ns);
        self.end_ns = end_ns;
        let Self { due_ns: first_due_ns, release_ns, period_ns, start_ns, .. } = *self;
        self.due_ns = release_ns + period_ns;
        Served { first_due_ns, release_ns, period_ns, start_ns, end_ns }
    }

    /// Start of the last step, ns.
    pub const fn start_ns(&self) -> u64 {
        self.start_ns
    }

    /// Releases that were skipped after the last step and that none will serve: answered, at best, when it ended.
    pub fn unserved(&self) -> Option<Served> {
        let Self { due_ns: first_due_ns, period_ns, end_ns, .. } = *self;
        let release_ns = self.next_release_ns();
        let found = Served { first_due_ns, release_ns, period_ns, start_ns: end_ns, end_ns };
        (found.missed() > 0).then_some(found)
    }

    /// Releases that came due so far.
    pub const fn due(&self) -> u64 {
        (self.next_release_ns() - self.first_release_ns) / self.period_ns
    }

    /// Periods that never started.
    pub const fn skipped(&self) -> u64 {
        self.schedule.skipped()
    }
}

/// Sleeps until an absolute time of the steady clock, ns, or until a signal asks for the end.
///
/// # Errors
/// [`RuntimeError::Interrupted`].
fn sleep_until(time_ns: u64) -> Result<(), RuntimeError> {
    signals::check()?;
    loop {
        let now_ns = now_ns();
        if now_ns >= time_ns {
            return Ok(());
        }
        clock::sleep_until(time_ns.min(now_ns + SLEEP_NS));
        signals::check()?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::time::durations::LoopDurations;

    const PERIOD: u64 = 1_000_000;

    /// A step that starts `late_ns` after its release and takes `takes_ns`.
    fn step(periodic: &mut PeriodicLoop, durations: &mut LoopDurations, late_ns: u64, takes_ns: u64) {
        let start_ns = periodic.next_release_ns() + late_ns;
        periodic.begin_at(start_ns);
        durations.record(&periodic.finish_at(start_ns + takes_ns));
    }

    #[test]
    fn a_stop_of_a_second_is_a_thousand_misses_and_a_second_late() {
        let (mut periodic, mut durations) = (PeriodicLoop::new(7, PERIOD), LoopDurations::default());
        step(&mut periodic, &mut durations, 100, 10);
        step(&mut periodic, &mut durations, 1000 * PERIOD + 100, 10);
        step(&mut periodic, &mut durations, 100, 10);
        let timing = durations.timing(1000.0, &periodic, &crate::runtime::time::clock::Scheduling::default());
        assert_eq!((timing.ticks, timing.skipped, timing.deadline_misses), (3, 1000, 1000));
        assert_eq!(timing.release_lateness.count, 1003, "an entry for every release that came due");
        assert_eq!(timing.release_lateness.count, periodic.due());
        let second = 1000 * PERIOD + 100;
        assert!(timing.release_lateness.max_ns.abs_diff(second) < second / 500, "{:?}", timing.release_lateness);
        assert!(timing.response_time.p99_ns > 900 * PERIOD, "the stop fills the percentiles");
    }

    #[test]
    fn a_step_that_takes_too_long_answers_for_the_releases_that_it_covers() {
        let (mut periodic, mut durations) = (PeriodicLoop::new(0, PERIOD), LoopDurations::default());
        step(&mut periodic, &mut durations, 0, 3 * PERIOD + PERIOD / 2);
        assert_eq!(periodic.unserved().map(|served| served.missed()), Some(3));
        step(&mut periodic, &mut durations, 0, 10);
        let timing = durations.timing(1000.0, &periodic, &crate::runtime::time::clock::Scheduling::default());
        // The long one, and those due at 1, 2 and 3 periods, which the step at 4 periods answers.
        assert_eq!((timing.ticks, timing.skipped, timing.deadline_misses), (2, 3, 4));
        assert!(timing.release_lateness.max_ns.abs_diff(3 * PERIOD) < PERIOD / 100);
    }

    #[test]
    fn releases_that_the_last_step_missed_are_in_the_figures() {
        let (mut periodic, mut durations) = (PeriodicLoop::new(0, PERIOD), LoopDurations::default());
        step(&mut periodic, &mut durations, 0, 5 * PERIOD);
        let timing = durations.timing(1000.0, &periodic, &crate::runtime::time::clock::Scheduling::default());
        assert_eq!((timing.release_lateness.count, timing.deadline_misses, timing.skipped), (5, 5, 4));
        assert_eq!(periodic.due(), 5);
    }
}
