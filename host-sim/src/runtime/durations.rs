//! Distributions of durations, without allocation while they are filled.

use firmware::schedule::Schedule;
use hdrhistogram::Histogram;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::clock::Scheduling;

/// Longest duration told apart, ns: one minute.
const LONGEST_NS: u64 = 60_000_000_000;
/// Width of a bin of the histogram that is published, ns.
const BIN_NS: u64 = 1_000;
/// Significant digits kept.
const DIGITS: u8 = 3;

/// Timing of a loop on the machine's clock.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoopTiming {
    /// Rate, Hz.
    pub rate_hz: f64,
    /// Ticks run.
    pub ticks: u64,
    /// Steps that ended more than a period after their release.
    pub deadline_misses: u64,
    /// Steps that ended after the next release, and wake-ups a period late.
    pub overruns: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// What the operating system granted.
    pub scheduling: Scheduling,
    /// Start minus release.
    pub release_lateness: Distribution,
    /// End minus start.
    pub execution_time: Distribution,
    /// End minus release.
    pub response_time: Distribution,
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
    /// 99.99 %.
    pub p9999_ns: u64,
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
            p9999_ns: quantile(0.9999),
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

/// The three durations of a loop's ticks.
#[derive(Clone, Debug, Default)]
pub struct LoopDurations {
    /// Start minus release.
    pub release_lateness: Durations,
    /// End minus start.
    pub execution_time: Durations,
    /// End minus release.
    pub response_time: Durations,
}

impl LoopDurations {
    /// Adds a tick that was due, started and ended at these times, ns.
    pub fn record(&mut self, release_ns: u64, start_ns: u64, end_ns: u64) {
        self.release_lateness.record(start_ns.saturating_sub(release_ns));
        self.execution_time.record(end_ns.saturating_sub(start_ns));
        self.response_time.record(end_ns.saturating_sub(release_ns));
    }

    /// Durations and what the schedule counted.
    pub fn timing(&self, rate_hz: f64, schedule: &Schedule, scheduling: &Scheduling) -> LoopTiming {
        LoopTiming {
            rate_hz,
            ticks: schedule.execution_time.count,
            deadline_misses: schedule.deadline_misses(),
            overruns: schedule.overruns(),
            skipped: schedule.skipped(),
            scheduling: scheduling.clone(),
            release_lateness: self.release_lateness.distribution(),
            execution_time: self.execution_time.distribution(),
            response_time: self.response_time.distribution(),
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
}
