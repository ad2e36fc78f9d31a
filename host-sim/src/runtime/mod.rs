//! The loop at work: the controller's and the plant's side of it, in lockstep or on the machine's clock.
//!
//! [`plant`] drives a [`World`](crate::world::World), or a [`bridge`] stands for sensors and actuators outside;
//! [`controller`] answers with steps that an [`executor`] computes; both wait for each other with a [`peer`], follow messages or a clock ([`time`]), and close their accounts
//! ([`accounting`]) at the end.

pub mod accounting;
pub mod bridge;
pub mod controller;
pub mod error;
pub mod executor;
pub mod names;
pub mod peer;
pub mod plant;
pub mod signals;
pub mod time;
