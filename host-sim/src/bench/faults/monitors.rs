//! The catalogue's own test: with a monitor of the controller off, at least one row must notice.
//!
//! A monitor is off when its codes are never set and what it would have refused is taken
//! ([`Controller::without`](firmware::Controller::without)): the bench is the same, the controller is worse. A line
//! without a row is a monitor whose loss nobody would notice.

use firmware::contract::{Faults, Table};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::catalogue::{Row, rows};
use super::evidence::RowVerdict;
use crate::bench::error::SimError;

/// Codes that tell of no monitor: what the law says of its own command, what only something outside of the controller
/// sets, and what no input can bring about (a table whose numbers are within bounds gives finite commands).
pub const NO_MONITORS: Faults = Faults::from_bits(
    Faults::POSITION_LIMITED.bits() | Faults::RATE_LIMITED.bits() | Faults::WATCHDOG.bits() | Faults::INTERNAL.bits(),
);

/// A monitor, and who notices that it is off.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MonitorOff {
    /// Its fault code.
    #[serde(with = "crate::runtime::names::faults")]
    pub monitor: Faults,
    /// Rows of the catalogue that fail without it.
    pub rows: Vec<u32>,
}

/// Tries every row in lockstep with one monitor off after the other.
///
/// # Errors
/// [`SimError`] when a row could not be set up.
pub fn monitors_off<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    seed: u64,
) -> Result<Vec<MonitorOff>, SimError> {
    // The control: a row that fails with every monitor on says nothing.
    let holds = |row: &Row<D, N, P>, without: Faults| -> Result<bool, SimError> {
        let evidence = row.run_without(without, table, seed)?;
        Ok(evidence.is_none_or(|evidence| evidence.verdict() != RowVerdict::Failed))
    };
    let rows = rows::<D, N, P>();
    let sound: Vec<&Row<D, N, P>> = rows
        .iter()
        .map(|row| Ok(holds(row, Faults::NONE)?.then_some(row)))
        .filter_map(Result::transpose)
        .collect::<Result<_, SimError>>()?;
    let none = if P > 1 { NO_MONITORS } else { NO_MONITORS | Faults::SECOND_PADDLE };
    let monitors = Faults::NAMES.iter().filter(|(code, _)| none.intersection(*code).is_empty());
    monitors
        .map(|(code, _)| {
            crate::runtime::signals::check()?;
            let tried = sound.par_iter().map(|row| Ok((!holds(row, *code)?).then_some(row.id)));
            let rows: Vec<Option<u32>> = tried.collect::<Result<_, SimError>>()?;
            Ok(MonitorOff { monitor: *code, rows: rows.into_iter().flatten().collect() })
        })
        .collect()
}
