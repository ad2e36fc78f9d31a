//! Placement in space: single paddles and pairs, at rest and along the insertion.

pub mod controllability;
pub mod discretised;
pub mod holding;
pub mod insertion;
mod refinement;
pub mod rest;
pub mod study;
pub mod uncertainty;
pub mod workflow;

pub use controllability::Controllability;
pub use discretised::{Discretised, SpaceErrorEstimate};
pub use insertion::InsertionModel;
pub use refinement::{SAFETY, distances};
pub use study::SpacePlacement;
pub use uncertainty::{SecondPaddle, Uncertain};
pub use workflow::SpaceStudy;
