//! What comes out of the catalogue: a line per row on the terminal, `faults.csv`, JSON.

use serde::{Deserialize, Serialize};

use super::catalogue::Row;
use super::evidence::{Evidence, Verdict};
use super::random::Composed;
use crate::commands::controller::mode_name;

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
    pub final_state: Option<String>,
    /// In one account and not in the other: 0.
    pub unaccounted: u64,
    /// `passed`, `FAILED` or `not run`.
    pub result: String,
    /// Why it failed or was not run, and what is worth knowing.
    pub notes: Vec<String>,
}

impl RowResult {
    /// The result of a row.
    pub(crate) fn new(row: &Row, evidence: &Evidence) -> Self {
        let notes = evidence.not_run.iter().chain(&evidence.failures).chain(&evidence.notes);
        Self {
            id: row.id,
            name: row.name.to_owned(),
            injected: evidence.injected,
            detected: evidence.detected,
            ticks_to_detect: evidence.ticks_to_detect,
            max_error: evidence.max_error,
            final_state: evidence.final_state.map(|mode| mode_name(mode).to_owned()),
            unaccounted: evidence.unaccounted,
            result: evidence.verdict().to_string(),
            notes: notes.cloned().collect(),
        }
    }

    fn is(&self, verdict: Verdict) -> bool {
        self.result == verdict.to_string()
    }
}

/// Result of `faults`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultsResult {
    /// Version of host-sim.
    pub version: String,
    /// Seed of phases, noise and schedules.
    pub seed: u64,
    /// Rows 1 to 32 are in lockstep, the others in real time.
    pub mode: String,
    /// The rows that were tried.
    pub rows: Vec<RowResult>,
    /// Random schedules of several faults at once.
    pub composed: Option<Composed>,
}

impl FaultsResult {
    /// Rows that failed.
    pub fn failed(&self) -> usize {
        self.rows.iter().filter(|row| row.is(Verdict::Failed)).count()
    }

    /// `faults.csv`.
    pub fn csv(&self) -> String {
        let mut text =
            String::from("id,name,injected,detected,ticks_to_detect,max_error,final_state,unaccounted,result\n");
        for row in &self.rows {
            let fields = [
                row.id.to_string(),
                quoted(&row.name),
                row.injected.to_string(),
                row.detected.to_string(),
                row.ticks_to_detect.map(|ticks| ticks.to_string()).unwrap_or_default(),
                row.max_error.map(|error| format!("{error:.3e}")).unwrap_or_default(),
                row.final_state.clone().unwrap_or_default(),
                row.unaccounted.to_string(),
                row.result.clone(),
            ];
            text.push_str(&fields.join(","));
            text.push('\n');
        }
        text
    }
}

/// A field of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Prints a row as soon as it is known.
pub fn print_row(row: &RowResult, wall_s: f64) {
    println!(
        "{:>2}  {:<46} {:>8} injected {:>8} detected {:>6} ticks  {:<4} unaccounted {}  {}  ({wall_s:.1} s)",
        row.id,
        row.name,
        row.injected,
        row.detected,
        row.ticks_to_detect.map_or_else(|| "–".to_owned(), |ticks| ticks.to_string()),
        row.final_state.as_deref().unwrap_or("–"),
        row.unaccounted,
        row.result,
    );
    if !row.is(Verdict::Passed) {
        for note in &row.notes {
            println!("    {note}");
        }
    }
}

/// Prints what became of the random schedules.
pub fn print_composed(composed: &Composed, wall_s: f64) {
    let [hold, run, safe] = composed.modes;
    println!(
        "{} random schedules of {} faults: {} ticks ({run} RUN, {hold} HOLD, {safe} SAFE), {} injections, {} commands \
         with fault codes, {} re-armings, largest error {:.3e}, unaccounted {}  ({wall_s:.1} s)",
        composed.schedules,
        composed.faults,
        composed.ticks,
        composed.injected,
        composed.flagged,
        composed.rearmed,
        composed.max_error,
        composed.unaccounted,
    );
    for failure in &composed.failures {
        println!("    {failure}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_csv_has_the_columns_and_quotes_commas() {
        let row =
            RowResult { id: 8, name: "gaps of 1, 10".to_owned(), result: "passed".to_owned(), ..Default::default() };
        let csv = FaultsResult { rows: vec![row], ..Default::default() }.csv();
        let expected = "id,name,injected,detected,ticks_to_detect,max_error,final_state,unaccounted,result\n\
                        8,\"gaps of 1, 10\",0,0,,,,0,passed\n";
        assert_eq!(csv, expected);
    }
}
