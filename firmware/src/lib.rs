//! Fixed-rate controller that holds a soft-tissue target still while a needle goes in.
//!
//! A needle goes into soft tissue and drags a target along. A paddle on the skin (in space: one or two) moves so that the displacement of
//! the target orthogonal to the needle axis stays 0 (model based stabilization of soft tissue targets, dynamic
//! paddle). What the tissue does is computed offline and comes as a [table](contract::Table); this crate reads
//! samples, checks them, and gives one paddle command per tick.
//!
//! The crate is `no_std`, allocates nothing, has no `unsafe` and no panic path, and computes in `f32` or `f64`. The
//! same code runs in the simulator and on the microcontroller.
//!
//! Where to begin: [precompute tables](../model_offline/guide/precompute/index.html),
//! [run simulations](../host_sim/guide/run_simulations/index.html), [check timing](../host_sim/guide/check_timing/index.html).
//!
//! # Modules
//! In the order of use; each uses only those above it, and `scalar` and `units`:
//!
//! 1. [`contract`]: frames, table format, codec, validation, errors: what others rely on.
//! 2. [`detection`]: what counts as a fault, each limit with its reason. [`schedule`]: absolute release times.
//! 3. Mathematics: [`law`], [`limits`], [`loop_stability`], [`observer`], [`table_lookup`].
//! 4. [`settings`] in physical units, checked once and turned into what a tick needs.
//! 5. [`inputs`]: streams, checks, monitors, supervisor, ledger: what is trusted.
//! 6. [`controller`]: one tick from inputs to command. [`io`] and [`serial`]: how a host or a board calls it.
//!
//! # Control law
//! With the needle depth z extrapolated by its velocity to the time when the command acts:
//!
//! ```text
//! feed-forward    f = path(z)                        table, cubic Hermite in depth
//! left over       m = Nᵀy − NᵀJ(z)·(u − f)           once per target sample; z, u: when y was measured
//! estimate        l, s ← observer(m)                 level and slope in depth of what the table leaves
//! feedback        NᵀJ·w = −(l + s·Δz), w along G     G = J⁺N, or the minimum-norm directions (NᵀJ)⁺
//! command         u ← towards f + w                  |u| ≤ u_max, |Δu| ≤ Δ_max on every tick, of each paddle
//! ```
//!
//! # Dimension and paddles
//! [`Table`], [`Controller`] and [`State`] have three numbers: the dimension of space D, the number N = D − 1 of directions
//! orthogonal to the needle, and the number of paddles P. They stand for one paddle in the plane unless said otherwise; a
//! [`SpatialTable`](contract::SpatialTable) is one in space. Frames have three components and two paddles whatever the
//! controller has.
//!
//! In the plane N is one unit vector n, and one paddle leaves the target's position along the needle alone (G = J⁻¹n). In space
//! two directions are to be held, each with an observer of its own, and what happens along the needle is left free
//! ([`Direction::default_in`]). Of two paddles, one that may go twice as far goes four times as far for the same effect
//! ([`law`]); what one cannot give because it is at its limit, the other gives as long as it can.
//!
//! Every paddle has its own stream of samples, limits and monitors. **If one of them is lost, both keep their positions**
//! (HOLD), and SAFE follows as it does for one: what the other alone could still control, the table does not say, and where
//! the lost one is, nobody knows. [`Faults::SECOND_PADDLE`] tells which.
//!
//! [`observer`] tells how sensor and table are weighed, and how [`Feedback::Harmonic`] adds a patient's breath to what is
//! removed: `NᵀJ·w = −(l + s·Δz + c(t))`. [`Feedback::Integral`] is the plain law, w ← w − g·G·e with
//! the error e = Nᵀy: no estimate, fewer instructions.
//!
//! The gain g, of an observer the largest, follows from the delay of the loop, see [`loop_stability`]; the limits and their anti-windup are in
//! [`limits`].
//!
//! # Symbols and units
//! | symbol | meaning | unit |
//! |---|---|---|
//! | z | needle depth | length of the scene |
//! | y | target displacement from rest | length |
//! | N | unit vectors orthogonal to the needle axis and each other, a column each; n in the plane | – |
//! | u | displacements of all paddles | length |
//! | w | what the feedback adds to the feed-forward | length |
//! | J | actuation Jacobian dy/du, of all paddles side by side | – |
//! | g | loop gain per target sample | – |
//! | d | delay of the loop | target samples |
//! | λ | eigenvalue of J·Ĵ⁻¹: true over assumed tissue; in space of (NᵀJ)·(NᵀĴ)⁺ | – |
//!
//! Times are nanoseconds (`_ns`) of one monotonic clock, speeds length per second.
//!
//! # Glossary
//! - **Sample**: one measurement in a frame, stamped with sequence number and the time of the measurement.
//! - **Tick**: one release of the loop. **Knot**: one depth of the table.
//! - **RUN, HOLD, SAFE**: the paddle is controlled; keeps its position until the reason is gone; keeps its position
//!   until somebody [re-arms](controller::State::rearm). See [`Faults`].
//! - **Adopt**: take the measured paddle position as the first command, so that starting moves nothing.
//!
//! # Example
//! ```
//! use firmware::contract::frames::TARGET_VISIBLE;
//! use firmware::{Controller, Inputs, Mode, NeedleSample, PaddleSample, Settings, State, TargetSample, decode};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Tissue that takes the target along by 2 % of the depth sideways; paddle number 3.
//! let table = decode::<f64, 2, 1, 1>(&std::fs::read("tests/planar.table")?)?;
//! // 1 kHz loop; target at 50 Hz, 20 ms old when it arrives.
//! let controller = Controller::new(&table, &Settings::new(1_000_000, 20_000_000, 20_000_000))?;
//! let mut state = State::new();
//!
//! // The needle goes in at 0.02 per second; the target stays where it is.
//! let mut paddle = [0.0; 3];
//! for tick in 0..1000 {
//!     let (sequence, time_ns) = (tick as u32, tick * 1_000_000);
//!     let depth = 2e-5 * tick as f64;
//!     let needle = NeedleSample { sequence, time_ns, depth, velocity: 0.02, ..Default::default() };
//!     let target = TargetSample { sequence, time_ns, flags: TARGET_VISIBLE, displacement: [0.0, -0.1 * depth, 0.0] };
//!     let measured = PaddleSample { sequence, time_ns, paddle_index: 3, displacement: paddle };
//!     let inputs = Inputs {
//!         tick,
//!         time_ns,
//!         needle: Some(needle),
//!         target: (tick % 20 == 0).then_some(target),
//!         paddles: [Some(measured), None],
//!     };
//!     let command = controller.step(&mut state, &inputs);
//!     if command.is_valid() {
//!         [paddle, _] = command.displacement; // what an ideal actuator does until the next tick
//!     }
//! }
//! assert_eq!(state.mode(), Mode::Run);
//! // The feed-forward acts against the needle: the paddle has pushed by 2 % of the depth of 0.02, over J.
//! let pushed = 0.30 * paddle[0] + 0.05 * paddle[1];
//! assert!((pushed + 0.02 * 0.02).abs() < 1e-5);
//! # Ok(())
//! # }
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

#[cfg(test)]
extern crate std;

// In the order of use: a module uses only what stands above its group, or beside it.
pub mod scalar;
mod units;

pub mod contract;

pub mod detection;
pub mod schedule;

pub mod law;
pub mod limits;
pub mod loop_stability;
pub mod observer;
pub mod table_lookup;

pub mod settings;

pub mod inputs;

pub mod controller;
pub mod io;
pub mod serial;

pub use contract::{
    Faults, Mode, NeedleSample, PaddleCommand, PaddleSample, Table, TableError, TargetSample, decode, encode,
};
pub use controller::{Controller, State};
pub use inputs::{Discard, Inputs, Ledger, StreamLedger};
pub use io::{CommandSink, MonotonicClock, SampleSource, run_tick};
pub use law::{Direction, Feedback};
pub use limits::PositionLimit;
pub use scalar::{Scalar, ScalarKind};
pub use schedule::Schedule;
pub use settings::{Settings, SettingsError};
