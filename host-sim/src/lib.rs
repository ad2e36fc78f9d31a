//! Tissue, sensors and actuators in a process of their own, exchanging samples with the controller over shared memory.
//!
//! ```text
//! plant process                                    controller process
//! plant → sensors → ─── needle, paddle, target ──→ firmware::Controller
//!    ↑                  clock                             │
//! actuator ←──────────── command ─────────────────────────┘
//! ```
//!
//! Where to begin: [run simulations](guide::run_simulations), [check timing](guide::check_timing),
//! [precompute tables](model_offline::guide::precompute), [how it works](model_offline::guide::how_it_works).
//!
//! Two modes of time, never mixed: in [`lockstep`] it comes from the messages, and the same seed gives the same bytes;
//! in [`free_run`] both processes follow the machine's steady clock with absolute deadlines. Either way every tick is
//! [recorded](recorder) and every sample accounted for ([`handover`]). [`run`] puts it together, [`result`] is what
//! comes out.

pub mod board;
pub mod by_hand;
pub mod bytes;
pub mod child;
pub mod cli;
pub mod clock;
pub mod control;
pub mod controller;
pub mod core;
pub mod describe;
pub mod error;
pub mod export;
pub mod faults;
pub mod free_run;
pub mod guide;
pub mod handover;
pub mod interrupt;
pub mod link;
pub mod lockstep;
pub mod output;
pub mod paper;
pub mod peer;
pub mod plant;
pub mod recorder;
pub mod replay;
pub mod report;
pub mod result;
pub mod run;
pub mod sensors;
pub mod session;
pub mod stability;
pub mod statistics;
pub mod strategy;
pub mod summary;
pub mod timing;
pub mod tissue_solver;
pub mod view;
pub mod world;
