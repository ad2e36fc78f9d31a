//! The loop at work: the controller's and the plant's side of it, in lockstep or on the machine's clock.
//!
//! [`plant`] drives a [`World`](crate::world::World), [`controller`] answers with steps that an [`executor`] computes;
//! both wait for each other with a [`peer`], and close their [`accounts`] at the end.

pub mod accounts;
pub mod child;
pub mod clock;
pub mod controller;
pub mod durations;
pub mod error;
pub mod executor;
pub mod introduction;
pub mod ledger;
pub mod mode;
pub mod names;
pub mod peer;
pub mod periodic;
pub mod plant;
pub mod signals;
pub mod tick;
