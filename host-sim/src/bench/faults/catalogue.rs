//! The rows, 45 and in space 51: number, name, and how each is tried.

use firmware::contract::{Faults, Table};

use super::evidence::Evidence;
use super::processes::{self, Stage};
use super::rows::{Trial, actuation, bytes, needle, pairs, streams, time, values};
use crate::bench::error::SimError;
use crate::runtime::signals;

/// How a row in lockstep is tried.
type InLockstep<const D: usize, const N: usize, const P: usize> =
    fn(&Trial<'_, D, N, P>, &mut Evidence) -> Result<(), SimError>;

/// How one with real processes is.
type WithProcesses<const D: usize, const N: usize, const P: usize> =
    fn(&Stage<'_, D, N, P>, &mut Evidence) -> Result<(), SimError>;

/// How a row is tried.
#[derive(Clone, Copy, Debug)]
pub(crate) enum RowMethod<const D: usize, const N: usize, const P: usize> {
    /// In lockstep and virtual time, from a seeded schedule.
    Lockstep(InLockstep<D, N, P>),
    /// With real processes, in real time.
    Processes(WithProcesses<D, N, P>),
}

/// One row.
#[derive(Clone, Copy, Debug)]
pub struct Row<const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    /// Number in the catalogue.
    pub id: u32,
    /// What goes wrong.
    pub name: &'static str,
    /// How it is tried.
    method: RowMethod<D, N, P>,
}

const fn lockstep<const D: usize, const N: usize, const P: usize>(
    id: u32,
    name: &'static str,
    run: InLockstep<D, N, P>,
) -> Row<D, N, P> {
    Row { id, name, method: RowMethod::Lockstep(run) }
}

const fn real<const D: usize, const N: usize, const P: usize>(
    id: u32,
    name: &'static str,
    run: WithProcesses<D, N, P>,
) -> Row<D, N, P> {
    Row { id, name, method: RowMethod::Processes(run) }
}

/// All rows in order: 45, and with two paddles 6 that are theirs alone.
pub fn rows<const D: usize, const N: usize, const P: usize>() -> Vec<Row<D, N, P>> {
    let pairs = if P > 1 { Row::PAIRS } else { &[] };
    Row::COMMON.iter().chain(pairs).copied().collect()
}

impl<const D: usize, const N: usize, const P: usize> Row<D, N, P> {
    /// The rows of every dimension in order.
    const COMMON: &'static [Self] = &[
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

    /// Those of two paddles, after them.
    const PAIRS: &'static [Self] = &[
        lockstep(46, "one paddle of two lost", pairs::lost),
        lockstep(47, "one paddle of two frozen", pairs::frozen),
        lockstep(48, "one paddle of two stuck or at half gain", pairs::broken),
        lockstep(49, "one paddle of two at its limit", pairs::at_its_limit),
        lockstep(50, "samples of the paddles exchanged", pairs::samples_exchanged),
        lockstep(51, "commands of the paddles exchanged", pairs::commands_exchanged),
    ];

    /// Tries the row.
    ///
    /// # Errors
    /// [`SimError`] when it could not be set up; what does not hold is in the evidence.
    pub fn run(&self, table: &Table<f64, D, N, P>, seed: u64, effort: f64) -> Result<Evidence, SimError> {
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
        table: &Table<f64, D, N, P>,
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
    use crate::bench::paper_table::{brick_table, paper_table};

    #[test]
    fn every_lockstep_row_holds_for_several_seeds() {
        every_lockstep_row_holds(&paper_table().unwrap(), 3);
    }

    #[test]
    fn every_lockstep_row_holds_in_space_with_two_paddles() {
        every_lockstep_row_holds(&brick_table().unwrap(), 1);
    }

    /// With what tells the paddles apart, or their following monitor, off: those rows fail that are there for it.
    #[test]
    fn rows_of_two_paddles_notice_what_is_theirs() {
        let (table, rows) = (brick_table().unwrap(), rows::<3, 2, 2>());
        for (id, off) in [
            (46, Faults::SECOND_PADDLE),
            (46, Faults::PADDLE_STALE),
            (47, Faults::FROZEN),
            (48, Faults::SECOND_PADDLE),
            (50, Faults::FOLLOWING_ERROR),
            (51, Faults::FOLLOWING_ERROR),
        ] {
            let row = rows.iter().find(|row| row.id == id).unwrap();
            let evidence = row.run_without(off, &table, 1).unwrap().unwrap();
            assert_eq!(evidence.verdict(), RowVerdict::Failed, "row {id} without {off}");
        }
        assert_eq!(catalogue_length::<2, 1, 1>(), 45, "rows of two paddles are not for one");
    }

    fn catalogue_length<const D: usize, const N: usize, const P: usize>() -> usize {
        rows::<D, N, P>().len()
    }

    fn every_lockstep_row_holds<const D: usize, const N: usize, const P: usize>(
        table: &Table<f64, D, N, P>,
        seeds: u64,
    ) {
        for (place, row) in rows::<D, N, P>().iter().enumerate() {
            assert_eq!(row.id as usize, place + 1, "rows are in order");
            if !matches!(row.method, RowMethod::Lockstep(_)) {
                continue;
            }
            // The bytes of a table do not depend on a seed.
            let seeds = if (26..=29).contains(&row.id) { 1 } else { seeds };
            for seed in 1..=seeds {
                let evidence = row.run(table, seed, 1.0).unwrap();
                let failures = &evidence.failures;
                assert_eq!(evidence.verdict(), RowVerdict::Passed, "row {} seed {seed}: {failures:?}", row.id);
                assert!(evidence.injected > 0, "row {}", row.id);
            }
        }
    }
}
