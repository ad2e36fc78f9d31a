//! The catalogue on the table that it is tried with, in the plane or in space.
//!
//! Rows are generic in the dimension of space and the number of paddles. Both forms are made here, so that a program which tries
//! them is not compiled with every row once more.

use firmware::contract::Table;

use super::catalogue::{Row, rows};
use super::monitors::{MonitorOff, monitors_off};
use super::random::{Composed, composed};
use super::report::RowResult;
use crate::bench::error::SimError;
use crate::bench::paper_table::{brick_table, paper_table};
use crate::runtime::signals;

/// Rows on a table, one seed for all of them.
pub trait Session {
    /// Tries a row, with this part of the repetitions of those that are repeated with real processes; `None` for a number
    /// without a row.
    ///
    /// # Errors
    /// [`SimError`] when it could not be set up; what does not hold is in the result.
    fn row(&self, id: u32, effort: f64) -> Result<Option<RowResult>, SimError>;

    /// Runs so many random schedules of several faults at once.
    ///
    /// # Errors
    /// [`SimError::Runtime`] for settings that the controller refuses.
    fn composed(&self, count: u64) -> Result<Composed, SimError>;

    /// Tries every row in lockstep with one monitor of the controller off after the other.
    ///
    /// # Errors
    /// [`SimError`] when a row could not be set up.
    fn monitors_off(&self) -> Result<Vec<MonitorOff>, SimError>;
}

/// Rows that there are: they are numbered from 1 on.
pub fn row_count(dimension: u32) -> u32 {
    let count = if dimension > 2 { rows::<3, 2, 2>().len() } else { rows::<2, 1, 1>().len() };
    count as u32
}

/// One paddle in the plane on the paper's table, or two in space on that of a small body, which are computed first.
///
/// # Errors
/// [`SimError`] when there is no such table.
pub fn session(dimension: u32, seed: u64) -> Result<Box<dyn Session>, SimError> {
    if dimension > 2 {
        Ok(Box::new(OnTable { table: brick_table()?, rows: rows(), seed }))
    } else {
        Ok(Box::new(OnTable { table: paper_table()?, rows: rows(), seed }))
    }
}

struct OnTable<const D: usize, const N: usize, const P: usize> {
    table: Table<f64, D, N, P>,
    rows: Vec<Row<D, N, P>>,
    seed: u64,
}

impl<const D: usize, const N: usize, const P: usize> Session for OnTable<D, N, P> {
    fn row(&self, id: u32, effort: f64) -> Result<Option<RowResult>, SimError> {
        let Some(row) = self.rows.iter().find(|row| row.id == id) else { return Ok(None) };
        Ok(Some(RowResult::new(row, &row.run(&self.table, self.seed, effort)?)))
    }

    fn composed(&self, count: u64) -> Result<Composed, SimError> {
        signals::ends_at_once(|| composed(&self.table, self.seed, count, &|| {}))
    }

    fn monitors_off(&self) -> Result<Vec<MonitorOff>, SimError> {
        signals::ends_at_once(|| monitors_off(&self.table, self.seed))
    }
}
