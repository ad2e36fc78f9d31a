//! Studies of tables and of stability as CSV, as figures, and on one screen.

pub mod loop_stability;
pub mod loop_stability_chart;
pub mod tables;
pub mod worlds;
pub mod worlds_chart;
