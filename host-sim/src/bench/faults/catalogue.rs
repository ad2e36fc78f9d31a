//! The 45 rows: number, name, and how each is tried.

use firmware::contract::{Faults, Table};

use super::evidence::Evidence;
use super::processes::{self, Stage};
use super::rows::{Trial, actuation, bytes, needle, streams, time, values};
use crate::bench::error::SimError;
use crate::runtime::signals;

/// How a row is tried.
#[derive(Clone, Copy, Debug)]
pub(crate) enum RowMethod {
    /// In lockstep and virtual time, from a seeded schedule.
    Lockstep(fn(&Trial<'_>, &mut Evidence) -> Result<(), SimError>),
    /// With real processes, in real time.
    Processes(fn(&Stage<'_>, &mut Evidence) -> Result<(), SimError>),
}

/// One row.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Number in the catalogue.
    pub id: u32,
    /// What goes wrong.
    pub name: &'static str,
    /// How it is tried.
    method: RowMethod,
}

const fn lockstep(id: u32, name: &'static str, run: fn(&Trial<'_>, &mut Evidence) -> Result<(), SimError>) -> Row {
    Row { id, name, method: RowMethod::Lockstep(run) }
}

const fn real(id: u32, name: &'static str, run: fn(&Stage<'_>, &mut Evidence) -> Result<(), SimError>) -> Row {
    Row { id, name, method: RowMethod::Processes(run) }
}

/// All rows in order.
pub const ROWS: &[Row] = &[
    lockstep(1, "step over budget by 0.5, 1, 3.5 periods", time::overrun),
    lockstep(2, "overrun on every tick", time::overrun_on_every_tick),
    lockstep(3, "peer stopped for 100 ms", time::peer_stopped),
    lockstep(4, "wall clock jumps by an hour", time::wall_clock),
    lockstep(5, "monotonic time goes back", time::clock_back),
    lockstep(6, "sequence counter wraps", time::counter_wrap),
    lockstep(7, "stale samples", streams::stale),
    lockstep(8, "sequence gaps of 1, 10, 1000", streams::gaps),
    lockstep(9, "duplicate samples", streams::duplicates),
    lockstep(10, "reordered samples", streams::reordered),
    lockstep(11, "value frozen while the sequence advances", streams::frozen),
    lockstep(12, "target sensor at 30 Hz in a 1 kHz loop", streams::slow_sensor),
    lockstep(13, "NaN, infinity, subnormal in each number", values::not_numbers),
    lockstep(14, "numbers out of range", values::out_of_range),
    lockstep(15, "units off by 1000", values::wrong_units),
    lockstep(16, "target lost for 1 to 500 ticks", streams::target_lost),
    lockstep(17, "target jumps by 5 and 50 sigma", values::jumps),
    lockstep(18, "noise sweep", values::noise),
    lockstep(19, "position saturation", actuation::position_saturation),
    lockstep(20, "rate saturation", actuation::rate_saturation),
    lockstep(21, "actuator stuck or at half gain", actuation::actuator_broken),
    lockstep(22, "actuator lag and delay of 0 to 10 ticks", actuation::actuator_late),
    lockstep(23, "plant sign error", actuation::sign_error),
    lockstep(24, "wrong paddle attached", actuation::wrong_paddle),
    lockstep(25, "near-singular Jacobian", actuation::near_singular),
    lockstep(26, "table: every single-bit flip", bytes::bit_flips),
    lockstep(27, "table: every truncation and trailing bytes", bytes::truncations),
    lockstep(28, "table: version, schema, unit mismatch", bytes::mismatches),
    lockstep(29, "table: valid checksum, impossible numbers", bytes::impossible),
    lockstep(30, "depth outside the table", needle::beyond_the_table),
    lockstep(31, "needle reverses", needle::reversal),
    lockstep(32, "needle too fast", needle::too_fast),
    real(33, "simulator killed at 200 phases", processes::plant_killed),
    real(34, "controller killed and restarted", processes::controller_restarted),
    real(35, "killed during service creation", processes::killed_at_start),
    real(36, "100 kill and restart cycles", processes::cycles),
    real(37, "two controllers", processes::two_controllers),
    real(38, "reader that never reads", processes::never_reads),
    real(39, "shared memory full", processes::memory_full),
    real(40, "file deleted under it", processes::file_deleted),
    real(41, "another user", processes::other_user),
    real(42, "garbage in the payload", processes::garbage),
    real(43, "other layout version", processes::other_layout),
    real(44, "disk of the log full", processes::disk_full),
    real(45, "panic in the step", processes::panic_in_step),
];

impl Row {
    /// Tries the row.
    ///
    /// # Errors
    /// [`SimError`] when it could not be set up; what does not hold is in the evidence.
    pub fn run(&self, table: &Table<f64, 2>, seed: u64, effort: f64) -> Result<Evidence, SimError> {
        let mut evidence = Evidence::default();
        match self.method {
            RowMethod::Lockstep(run) => {
                let trial = Trial { table, seed, without: Faults::NONE };
                signals::ends_at_once(|| run(&trial, &mut evidence))?;
            }
            RowMethod::Processes(run) => {
                let outcome = run(&Stage::new(table, seed, effort)?, &mut evidence);
                // What was not waited for any longer is no evidence.
                signals::check()?;
                outcome?;
            }
        }
        Ok(evidence)
    }

    /// Tries a row in lockstep with these monitors of the controller off; `None` for one with real processes.
    ///
    /// # Errors
    /// [`SimError`] when it could not be set up.
    pub fn run_without(
        &self,
        monitors: Faults,
        table: &Table<f64, 2>,
        seed: u64,
    ) -> Result<Option<Evidence>, SimError> {
        let RowMethod::Lockstep(run) = self.method else { return Ok(None) };
        let mut evidence = Evidence::default();
        run(&Trial { table, seed, without: monitors }, &mut evidence)?;
        Ok(Some(evidence))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::faults::evidence::RowVerdict;
    use crate::bench::paper_table::paper_table;

    #[test]
    fn every_lockstep_row_holds_for_several_seeds() {
        let table = paper_table().unwrap();
        for (place, row) in ROWS.iter().enumerate() {
            assert_eq!(row.id as usize, place + 1, "rows are in order");
            if !matches!(row.method, RowMethod::Lockstep(_)) {
                continue;
            }
            // The bytes of a table do not depend on a seed.
            let seeds = if (26..=29).contains(&row.id) { 1 } else { 3 };
            for seed in 1..=seeds {
                let evidence = row.run(&table, seed, 1.0).unwrap();
                let failures = &evidence.failures;
                assert_eq!(evidence.verdict(), RowVerdict::Passed, "row {} seed {seed}: {failures:?}", row.id);
                assert!(evidence.injected > 0, "row {}", row.id);
            }
        }
    }
}
