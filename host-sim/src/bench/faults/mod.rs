//! Every fault of the catalogue, injected by name, with accounts from outside of the controller.
//!
//! Rows 1 to 32 run in lockstep on a [`closed_loop`] in virtual time: a [`tissue`] that is linear about the controller's own
//! table, the sensors and the actuator of the simulator, and a [`seam`] between sensors and controller where faults act.
//! Rows 33 to 45 need real processes. All of it is generic in the dimension of space and the number of paddles: in space every
//! fault of a paddle is tried on both, and rows 46 to 51 are of two paddles alone.
//!
//! Nothing that is checked comes from the controller's own word: the [`audit`] knows the fate of every sample, the
//! [`invariants`] are checked against every command, and the schedule's releases against plain arithmetic.

pub mod audit;
pub mod catalogue;
pub mod closed_loop;
pub mod evidence;
pub mod fault;
pub mod invariants;
pub mod monitors;
mod processes;
pub mod random;
pub mod report;
pub(crate) mod rows;
pub mod seam;
pub mod session;
pub mod shuttle;
pub mod tissue;
