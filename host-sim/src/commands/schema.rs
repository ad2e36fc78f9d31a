//! `host-sim schema`: published schemas of what this program writes.

use clap::ValueEnum;
use host_sim::bench::in_space::SpaceRun;
use host_sim::bench::result::RunResult;
use host_sim::bench::timing::TimingResult;
use host_sim::record::export::messages;
use schemars::schema_for;

/// What a schema is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Subject {
    /// `run --json`, `result.json` of a scene in the plane
    #[default]
    Result,
    /// The same of a scene in space
    ResultInSpace,
    /// `timing --json`
    Timing,
    /// Messages of an MCAP file, by topic
    Mcap,
}

/// The JSON Schema of `subject`.
pub(crate) fn schema(subject: Subject) -> serde_json::Value {
    match subject {
        Subject::Result => schema_for!(RunResult).to_value(),
        Subject::ResultInSpace => schema_for!(SpaceRun).to_value(),
        Subject::Timing => schema_for!(TimingResult).to_value(),
        Subject::Mcap => {
            messages::schemas().into_iter().map(|(topic, _, schema)| (topic.to_owned(), schema.to_value())).collect()
        }
    }
}
