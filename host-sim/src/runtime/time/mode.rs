//! What drives time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether messages or the machine's clock drive time. Never mixed; every output says which it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, clap::ValueEnum, strum::Display)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum RunMode {
    /// Time comes from the messages: deterministic, as fast as it goes.
    Lockstep,
    /// Steady clock, absolute deadlines.
    FreeRun,
}
