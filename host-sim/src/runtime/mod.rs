//! The loop at work: controller and plant processes, in lockstep or on the machine's clock.

pub mod accounts;
pub mod clock;
pub mod controller;
pub mod durations;
pub mod executor;
pub mod peer;
pub mod plant;
pub mod signals;
