//! Where the closed loop stops being stable: simulated beside the theory of [`firmware::stability`].
//!
//! Three questions, each answered by simulation with the controller's own law and, where there is one, by theory:
//! - [`cells`]: gain × delay × Jacobian error, for which the theory is exact;
//! - [`mismatch`]: a table without the inclusion on tissue with it, and the other way round, along the depth;
//! - [`rate_limit`]: limit cycles from rate limits with delay, which linear theory does not show.

pub mod cells;
pub mod mismatch;
pub mod rate_limit;

/// What a simulated loop does in the long run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behaviour {
    /// The error dies out.
    Settles,
    /// The error stays, bounded by the actuator's limits.
    Cycles,
    /// The error grows.
    Diverges,
}

impl Behaviour {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Settles => "settles",
            Self::Cycles => "cycles",
            Self::Diverges => "diverges",
        }
    }
}
