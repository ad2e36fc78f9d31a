//! What is kept of a run: every tick, and accounts of samples, commands and ticks.

pub mod accounts;
pub mod ledger;
pub mod tick;
