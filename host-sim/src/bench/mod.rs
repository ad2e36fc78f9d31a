//! What is tried and measured: strategies and whole runs, faults, timing, stability, boards.

pub mod board;
pub mod comparison;
pub mod describe;
pub mod faults;
pub mod result;
pub mod stability;
pub mod strategy;
pub mod timing;
