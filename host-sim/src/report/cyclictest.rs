//! Histograms as cyclictest writes them (`--histfile`), for the scripts that plot those.

use std::collections::BTreeMap;

use crate::runtime::time::durations::{Distribution, LoopTiming};

/// Every release of a loop: what was measured in each mode of its controller.
#[derive(Clone, Debug)]
pub struct Column<'t> {
    /// Name of the loop.
    pub name: &'static str,
    /// One per mode.
    pub timings: Vec<&'t LoopTiming>,
}

impl Column<'_> {
    fn lateness(&self) -> impl Iterator<Item = &Distribution> {
        self.timings.iter().map(|timing| &timing.release_lateness).filter(|lateness| lateness.count > 0)
    }

    fn count(&self) -> u64 {
        self.lateness().map(|lateness| lateness.count).sum()
    }

    fn min_us(&self) -> u64 {
        self.lateness().map(|lateness| lateness.min_ns).min().unwrap_or(0) / 1000
    }

    fn max_us(&self) -> u64 {
        self.lateness().map(|lateness| lateness.max_ns).max().unwrap_or(0) / 1000
    }

    fn mean_us(&self) -> u64 {
        let sum_ns: f64 = self.lateness().map(|lateness| lateness.mean_ns * lateness.count as f64).sum();
        (1e-3 * sum_ns / self.count().max(1) as f64) as u64
    }
}

/// Release lateness of these loops: a line per microsecond, `µs` and a count for each loop, and after them the lines that
/// cyclictest adds. Lines in which nothing is counted are left out, so that a stop of a second does not make a million.
/// Skipped releases are in it.
pub fn histogram_file(loops: &[Column<'_>]) -> String {
    let mut counts: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    for (place, column) in loops.iter().enumerate() {
        for &(bin_us, count) in column.lateness().flat_map(|lateness| &lateness.bins_us) {
            counts.entry(bin_us).or_insert_with(|| vec![0; loops.len()])[place] += count;
        }
    }
    let names: Vec<&str> = loops.iter().map(|column| column.name).collect();
    let mut text = format!("# Histogram of the release lateness: us, then counts of: {}\n", names.join(", "));
    for (bin_us, of_loops) in &counts {
        let row: String = of_loops.iter().map(|count| format!("\t{count:06}")).collect();
        text.push_str(&format!("{bin_us:06}{row}\n"));
    }
    let mut line = |name: &str, of: fn(&Column<'_>) -> u64| {
        let row: String = loops.iter().map(|column| format!(" {:05}", of(column))).collect();
        text.push_str(&format!("# {name}:{row}\n"));
    };
    line("Total", |column| column.count());
    line("Min Latencies", |column| column.min_us());
    line("Avg Latencies", |column| column.mean_us());
    line("Max Latencies", |column| column.max_us());
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::time::durations::Durations;

    fn late(durations_ns: &[u64]) -> LoopTiming {
        let mut release_lateness = Durations::default();
        for duration_ns in durations_ns {
            release_lateness.record(*duration_ns);
        }
        LoopTiming { release_lateness: release_lateness.distribution(), ..LoopTiming::default() }
    }

    #[test]
    fn every_release_is_in_its_column() {
        let (empty, run, hold) = (late(&[1_500, 1_600, 40_000]), late(&[2_000, 40_010]), late(&[1_000_000_000]));
        let never = late(&[]);
        let text = histogram_file(&[
            Column { name: "empty loop", timings: vec![&empty] },
            Column { name: "controller", timings: vec![&run, &hold, &never] },
        ]);
        let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        let counts = |row: &str| row.split('\t').map(|n| n.parse::<u64>().unwrap()).collect::<Vec<_>>();
        assert_eq!(counts(rows[0]), [1, 2, 0]);
        assert_eq!(counts(rows[1]), [2, 0, 1]);
        assert_eq!(counts(rows[2]), [40, 1, 1]);
        // Three digits are kept of so long a lateness.
        assert!(rows.len() == 4 && counts(rows[3])[0].abs_diff(1_000_000) < 1_000 && counts(rows[3])[1..] == [0, 1]);
        assert!(text.contains("# Total: 00003 00003\n") && text.contains("# Min Latencies: 00001 00002\n"), "{text}");
        // (2 µs + 40.01 µs + 1 s) / 3.
        let mean: f64 = text.split("# Avg Latencies: 00014 ").nth(1).unwrap().lines().next().unwrap().parse().unwrap();
        assert!((mean - 333_347.0).abs() < 400.0, "{text}");
    }
}
