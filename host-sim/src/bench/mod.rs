//! What is tried and measured: strategies and whole comparisons, faults, timing, stability, tables, boards.

pub mod board;
pub mod bound;
pub mod causes;
pub mod comparison;
pub mod describe;
pub mod error;
pub mod faults;
mod forecast;
pub mod in_process;
pub mod in_space;
pub mod insertion;
pub mod loop_stability;
pub mod paper_table;
pub mod progress;
pub mod result;
pub mod rounds;
pub mod space_bodies;
pub mod strategy;
pub mod study_failure;
pub mod table_tissue;
pub mod tables;
pub mod timing;
pub mod usage;
pub mod worlds;
