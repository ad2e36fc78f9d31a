//! Monitors of what single samples cannot show: frozen values, contradictions, wrong associations, an actuator that
//! does not follow, a loop that diverges. What each of them cannot see is in [`crate::detection`].
//!
//! `check` and `next` change nothing; `accept` enters a sample that has been accepted.

mod bucket;
mod divergence;
mod following;
mod frozen;
mod innovation;
mod needle;
mod rest;
#[cfg(test)]
mod tests;

pub(crate) use bucket::LeakyBucket;
pub(crate) use divergence::DivergenceMonitor;
pub(crate) use following::FollowingMonitor;
pub(crate) use frozen::{FrozenMonitor, SensorStep};
pub(crate) use innovation::InnovationGate;
pub(crate) use needle::NeedleMonitor;
pub(crate) use rest::{Motion, RestMonitor};
