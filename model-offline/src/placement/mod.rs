//! Where to put the paddle: the actuation Jacobian d(target)/d(paddle), the controllability measure ‖J⁻¹n‖, the static
//! study, and the rankings for the static and the dynamic approach.

pub mod accuracy;
pub mod adaptive;
mod attaching;
mod condensed;
pub mod controllability;
pub mod cross_check;
mod curvature;
mod fields;
mod fixture;
mod goal_oriented;
pub mod hindrance;
pub mod reference;
pub mod rest;
pub mod space;
pub mod study;
pub mod verdict;
pub mod workflow;

pub use adaptive::discretise;
pub use study::{PaddleResult, Placement, PlacementOptions, StaticStudy, best_dynamic, place};
pub use workflow::{PlacementStudy, model_with_paddle};
