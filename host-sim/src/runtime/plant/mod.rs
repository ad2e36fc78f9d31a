//! The plant's side of the loop.

pub mod free_run;
pub mod lockstep;
