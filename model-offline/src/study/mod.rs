//! Studies of the methods themselves: which is fast, which is accurate, and where each stops working.

pub mod candidates;
pub mod effects;
mod extent;
pub mod fit;
pub mod insertion;
mod looks;
pub mod measurement;
pub mod pareto;
mod pareto_chart;
pub mod pareto_space;
pub mod slice;
pub mod stability;
pub mod sweep;

pub use extent::Extent;
