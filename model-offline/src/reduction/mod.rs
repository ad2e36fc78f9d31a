//! Reduced models of a body whose only moving parts are the needle and one paddle: what a simulator can afford at every
//! tick.
//!
//! - [`condensed`]: the linear model, statically condensed onto needle, paddle and target. Exact for small depths.
//! - [`online`]: the nonlinear model on a few displacement modes (proper orthogonal decomposition), its energy summed
//!   over a few weighted integration points (energy-conserving sampling and weighting, Farhat, Avery, Chapman & Cortial
//!   2014), with an error estimate at every step and a domain that it knows.
//! - [`mod@train`]: makes one from snapshots of the full model, and measures it on states that it was not trained on.

pub mod condensed;
mod error;
mod lifting;
mod nnls;
pub mod online;
mod snapshots;
mod space;
pub mod train;

pub use condensed::Condensed;
pub use online::{Invalid, ReducedModel};
pub use train::{TrainingError, TrainingOptions, TrainingReport, train};
