//! What a row of the catalogue is judged by.

use firmware::contract::PaddleCommand;
use firmware::{Faults, Mode};
use serde::{Deserialize, Serialize};

use super::closed_loop::ClosedLoop;

/// Failures that are kept in words, per row.
const KEPT: usize = 5;

/// Whether a row holds.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    strum::Display,
    strum::EnumString,
    strum::IntoStaticStr,
)]
#[serde(into = "&'static str", try_from = "String")]
pub enum RowVerdict {
    /// Everything that it demands was seen.
    #[strum(serialize = "passed")]
    Passed,
    /// Something was not.
    #[strum(serialize = "FAILED")]
    Failed,
    /// It could not be tried here. Never the same as passed.
    #[default]
    #[strum(serialize = "not run")]
    NotRun,
}

impl TryFrom<String> for RowVerdict {
    type Error = strum::ParseError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

/// What was seen while a row was tried.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Times that the fault was injected.
    pub injected: u64,
    /// Times that it was answered by what the row asks for.
    pub detected: u64,
    /// Longest time from the injection to that answer, ticks.
    pub ticks_to_detect: Option<u64>,
    /// Largest orthogonal error, length.
    pub max_error: Option<f64>,
    /// State at the end of the last trial.
    pub final_state: Option<Mode>,
    /// Samples and ticks that are in one account and not in another.
    pub unaccounted: u64,
    /// What the row demands and was not seen; the first few.
    pub failures: Vec<String>,
    /// Failures altogether.
    pub failed: u64,
    /// Why it could not be tried.
    pub not_run: Option<String>,
    /// What is worth knowing besides.
    pub notes: Vec<String>,
}

impl Evidence {
    /// A demand of the row.
    pub fn require(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.failed += 1;
            if self.failures.len() < KEPT {
                self.failures.push(what());
            }
        }
    }

    /// One injection, answered after `ticks` (counted from 1, or not at all); later than `limit` is a failure.
    pub fn detect(&mut self, ticks: Option<u64>, limit: u64, what: impl Fn() -> String) {
        self.injected += 1;
        if let Some(ticks) = ticks {
            self.detected += 1;
            self.ticks_to_detect = Some(self.ticks_to_detect.map_or(ticks, |longest| longest.max(ticks)));
        }
        self.require(ticks.is_some_and(|ticks| ticks <= limit), || match ticks {
            Some(ticks) => format!("{}: detected after {ticks} ticks, the limit is {limit}", what()),
            None => format!("{}: not detected", what()),
        });
    }

    /// Takes over accounts, invariants, error and final state of a finished trial.
    pub fn close<const D: usize, const N: usize, const P: usize>(
        &mut self,
        bench: &ClosedLoop<'_, D, N, P>,
        what: impl Fn() -> String,
    ) {
        self.max_error = Some(self.max_error.unwrap_or(0.0).max(bench.max_error));
        self.final_state = Some(bench.mode());
        let unaccounted = bench.unaccounted();
        self.unaccounted += unaccounted;
        self.require(unaccounted == 0, || format!("{}: {unaccounted} unaccounted", what()));
        for violation in bench.invariants.violations() {
            self.require(false, || format!("{}: {violation}", what()));
        }
    }

    /// The trial must end in this state.
    pub fn expect_mode<const D: usize, const N: usize, const P: usize>(
        &mut self,
        bench: &ClosedLoop<'_, D, N, P>,
        mode: Mode,
        what: impl Fn() -> String,
    ) {
        self.require(bench.mode() == mode, || {
            format!("{}: ended in {:?} instead of {mode:?}: {}", what(), bench.mode(), bench.state.faults())
        });
    }

    /// Adds what was seen in another trial.
    pub fn merge(&mut self, other: Self) {
        self.injected += other.injected;
        self.detected += other.detected;
        self.ticks_to_detect = self.ticks_to_detect.max(other.ticks_to_detect);
        self.max_error = match (self.max_error, other.max_error) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        self.final_state = other.final_state.or(self.final_state);
        self.unaccounted += other.unaccounted;
        self.failed += other.failed;
        self.failures.extend(other.failures);
        self.failures.truncate(KEPT);
        self.notes.extend(other.notes);
    }

    /// Whether the row holds.
    pub fn verdict(&self) -> RowVerdict {
        if self.failed > 0 || self.unaccounted > 0 {
            RowVerdict::Failed
        } else if self.not_run.is_some() {
            RowVerdict::NotRun
        } else {
            RowVerdict::Passed
        }
    }
}

/// Whether a command carries all of these codes.
pub fn carries(codes: Faults) -> impl Fn(&PaddleCommand) -> bool {
    move |command| Faults::from_bits(command.faults).contains(codes)
}

/// Whether a command was given in this mode.
pub fn is_in(mode: Mode) -> impl Fn(&PaddleCommand) -> bool {
    move |command| command.state == mode as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_are_written_and_read_by_name() {
        for (verdict, name) in
            [(RowVerdict::Passed, "passed"), (RowVerdict::Failed, "FAILED"), (RowVerdict::NotRun, "not run")]
        {
            assert_eq!((verdict.to_string(), serde_json::to_value(verdict).unwrap()), (name.to_owned(), name.into()));
            assert_eq!(serde_json::from_value::<RowVerdict>(name.into()).unwrap(), verdict);
        }
        assert!(serde_json::from_str::<RowVerdict>("\"failed\"").is_err());
    }
}
