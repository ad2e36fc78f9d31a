//! What drives time, the steady clock, periodic loops on it, and how long everything took.

pub mod clock;
pub mod durations;
pub mod mode;
pub mod periodic;
