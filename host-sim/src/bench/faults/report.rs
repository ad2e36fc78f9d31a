//! What comes out of the catalogue: `faults.csv`, JSON.

use firmware::Mode;
use serde::{Deserialize, Serialize};

use super::catalogue::Row;
use super::evidence::{Evidence, RowVerdict};
use super::random::Composed;
use crate::runtime::names;
use model_offline::output::csv::table;

/// Columns of `faults.csv`.
const COLUMNS: [&str; 9] =
    ["id", "name", "injected", "detected", "ticks_to_detect", "max_error", "final_state", "unaccounted", "result"];

/// One row of `faults.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RowResult {
    /// Number in the catalogue.
    pub id: u32,
    /// What goes wrong.
    pub name: String,
    /// Times that it was injected.
    pub injected: u64,
    /// Times that it was answered by what the row asks for.
    pub detected: u64,
    /// Longest time to that, ticks; none where nothing is to be detected.
    pub ticks_to_detect: Option<u64>,
    /// Largest orthogonal error, length; none where no plant moves.
    pub max_error: Option<f64>,
    /// State at the end of the last trial; none where there is no controller.
    #[serde(with = "names::optional_mode")]
    pub final_state: Option<Mode>,
    /// In one account and not in the other: 0.
    pub unaccounted: u64,
    /// Whether the row holds.
    pub result: RowVerdict,
    /// Why it failed or was not run, and what is worth knowing.
    pub notes: Vec<String>,
}

impl RowResult {
    /// The result of a row.
    pub fn new<const D: usize, const N: usize, const P: usize>(row: &Row<D, N, P>, evidence: &Evidence) -> Self {
        let notes = evidence.not_run.iter().chain(&evidence.failures).chain(&evidence.notes);
        Self {
            id: row.id,
            name: row.name.to_owned(),
            injected: evidence.injected,
            detected: evidence.detected,
            ticks_to_detect: evidence.ticks_to_detect,
            max_error: evidence.max_error,
            final_state: evidence.final_state,
            unaccounted: evidence.unaccounted,
            result: evidence.verdict(),
            notes: notes.cloned().collect(),
        }
    }
}

/// What drives time in the catalogue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum CatalogueMode {
    /// Faults inside of the loop in virtual time; deaths of processes and the like need real ones.
    #[default]
    #[serde(rename = "rows 1 to 32 and random schedules: lockstep; rows 33 to 45: real processes")]
    LockstepThenProcesses,
    /// The same in space, where there are rows of two paddles.
    #[serde(rename = "rows 1 to 32, 46 to 51 and random schedules: lockstep; rows 33 to 45: real processes")]
    InSpace,
}

/// Result of `faults`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultsResult {
    /// Version of host-sim.
    pub version: String,
    /// 3 in space; none in the plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimension: Option<u32>,
    /// Seed of phases, noise and schedules.
    pub seed: u64,
    /// Rows 1 to 32 are in lockstep, the others in real time.
    pub mode: CatalogueMode,
    /// The rows that were tried.
    pub rows: Vec<RowResult>,
    /// Random schedules of several faults at once.
    pub composed: Option<Composed>,
}

impl FaultsResult {
    /// Rows that failed.
    pub fn failed(&self) -> usize {
        self.rows.iter().filter(|row| row.result == RowVerdict::Failed).count()
    }

    /// `faults.csv`.
    pub fn csv(&self) -> Vec<u8> {
        table(COLUMNS, &self.rows, |row| {
            [
                row.id.to_string(),
                row.name.clone(),
                row.injected.to_string(),
                row.detected.to_string(),
                row.ticks_to_detect.map(|ticks| ticks.to_string()).unwrap_or_default(),
                row.max_error.map(|error| format!("{error:.3e}")).unwrap_or_default(),
                row.final_state.map(|state| state.name().to_owned()).unwrap_or_default(),
                row.unaccounted.to_string(),
                row.result.to_string(),
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_csv_has_the_columns_and_quotes_commas() {
        let row =
            RowResult { id: 8, name: "gaps of 1, 10".to_owned(), result: RowVerdict::Passed, ..Default::default() };
        let csv = FaultsResult { rows: vec![row], ..Default::default() }.csv();
        let csv = String::from_utf8(csv).unwrap();
        let expected = "id,name,injected,detected,ticks_to_detect,max_error,final_state,unaccounted,result\n\
                        8,\"gaps of 1, 10\",0,0,,,,0,passed\n";
        assert_eq!(csv, expected);
    }
}
