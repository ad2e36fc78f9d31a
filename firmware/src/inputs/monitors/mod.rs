//! Monitors of what single samples cannot show: frozen values, wrong associations, an actuator that does not follow,
//! a loop that diverges. What each of them cannot see is in [`crate::detection`].

mod divergence;
mod following;
mod frozen;
mod innovation;

pub(crate) use divergence::DivergenceMonitor;
pub(crate) use following::FollowingMonitor;
pub(crate) use frozen::{FrozenMonitor, FrozenPaddle};
pub(crate) use innovation::InnovationGate;
