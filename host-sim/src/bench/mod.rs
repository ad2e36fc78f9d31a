//! What is tried and measured: strategies and whole comparisons, faults, timing, stability, tables, boards.

pub mod board;
pub mod comparison;
pub mod describe;
pub mod error;
pub mod faults;
pub mod loop_stability;
pub mod paper_table;
pub mod result;
pub mod rounds;
pub mod strategy;
pub mod study_failure;
pub mod tables;
pub mod timing;
pub mod tissue_variant;
pub mod usage;
