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
//! Two modes of time, never mixed: in [`lockstep`](runtime::plant::lockstep) it comes from the messages, and the same seed gives the same bytes;
//! in [`free_run`](runtime::plant::free_run) both processes follow the machine's steady clock with absolute deadlines. Either way every tick is
//! [recorded](record::recording) and every sample accounted for ([`accounts`](runtime::accounts)). [`comparison`](bench::comparison) puts it together, [`result`](bench::result) is what
//! comes out.

pub mod bench;
pub mod exchange;
pub mod guide;
pub mod record;
pub mod report;
pub mod runtime;
pub mod view;
pub mod world;

pub use bench::error::SimError;
