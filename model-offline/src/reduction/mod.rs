//! What a simulator can afford at every tick: reduced models of a body whose only moving parts are the needle and one
//! paddle.
//!
//! - [`along_path`]: a body whose state depends on its past, near one insertion.
//! - [`condensed`]: the linear model, statically condensed onto needle, paddle and target. Exact for small depths.
//! - [`extrapolated`]: the full model, solved now and then: for simulated time, which can wait for a solve.
//! - [`online`]: the nonlinear model on a few displacement modes (proper orthogonal decomposition), its energy summed
//!   over a few weighted integration points (energy-conserving sampling and weighting, Farhat, Avery, Chapman & Cortial
//!   2014), with an error estimate at every step and a domain that it knows.
//! - [`tabulated`]: a body in space near one insertion: states with their first and second derivatives.
//! - [`mod@train`]: makes one from snapshots of the full model, and measures it on states that it was not trained on.

pub mod along_path;
pub mod condensed;
mod error;
pub mod extrapolated;
mod lifting;
mod nnls;
pub mod online;
mod snapshots;
mod space;
pub mod tabulated;
pub mod train;

pub use along_path::{AlongPath, PathBody, PathOptions};
pub use condensed::Condensed;
pub use extrapolated::Extrapolated;
pub use online::{Invalid, ReducedModel};
pub use tabulated::{Tabulated, TabulatedBody, TabulationError, TabulationOptions, TabulationReport};
pub use train::{TrainingError, TrainingOptions, TrainingReport, train};
