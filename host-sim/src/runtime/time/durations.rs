//! Distributions of durations, without allocation while they are filled.

use firmware::Mode;
use hdrhistogram::Histogram;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::runtime::names;
use crate::runtime::time::clock::Scheduling;
use crate::runtime::time::periodic::{PeriodicLoop, Served};

/// Longest duration told apart, ns: one minute.
const LONGEST_NS: u64 = 60_000_000_000;
/// Width of a bin of the histogram that is published, ns.
const BIN_NS: u64 = 1_000;
/// Significant digits kept.
const DIGITS: u8 = 3;
/// Values below which 99.99 % say nothing: one in ten thousand has not happened yet.
const VALUES_FOR_P9999: u64 = 10_000;
/// Missed releases that have an entry each. A longer stop is entered in so many groups, each with the lateness of its
/// first release: the loop must not spend its next period on the accounts of an hour.
const SEPARATE_MISSES: u64 = 4096;

/// Timing of a loop on the machine's clock.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoopTiming {
    /// Rate, Hz.
    pub rate_hz: f64,
    /// Mode of the controller that all of this was measured in; none: all modes, or no controller.
    #[serde(default, with = "names::optional_mode")]
    #[schemars(with = "Option<String>")]
    pub mode: Option<Mode>,
    /// Ticks run.
    pub ticks: u64,
    /// Releases that were not answered within a period, those among them that were skipped.
    pub deadline_misses: u64,
    /// Stretches of skipped periods: steps that ended after the next release, and wake-ups a period late.
    pub overruns: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// What the operating system granted.
    pub scheduling: Scheduling,
    /// Start minus release, of every release that came due: skipped ones waited for the step after them.
    pub release_lateness: Distribution,
    /// End minus start, of every step.
    pub execution_time: Distribution,
    /// End minus release, of every release that came due.
    pub response_time: Distribution,
    /// Plant in free-run: how old the needle and paddle samples of a command were when the actuator had it.
    #[serde(default)]
    pub input_age: Option<Distribution>,
    /// The same for the target sample that the command used last.
    #[serde(default)]
    pub target_age: Option<Distribution>,
}

/// A distribution of durations, ns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Distribution {
    /// Number of values.
    pub count: u64,
    /// Smallest.
    pub min_ns: u64,
    /// Median.
    pub p50_ns: u64,
    /// 99 %.
    pub p99_ns: u64,
    /// 99.9 %.
    pub p999_ns: u64,
    /// 99.99 %; none with fewer than 10,000 values.
    pub p9999_ns: Option<u64>,
    /// Largest.
    pub max_ns: u64,
    /// Mean.
    pub mean_ns: f64,
    /// Histogram: bin of 1 µs (its lower end, µs) and count; empty bins are left out.
    pub bins_us: Vec<(u64, u64)>,
}

/// Durations of one kind.
#[derive(Clone, Debug)]
pub struct Durations(Histogram<u64>);

impl Default for Durations {
    fn default() -> Self {
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS)
            .expect("the bounds are in order and the digits at most 5");
        Self(histogram)
    }
}

impl Durations {
    /// Adds a duration; longer ones than a minute count as a minute.
    pub fn record(&mut self, duration_ns: u64) {
        self.0.saturating_record(duration_ns);
    }

    fn record_all(&mut self, duration_ns: u64, count: u64) {
        self.0.saturating_record_n(duration_ns, count);
    }

    /// Median, ns.
    pub fn median_ns(&self) -> u64 {
        self.0.value_at_quantile(0.5)
    }

    /// What is published.
    pub fn distribution(&self) -> Distribution {
        let quantile = |q| self.0.value_at_quantile(q);
        Distribution {
            count: self.0.len(),
            min_ns: self.0.min(),
            p50_ns: quantile(0.5),
            p99_ns: quantile(0.99),
            p999_ns: quantile(0.999),
            p9999_ns: (self.0.len() >= VALUES_FOR_P9999).then(|| quantile(0.9999)),
            max_ns: self.0.max(),
            mean_ns: self.0.mean(),
            bins_us: self.bins_us(),
        }
    }

    fn bins_us(&self) -> Vec<(u64, u64)> {
        let mut bins: Vec<(u64, u64)> = Vec::new();
        for value in self.0.iter_recorded() {
            let bin = value.value_iterated_to() / BIN_NS;
            match bins.last_mut() {
                Some(last) if last.0 == bin => last.1 += value.count_at_value(),
                _ => bins.push((bin, value.count_at_value())),
            }
        }
        bins
    }
}

/// The durations of a loop's releases.
#[derive(Clone, Debug, Default)]
pub struct LoopDurations {
    /// Start minus release.
    pub release_lateness: Durations,
    /// End minus start.
    pub execution_time: Durations,
    /// End minus release.
    pub response_time: Durations,
    deadline_misses: u64,
    overruns: u64,
    skipped: u64,
}

impl LoopDurations {
    /// Adds a step and the releases that it served late.
    pub fn record(&mut self, served: &Served) {
        self.record_missed(served);
        self.record_step(served);
    }

    /// Adds a step with its own release.
    pub fn record_step(&mut self, served: &Served) {
        self.execution_time.record(served.end_ns.saturating_sub(served.start_ns));
        self.record_release(served, served.release_ns, 1);
    }

    /// Adds the releases before the step that came due and never started.
    pub fn record_missed(&mut self, served: &Served) {
        let missed = served.missed();
        let group = missed.div_ceil(SEPARATE_MISSES).max(1);
        let mut entered = 0;
        while entered < missed {
            let count = group.min(missed - entered);
            self.record_release(served, served.first_due_ns + entered * served.period_ns, count);
            entered += count;
        }
        self.skipped += missed;
        self.overruns += u64::from(missed > 0);
    }

    fn record_release(&mut self, served: &Served, release_ns: u64, count: u64) {
        let response_ns = served.end_ns.saturating_sub(release_ns);
        self.release_lateness.record_all(served.start_ns.saturating_sub(release_ns), count);
        self.response_time.record_all(response_ns, count);
        self.deadline_misses +=
            if response_ns > served.period_ns || release_ns < served.release_ns { count } else { 0 };
    }

    /// Everything so far, with the releases that nothing has answered at the end.
    pub fn timing(mut self, rate_hz: f64, periodic: &PeriodicLoop, scheduling: &Scheduling) -> LoopTiming {
        if let Some(unserved) = periodic.unserved() {
            self.record_missed(&unserved);
        }
        self.in_mode(None, rate_hz, scheduling)
    }

    /// What was measured in `mode`.
    pub fn in_mode(&self, mode: Option<Mode>, rate_hz: f64, scheduling: &Scheduling) -> LoopTiming {
        LoopTiming {
            rate_hz,
            mode,
            ticks: self.execution_time.0.len(),
            deadline_misses: self.deadline_misses,
            overruns: self.overruns,
            skipped: self.skipped,
            scheduling: scheduling.clone(),
            release_lateness: self.release_lateness.distribution(),
            execution_time: self.execution_time.distribution(),
            response_time: self.response_time.distribution(),
            ..LoopTiming::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_and_bins_count_everything() {
        let mut durations = Durations::default();
        for value in 1..=1000 {
            durations.record(value * 100);
        }
        let distribution = durations.distribution();
        assert_eq!(distribution.count, 1000);
        assert_eq!(distribution.bins_us.iter().map(|bin| bin.1).sum::<u64>(), 1000);
        assert!(distribution.p50_ns.abs_diff(50_000) < 200);
        assert!(distribution.max_ns.abs_diff(100_000) < 200);
    }

    #[test]
    fn one_in_ten_thousand_is_said_of_ten_thousand_or_more() {
        let mut durations = Durations::default();
        (1..10_000).for_each(|value| durations.record(value));
        assert_eq!(durations.distribution().p9999_ns, None);
        durations.record(1);
        assert!(durations.distribution().p9999_ns.is_some());
    }

    #[test]
    fn an_hour_of_misses_is_counted_whole_in_bounded_time() {
        let period_ns = 10_000;
        let missed = 3600 * 100_000;
        let served = Served {
            first_due_ns: 0,
            release_ns: missed * period_ns,
            period_ns,
            start_ns: missed * period_ns,
            end_ns: missed * period_ns,
        };
        let mut durations = LoopDurations::default();
        durations.record_missed(&served);
        assert_eq!((durations.deadline_misses, durations.skipped), (missed, missed));
        assert_eq!(durations.release_lateness.distribution().count, missed);
    }
}
