//! Published schemas of what this program writes.

use clap::ValueEnum;
use schemars::schema_for;

use crate::bench::result::RunResult;
use crate::record::export::mcap;

/// What a schema is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Subject {
    /// `run --json`, `result.json`
    #[default]
    Result,
    /// `timing --json`
    Timing,
    /// Messages of an MCAP file, by topic
    Mcap,
}

/// The JSON Schema of `subject`.
pub fn schema(subject: Subject) -> serde_json::Value {
    match subject {
        Subject::Result => schema_for!(RunResult).to_value(),
        Subject::Timing => schema_for!(crate::bench::timing::TimingResult).to_value(),
        Subject::Mcap => {
            mcap::schemas().into_iter().map(|(topic, schema)| (topic.to_owned(), schema.to_value())).collect()
        }
    }
}
